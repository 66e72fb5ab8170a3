"""pymoo operators, built anew for every run, because its defaults are shared between algorithms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from pymoo.core.crossover import Crossover as PymooCrossover
from pymoo.core.mutation import Mutation as PymooMutation
from pymoo.core.repair import Repair
from pymoo.operators.crossover.pntx import SinglePointCrossover, TwoPointCrossover
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.crossover.ux import UniformCrossover
from pymoo.operators.mutation.gauss import GaussianMutation
from pymoo.operators.mutation.pm import PM
from pymoo.operators.sampling.rnd import FloatRandomSampling

from ..arrays import Array, Flags
from .settings import Crossover, Mutation

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem


class RoundIntegers(Repair):
    """Rounds the integer variables, leaves the others."""

    def __init__(self, integer: Flags) -> None:
        super().__init__()
        self.integer = integer

    def _do(self, problem: Any, X: Array, **kwargs: Any) -> Array:
        return np.where(self.integer, np.rint(X), X)


def repair(problem: ToleranceProblem) -> Repair:
    """A repair that rounds the integer variables of `problem`."""
    return RoundIntegers(np.array([v.integer for v in problem.free]))


def operators(problem: ToleranceProblem, crossover: Crossover, mutation: Mutation) -> dict[str, Any]:
    """Keyword arguments of a pymoo genetic algorithm.

    The duplicate check is off: it takes a fifth of a run and has no use for continuous tolerances.
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
