"""Backlash of an RV reducer against manufacturing cost, by tolerances, modification and stagger."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...errors import Fault
from ...journal import recall_arrays
from ...models.costs import CostCurve, Reciprocal, ReciprocalPower, Table
from ...models.propagation import Convolution, Estimate, Moments, MonteCarlo, Propagated, Propagation
from ...models.propagation.sums import ClippedSum, Term, total_cumulants
from ...models.rv_reducer import declared
from ...models.rv_reducer import geometry as modification
from ...models.rv_reducer.backlash import Allocation, stage_means
from ...section import Array, Output, Section, number
from ...units import ARCMIN, MM, UM
from ..declaration import ConfiguredProblem, Declaration, Interval
from ..deviations import Deviations
from ..forms import Form, ends_of_front
from ..limits import apart
from ..machined import Machined
from ..promise import Promising
from ..settings import ASSURED, PROMISED, Bound, Settings
from .counterparts import changes_of, deviations_of, form_of_promise, sentence
from .form import deviations
from .matching import (
    HOLE,
    LEFT_OVER,
    PER_GOOD_UNIT,
    PIN,
    SORTING,
    PinMatching,
    matching_faults,
    refuse_alone,
    refuse_rotation,
    with_matching,
)
from .quantile_form import quantile_form, shortfalls
from .shift import BEARING, GRADE, SHIFT, TERMS, Shift, columns_of, move_means, promise_faults, shift_of, terms_by_name

if TYPE_CHECKING:
    from ..rv_reducer import RvReducer

# The exact contact's verdict on allocations of the closed form.


NAMED = ("yield_percent", "backlash_max_arcmin", "interference_probability")
"""The outputs of the contact that a verdict names."""


def contact_problem(problem: RvBacklash) -> RvReducer:
    """The problem of the same reducer on its exact contact: parameters, mid-limits and effects carried over.

    Errors between discs, which the closed form does not know, are at their defaults.
    """
    from ..rv_reducer import RvReducer  # it takes the costs of this problem

    known = {parameter.name for parameter in RvReducer.declaration.parameters}
    given = {n: v for n, v in problem.settings.parameters.items() if n in known}
    inputs = {n: setting for n, setting in problem.given.variables.items() if setting.distribution or setting.mid}
    return RvReducer(
        Settings(
            parameters=given,
            variables=inputs,
            propagation=problem.settings.propagation,
            seed=problem.settings.seed,
            effects=problem.settings.effects,
        )
    )


def verdicts(problem: RvBacklash, designs: Array) -> tuple[str, ...]:
    """The verdict on each full design (n, all variables) of the closed form."""
    contact = contact_problem(problem)
    known = [contact.fixed | dict(zip(problem.names, design.tolist(), strict=True)) for design in designs]
    rows = [np.array([design.get(name) for name in contact.names], dtype=float) for design in known]
    coverage = 100.0 * problem.settings.propagation.coverage

    def values_of() -> tuple[Array]:
        evaluations = [contact.evaluation(row, searching=False) for row in rows]
        return (np.array([[evaluation.value(name) for name in NAMED] for evaluation in evaluations]),)

    (values,) = recall_arrays((designs, "by contact"), values_of)
    return tuple(
        f"by contact this allocation keeps {problem.limit:g} arcmin in {kept:.1f} % of "
        f"the units at all {contact.count('positions')} positions of a turn; {coverage:.4g} % of them stay below "
        f"{quantile:.2f} arcmin, and {100.0 * interfering:.2g} % interfere"
        for kept, quantile, interfering in values.tolist()
    )


# Relative costs of the features of an RV-40E, all of them assumptions.
#
# The documents print no cost data. The unit is the finishing cost of the 40 pin holes at their
# document tolerance, divided by two. Each curve is a + b/t^k with t in um; b puts the variable part
# at the document's half-width t_0 to the weight below, so C(t_0) = a + weight.
#
# | feature | weight at t_0 | reasoning |
# |---|---|---|
# | pin holes, radius | 2.0 | 40 half-open bores, honed or ground one by one: the most expensive feature |
# | pin position | 1.6 | indexing of the same 40 bores on a jig grinder |
# | pin circle radius | 0.8 | one setting of the same machine, drifts with temperature |
# | pins, radius | 0.6 | 40 pins, centreless ground in quantity and sorted in classes |
# | pitch of the discs | 1.4 | generating grinding of two discs, indexing accuracy |
# | runout of the discs | 0.5 | bore and profile ground in one clamping |
# | equidistance, shift | 0.6 each | wheel dressing, and grinding centre distance |
# | eccentricity | 1.2 | two crankshafts with two eccentrics each, ground out of centre |
# | crank bearings | 0.8 | four needle bearings, sorted into clearance classes |
# | involute gears | 0.8 .. 3.2 | grade 8 to 4: ground and inspected, about 1.3 to 1.6 per grade |
#
# Exponents: k = 1 (reciprocal) where a size is reached by further passes on one machine, k = 0.6
# where parts are sorted (narrower classes cost scrap and handling, not passes). Exponents between
# about 0.5 and 1 are what reciprocal-power fits to process data use: Sutherland & Roth (1975);
# Chase, Greenwood, Loosli & Hauglund (1990), Manufacturing Review 3(1), 49-59. Absolute values are
# not transferable between shops: replace them under `[costs]` in the configuration.


def _sorted(weight: float, t_0: float) -> ReciprocalPower:
    return ReciprocalPower(a=0.1, b=round(weight * t_0**0.6, 6), k=0.6)


def _ground(weight: float, t_0: float) -> Reciprocal:
    return Reciprocal(a=0.1, b=round(weight * t_0, 6))


DEFAULT_COSTS: dict[str, CostCurve] = {
    "pin_circle_radius_um": _ground(0.8, 3.0),
    "pin_position_um": _ground(1.6, 2.0),
    "pin_hole_radius_um": _ground(2.0, 1.5),
    "pin_radius_um": _sorted(0.6, 1.0),
    "pitch_um": _ground(1.4, 4.0),
    "runout_um": _ground(0.5, 1.0),
    "eccentricity_um": _ground(1.2, 1.0),
    "equidistance_um": _ground(0.6, 1.0),
    "shift_um": _ground(0.6, 1.0),
    "crank_bearing_um": _sorted(0.8, 2.0),
    "involute_grade": Table(t=(4.0, 5.0, 6.0, 7.0, 8.0), cost_at=(3.2, 2.0, 1.4, 1.0, 0.8)),
}


# Derivatives of cost and of the geometric backlash with respect to every variable.


def gradients(problem: RvBacklash, designs: Array) -> dict[str, Array]:
    """d output / d variable, shape (n, all variables), in the units of output and variable.

    A term constant + a t z + b t^2 z^2 has mean and variance that are polynomials in its tolerance
    t, so both derivatives are exact. The grade counts as continuous (sqrt(2) per grade).
    """
    total = problem.total(designs)
    terms = terms_by_name(total)
    mean, variance = np.zeros_like(designs), np.zeros_like(designs)
    phi_1, phi_3 = total.free
    spread = problem.effective(designs)
    slopes = {name: _slopes_by_tolerance(t, problem.column(spread, name)) for name, t in terms.items()}
    for tolerance in problem.machined_tolerances.values():
        t, chosen = problem.column(designs, tolerance.name), problem.chosen(designs, tolerance)
        rise, shift = tolerance.slopes(t, chosen)
        (by_mean, by_variance), x = slopes[tolerance.name], problem.column(spread, tolerance.name)
        shift = shift * problem.model.moves(tolerance.name.removesuffix("_um"))
        of_mean, of_variance = _slopes_by_middle(terms[tolerance.name], x)
        slopes[tolerance.name] = (by_mean * rise + of_mean * shift, by_variance * rise + of_variance * shift)
    if problem.matching is not None:
        _, centres = problem.matching.added(total)
        for name in (HOLE, PIN):
            by_mean, by_variance = slopes[name]
            rate = problem.matching.classes * terms[name].linear / problem.column(designs, name)
            slopes[name] = by_mean, by_variance + 2.0 * centres.linear * rate * centres.distribution.raw_moments(2)[2]
    slopes[BEARING] = _slopes_by_scale(phi_3, 1.0 / problem.column(designs, BEARING))
    slopes[GRADE] = _slopes_by_scale(phi_1, 0.5 * np.log(2.0))
    for name, pair in slopes.items():
        at = problem.names.index(name)
        mean[:, at], variance[:, at] = pair
    model = problem.model
    unit = 2.0 * model.output_factor / model.geometry.lever
    fixed = {
        "stagger_arcmin": -model.output_factor * model.stagger_gain * ARCMIN,
        "dr_rp_mm": unit * MM,
        "dr_p_mm": -unit * model.geometry.flank * MM,
    }
    for name, slope in fixed.items():
        mean[:, problem.names.index(name)] = slope
    std = np.sqrt(total_cumulants(total.clipped + total.free)[1])
    deviation = 0.5 * variance / std[:, None] * (1.0 + problem.change.growth)
    return {
        "cost": problem.cost_slopes(designs),
        "backlash_geometric_arcmin": (mean + deviations(problem) * deviation) / ARCMIN,
        "backlash_geometric_mean_arcmin": mean / ARCMIN,
        "backlash_geometric_std_arcmin": deviation / ARCMIN,
    }


def _slopes_by_tolerance(term: Term, t: Array) -> tuple[Array, Array]:
    """d mean/dt and d variance/dt of a term whose linear part grows with t, the bent with t^2."""
    _, m1, m2, m3, m4 = term.distribution.raw_moments(4)
    linear = term.linear / t
    bent = 0.0 if term.quadratic is None else term.quadratic / t**2
    mean = linear * m1 + 2.0 * bent * t * m2
    variance = (
        2.0 * linear**2 * t * (m2 - m1**2)
        + 6.0 * linear * bent * t**2 * (m3 - m1 * m2)
        + 4.0 * bent**2 * t**3 * (m4 - m2**2)
    )
    return mean, variance


def _slopes_by_middle(term: Term, x: Array) -> tuple[Array, Array]:
    """d mean/dm and d variance/dm of a normal term (b + 2 q m) x z + q (x z)^2 about its mean m."""
    if term.quadratic is None:
        return term.linear / x, np.zeros_like(x)
    square = term.distribution.raw_moments(2)[2]
    return term.linear / x, 4.0 * term.linear * term.quadratic / x * square


def _slopes_by_scale(term: Term, rate: Array | float) -> tuple[Array, Array]:
    """The same of a term that grows as a whole at the relative `rate`."""
    mean, variance = term.cumulants()[:2]
    return mean * rate, 2.0 * variance * rate


# Outputs of `rv_backlash`, its default limits and objectives.


OUTPUTS = (
    Output("cost", "", "relative manufacturing cost, sum of the cost curves", low=0.0),
    Output("phi_1_arcmin", "arcmin", "mean backlash of the involute stage"),
    Output("phi_2_arcmin", "arcmin", "mean of the cycloid stage, stagger included; below zero: interference"),
    Output("phi_3_arcmin", "arcmin", "mean backlash of the output stage"),
    Output("backlash_geometric_mean_arcmin", "arcmin", "mean of phi_1 + phi_2 + phi_3"),
    Output("backlash_geometric_std_arcmin", "arcmin", "standard deviation of the same", low=0.0),
    Output(
        "backlash_geometric_arcmin",
        "arcmin",
        "mean + k standard deviations of the same, k the standard normal quantile at the coverage",
    ),
    Output("backlash_mean_arcmin", "arcmin", "mean of phi_1 + max(0, phi_2) + phi_3", low=0.0),
    Output("backlash_std_arcmin", "arcmin", "standard deviation of the same", low=0.0),
    Output("backlash_rms_arcmin", "arcmin", "root mean square of the same over units", low=0.0),
    Output("backlash_arcmin", "arcmin", "one-sided quantile of phi_1 + max(0, phi_2) + phi_3 at the coverage", low=0.0),
    Output(
        "yield_percent",
        "%",
        "units whose effective backlash keeps backlash_limit_arcmin",
        100.0,
        larger_is_better=True,
        low=0.0,
        high=100.0,
    ),
    Output("interference_probability", "", "probability of phi_2 < 0 (preload)", low=0.0, high=1.0),
    Output("radial_gap_mm", "mm", "clearance at tooth tip and root, dr_rp - dr_p (g3)", 0.03, larger_is_better=True),
    Output("clearance_min_mm", "mm", "least raw flank clearance of the modification", 0.03, larger_is_better=True),
    Output("conjugate_clearance_min_mm", "mm", "least clearance after first contact (g5)", 0.03, larger_is_better=True),
    Output("modification_backlash_arcmin", "arcmin", "backlash that the modification itself leaves (g4)"),
    Output("backlash_mean_arcmin_error", "arcmin", "stated numerical error", error_of="backlash_mean_arcmin"),
    Output("backlash_std_arcmin_error", "arcmin", "stated numerical error", error_of="backlash_std_arcmin"),
    Output("backlash_rms_arcmin_error", "arcmin", "stated numerical error", error_of="backlash_rms_arcmin"),
    Output("backlash_arcmin_error", "arcmin", "stated numerical error", error_of="backlash_arcmin"),
    Output("yield_percent_error", "%", "stated numerical error", error_of="yield_percent"),
    Output("interference_probability_error", "", "stated numerical error", error_of="interference_probability"),
)

DEFAULT_LIMITS = {
    "dr_rp_mm": Bound(high=0.0),
    "dr_p_mm": Bound(high=0.0),
    "radial_gap_mm": Bound(low=0.03),
    "modification_backlash_arcmin": Bound(low=0.0),
    "conjugate_clearance_min_mm": Bound(low=0.0),
}
"""Radial gap at least 0.03 mm, and g1 to g5 of document B (g3 is implied by the gap)."""

DEFAULT_OBJECTIVES = ("cost", "backlash_arcmin")


SEARCH_POINTS = 512
"""Lattice of the search; its quantiles are within about 0.001 arcmin of the reported ones."""
TIGHTER = 1.0, 0.7, 0.5
"""Fractions of document B's bands at which a search for a promise begins."""
STAGGER_OF_DOCUMENT = 0.2
"""Turn of each disc [arcmin] in document B's structural adjustment: twice its delta' of 0.1'."""
STAGGERED = "document B, staggered 0.2 arcmin (delta' = 0.1)"


