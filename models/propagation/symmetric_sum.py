"""Quantiles of sums of independent, even, log-concave deviations: value, gradient and error.

X = sum_j s_j z_j with s_j >= 0. For p >= 1/2 the p-quantile q(s) is convex and homogeneous of
degree one in s, so that q(t) >= grad q(s) . t for all s, t: the level sets of q are polars of the
floating bodies of a log-concave measure (Meyer & Reisner 1991, Geometriae Dedicata 37; Bobkov 2010,
Probab. Theory Relat. Fields 147; Lagoa, Li & Sznaier 2005, SIAM J. Optim. 15).

The distribution is a square wave's Fourier series: for |y| + |X| < R,

    2 F(y) - 1 = (4/pi) sum over odd k of phi(k pi/R) sin(k pi y/R)/k,

which has no error of quadrature; the neglected terms are bounded by the envelopes of phi. Unbounded
inputs are cut at `REACH` standard deviations, beyond which lies less than 1e-17 of the mass.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ...journal import stretch
from ...section import Array
from .convolution import Even

# The Fourier series of sums of even deviations: distribution, density, slopes and quantiles.


Kinds = Mapping[Even, Sequence[int]]
"""By law, the columns of its scales."""
CLOSE, SQUARED = 1e-14, 1e-8
"""Relative step at which bisection ends, and Newton's method, whose next step is its square."""
STEPS = 60
"""Steps of Newton's method, with bisection where it leaves its bracket."""
MIN_COLUMNS_PER_SCALE = 4
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
        return cls(k, omega, phi, slopes, period, _truncation_bounds(product, decay), dense, steep)

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
                _multiply_by_factors(phi, law, s[:, columns], omega[0])
            else:
                phi *= np.prod(law.value(s[:, columns, None] * omega[:, None, :]), axis=1)
            bound, fall = law.envelope(last[:, columns])
            product, decay = product * np.prod(bound, axis=1), decay + np.sum(fall, axis=1)
        unknown = np.full(len(s), np.inf)
        return cls(
            k, omega, phi, np.empty((len(s), 0, terms)), period, _truncation_bounds(product, decay), unknown, unknown
        )

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


def _truncation_bounds(product: Array, decay: Array) -> Array:
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
    if not len(s) or period.max() > 1.25 * period.min():
        return False
    distinct = len(s[0]) + np.count_nonzero(np.diff(np.sort(s, axis=0), axis=0))
    return bool(MIN_COLUMNS_PER_SCALE * distinct <= s.size)


def _multiply_by_factors(phi: Array, law: Even, s: Array, omega: Array) -> None:
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


REACH = 9.0
"""Standard deviations beyond which X is neglected."""
TERMS = (48, 96, 192, 384, 768, 1536, 3072)
"""Odd terms of the series: the next number is tried where the neglected terms are too large."""
TRUNCATION_TOLERANCE = 1e-14
"""Neglected part of a probability that is allowed."""
ROUNDING = 4e-15
"""Rounding of a probability."""
SURE, STEP = 1e-7, (1e-6, 1e-2)
"""Fraction of a quantile up to which errors of its gradient are accepted, and the fractions of a
scale by which it is changed to bound its slope from values."""
LARGE = 3
"""Index in `TERMS` up to which a sum remembers how many terms it needs."""
EDGE = 1e-10
"""Fraction of the end of a sum within which a limit is at the end: a difference of sizes has lost such digits. The
density falls from the middle, so that at most half as much of the units lies there."""
BLOCK = 1 << 21
"""Numbers that are held at once."""


@dataclass(frozen=True, slots=True)
class Tangent:
    """Quantiles (n,), gradients (n, m), and bounds of the errors of both."""

    value: Array
    gradient: Array
    value_error: Array
    gradient_error: Array


def _edge_error(y: Array, end: Array) -> Array:
    """The bound of the error (n,) of no units beyond y, at the end or farther."""
    return np.where(np.abs(y) >= end, 2e-17, 0.5 * EDGE)


