"""Yield and half-width of a linear stack of any independent deviations, without a sample.

The distribution of X = sum_j s_j u_j is a square wave's Fourier series: for |y| + |X| < R,

    F(y) = 1/2 + (2/pi) sum over odd k of Im[exp(i k pi y/R) conj phi(k pi/R)]/k,

with phi the product of the characteristic functions of the pieces, which are tabulated once for each
distribution from its partial moments. Where phi falls too slowly it is damped, which spreads X by
`DAMPED` of its range. Unlike `Law`, nothing is claimed about convexity.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ...section import Array
from ..inputs import Distribution
from .mechanism import Mechanism, Tolerances, mean_of, spread_of

TERMS = (48, 192, 1024)
"""Odd terms of the series: the next number is taken where the last terms are above `NEGLECTED`."""
NEGLECTED = 3e-8
"""Size of the last terms of phi at which the series ends without damping."""
DAMPED = 4.0
"""Damping of the last term, exp(-x^2/2) at x: X is spread by x R/(2 pi terms)."""
NODE, POINTS = 0.1, 2**18
"""Distance of the nodes of a table of phi(v), v times a deviation that is at most 1; points of its
transform."""
REACH = 8.4
"""|X| > REACH sqrt(sum s_j^2) for |u_j| <= 1 has a probability below 1e-15 (Hoeffding 1963)."""
ROUGH = 0.05
"""Mean size of phi at the end of its table above which a law has atoms."""
ERROR = 1e-6
"""Stated error of a yield [percent], in addition to the effect of the damping."""
STEPS, BLOCK = 60, 1 << 19
"""Steps of Newton's method, safeguarded by bisection, and numbers that are held at once."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """phi(v) = E exp(i v u) of u = (z - mean)/reach in [-1, 1]; `low` and `high` are its ends.

    Row n of `quintic` (nodes, 6) are the coefficients of phi between n `NODE` and (n + 1) `NODE`.
    """

    mean: float
    reach: float
    low: float
    high: float
    quintic: NDArray[np.complex128]
    rough: bool

    @classmethod
    def of(cls, law: Distribution) -> Table:
        """The table of a distribution, from its moments on 8345 cells."""
        mean = float(law.raw_moments(1)[1])
        low, high = law.support
        reach = max(high - mean, mean - low)
        step = 2.0 * np.pi / (NODE * POINTS)
        edges = -1.0 + step * np.arange(int(np.ceil(2.0 / step)) + 1, dtype=float)
        centre = 0.5 * (edges[1:] + edges[:-1])
        mass, first, second = (
            np.diff(part) for part in law.partial_moments(np.asarray(mean + reach * edges, dtype=float))
        )
        middle = mean + reach * centre
        moments = [mass, (first - middle * mass) / reach, (second - 2.0 * middle * first + middle**2 * mass) / reach**2]
        nodes = int(np.ceil(np.pi * TERMS[-1] / NODE)) + 2
        v = NODE * np.arange(nodes)
        turn = np.exp(1j * v * centre[0])

        def transforms(arm: Array) -> list[NDArray[np.complex128]]:
            return [turn * np.conj(np.fft.rfft(arm * part, POINTS)[:nodes]) for part in moments]

        m, a, b = (transforms(centre**power) for power in range(3))
        phi = m[0] + 1j * v * m[1] - 0.5 * v**2 * m[2]
        slope = NODE * (1j * (a[0] + m[1]) - v * (a[1] + m[2]) - 0.5j * v**2 * a[2])
        bend = -(NODE**2) * (b[0] + 1j * v * b[1] - 0.5 * v**2 * b[2] + 2.0 * (a[1] + 1j * v * a[2]) + m[2])
        rough = bool(np.mean(np.abs(phi[3 * nodes // 4 :])) > ROUGH)
        return cls(mean, reach, (low - mean) / reach, (high - mean) / reach, _hermite(phi, slope, bend), rough)

    def at(self, v: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """phi and its derivative, of the shape of v >= 0."""
        place = np.minimum(v / NODE, len(self.quintic) - 1e-9)
        row = place.astype(np.int64)
        x, c = place - row, np.moveaxis(self.quintic[row], -1, 0)
        value, slope = c[5], np.zeros_like(c[5])
        for coefficient in c[4::-1]:
            slope = value + x * slope
            value = coefficient + x * value
        return value, slope / NODE


def _hermite(
    phi: NDArray[np.complex128], slope: NDArray[np.complex128], bend: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Coefficients (nodes - 1, 6) between nodes of values and two derivatives (nodes,)."""
    rise, begin, end = phi[1:] - phi[:-1], slope[:-1], slope[1:]
    left, right = 0.5 * bend[:-1], 0.5 * bend[1:]
    third = 10.0 * rise - 6.0 * begin - 4.0 * end - 3.0 * left + right
    fourth = -15.0 * rise + 8.0 * begin + 7.0 * end + 3.0 * left - 2.0 * right
    return np.stack([phi[:-1], begin, left, third, fourth, 6.0 * rise - 3.0 * (begin + end) - left + right], axis=1)


