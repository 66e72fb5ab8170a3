"""The exact law of the units of a population with one of its inputs changed.

X = F + max(0, C), F and C sums of independent inputs. A shift moves C, or F; a wider zone replaces
one factor of the characteristic function. All on one lattice in the unit of the output.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from scipy import fft

from ....arrays import Array, Integers
from ....models.propagation import Term
from ....models.propagation.lattice import Spectrum, spectrum, window
from ....models.propagation.sums import total_cumulants
from ....models.sources import Source, Sources

POINTS = 2048
FINE = 64.0
"""Points per standard deviation of the units."""
ODD = 1e-3
"""Fraction of units of an arbitrary distribution, so that a single outlier decides nothing."""
WIDE = 4.0
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
        return self.std / FINE

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
        sums = [self._sum((widened(source, float(factor)),)) for factor in factors]
        transform = np.concatenate([transform for transform, _ in sums])
        return self._log(transform, np.concatenate([start for _, start in sums]), *self._free)

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
        odd = scipy.stats.norm.pdf(self.x, self.x[POINTS // 2], WIDE * self.std)
        density = (1.0 - ODD) * self._density(*parts) + ODD * odd
        return np.asarray(np.log(np.maximum(density, ODD**4 / self.std)))

    def _density(self, clipped: Spectrum, start: Integers, free: Spectrum, free_start: Integers) -> Array:
        """Density (m, k) of the sum of both parts: the mass of C below zero is put at zero."""
        at = np.full(len(clipped), -(POINTS // 2))
        mass = window(clipped, start, at, POINTS)
        zero = POINTS // 2
        mass[:, zero] += mass[:, :zero].sum(axis=1)
        kept = fft.rfft(mass[:, zero:], n=POINTS, axis=1)
        product = kept * free
        begin = np.full(len(product), self.first)
        values = window(product, np.broadcast_to(free_start, len(product)), begin, POINTS)
        return np.asarray(np.maximum(values, 0.0) / self.step)


def below(log: Array) -> Array:
    """Distribution functions of log densities (..., k)."""
    density = np.exp(log)
    total = np.cumsum(density, axis=-1) - 0.5 * density
    return np.asarray(total / density.sum(axis=-1, keepdims=True))