@dataclass(eq=False)
class SymmetricSum:
    """A sum of independent deviations s_j z_j, z_j of the even `laws` (m)."""

    laws: Sequence[Even]
    _last: tuple[Array, Array, Tangent] | None = field(default=None, init=False, repr=False)
    _sure: bool = field(default=False, init=False, repr=False)
    _begin: int = field(default=0, init=False, repr=False)
    _stretch: object = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        self._kinds = {law: [j for j, other_law in enumerate(self.laws) if other_law == law] for law in self.laws}
        self._std = np.array([law.std for law in self.laws])
        self._ends = np.array([law.reach for law in self.laws])

    def quantile(self, s: Array, probability: float | Array, sure: bool = True) -> Tangent:
        """Quantiles at a `probability` >= 1/2, common or (n,), of sums of scales s (n, m).

        With `sure` the bounds of the errors of gradients are made as small as possible.
        """
        self._remember()
        p, last = np.broadcast_to(np.asarray(probability, dtype=float), len(s)), self._last
        same = last is not None and np.array_equal(last[0], s) and np.array_equal(last[1], p)
        if last is not None and same and self._sure >= sure:
            return last[2]
        scales, p, s = np.array(s, dtype=float), np.array(p), np.abs(np.array(s, dtype=float))
        tangent = self._tangent(s, p, self._expected(s, p), self._begin)
        if sure:
            self._surer(tangent, s, p)
        self._last, self._sure = (scales, p, tangent), sure
        return tangent

    def values(self, s: Array, probability: float) -> Array:
        """Quantiles (n,) without gradients: less work where many sums have scales in common."""
        s = np.abs(np.asarray(s, dtype=float))
        std, end = self._size(s)
        high = self._high(std, end, np.asarray(probability))
        if np.any(np.count_nonzero(s > 0.0, axis=1) <= 1) or not alike(s, end + high):
            return self.quantile(s, probability).value
        series = self._series(s, end, high, Series.of_values)
        return series.solved(np.full(len(s), probability), high, np.asarray(float(ndtri(probability)) * std))

    def _high(self, std: Array, end: Array, p: Array) -> Array:
        """Upper bounds (n,) of quantiles: sums of this kind are strictly sub-Gaussian, so that
        P(X > y) <= exp(-y^2 / (2 std^2)).
        """
        return np.minimum(end, 1.1 * std * np.sqrt(-2.0 * np.log(1.0 - p)) + 1e-300)

    def below(self, s: Array, y: Array) -> tuple[Array, Array, Array]:
        """P(X <= y) (n,) of scales (n, m), its derivatives in s (n, m), and the bound of its error.

        The derivative in y is that in a scale of a constant: see `density`.
        """
        s = np.abs(np.asarray(s, dtype=float))
        std, end = self._size(s)
        most = np.minimum(np.abs(y), end)
        series = self._series(s, end, most)
        probability = 0.5 + 0.5 * np.sign(y) * (2.0 * series.below(most) - 1.0)
        beyond = np.abs(y) >= end * (1.0 - EDGE)
        probability = np.where(beyond, 0.5 + 0.5 * np.sign(y), probability)
        slopes = np.sign(y)[:, None] * series.slopes(most)
        error = np.where(beyond, _edge_error(y, end), series.missing + ROUNDING)
        flat = std <= 0.0
        probability, error = (np.where(flat, (y >= 0.0).astype(float), probability), np.where(flat, 0.0, error))
        return (np.clip(probability, 0.0, 1.0), np.where((beyond | flat)[:, None], 0.0, slopes), error)

    def within(self, s: Array, low: Array, high: Array) -> tuple[Array, Array]:
        """P(low < X <= high) (n,) of scales (n, m), and the bound of its error.

        A single series without derivatives serves both ends: a sixth of the work of `below` twice.
        """
        s = np.abs(np.asarray(s, dtype=float))
        std, end = self._size(s)
        ends = [np.minimum(np.abs(y), end) for y in (low, high)]
        series = self._series(s, end, np.asarray(np.maximum(*ends), dtype=float), Series.of_values)
        probability, error = np.zeros(len(s)), np.zeros(len(s))
        for side, y, most in ((-1.0, low, ends[0]), (1.0, high, ends[1])):
            beyond = np.abs(y) >= end * (1.0 - EDGE)
            mass_within = np.where(beyond, 1.0, 2.0 * series.below(most) - 1.0)
            below = np.where(std > 0.0, 0.5 + 0.5 * np.sign(y) * mass_within, (y >= 0.0).astype(float))
            doubt = np.where(beyond, _edge_error(y, end), series.missing + ROUNDING)
            probability += side * np.clip(below, 0.0, 1.0)
            error += np.where((std > 0.0) & np.isfinite(y), doubt, 0.0)
        return probability, error

    def density(self, s: Array, y: Array) -> Array:
        """Density of X (n,) at y (n,)."""
        s = np.abs(np.asarray(s, dtype=float))
        std, end = self._size(s)
        most = np.minimum(np.abs(y), end)
        densities = self._series(s, end, most).density(most)
        return np.where((np.abs(y) >= end) | (std <= 0.0), 0.0, densities)

    def _remember(self) -> None:
        """Forget what is remembered from before the last step: a resumed run does not compute it."""
        if self._stretch is not (now := stretch()):
            self._last, self._sure, self._begin, self._stretch = None, False, 0, now

    def _size(self, s: Array) -> tuple[Array, Array]:
        """Standard deviation and end (n,) of the sums."""
        std = np.sqrt(np.sum((s * self._std) ** 2, axis=1))
        with np.errstate(invalid="ignore"):
            ends = np.where(s > 0.0, s * self._ends, 0.0).sum(axis=1)
        return std, np.minimum(ends, REACH * std)

    def _series(self, s: Array, end: Array, most: Array, make: Callable[..., Series] | None = None) -> Series:
        self._remember()
        build, safe = make or Series.of, np.where(end > 0.0, end + most, 1.0)
        series = build(self._kinds, s, safe, TERMS[self._begin])
        for terms in TERMS[self._begin + 1 :]:
            if np.all((series.missing <= TRUNCATION_TOLERANCE) | (end <= 0.0)):
                break
            series = build(self._kinds, s, safe, terms)
        return series

    def _tangent(self, s: Array, p: Array, start: Array, at: int) -> Tangent:
        """Quantiles from `start` (n,) on, with `TERMS[at]` terms or more."""
        tangent = Tangent(np.zeros(len(s)), np.zeros_like(s), np.zeros(len(s)), np.zeros_like(s))
        self._blocks(tangent, np.arange(len(s)), s, p, start, at)
        self._replace_single_terms(s, p, tangent)
        return tangent

    def _blocks(self, tangent: Tangent, rows: NDArray[np.int64], s: Array, p: Array, start: Array, at: int) -> None:
        """Fill in some rows of `tangent` with `TERMS[at]` terms, or more where a row needs more."""
        most = max(1, BLOCK // (TERMS[at] * max(1, s.shape[1])))
        more = []
        for begin in range(0, len(rows), most):
            block = rows[begin : begin + most]
            std, end = self._size(s[block])
            high = self._high(std, end, p[block])
            series = Series.of(self._kinds, s[block], np.where(end > 0.0, end + high, 1.0), TERMS[at])
            done = (series.missing <= TRUNCATION_TOLERANCE) | (end <= 0.0) | (at + 1 == len(TERMS))
            if np.any(done):
                some = slice(None) if np.all(done) else done
                at_rows = block[some]
                self._fill(tangent, at_rows, series.of_rows(some), p[at_rows], high[some], start[at_rows], end[some])
            more.append(block[~done])
        remaining = np.concatenate(more) if more else rows
        if len(remaining) == len(rows) > 0 and at == self._begin < LARGE:
            self._begin = at + 1
        if len(remaining):
            self._blocks(tangent, remaining, s, p, start, at + 1)

    def _surer(self, tangent: Tangent, s: Array, p: Array) -> None:
        """Gradients of sums whose series falls slowly, between the chords to either side.

        The quantile is convex: its slope in s_j lies between those of the chords from s_j - h and
        to s_j + h, whose values have known errors.
        """
        doubt = np.where(s > 0.0, tangent.gradient_error * s, 0.0).sum(axis=1)
        rows = np.flatnonzero(doubt > SURE * np.abs(tangent.value))
        if not len(rows):
            return
        m, value, error = s.shape[1], tangent.value[rows], tangent.value_error[rows]
        relative_step = np.clip(2.0 * np.sqrt(error / np.maximum(value, 1e-300)), *STEP)
        h = relative_step[:, None] * s[rows]
        ends = []
        for side in (1.0, -1.0):
            shifted = (s[rows][:, None, :] + side * h[:, :, None] * np.eye(m)).reshape(-1, m)
            at_shifted = self._tangent(shifted, np.repeat(p[rows], m), np.repeat(value, m), 0)
            rise = at_shifted.value - np.repeat(value, m)
            ends.append((rise.reshape(-1, m), at_shifted.value_error.reshape(-1, m) + error[:, None]))
        safe = np.where(h > 0.0, h, 1.0)
        above = (ends[0][0] + ends[0][1]) / safe - tangent.gradient[rows]
        below = tangent.gradient[rows] + (ends[1][0] + ends[1][1]) / safe
        apart = np.where(h > 0.0, np.maximum(above, below), np.inf)
        tangent.gradient_error[rows] = np.minimum(tangent.gradient_error[rows], apart)

    def _fill(
        self, tangent: Tangent, rows: NDArray[np.int64], series: Series, p: Array, high: Array, start: Array, end: Array
    ) -> None:
        y = series.solved(p, high, start)
        density = np.maximum(series.density(y), 1e-300)
        gradient = -series.slopes(y) / density[:, None]
        missing = series.missing_slopes + ROUNDING / np.where(end > 0.0, end, 1.0)[:, None]
        with np.errstate(invalid="ignore", over="ignore"):
            doubt = missing + np.abs(gradient) * series.missing_density[:, None]
            doubt = 2.0 * doubt / density[:, None]
        tangent.value[rows], tangent.gradient[rows] = y, gradient
        tangent.value_error[rows] = 2.0 * (series.missing + ROUNDING) / density
        tangent.gradient_error[rows] = np.where(np.isfinite(doubt), doubt, np.inf)

    def _expected(self, s: Array, p: Array) -> Array:
        """Starting value: on the tangent at the last scales, or at the normal quantile."""
        last = self._last
        if last is not None and last[0].shape == s.shape and np.array_equal(last[1], p):
            return np.asarray(np.sum(np.abs(last[2].gradient) * s, axis=1))
        return np.asarray(ndtri(p) * np.sqrt(np.sum((s * self._std) ** 2, axis=1)))

    def _replace_single_terms(self, s: Array, p: Array, tangent: Tangent) -> None:
        """Replace quantiles of sums of at most one term by that of its law."""
        active = np.count_nonzero(s > 0.0, axis=1)
        for row in np.flatnonzero(active <= 1).tolist():
            for part in (tangent.value, tangent.gradient, tangent.value_error, tangent.gradient_error):
                part[row] = 0.0
            if active[row]:
                j = int(np.argmax(s[row]))
                unit = self.laws[j].quantile(float(p[row]))
                tangent.value[row], tangent.gradient[row, j] = s[row, j] * unit, unit
