"""Backlash of an RV reducer against manufacturing cost, by tolerances, modification and stagger."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...declarations import number
from ...errors import Fault
from ...models.propagation import Convolution, Estimate, Moments, MonteCarlo, Propagated, Propagation
from ...models.propagation.sums import ClippedSum
from ...models.rv_reducer import declared, modification
from ...models.rv_reducer.backlash import Allocation, stage_means
from ...units import ARCMIN, MM
from ..declaration import Declaration, Interval
from ..deviations import Deviations
from ..forms import Form
from ..interfaces import Accuracy, Comparison, Documented, Page, Provable, WithEffects
from ..least import ends_of_front
from ..machined import Machined
from ..promise import ASSURED, PROMISED
from ..promising import Promising
from ..settings import Bound, Settings
from .by_contact import verdicts
from .costs import DEFAULT_COSTS
from .counterparts import changes_of, sentence
from .deviating import deviations_of, promised_form
from .form import deviations
from .gradient import gradients
from .machined_tolerances import TERMS, moved
from .outputs import DEFAULT_LIMITS, DEFAULT_OBJECTIVES, OUTPUTS
from .quantile_form import quantile_form, shortfalls
from .refused import refused
from .shift import SHIFT, Shift, columns_of, shift_of

SEARCH_POINTS = 512
"""Lattice of the search; its quantiles are within about 0.001 arcmin of the reported ones."""
TIGHTER = 1.0, 0.7, 0.5
"""Fractions of document B's bands at which a search for a promise begins."""
STAGGER_OF_DOCUMENT = 0.2
"""Turn of each disc [arcmin] in document B's structural adjustment: twice its delta' of 0.1'."""
STAGGERED = "document B, staggered 0.2 arcmin (delta' = 0.1)"