@lru_cache(maxsize=64)
def table_of(law: Distribution) -> Table:
    """The table of a distribution, made once: 0.1 s."""
    return Table.of(law)


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """The series of n designs: w (n, terms), phi with damping, and its slopes by the scale of each group.

    `odd` (terms,) are the odd numbers, `ends` the range of X, (n,) each.
    """

    w: Array
    odd: Array
    phi: NDArray[np.complex128]
    slopes: tuple[NDArray[np.complex128], ...]
    half_range: Array
    ends: tuple[Array, Array]

    def below(self, y: Array) -> Array:
        """P(X <= y) (n,)."""
        series = np.sum(np.imag(self._turned(y) * np.conj(self.phi)) / self.odd, axis=1)
        inside = np.clip(0.5 + 2.0 / np.pi * series, 0.0, 1.0)
        return np.where(y >= self.ends[1], 1.0, np.where(y <= self.ends[0], 0.0, inside))

    def density(self, y: Array) -> Array:
        """Density (n,) of X at y, 0 outside of its range."""
        series = np.sum(np.real(self._turned(y) * np.conj(self.phi)), axis=1)
        inside = (y > self.ends[0]) & (y < self.ends[1])
        return np.where(inside, np.maximum(2.0 / self.half_range * series, 0.0), 0.0)

    def rises(self, y: Array) -> Array:
        """dP(X <= y)/ds (n, groups)."""
        turned = self._turned(y) / self.odd
        columns = [2.0 / np.pi * np.sum(np.imag(turned * np.conj(slope)), axis=1) for slope in self.slopes]
        inside = (y > self.ends[0]) & (y < self.ends[1])
        return np.where(inside[:, None], np.stack(columns, axis=1), 0.0)

    def quantile(self, p: float, std: Array) -> Array:
        """The y (n,) with P(X <= y) = p."""
        low, high = (end.copy() for end in self.ends)
        y = np.clip(float(ndtri(p)) * std, low, high)
        for _ in range(STEPS):
            excess = self.below(y) - p
            high, low = np.where(excess >= 0.0, y, high), np.where(excess < 0.0, y, low)
            density = self.density(y)
            moved = y - excess / np.where(density > 0.0, density, 1.0)
            safe = (density > 0.0) & (moved > low) & (moved < high)
            moved = np.where(safe, moved, 0.5 * (low + high))
            done = np.abs(moved - y) <= 1e-12 * self.half_range
            y = moved
            if np.all(done):
                break
        return y

    def _turned(self, y: Array) -> NDArray[np.complex128]:
        return np.asarray(np.exp(1j * self.w * y[:, None]))


