"""Allocation of an RV reducer evaluated by its exact contact, unit by unit."""

from __future__ import annotations

import copy
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...errors import Fault, ModelError
from ...models.cost_reading import times
from ...models.effects.measurements import Active
from ...models.effects.temperature_time import DifferentialThermalExpansion
from ...models.inputs import Normal, Uniform
from ...models.rv_reducer import geometry as modification
from ...models.rv_reducer.cycloid import pin_circle_growth
from ...models.rv_reducer.geometry import RvGeometry
from ...models.rv_reducer.population.errors import nearest_prime
from ...models.rv_reducer.population.units import GEARS, ONE_WAVE, WHITE, Involute, pitch_spectrum, stem
from ...records import UnitsShown
from ...section import Array, Assumption, Section, Value, Variable, number
from ...units import ARCMIN, MM, UM
from ..declaration import ConfiguredProblem, Declaration, Interval
from ..machined import Machined
from ..rv_backlash.matching import refuse_alone, refuse_rotation
from ..rv_backlash.problem import DEFAULT_COSTS
from ..rv_backlash.shift import TERMS
from ..settings import Bound, Settings, VariableSetting
from ..tolerance_problem import Variant
from . import declared
from .counterparts import Change, changes_of, outputs_without_rule, sentence, worn
from .declared import (
    ALLOWANCES,
    DEFAULT_LIMITS,
    DEFAULT_OBJECTIVES,
    DISC_TO_DISC,
    FLANK_CLEARANCE,
    HOLD_INTERFERENCE,
    MEASURES,
    OF_COUPLING,
    OF_JAM,
    OF_SORTING,
    OF_THE_STAGE,
    OUTPUTS,
    PARAMETERS,
    REFERENCES,
    SAMPLED,
    SAMPLED_UNDER_LOAD,
    SORTING,
    UNLISTED,
    VARIABLES,
    changed_geometry_parameters,
    default_values_sentence,
    is_unit_statistic,
    size_faults,
    unlimited_interference_faults,
    unpriced_error_faults,
    with_cranks,
    with_sorting,
    with_thickness,
)
from .evaluation import STEP_OF_GRADE, Evaluation, Populations, UnitModel, classes_of, unit_tables
from .promising import PromisingUnits

if TYPE_CHECKING:
    import pandas as pd

    from .bound import CommonErrorBound

# Designs of `rv_reducer` that a search by gradients begins from.


FACTORS = (0.0, 0.7, 1.0, 1.4)
"""Zones over those of the document; 0: the tightest of the search ranges."""
HALVINGS = 12
"""Steps of the bisection for the equidistance modification."""
USUAL = 0.02
"""Probability of interference that is the target where no limit is set."""


def nominal_of(problem: RvReducer) -> dict[str, float]:
    """The document's value of every variable; errors between discs as the problem fixes them."""
    values = {v.name: float(v.document or 0.0) for v in problem.variables}
    return values | {name: problem.fixed[name] for name in UNLISTED if name in problem.fixed}


def starts_of(problem: RvReducer) -> Array:
    """The tightest zones, and the document's, tighter and wider: full designs (k, all variables).

    Each is opened until the limit on interference is kept.
    """
    names, nominal, rows = problem.names, nominal_of(problem), []
    zones = [names.index(v.name) for v in problem.variables if v.name.endswith("_um")]
    for factor in FACTORS:
        row = np.array([nominal[name] for name in names])
        row[names.index("dr_p_mm")] *= _modification_ratio(problem)
        row[zones] *= factor
        rows.append(_centre_interference(problem, _clip_to_ranges(problem, row)))
    return np.array(rows)


def _modification_ratio(problem: RvReducer) -> float:
    """Ratio of shift modifications that leave the same radial gap, to the RV-40E's."""
    return (1.0 - RvGeometry().flank) / (1.0 - problem.model.geometry.nominal.flank)


def _clip_to_ranges(problem: RvReducer, row: Array) -> Array:
    """A full design within the search ranges, at the fixed values."""
    free = [problem.names.index(v.name) for v in problem.free]
    return np.asarray(problem.complete(np.clip(row[free], problem.xl, problem.xu)[None, :])[0])


def _centre_interference(problem: RvReducer, row: Array) -> Array:
    """The design with the equidistance modification at which interference is in its middle.

    The middle is half of the limit on its probability, `USUAL` where there is none.
    """
    at = problem.names.index("dr_rp_mm")
    bound = problem.settings.limits.get("interference_probability", Bound())
    wanted = 0.5 * bound.high if bound.high < 1.0 else USUAL
    low, high = problem.interval("dr_rp_mm")
    for _ in range(HALVINGS if low < high else 0):
        row[at] = 0.5 * (low + high)
        interferes = problem.evaluation(row, searching=True).value("interference_probability")
        low, high = (row[at], high) if interferes > wanted else (low, row[at])
    return row


# Discs that jam because they are warmer than the housing.


JAM_UNITS, JAM_POSITIONS = 16, 31
"""Units without errors, and positions of a turn, that are tested for a jam."""
HOTTEST = 500.0
"""Difference of temperature [K] up to which a jam is sought."""


