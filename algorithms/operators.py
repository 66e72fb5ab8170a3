"""pymoo operators, built freshly for every run: its defaults are shared between algorithms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.repair import Repair
from pymoo.operators.crossover.sbx import SBX
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


def operators(
    problem: ToleranceProblem, crossover: Crossover, mutation: Mutation
) -> dict[str, Any]:
    """Keyword arguments of a pymoo genetic algorithm.

    The duplicate check is off: it costs a fifth of a run and buys nothing on continuous tolerances.
    """
    return {
        "sampling": FloatRandomSampling(),
        "crossover": SBX(prob=crossover.probability, eta=crossover.eta),
        "mutation": PM(prob=1.0, prob_var=mutation.probability, eta=mutation.eta),
        "repair": repair(problem),
        "eliminate_duplicates": False,
    }
