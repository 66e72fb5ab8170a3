"""Single-objective genetic algorithm, as the documents use it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from ..counts import INDIVIDUALS
from .settings import AlgorithmSettings, Crossover, Mutation

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class GA(AlgorithmSettings):
    """Genetic algorithm for one objective: tournament selection, SBX, polynomial mutation."""

    many_objectives: ClassVar[bool] = False
    population: int = field(default=100, metadata={"low": 2, "need": INDIVIDUALS})
    crossover: Crossover = Crossover()
    mutation: Mutation = Mutation()
    polish: bool = False

    def build(self, problem: ToleranceProblem) -> Any:
        from pymoo.algorithms.soo.nonconvex.ga import GA as PymooGA

        from .operators import operators

        return PymooGA(pop_size=self.population, **operators(problem, self.crossover, self.mutation))