def jam_faults(problem: RvReducer, effects: Iterable[Active]) -> list[Fault]:
    """A fault where expansion closes even the most open profile without errors, with the temperature."""
    effects = tuple(effects)
    warmer = sum(active.values.get("temperature_difference_K", 0.0) for active in effects)
    if warmer <= 0.0 or problem.settings.parameters["allow_interference"]:
        return []
    model = problem.model
    per_kelvin = float(pin_circle_growth(model.geometry.nominal, np.array(1.0), np.array(0.0))) / UM
    drawn = model.population(nearest_prime(JAM_POSITIONS, model.geometry), JAM_UNITS, 0, REPORT)
    row = {name: problem.interval(name)[0] for name in problem.names if name == "involute_grade"}
    clearance = problem.interval("crank_bearing_um")[1]
    row |= {v.name: 0.0 for v in VARIABLES if v.name != "involute_grade"}
    row |= {"dr_rp_mm": problem.interval("dr_rp_mm")[1], "dr_p_mm": problem.interval("dr_p_mm")[0]}

    def play(difference: float) -> float:
        moved = {"pin_circle_radius": per_kelvin * (difference - warmer), "crank_bearing": clearance}
        return float(drawn.turn(model.design(row, moved)).play.mean(axis=0).max())

    if play(warmer) >= 0.0:
        return []
    at = scipy.optimize.brentq(play, -HOTTEST, warmer, xtol=0.01) if play(-HOTTEST) > 0.0 else -HOTTEST
    place = next(n for n, a in enumerate(effects) if a.values.get("temperature_difference_K", 0.0) > 0.0)
    text = (
        f"the discs jam: {warmer:g} K warmer than the housing they fill the pin circle; even the most open profile of "
        f"the search ranges, without errors, has no backlash from {at:.3g} K on; lower the temperature, open the "
        "profile (dr_rp_mm, dr_p_mm), or set parameters.allow_interference = true"
    )
    return [Fault(f"effect[{place}]", text)]


# Limits of validity of the units of `rv_reducer`.


def validity(parameters: Mapping[str, Value], uniform: bool, change: Change, sorted_pins: bool) -> tuple[str, ...]:
    """A sentence for each; `uniform`: every error is uniform over its zone; `change`: what effects change;
    `sorted_pins`: pins are fitted to units.
    """
    may_couple = not declared.planet_faults({**parameters, "planet_coupling": True}, sorted_pins)
    zones = "Every error is uniform over its zone: skewed or centred processes give other fractions."
    given = "Distributions are those of the configuration, the same for all parts of a kind."
    left_out = [*([] if change.circle else ["temperature"]), *([] if change.wear else ["wear"])]
    stage = (
        "The clearances of the planets are centred on each other, and the runout of the involute stage is not "
        "followed along the turn: phi_1 is a single number per unit.",
        "phi_1 does not depend on the torque.",
        "Two cranks turn apart within the play of rigid bearings at true distances, phi_1 taken as independent of how "
        "far; interference and outputs under load are of cranks that the tighter planet holds."
        if parameters["planet_coupling"]
        else "The tighter planet holds all cranks: cranks that turn apart are left out"
        + (" (planet_coupling)." if may_couple else "."),
    )
    return (
        zones if uniform else given,
        "Pitch error and runout of a disc are waves with one period per turn of the disc."
        if pitch_spectrum(parameters) == ONE_WAVE
        else "The runout of a disc is a wave with one period per turn of the disc; its pitch errors are those of "
        "pitch_spectrum.",
        *(stage if parameters["involute_stage"] else ()),
        "Friction is in running_torque_Nm alone, between teeth and pins that do not turn: that of bearings, seals and "
        "lubricant is not in it.",
        *([f"No {', no '.join(left_out)}."] if left_out else []),
        *_of_bearings(parameters),
        "A pin circle that is offset does not centre itself under load: likely pessimistic.",
        "Stiffnesses (contact and series) are assumed; lost motion, transmission error, preload and pin force follow "
        + (
            "from them, and with over_constraint backlash and jam force as well."
            if parameters["over_constraint"]
            else "from them, backlash does not."
        ),
    )


def _of_bearings(parameters: Mapping[str, Value]) -> Iterator[str]:
    """What is left out of crank bearings and their distances."""
    factor = number(parameters["bearing_play_factor"])
    if parameters["over_constraint"]:
        yield f"Play of the crank bearings counts {factor:g} times, at the places where discs rest without load."
        preload = parameters["interference"] == "preload"
        rigid, loaded = ("and ", "and interference ") if preload else ("interference and ", "")
        yield (
            f"Wrong distances of the cranks act on backlash, {rigid}jam force; outputs under load "
            f"{loaded}are of bearings at true distances, and the jam force is without what squeezed pins add."
        )
        return
    if factor == 1.0:
        yield (
            "Play of the crank bearings acts about the centre of the disc only; along the load of the bearing it "
            "counts about 1.12 times (bearing_play_factor)."
        )
    else:
        yield f"Play of the crank bearings counts {factor:g} times its turn about the centre of the disc everywhere."
    yield (
        "Cranks have the distances of their bores: wrong distances, which take up play or jam, are left out "
        "(over_constraint)."
    )


