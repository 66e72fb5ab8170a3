"""Cost of a reducer at an rms of its backlash: cost curves for a larger problem."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy

from ...arrays import Array
from ...models.costs import CostCurve

NODES = 6000
"""Prices at which a curve in closed form is tabulated."""
LITTLE = 1e-6
"""Gain, relative to the largest, below which an error does not count."""


@dataclass(frozen=True, eq=False)
class PricedCurve(CostCurve):
    """Least cost V of a root mean square t, from its conjugate at many prices kappa of t^2.

    `t`, `cost_at` and `kappa` (n,) belong to allocations of least cost + kappa t^2, t rising: V has
    the slope -2 kappa t there. Between them it is a cubic in ln t. `margin` is how much that lies
    above the proven tangents at most: it is taken off, so that V is a lower bound. `price` is a
    factor of the whole cost.
    """

    t: Array
    cost_at: Array
    kappa: Array
    margin: float = 0.0
    price: float = 1.0
    label: str = field(default="")

    @classmethod
    def of(
        cls, t: Array, cost_at: Array, kappa: Array, proven: Array, price: float = 1.0, label: str = ""
    ) -> PricedCurve:
        """The curve of allocations, t rising, with proven lower bounds (n,) of cost + kappa t^2."""
        plain = cls(t, cost_at, kappa, 0.0, 1.0)
        fraction = np.linspace(0.0, 1.0, 9)[:-1]
        tried = np.append((t[:-1, None] + np.diff(t)[:, None] * fraction).ravel(), t[-1])
        at = np.clip(np.searchsorted(t, tried), 1, len(t) - 1)
        tangents = [proven[at - side] - kappa[at - side] * tried**2 for side in (0, 1)]
        above = plain.cost(tried) - np.maximum(*tangents)
        return cls(t, cost_at, kappa, max(0.0, float(above.max())), price, label)

    @cached_property
    def _splines(self) -> list[scipy.interpolate.PPoly]:
        """Cost over ln t, and its first and second derivative."""
        spline = scipy.interpolate.CubicHermiteSpline(np.log(self.t), self.cost_at, -2.0 * self.kappa * self.t**2)
        return [spline, spline.derivative(), spline.derivative().derivative()]

    @cached_property
    def _inverse(self) -> tuple[Array, Array]:
        """ln kappa, rising, and ln t there; the last of those at one bound."""
        return np.log(self.kappa[::-1]), np.log(self.t[::-1])

    @property
    def priced(self) -> bool:
        return True

    def _inside(self, t: Array) -> Array:
        return np.asarray(np.clip(np.asarray(t, dtype=float), self.t[0], self.t[-1]))

    def cost(self, t: Array) -> Array:
        """Beyond the last t the cost stays; below the first it is infinite."""
        t = np.asarray(t, dtype=float)
        priced = self.price * (self._splines[0](np.log(self._inside(t))) - self.margin)
        return np.where(t < self.t[0] * (1.0 - 1e-12), np.inf, priced)

    def slope(self, t: Array) -> Array:
        inside = self._inside(t)
        return np.asarray(self.price * np.minimum(self._splines[1](np.log(inside)), 0.0) / inside)

    def best(self, linear: Array, square: Array, low: float, high: float) -> Array:
        if np.any(linear):
            return super().best(linear, square, low, high)
        unpriced = np.asarray(square) / self.price
        with np.errstate(divide="ignore"):
            x = np.interp(np.log(np.maximum(unpriced, 0.0)), *self._inverse)
        # a secant step on the spline: the residual is rounding
        rise = 2.0 * unpriced * np.exp(2.0 * x)
        bend = self._splines[2](x) + 2.0 * rise
        step = np.where(bend > 0.0, (self._splines[1](x) + rise) / np.where(bend > 0.0, bend, 1.0), 0.0)
        return np.asarray(np.clip(np.exp(x - np.clip(step, -0.02, 0.02)), low, high))

    def price_at(self, t: Array) -> Array:
        """kappa (n,), without the factor, at an rms t (n,)."""
        inside = self._inside(t)
        return np.asarray(-self._splines[1](np.log(inside)) / (2.0 * inside**2))


@dataclass(frozen=True, eq=False)
class Clipped:
    """Least cost of a root mean square t of independent errors, each with its reciprocal cost.

    t^2 = sum (gain_i h_i)^2 with half-widths h_i in [low, high] and costs b_i/h_i; at a price kappa
    of t^2 h_i = (b_i / (2 kappa gain_i^2))^(1/3), clipped.
    """

    gain: Array
    b: Array
    low: float
    high: float

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest t."""
        size = float(np.linalg.norm(self.gain))
        return size * self.low, size * self.high

    @cached_property
    def _prices(self) -> Array:
        """Prices at which any error that counts is between its ends, falling."""
        counts = self.gain > LITTLE * self.gain.max()
        inner = self.b[counts] / (2.0 * self.gain[counts] ** 2)
        return np.geomspace((inner / self.low**3).max(), (inner / self.high**3).min(), NODES)

    def half_widths(self, kappa: Array) -> Array:
        """h (n, errors) at prices kappa (n,) of t^2."""
        with np.errstate(divide="ignore", over="ignore"):
            free = np.cbrt(self.b / (2.0 * np.asarray(kappa)[:, None] * self.gain**2))
        return np.clip(free, self.low, self.high)

    @cached_property
    def curve(self) -> PricedCurve:
        """The least cost over t."""
        h, kappa = self.half_widths(self._prices), self._prices
        t, cost = self.rms(h), np.sum(self.b / h, axis=1)
        apart = np.append(True, np.diff(t) > 1e-12 * t[1:])
        t, cost, kappa = t[apart], cost[apart], kappa[apart]
        return PricedCurve.of(t, cost, kappa, cost + kappa * t**2)

    def allocation(self, t: Array) -> Array:
        """h (n, errors) of least cost at root mean squares t (n,), by bisection on the price."""
        t = np.asarray(t, dtype=float)
        low = np.full(len(t), np.log(self._prices[-1]) - 1.0)
        high = np.full(len(t), np.log(self._prices[0]) + 1.0)
        for _ in range(70):
            middle = 0.5 * (low + high)
            tight = self.rms(self.half_widths(np.exp(middle))) < t
            low, high = np.where(tight, low, middle), np.where(tight, middle, high)
        return self.half_widths(np.exp(0.5 * (low + high)))

    def rms(self, h: Array) -> Array:
        """t (n,) of half-widths (n, errors)."""
        return np.asarray(np.sqrt(h**2 @ self.gain**2))
