"""The cheapest allocation that keeps a promise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...algorithms.exact.bounds import row_limits
from ...algorithms.exact.choices import Optimum, least_cost
from ...algorithms.exact.epsilon import SETS
from ...algorithms.exact.solver import Exact, closed_form
from ...algorithms.hybrid import Hybrid
from ...algorithms.search import search
from ...algorithms.settings import Budget
from ...problems.forms import Form
from ...problems.stack import Stack

Array = NDArray[np.float64]
Solved: TypeAlias = tuple[Form, Optimum]
"""The form of a stack, and its least cost."""
EVALUATIONS = 600
"""Of a search among many choices of processes."""


@dataclass(frozen=True, slots=True)
class Least:
    """A full design (all variables,) and its cost; NaN where none was found."""

    cost: float
    design: Array

    @classmethod
    def none(cls, stack: Stack) -> Least:
        """No design."""
        return cls(float("nan"), np.full(len(stack.variables), np.nan))


def cheapest(stack: Stack) -> Least:
    """The cheapest design of a stack whose only objective is the cost: exact where it can be.

    Many choices without a closed form are searched (an expected yield by sampled machines).
    """
    choices = float(np.prod([len(part.processes) for part in stack.definition.parts], dtype=float))
    if closed_form(stack) is None and choices > SETS:
        found = search(stack, Hybrid(), Budget(evaluations=EVALUATIONS), stack.settings.seed)
    else:
        found = search(stack, Exact(), Budget(), stack.settings.seed)
    if not len(found.f):
        return Least.none(stack)
    at = int(np.argmin(found.f[:, 0]))
    return Least(float(found.f[at, 0]), stack.complete(found.x[at : at + 1])[0])


def solved(stack: Stack) -> Solved | None:
    """The form of a stack and its least cost with multipliers; None without a closed form."""
    form = closed_form(stack)
    if form is None:
        return None
    found = least_cost(form, row_limits(stack, form)[None, :])
    return (form, found) if np.isfinite(found.cost[0]) else None
