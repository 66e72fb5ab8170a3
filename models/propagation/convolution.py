"""Propagation by convolution on a lattice: mean, spread, quantile, yield and interference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ...arrays import Array, Integers
from .lattice import spectrum, window
from .method import Propagation
from .result import Estimate, Propagated
from .sums import ClippedSum, Term, total_cumulants

REACH = 9.0
"""Standard deviations that the lattice covers on either side where the inputs are unbounded."""
HEAVY = 1e-9
"""Mass that an input may have beyond REACH standard deviations; with more its bounds are used."""
ROUNDING = 1e-12
"""Floor of the stated errors: rounding of the transforms, relative to the step or probability."""


@dataclass(frozen=True, slots=True)
class Convolution(Propagation):
    """Clipped part by convolution, its negative mass put at zero, convolved with the free part.

    The lattice has `points` points over the range of the sum, so the discretisation error falls
    with points^-2. With `errors` the same is done on half the points; the stated error is the
    difference, about three times the true one, plus a floor of the discretisation. Without, the
    errors are NaN (unknown), at two thirds of the time, for use in a search.
    """

    points: int = 4096
    errors: bool = True

    @property
    def block(self) -> int:
        return max(1, (1 << 19) // self.points)

    def _propagate(self, total: ClippedSum, coverage: float, limit: float) -> Propagated:
        cumulants = total_cumulants(total.clipped + total.free)
        fine = _statistics(total, coverage, limit, self.points)
        error = np.full_like(fine, np.nan)
        if self.errors:
            coarse = _statistics(total, coverage, limit, self.points // 2)
            error = np.abs(fine - coarse) + self._floor(total, fine)
        estimates = [Estimate(value, err) for value, err in zip(fine, error, strict=True)]
        return Propagated(cumulants[0], np.sqrt(cumulants[1]), *estimates)

    def _floor(self, total: ClippedSum, fine: Array) -> Array:
        """Floor of the errors for the case that fine and coarse agree by chance, shape (5, n).

        Linear allocation adds up to step^2/6 to the variance of each term, so the spread s grows by
        about terms step^2/(12 s); the quantile moves by up to three of it, a probability by up to a
        quarter of it in units of s.
        """
        terms = len(total.clipped) + len(total.free)
        width = _range(total.clipped)[2] + _range(total.free)[2]
        spread = np.maximum(fine[1], np.finfo(float).tiny)
        growth = terms * (width / self.points) ** 2 / (12.0 * spread)
        rounding = ROUNDING * np.abs(fine[2])
        lengths = np.array([growth, growth, 3.0 * growth]) + rounding
        chance = np.minimum(0.25 * growth / spread, 1.0) + ROUNDING
        return np.array([*lengths, chance, chance])


def _statistics(total: ClippedSum, coverage: float, limit: float, points: int) -> Array:
    """Mean, std, quantile, conforming and negative probability, shape (5, n)."""
    (low, _, width), (free_low, _, free_width) = _range(total.clipped), _range(total.free)
    pad = 4 * (len(total.clipped) + len(total.free))
    step = np.maximum(width + free_width, np.finfo(float).tiny) / (points - pad)
    transform, start = spectrum(total.clipped, step, points)
    first = np.floor(low / step).astype(np.int64) - 2 * len(total.clipped)
    mass = window(transform, start, first, points)
    negative = _below(mass, -first)
    effective, base = _clip(mass, first)
    free, free_start = spectrum(total.free, step, points)
    begin = base + np.floor(free_low / step).astype(np.int64) - 2 * len(total.free)
    spread = window(scipy.fft.rfft(effective, axis=1) * free, base + free_start, begin, points)
    x = (begin[:, None] + np.arange(points)) * step[:, None]
    return np.array([*_moments(spread, x), *_levels(spread, x, step, coverage, limit), negative])


def _range(terms: tuple[Term, ...]) -> tuple[Array, Array, Array]:
    """Lower end, upper end and width of the range of a sum of terms, each (n,)."""
    ends = np.array([term.bounds() for term in terms]).sum(axis=0)
    light = [_light(term) for term in terms]
    wide = [term.bounds() for term, covered in zip(terms, light, strict=True) if not covered]
    straight = tuple(term for term, covered in zip(terms, light, strict=True) if covered)
    low, high = np.array(wide).sum(axis=0) if wide else np.zeros_like(ends)
    if straight:
        mean, variance = total_cumulants(straight)[:2]
        low = low + mean - REACH * np.sqrt(variance)
        high = high + mean + REACH * np.sqrt(variance)
    low, high = np.maximum(ends[0], low), np.minimum(ends[1], high)
    return low, high, high - low


def _light(term: Term) -> bool:
    """Whether REACH standard deviations cover the contribution.

    They do not for z^2 of a normal z, nor for a rare outlier.
    """
    if term.quadratic is not None:
        return False
    _, mean, square = term.distribution.raw_moments(2)
    reach = REACH * np.sqrt(max(square - mean**2, 0.0))
    below, upto = term.distribution.partial_moments(np.array([mean - reach, mean + reach]))[0]
    return bool(below + 1.0 - upto <= HEAVY)


def _below(mass: Array, zero: Integers) -> Array:
    """Probability of a negative value: all mass below index `zero` and half of that on it."""
    at = np.arange(mass.shape[1])
    weight = np.where(at < zero[:, None], 1.0, np.where(at == zero[:, None], 0.5, 0.0))
    return np.asarray(np.clip(np.sum(mass * weight, axis=1), 0.0, 1.0))


def _clip(mass: Array, first: Integers) -> tuple[Array, Integers]:
    """Masses of max(0, x) and the lattice index of the first of them."""
    points = mass.shape[1]
    base = np.maximum(first, 0)
    at = (base - first)[:, None] + np.arange(points)
    clipped = np.where(at < points, np.take_along_axis(mass, np.minimum(at, points - 1), axis=1), 0.0)
    clipped[:, 0] += mass.sum(axis=1) - clipped.sum(axis=1)
    return clipped, base


def _moments(mass: Array, x: Array) -> tuple[Array, Array]:
    mean = np.sum(mass * x, axis=1)
    return mean, np.sqrt(np.maximum(np.sum(mass * (x - mean[:, None]) ** 2, axis=1), 0.0))


def _levels(mass: Array, x: Array, step: Array, coverage: float, limit: float) -> tuple[Array, Array]:
    """Quantile at `coverage` and probability up to `limit`, by linear interpolation."""
    below = np.cumsum(mass, axis=1) - 0.5 * mass
    level = np.minimum(coverage, below[:, -1])  # rounding may leave all mass below the coverage
    after = np.clip(np.argmax(below >= level[:, None], axis=1), 1, mass.shape[1] - 1)[:, None]
    low, high = (np.take_along_axis(below, at, axis=1)[:, 0] for at in (after - 1, after))
    rise = np.where(high > low, high - low, 1.0)
    part = np.clip((level - low) / rise, 0.0, 1.0)
    quantile = np.take_along_axis(x, after - 1, axis=1)[:, 0] + part * step
    place = np.clip((limit - x[:, 0]) / step, 0.0, mass.shape[1] - 1.000001)
    left = place.astype(np.int64)[:, None]
    at_left, at_right = (np.take_along_axis(below, at, axis=1)[:, 0] for at in (left, left + 1))
    conforming = at_left + (place - left[:, 0]) * (at_right - at_left)
    return quantile, np.clip(conforming, 0.0, 1.0)
