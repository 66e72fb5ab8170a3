"""The change of one input alone that explains a batch: a shift, a wider zone, or a trend."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import chdtri

from ....arrays import Array
from ....models.effects.population.law import Law
from ....models.sources import Source
from .unit_law import FACTORS, NOISES, REACH, SHIFTS, UnitLaw, below

GAUGE = "gauge"
"""The gauge is no input, but moves or blurs every measurement alike."""
TRENDS = np.sinh(np.linspace(-np.arcsinh(20.0), np.arcsinh(20.0), 61)) * (REACH / 20.0)
DENSE = 401
LIKELY = 4.0
"""Distance from the highest log likelihood within which an interval may lie."""
NEAR = 12.0
"""Distance from the highest log likelihood of all changes within which a change may explain a
batch.
"""
POINTS = 33
KINDS = ("shift", "widening", "trend")
BATCHES, MOST = 400, 400
"""Number of simulated batches, and largest number of their units: the law of a likelihood ratio
does not depend on it.
"""
LEAST = 1e-7
"""Probability of a cell below which no unit is drawn from it."""


@dataclass(frozen=True)
class Change:
    """A change of one input (None: of the gauge).

    Amounts are in the unit of the output, for a widening they are factors; `per` turns a shift into
    the input's unit. `low` and `high` are the admissible ones. `log` (m,) is the log likelihood of
    the batch at `grid` (m,).
    """

    kind: str
    source: Source | None
    grid: Array
    log: Array
    low: float
    high: float
    per: float = 1.0

    @property
    def name(self) -> str:
        """The input's name."""
        return GAUGE if self.source is None else self.source.name

    @property
    def clipped(self) -> bool:
        """Whether the input acts before interference is clipped."""
        return self.source is not None and self.source.clipped

    @cached_property
    def likely(self) -> tuple[float, float]:
        """Points of the grid that enclose any interval."""
        inside = np.flatnonzero(self.log > self.log.max() - LIKELY)
        last = len(self.grid) - 1
        return (float(self.grid[max(inside[0] - 1, 0)]), float(self.grid[min(inside[-1] + 1, last)]))

    @cached_property
    def _dense(self) -> tuple[Array, Array]:
        """The log likelihood interpolated between the points of the grid, finely about its peak."""
        curve = CubicSpline(self.grid, self.log)
        near = self.likely
        ends = np.clip([self.low, self.high], self.grid[0], self.grid[-1])
        x = np.unique(np.concatenate([np.linspace(*near, DENSE), self.grid, ends]))
        return x, np.asarray(curve(x), dtype=np.float64)

    @property
    def free(self) -> tuple[float, float]:
        """The likeliest amount, admissible or not, and its log likelihood."""
        return _peak(*self._dense)

    @property
    def best(self) -> tuple[float, float]:
        """The likeliest admissible amount, and its log likelihood."""
        x, log = self._dense
        return _peak(x, np.where(self._admissible(x), log, -np.inf))

    def interval(self, quantile: float, admissible: bool) -> tuple[float, float]:
        """Amounts whose log likelihood is within `quantile` (of chi2) of the highest one, of all amounts
        or only of the `admissible` ones: the interval about `free`, or about `best`.
        """
        x, log = self._dense
        if admissible:
            log = np.where(self._admissible(x), log, -np.inf)
        inside = x[2.0 * (log.max() - log) <= quantile]
        return float(inside.min()), float(inside.max())

    def _admissible(self, x: Array) -> NDArray[np.bool_]:
        """Which amounts (n,) are admissible, up to rounding."""
        return np.asarray((x >= self.low - 1e-12) & (x <= self.high + 1e-12))

    def shown(self, amount: float) -> float:
        """An amount in the input's unit; a factor is unchanged."""
        return amount if self.kind == "widening" else amount / self.per

    @property
    def unit(self) -> str:
        """The unit of the amounts shown; empty for a factor and for the unit of the output."""
        return "" if self.source is None or self.kind == "widening" else self.source.unit

    def share(self, amount: float) -> float:
        """An amount as a fraction of the tolerance; nan for the gauge, which has none."""
        if self.source is None:
            return float("nan")
        return amount if self.kind == "widening" else self.shown(amount) / self.source.tolerance


