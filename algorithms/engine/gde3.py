"""GDE3 on arrays."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Flags, Integers
from .base import ArrayEngine, Space
from .operators import differential


class GDE3Engine(ArrayEngine):
    """GDE3 (Kukkonen & Lampinen 2005): differential evolution for several objectives.

    A trial point replaces its parent where it dominates it, is dropped where the parent dominates
    it, and otherwise joins the population, which is then pruned by rank and crowding.
    """

    def __init__(
        self,
        space: Space,
        population: int,
        rng: np.random.Generator,
        rate: float = 0.9,
        scale: tuple[float, float] = (0.0, 1.0),
    ) -> None:
        super().__init__(space, population, rng)
        self.rate = rate
        self.scale = scale

    def _offspring(self) -> Array:
        return differential(self.x, self.space, self.rate, self.scale, self.rng)

    def _select(self, x: Array, f: Array, v: Array) -> Integers:
        if not len(self.x):
            return self._keep_best(slice(None), x, f, v)
        stay = np.concatenate(_duel(self.f, self.v, f, v))
        return self._keep_best(np.flatnonzero(stay), x, f, v)


def _duel(f: Array, v: Array, trial_f: Array, trial_v: Array) -> tuple[Flags, Flags]:
    """Which parents and which trial points stay; of equal points the trial point stays."""
    feasible = (v <= 0.0) & (trial_v <= 0.0)
    better = np.where(feasible, (trial_f <= f).all(axis=1), trial_v < v)
    worse = np.where(feasible, (f <= trial_f).all(axis=1), v < trial_v)
    return ~better, better | ~worse