# The assumptions of `rv_reducer` that no document settles, changed one at a time.


VARIANT_SETTINGS = {"report_units": 64}
"""Fresh units of a problem that is searched and not reported."""
SHARES = {
    "share_pins": ("share of the variance of pins and holes common to a unit", (0.0, 0.5, 1.0)),
    "share_discs": ("share of the variance of the discs common to a unit", (0.0, 0.5, 1.0)),
    "planet_share": ("share of the variance of the planets' clearances common to a unit", (0.0, 1.0)),
}
PARTS_OF_A_LAW, UNITS_MEASURED = 50, 30
"""Parts of a kind that show the shape of its law, and units whose measurement shows the size of an error [assumed]."""
WRONG_COSTS = 4
"""Seed of the patterns of wrong costs."""
WARMER_K, OWN_THICKNESS, MANY_POSITIONS = 1.0, 5.0, 1021
"""Values that are tried: difference of temperature, half-width of tooth thickness [um], positions of a turn."""
ALONG_ITS_LOAD = 1.12
"""Turn of a disc by the play of its bearings over that about its centre, by the statics of discs with play."""
COUNTED = ("turn_mean", "share_of_turn", "overlap")
"""Definitions of interference that rigid units show."""


def variants(problem: RvReducer) -> tuple[Variant, ...]:
    """The problem as it is, then with one assumption changed at a time."""
    same = Variant("as it is", "", _with_parameters(problem))
    usual = (same, *_fractions(problem), *_interference(problem), *_disc_to_disc(problem))
    return (*usual, *_further(problem)) if problem.settings.parameters["assumptions"] == "all" else usual


def _with_parameters(problem: RvReducer, **parameters: Value) -> RvReducer:
    given = problem.given
    return type(problem)(replace(given, parameters={**given.parameters, **VARIANT_SETTINGS, **parameters}))


def _with_variables(problem: RvReducer, changed: Mapping[str, VariableSetting]) -> RvReducer:
    given = _with_parameters(problem).given
    return type(problem)(replace(given, variables={**given.variables, **changed}))


def _further(problem: RvReducer) -> Iterator[Variant]:
    """Laws, errors between discs, temperature, tooth thickness, stiffness and positions."""
    settings = problem.settings
    laws = {
        v.name: replace(problem.given.variables.get(v.name, VariableSetting()), distribution=Normal())
        for v in problem.variables
        if v.random and isinstance(settings.variables[v.name].distribution or Uniform(), Uniform)
    }
    if laws and problem.model.sorting is None and not problem.machined_tolerances:
        each = len(laws) * PARTS_OF_A_LAW
        yield Variant("law of uniform errors", "normal, t = 3 sigma", _with_variables(problem, laws), each, True)
    for name in DISC_TO_DISC:
        for factor in (0.5, 2.0) if problem.fixed.get(name, 0.0) > 0.0 else ():
            fixed = {name: VariableSetting(value=factor * problem.fixed[name])}
            yield Variant(name, f"{factor:g} times", _with_variables(problem, fixed), UNITS_MEASURED)
    if problem.model.sorting is None and not settings.effects:
        effect = Active(DifferentialThermalExpansion(), {"temperature_difference_K": WARMER_K})
        given = _with_parameters(problem).given
        warm = type(problem)(replace(given, effects=(effect,)))
        yield Variant("discs warmer than the housing", f"{WARMER_K:g} K", warm, UNITS_MEASURED)
    if settings.parameters["involute_stage"] and not any(name in ALLOWANCES for name in problem.names):
        apart = {name: VariableSetting(value=OWN_THICKNESS) for name in ALLOWANCES}
        text = f"of its own: allowance 20 um, +-{OWN_THICKNESS:g} um, at the best grade"
        yield Variant("tooth thickness of sun and planets", text, _with_variables(problem, apart), 0, True)
    if pitch_spectrum(settings.parameters) == ONE_WAVE:
        white = _with_parameters(problem, pitch_spectrum={WHITE: 1.0})
        yield Variant("pitch spectrum of the discs", "white, from tooth to tooth", white, UNITS_MEASURED)
    if any(limit.name.startswith("lost_motion") for limit in problem.limits):
        for name in ("normal_stiffness_N_per_mm", "series_stiffness_Nm_per_arcmin"):
            for factor in (0.5, 2.0):
                changed = _with_parameters(problem, **{name: factor * number(settings.parameters[name])})
                yield Variant(name, f"{factor:g} times", changed, UNITS_MEASURED)
    coupled = _with_parameters(problem, planet_coupling=True)
    known = not declared.planet_faults(coupled.settings.parameters, problem.model.sorting is not None)
    if known and not settings.parameters["planet_coupling"]:
        yield Variant("planets coupled through two cranks", "counted", coupled)
    if not settings.parameters["over_constraint"]:
        text = f"counted, crank holes of the carrier within +-{UNLISTED['crank_hole_um']:g} um"
        wrong = _with_parameters(problem, over_constraint=True, planet_coupling=False)
        asked = (*wrong.objectives, *(limit.name for limit in wrong.limits))
        unknown = declared.distance_faults(wrong.given, asked)
        if not any((*declared.coupling_faults(wrong.model.geometry, wrong.model.coupling), *unknown)):
            yield Variant("distances of cranks", text, wrong, UNITS_MEASURED)
    if settings.parameters["bearing_play_factor"] == 1.0:
        along = _with_parameters(problem, bearing_play_factor=ALONG_ITS_LOAD)
        yield Variant("play of crank bearings along its load", f"{ALONG_ITS_LOAD:g} times", along)
    for number_of, signs in enumerate(np.random.default_rng(WRONG_COSTS).choice([0.5, 2.0], (2, len(settings.costs)))):
        for factors in (signs, 1.0 / signs):
            curves = {
                name: times(curve, factor)
                for (name, curve), factor in zip(settings.costs.items(), factors.tolist(), strict=True)
            }
            given = _with_parameters(problem).given
            wrong = type(problem)(replace(given, costs={**given.costs, **curves}))
            label = (
                f"every curve 2 times too high or too low, pattern {number_of + 1}{'a' if factors is signs else 'b'}"
            )
            yield Variant("loss of an allocation by wrong costs", label, wrong, true_costs=True)
    finer = nearest_prime(MANY_POSITIONS, problem.model.geometry)
    yield Variant("positions of a turn", f"{finer}", _with_parameters(problem, positions=finer, search_positions=finer))


