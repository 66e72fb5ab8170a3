"""A lower bound of the cost of reducers on the exact contact, by the errors that all parts have in common.

y, the backlash of the cycloid stage at one position of the turn, is the least over pairs of contacts of forms that are
affine in the errors. Each grows with every common error x_j of a unit (pin circle, mean equidistance, minus the mean
shift, mean clearance of the crank bearings) by at least c_j. Fix all other errors, and phi_1. A unit is good where the
turn mean of y is not below 0 and phi_1 + max y <= L. For two good units x <= x'

    sum c_j (x'_j - x_j) <= mean y(x') - mean y(x) <= max y(x') <= L - phi_1 = w,

so that good units hold no chain longer than w. Among all such sets in a product of chains the middle slab is the
largest (de Bruijn, van Ebbenhorst Tengbergen & Kruyswijk 1951, Nieuw Archief voor Wiskunde 23, 191-193; for several
ranks as in Erdos 1945, Bull. AMS 51, 898-902). By ever finer chains this holds for uniform errors, and by mixing them
for unimodal ones: P(good) <= P(2 |sum c_j z_j| <= w), z_j the errors about their means. A quantile at 99.73 % and an
interference of at most 5 % therefore need

    P(phi_1 + 2 |sum c_j z_j| <= L) >= 0.9973 - 0.05,

and the least cost of tolerances that keep this is a bound of the cost.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.polynomial import chebyshev

from ...errors import Fault
from ...models.costs import Table
from ...models.propagation.convolution import UNIFORM, Even, EvenNormal, even_law
from ...models.rv_reducer.population.errors import Lattice, turn_lattice
from ...models.rv_reducer.population.units import Involute, Profile, stem
from ...section import Array, Integers
from ...units import ARCMIN, MM, UM
from ..limits import loosened, narrow_range
from ..settings import YIELD

if TYPE_CHECKING:
    from .problem import RvReducer

# The least slopes of all contacts.


PIECES = 8
"""Parts of the range of the shift modification in which slopes are bounded separately."""
SINGLE_PRECISION = 1e-5
"""Fraction by which slopes are lowered: the kernels hold them within 6e-8."""


def least_slopes(profile: Profile, shifts: tuple[float, float]) -> tuple[float, float]:
    """Least growth of a contact's turn [arcmin] by 1 um along its normal, and by 1 um of the pin circle, over the
    contacts of a profile at all shift modifications [m] in an interval.

    Normal and lever arm are polynomials in the modification, as the kernels use them. In each of `PIECES` they lie
    within the sum of the magnitudes of their other Chebyshev coefficients about the first.
    """
    low, high = profile.shifts
    if not (low <= shifts[0] and shifts[1] <= high):
        low, high = shifts[0], max(shifts[1], shifts[0] + UM)
        profile = Profile.of(profile.geometry, profile.phase, (low, high))
    count = len(profile.coefficients)
    nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    to_series = np.linalg.inv(chebyshev.chebvander(nodes, count - 1))
    by_normal = by_circle = np.inf
    for start, end in pairwise(np.linspace(*shifts, PIECES + 1)):
        at = (start + end + (end - start) * nodes - low - high) / (high - low)
        to_piece = to_series @ chebyshev.chebvander(at, count - 1)
        along, arm = np.einsum("nk,kic->inc", to_piece, profile.coefficients[:, [1, 3]])
        reach, arm_reach = np.abs(along[1:]).sum(axis=0), np.abs(arm[1:]).sum(axis=0)
        longest, least = arm[0] + arm_reach, along[0] - reach
        by_normal = min(by_normal, float(1.0 / longest.max()))
        by_circle = min(by_circle, float(np.min(least / np.where(least > 0.0, longest, arm[0] - arm_reach))))
    unit = (1.0 - SINGLE_PRECISION) * UM / ARCMIN
    return unit * by_normal, unit * by_circle


# The errors that all parts of a kind have in common.


SERIES = 24
"""Terms of a power series that is exact to rounding for arguments up to the number of parts and 4."""


@dataclass(frozen=True, slots=True)
class CommonError:
    """The mean of so many independent errors with the `law` of z, given their differences.

    `variable` is its tolerance, `slope` the least growth of y [arcmin] by it at z = 1. For one or two parts the mean
    about its middle has the law of the mean. n uniform parts leave a uniform mean in a range that their differences
    narrow, on average the density (n/2) (1 - |z|)^(n-1).
    """

    variable: str
    slope: float
    law: Even
    parts: int = 1

    def characteristic(self, w: Array) -> Array:
        """E cos(w z), shape of `w`."""
        if self.parts <= 2:
            return np.asarray(self.law.value(w / self.parts) ** self.parts)
        n, small = self.parts, w < self.parts + 4.0
        near, square = np.ones_like(w[small]), w[small] ** 2
        for m in range(SERIES, 0, -1):
            near = 1.0 - square / ((n + 2 * m - 1) * (n + 2 * m)) * near
        far = np.cos(w[~small]) if n % 2 == 0 else np.sinc(w[~small] / np.pi)
        for k in range(2 + n % 2, n + 1, 2):
            far = k * (k - 1) / w[~small] ** 2 * (1.0 - far)
        value = np.empty_like(w)
        value[small], value[~small] = near, far
        return value

    def envelope(self, w: Array) -> Array:
        """A bound of the magnitude of `characteristic` from w on, shape of `w`."""
        if self.parts <= 2:
            return np.asarray(np.minimum(self.law.envelope(w / self.parts)[0], 1.0) ** self.parts)
        return np.asarray(np.minimum(1.0, self.parts / np.maximum(w, 1e-300)))


def common_errors(problem: RvReducer) -> tuple[list[CommonError], list[str]]:
    """The common errors whose laws the theorem covers, and the variables of those that count as fixed."""
    geometry, hierarchy = problem.model.geometry, problem.model.hierarchy
    lattice = Lattice.of(geometry, turn_lattice(problem.count("positions"), geometry.nominal.cycloid_teeth))
    low, high = narrow_range(problem.limits, "dr_p_mm", *problem.interval("dr_p_mm"))
    by_normal, by_circle = least_slopes(lattice.profile, (low * MM, high * MM))
    by_play = 0.25 * UM / geometry.nominal.centre_distance / ARCMIN
    counted, share = (geometry.discs, hierarchy.share_discs), geometry.cranks * geometry.discs
    kinds = (
        ("pin_circle_radius_um", by_circle, 1, 0.0),
        ("equidistance_um", by_normal, *counted),
        ("shift_um", by_circle, *counted),
        ("crank_bearing_um", by_play, share, 0.0),
    )
    errors, fixed = [], []
    for variable, slope, parts, fraction in kinds:
        law = _law_of_mean(even_law(hierarchy.of(stem(variable))), parts, fraction)
        if law is None or slope <= 0.0:
            fixed.append(variable)
        else:
            errors.append(CommonError(variable, 2.0 * slope / geometry.output_ratio, *law))
    return errors, fixed


def _law_of_mean(law: tuple[float, Even] | None, parts: int, share: float) -> tuple[Even, int] | None:
    """Law and number of the parts that a mean is of, which have a `share` of their variance in common."""
    if law is None:
        return None
    even = law[1]
    if isinstance(even, EvenNormal):
        return EvenNormal(even.sigma * float(np.sqrt(share + (1.0 - share) / parts))), 1
    if share == 1.0:
        return even, 1
    return (even, parts) if share == 0.0 and (parts <= 2 or even == UNIFORM) else None


# The chance that a unit can be good, as a cosine series, never too small.


TERMS, NODES = 128, 32_768
"""Terms of the series, and nodes by which its coefficients are computed."""
ALIASES = np.pi**2 / 4.0
"""Sum of 2/(2 m - 1)^2 over m: coefficients beyond twice the nodes that each coefficient takes up."""


@dataclass(frozen=True, slots=True, eq=False)
class Chance:
    """P(phi_1 <= min(limit, limit + gap - 2 |s|)) as a series in cos(k pi s/period), k = 0 .. `TERMS`.

    The series continues the chance, which is 0 from half the period on, periodically: nothing is lost. The terms
    beyond fall at least like 1/k^2 with the total variation of the slope; `rounding` bounds what the coefficients
    take up of them by their sampling, `remainder` their sum.
    """

    coefficients: Array
    remainder: float
    rounding: float

    @classmethod
    def of(cls, involute: Involute, limit: float, gap: float, period: float) -> Chance:
        """The chance [arcmin] at one grade."""
        s = (np.arange(NODES) + 0.5) * period / NODES
        coefficients = scipy.fft.dct(involute.cdf(np.minimum(limit, limit + gap - 2.0 * s)))[: TERMS + 1] / NODES
        coefficients[0] *= 0.5
        fall = 2.0 * period / np.pi**2 * 2.0 * involute.variation
        return cls(coefficients, fall / TERMS, (TERMS + 1) * ALIASES * fall / NODES**2 + 1e-12)


# The least cost of tolerances and a grade at which enough units can be good.


STEPS = 1024
"""Steps of the range of a tolerance, even in its logarithm."""
NARROWEST = 1e-3
"""Fraction of the end of a range up to which its beginning is one step."""
SHORT = 0.003
"""Fraction by which the cost to be proven lies below one that a local search reaches: it is left to the steps."""
CELLS = 8192
"""Cells that are tested at once."""
STARTS = 33
"""Designs between the tightest and the loosest, the loosest feasible of which the local search starts from."""


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """A tolerance of a common error at the ends (n,) of its steps, from the tightest on, and its cost there."""

    error: CommonError
    t: Array
    cost: Array


@dataclass(frozen=True, slots=True)
class Grade:
    """The involute stage at one grade, with its cost and that of all that has no part in the theorem."""

    involute: Involute
    cost: float


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """The share of units that can be good at one grade, against tolerances by their steps.

    `waves` (n, terms) are the factors of the terms by each tolerance, `ends` (n,) those of the terms beyond. The share
    falls with every tolerance, because a sum of independent even unimodal errors spreads with each of them
    (Birnbaum 1948, Annals of Mathematical Statistics 19, 76-81).
    """

    tolerances: list[Steps]
    waves: list[Array]
    ends: list[Array]
    chance: Chance
    wanted: float

    def _spare(self, waves: Array, last: Array) -> Array:
        chance = self.chance
        return np.asarray(waves @ chance.coefficients + chance.remainder * last + chance.rounding - self.wanted)

    def spare(self, steps: Integers) -> Array:
        """The share (n,) beyond the wanted one at the ends of steps (n, tolerances)."""
        spare = np.empty(len(steps))
        for first in range(0, len(steps), CELLS):
            part = steps[first : first + CELLS]
            waves, last = np.ones((len(part), TERMS + 1)), np.ones(len(part))
            for at, (wave, end) in enumerate(zip(self.waves, self.ends, strict=True)):
                waves *= wave[part[:, at]]
                last *= end[part[:, at]]
            spare[first : first + CELLS] = self._spare(waves, last)
        return spare

    def reached(self) -> float:
        """A cost at which the share is left, by a local search between the steps; inf where there is none."""
        last = np.array([len(steps.t) - 1 for steps in self.tolerances])

        def between(x: Array, tables: list[Array]) -> Iterator[Array]:
            for place, most, table in zip(x, last, tables, strict=True):
                step = min(int(place * most), most - 1)
                yield table[step] + (place * most - step) * (table[step + 1] - table[step])

        def cost(x: Array) -> float:
            return float(sum(between(x, [steps.cost for steps in self.tolerances])))

        def spare(x: Array) -> float:
            return float(self._spare(np.prod(list(between(x, self.waves)), axis=0), np.zeros(1)).item())

        starts = [np.full(len(last), part) for part in np.linspace(0.0, 1.0, STARTS)]
        start = next((x for x in reversed(starts) if spare(x) >= 0.0), None)
        if start is None:
            return np.inf
        found = scipy.optimize.minimize(
            cost, start, method="SLSQP", bounds=[(0.0, 1.0)] * len(last), constraints={"type": "ineq", "fun": spare}
        )
        return min(cost(start), cost(found.x) if spare(found.x) >= -1e-6 else np.inf)

    def proven(self, target: float) -> float:
        """The least cost at which the share can be left, `target` where none below it is.

        A cell spans steps of all tolerances but the last. What lies in it costs at least what its loosest do, and
        leaves no more units than its tightest: with the tightest of the last tolerance that is cheap enough it is
        tested whole, and halved where it may hold something.
        """
        *cut, last = self.tolerances
        first, end = np.zeros((1, len(cut)), np.int64), np.array([[len(steps.t) - 1 for steps in cut]])
        while len(first):
            cost = np.sum([steps.cost[end[:, at]] for at, steps in enumerate(cut)], axis=0)
            step = np.searchsorted(-last.cost[1:], cost - target, side="right")
            kept = step < len(last.t) - 1
            kept[kept] = self.spare(np.column_stack([first[kept], step[kept]])) >= 0.0
            first, end, cost, step = (values[kept] for values in (first, end, cost, step))
            whole = np.all(end - first == 1, axis=1)
            loosest = self._loosest(first[whole], step[whole])
            target = float(np.min(cost[whole] + last.cost[loosest + 1], initial=target))
            first, end = self._halved(first[~whole], end[~whole])
        return target

    def _loosest(self, first: Integers, low: Integers) -> Integers:
        """The last step (n,) of the last tolerance that leaves the share, which `low` (n,) do."""
        high = np.full(len(low), len(self.tolerances[-1].t) - 1)
        while np.any(high - low > 1):
            middle = (low + high) // 2
            fits = self.spare(np.column_stack([first, middle])) >= 0.0
            low, high = np.where(fits, middle, low), np.where(fits, high, middle)
        return low

    def _halved(self, first: Integers, end: Integers) -> tuple[Integers, Integers]:
        """Cells cut in two where their cost varies most."""
        fall = [s.cost[first[:, at]] - s.cost[end[:, at]] for at, s in enumerate(self.tolerances[:-1])]
        varies = np.where(end - first > 1, np.reshape(fall, end.T.shape).T, -1.0)
        rows, at = np.arange(len(first)), np.argmax(varies, axis=1)
        middle = (first[rows, at] + end[rows, at]) // 2
        lower_end, upper_first = end.copy(), first.copy()
        lower_end[rows, at] = upper_first[rows, at] = middle
        return np.concatenate([first, upper_first]), np.concatenate([lower_end, end])


def levels(tolerances: list[Steps], grades: list[Grade], needed: Array) -> Iterator[tuple[Level, Grade]]:
    """The grades at which the tightest tolerances leave a share of units, limit and gap [arcmin] in `needed`."""
    wanted, limit, gap = needed.tolist()
    period = limit + gap - min(grade.involute.ends()[0] for grade in grades)
    if period <= 0.0:
        return
    w = np.arange(TERMS + 1) * np.pi / period
    scales = [(steps.error, steps.error.slope * steps.t) for steps in tolerances]
    waves = [error.characteristic(scale[:, None] * w) for error, scale in scales]
    ends = [error.envelope(scale * w[-1]) for error, scale in scales]
    for grade in grades:
        level = Level(tolerances, waves, ends, Chance.of(grade.involute, limit, gap, period), wanted)
        if level.spare(np.zeros((1, len(tolerances)), np.int64))[0] >= 0.0:
            yield level, grade


def least_cost(tolerances: list[Steps], grades: list[Grade], needed: Array) -> float:
    """Proven least cost at which a share of units can be good: `needed` are share, limit and gap [arcmin].

    inf where no tolerances and grade leave the share.
    """
    possible = list(levels(tolerances, grades, needed))
    proven = (1.0 - SHORT) * min((grade.cost + level.reached() for level, grade in possible), default=np.inf)
    for level, grade in possible:
        proven = min(proven, grade.cost + level.proven(proven - grade.cost))
    return proven


# The bound of a problem: what its limits and objectives need of the units.


SOLVED = 100
"""Sets of limits that are solved at most; others have the bound of the next looser one."""
DEAREST = 1e12
"""Cost that stands for an infinite one."""
ROOM = 2.0
"""Widening of limits, in units of the room within which they count as kept."""
BISECTIONS = 40
MAX, MEAN = "backlash_max_arcmin", "backlash_mean_arcmin"
PROBABILITY, SHARE_OF_TURN, OVERLAP = "interference_probability", "interference_share_of_turn", "overlap_p95_arcmin"
OVERLAP_SHARE = 0.95
"""Fraction of the units that `OVERLAP` is the quantile at."""
FREE = ("dr_rp_mm", "dr_p_mm", "stagger_arcmin", "radial_gap_mm", "modification_backlash_arcmin")
"""Nominal values, and outputs of them alone: the theorem holds at all of them."""
THEOREM = "by the theorem of de Bruijn, Tengbergen and Kruyswijk on chains"


class CommonErrorBound:
    """Lower bounds of the cost of reducers, as the head of this module derives them."""

    def __init__(self, problem: RvReducer) -> None:
        self.problem = problem

    @cached_property
    def missing(self) -> str:
        """Why there is none, empty where there is one."""
        if made := ", ".join(self.problem.machined_tolerances):
            return f"no bound is known where machines make tolerances ({made})"
        if self.problem.model.change.outside:
            return "no bound is known where effects change the backlash outside of the contact"
        if not self._pairs:
            return (
                "a bound needs backlash_max_arcmin, backlash_mean_arcmin or yield_percent, and interference that is "
                "counted without load, each as a limit or an objective"
            )
        return "" if self._errors[0] else "no law of an error that parts have in common is symmetric and log-concave"

    @cached_property
    def statement(self) -> str:
        """What the bound holds for, or why there is none."""
        if self.missing:
            return self.missing
        errors, fixed = self._errors
        used = {"cost", *FREE, *(name for pair in self._pairs for name in pair)}
        asked = (*self.problem.objectives, *(limit.name for limit in self.problem.limits if limit.count))
        left_out = [name for name in dict.fromkeys(asked) if name not in used]
        return "; ".join(
            [
                f"least cost of {', '.join(error.variable for error in errors)} and the grade at which enough units "
                f"can keep backlash and interference, {THEOREM}: the backlash counts as even over the turn, all other "
                "tolerances as their widest, the modification as free; for the units as a whole, of which the values "
                "of a point are a sample",
                *([f"not counted, for their laws: {', '.join(fixed)}"] if fixed else []),
                *([f"left out: {', '.join(left_out)}"] if left_out else []),
            ]
        )

    # ---------------------------------------------------------------- what is needed

    def _upper(self, name: str, values: Mapping[str, Array]) -> Array:
        """Upper limits of an output at points: that of the run, and their own value of an objective."""
        own = values[name] if name in self.problem.objectives and name in values else np.inf
        return loosened(np.minimum(own, narrow_range(self.problem.limits, name)[1]), ROOM)

    @cached_property
    def _pairs(self) -> list[tuple[str, str]]:
        """Outputs whose limits or values hold the backlash, each with one that holds interference."""
        kind = self.problem.model.conditions.interference
        held = {*self.problem.objectives, *(limit.name for limit in self.problem.limits if np.isfinite(limit.high))}
        backlash = [name for name in (MAX, MEAN) if name in held]
        if np.isfinite(narrow_range(self.problem.limits, YIELD)[0]):
            backlash.append(YIELD)
        anywhere = {SHARE_OF_TURN, *([PROBABILITY] if kind == "share_of_turn" else [])}
        interference = {PROBABILITY, SHARE_OF_TURN, OVERLAP} & held - ({PROBABILITY} if kind == "preload" else set())
        return [pair for pair in product(backlash, sorted(interference)) if pair[0] != MEAN or pair[1] not in anywhere]

    def _needed(self, pair: tuple[str, str], values: Mapping[str, Array], points: int) -> Array:
        """Share of good units, limit and gap [arcmin] (points, 3) that a pair of outputs needs."""
        kept, missed = pair
        conditions = self.problem.model.conditions
        share, limit = conditions.coverage, self._upper(kept, values)
        if kept == YIELD:
            share = 0.01 * float(loosened(narrow_range(self.problem.limits, YIELD)[0], -ROOM))
            limit = np.array(conditions.limit)
        overlaps = missed == PROBABILITY and conditions.interference == "overlap"
        gap = conditions.overlap if overlaps else 0.0
        allowed = self._upper(missed, values)
        if missed == OVERLAP:
            gap, allowed = allowed, np.array(1.0 - OVERLAP_SHARE)
        return np.stack([np.broadcast_to(v, points) for v in (share - allowed, limit, gap)], axis=1)

    # ---------------------------------------------------------------- costs

    @cached_property
    def _errors(self) -> tuple[list[CommonError], list[str]]:
        return common_errors(self.problem)

    @cached_property
    def _tolerances(self) -> list[Steps]:
        """Tolerances of the common errors, that with the greatest range of costs last."""
        steps = [self._steps(error) for error in self._errors[0]]
        return sorted(steps, key=lambda s: float(s.cost[0] - s.cost[-1]))

    def _steps(self, error: CommonError) -> Steps:
        low, high = self.problem.interval(error.variable)
        t = np.array([low, high])
        if low < high:
            t = np.geomspace(max(low, NARROWEST * high), high, STEPS + 1)
            t[0] = low
        curve = self.problem.settings.costs.get(error.variable)
        priced = np.minimum(t, curve.t[-1]) if isinstance(curve, Table) else t
        with np.errstate(divide="ignore"):
            cost = np.zeros_like(t) if curve is None else curve.cost(priced)
        return Steps(error, t, np.minimum.accumulate(np.minimum(cost, DEAREST)))

    @cached_property
    def _grades(self) -> list[Grade]:
        """Every grade, with its cost and that of all other tolerances at their widest."""
        problem, counted = self.problem, {steps.error.variable for steps in self._tolerances}
        low, high = problem.interval("involute_grade")
        grades = np.arange(np.rint(low), np.rint(high) + 1.0) if low < high else np.array([low])
        designs = np.tile([problem.interval(name)[1] for name in problem.names], (len(grades), 1))
        designs[:, problem.names.index("involute_grade")] = grades
        costs = [cost for name, cost in problem.costs_of(designs).items() if name not in counted]
        whole = np.minimum(np.sum(costs, axis=0), DEAREST)
        return [Grade(problem.model.involute(grade), float(cost)) for grade, cost in zip(grades, whole, strict=True)]

    def least_costs(self, values: Mapping[str, Array], points: int) -> Array:
        """Least costs (points,) at limits and at values (points,) of the objectives; inf where no design keeps them."""
        bounds = np.full(points, -np.inf)
        for pair in self._pairs:
            needed, place = np.unique(self._needed(pair, values, points), axis=0, return_inverse=True)
            bounds = np.maximum(bounds, self._solved(needed)[np.ravel(place)])
        return bounds

    def _solved(self, needed: Array) -> Array:
        """Least costs (n,) of needs (n, 3): where they are too many, of some, and of others by looser ones."""
        order = np.argsort(needed[:, 1], kind="stable")
        rows = needed[order[np.unique(np.linspace(0, len(order) - 1, SOLVED).astype(int))]]
        loosest = np.array([needed[:, 0].min(), *needed[:, 1:].max(axis=0)])
        costs, tighter = np.full(len(needed), -np.inf), needed * [1.0, -1.0, -1.0]
        for row in np.unique([loosest, *rows], axis=0):
            beyond = np.all(tighter >= row * [1.0, -1.0, -1.0], axis=1)
            costs[beyond] = np.maximum(costs[beyond], least_cost(self._tolerances, self._grades, row))
        return costs

    # ---------------------------------------------------------------- limits that nothing keeps

    def _best(self, limit: float, gap: float) -> float:
        """The greatest share of units that any tolerances allow to be good."""
        tightest = [Steps(steps.error, steps.t[:1], steps.cost[:1]) for steps in self._tolerances]
        first = np.zeros((1, len(tightest)), np.int64)
        every = levels(tightest, self._grades, np.array([0.0, limit, gap]))
        return max((float(level.spare(first)[0]) for level, _ in every), default=0.0)

    def faults(self) -> list[Fault]:
        """A fault for each limit on backlash or yield that no design keeps together with one on interference."""
        faults = {}
        for kept, missed in [] if self.missing else self._pairs:
            share, limit, gap = self._needed((kept, missed), {}, 1)[0].tolist()
            if not np.isfinite(limit) or (best := self._best(limit, gap)) >= share:
                continue
            stated = narrow_range(self.problem.limits, kept)
            if kept == YIELD:
                most = min(stated[0] - 100.0 * (share - best), 100.0)
                asked, reach = f"at least {stated[0]:g} %", f"at most {most:.4g} %"
            else:
                asked, reach = (
                    f"at most {stated[1]:g} arcmin",
                    f"no less than {self._least(share, limit, gap):.4g} arcmin",
                )
            faults[kept] = Fault(
                f"limits.{kept}",
                f"{asked} cannot be kept together with limits.{missed}, {THEOREM}: the tightest tolerances allow "
                f"{reach}; relax one of the limits or widen the ranges",
            )
        return list(faults.values())

    def _least(self, share: float, low: float, gap: float) -> float:
        """The least limit [arcmin] above `low` at which a share of units can be good, found from below."""
        high = 2.0 * abs(low) + 1.0
        while self._best(high, gap) < share:
            low, high = high, 2.0 * high
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self._best(middle, gap) >= share else (middle, high)
        return low