class RvBacklash(Promising, Machined, Accuracy, Provable, Documented, Comparison, WithEffects, Page):
    """Backlash of an RV reducer against cost (default: RV-40E-121, document B).

    Variables, outputs and limits: docs/rv_backlash.md. Known answer: none (`exact_front` is None).
    """

    declaration = Declaration(
        declared.VARIABLES,
        OUTPUTS,
        declared.PARAMETERS,
        costs=DEFAULT_COSTS,
        limits=DEFAULT_LIMITS,
        objectives=DEFAULT_OBJECTIVES,
        model="rv_batch",
        algorithm="exact",
        model_name="document",
        model_statement="document B's closed form",
        explained={
            "backlash_arcmin": "backlash_geometric_arcmin",
            "backlash_mean_arcmin": "backlash_geometric_mean_arcmin",
            "backlash_std_arcmin": "backlash_geometric_std_arcmin",
        },
    )
    machinable = frozenset(TERMS)

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        given = self.settings
        self.model = declared.backlash_model(
            given.parameters,
            {_stem(name): s.centre for name, s in self.given.variables.items() if s.centre is not None},
            {_stem(name): s.distribution for name, s in given.variables.items() if s.distribution},
        )
        self.limit = number(given.parameters["backlash_limit_arcmin"])
        self.change = changes_of(given.effects, self.model)

    # ---------------------------------------------------------------- evaluation

    @cached_property
    def _reporting(self) -> Propagation:
        return self._method(Convolution())

    @cached_property
    def _searching(self) -> Propagation:
        return self._method(Convolution(SEARCH_POINTS, errors=False))

    def _method(self, convolution: Convolution) -> Propagation:
        given = self.settings.propagation
        if given.method == "moments":
            return Moments()
        if given.method == "monte_carlo":
            dimensions = len(declared.VARIABLES) - 3
            return MonteCarlo.draw(given.samples, dimensions, np.random.default_rng(self.settings.seed))
        return convolution

    def reported(self) -> RvBacklash:
        """The same problem with every value by convolution, as reported points need it."""
        convolution = replace(self.settings.propagation, method="convolution")
        return RvBacklash(replace(self.given, propagation=convolution))

    def allocation(self, designs: Array) -> Allocation:
        """The model's view (SI) of full designs."""
        return declared.allocation({name: self.column(designs, name) for name in self.names})

    def total(self, designs: Array) -> ClippedSum:
        """The sum over units that is propagated [rad]."""
        return self.change.opened(moved(self, designs, self.plain_total(self.effective(designs))))

    def plain_total(self, designs: Array) -> ClippedSum:
        """The same of spreads of centred parts."""
        return self.model.total(self.allocation(designs))

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        total = self.total(designs)
        method = self._searching if searching else self._reporting
        coverage = self.settings.propagation.coverage
        spread = self.change.propagate(method, total, coverage, self.limit * ARCMIN)
        means = zip(("phi_1", "phi_2", "phi_3"), stage_means(total), strict=True)
        outputs = {f"{name}_arcmin": value / ARCMIN for name, value in means}
        geometric = spread.geometric_mean + deviations(self) * spread.geometric_std
        outputs["backlash_geometric_arcmin"] = geometric / ARCMIN
        return {"cost": self.cost_of(designs)} | outputs | _spread(spread) | self.profile(designs)

    def profile(self, designs: Array) -> dict[str, Array]:
        """Outputs of the tooth modification, shape (n,), of full designs."""
        geometry = self.model.geometry
        pair = (self.column(designs, "dr_rp_mm") * MM, self.column(designs, "dr_p_mm") * MM)
        return {
            "radial_gap_mm": (pair[0] - pair[1]) / MM,
            "clearance_min_mm": modification.least_raw_clearance(geometry, *pair) / MM,
            "conjugate_clearance_min_mm": modification.least_clearance(geometry, *pair) / MM,
            "modification_backlash_arcmin": self.model.nominal(*pair, np.zeros(len(designs))) / ARCMIN,
        }

    def form(self) -> Form | None:
        """The quantile of the effective backlash, from below; else moments of the geometric one.

        The first where `backlash_arcmin` or a yield is asked for and the inputs allow it. None
        where an effect inflates the spread: the forms know the spread of the inputs alone.
        """
        if self.change.growth != 0.0:
            return None
        quantile = self._quantile_form
        return quantile if isinstance(quantile, Form) else promised_form(self)

    def unproven(self) -> str:
        return self._quantile_form if isinstance(self._quantile_form, str) else ""

    @cached_property
    def shift(self) -> Shift | None:
        """Range in which modification and stagger move phi_2, None where they have no room."""
        return shift_of(self)

    @cached_property
    def _quantile_form(self) -> Form | str:
        return quantile_form(self)

    def box(self) -> tuple[Array, Array]:
        """Ideal and nadir from the proof, where there is one of the effective backlash."""
        form = self._quantile_form
        if isinstance(form, str) or set(self.objectives) != {"cost", "backlash_arcmin"}:
            return super().box()
        ends = ends_of_front(form, form.outputs.index("backlash_arcmin"), form.own_limits)
        if ends is None:
            return super().box()
        order = [("cost", "backlash_arcmin").index(name) for name in self.objectives]
        return ends[0][order], np.maximum(ends[1][order], ends[0][order] + 1e-12)

    def form_values(self, form: Form, designs: Array, outputs: Mapping[str, Array]) -> Array:
        values = super().form_values(form, designs, outputs)
        missing = shortfalls(self, designs, outputs)
        if self.promised is not None and self.promised.promise.statement == ASSURED:
            missing[PROMISED] = self.promised.lacking(self.deviations(designs))
        for row, name in enumerate(form.outputs):
            if np.isfinite(form.own_limits[row]):
                values[:, row] = form.own_limits[row] + missing[name]
        return values

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Modification and stagger at the shift of a form's optimum, and limits of inspection."""
        values, shift = dict(columns), self.shift
        for tolerance in self.machined_tolerances.values():
            if tolerance.name in values:
                chosen = np.rint(values.get(tolerance.choice, 0.0 * values[tolerance.name])).astype(np.int64)
                values[tolerance.name] = tolerance.limits(values[tolerance.name], chosen)
        if SHIFT not in values or shift is None:
            return values
        s = np.asarray(values[SHIFT]) + shift.low - 1.0
        return {**values, **columns_of(self, shift, s)}

    def counterparts(self) -> tuple[str, ...]:
        return tuple(sentence(effect, self.model) for effect in self.settings.effects)

    def gradient(self, designs: Array) -> dict[str, Array]:
        return gradients(self, designs) | self.promised_slopes(designs)

    def deviations(self, designs: Array) -> Deviations:
        """Those of the geometric backlash; interference alone makes the effective one larger."""
        return deviations_of(self, designs)

    # ---------------------------------------------------------------- what is known

    def references(self) -> dict[str, Array]:
        """Document B's printed bands and modification, without and with its stagger.

        None where machines make a part: the bands would not be theirs.
        """
        if self.machined_tolerances:
            return {}
        bands = np.array([float(v.document or 0.0) for v in self.variables])
        staggered = bands.copy()
        staggered[self.names.index("stagger_arcmin")] = STAGGER_OF_DOCUMENT
        return {"document B": bands, STAGGERED: staggered}

    def starts(self) -> Array:
        """Document B's bands and tighter ones, where a promise leaves the search no closed form."""
        if not self.promises_by_samples:
            return super().starts()
        bands = np.array([float(v.document or 0.0) for v in self.variables])
        rows = np.repeat(bands[None, :], len(TIGHTER), axis=0)
        zones = [at for at, v in enumerate(self.variables) if v.tolerance and not v.integer]
        rows[:, zones] *= np.array(TIGHTER)[:, None]
        free = [self.names.index(v.name) for v in self.free]
        return self.complete(np.clip(rows[:, free], self.xl, self.xu))

    def least_cost(self) -> tuple[str, RvBacklash]:
        """Least cost at the backlash limit, the documents' single objective."""
        stated = self.settings.limits.get("backlash_arcmin", Bound())
        limit = Bound(stated.low, min(stated.high, self.limit))
        given = replace(self.given, objectives=("cost",), limits=dict(self.given.limits) | {"backlash_arcmin": limit})
        return f"GA, least cost at {limit.high:g} arcmin", RvBacklash(given)

    def finer_verdicts(self, designs: Array) -> tuple[str, ...]:
        return () if self.machined_tolerances else verdicts(self, designs)

    def interval(self, output: str) -> Interval:
        """Proven bounds: by monotonicity in the tolerances, or by leaving the cycloid stage out.

        max(0, phi_2) >= 0, so no design has less effective backlash than the involute and output
        stages alone at their tightest; the probability of keeping the limit is bounded likewise.
        """
        if output == "cost":
            return self._cost_interval
        if output in self._least:
            return self._least[output], np.inf
        if output == "yield_percent":
            return 0.0, self._most_yield
        if output in ("radial_gap_mm", "clearance_min_mm", "modification_backlash_arcmin"):
            return self._modification_interval(output)
        return super().interval(output)

    @cached_property
    def _tight_without_cycloid(self) -> Propagated:
        """Effective backlash at the tightest corner with the cycloid stage taken out."""
        tight = self.total(self._corner(tight=True)[None, :])
        nothing = [replace(t, constant=0.0 * t.constant, linear=0.0 * t.linear, quadratic=None) for t in tight.clipped]
        only_free = ClippedSum(tight.free, tuple(nothing))
        return self.change.propagate(Convolution(), only_free, self.settings.propagation.coverage, self.limit * ARCMIN)

    @cached_property
    def _least(self) -> dict[str, float]:
        tight = self._corner(tight=True)[None, :]
        phi_1, _, phi_3 = (float(value[0]) / ARCMIN for value in stage_means(self.total(tight)))
        free = self._tight_without_cycloid
        quantile = float(free.quantile.value[0] - free.quantile.error[0]) / ARCMIN
        least = phi_1 + phi_3 + self.change.effective / ARCMIN
        return {
            "phi_1_arcmin": phi_1,
            "phi_3_arcmin": phi_3,
            "backlash_mean_arcmin": least,
            "backlash_rms_arcmin": max(least, 0.0),
            "backlash_arcmin": quantile,
        }

    @cached_property
    def _most_yield(self) -> float:
        conforming = self._tight_without_cycloid.conforming
        return min(100.0, 100.0 * float(conforming.value[0] + conforming.error[0]))

    def _modification_interval(self, output: str) -> Interval:
        pairs = np.repeat(self._corner(tight=True)[None, :], 4, axis=0)
        for name, ends in (("dr_rp_mm", (0, 0, 1, 1)), ("dr_p_mm", (0, 1, 0, 1))):
            bounds = np.array(super().interval(name))
            pairs[:, self.names.index(name)] = bounds[list(ends)]
        outputs = self.profile(pairs)[output]
        return float(outputs.min()), float(outputs.max())

    def _corners(self) -> Array:
        """Tightest and loosest tolerances with the zero-backlash pair, without and with stagger."""
        gap = max(0.0, float(self.settings.limits["radial_gap_mm"].low))
        gap = gap if np.isfinite(gap) else 0.0
        pair = modification.zero_backlash_pair(self.model.geometry, gap * MM)
        rows = np.repeat(super()._corners(), 2, axis=0)
        for name, value in zip(("dr_rp_mm", "dr_p_mm"), pair, strict=True):
            low, high = super().interval(name)
            rows[:, self.names.index(name)] = np.clip(value / MM, low, high)
        rows[:, self.names.index("stagger_arcmin")] = list(super().interval("stagger_arcmin")) * 2
        return rows

    # ---------------------------------------------------------------- faults and warnings

    def faults(self) -> list[Fault]:
        if 0.0 < (k1 := self.model.geometry.k1) < 1.0:
            return super().faults()
        text = f"eccentricity * pins / pin circle radius must lie in (0, 1), got {k1:.4g}"
        return [Fault("parameters.eccentricity_mm", text)]

    def search_faults(self) -> list[Fault]:
        return refused(self)

    def warnings(self) -> tuple[str, ...]:
        if "interference_probability" in self.settings.limits:
            return ()
        return (
            "no limit on interference_probability: interference can always lower the backlash; set [limits] "
            "interference_probability",
        )