def _fractions(problem: RvReducer) -> Iterator[Variant]:
    parameters = problem.settings.parameters
    for name, (words, values) in SHARES.items():
        for value in values:
            if name in parameters and parameters[name] != value:
                yield Variant(words, f"{value:g}", _with_parameters(problem, **{name: value}))


def _interference(problem: RvReducer) -> Iterator[Variant]:
    """Other definitions, with the same limit on their probability."""
    parameters = problem.settings.parameters
    bound = problem.settings.limits.get("interference_probability", Bound())
    if not bound.high < 1.0:
        return
    for kind in COUNTED:
        if kind != parameters["interference"]:
            more = f", beyond {parameters['overlap_arcmin']:g} arcmin" if kind == "overlap" else ""
            words = f"{kind.replace('_', ' ')}{more}, in at most {100.0 * bound.high:g} %"
            yield Variant("what counts as interference", words, _with_parameters(problem, interference=kind))


def _disc_to_disc(problem: RvReducer) -> Iterator[Variant]:
    """Without the errors between discs, where they are fixed at other values."""
    fixed = [name for name in DISC_TO_DISC if problem.fixed.get(name, 0.0) > 0.0]
    if len(fixed) < len(DISC_TO_DISC):
        return
    changed = _with_variables(problem, {name: VariableSetting(value=0.0) for name in fixed})
    yield Variant("errors between discs (pin circle, bores, journals)", "0", changed)


SEARCH, REPORT = 1, 2
"""Streams of random numbers of the two populations."""
MANY, ALONE = 512, 2048
"""Units of the sample that is searched on: for fronts, and for the optimum of one objective."""
LOADED_POSITIONS = 31
"""Positions of a turn at which units are solved under load at most: means over the turn need no
more."""
MAX_CACHED_EVALUATIONS = 2
"""Most evaluations that are stored, so that a derivative costs no second evaluation."""
MAX_KNOWN_DESIGNS = 1024
"""Most designs whose outputs are stored: corners of the box and roundings are asked for again and again."""
SAMPLED_OUTPUTS = frozenset((*SAMPLED, *SAMPLED_UNDER_LOAD))


def _refuse_uncoupled(top: Section) -> None:
    """A fault for everything that belongs to discs on all of their cranks, where these are not asked for."""
    text = "changes nothing: state parameters.over_constraint = true, or leave it out"
    names = {
        "parameters": [parameter.name for parameter in OF_COUPLING],
        "variables": ["crank_hole_um"],
        "costs": ["crank_hole_um"],
        "limits": [output.name for output in OF_JAM],
    }
    for table, keys in names.items():
        section = top.section(table)
        for name in keys:
            if name in section and section.take(name) is not None:
                section.fault(name, text)


def unpriced(parameters: Mapping[str, Value]) -> frozenset[str]:
    """Without the involute stage, its grade has no cost."""
    return frozenset() if parameters.get("involute_stage", True) else frozenset(["involute_grade"])