@dataclass(frozen=True, eq=False)
class LinearSum:
    """y = centre + sum_i S_i t z_i of independent pieces; tolerances t (n, p), derivatives alike.

    Pieces of one part with one sensitivity are a group: `owner`, `slope` and `count` (groups,).
    """

    mechanism: Mechanism
    owner: NDArray[np.int64]
    slope: Array
    count: NDArray[np.int64]
    tables: tuple[Table, ...]

    def yield_percent(self, t: Tolerances) -> tuple[Array, Array]:
        """Fraction of units within the limits (n,), in percent, and its error (n,)."""
        yields, error = np.empty(len(t)), np.empty(len(t))
        for rows, series, damping in self._series(t):
            within = self._within(series, t[rows])
            again = within if damping is None else self._within(damping, t[rows])
            yields[rows], error[rows] = 100.0 * within, 100.0 * np.abs(within - again) + ERROR
        return np.clip(yields, 0.0, 100.0), error

    def yield_slopes(self, t: Tolerances) -> Array:
        """d yield_percent/dt, (n, p)."""
        slopes = np.zeros_like(spread_of(t))
        for rows, series, _ in self._series(t):
            for sign, end in self._ends(t[rows]):
                if np.all(np.isfinite(end)):
                    moved = series.density(end)[:, None] * self._mean
                    slopes[rows] += 100.0 * sign * (self._to_parts(series.rises(end)) - moved)
        return slopes

    def half_width(self, t: Tolerances, coverage: float) -> Array:
        """Half the width (n,) of the interval that holds `coverage` of the units, with equal tails."""
        widths, tail, std = np.empty(len(t)), 0.5 * (1.0 - coverage), self._std(t)
        for rows, series, _ in self._series(t):
            low, high = (series.quantile(p, std[rows]) for p in (tail, 1.0 - tail))
            widths[rows] = 0.5 * (high - low)
        return widths

    def half_width_slopes(self, t: Tolerances, coverage: float) -> Array:
        """d half_width/dt, (n, p)."""
        slopes, tail, std = np.zeros_like(spread_of(t)), 0.5 * (1.0 - coverage), self._std(t)
        for rows, series, _ in self._series(t):
            for sign, p in ((-0.5, tail), (0.5, 1.0 - tail)):
                y = series.quantile(p, std[rows])
                density = np.maximum(series.density(y), 1e-300)[:, None]
                slopes[rows] -= sign * self._to_parts(series.rises(y)) / density
        return slopes

    # ---------------------------------------------------------------- the series

    def _series(self, t: Tolerances) -> Iterator[tuple[NDArray[np.int64], Series, Series | None]]:
        """Blocks of designs (rows) with their series; where it is damped that of less damping as well."""
        scales = spread_of(t)[:, self.owner] * np.abs(self.slope)
        rest = np.arange(len(t))
        for terms in TERMS:
            unsettled = []
            wide = max(1, BLOCK // (terms * len(self.owner)))
            for start in range(0, len(rest), wide):
                rows = rest[start : start + wide]
                series = self._of(scales[rows], terms)
                settled = np.max(np.abs(series.phi[:, -terms // 8 :]), axis=1) <= NEGLECTED
                if terms < TERMS[-1]:
                    unsettled.append(rows[~settled])
                    if np.any(settled):
                        yield rows[settled], _select_designs(series, settled, 0.0), None
                elif np.all(settled):
                    yield rows, series, None
                else:
                    every = np.ones(len(rows), dtype=bool)
                    yield rows, _select_designs(series, every, DAMPED), _select_designs(series, every, 0.7 * DAMPED)
            rest = np.concatenate(unsettled) if unsettled else rest[:0]

    def _of(self, scales: Array, terms: int) -> Series:
        """The series of scales (n, groups), without damping."""
        reach = scales * [table.reach for table in self.tables]
        most = np.minimum(reach @ self.count, REACH * np.sqrt(reach**2 @ self.count))
        half_range = 2.0 * np.maximum(most, np.finfo(float).tiny ** 0.5)
        odd = 2.0 * np.arange(terms, dtype=float) + 1.0
        w = odd * (np.pi / half_range)[:, None]
        values = [table.at(reach[:, at, None] * w) for at, table in enumerate(self.tables)]
        factors, slopes = [], []
        for at, (phi, slope) in enumerate(values):
            count, rate = int(self.count[at]), w * self.tables[at].reach
            power = phi ** (count - 1)
            whole, rise = power * phi, count * power * slope * rate
            flip = self.slope[at] < 0.0
            factors.append(np.conj(whole) if flip else whole)
            slopes.append(np.conj(rise) if flip else rise)
        before = [np.ones_like(factors[0])]
        for factor in factors:
            before.append(before[-1] * factor)
        after = np.ones_like(factors[0])
        by_group = []
        for at in reversed(range(len(factors))):
            by_group.append(before[at] * after * slopes[at])
            after = after * factors[at]
        ends = self._range(scales, most)
        return Series(w, odd, before[-1], tuple(by_group[::-1]), half_range, ends)

    def _range(self, scales: Array, most: Array) -> tuple[Array, Array]:
        """Least and largest X (n,)."""
        ends = [
            sorted([sign * table.low * table.reach, sign * table.high * table.reach])
            for table, sign in zip(self.tables, np.sign(self.slope), strict=True)
        ]
        low, high = (scales * np.array(side) @ self.count for side in np.array(ends).T)
        return np.maximum(low, -most), np.minimum(high, most)

    def _within(self, series: Series, t: Tolerances) -> Array:
        """Fraction of units within the limits (n,)."""
        fraction = np.zeros(len(t))
        for sign, end in self._ends(t):
            fraction += sign * (series.below(end) if np.all(np.isfinite(end)) else (end > 0.0).astype(float))
        return fraction

    def _ends(self, t: Tolerances) -> list[tuple[float, Array]]:
        """Sign and distance (n,) of each limit from the mean of y."""
        total = np.bincount(self.owner, self.slope * self.count, len(self._mean))
        mean = self.mechanism.centre + spread_of(t) @ self._mean + mean_of(t) @ total
        return [(1.0, self.mechanism.upper - mean), (-1.0, self.mechanism.lower - mean)]

    @cached_property
    def _mean(self) -> Array:
        """Shift of the mean of y per unit of each tolerance (p,)."""
        means = self.slope * self.count * [table.mean for table in self.tables]
        return np.asarray(np.bincount(self.owner, means, len(self.mechanism.inputs)), dtype=float)

    def _std(self, t: Tolerances) -> Array:
        moments = [self.mechanism.inputs[at].raw_moments(2) for at in self.owner.tolist()]
        variance = self.slope**2 * self.count * [max(m[2] - m[1] ** 2, 0.0) for m in moments]
        return np.asarray(np.sqrt(spread_of(t)[:, self.owner] ** 2 @ variance))

    def _to_parts(self, by_group: Array) -> Array:
        """Derivatives in t (n, p) from those in the scales of the groups."""
        parts = np.arange(len(self.mechanism.inputs))
        return np.asarray(by_group @ ((self.owner[:, None] == parts) * np.abs(self.slope)[:, None]))


def _select_designs(series: Series, rows: NDArray[np.bool_], damped: float) -> Series:
    """Some designs of a series, with damping."""
    damping = np.exp(-0.5 * (damped * series.odd / series.odd[-1]) ** 2)
    return Series(
        series.w[rows],
        series.odd,
        series.phi[rows] * damping,
        tuple(slope[rows] * damping for slope in series.slopes),
        series.half_range[rows],
        (series.ends[0][rows], series.ends[1][rows]),
    )


def linear_sum_of(mechanism: Mechanism) -> LinearSum | None:
    """The distribution of a linear requirement; None with another formula, correlations or atoms."""
    linear = mechanism.formula is None or mechanism.formula.linear
    if not linear or mechanism.correlation is not None:
        return None
    groups: dict[tuple[int, float], int] = {}
    for at, slope in zip(mechanism.owner, mechanism.directed.tolist(), strict=True):
        if slope != 0.0:
            groups[at, slope] = groups.get((at, slope), 0) + 1
    tables = tuple(table_of(mechanism.inputs[at]) for at, _ in groups)
    if not groups or all(table.rough for table in tables):
        return None
    owner, slope = (np.array(column) for column in zip(*groups, strict=True))
    return LinearSum(mechanism, owner, slope, np.array(list(groups.values())), tables)
