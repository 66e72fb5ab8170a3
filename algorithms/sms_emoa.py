"""SMS-EMOA: survival by the contribution to the hypervolume."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from ..counts import INDIVIDUALS
from .settings import AlgorithmSettings, Crossover, Mutation

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class SMSEMOA(AlgorithmSettings):
    """SMS-EMOA for two or three objectives (Beume, Naujoks & Emmerich 2007).

    A generation has as many offspring as the population; the paper's has one. More objectives are
    taken, but the hypervolume is expensive there.
    """

    many_objectives: ClassVar[bool] = True
    population: int = field(default=100, metadata={"low": 2, "need": INDIVIDUALS})
    crossover: Crossover = Crossover()
    mutation: Mutation = Mutation()
    polish: bool = False

    def build(self, problem: ToleranceProblem) -> Any:
        from pymoo.algorithms.moo.sms import SMSEMOA as PymooSMSEMOA
        from pymoo.algorithms.moo.sms import LeastHypervolumeContributionSurvival, cv_and_dom_tournament
        from pymoo.operators.selection.tournament import TournamentSelection

        from .operators import operators

        return PymooSMSEMOA(
            pop_size=self.population,
            selection=TournamentSelection(func_comp=cv_and_dom_tournament),
            survival=LeastHypervolumeContributionSurvival(),
            **operators(problem, self.crossover, self.mutation),
        )
