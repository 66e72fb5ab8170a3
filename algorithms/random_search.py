"""Random search: the baseline of every algorithm."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from ..section import INDIVIDUALS
from .settings import AlgorithmSettings

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class RandomSearch(AlgorithmSettings):
    """Designs drawn uniformly from the search ranges; `population` per generation."""

    many_objectives: ClassVar[bool] = True
    population: int = field(default=100, metadata={"low": 1, "need": INDIVIDUALS})

    def build(self, problem: ToleranceProblem) -> Any:
        from pymoo.algorithms.soo.nonconvex.random_search import RandomSearch as PymooRandomSearch
        from pymoo.operators.sampling.rnd import FloatRandomSampling

        return PymooRandomSearch(n_points_per_iteration=self.population, sampling=FloatRandomSampling())
