"""The Fourier series of sums of even deviations: distribution, density, slopes and quantiles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from .even import Even

Kinds = Mapping[Even, Sequence[int]]
"""By law, the columns of its scales."""
CLOSE, SQUARED = 1e-14, 1e-8
"""Relative step at which bisection ends, and Newton's method, whose next step is its square."""
STEPS = 60
"""Steps of Newton's method, with bisection where it leaves its bracket."""
FEW = 4
"""Times that each scale of a variable must occur, on average, for sums to count as alike."""


@dataclass(eq=False)
class Series:
    """phi of n sums at the odd frequencies k pi/R, and bounds of the neglected terms."""

    k: Array
    omega: Array
    phi: Array
    slopes_of_phi: Array
    period: Array
    missing: Array
    missing_density: Array
    missing_slopes: Array

    @classmethod
    def of(cls, kinds: Kinds, s: Array, period: Array, terms: int) -> Series:
        """The series of scales s (n, m) with so many odd terms and periods R (n,)."""
        k, omega = _frequencies(period, terms)
        factors = np.empty((len(s), s.shape[1], terms))
        slope = np.empty_like(factors)
        last = omega[:, -1:] * s
        bound, fall = np.empty_like(s), np.empty_like(s)
        slope_bound, slope_fall = np.empty_like(s), np.empty_like(s)
        for law, columns in kinds.items():
            factors[:, columns], slope[:, columns] = law.characteristic(s[:, columns, None] * omega[:, None, :])
            bound[:, columns], fall[:, columns] = law.envelope(last[:, columns])
            slope_bound[:, columns], slope_fall[:, columns] = law.slope_envelope(last[:, columns])
        before, after = _products_before_and_after(factors)
        phi = before[:, -1] * factors[:, -1]
        slopes = slope * before * after
        product, decay = np.prod(bound, axis=1), np.sum(fall, axis=1)
        bounds_before, bounds_after = _products_before_and_after(bound[:, :, None])
        partial = (bounds_before * bounds_after)[:, :, 0] * slope_bound
        others_decay = decay[:, None] - fall + slope_fall
        with np.errstate(divide="ignore"):
            last_k = k[-1] / period
            dense = np.where(decay > 1.0, product * last_k / (decay - 1.0), np.inf)
            steep = np.where(others_decay > 1.0, partial * last_k[:, None] / (others_decay - 1.0), np.inf)
        return cls(k, omega, phi, slopes, period, _missing(product, decay), dense, steep)

    @classmethod
    def of_values(cls, kinds: Kinds, s: Array, period: Array, terms: int) -> Series:
        """The series without derivatives in the scales: their errors are unknown."""
        if shared := alike(s, period):
            period = np.full_like(period, period.max())
        k, omega = _frequencies(period, terms)
        phi, last = np.ones_like(omega), omega[:, -1:] * s
        product, decay = np.ones(len(s)), np.zeros(len(s))
        for law, columns in kinds.items():
            if shared:
                _times(phi, law, s[:, columns], omega[0])
            else:
                phi *= np.prod(law.value(s[:, columns, None] * omega[:, None, :]), axis=1)
            bound, fall = law.envelope(last[:, columns])
            product, decay = product * np.prod(bound, axis=1), decay + np.sum(fall, axis=1)
        unknown = np.full(len(s), np.inf)
        return cls(k, omega, phi, np.empty((len(s), 0, terms)), period, _missing(product, decay), unknown, unknown)

    def of_rows(self, rows: NDArray[np.bool_] | slice) -> Series:
        """The series of some sums."""
        if isinstance(rows, slice):
            return self
        return Series(self.k, *(getattr(self, field.name)[rows] for field in fields(self)[1:]))

    def below(self, y: Array) -> Array:
        """F(y), (n,)."""
        wave = self.phi * np.sin(self.omega * y[:, None]) / self.k
        return np.asarray(0.5 + 2.0 / np.pi * wave.sum(axis=1))

    def density(self, y: Array) -> Array:
        """F'(y), (n,)."""
        wave = self.phi * np.cos(self.omega * y[:, None])
        return np.asarray(2.0 / self.period * wave.sum(axis=1))

    def slopes(self, y: Array) -> Array:
        """dF(y)/ds, (n, m)."""
        wave = np.sin(self.omega * y[:, None])
        sums = np.einsum("nmk,nk->nm", self.slopes_of_phi, wave)
        return np.asarray(2.0 / self.period[:, None] * sums)

    def solved(self, p: Array, high: Array, start: Array) -> Array:
        """The y (n,) with F(y) = p (n,) between 0 and `high`, from `start` (n,) on."""
        low, high = np.zeros_like(high), np.array(high)
        y = np.where((start > low) & (start < high), start, 0.5 * high)
        for _ in range(STEPS):
            excess = self.below(y) - p
            low, high = np.where(excess < 0.0, y, low), np.where(excess < 0.0, high, y)
            dense = self.density(y)
            step = excess / np.where(dense > 0.0, dense, 1.0)
            candidate = y - step
            inside = (dense > 0.0) & (candidate >= low) & (candidate <= high)  # y itself is solved
            new = np.where(inside, candidate, 0.5 * (low + high))
            if np.all(np.abs(new - y) <= np.where(inside, SQUARED, CLOSE) * np.abs(new)):
                return new
            y = new
        return y


def _frequencies(period: Array, terms: int) -> tuple[Array, Array]:
    """So many odd k (terms,), and the frequencies k pi/R (n, terms) of periods R (n,)."""
    k = 2.0 * np.arange(terms, dtype=float) + 1.0
    return k, np.pi * k / period[:, None]


def _missing(product: Array, decay: Array) -> Array:
    """Bounds (n,) of neglected terms: the sum over odd k > K of (K/k)^D/k is at most 1/(2 D)."""
    with np.errstate(divide="ignore"):
        return np.where(decay > 0.0, product / (np.pi * decay), 1.0)


def _products_before_and_after(factors: Array) -> tuple[Array, Array]:
    """Products of the factors before and after each factor, along axis 1."""
    ones = np.ones_like(factors[:, :1])
    before = np.cumprod(np.concatenate([ones, factors[:, :-1]], axis=1), axis=1)
    after = np.cumprod(np.concatenate([ones, factors[:, :0:-1]], axis=1), axis=1)[:, ::-1]
    return np.asarray(before, dtype=float), np.asarray(after, dtype=float)


def alike(s: Array, period: Array) -> bool:
    """Whether sums (n, m) have so few different scales that a common period saves work."""
    if period.max() > 1.25 * period.min():
        return False
    distinct = len(s[0]) + np.count_nonzero(np.diff(np.sort(s, axis=0), axis=0))
    return bool(FEW * distinct <= s.size)


def _times(phi: Array, law: Even, s: Array, omega: Array) -> None:
    """Multiply `phi` (n, terms) by the factors of the columns of s (n, m), equal scales once."""
    order = np.argsort(s, axis=0)
    ranked = np.take_along_axis(s, order, axis=0).T
    first = np.ones(ranked.shape, dtype=bool)
    first[:, 1:] = ranked[:, 1:] > ranked[:, :-1]
    values = law.value(ranked[first][:, None] * omega)
    rows = np.empty(ranked.shape, dtype=np.int64)
    at = np.cumsum(first).reshape(ranked.shape) - 1
    np.put_along_axis(rows, order.T, at, axis=1)
    for places in rows:
        phi *= values[places]
