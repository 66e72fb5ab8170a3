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

and the least cost of tolerances that keep this is a bound of the cost. What it leaves out is the ripple of a unit,
max y - mean y > 0, by which w is smaller. With the ripples of a sample (`RippleEstimate`) the least cost lies closer to
the best allocations, but is an estimate: neither their expectation nor the least cost is proven.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache, reduce
from itertools import pairwise, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy
from numpy.polynomial import chebyshev

from ...errors import Fault
from ...models.propagation.convolution import UNIFORM, Even, EvenNormal, even_law
from ...models.rv_reducer.contact.geometry import ContactGeometry
from ...models.rv_reducer.population.units import RANGE, Involute, Profile, contact_phases, stem
from ...section import Array, Integers
from ...units import ARCMIN, MM, UM
from ..limits import loosened, narrow_range
from ..settings import YIELD
from .evaluation import by_variable

if TYPE_CHECKING:
    from .problem import RvReducer

# The least slopes of all contacts.


PIECES = 8
"""Parts of the range of the shift modification in which slopes are bounded separately."""
PHASES = 4001
"""Phases of pins at which slopes are computed: between them they are 1e-6 smaller at most."""
ROUNDING = 1e-5
"""Fraction by which slopes are lowered, for that and for the kernels, which hold them within 6e-8."""


@lru_cache(maxsize=16)
def least_slopes(geometry: ContactGeometry, shifts: tuple[float, float]) -> tuple[float, float]:
    """Least growth of a contact's turn [arcmin] by 1 um along its normal, and by 1 um of the pin circle, at all phases
    and at all shift modifications [m] in an interval.

    Normal and lever arm are polynomials in the modification, as the kernels use them. In each of `PIECES` they lie
    within the sum of the magnitudes of their other Chebyshev coefficients about the first.
    """
    low, high = RANGE if RANGE[0] <= shifts[0] and shifts[1] <= RANGE[1] else (shifts[0] - UM, shifts[1] + UM)
    profile = Profile.of(geometry, np.linspace(*contact_phases(geometry), PHASES), (low, high))
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
    return by_normal * UM / ARCMIN, by_circle * UM / ARCMIN


# The errors that all parts of a kind have in common.


SERIES = 24
"""Terms, beyond the number of parts, of a power series that is exact to rounding for arguments up to that and 4."""


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
        for m in range(SERIES + n, 0, -1):
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
    low, high = narrow_range(problem.limits, "dr_p_mm", *problem.interval("dr_p_mm"))
    by_normal, by_circle = least_slopes(geometry, (low * MM, high * MM))
    by_play = 0.25 * geometry.play_factor * UM / geometry.nominal.centre_distance / ARCMIN
    of_discs = geometry.discs, hierarchy.share_discs
    kinds: tuple[tuple[str, float, int, float], ...] = (
        ("pin_circle_radius_um", by_circle, 1, 0.0),
        ("equidistance_um", by_normal, *of_discs),
        ("shift_um", by_circle, *of_discs),
        ("crank_bearing_um", by_play, geometry.cranks * geometry.discs, 0.0),
    )
    if problem.model.coupling is not None:  # play that wrong distances take up has no part in the theorem
        kinds = kinds[:-1]
    errors, fixed = [], []
    for variable, slope, parts, common in kinds:
        even = (even_law(hierarchy.of(stem(variable))) or (0.0, None))[1]
        if isinstance(even, EvenNormal):
            even, parts = EvenNormal(even.sigma * float(np.sqrt(common + (1.0 - common) / parts))), 1
        parts = 1 if common == 1.0 else parts
        covered = parts == 1 or (common == 0.0 and (parts == 2 or even == UNIFORM))
        if even is None or slope <= 0.0 or not covered:
            fixed.append(variable)
        else:
            errors.append(CommonError(variable, 2.0 * (1.0 - ROUNDING) * slope / geometry.output_ratio, even, parts))
    return errors, fixed


