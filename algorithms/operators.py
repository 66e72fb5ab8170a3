"""pymoo operators, built freshly for every run: its defaults are shared between algorithms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.crossover import Crossover as PymooCrossover
from pymoo.core.mutation import Mutation as PymooMutation
from pymoo.core.repair import Repair
from pymoo.operators.crossover.pntx import SinglePointCrossover, TwoPointCrossover
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.crossover.ux import UniformCrossover
from pymoo.operators.mutation.gauss import GaussianMutation
from pymoo.operators.mutation.pm import PM
from pymoo.operators.sampling.rnd import FloatRandomSampling

from .settings import Crossover, Mutation

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem


class RoundIntegers(Repair):
    """Rounds the integer variables, leaves the others."""

    def __init__(self, integer: NDArray[np.bool_]) -> None:
        super().__init__()
        self.integer = integer

    def _do(self, problem: Any, X: NDArray[np.float64], **kwargs: Any) -> NDArray[np.float64]:
        return np.where(self.integer, np.rint(X), X)


def repair(problem: ToleranceProblem) -> Repair:
    """Rounds what is a whole number in `problem`."""
    return RoundIntegers(np.array([v.integer for v in problem.free]))


def operators(problem: ToleranceProblem, crossover: Crossover, mutation: Mutation) -> dict[str, Any]:
    """Keyword arguments of a pymoo genetic algorithm.

    The duplicate check is off: it costs a fifth of a run and buys nothing on continuous tolerances.
    """
    return {
        "sampling": FloatRandomSampling(),
        "crossover": _crossover(crossover),
        "mutation": _mutation(mutation),
        "repair": repair(problem),
        "eliminate_duplicates": False,
    }


def _crossover(settings: Crossover) -> PymooCrossover:
    if settings.operator == "sbx":
        return SBX(prob=settings.probability, eta=settings.eta)
    kinds = {"uniform": UniformCrossover, "one_point": SinglePointCrossover, "two_point": TwoPointCrossover}
    return kinds[settings.operator](prob=settings.probability)


def _mutation(settings: Mutation) -> PymooMutation:
    if settings.operator == "gaussian":
        return GaussianMutation(prob=1.0, prob_var=settings.probability)
    return PM(prob=1.0, prob_var=settings.probability, eta=settings.eta)
