"""The reference of the runs of one problem; computed once per problem of a study."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, nan

import numpy as np

from ...algorithms.course import Box
from ...algorithms.exact.bounds import proof
from ...errors import ModelError
from ...problems.tolerance_problem import ToleranceProblem

SHARE = 0.99
"""Fraction of the exact hypervolume, and 1 less the relative gap of one objective, that
`..._to_99` waits for."""


@dataclass(frozen=True, slots=True)
class Yardstick:
    """Box of the hypervolume, the exact `value`, and a proven bound of the cost.

    `value` is the exact optimum of one objective, the hypervolume of the exact front of two, NaN
    where neither is known. `bound` is that of one objective, NaN where nothing is proven.
    """

    box: Box
    value: float
    bound: float

    @property
    def level(self) -> float:
        """The value of a curve at which 99 % are reached."""
        if len(self.box.ideal) > 1:
            return SHARE * self.value
        return self.value + (1.0 - SHARE) * abs(self.value)


def box_alone(problem: ToleranceProblem) -> Yardstick:
    """The box alone, with which runs can begin."""
    ideal, nadir = (tuple(float(v) for v in end) for end in problem.box())
    return Yardstick(Box(ideal, nadir), nan, nan)


def yardstick(problem: ToleranceProblem) -> Yardstick:
    """The yardstick of a problem (some seconds where the exact front takes programmes)."""
    from ..run.proofs import exact_front  # with it come the libraries of the page, slow to load

    exact, value, bound = exact_front(problem), nan, nan
    if exact is not None and problem.n_obj > 1:
        value = exact.hypervolume
    elif exact is not None:
        value = float(problem.objective_values(problem.outputs_of(exact.designs[:1], searching=True))[0, 0])
    if problem.n_obj == 1:
        bound = _bound(problem)
    return replace(box_alone(problem), value=value, bound=bound)


def _bound(problem: ToleranceProblem) -> float:
    """The lower bound of a single objective's cost, which does not depend on the design."""
    try:
        return float(proof(problem, {problem.objectives[0]: np.array([inf])}, 1).bound[0])
    except ModelError:
        return nan