# The share of units that can be good, as a cosine series, never too small.


TERMS, NODES = 128, 8192
"""Terms of the series, and nodes by which its coefficients are computed."""
ALIASES = np.pi**2 / 4.0
"""Sum of 2/(2 m - 1)^2: coefficients beyond twice the nodes times m, of which each coefficient takes up a part."""
STEPS = 1024
"""Steps of the range of a tolerance, even in the root of what lies beyond its tightest."""
SHORTEST = 1e-3
"""Period [arcmin] at limits that no unit keeps."""
SHORT = 0.003
"""Fraction by which the cost to be proven lies below the least of any tolerances that were tested: for the steps."""
CELLS, ROUNDS = 1024, 1000
"""Cells that are tested at once, and how often at most."""


class Steps(NamedTuple):
    """A tolerance of a common error at the ends (n,) of its steps, from the tightest on, and its cost there."""

    error: CommonError
    t: Array
    cost: Array


class Grade(NamedTuple):
    """The involute stage at a grade, and the cost of that and of all that has no part in the theorem."""

    involute: Involute
    cost: float


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """The share of units with phi_1 <= min(limit, limit + gap - 2 |s|), against steps of all tolerances and the grade.

    The share given s is a series in cos(k pi s/period), up to k = `TERMS` with `coefficients` (grades, terms). `waves`
    (steps, terms) are the factors of its mean by each tolerance, `ends` (steps,) those of the terms beyond, whose sum
    is at most `remainder` (grades,). `cost` are those of the tolerances (steps,) and of the grades (grades,).

    The share falls with every tolerance: a sum of independent even unimodal errors spreads with each of them
    (Birnbaum 1948, Annals of Mathematical Statistics 19, 76-81).
    """

    cost: list[Array]
    waves: list[Array]
    ends: list[Array]
    coefficients: Array
    remainder: Array

    @classmethod
    def of(cls, tolerances: list[Steps], grades: list[Grade], limit: float, gap: float) -> Level:
        """The level of a limit and gap [arcmin].

        The share given s is 0 from half the period on, and continued periodically, so that nothing is lost. Its
        coefficients fall at least like 1/k^2, by the total variation of its slope; what they take up from beyond the
        nodes is added to the first.
        """
        period = max(limit + gap - min(grade.involute.ends()[0] for grade in grades), SHORTEST)
        w, waves, ends = np.arange(TERMS + 1) * np.pi / period, [], []
        for steps in tolerances:
            phase = steps.error.slope * steps.t[:, None] * w
            waves.append(steps.error.characteristic(phase))
            ends.append(steps.error.envelope(phase[:, -1]))
        within = np.minimum(limit, limit + gap - 2.0 * (np.arange(NODES) + 0.5) * period / NODES)
        transform = scipy.fft.dct([grade.involute.cdf(within) for grade in grades])[:, : TERMS + 1]
        coefficients = np.asarray(transform / NODES, dtype=np.float64)
        fall = 4.0 * period / np.pi**2 * np.array([grade.involute.variation for grade in grades])
        coefficients[:, 0] = 0.5 * coefficients[:, 0] + (TERMS + 1) * ALIASES * fall / NODES**2
        cost = [*(steps.cost for steps in tolerances), np.array([grade.cost for grade in grades])]
        return cls(cost, waves, ends, coefficients, fall / TERMS)

    def share(self, steps: Integers) -> Array:
        """The share (n,) at the ends of steps of tolerances, and grades (n, tolerances + 1); at most too great."""
        *ends_of_steps, grade = steps.T
        waves, ends = (
            reduce(np.multiply, [table[at] for table, at in zip(tables, ends_of_steps, strict=True)])
            for tables in (self.waves, self.ends)
        )
        return np.asarray(np.einsum("nk,nk->n", waves, self.coefficients[grade]) + self.remainder[grade] * ends)

    def cells(self) -> Integers:
        """First and last steps (grades, 2, tolerances + 1) of all tolerances at each grade."""
        *last, grades = [len(cost) for cost in self.cost]
        return np.array([[[*(0 for _ in last), g], [*(count - 1 for count in last), g]] for g in range(grades)])

    def least_cost(self, share: float) -> float:
        """The least cost at which a share can be left, proven, `SHORT` of what is reached; inf where none leaves it.

        What lies in a cell costs at least what its loosest tolerances do, and leaves no more units than its tightest.
        The cheapest cells are halved first, until one of the two excludes them, or the cheapest left is the bound.
        """
        cells, target, rounds = self.cells(), np.inf, 0
        while len(cells) and (rounds := rounds + 1) <= ROUNDS:
            cost = np.sum([table[cells[:, :, at]] for at, table in enumerate(self.cost)], axis=0)
            order = np.argsort(cost[:, 1], kind="stable")
            order = order[cost[order, 1] < target]
            some, cost, cells = cells[order[:CELLS]], cost[order[:CELLS]], cells[order[CELLS:]]
            kept = self.share(some[:, 0]) >= share
            some, cost = some[kept], cost[kept]
            width = some[:, 1] - some[:, 0]
            whole = np.all(width <= 1, axis=1)
            short = cost[:, 0] - SHORT * np.abs(cost[:, 0])
            target = min(target, short.min(initial=np.inf), cost[whole, 1].min(initial=np.inf))
            some, width = some[~whole], width[~whole]
            fall = [table[some[:, 0, at]] - table[some[:, 1, at]] for at, table in enumerate(self.cost)]
            rows, at = np.arange(len(some)), np.argmax(np.where(width > 1, np.transpose(fall), -1.0), axis=1)
            tight, loose = some.copy(), some.copy()
            tight[rows, 1, at] = loose[rows, 0, at] = some[rows, :, at].sum(axis=1) // 2
            cells = np.concatenate([cells, tight, loose])
        left = np.sum([table[cells[:, 1, at]] for at, table in enumerate(self.cost)], axis=0)
        return float(left.min(initial=target))


