"""Yields over the posterior of the processes: how surely a promise is kept, and what to expect.

Of every draw the requirement is normal: its variance is the sum of the drawn ones, its mean is off
by the drawn errors of the means, both in proportion to the tolerances.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ...models.stack import Tolerances, mean_of, spread_of
from .definition import Part
from .measured import Measured

Array = NDArray[np.float64]
DRAWS = 20_000
"""Draws of the posterior that a stated assurance is of."""
AT_ONCE = 2_000_000
"""Yields that are computed at once."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Processes of all parts, drawn once: designs and requirements share the draws."""

    parts: tuple[Part, ...]
    seed: int
    draws: int = DRAWS

    @cached_property
    def _drawn(self) -> tuple[Array, Array]:
        """Variances over their estimates, and errors of means over the estimates (draws, p)."""
        variance, error = (
            np.ones((self.draws, len(self.parts))),
            np.zeros((self.draws, len(self.parts))),
        )
        for at, part in enumerate(self.parts):
            if part.sample is not None:
                rng = np.random.default_rng([self.seed, at])
                variance[:, at], error[:, at] = part.sample.knowledge.drawn(self.draws, rng)
        return variance, error

    def assurance(self, of: Sequence[Measured], t: Tolerances, share: float) -> tuple[Array, Array]:
        """Probability [percent] (n,) that a share of the units keeps every requirement, its error.

        Every requirement is asked for the share on its own.
        """
        kept = np.empty(len(t))
        for rows in self._portions(len(t)):
            every = np.all([self._yields(one, t[rows])[0] >= share for one in of], axis=0)
            kept[rows] = every.mean(axis=1)
        error = np.sqrt(np.maximum(kept * (1.0 - kept), 1.0 / self.draws) / self.draws)
        return 100.0 * kept, 100.0 * error

    def expected(self, one: Measured, t: Tolerances) -> Array:
        """Expected yield [percent] (n,) of a requirement."""
        each = [self._yields(one, t[rows])[0].mean(axis=1) for rows in self._portions(len(t))]
        return np.asarray(100.0 * np.concatenate([np.empty(0), *each]))

    def expected_slopes(self, one: Measured, t: Tolerances) -> Array:
        """Derivatives (n, parts) of the expected yield by the spread of the parts."""
        found = np.empty_like(spread_of(t))
        for rows in self._portions(len(t)):
            found[rows] = self._slopes(one, t[rows])
        return found

    def _portions(self, n: int) -> list[slice]:
        step = max(1, AT_ONCE // self.draws)
        return [slice(first, first + step) for first in range(0, n, step)]

    def _coefficients(self, one: Measured) -> tuple[Array, Array]:
        """Variances (draws, p) and shifts of the mean (draws, p) of a requirement at t = 1."""
        variance, error = self._drawn
        std = np.array([p.distribution.sigma if p.sample is not None else 0.0  # type: ignore[attr-defined]
                        for p in self.parts])  # fmt: skip
        slope = one.linear.slope * std
        return variance * np.diag(one.linear.covariance), error * slope + one.linear.mean

    def _yields(self, one: Measured, t: Tolerances) -> tuple[Array, tuple[Array, Array, Array]]:
        """Yields (n, draws), and standard deviation and distance of each limit behind them."""
        square, shift = self._coefficients(one)
        s, mechanism = spread_of(t), one.mechanism
        std = np.maximum(np.sqrt(s**2 @ square.T), 1e-300)
        mean = mechanism.centre + (mean_of(t) @ one.linear.slope)[:, None] + s @ shift.T
        above, below = (mechanism.upper - mean) / std, (mechanism.lower - mean) / std
        return np.asarray(ndtr(above) - ndtr(below)), (std, above, below)

    def _slopes(self, one: Measured, t: Tolerances) -> Array:
        _, (std, above, below) = self._yields(one, t)
        square, shift = self._coefficients(one)
        bells = [np.where(np.isfinite(z), np.exp(-0.5 * np.where(np.isfinite(z), z, 0.0) ** 2), 0.0)
                 / (np.sqrt(2.0 * np.pi) * std) for z in (above, below)]  # fmt: skip
        far = [np.where(np.isfinite(z), z, 0.0) for z in (above, below)]
        by_mean = -(bells[0] - bells[1])
        by_std = -(bells[0] * far[0] - bells[1] * far[1])
        each = by_mean @ shift + ((by_std / std) @ square) * spread_of(t)
        return np.asarray(100.0 * each / self.draws)
