"""Refused before a search: a promise that interference would keep."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...errors import Fault
from ...models.costs import CostCurve
from ...models.machines import convex_cost
from ...models.propagation.sums import ClippedSum, Term
from ...models.rv_reducer.cycloid import LINEAR_ERRORS
from ...section import Array
from ...units import ARCMIN, MM
from ..limits import narrow_range
from ..machined import MachinedTolerance, curve_of

if TYPE_CHECKING:
    from ..limits import Limit
    from .problem import RvBacklash

INTERFERENCE = "interference_probability"
OPENING = "dr_rp_mm", "dr_p_mm", "stagger_arcmin"
"""Variables that move phi_2 of every unit and cost nothing."""


def promise_faults(problem: RvBacklash) -> list[Fault]:
    """A promise without a limit on interference, where modification or stagger are searched."""
    opened = [variable.name for variable in problem.free if variable.name in OPENING]
    if problem.promise is None or INTERFERENCE in problem.settings.limits or not opened:
        return []
    return [
        Fault(
            f"limits.{INTERFERENCE}",
            "is missing: without a limit on interference the promise is kept by units that are nearly all preloaded "
            "(92 to 95 % of them in the document's case, at half the cost); set, for example, 0.05 (1 allows any), "
            f"or fix {', '.join(f'variables.{name}.value' for name in opened)}",
        )
    ]


def allows_any(limit: Limit) -> bool:
    """Whether a limit says that units may interfere as they like."""
    return limit.name == INTERFERENCE and limit.low <= 0.0 and limit.high >= 1.0


# Tolerances of an RV reducer that machines make: their means, and ways of the forms.


TERMS = tuple(f"{name}_um" for name in (*LINEAR_ERRORS, "eccentricity"))
"""Variables of the terms of phi_2, in their order."""
CELLS = 6
"""Pieces of the range of a machine that is not centred."""
TRIED_TOLERANCES = 33
"""Points of a piece at which lines are tried."""
ROUNDING = 1e-12
"""Fraction of its values by which a line keeps below."""


def move_means(problem: RvBacklash, designs: Array, total: ClippedSum) -> ClippedSum:
    """The sum with the means of machined parts; spreads already replace the limits.

    A term b x z + q (x z)^2 of the spread x becomes, about a mean m, b m + q m^2 and
    (b + 2 q m) x z + q (x z)^2.
    """
    if not problem.machined_tolerances:
        return total
    terms = list(total.clipped)
    for name, (x, m) in problem.as_made(designs).items():
        at = TERMS.index(name)
        term = terms[at]
        if not problem.model.moves(name.removesuffix("_um")):
            continue
        q = 0.0 if term.quadratic is None else term.quadratic / x**2
        terms[at] = replace(
            term, constant=term.constant + (term.linear / x + q * m) * m, linear=term.linear + 2.0 * q * m * x
        )
    return replace(total, clipped=tuple(terms))


@dataclass(frozen=True, slots=True)
class Piece:
    """Spreads between which a tolerance is made in the way `choice`, and means of its good parts.

    `means` (k,) belong to spreads `x` (k,) from `low` to `high`.
    """

    curve: CostCurve
    low: float
    high: float
    choice: float
    x: Array
    means: Array

    def line(self, values: Array, side: float) -> tuple[float, float]:
        """Slope and constant of a line below (`side` = 1) or above (-1) values (k,) at `x`."""
        wide = self.high > self.low
        slope = float((values[-1] - values[0]) / (self.high - self.low)) if wide else 0.0
        rest = side * (values - slope * self.x)
        slack = float(np.max(np.abs(np.diff(values, 2)), initial=0.0))
        slack += ROUNDING * float(np.max(np.abs(values)))
        return slope, side * (float(rest.min()) - (slack if wide else 0.0))


def pieces_of(
    tolerance: MachinedTolerance, ends: tuple[float, float], moving: int = CELLS, still: int = 1
) -> Iterator[Piece]:
    """The ways of a tolerance within `ends` of its limit.

    Those that are inspected are cut, into `moving` pieces where their mean moves, else `still`.
    """
    for number, way in enumerate(tolerance.ways):
        low, high = max(way.low, ends[0]), min(way.high, ends[1])
        if low > high:
            continue
        choice = np.full(2, number)
        spread, mean = tolerance.spread_and_mean(np.array([low, high]), choice)
        if way.low == way.high:
            x = float(spread[0])
            yield Piece(way.curve, x, x, float(number), spread[:1], mean[:1])
            continue
        plain = tolerance.by_spread(way)
        curve, _ = convex_cost(curve_of(tolerance, way, low, high), plain.tabulated)
        cells = moving if way.machine.mean else still
        for first, last in pairwise(np.linspace(spread[0], spread[1], cells + 1).tolist()):
            x_of = np.linspace(first, last, TRIED_TOLERANCES)
            means = way.machine.good_parts(plain.limit(x_of)).mean
            yield Piece(curve, first, last, float(number), x_of, means)


# The terms of phi_2 by tolerance, and the ranges of variables, as convex forms need them.


GRADE, BEARING = "involute_grade", "crank_bearing_um"
"""Variables of the first and last stage, in the order of their terms."""


def unit_terms(problem: RvBacklash) -> dict[str, Term]:
    """The terms of the cycloid stage at half-widths of 1 um, without modification and stagger."""
    design = np.ones((1, len(problem.names)))
    for name in ("dr_rp_mm", "dr_p_mm", "stagger_arcmin"):
        design[:, problem.names.index(name)] = 0.0
    return terms_by_name(problem.change.opened(problem.plain_total(design)))


def terms_by_name(total: ClippedSum) -> dict[str, Term]:
    """The terms of phi_2 by their tolerance, without those that matched parts add."""
    return dict(zip(TERMS, total.clipped[: len(TERMS)], strict=True))


def grades_of(problem: RvBacklash) -> tuple[Array, Term]:
    """The involute grades (k,) within their range, and the clearance of the first stage at each."""
    low, high = ends(problem, GRADE)
    grades = np.arange(np.ceil(low), np.floor(high) + 1.0)
    designs = np.ones((len(grades), len(problem.names)))
    designs[:, problem.names.index(GRADE)] = grades
    return grades, problem.total(designs).free[0]


def bearing_term(problem: RvBacklash) -> Term:
    """The clearance of the crank-arm bearings at 1 um."""
    return problem.total(np.ones((1, len(problem.names)))).free[1]


def ends(problem: RvBacklash, name: str) -> tuple[float, float]:
    """Range of a variable within the limits on it."""
    return narrow_range(problem.limits, name, *problem.interval(name))


# The joint effect of modification and stagger on phi_2: one shift s, and designs that have it.


SHIFT = "phi_2_shift"
"""The shift as a feature of a form: s - low + 1."""
TRIED = 101
"""Modifications of a shift that are tried for the limits that are not linear."""
INSIDE = 1e-9
"""Distance [mm] that a modification keeps from its limits, against rounding."""


@dataclass(frozen=True)
class Shift:
    """Range [arcmin] of s = play of the modification - stagger, and where its ends are.

    `pairs` (2, 2) are modifications (dr_rp, dr_p) [mm] of least and of most play, `plays` (2,)
    those plays, `stagger` (2,) its range [arcmin] and `gain` what an arcmin of it takes from phi_2.
    """

    pairs: Array
    plays: Array
    stagger: Array
    gain: float

    @property
    def low(self) -> float:
        """Least s."""
        return float(self.plays[0] - self.gain * self.stagger[1])

    @property
    def high(self) -> float:
        """Largest s."""
        return float(self.plays[1] - self.gain * self.stagger[0])


def profile_at(problem: RvBacklash, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Outputs of the tooth modification (n,) at some columns (n,) of otherwise tight designs."""
    designs = np.repeat(problem.complete(np.atleast_2d(problem.xl)), len(next(iter(columns.values()))), axis=0)
    for name, column in columns.items():
        designs[:, problem.names.index(name)] = column
    return problem.profile(designs)