# The bound of a problem: what its limits and objectives need of the units.


ROOM = 2.0
"""Widening of limits, in units of the room within which they count as kept."""
FAR = 60.0
"""Distance [arcmin] from a limit that is not kept within which the least one is sought."""
MAX, MEAN = "backlash_max_arcmin", "backlash_mean_arcmin"
PROBABILITY, SHARE_OF_TURN, OVERLAP = "interference_probability", "interference_share_of_turn", "overlap_p95_arcmin"
OVERLAP_SHARE = 0.95
"""Fraction of the units that `OVERLAP` is the quantile at."""
MODIFICATION = ("radial_gap_mm", "modification_backlash_arcmin")
"""Outputs of the modification alone."""
FREE = ("dr_rp_mm", "dr_p_mm", "stagger_arcmin", *MODIFICATION)
"""Nominal values, and outputs of them alone: the theorem holds at all of them."""
THEOREM = "by the theorem of de Bruijn, Tengbergen and Kruyswijk on chains"


class CommonErrorBound:
    """Lower bounds of the cost of reducers, as the head of this module derives them."""

    def __init__(self, problem: RvReducer) -> None:
        self.problem = problem

    @property
    def missing(self) -> str:
        """Why there is none, empty where there is one."""
        if made := ", ".join(self.problem.machined_tolerances):
            return f"no bound is known where machines make tolerances ({made})"
        if self.problem.model.sorting is not None:
            return "no bound is known where pins are fitted to units"
        if self.problem.model.change.outside:
            return "no bound is known where effects change the backlash outside of the contact"
        if not np.all(np.isfinite(self.problem.interval("cost"))):
            return "a tolerance has no finite cost at an end of its range"
        if not self._pairs:
            return (
                f"a bound needs {MAX}, {MEAN} or {YIELD} (no promise by samples), and interference that is counted "
                "without load, each as a limit or an objective"
            )
        return "" if self._errors[0] else "no law of an error that parts have in common is symmetric and log-concave"

    @property
    def statement(self) -> str:
        """What the bound holds for, or why there is none."""
        if self.missing:
            return self.missing
        errors, fixed = self._errors
        used = {"cost", *FREE, *(name for pair in self._pairs for name in pair)}
        asked = (*self.problem.objectives, *(limit.name for limit in self.problem.limits if limit.count))
        left_out = [name for name in dict.fromkeys(asked) if name not in used]
        grade = " and the grade" if any(variable.name == "involute_grade" for variable in self.problem.free) else ""
        if self.problem.model.coupling is not None:
            left_out = ["crank_bearing_um (wrong distances of the cranks take up its play)", *left_out]
        text = (
            f"least cost of {', '.join(error.variable for error in errors)}{grade} at which enough units can "
            f"keep backlash and interference, {THEOREM}: the backlash counts as even over the turn, all other "
            "tolerances as their widest, the modification as free; for the units as a whole, of which the values of a "
            "point are a sample"
        )
        for what, names in (("not counted, for their laws", fixed), ("left out", left_out)):
            text += f"; {what}: {', '.join(names)}" if names else ""
        return text

    @cached_property
    def _pairs(self) -> list[tuple[str, str]]:
        """Outputs whose limits or values hold the backlash, each with one that holds interference."""
        kind, limits = self.problem.model.conditions.interference, self.problem.limits
        held = {*self.problem.objectives, *(limit.name for limit in limits if np.isfinite(limit.high))}
        kept = [name for name in (MAX, MEAN) if name in held]
        kept += [YIELD] if np.isfinite(narrow_range(limits, YIELD)[0]) else []
        anywhere = {SHARE_OF_TURN, *([PROBABILITY] if kind == "share_of_turn" else [])}
        missed = {PROBABILITY, SHARE_OF_TURN, OVERLAP} & held - ({PROBABILITY} if kind == "preload" else set())
        return [pair for pair in product(kept, sorted(missed)) if pair[0] != MEAN or pair[1] not in anywhere]

    def _upper(self, name: str, values: Mapping[str, Array]) -> Array:
        """Upper limits of an output at points: that of the run, and their own value of an objective."""
        own = values[name] if name in self.problem.objectives and name in values else np.inf
        return loosened(np.minimum(own, narrow_range(self.problem.limits, name)[1]), ROOM)

    def _needed(self, pair: tuple[str, str], values: Mapping[str, Array], points: int) -> Array:
        """Share of good units, limit and gap [arcmin] (points, 3) that a pair of outputs needs."""
        (kept, missed), conditions = pair, self.problem.model.conditions
        share, limit = np.array(conditions.coverage), self._upper(kept, values)
        if kept == YIELD:
            least = narrow_range(self.problem.limits, YIELD)[0]
            share, limit = 0.01 * loosened(least, -ROOM), np.array(conditions.limit)
        allowed, gap = self._upper(missed, values), np.zeros(1)
        if missed == OVERLAP:
            allowed, gap = np.array(1.0 - OVERLAP_SHARE), allowed
        elif missed == PROBABILITY and conditions.interference == "overlap":
            gap = np.array(conditions.overlap)
        return np.stack([np.broadcast_to(value, points) for value in (share - allowed, limit, gap)], axis=1)

    @cached_property
    def _errors(self) -> tuple[list[CommonError], list[str]]:
        return common_errors(self.problem)

    @cached_property
    def _tolerances(self) -> list[Steps]:
        tolerances = []
        for error in self._errors[0]:
            low, high = self.problem.interval(error.variable)
            parts = np.linspace(0.0, 1.0, (STEPS if low < high else 1) + 1)
            t = low + (high - low) * parts**2
            curve = self.problem.settings.costs.get(error.variable)
            cost = np.zeros_like(t) if curve is None else np.minimum.accumulate(curve.cost(t))
            tolerances.append(Steps(error, t, cost))
        return tolerances

    @cached_property
    def _grades(self) -> list[Grade]:
        """Every grade, its cost with that of all other tolerances at their widest."""
        problem, counted = self.problem, {steps.error.variable for steps in self._tolerances}
        low, high = problem.interval("involute_grade")
        grades = np.arange(np.rint(low), np.rint(high) + 1.0) if low < high else np.array([low])
        designs = np.tile([problem.interval(name)[1] for name in problem.names], (len(grades), 1))
        designs[:, problem.names.index("involute_grade")] = grades
        costs = [cost for name, cost in problem.costs_of(designs).items() if name not in counted]
        rest = np.sum(costs, axis=0) + np.zeros(len(grades))
        return [Grade(stage, float(cost)) for stage, cost in zip(problem.tightest_gears(grades), rest, strict=True)]

    def least_costs(self, values: Mapping[str, Array], points: int) -> Array:
        """Least costs (points,) at limits and at values (points,) of the objectives: inf where no design keeps them,
        NaN where they are not known.
        """
        bounds, needs = np.full(points, np.nan), [self._needed(pair, values, points) for pair in self._pairs]
        for at, (share, limit, gap) in enumerate(np.concatenate(needs)):
            if np.all(np.isfinite([share, limit, gap])):
                least = Level.of(self._tolerances, self._grades, limit, gap).least_cost(share)
                bounds[at % points] = np.fmax(bounds[at % points], least)
        return bounds

    def estimate(self, values: Mapping[str, float]) -> RippleEstimate | None:
        """What the ripple of sampled units needs at the limits and at values of the objectives; None where no pair of
        outputs holds both the largest backlash and the mean over the turn.
        """
        if self.missing:
            return None
        columns, conditions = {name: np.array([value]) for name, value in values.items()}, self.problem.model.conditions
        for kept, missed in self._pairs:
            share, limit, gap = self._needed((kept, missed), columns, 1)[0].tolist()
            of_the_mean = missed == OVERLAP or (missed == PROBABILITY and conditions.interference != "share_of_turn")
            if kept != MEAN and of_the_mean and np.all(np.isfinite([share, limit, gap])):
                return RippleEstimate(self.problem, self._errors[0], self._grades, share, limit, gap)
        return None

    def _spare(self, limit: float, gap: float, share: float) -> float:
        """What the tightest tolerances leave of units beyond a share, at the best grade."""
        tightest = [steps._replace(t=steps.t[:1], cost=steps.cost[:1]) for steps in self._tolerances]
        level = Level.of(tightest, self._grades, limit, gap)
        return float(level.share(level.cells()[:, 0]).max()) - share

    def faults(self) -> list[Fault]:
        """A fault for each limit on backlash or yield that no design keeps together with one on interference."""
        faults = {}
        for pair in [] if self.missing else self._pairs:
            share, limit, gap = needed = self._needed(pair, {}, 1)[0]
            if np.all(np.isfinite(needed)) and self._spare(limit, gap, share) < 0.0:
                least = scipy.optimize.brentq(self._spare, limit, limit + FAR, args=(gap, share))
                faults[pair[0]] = Fault(
                    f"limits.{pair[0]}",
                    f"cannot be kept together with limits.{pair[1]}, {THEOREM}: so many units with the tightest "
                    f"tolerances need {least:.4g} arcmin at least, the limit is {limit:g}; relax one of the two or "
                    "widen the ranges",
                )
        return list(faults.values())


