"""NSGA-II: non-dominated sorting with crowding distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from .settings import Genetic

if TYPE_CHECKING:
    import numpy as np

    from ..problems.tolerance_problem import ToleranceProblem
    from .engine import ArrayEngine, Space


@dataclass(frozen=True, slots=True)
class NSGA2(Genetic):
    """NSGA-II for two or more objectives (Deb, Pratap, Agarwal & Meyarivan 2002)."""

    array_engine: ClassVar[bool] = True

    def build(self, problem: ToleranceProblem) -> Any:
        from pymoo.algorithms.moo.nsga2 import NSGA2 as PymooNSGA2
        from pymoo.operators.survival.rank_and_crowding import RankAndCrowding

        from .settings import operators

        return PymooNSGA2(
            pop_size=self.population, survival=RankAndCrowding(), **operators(problem, self.crossover, self.mutation)
        )

    def engine(self, space: Space, rng: np.random.Generator) -> ArrayEngine:
        from .engine import NSGA2Engine

        mating = (self.crossover.probability, self.crossover.eta)
        mutation = (self.mutation.probability, self.mutation.eta)
        return NSGA2Engine(space, self.population, rng, mating, mutation)
