"""Propagation by convolution on a lattice: mean, spread, quantile, yield and interference."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import erf, gamma, jv, ndtri, wofz

from ...section import Array, Integers
from ..inputs import Beta, Distribution, Normal, Trapezoid, Triangular, TruncatedNormal, Uniform
from .sums import ClippedSum, Estimate, Propagated, Propagation, Term, total_cumulants

# Distributions on a lattice of multiples of a step, one step per design.
#
# A term is split onto the lattice by linear allocation: the mass at x goes to the two neighbouring
# points so that its mean stays. The masses are second differences of E[(x - Y)+], which the partial
# moments of the input give exactly, so no density is ever sampled. Panjer & Lutek (1983), Insurance:
# Mathematics and Economics 2(3), 159-177, call it the method of matching the first moment.


Spectrum = NDArray[np.complex128]


def stop_loss(term: Term, x: Array) -> Array:
    """E[(x - Y)+] of the contribution Y of `term`, for x of shape (n, k)."""
    away = x - term.constant[:, None]
    if term.quadratic is None:
        return _stop_loss_linear(term, away)
    return np.where((term.quadratic == 0.0)[:, None], _stop_loss_linear(term, away), _stop_loss_quadratic(term, away))


def _stop_loss_linear(term: Term, away: Array) -> Array:
    slope = term.linear[:, None]
    flat = slope == 0.0
    safe = np.where(flat, 1.0, slope)
    mass, first, _ = term.distribution.partial_moments(away / safe)
    mean = term.distribution.raw_moments(1)[1]
    rising = away * mass - slope * first
    falling = away * (1.0 - mass) - slope * (mean - first)
    return np.where(flat, np.maximum(away, 0.0), np.where(slope > 0.0, rising, falling))


def _stop_loss_quadratic(term: Term, away: Array) -> Array:
    """The same for linear z + quadratic z^2: the mass between the roots, or outside of them."""
    assert term.quadratic is not None
    b, a = term.linear[:, None], np.where(term.quadratic == 0.0, 1.0, term.quadratic)[:, None]
    square = b * b + 4.0 * a * away
    root = np.sqrt(np.maximum(square, 0.0))
    stable = -0.5 * (b + np.where(b < 0.0, -root, root))
    first_root = stable / a
    single = (square <= 0.0) | (stable == 0.0)  # beyond the vertex: no root, an empty interval
    second_root = np.where(single, first_root, -away / np.where(single, 1.0, stable))
    low = term.distribution.partial_moments(np.minimum(first_root, second_root))
    high = term.distribution.partial_moments(np.maximum(first_root, second_root))
    inside = [upper - lower for lower, upper in zip(low, high, strict=True)]
    between = away * inside[0] - b * inside[1] - a * inside[2]
    _, first, second = term.distribution.raw_moments(2)
    return np.where(a > 0.0, between, away - b * first - a * second - between)


def masses(term: Term, step: Array) -> tuple[Array, Integers]:
    """Masses (n, k) of `term` on the lattice and the lattice index (n,) of the first of them."""
    low, high = term.bounds()
    start = np.floor(low / step).astype(np.int64) - 1
    count = int(np.max(np.ceil(high / step).astype(np.int64) - start)) + 3
    x = (start[:, None] + np.arange(count)) * step[:, None]
    mass = np.diff(stop_loss(term, x), n=2, axis=1) / step[:, None]
    near = (x > (low - step)[:, None]) & (x < (high + step)[:, None])
    return np.where(near[:, 1:-1], np.maximum(mass, 0.0), 0.0), start + 1


def spectrum(terms: tuple[Term, ...], step: Array, points: int) -> tuple[Spectrum, Integers]:
    """Transform (n, points // 2 + 1) of the sum of `terms`, and the lattice index of its start."""
    product: Spectrum | None = None
    start = np.zeros(len(step), dtype=np.int64)
    for term in terms:
        mass, first = masses(term, step)
        transform = scipy.fft.rfft(_wrapped_mass(mass, points), n=points, axis=1)
        product = transform if product is None else product * transform
        start += first
    assert product is not None
    return product, start


def _wrapped_mass(mass: Array, points: int) -> Array:
    """Mass beyond the last lattice point, folded round: the lattice is periodic."""
    if mass.shape[1] <= points:
        return mass
    folds = -(-mass.shape[1] // points)
    padded = np.zeros((len(mass), folds * points))
    padded[:, : mass.shape[1]] = mass
    return np.asarray(padded.reshape(len(mass), folds, points).sum(axis=1))


def window(transform: Spectrum, start: Integers, first: Integers, points: int) -> Array:
    """Masses at lattice indices first .. first + points - 1, shape (n, points)."""
    periodic = scipy.fft.irfft(transform, n=points, axis=1)
    at = (first - start)[:, None] + np.arange(points)
    return np.take_along_axis(periodic, at % points, axis=1)


REACH = 9.0
"""Standard deviations that the lattice covers on either side where the inputs are unbounded."""
HEAVY = 1e-9
"""Mass that an input may have beyond REACH standard deviations; with more, its quantiles are used."""
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
    negative = _negative_probability(mass, -first)
    effective, base = _clip(mass, first)
    free, free_start = spectrum(total.free, step, points)
    begin = base + np.floor(free_low / step).astype(np.int64) - 2 * len(total.free)
    spread = window(scipy.fft.rfft(effective, axis=1) * free, base + free_start, begin, points)
    x = (begin[:, None] + np.arange(points)) * step[:, None]
    return np.array([*_moments(spread, x), *_levels(spread, x, step, coverage, limit), negative])


def _range(terms: tuple[Term, ...]) -> tuple[Array, Array, Array]:
    """Lower end, upper end and width of the range of a sum of terms, each (n,)."""
    ends = np.array([term.bounds() for term in terms]).sum(axis=0)
    light = [_is_light_tailed(term) for term in terms]
    wide = [_ends_of_heavy(term) for term, covered in zip(terms, light, strict=True) if not covered]
    straight = tuple(term for term, covered in zip(terms, light, strict=True) if covered)
    low, high = np.array(wide).sum(axis=0) if wide else np.zeros_like(ends)
    if straight:
        mean, variance = total_cumulants(straight)[:2]
        low = low + mean - REACH * np.sqrt(variance)
        high = high + mean + REACH * np.sqrt(variance)
    low, high = np.maximum(ends[0], low), np.minimum(ends[1], high)
    return low, high, high - low


def _ends_of_heavy(term: Term) -> tuple[Array, Array]:
    """Lower and upper end (n,) of a term beyond which `HEAVY` of its mass lies at most; its bounds where
    it is not linear.
    """
    if term.quadratic is not None:
        return term.bounds()
    ends = term.constant + np.outer(term.distribution.quantile(np.array([HEAVY, 1.0 - HEAVY])), term.linear)
    return ends.min(axis=0), ends.max(axis=0)


def _is_light_tailed(term: Term) -> bool:
    """Whether REACH standard deviations cover the contribution.

    They do not for z^2 of a normal z, nor for a rare outlier.
    """
    if term.quadratic is not None:
        return False
    _, mean, square = term.distribution.raw_moments(2)
    reach = REACH * np.sqrt(max(square - mean**2, 0.0))
    below, upto = term.distribution.partial_moments(np.array([mean - reach, mean + reach]))[0]
    return bool(below + 1.0 - upto <= HEAVY)


def _negative_probability(mass: Array, zero: Integers) -> Array:
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


# Laws of deviations that are even and log-concave, by their characteristic functions.
#
# A quantile of a weighted sum of such deviations is convex in the weights (`symmetric_sum`).


MAX_SERIES_ARGUMENT = 1e-3
"""Arguments below which a power series replaces a quotient."""
LANDAU = 0.7858
"""|J_nu(x)| <= 0.7858 x^(-1/3), nu >= 0, x > 0 (Landau 2000, J. London Math. Soc. 61)."""


class Even(ABC):
    """A law of z with an even and log-concave density.

    `reach` is the end of its support (inf where it has none), `std` its standard deviation.
    """

    reach: float = 1.0

    @property
    @abstractmethod
    def std(self) -> float:
        """Standard deviation of z."""

    @abstractmethod
    def quantile(self, probability: float) -> float:
        """The z below which `probability` of the units lie."""

    @abstractmethod
    def characteristic(self, w: Array) -> tuple[Array, Array]:
        """phi(w) = E cos(w z) and its derivative -E z sin(w z), each of the shape of `w`."""

    def value(self, w: Array) -> Array:
        """phi(w) alone."""
        return self.characteristic(w)[0]

    @abstractmethod
    def envelope(self, w: Array) -> tuple[Array, Array]:
        """A bound of |phi| that falls from w on at least like w^-d, and d, each shape of `w`."""

    def slope_envelope(self, w: Array) -> tuple[Array, Array]:
        """The same of |phi'|; E|z| <= 1 is the default bound."""
        return np.ones_like(w), np.zeros_like(w)


@dataclass(frozen=True)
class EvenPlateau(Even):
    """Uniform on [-1, 1] (`top` 1), trapezoid, triangle (`top` 0): a sum of two uniform laws."""

    top: float = 1.0

    @property
    def std(self) -> float:
        return float(np.sqrt((1.0 + self.top**2) / 6.0))

    def quantile(self, probability: float) -> float:
        return float(Trapezoid(self.top).quantile(np.array(probability)))

    def characteristic(self, w: Array) -> tuple[Array, Array]:
        wide = _sinc(0.5 * (1.0 + self.top) * w)
        if self.top == 1.0:
            return wide
        a, b = 0.5 * (1.0 + self.top), 0.5 * (1.0 - self.top)
        narrow = _sinc(b * w)
        return wide[0] * narrow[0], a * wide[1] * narrow[0] + b * wide[0] * narrow[1]

    def value(self, w: Array) -> Array:
        flat = _sinc_value(0.5 * (1.0 + self.top) * w)
        return flat if self.top == 1.0 else flat * _sinc_value(0.5 * (1.0 - self.top) * w)

    def envelope(self, w: Array) -> tuple[Array, Array]:
        if self.top == 1.0:
            return power_envelope(1.0, 1.0, w)
        return power_envelope(4.0 / (1.0 - self.top**2), 2.0, w)

    def slope_envelope(self, w: Array) -> tuple[Array, Array]:
        if self.top == 1.0:
            return power_envelope(2.0, 1.0, w)
        return power_envelope(8.0 / (1.0 - self.top**2), 2.0, w)


@dataclass(frozen=True)
class EvenNormal(Even):
    """Normal with mean 0 and standard deviation `sigma`."""

    sigma: float
    reach: float = float("inf")

    @property
    def std(self) -> float:
        return self.sigma

    def quantile(self, probability: float) -> float:
        return float(self.sigma * ndtri(probability))

    def characteristic(self, w: Array) -> tuple[Array, Array]:
        phi = np.exp(-0.5 * (self.sigma * w) ** 2)
        return phi, -(self.sigma**2) * w * phi

    def value(self, w: Array) -> Array:
        return np.asarray(np.exp(-0.5 * (self.sigma * w) ** 2))

    def envelope(self, w: Array) -> tuple[Array, Array]:
        square = (self.sigma * w) ** 2
        return np.exp(-0.5 * square), square

    def slope_envelope(self, w: Array) -> tuple[Array, Array]:
        bound, fall = self.envelope(w)
        safe = self.sigma * w > 1.0
        slope = np.where(safe, self.sigma**2 * w * bound, self.sigma)
        return slope, np.where(safe, np.maximum(fall - 1.0, 0.0), 0.0)


@dataclass(frozen=True)
class EvenTruncatedNormal(Even):
    """Normal of scale `sigma` about 0, cut at -1 and +1."""

    sigma: float

    @property
    def _peak(self) -> float:
        return float(1.0 / (self.sigma * np.sqrt(2.0 * np.pi) * erf(np.sqrt(0.5) / self.sigma)))

    @property
    def std(self) -> float:
        edge = self._peak * np.exp(-0.5 / self.sigma**2)
        return float(np.sqrt(self.sigma**2 * (1.0 - 2.0 * edge)))

    def quantile(self, probability: float) -> float:
        return float(TruncatedNormal(1.0 / (3.0 * self.sigma)).quantile(np.array(probability)))

    def characteristic(self, w: Array) -> tuple[Array, Array]:
        c, s = 1.0 / self.sigma, self.sigma * w
        turn = np.exp(1j * c * s) * wofz((s + 1j * c) / np.sqrt(2.0))
        mass = float(erf(np.sqrt(0.5) * c))
        phi = (np.exp(-0.5 * s * s) - np.exp(-0.5 * c * c) * turn.real) / mass
        edge = self._peak * np.exp(-0.5 * c * c)
        return phi, self.sigma**2 * (2.0 * edge * np.sin(w) - w * phi)

    @property
    def _bend(self) -> float:
        """A bound of 2 |f'(1)| plus the total variation of f'."""
        turn = min(self.sigma, 1.0)
        return float(4.0 * self._peak * turn / self.sigma**2 * np.exp(-0.5 * (turn / self.sigma) ** 2))

    def envelope(self, w: Array) -> tuple[Array, Array]:
        safe = np.maximum(w, 1e-150)
        edge = self._peak * np.exp(-0.5 / self.sigma**2)
        bound = np.minimum(2.0 * self._peak / safe, 2.0 * edge / safe + self._bend / safe**2)
        return np.minimum(bound, 1.0), np.where(bound < 1.0, 1.0, 0.0)

    def slope_envelope(self, w: Array) -> tuple[Array, Array]:
        return power_envelope(self.sigma**2 * self._bend, 1.0, w)


@dataclass(frozen=True)
class EvenBeta(Even):
    """Beta(k, k) on [-1, 1], k >= 1: phi = Gamma(k + 1/2) (2/w)^(k - 1/2) J_(k - 1/2)(w)."""

    k: float

    @property
    def std(self) -> float:
        return float(np.sqrt(1.0 / (2.0 * self.k + 1.0)))

    def quantile(self, probability: float) -> float:
        return float(Beta(self.k, self.k).quantile(np.array(probability)))

    def characteristic(self, w: Array) -> tuple[Array, Array]:
        order = self.k - 0.5
        near = np.abs(w) < MAX_SERIES_ARGUMENT
        safe = np.where(near, 1.0, np.abs(w))
        scale = gamma(self.k + 0.5) * (2.0 / safe) ** order
        square = 1.0 / (2.0 * self.k + 1.0)
        phi = np.where(near, 1.0 - 0.5 * square * w * w, scale * jv(order, safe))
        return phi, np.where(near, -square * w, -np.sign(w) * scale * jv(order + 1.0, safe))

    def envelope(self, w: Array) -> tuple[Array, Array]:
        order = self.k - 0.5
        return power_envelope(float(gamma(self.k + 0.5)) * 2.0**order * LANDAU, order + 1.0 / 3.0, w)

    def slope_envelope(self, w: Array) -> tuple[Array, Array]:
        return self.envelope(w)


UNIFORM = EvenPlateau()


def even_law(law: Distribution) -> tuple[float, Even] | None:
    """Mean and even, log-concave law of z minus its mean; None for other laws.

    Skewed laws, and those with poles at the limits (beta below 1), have quantiles that are not
    convex in the tolerances.
    """
    match law:
        case Uniform():
            return 0.0, UNIFORM
        case Trapezoid():
            return 0.0, EvenPlateau(law.top)
        case Triangular(mode=0.0):
            return 0.0, EvenPlateau(0.0)
        case Normal():
            return law.shift, EvenNormal(law.sigma)
        case TruncatedNormal(shift=0.0):
            return 0.0, EvenTruncatedNormal(law.sigma)
        case Beta() if law.alpha == law.beta and law.alpha >= 1.0:
            return 0.0, EvenBeta(law.alpha)
    return None


def _sinc_value(w: Array) -> Array:
    """sin(w)/w."""
    return _sinc_apart(w, *_apart_from_zero(w))


def _sinc(w: Array) -> tuple[Array, Array]:
    """sin(w)/w and its derivative."""
    safe, near = _apart_from_zero(w)
    value = _sinc_apart(w, safe, near)
    slope = np.asarray((np.cos(safe) - value) / safe)
    if near is not None:
        small = w[near]
        slope[near] = -small / 3.0 + small**3 / 30.0
    return value, slope


def _apart_from_zero(w: Array) -> tuple[Array, NDArray[np.bool_] | None]:
    """Arguments by which one can divide, and where others stand for those near zero; None where none is near."""
    near = np.abs(w) < MAX_SERIES_ARGUMENT
    return (np.where(near, 1.0, w), near) if np.any(near) else (w, None)


def _sinc_apart(w: Array, safe: Array, near: NDArray[np.bool_] | None) -> Array:
    value = np.asarray(np.sin(safe) / safe)
    if near is not None:
        square = w[near] ** 2
        value[near] = 1.0 - square / 6.0 + square * square / 120.0
    return value


def power_envelope(factor: float, order: float, w: Array) -> tuple[Array, Array]:
    """min(1, factor w^-order) (shape of `w`), and its order of falling."""
    with np.errstate(divide="ignore", over="ignore"):
        bound = factor / np.maximum(w, 1e-300) ** order
    return np.minimum(bound, 1.0), np.where(bound < 1.0, order, 0.0)