# The same with the ripple of units over the turn, as a sample shows it.


WAVES, PLACES = 128, 96
"""Terms of the series of the density of |sum c_j z_j|, and places at which it is integrated."""
COSINES = np.cos(np.outer((np.arange(PLACES) + 0.5) * np.pi / (2 * PLACES), np.arange(WAVES + 1)))
COSINES[:, 1:] *= 2.0
SHARES = 0.05
"""Share of the units that counts as much as the range of a variable."""
TINY = 1e-3
"""Least size of a limit on the modification [mm, arcmin] that its margin is compared with."""
STEP = 1e-4
"""Step, relative to a tolerance, of the differences of a characteristic function by it."""


@dataclass(frozen=True, slots=True, eq=False)
class RippleEstimate:
    """The share of units that can be good where the ripple max y - mean y of each is that of the search's sample.

    E P(phi_1 <= min(limit, limit + gap - ripple - 2 |sum c_j z_j|)) has to reach the share that is `needed`.
    """

    problem: RvReducer
    errors: list[CommonError]
    grades: list[Grade]
    needed: float
    limit: float
    gap: float

    @property
    def units(self) -> int:
        """Units of the sample."""
        return self.problem.populations(searching=True).rigid.units

    def margins(self, design: Array) -> tuple[Array, Array]:
        """What the share at a full design (variables,) exceeds the needed one by, and what limits on the modification
        leave, relative to their size (m,), and the derivatives (m, variables) by all but the grade.
        """
        share, slopes = self.share(design)
        margins, rows = [(share - self.needed) / SHARES], [slopes / SHARES]
        values = self.problem.profile(design[None, :])
        by_variable = self.problem.plain_slopes(design[None, :])
        for limit in self.problem.limits:
            for end, sign in ((limit.low, 1.0), (limit.high, -1.0)) if limit.name in MODIFICATION else ():
                if np.isfinite(end):
                    margins.append(sign * (float(values[limit.name][0]) - end) / max(abs(end), TINY))
                    rows.append(sign * by_variable[limit.name][0] / max(abs(end), TINY))
        return np.array(margins), np.array(rows)

    def _involute(self, design: Array) -> Involute:
        low = np.rint(self.problem.interval("involute_grade")[0])
        place = int(np.rint(design[self.problem.names.index("involute_grade")]) - low)
        return self.grades[place if len(self.grades) > 1 else 0].involute

    def share(self, design: Array, searching: bool = True) -> tuple[float, Array]:
        """The share at a full design (variables,), and its derivatives (variables,) by all but the grade.

        Ripples are those of the search's units, or of the units that points are reported on.
        """
        problem, involute = self.problem, self._involute(design)
        turn = problem.evaluation(design, searching).turn
        play, unit = turn.play, np.arange(turn.play.shape[1])
        at = play.argmax(axis=0)
        ripple = play[at, unit] - play.mean(axis=0, dtype=np.float64)
        period = max(self.limit + self.gap - involute.ends()[0], SHORTEST)
        w, place = np.arange(WAVES + 1) * np.pi / period, (np.arange(PLACES) + 0.5) * period / PLACES
        within = np.minimum(self.limit, self.limit + self.gap - place - ripple[:, None])
        below = involute.cdf(within).mean(axis=0)
        t = [design[problem.names.index(error.variable)] for error in self.errors]
        waves = [error.characteristic(error.slope * size * w) for error, size in zip(self.errors, t, strict=True)]
        density = COSINES @ reduce(np.multiply, waves) / (2 * PLACES)
        by_ripple = -(involute.density(within) * (within < self.limit)) @ density / len(unit)
        weight = np.tile(-by_ripple / len(play), (len(play), 1))
        weight[at, unit] += by_ripple
        slopes = by_variable(turn.slopes(weight))
        for j, (error, size) in enumerate(zip(self.errors, t, strict=True)):
            step = STEP * max(size, STEP)
            higher, lower = (error.characteristic(error.slope * (size + move) * w) for move in (step, -step))
            others = reduce(np.multiply, [*waves[:j], *waves[j + 1 :], 0.5 * (higher - lower) / step])
            slopes[error.variable] += float(below @ (COSINES @ others)) / (2 * PLACES)
        return float(below @ density), np.array([slopes.get(name, 0.0) for name in problem.names])
