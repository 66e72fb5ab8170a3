"""NSGA-II on arrays."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Integers
from .base import ArrayEngine, Space
from .operators import crossover, mutate, tournament


class NSGA2Engine(ArrayEngine):
    """NSGA-II (Deb, Pratap, Agarwal & Meyarivan 2002), with pymoo's operators in distribution.

    `mating` and `mutation` are pairs of probability and distribution index eta.
    """

    def __init__(
        self,
        space: Space,
        population: int,
        rng: np.random.Generator,
        mating: tuple[float, float] = (0.9, 15.0),
        mutation: tuple[float, float] = (0.1, 20.0),
    ) -> None:
        super().__init__(space, population, rng)
        self.mating = mating
        self.mutation = mutation

    def _offspring(self) -> Array:
        pairs = -(-self.population // 2)
        parents = tournament(self.f, self.v, self.rank, self.crowding, 2 * pairs, self.rng)
        mated = self.x.take(parents.reshape(pairs, 2).T.ravel(), axis=0)
        children = crossover(mated, self.space, *self.mating, self.rng)
        return mutate(children[: self.population], self.space, *self.mutation, self.rng)

    def _select(self, x: Array, f: Array, v: Array) -> Integers:
        return self._keep_best(slice(None), x, f, v)
