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
from ...section import Array, Flags, Integers, number
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


STEPS = 256
"""Steps of the range of a tolerance, even in its logarithm."""
NARROWEST = 1e-3
"""Fraction of the end of a range up to which its beginning is one step."""
SHORT = 0.01
"""Fraction of a cost that is reached by which the cost to be proven lies below it: it is left to the steps."""
CELLS = 8192
"""Cells that are tested at once."""


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """A tolerance of a common error at the ends (n,) of its steps, from the tightest on, and its cost there."""

    error: CommonError
    t: Array
    cost: Array


class Level:
    """The share of units that can be good against tolerances, at one grade, limit and gap.

    It falls with every tolerance, because a sum of independent even unimodal errors spreads with each of them
    (Birnbaum 1948, Annals of Mathematical Statistics 19, 76-81).
    """

    def __init__(self, tolerances: list[Steps], involute: Involute, limit: float, gap: float) -> None:
        period = limit + gap - involute.ends()[0]
        self.tolerances, self.chance = tolerances, Chance.of(involute, limit, gap, period)
        self.frequencies = np.arange(TERMS + 1) * np.pi / period
        tabulated = [self._factors(at, steps.t) for at, steps in enumerate(tolerances)]
        self.waves, self.ends = [wave for wave, _ in tabulated], [end for _, end in tabulated]

    def _factors(self, at: int, t: Array) -> tuple[Array, Array]:
        """Factors of all terms (n, terms) and of those beyond (n,) by a tolerance t (n,)."""
        error = self.tolerances[at].error
        scale = error.slope * t
        waves = error.characteristic(scale[:, None] * self.frequencies)
        return waves, error.envelope(scale * self.frequencies[-1])

    def _share(self, waves: Array, last: Array) -> Array:
        chance = self.chance
        return np.asarray(waves @ chance.coefficients + chance.remainder * last + chance.rounding)

    def shares(self, steps: Integers) -> Array:
        """The share (n,) at the ends of steps (n, tolerances)."""
        shares = np.empty(len(steps))
        for first in range(0, len(steps), CELLS):
            part = steps[first : first + CELLS]
            waves, last = np.ones((len(part), TERMS + 1)), np.ones(len(part))
            for at, (wave, end) in enumerate(zip(self.waves, self.ends, strict=True)):
                waves *= wave[part[:, at]]
                last *= end[part[:, at]]
            shares[first : first + CELLS] = self._share(waves, last)
        return shares

    def reached(self, share: float) -> float:
        """The cost of tolerances that a local search finds to leave this share; inf where it finds none."""
        ends = np.log([(steps.t[0], steps.t[-1]) for steps in self.tolerances])

        def cost(x: Array) -> float:
            return float(sum(np.interp(v, np.log(s.t), s.cost) for v, s in zip(x, self.tolerances, strict=True)))

        def spare(x: Array) -> float:
            factors = [self._factors(at, np.exp([v])) for at, v in enumerate(x)]
            waves, last = (np.prod([f[side] for f in factors], axis=0) for side in (0, 1))
            return float(self._share(waves, last)[0]) - share

        start = ends[:, 0]
        for part in np.linspace(0.0, 1.0, 33):
            x = ends @ (1.0 - part, part)
            start = x if spare(x) >= 0.0 else start
        found = scipy.optimize.minimize(
            cost, start, method="SLSQP", bounds=ends, constraints={"type": "ineq", "fun": spare}
        )
        return min(cost(start), cost(found.x) if spare(found.x) >= -1e-6 else np.inf)

    def proven(self, share: float, target: float) -> float:
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
            first, end, cost, step = (values[kept] for values in (first, end, cost, step))
            kept = self.shares(np.column_stack([first, step])) >= share
            first, end, cost, step = (values[kept] for values in (first, end, cost, step))
            whole = np.all(end - first == 1, axis=1)
            loosest = self._loosest(first[whole], step[whole], share)
            target = float(np.min(cost[whole] + last.cost[loosest + 1], initial=target))
            first, end = self._halved(first[~whole], end[~whole])
        return target

    def _loosest(self, first: Integers, low: Integers, share: float) -> Integers:
        """The last step (n,) of the last tolerance that leaves the share, which `low` (n,) do."""
        high = np.full(len(low), len(self.tolerances[-1].t) - 1)
        while np.any(high - low > 1):
            middle = (low + high) // 2
            fits = self.shares(np.column_stack([first, middle])) >= share
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
