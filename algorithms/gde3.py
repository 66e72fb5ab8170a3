"""GDE3: differential evolution for several objectives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from ..section import INDIVIDUALS
from .settings import AlgorithmSettings

if TYPE_CHECKING:
    import numpy as np

    from ..problems.tolerance_problem import ToleranceProblem
    from .engine import ArrayEngine, Space


@dataclass(frozen=True, slots=True)
class Binomial:
    """Binomial crossover: probability CR per variable of coming from the donor."""

    probability: float = field(default=0.9, metadata={"low": 0.0, "high": 1.0})


@dataclass(frozen=True, slots=True)
class Differential:
    """Differential mutation: the scale factor F is drawn from [low, high] for every trial point."""

    low: float = field(default=0.0, metadata={"low": 0.0, "high": 2.0})
    high: float = field(default=1.0, metadata={"low": 0.0, "high": 2.0})


@dataclass(frozen=True, slots=True)
class GDE3(AlgorithmSettings):
    """GDE3 for two or more objectives (Kukkonen & Lampinen 2005), DE/rand/1/bin."""

    many_objectives: ClassVar[bool] = True
    array_engine: ClassVar[bool] = True
    population: int = field(default=100, metadata={"low": 4, "need": INDIVIDUALS})
    crossover: Binomial = Binomial()
    mutation: Differential = Differential()
    polish: bool = False

    def build(self, problem: ToleranceProblem) -> Any:
        from pymoo.algorithms.moo.gde3 import GDE3 as PymooGDE3
        from pymoo.operators.sampling.rnd import FloatRandomSampling
        from pymoo.operators.survival.rank_and_crowding import RankAndCrowding

        from .settings import repair

        algorithm = PymooGDE3(
            pop_size=self.population,
            CR=self.crossover.probability,
            F=(self.mutation.low, self.mutation.high),
            sampling=FloatRandomSampling(),
            survival=RankAndCrowding(),
            repair=repair(problem),
        )
        algorithm.mating.repair = repair(problem)  # pymoo passes the repair to the sampling alone
        return algorithm

    def engine(self, space: Space, rng: np.random.Generator) -> ArrayEngine:
        from .engine import GDE3Engine

        scale = (self.mutation.low, self.mutation.high)
        return GDE3Engine(space, self.population, rng, self.crossover.probability, scale)
