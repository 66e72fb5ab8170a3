"""The genetic algorithm for one objective, as the documents use it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from .settings import Genetic

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class GA(Genetic):
    """Genetic algorithm for one objective: tournament selection, SBX, polynomial mutation."""

    many_objectives: ClassVar[bool] = False

    def build(self, problem: ToleranceProblem) -> Any:
        from pymoo.algorithms.soo.nonconvex.ga import GA as PymooGA

        from .settings import operators

        return PymooGA(pop_size=self.population, **operators(problem, self.crossover, self.mutation))