def play_slopes(problem: RvBacklash) -> Array:
    """d phi_2 [arcmin] / d (dr_rp, dr_p) [mm], (2,)."""
    model = problem.model
    unit = 2.0 * model.output_factor / model.geometry.lever / ARCMIN * MM
    return unit * np.array([1.0, -model.geometry.flank])


def shift_of(problem: RvBacklash) -> Shift | None:
    """The range of s in ranges and limits, None where these leave no room."""
    slopes = play_slopes(problem)
    least, most = (extreme_pair(problem, side * slopes) for side in (1.0, -1.0))
    if least is None or most is None:
        return None
    extremes = np.array([least, most])
    gain = problem.model.output_factor * problem.model.stagger_gain
    return Shift(extremes, extremes @ slopes, np.array(ends(problem, "stagger_arcmin")), gain)


def extreme_pair(problem: RvBacklash, goal: Array) -> tuple[float, float] | None:
    """The pair (dr_rp, dr_p) [mm] of least goal . pair in ranges and limits, None without room."""
    limits = {limit.name: limit for limit in problem.limits}
    above, below = [], []
    rows = (("radial_gap_mm", np.array([1.0, -1.0])), ("modification_backlash_arcmin", play_slopes(problem)))
    for name, row in rows:
        if name in limits:
            above += [-row, row]
            below += [-limits[name].low, limits[name].high]
    real = np.isfinite(below)
    solution = scipy.optimize.linprog(
        goal,
        A_ub=np.array(above)[real] if real.any() else None,
        b_ub=np.array(below)[real] if real.any() else None,
        bounds=[ends(problem, "dr_rp_mm"), ends(problem, "dr_p_mm")],
    )
    return (float(solution.x[0]), float(solution.x[1])) if solution.x is not None else None


