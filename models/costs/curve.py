"""The interface of a cost-tolerance curve."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from ...arrays import Array
from ..roots import bracketed_roots


class CostCurve(ABC):
    """Relative cost C(t) of holding a tolerance t > 0 (in the unit of its variable).

    Manufacturing cost falls as the tolerance widens: `slope` is negative or zero everywhere.
    """

    not_negative: ClassVar[tuple[str, ...]] = ()
    """Coefficients that must not be below 0: the cost would rise with the tolerance."""

    @abstractmethod
    def cost(self, t: Array) -> Array:
        """C(t), same shape as t."""

    @abstractmethod
    def slope(self, t: Array) -> Array:
        """dC/dt, same shape as t."""

    @property
    def bends(self) -> tuple[float, ...]:
        """Tolerances at which C bends down: between them it is convex."""
        return ()

    @property
    def priced(self) -> bool:
        """Whether the curve is given by the prices of its t^2: `best` then costs less than C."""
        return False

    @property
    def smooth(self) -> bool:
        """Whether the slope of C is continuous."""
        return True

    def best(self, linear: Array, square: Array, low: float, high: float) -> Array:
        """The t in [low, high] that minimises C(t) + linear t + square t^2, shape (n,).

        `linear` and `square` (n,) are the prices of a tolerance, square >= 0; 0 < low <= high.
        """
        stationary = self.stationary(linear, square)
        if stationary is None:
            return self._root(linear, square, low, high)
        return np.clip(stationary, low, high)

    def stationary(self, linear: Array, square: Array) -> Array | None:
        """The stationary point in closed form, inf where there is none; None if not known."""
        return None

    def _root(self, linear: Array, square: Array, low: float, high: float) -> Array:
        """`best` by a safeguarded root of the derivative, which rises with t."""

        def rise(x: Array, p: Array, q: Array) -> Array:
            t = np.exp(x)
            return t * (self.slope(t) + p + 2.0 * q * t)

        ends = np.log(low), np.log(high)
        falls = rise(np.full_like(linear, ends[1]), linear, square) <= 0.0
        rises = rise(np.full_like(linear, ends[0]), linear, square) >= 0.0
        minimum = np.where(falls, high, low)
        inner = ~(falls | rises)
        if np.any(inner):
            minimum[inner] = np.exp(bracketed_roots(rise, ends, linear[inner], square[inner]).x)
        return np.clip(minimum, low, high)

    def faults(self) -> list[tuple[str, str]]:
        """(field, message) for every coefficient that makes the curve rise or meaningless."""
        reason = "must not be negative (the cost would rise with the tolerance)"
        values = {name: float(getattr(self, name)) for name in self.not_negative}
        return [(name, f"{reason}, got {value:g}") for name, value in values.items() if value < 0]