class RvReducer(PromisingUnits, Machined):
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
        priceable=frozenset(UNLISTED),
        performance=SAMPLED_OUTPUTS - HOLD_INTERFERENCE.keys() - {"yield_percent"},
        unpriced=unpriced,
        unconditional=frozenset(["cost", "radial_gap_mm", "modification_backlash_arcmin"]),
        operation={"hours": ("hours",), "torque_Nm": ("load_torque_Nm", "te_torque_Nm")},
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
    _of_searches = frozenset(("_searched", "_recent", "_finer"))
    _drawn_again = _of_searches | {"_reported", "_known", "_verdicts", "_mixed", "_promised_units"}

    _fresh_alone = False
    """Whether searches see the units that reported points are tested on."""

    def __init__(self, settings: Settings | None = None) -> None:
        self.declaration = with_thickness(type(self).declaration, settings.variables if settings else ())
        self.declaration = with_sorting(self.declaration, settings.parameters if settings else ())
        coupled = settings is not None and settings.parameters.get("over_constraint") is True
        self.declaration = with_cranks(self.declaration, coupled)
        super().__init__(settings)
        given = self.settings
        units = UnitModel.of(given.parameters, given.variables, given.propagation.coverage)
        hours = number(given.parameters["hours"])
        change = changes_of(given.effects, units.geometry) + worn(given.parameters, hours)
        lacking = outputs_without_rule(MEASURES, SAMPLED_OUTPUTS, SAMPLED_UNDER_LOAD) if change.outside else []
        if lacking:
            raise ModelError(f"{', '.join(lacking)}: no rule says what effects do; add its kind to RULES")
        self.model = units.changed(change)

    @classmethod
    def configured(cls, top: Section) -> ConfiguredProblem | None:
        """Thickness of teeth and classes of pins are declared where they are stated; alone, what belongs to them
        changes nothing.
        """
        configured, parameters = super().configured(top), top.section("parameters")
        stated = [name for name in ALLOWANCES if name in top.section("variables")]
        for name in stated:
            table = top.section("variables").section(name)
            if not any(key in table for key in ("value", "low", "high", "limits")):
                table.fault("", "states nothing: give its value, or low and high")
        for name, parameter in ALLOWANCES.items():
            if name not in stated and parameters.take(parameter.name) is not None:
                parameters.fault(
                    parameter.name,
                    f"changes nothing: state variables.{name} (value, or low and high), or leave it out; the thickness "
                    "of the teeth follows their grade",
                )
        if configured is None:
            return None
        refuse_rotation(top.section("variables"))
        refuse_alone(parameters, [parameter.name for parameter in SORTING[1:]])
        declaration = with_sorting(with_thickness(configured.declaration, stated), parameters.all_keys())
        coupled = parameters.take("over_constraint") is True
        declaration = with_cranks(declaration, coupled)
        if not coupled:
            _refuse_uncoupled(top)
        return replace(configured, declaration=declaration)

    def _completed(self, given: Settings) -> Settings:
        settings = super()._completed(given)
        if settings.parameters["involute_stage"]:
            return settings
        ratio = {"reduction_ratio": number(settings.parameters["cycloid_teeth"])}
        costs = {name: curve for name, curve in settings.costs.items() if name != "involute_grade"}
        return replace(settings, parameters={**settings.parameters, **ratio}, costs=costs)

    def assumptions(self) -> tuple[Assumption, ...]:
        """Of a reducer without an involute stage, nothing of that stage is assumed."""
        every = super().assumptions()
        if self.settings.parameters["involute_stage"]:
            return every
        return tuple(one for one in every if not {*one.name.split(".")} & {*OF_THE_STAGE})

    def _variable(self, variable: Variable, given: VariableSetting | None) -> VariableSetting:
        fixed = UNLISTED.get(variable.name)
        if variable.name == "involute_grade" and not self.given.parameters.get("involute_stage", True):
            fixed = variable.document
        if variable.name == "pin_radius_um" and (sorting := classes_of(self._with_defaults_of_sorting)):
            given, fixed = VariableSetting(), 0.5 * sorting.classes * sorting.width
        given = given or VariableSetting()
        if fixed is not None and given.value is None and given.low is None and given.high is None:
            given = replace(given, value=fixed)
        return super()._variable(variable, given)

    @property
    def _with_defaults_of_sorting(self) -> dict[str, Value]:
        """The parameters that are given, with those of classes of pins where their number is."""
        given = self.given.parameters
        defaults = {p.name: p.default for p in SORTING} if SORTING[0].name in given else {}
        return {**defaults, **given}

    # ---------------------------------------------------------------- populations

    def count(self, name: str) -> int:
        """A whole parameter."""
        return int(number(self.settings.parameters[name]))

    @cached_property
    def _searched(self) -> Populations:
        if self._fresh_alone:
            return self._reported
        positions = self.count("search_positions") or self.count("positions")
        return self._drawn(positions, self._search_units, SEARCH)

    @property
    def _search_units(self) -> int:
        return self.count("search_units") or (ALONE if len(self.objectives) == 1 else MANY)

    def sample_sizes(self) -> Mapping[str, Value]:
        return {"search_units": self._search_units}

    def quantile_units(self) -> Mapping[str, int]:
        loaded = any(name in declared.LOADED for name in self.required_outputs)
        counted = ("report_units", "elastic_units") if loaded else ("report_units",)
        return {f"parameters.{name}": self.count(name) for name in counted}

    @cached_property
    def _reported(self) -> Populations:
        return self._drawn(self.count("positions"), self.count("report_units"), REPORT)

    def _drawn(self, positions: int, units: int, stream: int) -> Populations:
        elastic = self.count("elastic_units")
        loaded = nearest_prime(min(positions, LOADED_POSITIONS), self.model.geometry)
        turning = self.count("te_positions")
        draw = partial(self.model.population, seed=self.settings.seed, stream=stream)
        return Populations(draw, ((positions, units), (loaded, elastic), (turning, elastic)), stream == REPORT)

    @cached_property
    def _recent(self) -> OrderedDict[bytes, Evaluation]:
        """The last evaluations on the search's population, by design."""
        return OrderedDict()

    @cached_property
    def _known(self) -> OrderedDict[tuple[bytes, bool, tuple[str, ...]], list[float]]:
        """Outputs of the last designs, by design, population and names."""
        return OrderedDict()

    def evaluation(self, design: Array, searching: bool) -> Evaluation:
        """A full design (all variables,) on one of the two populations."""
        if not searching:
            return self._fresh(design, self._reported)
        key = design.tobytes()
        if key not in self._recent:
            self._recent[key] = self._fresh(design, self._searched)
        self._recent.move_to_end(key)
        while len(self._recent) > MAX_CACHED_EVALUATIONS:
            self._recent.popitem(last=False)
        return self._recent[key]

    def _fresh(self, design: Array, drawn: Populations) -> Evaluation:
        return Evaluation(self.model, drawn, *self.as_built(design))

    def as_built(self, design: Array) -> tuple[dict[str, float], dict[str, float]]:
        """Variables by name with the scatter of good parts, and the offsets of their means [um]."""
        effective = self.effective(design[None, :])[0]
        row = {v.name: float(effective[at]) for at, v in enumerate(self.variables) if not v.labels}
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
        jam = OF_JAM if self.model.coupling is not None else ()
        names = SAMPLED_OUTPUTS | {output.name for output in jam}
        return columns | self._statistics(designs, searching, names, errors=True)

    def needed(self, designs: Array) -> dict[str, Array]:
        outputs = self._statistics(designs, searching=False, names=self._sampled_outputs)
        return outputs | self.promised_needs(designs)

    def _statistics(
        self, designs: Array, searching: bool, names: frozenset[str], errors: bool = False
    ) -> dict[str, Array]:
        """Sampled outputs (n,) of full designs, with their standard errors where asked for."""
        more = [f"{name}_error" for name in names] if errors else []
        columns = {name: np.empty(len(designs)) for name in ("phi_1_arcmin", *names, *more)}
        if self.model.sorting is not None:
            columns |= {output.name: np.full(len(designs), np.nan) for output in OF_SORTING}
        for at, design in enumerate(designs):
            key = design.tobytes(), searching, tuple(columns)
            if key in self._known:
                for column, value in zip(columns.values(), self._known[key], strict=True):
                    column[at] = value
                continue
            evaluation = self.evaluation(design, searching)
            if self.model.sorting is not None and not searching:
                self._add_sorting(columns, at, design, evaluation)
            columns["phi_1_arcmin"][at] = evaluation.involute.mean
            for name in names:
                columns[name][at] = evaluation.value(name)
                if errors:
                    columns[f"{name}_error"][at] = evaluation.error(name)
            self._known[key] = [float(column[at]) for column in columns.values()]
            if len(self._known) > MAX_KNOWN_DESIGNS:
                self._known.popitem(last=False)
        return columns | {"cost": self.cost_of(designs)} | self.profile(designs)

    def _add_sorting(self, columns: dict[str, Array], at: int, design: Array, evaluation: Evaluation) -> None:
        """Pins left over, of classes that are made in equal numbers, and the cost of a good unit."""
        fitted, sorting = evaluation.turn.fitted, self.model.sorting
        assert fitted is not None and sorting is not None
        taken = np.bincount(fitted.number, minlength=sorting.classes) / len(fitted.number)
        made = sorting.classes * float(taken.max())  # pins that are made for each that is built in
        radius = self.settings.variables["pin_radius_um"].value
        pins = (
            self.settings.costs["pin_radius_um"].cost(np.array([radius]))[0]
            if "pin_radius_um" in self.settings.costs
            else 0.0
        )
        cost = float(self.cost_of(design[None, :])[0])
        columns[OF_SORTING[0].name][at] = 100.0 * (1.0 - 1.0 / made)
        columns[OF_SORTING[1].name][at] = (cost + (made - 1.0) * pins) / (0.01 * evaluation.value("yield_percent"))

    def cost_of(self, designs: Array) -> Array:
        """Sum of the cost curves, and of sorting the pins (n,)."""
        return super().cost_of(designs) + number(self.settings.parameters.get("pin_sorting_price", 0.0))

    @cached_property
    def _sampled_outputs(self) -> frozenset[str]:
        """Sampled outputs that a search needs."""
        return frozenset(filter(is_unit_statistic, self.required_outputs))

    @cached_property
    def _own_thickness(self) -> dict[str, str]:
        """The gears whose thickness of teeth has a tolerance of its own, with its name."""
        return {gear: name for gear in GEARS if (name := f"thickness_{gear}_um") in self.names}

    def _flank_clearance(self, designs: Array) -> dict[str, Array]:
        """j_nmin [um] (n,) of the gears of full designs, where their thickness has a tolerance of its own."""
        thickness = {gear: self.column(designs, name) for gear, name in self._own_thickness.items()}
        if not thickness:
            return {}
        least, _ = self.model.flank_clearances(self.column(designs, "involute_grade"), thickness)
        return {FLANK_CLEARANCE.name: least / UM}

    def profile(self, designs: Array) -> dict[str, Array]:
        """Outputs of the tooth modification (n,) of full designs, and of the gears."""
        pair = (self.column(designs, "dr_rp_mm") * MM, self.column(designs, "dr_p_mm") * MM)
        nominal = self.model.geometry.nominal
        return {
            "radial_gap_mm": (pair[0] - pair[1]) / MM,
            "modification_backlash_arcmin": modification.modification_backlash(nominal, *pair) / ARCMIN,
            **self._flank_clearance(designs),
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
        return self.by_limits(designs, gradients, by_mean) | self.plain_slopes(designs)

    def plain_slopes(self, designs: Array) -> dict[str, Array]:
        """Derivatives (n, variables) of cost, profile and flank clearance, at full designs (n, variables)."""
        names = ("radial_gap_mm", "modification_backlash_arcmin")
        slopes = {name: np.zeros_like(designs) for name in names}
        nominal = self.model.geometry.nominal
        unit = 2.0 / nominal.lever / ARCMIN * MM
        by = (("dr_rp_mm", 1.0, unit), ("dr_p_mm", -1.0, -unit * nominal.flank))
        for name, gap, backlash in by:
            column = self.names.index(name)
            slopes["radial_gap_mm"][:, column] = gap
            slopes["modification_backlash_arcmin"][:, column] = backlash
        if self._own_thickness:
            finer, coarser = designs.copy(), designs.copy()
            at, slope = self.names.index("involute_grade"), np.zeros_like(designs)
            finer[:, at], coarser[:, at] = finer[:, at] + STEP_OF_GRADE, coarser[:, at] - STEP_OF_GRADE
            ends = [self._flank_clearance(moved)[FLANK_CLEARANCE.name] for moved in (finer, coarser)]
            slope[:, at] = 0.5 * (ends[0] - ends[1]) / STEP_OF_GRADE
            slopes[FLANK_CLEARANCE.name] = slope
        return slopes | {"cost": self.cost_slopes(designs)}

    def counterparts(self) -> tuple[str, ...]:
        return tuple(sentence(effect, self.model.geometry) for effect in self.settings.effects)

    # ---------------------------------------------------------------- what is known

    def references(self) -> dict[str, Array]:
        """The documents' allocations, which are those of the RV-40E-121 alone, without machines, and with a
        thickness of teeth that follows their grade.
        """
        if self._own_thickness or self.machined_tolerances or changed_geometry_parameters(self.settings.parameters):
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

    def finer(self) -> RvReducer:
        """On as many units as reported points are tested on, others than those, at the same positions."""
        return self._finer

    @cached_property
    def _finer(self) -> RvReducer:
        units, alike = self.count("report_units"), {self.count("positions"), 0}
        if units <= self._search_units and self.count("search_positions") in alike:
            return self
        large = {"search_units": max(units, self._search_units), "search_positions": 0}
        return type(self)(replace(self.given, parameters=dict(self.given.parameters) | large))

    @property
    def fresh_units(self) -> int:
        return self.count("report_units")

    def on_fresh_units(self) -> RvReducer:
        fresh = copy.copy(self)
        fresh._fresh_alone = True
        return fresh

    def interval(self, output: str) -> Interval:
        """Proven bounds: no unit has less backlash than its involute stage."""
        if output == "cost":
            return self._cost_interval
        if output in ("backlash_max_arcmin", "backlash_mean_arcmin") and not self._stretched:
            return self._least_backlash + self.model.change.effective, np.inf
        if output == FLANK_CLEARANCE.name:
            grades = np.array(super().interval("involute_grade"))[::-1]
            ends = np.repeat(self.corner(tight=True)[None, :], 2, axis=0)
            ends[:, self.names.index("involute_grade")] = grades
            least, most = self._flank_clearance(ends)[output]
            return float(least), float(most)
        whole = self.model.geometry.nominal.k1 < 1.0  # else the profile has loops, and is refused
        if whole and output in ("radial_gap_mm", "modification_backlash_arcmin"):  # linear in both modifications
            ends = np.repeat(self.corner(tight=True)[None, :], 4, axis=0)
            for name, order in (("dr_rp_mm", [0, 0, 1, 1]), ("dr_p_mm", [0, 1, 0, 1])):
                ends[:, self.names.index(name)] = np.array(super().interval(name))[order]
            values = self.profile(ends)[output]
            return float(values.min()), float(values.max())
        return super().interval(output)

    @property
    def _stretched(self) -> bool:
        """Whether an effect makes units scatter more about their mean: no bound is proven then."""
        return self.model.change.growth != 0.0

    @cached_property
    def _least_backlash(self) -> float:
        """Least quantile of phi_1 alone [arcmin]."""
        at = float(self.model.planet.quantile(np.array([self.settings.propagation.coverage]))[0])
        return min(alone.middle + alone.half * at for alone in self.tightest_gears())

    def tightest_gears(self, grades: Array | None = None) -> list[Involute]:
        """phi_1 at every grade of the range (or at `grades`), thickness of teeth at its tightest.

        With a thickness of its own, a finer grade need not have less backlash.
        """
        low, high = super().interval("involute_grade")
        thickness = {gear: super(RvReducer, self).interval(name)[0] for gear, name in self._own_thickness.items()}
        if grades is None:
            grades = np.arange(np.rint(low), np.rint(high) + 1.0) if thickness and low < high else np.array([low])
        return [self.model.involute(grade, thickness) for grade in grades]

    def faults(self) -> list[Fault]:
        ends = {name: super(RvReducer, self).interval(name) for name in ("dr_rp_mm", "dr_p_mm")}
        shape = declared.faults(self.model.geometry, self.given, ends)
        size = size_faults(self.count, MAX_CACHED_EVALUATIONS)
        beyond = size or super().faults()
        if shape:  # a profile that cannot be breaks the limits on it as well
            beyond = [fault for fault in beyond if fault.place.removeprefix("limits.") not in DEFAULT_LIMITS]
        faults = [
            *shape,
            *declared.coupling_faults(self.model.geometry, self.model.coupling),
            *declared.planet_faults(self.settings.parameters, self.model.sorting is not None),
            *unpriced_error_faults({variable.name for variable in self.free}, self.settings.costs),
            *beyond,
        ]
        asked = (*self.objectives, *(limit.name for limit in self.limits if limit.count))
        if self.model.sorting is not None:
            faults += declared.sorting_faults(self.given, asked)
        if self.model.coupling is not None:
            faults += declared.distance_faults(self.given, asked)
        faults += self._idle_hours()
        if not shape and not size:
            faults += jam_faults(self, self.settings.effects)
        return faults or self.cost_bound().faults()

    def _idle_hours(self) -> list[Fault]:
        """A fault for hours in which nothing wears."""
        hours = number(self.settings.parameters["hours"])
        if not hours or self.model.change.wear:
            return []
        text = "change nothing: state parameters.wear_um_per_1000h, parameters.running_in_um or an effect of wear"
        return [Fault("parameters.hours", f"{hours:g} h {text}")]

    def cost_bound(self) -> CommonErrorBound:
        from .bound import CommonErrorBound  # not before one is asked for

        return CommonErrorBound(self)

    def search_faults(self) -> list[Fault]:
        return unlimited_interference_faults(self.settings.limits, self.settings.parameters)

    def warnings(self) -> tuple[str, ...]:
        given = self.settings
        gap = given.limits.get("radial_gap_mm", Bound())
        odd = declared.warnings(self.model.geometry, given.parameters, gap)
        idle = declared.idle_wear(given.parameters)
        return (*default_values_sentence(self.given, given.parameters), *idle, *odd)

    # ---------------------------------------------------------------- what a reader is shown

    def title(self) -> str:
        if name := super().title():
            return name
        nominal = self.model.geometry.nominal
        kind = "RV reducer" if self.settings.parameters["involute_stage"] else "Cycloidal reducer"
        teeth = f"{nominal.cycloid_teeth} teeth on {nominal.pins} pins"
        return f"{kind}, {teeth}: allocation on the exact contact"

    def drawn(self, name: str) -> Mapping[str, str]:
        """The phase of a journal is the place of its axis on the circle of the eccentricity."""
        at = {"crank_phase_mrad": {"drawn_as": f"at {number(self.settings.parameters['eccentricity_mm'])!r} mm"}}
        return at.get(name, {})

    def validity(self) -> tuple[str, ...]:
        given = [setting.distribution for setting in self.settings.variables.values()]
        uniform = all(d is None or isinstance(d, Uniform) for d in given)
        return validity(self.settings.parameters, uniform, self.model.change, self.model.sorting is not None)

    def remarks(self, front: pd.DataFrame) -> tuple[str, ...]:
        """Zones that no process is known to hold."""
        held = self.settings.parameters["held_um"]
        assert isinstance(held, Mapping)
        tight = []
        for name, least in held.items():
            tolerance = f"{name}_um"
            zones = front[tolerance] if tolerance in front and tolerance not in self.fixed else front.iloc[:0, 0]
            if len(zones) and (few := int((zones < number(least)).sum())):
                tight.append(
                    f"{tolerance} down to {zones.min():.3g} (at {few} of {len(front)} points; held: {least:g})"
                )
        if not tight:
            return ()
        return (
            f"zones tighter than processes are taken to hold, in um: {'; '.join(tight)}; ask who makes them, raise "
            "variables.NAME.low, or state what yours hold in parameters.held_um",
        )

    def shown_limit(self) -> tuple[str, float] | None:
        return "backlash_max_arcmin", number(self.settings.parameters["backlash_limit_arcmin"])

    def shown_units(self, design: Array) -> UnitsShown | None:
        evaluation = self.evaluation(design, searching=False)
        return unit_tables(evaluation, self.settings.parameters)

    def variants(self) -> tuple[Variant, ...]:
        return variants(self)