def _stem(name: str) -> str:
    return name.removesuffix("_um")


def _rms(spread: Propagated) -> Estimate:
    """Root mean square over units, sqrt(mean^2 + std^2) [rad], with its numerical error."""
    mean, std = spread.mean, spread.std
    rms = np.hypot(mean.value, std.value)
    error = np.abs(mean.value) * mean.error + std.value * std.error
    return Estimate(rms, error / np.where(rms > 0.0, rms, 1.0))


def _spread(spread: Propagated) -> dict[str, Array]:
    """Outputs of the propagation, at the edge's units."""
    estimates = {
        "backlash_mean_arcmin": (spread.mean, ARCMIN),
        "backlash_std_arcmin": (spread.std, ARCMIN),
        "backlash_rms_arcmin": (_rms(spread), ARCMIN),
        "backlash_arcmin": (spread.quantile, ARCMIN),
        "yield_percent": (spread.conforming, 0.01),
        "interference_probability": (spread.negative, 1.0),
    }
    outputs = {
        "backlash_geometric_mean_arcmin": spread.geometric_mean / ARCMIN,
        "backlash_geometric_std_arcmin": spread.geometric_std / ARCMIN,
    }
    outputs |= {name: estimate.value / unit for name, (estimate, unit) in estimates.items()}
    return outputs | {f"{name}_error": estimate.error / unit for name, (estimate, unit) in estimates.items()}