def columns_of(problem: RvBacklash, shift: Shift, s: Array) -> dict[str, Array]:
    """Modification and stagger (n,) of shifts (n,): no more stagger than they need.

    Among the modifications of one play, the one with the largest margin to its limits is taken.
    """
    low, high = shift.plays
    play = np.clip(s + shift.gain * shift.stagger[0], low, high)
    stagger = np.clip((play - s) / shift.gain, *shift.stagger)
    pairs = np.array([_modification_with_most_room(problem, float(design_play)) for design_play in play]).reshape(-1, 2)
    return {"dr_rp_mm": pairs[:, 0], "dr_p_mm": pairs[:, 1], "stagger_arcmin": stagger}


def _modification_with_most_room(problem: RvBacklash, play: float) -> tuple[float, float]:
    """The modification [mm] of a play [arcmin] whose least margin to its limits is largest."""
    slopes = play_slopes(problem)
    first, second = ends(problem, "dr_rp_mm"), ends(problem, "dr_p_mm")
    along = np.array([(play - slopes[1] * end) / slopes[0] for end in second])
    low, high = max(first[0], along.min()), min(first[1], along.max())
    dr_rp = np.linspace(low, high, TRIED)
    dr_p = np.clip((play - slopes[0] * dr_rp) / slopes[1], *second)
    profile = profile_at(problem, {"dr_rp_mm": dr_rp, "dr_p_mm": dr_p})
    violations = [v for limit in problem.limits if limit.name in profile for v in limit.violations(profile[limit.name])]
    worst = np.max(violations, axis=0) if violations else np.zeros(TRIED)
    at = int(np.argmin(np.maximum(worst, -INSIDE)))
    middle = np.flatnonzero(worst <= worst[at] + INSIDE)
    chosen = int(middle[len(middle) // 2])
    return float(dr_rp[chosen]), float(dr_p[chosen])
