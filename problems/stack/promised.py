"""The promise of one requirement's yield, given the knowledge of the processes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...models.capability import Norm, norm_of
from ...models.stack import AsMade, Tolerances, mean_of, spread_of
from ..promise import ASSURED, Promise, normal_yield
from .measured import Measured
from .posterior import Posterior

LEAST = 1e-300


@dataclass(frozen=True, eq=False)
class Promised:
    """The promise of one requirement with limits; tolerances have shape (n, parts)."""

    measured: Measured
    promise: Promise
    posterior: Posterior
    level: float | None = None

    @cached_property
    def norms(self) -> tuple[Norm, ...]:
        """The standard deviation that an assured promise uses, by the spreads of the parts.

        One norm for each process number; parts with fewer processes count with their last one.
        """
        measured = self.measured
        variances = np.diag(measured.linear.covariance)
        slopes = measured.mechanism.sensitivities
        squares = np.bincount(measured.mechanism.owners, slopes**2, minlength=len(variances))
        alone = np.divide(variances, squares, out=np.zeros_like(variances), where=squares > 0.0)
        return tuple(
            norm_of(
                [part.knowledge_of(min(number, len(part.processes) - 1)) for part in measured.parts],
                variances,
                measured.linear.slope**2 * alone,
                self.promise.confidence,
                self.level,
                self.quantile if len(self.sides) == 1 else None,
            )
            for number in range(max(len(part.processes) for part in measured.parts))
        )

    def norm(self, t: Tolerances) -> Norm:
        """The norm of designs by the processes that they choose."""
        if not isinstance(t, AsMade) or t.chosen is None or len(self.norms) == 1:
            return self.norms[0]
        at = t.chosen, np.arange(t.chosen.shape[1])
        even, own, shared = (
            np.array([getattr(norm, name) for norm in self.norms])[at] for name in ("even", "own", "shared")
        )
        errors = [norm.error for norm in self.norms if norm.error is not None]
        return Norm(even, own, shared, np.array(errors)[at] if errors else None)

    @property
    def sides(self) -> list[tuple[float, float]]:
        """Direction and distance of each limit from the mean that does not move with t."""
        mechanism = self.measured.mechanism
        ends = [(1.0, mechanism.upper - mechanism.centre), (-1.0, mechanism.centre - mechanism.lower)]
        return [(side, room) for side, room in ends if np.isfinite(room)]

    @property
    def quantile(self) -> float:
        """Standard deviations that must fit between mean and each limit."""
        return self.promise.quantile(two_sided=len(self.sides) == 2)

    def promised(self, t: Tolerances) -> Array:
        """The promised yield [percent] (n,): assured by the norm, or expected.

        For an assured yield between two limits, both count at the distance of the nearer one.
        """
        if self.promise.statement != ASSURED:
            return self.posterior.expected(self.measured, t)
        z = np.min([self._room(t, *end) for end in self.sides], axis=0) / self._spread(t)
        return normal_yield(z, two_sided=len(self.sides) == 2)

    def slopes(self, t: Tolerances) -> Array:
        """Derivatives (n, parts) of the promised yield by the spread of the parts."""
        if self.promise.statement != ASSURED:
            return self.posterior.expected_slopes(self.measured, t)
        room = np.array([self._room(t, *end) for end in self.sides])
        nearest, spread = np.argmin(room, axis=0), self._spread(t)
        side = np.array([side for side, _ in self.sides])[nearest]
        z = room.min(axis=0) / spread
        rise = -side[:, None] * self.measured.linear.mean - z[:, None] * self.norm(t).slopes(spread_of(t))
        bell = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi) * (1.0 + (len(self.sides) == 2))
        return np.asarray(100.0 * (bell / spread)[:, None] * rise)

    def lacking(self, t: Tolerances) -> Array:
        """By how much (n,) the nearest limit would have to be widened for the promise."""
        z = self.quantile * self._spread(t)
        return np.asarray(np.max([z - self._room(t, *end) for end in self.sides], axis=0))

    def _spread(self, t: Tolerances) -> Array:
        return np.maximum(self.norm(t).value(spread_of(t)), LEAST)

    def _room(self, t: Tolerances, side: float, room: float) -> Array:
        """Distance (n,) of a limit from the mean."""
        linear = self.measured.linear
        moved = spread_of(t) @ linear.mean + mean_of(t) @ linear.slope
        return np.asarray(room - side * moved)
