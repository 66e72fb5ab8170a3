"""Allocation of an RV reducer evaluated by its exact contact, unit by unit."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from ...arrays import Array
from ...declarations import Value, Variable, number
from ...errors import Fault, ModelError
from ...models.inputs import Uniform
from ...models.rv_reducer import modification
from ...models.rv_reducer.population.lattice import nearest_prime
from ...models.rv_reducer.population.unit_basis import stem
from ...records import UnitsShown
from ...units import ARCMIN, MM
from ..declaration import Declaration, Interval
from ..interfaces import Accuracy, Comparison, Documented, Page, Variant, WithEffects
from ..machined import Machined
from ..rv_backlash.costs import DEFAULT_COSTS
from ..rv_backlash.machined_tolerances import TERMS
from ..settings import Bound, Settings, VariableSetting
from . import geometry
from .changed_measures import unruled
from .counterparts import changes_of, sentence
from .declared import DISC_TO_DISC, PARAMETERS, VARIABLES
from .evaluation import MEASURES, Evaluation, Populations, is_unit_statistic
from .inherited import changed, still_default
from .outputs import DEFAULT_LIMITS, DEFAULT_OBJECTIVES, OUTPUTS, SAMPLED, SAMPLED_UNDER_LOAD
from .promising import PromisingUnits
from .references import REFERENCES
from .refused import HOLD_INTERFERENCE, priceless, unlimited
from .shown import units_shown
from .sizes import size_faults
from .starts import nominal_of, starts_of
from .units import UnitModel
from .validity import validity
from .variants import variants

SEARCH, REPORT = 1, 2
"""Streams of random numbers of the two populations."""
MANY, ALONE = 512, 2048
"""Units of the sample that is searched on: for fronts, and for the optimum of one objective."""
LOADED_POSITIONS = 31
"""Positions of a turn at which units are solved under load at most: means over the turn need no
more."""
MOST_EVALUATIONS = 4
"""Most evaluations that are stored, so that a derivative costs no second evaluation."""
SAMPLED_OUTPUTS = frozenset((*SAMPLED, *SAMPLED_UNDER_LOAD))


def unpriced(parameters: Mapping[str, Value]) -> frozenset[str]:
    """Without the involute stage, its grade has no cost."""
    return frozenset() if parameters.get("involute_stage", True) else frozenset(["involute_grade"])


class RvReducer(PromisingUnits, Machined, Accuracy, Documented, Comparison, WithEffects, Page):
    """Tolerances of an RV reducer by exact contact of its units (default: RV-40E-121).

    A search sees a fixed population (`search_units` at `search_positions`); what is reported comes
    from fresh units. Variables, outputs and limits: docs/rv_reducer.md. Known answer: none.
    """

    declaration = Declaration(
        VARIABLES,
        OUTPUTS,
        PARAMETERS,
        costs=DEFAULT_COSTS,
        limits=DEFAULT_LIMITS,
        objectives=DEFAULT_OBJECTIVES,
        model="rv_batch",
        algorithm="exact",
        sampled=True,
        grain=8,
        performance=SAMPLED_OUTPUTS - HOLD_INTERFERENCE.keys() - {"yield_percent"},
        unpriced=unpriced,
        reference_ga={
            "population": 100,
            "generations": 80,
            "crossover": 0.9,
            "crossover_eta": 5.0,
            "mutation": 0.1,
            "mutation_eta": 10.0,
        },
    )
    machinable = frozenset(TERMS)
    _drawn_again = frozenset(("_searched", "_reported", "_recent", "_verdicts", "_mixed", "_promised_units"))

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        given = self.settings
        units = UnitModel.of(given.parameters, given.variables, given.propagation.coverage)
        change = changes_of(given.effects, units.geometry)
        lacking = unruled(MEASURES, SAMPLED_OUTPUTS, SAMPLED_UNDER_LOAD) if change.outside else []
        if lacking:
            raise ModelError(f"{', '.join(lacking)}: no rule says what effects do; add its kind to RULES")
        self.model = units.changed(change)

    def _completed(self, given: Settings) -> Settings:
        settings = super()._completed(given)
        if settings.parameters["involute_stage"]:
            return settings
        ratio = {"reduction_ratio": number(settings.parameters["cycloid_teeth"])}
        costs = {name: curve for name, curve in settings.costs.items() if name != "involute_grade"}
        return replace(settings, parameters={**settings.parameters, **ratio}, costs=costs)

    def _variable(self, variable: Variable, given: VariableSetting | None) -> VariableSetting:
        fixed = DISC_TO_DISC.get(variable.name)
        if variable.name == "involute_grade" and not self.given.parameters.get("involute_stage", True):
            fixed = variable.document
        given = given or VariableSetting()
        if fixed is not None and given.value is None and given.low is None and given.high is None:
            given = replace(given, value=fixed)
        return super()._variable(variable, given)

    # ---------------------------------------------------------------- populations

    def count(self, name: str) -> int:
        """A whole parameter."""
        return int(number(self.settings.parameters[name]))

    @cached_property
    def _searched(self) -> Populations:
        positions = self.count("search_positions") or self.count("positions")
        return self._drawn(positions, self._search_units, SEARCH)

    @property
    def _search_units(self) -> int:
        return self.count("search_units") or (ALONE if len(self.objectives) == 1 else MANY)

    @cached_property
    def _reported(self) -> Populations:
        return self._drawn(self.count("positions"), self.count("report_units"), REPORT)

    def _drawn(self, positions: int, units: int, stream: int) -> Populations:
        elastic = self.count("elastic_units")
        loaded = nearest_prime(min(positions, LOADED_POSITIONS), self.model.geometry)
        turning = self.count("te_positions")
        draw = partial(self.model.population, seed=self.settings.seed, stream=stream)
        return Populations(draw, ((positions, units), (loaded, elastic), (turning, elastic)))

    @cached_property
    def _recent(self) -> OrderedDict[bytes, Evaluation]:
        """The last evaluations on the search's population, by design."""
        return OrderedDict()

    def evaluation(self, design: Array, searching: bool) -> Evaluation:
        """A full design (all variables,) on one of the two populations."""
        if not searching:
            return self._fresh(design, self._reported)
        key = design.tobytes()
        if key not in self._recent:
            self._recent[key] = self._fresh(design, self._searched)
        self._recent.move_to_end(key)
        while len(self._recent) > MOST_EVALUATIONS:
            self._recent.popitem(last=False)
        return self._recent[key]

    def _fresh(self, design: Array, drawn: Populations) -> Evaluation:
        return Evaluation(self.model, drawn, *self.as_built(design))

    def as_built(self, design: Array) -> tuple[dict[str, float], dict[str, float]]:
        """Variables by name with the scatter of good parts, and the offsets of their means [um]."""
        effective = self.effective(design[None, :])[0]
        row = {v.name: float(effective[at]) for at, v in enumerate(VARIABLES)}
        means = {stem(name): float(mean[0]) for name, (_, mean) in self.as_made(design[None, :]).items()}
        return row, means

    def populations(self, searching: bool) -> Populations:
        """The population of searches, or that of reported points."""
        return self._searched if searching else self._reported

    # ---------------------------------------------------------------- evaluation

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        columns = {output.name: np.full(len(designs), np.nan) for output in self.outputs}
        if searching:
            return columns | self._statistics(designs, searching, self._sampled_outputs)
        return columns | self._statistics(designs, searching, SAMPLED_OUTPUTS, errors=True)

    def needed(self, designs: Array) -> dict[str, Array]:
        outputs = self._statistics(designs, searching=False, names=self._sampled_outputs)
        return outputs | self.promised_needs(designs)

    def _statistics(
        self, designs: Array, searching: bool, names: frozenset[str], errors: bool = False
    ) -> dict[str, Array]:
        """Sampled outputs (n,) of full designs, with their standard errors where asked for."""
        more = [f"{name}_error" for name in names] if errors else []
        columns = {name: np.empty(len(designs)) for name in ("phi_1_arcmin", *names, *more)}
        for at, design in enumerate(designs):
            evaluation = self.evaluation(design, searching)
            columns["phi_1_arcmin"][at] = evaluation.involute.mean
            for name in names:
                columns[name][at] = evaluation.value(name)
                if errors:
                    columns[f"{name}_error"][at] = evaluation.error(name)
        return columns | {"cost": self.cost_of(designs)} | self.profile(designs)

    @cached_property
    def _sampled_outputs(self) -> frozenset[str]:
        """Sampled outputs that a search needs."""
        return frozenset(filter(is_unit_statistic, self.required_outputs))

    def profile(self, designs: Array) -> dict[str, Array]:
        """Outputs of the tooth modification (n,) of full designs."""
        pair = (self.column(designs, "dr_rp_mm") * MM, self.column(designs, "dr_p_mm") * MM)
        nominal = self.model.geometry.nominal
        return {
            "radial_gap_mm": (pair[0] - pair[1]) / MM,
            "modification_backlash_arcmin": modification.modification_backlash(nominal, *pair) / ARCMIN,
        }

    def gradient(self, designs: Array) -> dict[str, Array]:
        names = self._sampled_outputs
        gradients = {name: np.zeros_like(designs) for name in names}
        by_mean = {
            name: {tolerance: np.zeros(len(designs)) for tolerance in self.machined_tolerances} for name in names
        }
        for at, design in enumerate(designs):
            evaluation = self.evaluation(design, searching=True)
            for name in names:
                slopes = evaluation.gradient(name)
                gradients[name][at] = [slopes.get(v.name, 0.0) for v in self.variables]
                for tolerance, slope in evaluation.by_mean(name).items():
                    by_mean[name][tolerance][at] = slope
        self.add_promised_slopes(designs, gradients, by_mean)
        return self.by_limits(designs, gradients, by_mean) | self._plain_slopes(designs)

    def _plain_slopes(self, designs: Array) -> dict[str, Array]:
        """Derivatives of cost and profile."""
        names = ("radial_gap_mm", "modification_backlash_arcmin")
        slopes = {name: np.zeros_like(designs) for name in names}
        nominal = self.model.geometry.nominal
        unit = 2.0 / nominal.lever / ARCMIN * MM
        by = (("dr_rp_mm", 1.0, unit), ("dr_p_mm", -1.0, -unit * nominal.flank))
        for name, gap, backlash in by:
            column = self.names.index(name)
            slopes["radial_gap_mm"][:, column] = gap
            slopes["modification_backlash_arcmin"][:, column] = backlash
        return slopes | {"cost": self.cost_slopes(designs)}

    def counterparts(self) -> tuple[str, ...]:
        return tuple(sentence(effect, self.model.geometry) for effect in self.settings.effects)

    # ---------------------------------------------------------------- what is known

    def references(self) -> dict[str, Array]:
        """The documents' allocations, which are those of the RV-40E-121 alone, without machines."""
        if self.machined_tolerances or changed(self.settings.parameters):
            return {}
        nominal = nominal_of(self)
        return {
            label: np.array([{**nominal, **design}[name] for name in self.names])
            for label, design in REFERENCES.items()
        }

    def starts(self) -> Array:
        """The tightest zones, and the document's, tighter and wider, each opened until the limit on
        interference is kept.
        """
        return self._starts.copy()

    @cached_property
    def _starts(self) -> Array:
        return starts_of(self)

    def least_cost(self) -> tuple[str, RvReducer]:
        """Least cost at the backlash limit, the documents' single objective."""
        most = number(self.settings.parameters["backlash_limit_arcmin"])
        stated = self.settings.limits.get("backlash_max_arcmin", Bound())
        limit = Bound(stated.low, min(stated.high, most))
        limits = dict(self.given.limits) | {"backlash_max_arcmin": limit}
        given = replace(self.given, objectives=("cost",), limits=limits)
        return f"GA, least cost at {limit.high:g} arcmin", RvReducer(given).coarser()

    def relaxed(self, limits: Mapping[str, Bound]) -> RvReducer:
        """With other limits, on the sample of a front: it is there for comparison."""
        given = dict(self.given.parameters) | {"search_units": min(MANY, self._search_units)}
        limits = dict(self.given.limits) | dict(limits)
        return RvReducer(replace(self.given, parameters=given, limits=limits))

    def coarser(self) -> RvReducer:
        """On at most 256 units at 31 positions, which no result of the search is tested on."""
        positions = nearest_prime(min(31, self.count("positions")), self.model.geometry)
        small = {"search_units": min(256, self._search_units), "search_positions": positions}
        return RvReducer(replace(self.given, parameters=dict(self.given.parameters) | small))

    def interval(self, output: str) -> Interval:
        """Proven bounds: no unit has less backlash than its involute stage."""
        if output == "cost":
            return self._cost_interval
        if output in ("backlash_max_arcmin", "backlash_mean_arcmin") and not self._stretched:
            return self._least_backlash + self.model.change.effective, np.inf
        return super().interval(output)

    @property
    def _stretched(self) -> bool:
        """Whether an effect makes units scatter more about their mean: no bound is proven then."""
        return self.model.change.growth != 0.0

    @cached_property
    def _least_backlash(self) -> float:
        """Quantile of phi_1 alone at the finest grade [arcmin]."""
        alone = self.model.involute(super().interval("involute_grade")[0])
        at = self.model.planet.quantile(np.array([self.settings.propagation.coverage]))
        return alone.middle + alone.half * float(at[0])

    def faults(self) -> list[Fault]:
        ends = {name: super(RvReducer, self).interval(name) for name in ("dr_rp_mm", "dr_p_mm")}
        return [
            *geometry.faults(self.model.geometry, self.given, ends),
            *priceless({variable.name for variable in self.free}, self.settings.costs),
            *(size_faults(self.count, MOST_EVALUATIONS) or super().faults()),
        ]

    def search_faults(self) -> list[Fault]:
        return unlimited(self.settings.limits, self.settings.parameters)

    def warnings(self) -> tuple[str, ...]:
        given = self.settings
        gap = given.limits.get("radial_gap_mm", Bound())
        odd = geometry.warnings(self.model.geometry, given.parameters, gap)
        return (*still_default(self.given, given.parameters), *odd)

    # ---------------------------------------------------------------- what a reader is shown

    def title(self) -> str:
        if name := super().title():
            return name
        nominal = self.model.geometry.nominal
        kind = "RV reducer" if self.settings.parameters["involute_stage"] else "Cycloidal reducer"
        teeth = f"{nominal.cycloid_teeth} teeth on {nominal.pins} pins"
        return f"{kind}, {teeth}: allocation on the exact contact"

    def validity(self) -> tuple[str, ...]:
        given = [setting.distribution for setting in self.settings.variables.values()]
        return validity(self.settings.parameters, all(d is None or isinstance(d, Uniform) for d in given))

    def shown_limit(self) -> tuple[str, float] | None:
        return "backlash_max_arcmin", number(self.settings.parameters["backlash_limit_arcmin"])

    def shown_units(self, design: Array) -> UnitsShown | None:
        evaluation = self.evaluation(design, searching=False)
        return units_shown(evaluation, self.settings.parameters)

    def variants(self) -> tuple[Variant, ...]:
        return variants(self)