class RvBacklash(Promising, Machined):
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
        unconditional=frozenset(
            ["cost", "radial_gap_mm", "clearance_min_mm", "conjugate_clearance_min_mm", "modification_backlash_arcmin"]
        ),
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
        self.declaration = with_matching(self.declaration, settings.parameters if settings else ())
        super().__init__(settings)
        given = self.settings
        self.matching = PinMatching.of(given.parameters)
        self.model = declared.backlash_model(
            {name: value for name, value in given.parameters.items() if name not in {p.name for p in SORTING}},
            {_stem(name): s.centre for name, s in self.given.variables.items() if s.centre is not None},
            {_stem(name): s.distribution for name, s in given.variables.items() if s.distribution},
        )
        self.limit = number(given.parameters["backlash_limit_arcmin"])
        self.change = changes_of(given.effects, self.model)

    @classmethod
    def configured(cls, top: Section) -> ConfiguredProblem | None:
        """Pins in classes are declared where their number is stated; alone, what belongs to them changes nothing."""
        configured, parameters = super().configured(top), top.section("parameters")
        if configured is None:
            return None
        refuse_rotation(top.section("variables"))
        refuse_alone(parameters, [parameter.name for parameter in SORTING[1:]])
        return replace(configured, declaration=with_matching(configured.declaration, parameters.all_keys()))

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
            dimensions = len(declared.VARIABLES) - 3 + (0 if self.matching is None else 2)
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
        return self.change.opened(move_means(self, designs, self.plain_total(self.effective(designs))))

    def plain_total(self, designs: Array) -> ClippedSum:
        """The same of spreads of centred parts."""
        total = self.model.total(self.allocation(designs))
        return total if self.matching is None else self.matching.matched(total, self.model.gain("pin_hole_radius") * UM)

    def cost_of(self, designs: Array) -> Array:
        """Sum of the cost curves, and of sorting the pins and holes (n,)."""
        return super().cost_of(designs) + (0.0 if self.matching is None else self.matching.price)

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        outputs = self._propagated(designs, self._searching if searching else self._reporting)
        return outputs | self._matched(designs, outputs, searching)

    def needed(self, designs: Array) -> dict[str, Array]:
        """Every output as reported, the errors of propagation at NaN: a third of the work is theirs."""
        outputs = self._propagated(designs, self._method(Convolution(errors=False)))
        return outputs | self._matched(designs, outputs, searching=False) | self._further(designs, searching=False)

    def _propagated(self, designs: Array, method: Propagation) -> dict[str, Array]:
        """Outputs (n,) of full designs by a method of propagation, without those of matched parts."""
        total = self.total(designs)
        coverage = self.settings.propagation.coverage
        spread = self.change.propagate(method, total, coverage, self.limit * ARCMIN)
        means = zip(("phi_1", "phi_2", "phi_3"), stage_means(total), strict=True)
        outputs = {f"{name}_arcmin": value / ARCMIN for name, value in means}
        geometric = spread.geometric_mean + deviations(self) * spread.geometric_std
        outputs["backlash_geometric_arcmin"] = geometric / ARCMIN
        return {"cost": self.cost_of(designs)} | outputs | _spread(spread) | self.profile(designs)

    def _matched(self, designs: Array, outputs: Mapping[str, Array], searching: bool) -> dict[str, Array]:
        """Pins and holes left over, and the cost of a good unit that pays for them, each (n,); NaN where a search does
        not need them: they take three times as long as all others.
        """
        if self.matching is None:
            return {}
        names = LEFT_OVER, PER_GOOD_UNIT
        if searching and self.required_outputs.isdisjoint(names):
            return dict.fromkeys(names, np.full(len(designs), np.nan))
        t = {name: self.column(designs, name) for name in (HOLE, PIN)}
        left = self.matching.left_over(np.stack(list(t.values()), axis=1))
        parts = sum(self.settings.costs[name].cost(zone) for name, zone in t.items() if name in self.settings.costs)
        cost = outputs["cost"] + left / (1.0 - left) * parts
        good = 0.01 * np.maximum(outputs["yield_percent"], 1e-9)
        return {LEFT_OVER: 100.0 * left, PER_GOOD_UNIT: cost / good}

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
        return quantile if isinstance(quantile, Form) else form_of_promise(self)

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
        form = self._quantile_form if self.matching is None else quantile_form(self, tied=False)
        if isinstance(form, str) or set(self.objectives) != {"cost", "backlash_arcmin"}:
            return super().box()
        ends = ends_of_front(form, form.outputs.index("backlash_arcmin"), form.own_limits)
        if ends is None:
            return super().box()
        order = [("cost", "backlash_arcmin").index(name) for name in self.objectives]
        return ends[0][order], apart(ends[0][order], ends[1][order])

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
        if self.matching is not None and HOLE in values and PIN not in values and PIN not in self.fixed:
            values[PIN] = values[HOLE]
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

        None where machines make a part, or where pins are sorted: the bands would not be theirs.
        """
        if self.machined_tolerances or self.matching is not None:
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
        return () if self.machined_tolerances or self.matching is not None else verdicts(self, designs)

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
        tight = self.total(self.corner(tight=True)[None, :])
        nothing = [replace(t, constant=0.0 * t.constant, linear=0.0 * t.linear, quadratic=None) for t in tight.clipped]
        only_free = ClippedSum(tight.free, tuple(nothing))
        return self.change.propagate(Convolution(), only_free, self.settings.propagation.coverage, self.limit * ARCMIN)

    @cached_property
    def _least(self) -> dict[str, float]:
        tight = self.corner(tight=True)[None, :]
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
        pairs = np.repeat(self.corner(tight=True)[None, :], 4, axis=0)
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
            widest = {name: self.interval(name)[1] for name in (HOLE, PIN)}
            return [*(matching_faults(self.given, self.matching, widest) if self.matching else ()), *super().faults()]
        text = f"eccentricity * pins / pin circle radius must lie in (0, 1), got {k1:.4g}"
        return [Fault("parameters.eccentricity_mm", text)]

    def search_faults(self) -> list[Fault]:
        return promise_faults(self)

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