def _peak(x: Array, log: Array) -> tuple[float, float]:
    at = int(np.argmax(log))
    return float(x[at]), float(log[at])


@dataclass(frozen=True)
class Tables:
    """Units `y` (n,) in the output's unit, their order `u` (n,) from 0 to 1, and their law.

    `out` is the fraction of an input's parts that may be out of its limits. A uniform input reaches
    it when it is shifted by 2 `out` tolerances, or 1/(1 - `out`) times as wide.
    """

    law: UnitLaw
    y: Array
    u: Array
    out: float = 0.75

    @cached_property
    def counts(self) -> Array:
        """The units on the lattice (k,), each divided between its two neighbours."""
        return counted(self.law, self.y)

    @cached_property
    def none(self) -> float:
        """Log likelihood of the unchanged model."""
        return float(self.law.base @ self.counts)

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """Each change of every input, the gauge last, on a fine grid where it may explain the batch."""
        coarse = (*self._shifts(), *self._widenings(), *self._trends())
        top = max(float(change.log.max()) for change in coarse)
        fine: dict[tuple[str, bool, str], tuple[Array, Array]] = {}
        return tuple(change if change.log.max() < top - NEAR else self._finely(change, fine) for change in coarse)

    def _finely(self, change: Change, kept: dict[tuple[str, bool, str], tuple[Array, Array]]) -> Change:
        """The change with more amounts about the likeliest; inputs that act alike share a grid."""
        key = (change.kind, change.clipped, change.name if change.kind == "widening" else "")
        if key not in kept:
            low, high = change.likely
            between = np.linspace(low, high, POINTS)
            outside = (change.grid < low) | (change.grid > high)
            grid = np.concatenate([change.grid[outside], between])
            log = np.concatenate([change.log[outside], self._logs(change, between)])
            order = np.argsort(grid)
            kept[key] = grid[order], log[order]
        grid, log = kept[key]
        return replace(change, grid=grid, log=log)

    def _logs(self, change: Change, amounts: Array) -> Array:
        """Log likelihoods (m,) at amounts (m,)."""
        if change.kind == "trend":
            return self._along(amounts, change.clipped)
        if change.kind == "widening" or change.clipped:
            return np.asarray(self._densities(change, amounts) @ self.counts)
        return self._off(amounts)

    def _densities(self, change: Change, amounts: Array) -> Array:
        """Log densities (m, k) of the model with a zone wider, or a clipped input shifted."""
        if change.kind != "widening":
            return self.law.shifted(amounts)
        return self.law.blurred(amounts) if change.source is None else self.law.widened(change.source, amounts)

    def _off(self, amounts: Array, over: Array | float = 1.0) -> Array:
        """Log likelihoods (m,) of measurements that are off by amounts times `over`."""
        x, base = self.law.x, self.law.base
        return np.array([np.interp(self.y - by * over, x, base).sum() for by in amounts])

    def _along(self, amounts: Array, clipped: bool) -> Array:
        """Log likelihoods (m,) of trends that reach amounts at the last unit."""
        if not clipped:
            return self._off(amounts, self.u)
        return np.array([self.between(self.law.shifts, by * self.u).sum() for by in amounts])

    def _shifts(self) -> Iterator[Change]:
        std = self.law.std
        yield from self._moved("shift", SHIFTS * std, self.law.shifts @ self.counts, True)
        by = SHIFTS[::3] * std
        centre = float(np.median(self.y) - self.law.x @ np.exp(self.law.base) * self.law.step)
        if abs(centre) > 0.5 * REACH * std:  # farther than a shift of inputs can be
            by = np.unique(np.concatenate([by, centre + by]))
        yield from self._moved("shift", by, self._off(by), False)

    def _trends(self) -> Iterator[Change]:
        by = TRENDS * self.law.std
        for clipped in (True, False):
            yield from self._moved("trend", by, self._along(by, clipped), clipped)

    def _moved(self, kind: str, by: Array, log: Array, clipped: bool) -> Iterator[Change]:
        for source in self.law.sources.inputs:
            if source.clipped is clipped and source.tolerance > 0.0 and source.moves and source.per_unit != 0.0:
                per = source.per_unit / self.law.sources.unit
                most = 2.0 * self.out * source.tolerance * abs(per)
                yield Change(kind, source, by, log, -most, most, per)
        if not clipped:
            yield Change(kind, None, by, log, -np.inf, np.inf)

    def _widenings(self) -> Iterator[Change]:
        for source, table in self.law.wider:
            most = min(1.0 / (1.0 - self.out), source.widest)
            yield Change("widening", source, FACTORS, table @ self.counts, 1.0, most)
        noise = NOISES * self.law.std
        yield Change("widening", None, noise, self.law.noisy @ self.counts, 0.0, np.inf)

    def chance(self, rate: float, seed: int) -> float:
        """The threshold of twice the log likelihood ratio of the best change, at the false rate
        `rate` under the null model.

        Half of the rate is reserved for trends, which have at most two forms.
        """
        law, near = self.law, np.abs(SHIFTS) < 1.5
        off = (law.off(by) for by in SHIFTS[near][::3] * law.std)
        tried = np.vstack([law.shifts[near][::2], *off, *(table[::2] for _, table in law.wider), law.noisy[1::2]])
        fraction = np.exp(law.base) * law.step
        kept = np.flatnonzero(fraction > LEAST)
        fractions, rng = fraction[kept] / fraction[kept].sum(), np.random.default_rng([seed, 13])
        drawn = rng.multinomial(min(len(self.y), MOST), fractions, BATCHES).astype(float)
        gains = drawn @ (tried[:, kept] - law.base[kept]).T
        still = float(np.quantile(2.0 * gains.max(axis=1).clip(0.0), 1.0 - 0.5 * rate))
        return max(still, float(chdtri(1, 0.25 * rate)))

    def under(self, change: Callable[[Law], Law]) -> float:
        """Log likelihood with an effect on the scatter in the law."""
        law, mean = self.law, float(self.law.x @ np.exp(self.law.base) * self.law.step)
        plain = Law(float(law.x[0]) - mean, law.step, self.law.base, law.std, mean)
        return float(change(plain)(self.y - mean).sum())

    def between(self, table: Array, by: Array) -> Array:
        """Values of a table (m, k) over SHIFTS and the lattice at shifts (n,) and the units."""
        row = np.clip(np.interp(by / self.law.std, SHIFTS, np.arange(len(SHIFTS))), 0.0, len(SHIFTS) - 1.001)
        i, (j, b) = row.astype(np.int64), placed(self.law, self.y)
        a = row - i
        low = table[i, j] * (1.0 - b) + table[i, j + 1] * b
        high = table[i + 1, j] * (1.0 - b) + table[i + 1, j + 1] * b
        return np.asarray(low * (1.0 - a) + high * a)

    def shares_below(self, change: Change, amount: float) -> Array:
        """Fraction (n,) of the changed model's units below each unit; uniform if it is true."""
        over = np.ones_like(self.y) if change.kind == "shift" else self.u
        if change.kind == "widening":
            return np.asarray(np.interp(self.y, self.law.x, below(self.density(change, amount))))
        if change.clipped:
            return self.between(self.law.shifts_below, amount * over)
        return np.asarray(np.interp(self.y - amount * over, self.law.x, below(self.law.base)))

    def density(self, change: Change, amount: float) -> Array:
        """Log density (k,) of the model with that input changed; a trend has none."""
        if change.kind == "widening" or change.clipped:
            return np.asarray(self._densities(change, np.array([amount]))[0])
        return self.law.off(amount)


def placed(law: UnitLaw, y: Array) -> tuple[NDArray[np.int64], Array]:
    """The lattice point (n,) below each unit (n,), and the fraction of the step beyond it."""
    at = np.clip((y - law.x[0]) / law.step, 0.0, len(law.x) - 1.001)
    low = at.astype(np.int64)
    return low, at - low


def counted(law: UnitLaw, y: Array) -> Array:
    """Units (n,) on the lattice (k,)."""
    (low, part), size = placed(law, y), len(law.x)
    counts = np.bincount(low, 1.0 - part, size) + np.bincount(low + 1, part, size)
    return counts.astype(np.float64)
