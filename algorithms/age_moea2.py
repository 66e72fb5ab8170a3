"""AGE-MOEA-II: survival by distances on the estimated shape of the front."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..section import PAIRED
from .settings import Genetic

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class AGEMOEA2(Genetic):
    """AGE-MOEA-II for two or more objectives (Panichella 2022)."""

    population: int = field(default=100, metadata={"low": 2, "need": PAIRED})

    def build(self, problem: ToleranceProblem) -> Any:
        from pymoo.algorithms.moo.age2 import AGEMOEA2 as PymooAGEMOEA2
        from pymoo.algorithms.moo.nsga2 import binary_tournament
        from pymoo.operators.selection.tournament import TournamentSelection

        from .settings import operators

        return PymooAGEMOEA2(
            pop_size=self.population,
            selection=TournamentSelection(func_comp=binary_tournament),
            **operators(problem, self.crossover, self.mutation),
        )
