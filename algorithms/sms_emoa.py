"""SMS-EMOA: survival by the contribution to the hypervolume."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .settings import Genetic

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class SMSEMOA(Genetic):
    """SMS-EMOA for two or three objectives (Beume, Naujoks & Emmerich 2007).

    A generation has as many offspring as the population, in the paper only one. More objectives are
    accepted, but their hypervolume is expensive.
    """

    def build(self, problem: ToleranceProblem) -> Any:
        from pymoo.algorithms.moo.sms import SMSEMOA as PymooSMSEMOA
        from pymoo.algorithms.moo.sms import LeastHypervolumeContributionSurvival, cv_and_dom_tournament
        from pymoo.operators.selection.tournament import TournamentSelection

        from .settings import operators

        return PymooSMSEMOA(
            pop_size=self.population,
            selection=TournamentSelection(func_comp=cv_and_dom_tournament),
            survival=LeastHypervolumeContributionSurvival(),
            **operators(problem, self.crossover, self.mutation),
        )
