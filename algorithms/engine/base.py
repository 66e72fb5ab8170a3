"""The common part of all array engines: the search space, ask and tell, the state."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array, Flags, Integers
from ..states import SavedState, State
from .survival import survivors, violation_of

if TYPE_CHECKING:
    from ...problems.tolerance_problem import ToleranceProblem


@dataclass(frozen=True, eq=False)
class Space:
    """A box: bounds (variables,), which variables are integers, and the number of objectives."""

    low: Array
    high: Array
    integer: Flags
    objectives: int
    _tiled: Array = field(default_factory=lambda: np.empty((2, 0)), init=False)

    @classmethod
    def of(cls, problem: ToleranceProblem) -> Space:
        """The search space of a problem."""
        return cls(problem.xl, problem.xu, np.array([v.integer for v in problem.free]), problem.n_obj)

    @cached_property
    def ends(self) -> Array:
        """Lower and upper bounds (2, variables)."""
        return np.stack([self.low, self.high])

    def ends_of(self, points: int) -> Array:
        """Lower and upper bounds (2, points * variables) of so many points, one after the other."""
        size = points * len(self.low)
        if self._tiled.shape[1] < size:
            object.__setattr__(self, "_tiled", np.tile(self.ends, points))
        return self._tiled[:, :size]

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Uniformly drawn points (count, variables)."""
        x = self.low + (self.high - self.low) * rng.random((count, len(self.low)))
        return self.repaired(x)

    def repaired(self, x: Array) -> Array:
        """The points, with their integer variables rounded."""
        return np.where(self.integer, np.rint(x), x) if np.count_nonzero(self.integer) else x


class ArrayEngine(ABC):
    """A population search on arrays: alternately `ask` for points and `tell` their values.

    The population is x (n, variables), f (n, objectives) and the total violation v (n,), the sum of
    the positive constraints; it is empty before the first `tell`. The arrays are replaced, never
    changed, so that an earlier state stays valid.
    """

    def __init__(self, space: Space, population: int, rng: np.random.Generator) -> None:
        self.space = space
        self.population = population
        self.rng = rng
        self.x = np.empty((0, len(space.low)))
        self.f = np.empty((0, space.objectives))
        self.v = np.empty(0)
        self.rank = np.empty(0, dtype=np.int64)
        self.crowding = np.empty(0)

    def ask(self) -> Array:
        """Points (n, variables) to be evaluated, within the bounds."""
        if not len(self.x):
            return self.space.draw(self.population, self.rng)
        return self.space.repaired(self._offspring())

    def tell(self, x: Array, f: Array, g: Array) -> Integers:
        """Take in the points that were asked for: objectives f, constraints g (n, any number).

        Returns which rows of the old population and these points, one after the other, are the new
        population.
        """
        return self._select(x, f, violation_of(g))

    @abstractmethod
    def _offspring(self) -> Array:
        """New points from the population."""

    @abstractmethod
    def _select(self, x: Array, f: Array, v: Array) -> Integers:
        """Replace the population by the best of it and the new points; see `tell`."""

    def _keep_best(self, candidates: Integers | slice, x: Array, f: Array, v: Array) -> Integers:
        """Make the best of some rows of the population and new points the population."""
        x, f = np.concatenate([self.x, x]), np.concatenate([self.f, f])
        v = np.concatenate([self.v, v])
        best, self.rank, self.crowding = survivors(f[candidates], v[candidates], self.population, self.rng)
        rows = best if isinstance(candidates, slice) else candidates[best]
        self.x, self.f, self.v = x.take(rows, axis=0), f.take(rows, axis=0), v.take(rows)
        return rows

    def state(self) -> State:
        """Everything that the next step depends on, as arrays; the generator as JSON."""
        return {
            "x": self.x,
            "f": self.f,
            "v": self.v,
            "rank": self.rank,
            "crowding": self.crowding,
            "rng": np.array(json.dumps(self.rng.bit_generator.state)),
        }

    def restore(self, state: SavedState) -> None:
        """Continue from a `state()`."""
        self.x, self.f, self.v = state["x"], state["f"], state["v"]
        self.rank, self.crowding = state["rank"], state["crowding"]
        self.rng.bit_generator.state = json.loads(str(state["rng"]))
