"""Yields over the posterior of the processes: how surely a promise is kept, and what to expect.

The requirement is normal in every draw: its variance is the sum of the drawn ones, its mean is off
by the drawn errors of the means, both in proportion to the tolerances. Where a part is made by one
of several processes, those that a design chooses count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Array, Integers
from ...models.stack import AsMade, Tolerances, mean_of, spread_of
from ..draws import Draws, Sums
from ..promise import AT_ONCE, DRAWS, assured_percent
from .definition import Part
from .measured import Measured


@dataclass(frozen=True, eq=False)
class Posterior:
    """Processes of all parts, drawn once: designs and requirements share the draws."""

    parts: tuple[Part, ...]
    seed: int
    draws: int = DRAWS

    def _drawn(self, chosen: tuple[int, ...]) -> Draws:
        """Draws of the processes that make the parts."""
        none = np.ones(self.draws), np.zeros(self.draws)
        pairs = [self._drawn_processes.get((at, self._source(at, number)), none) for at, number in enumerate(chosen)]
        variance, error = zip(*pairs, strict=True)
        return Draws(np.stack(variance, axis=1), np.stack(error, axis=1))

    @cached_property
    def _drawn_processes(self) -> dict[tuple[int, str], tuple[Array, Array]]:
        """Draws of variance and error of each sampled process, by part and machine."""
        draws = {}
        for at, part in enumerate(self.parts):
            for number in range(len(part.processes)):
                key, known = (at, self._source(at, number)), part.knowledge_of(number)
                if known is not None and key not in draws:
                    machine = [] if part.sample is not None else [number + 1]
                    drawn = Draws.of([known], [(self.seed, at, *machine)], self.draws)
                    draws[key] = drawn.variance[:, 0], drawn.error[:, 0]
        return draws

    def _source(self, at: int, number: int) -> str:
        """The machine of a process: it scatters alike with and without inspection."""
        machine = self.parts[at].processes[number].machine
        return "" if machine is None else machine.name

    def _choices(self, t: Tolerances) -> list[tuple[tuple[int, ...], Integers]]:
        """The choices of processes (p,) among designs, each with the rows that make it."""
        made = t.chosen if isinstance(t, AsMade) else None
        if made is None or not any(part.machines for part in self.parts if part.sampled):
            return [((0,) * len(self.parts), np.arange(len(t)))]
        ways, owner = np.unique(made, axis=0, return_inverse=True)
        return [(tuple(choice), np.flatnonzero(owner.ravel() == at)) for at, choice in enumerate(ways.tolist())]

    def assurance(self, of: Sequence[Measured], t: Tolerances, fraction: float) -> tuple[Array, Array]:
        """Probability [percent] (n,) that a fraction of units keeps every requirement, its error.

        The fraction is required of every requirement separately.
        """
        kept = np.empty(len(t))
        for chosen, rows in self._portions(t):
            every = np.all([self._yields(measured, t[rows], chosen) >= fraction for measured in of], axis=0)
            kept[rows] = every.mean(axis=1)
        return assured_percent(kept, self.draws)

    def expected(self, measured: Measured, t: Tolerances) -> Array:
        """Expected yield [percent] (n,) of a requirement."""
        percent = np.empty(len(t))
        for chosen, rows in self._portions(t):
            percent[rows] = 100.0 * self._yields(measured, t[rows], chosen).mean(axis=1)
        return percent

    def expected_slopes(self, measured: Measured, t: Tolerances) -> Array:
        """Derivatives (n, parts) of the expected yield by the spread of the parts."""
        slopes = np.empty_like(spread_of(t))
        for chosen, rows in self._portions(t):
            slopes[rows] = self._slopes(measured, t[rows], chosen)
        return slopes

    def _portions(self, t: Tolerances) -> list[tuple[tuple[int, ...], Integers]]:
        """Rows of designs that are evaluated together, with the processes that they choose."""
        step = max(1, AT_ONCE // self.draws)
        return [
            (chosen, rows[first : first + step])
            for chosen, rows in self._choices(t)
            for first in range(0, len(rows), step)
        ]

    @property
    def _std(self) -> Array:
        """Standard deviations (p,) at t = 1 of parts that are known by samples, else 0."""
        return np.array(
            [
                p.distribution.sigma if p.sampled else 0.0  # type: ignore[attr-defined]
                for p in self.parts
            ]
        )

    def _sums(self, measured: Measured, t: Tolerances) -> Sums:
        """The requirement as a sum of the deviations of the parts."""
        s, mechanism, linear = spread_of(t), measured.mechanism, measured.linear
        mean = mechanism.centre + mean_of(t) @ linear.slope + s @ linear.mean
        return Sums(
            mean,
            s * np.sqrt(np.diag(linear.covariance)),
            s * linear.slope * self._std,
            np.zeros(len(s)),
            mechanism.lower,
            mechanism.upper,
        )

    def _yields(self, measured: Measured, t: Tolerances, chosen: tuple[int, ...]) -> Array:
        """Yields (n, draws)."""
        return self._sums(measured, t).yields(self._drawn(chosen))

    def _slopes(self, measured: Measured, t: Tolerances, chosen: tuple[int, ...]) -> Array:
        sums, drawn = self._sums(measured, t), self._drawn(chosen)
        std, above, below = sums.ends(drawn)
        bells = [
            np.where(np.isfinite(z), np.exp(-0.5 * np.where(np.isfinite(z), z, 0.0) ** 2), 0.0)
            / (np.sqrt(2.0 * np.pi) * std)
            for z in (above, below)
        ]
        far = [np.where(np.isfinite(z), z, 0.0) for z in (above, below)]
        by_mean = -(bells[0] - bells[1])
        by_std = -(bells[0] * far[0] - bells[1] * far[1])
        s, linear = spread_of(t), measured.linear
        moved = by_mean @ drawn.error * linear.slope * self._std
        moved += by_mean.sum(axis=1)[:, None] * linear.mean
        wider = ((by_std / std) @ drawn.variance) * np.diag(linear.covariance) * s
        return np.asarray(100.0 * (moved + wider) / self.draws)
