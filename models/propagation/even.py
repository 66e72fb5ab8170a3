"""Laws of deviations that are even and log-concave, by their characteristic functions.

A quantile of a weighted sum of such deviations is convex in the weights (`symmetric_sum`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from scipy.special import erf, gamma, jv, ndtri, wofz

from ...arrays import Array
from ..inputs import Beta, Distribution, Normal, Trapezoid, Triangular, TruncatedNormal, Uniform

NEAR = 1e-3
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
        flat = _sinc_alone(0.5 * (1.0 + self.top) * w)
        return flat if self.top == 1.0 else flat * _sinc_alone(0.5 * (1.0 - self.top) * w)

    def envelope(self, w: Array) -> tuple[Array, Array]:
        if self.top == 1.0:
            return _power(1.0, 1.0, w)
        return _power(4.0 / (1.0 - self.top**2), 2.0, w)

    def slope_envelope(self, w: Array) -> tuple[Array, Array]:
        if self.top == 1.0:
            return _power(2.0, 1.0, w)
        return _power(8.0 / (1.0 - self.top**2), 2.0, w)


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
        return _power(self.sigma**2 * self._bend, 1.0, w)


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
        near = np.abs(w) < NEAR
        safe = np.where(near, 1.0, np.abs(w))
        scale = gamma(self.k + 0.5) * (2.0 / safe) ** order
        square = 1.0 / (2.0 * self.k + 1.0)
        phi = np.where(near, 1.0 - 0.5 * square * w * w, scale * jv(order, safe))
        return phi, np.where(near, -square * w, -np.sign(w) * scale * jv(order + 1.0, safe))

    def envelope(self, w: Array) -> tuple[Array, Array]:
        order = self.k - 0.5
        return _power(float(gamma(self.k + 0.5)) * 2.0**order * LANDAU, order + 1.0 / 3.0, w)

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


def _sinc_alone(w: Array) -> Array:
    """sin(w)/w."""
    near = np.abs(w) < NEAR
    safe = np.where(near, 1.0, w)
    value = np.asarray(np.sin(safe) / safe)
    if np.any(near):
        square = np.asarray(w)[near] ** 2
        value[near] = 1.0 - square / 6.0 + square * square / 120.0
    return value


def _sinc(w: Array) -> tuple[Array, Array]:
    """sin(w)/w and its derivative."""
    near = np.abs(w) < NEAR
    safe = np.where(near, 1.0, w)
    value = _sinc_alone(w)
    slope = np.where(near, -w / 3.0 + w**3 / 30.0, (np.cos(safe) - value) / safe)
    return value, slope


def _power(factor: float, order: float, w: Array) -> tuple[Array, Array]:
    """min(1, factor w^-order) and its order of falling."""
    with np.errstate(divide="ignore", over="ignore"):
        bound = factor / np.maximum(w, 1e-300) ** order
    return np.minimum(bound, 1.0), np.where(bound < 1.0, order, 0.0)
