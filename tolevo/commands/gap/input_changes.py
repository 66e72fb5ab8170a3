"""The law of the units of a batch with one input changed, and the likelihood of each such change.

X = F + max(0, C), F and C sums of independent inputs. A shift moves C, or F; a wider zone replaces
one factor of the characteristic function. All on one lattice in the unit of the output.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import chdtri

from ...journal import Arrays, recall_arrays
from ...models.effects.population import Law
from ...models.measurable import Source, Sources
from ...models.propagation import Term
from ...models.propagation.convolution import Spectrum, spectrum, window
from ...models.propagation.sums import total_cumulants
from ...section import Array, Integers

POINTS = 2048
STEPS_PER_STD = 64.0
"""Points per standard deviation of the units."""
OUTLIER_FRACTION = 1e-3
"""Fraction of units of an arbitrary distribution, so that a single outlier decides nothing."""
OUTLIER_STD_RATIO = 4.0
"""Standard deviation of those, in standard deviations of the units."""
REACH = 6.0
FACTORS = np.geomspace(0.3, 8.0, 22)
NOISES = np.linspace(0.0, 2.0, 21)
"""Standard deviations of a gauge, in those of the units."""
SHIFTS = np.concatenate([np.arange(-REACH, -2.5, 0.1), np.arange(-2.5, 2.5, 0.03), np.arange(2.5, REACH, 0.1)])
"""In standard deviations of the units."""


@dataclass(frozen=True)
class UnitLaw:
    """Densities of units with changed inputs, on the lattice `x` (k,) in the output's unit; those
    on a grid of amounts are cached, as they do not depend on the batch.
    """

    sources: Sources

    @cached_property
    def base(self) -> Array:
        """Log density (k,) of the unchanged units."""
        return np.asarray(self.shifted(np.zeros(1))[0])

    @cached_property
    def shifts(self) -> Array:
        """Log densities (m, k) with the clipped sum shifted by SHIFTS."""
        return self.shifted(SHIFTS * self.std)

    @cached_property
    def shifts_below(self) -> Array:
        """The distribution functions of the same."""
        return below(self.shifts)

    @cached_property
    def wider(self) -> tuple[tuple[Source, Array], ...]:
        """Each input, and the log densities (m, k) with its zone wider by FACTORS."""
        inputs = [source for source in self.sources.inputs if source.tolerance > 0.0]
        return tuple((source, self.widened(source, FACTORS)) for source in inputs)

    @cached_property
    def noisy(self) -> Array:
        """Log densities (m, k) of units measured with the noise NOISES."""
        return self.blurred(NOISES * self.std)

    def off(self, by: float) -> Array:
        """Log density (k,) of measurements that are all shifted by `by`."""
        return np.asarray(np.interp(self.x - by, self.x, self.base))

    @cached_property
    def std(self) -> float:
        """Standard deviation of the units without clipping: the scale of the lattice."""
        return float(np.sqrt(self._cumulants[1, 0])) / self.sources.unit

    @cached_property
    def _cumulants(self) -> Array:
        return total_cumulants(self.sources.total.clipped + self.sources.total.free)

    @cached_property
    def step(self) -> float:
        """The step of the lattice, in the output's unit."""
        return self.std / STEPS_PER_STD

    @cached_property
    def first(self) -> int:
        """Lattice index of the first point."""
        middle = float(self._cumulants[0, 0]) / self.sources.unit
        return int(np.floor(middle / self.step)) - POINTS // 2

    @cached_property
    def x(self) -> Array:
        """The points of the lattice."""
        return np.asarray(self.step * (self.first + np.arange(POINTS)), dtype=np.float64)

    def shifted(self, by: Array) -> Array:
        """Log density (m, k) with the clipped sum moved `by` (m,), in the output's unit."""
        transform, start = self._sum(self.sources.total.clipped)
        index = np.arange(transform.shape[1])
        turn = np.exp(-2j * np.pi * index * (by / self.step)[:, None] / POINTS)
        turn[:, -1] = turn[:, -1].real
        return self._log(transform * turn, np.full(len(by), start[0]), *self._free)

    def widened(self, source: Source, factors: Array) -> Array:
        """Log density (m, k) with the zone of one input `factors` (m,) as wide."""
        if source.clipped and self.sources.widened is not None:
            return self._built_anew(source, factors, self.sources.widened)
        term = self.sources.term(source)
        linear, ones = term.linear * factors, np.ones(len(factors))
        constant = (term.constant - term.linear) * ones + linear if source.from_zero else term.constant * ones
        bent = None if term.quadratic is None else term.quadratic * factors**2
        changed = self._sum((replace(term, constant=constant, linear=linear, quadratic=bent),))
        side = self.sources.total.clipped if source.clipped else self.sources.total.free
        rest = self._sum((*side[: source.at], *side[source.at + 1 :]))
        both = rest[0] * changed[0], rest[1] + changed[1]
        return self._log(*both, *self._free) if source.clipped else self._log(*self._clipped, *both)

    def _built_anew(self, source: Source, factors: Array, widened: Callable[[Source, float], Term]) -> Array:
        """The same where the inputs of the clipped part do not simply add."""

        def computed() -> Arrays:
            sums = [self._sum((widened(source, float(factor)),)) for factor in factors]
            transform = np.concatenate([transform for transform, _ in sums])
            return (self._log(transform, np.concatenate([start for _, start in sums]), *self._free),)

        return recall_arrays(("widened", source.name, factors), computed)[0]

    def blurred(self, noise: Array) -> Array:
        """Log density (m, k) of units measured with a normal error of standard deviation `noise`."""
        rate = 2.0 * np.pi * np.arange(POINTS // 2 + 1) / (POINTS * self.step)
        blur = np.exp(-0.5 * (noise[:, None] * rate) ** 2)
        transform, start = self._free
        return self._log(*self._clipped, transform * blur, np.full(len(noise), start[0]))

    @cached_property
    def _free(self) -> tuple[Spectrum, Integers]:
        return self._sum(self.sources.total.free)

    @cached_property
    def _clipped(self) -> tuple[Spectrum, Integers]:
        return self._sum(self.sources.total.clipped)

    def _sum(self, terms: tuple[Term, ...]) -> tuple[Spectrum, Integers]:
        if not terms:
            return np.ones((1, POINTS // 2 + 1), dtype=np.complex128), np.zeros(1, dtype=np.int64)
        rows = len(terms[0].constant)
        return spectrum(terms, np.full(rows, self.step * self.sources.unit), POINTS)

    def density(self) -> Array:
        """The exact density (k,) of the unchanged units."""
        return np.asarray(self._density(*self._clipped, *self._free)[0])

    def _log(self, *parts: Any) -> Array:
        """Log density (m, k) of the sum of both parts, mixed with a wide one."""
        odd = scipy.stats.norm.pdf(self.x, self.x[POINTS // 2], OUTLIER_STD_RATIO * self.std)
        density = (1.0 - OUTLIER_FRACTION) * self._density(*parts) + OUTLIER_FRACTION * odd
        return np.asarray(np.log(np.maximum(density, OUTLIER_FRACTION**4 / self.std)))

    def _density(self, clipped: Spectrum, start: Integers, free: Spectrum, free_start: Integers) -> Array:
        """Density (m, k) of the sum of both parts: the mass of C below zero is put at zero."""
        at = np.full(len(clipped), -(POINTS // 2))
        mass = window(clipped, start, at, POINTS)
        zero = POINTS // 2
        mass[:, zero] += mass[:, :zero].sum(axis=1)
        kept = scipy.fft.rfft(mass[:, zero:], n=POINTS, axis=1)
        product = kept * free
        begin = np.full(len(product), self.first)
        values = window(product, np.broadcast_to(free_start, len(product)), begin, POINTS)
        return np.asarray(np.maximum(values, 0.0) / self.step)


def below(log: Array) -> Array:
    """Distribution functions of log densities (..., k)."""
    density = np.exp(log)
    total = np.cumsum(density, axis=-1) - 0.5 * density
    return np.asarray(total / density.sum(axis=-1, keepdims=True))


GAUGE = "gauge"
"""The gauge is no input, but moves or blurs every measurement alike."""
TRENDS = np.sinh(np.linspace(-np.arcsinh(20.0), np.arcsinh(20.0), 61)) * (REACH / 20.0)
DENSE = 401
LIKELY = 4.0
"""Distance from the highest log likelihood within which an interval may lie."""
MAX_LOG_RATIO = 12.0
"""Distance from the highest log likelihood of all changes within which a change may explain a
batch.
"""
INPUT_CHANGES_POINTS = 33
KINDS = ("shift", "widening", "trend")
BATCHES, MOST = 400, 400
"""Number of simulated batches, and largest number of their units: the law of a likelihood ratio
does not depend on it.
"""
MIN_LATTICE_FRACTION = 1e-7
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
        curve = scipy.interpolate.CubicSpline(self.grid, self.log)
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
        return count_on_lattice(self.law, self.y)

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
        return tuple(
            change if change.log.max() < top - MAX_LOG_RATIO else self._finely(change, fine) for change in coarse
        )

    def _finely(self, change: Change, kept: dict[tuple[str, bool, str], tuple[Array, Array]]) -> Change:
        """The change with more amounts about the likeliest; inputs that act alike share a grid."""
        key = (change.kind, change.clipped, change.name if change.kind == "widening" else "")
        if key not in kept:
            low, high = change.likely
            between = np.linspace(low, high, INPUT_CHANGES_POINTS)
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
        kept = np.flatnonzero(fraction > MIN_LATTICE_FRACTION)
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
        i, (j, b) = row.astype(np.int64), place_on_lattice(self.law, self.y)
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


def place_on_lattice(law: UnitLaw, y: Array) -> tuple[NDArray[np.int64], Array]:
    """The lattice point (n,) below each unit (n,), and the fraction of the step beyond it."""
    at = np.clip((y - law.x[0]) / law.step, 0.0, len(law.x) - 1.001)
    low = at.astype(np.int64)
    return low, at - low


def count_on_lattice(law: UnitLaw, y: Array) -> Array:
    """Units (n,) on the lattice (k,)."""
    (low, part), size = place_on_lattice(law, y), len(law.x)
    counts = np.bincount(low, 1.0 - part, size) + np.bincount(low + 1, part, size)
    return counts.astype(np.float64)
