"""Array engines as pymoo algorithms: `minimize(problem, ArrayNSGA2(pop_size=100), ...)`."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
from pymoo.core.algorithm import Algorithm
from pymoo.core.population import Population
from pymoo.util.display.multi import MultiObjectiveOutput

from .engine import ArrayEngine, GDE3Engine, NSGA2Engine, Space


class PymooEngine(Algorithm):
    """An array engine behind pymoo's ask and tell, for any bounded real or integer problem."""

    def __init__(self, pop_size: int = 100, **kwargs: Any) -> None:
        super().__init__(output=MultiObjectiveOutput(), **kwargs)
        self.pop_size = pop_size
        self.engine: ArrayEngine | None = None
        self.pop: Any = None

    @abstractmethod
    def _engine(self, space: Space, rng: np.random.Generator) -> ArrayEngine:
        """The engine, with the settings of this algorithm."""

    def _setup(self, problem: Any, **kwargs: Any) -> None:
        if not problem.has_bounds():
            raise ValueError("an array engine needs bounds: give the problem xl and xu")
        if problem.n_eq_constr:
            raise ValueError(
                f"an array engine takes inequality constraints only, got {problem.n_eq_constr} "
                "equalities: write h = 0 as |h| - tolerance <= 0"
            )
        integer = np.full(problem.n_var, problem.vtype is int)
        low, high = (np.asarray(bound, dtype=float) for bound in problem.bounds())
        space = Space(low, high, integer, problem.n_obj)
        self.engine = self._engine(space, self.random_state)

    def _initialize_infill(self) -> Population:
        return self._infill()

    def _infill(self) -> Population:
        assert self.engine is not None
        return Population.new("X", self.engine.ask())

    def _initialize_advance(self, infills: Any = None, **kwargs: Any) -> None:
        self._advance(infills)

    def _advance(self, infills: Any = None, **kwargs: Any) -> None:
        assert self.engine is not None
        before = self.pop if len(self.engine.x) else Population.empty()
        x, f, g = (np.asarray(infills.get(key), dtype=float) for key in ("X", "F", "G"))
        rows = self.engine.tell(x, f, g.reshape(len(x), -1))
        self.pop = Population.merge(before, infills)[rows]
        self.pop.set("rank", self.engine.rank, "crowding", self.engine.crowding)


class ArrayNSGA2(PymooEngine):
    """NSGA-II on arrays; `crossover` and `mutation` are pairs of probability and eta.

    Without `mutation` the probability is 1/variables, at most 0.5, and eta 20, as in pymoo.
    """

    def __init__(
        self,
        pop_size: int = 100,
        crossover: tuple[float, float] = (0.9, 15.0),
        mutation: tuple[float, float] | None = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(pop_size, **kwargs)
        self.crossover = crossover
        self.mutation = mutation

    def _engine(self, space: Space, rng: np.random.Generator) -> ArrayEngine:
        mutation = self.mutation or (min(0.5, 1.0 / len(space.low)), 20.0)
        return NSGA2Engine(space, self.pop_size, rng, self.crossover, mutation)


class ArrayGDE3(PymooEngine):
    """GDE3 on arrays: crossover rate CR and the range F of the scale factor."""

    def __init__(
        self, pop_size: int = 100, CR: float = 0.9, F: tuple[float, float] = (0.0, 1.0), **kwargs: Any
    ) -> None:
        super().__init__(pop_size, **kwargs)
        self.rate = CR
        self.scale = F

    def _engine(self, space: Space, rng: np.random.Generator) -> ArrayEngine:
        return GDE3Engine(space, self.pop_size, rng, self.rate, self.scale)
