"""Derivatives of outputs by tolerances, from the model or by differences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...declarations import Kind, Variable
from ...problems.interfaces import Differentiable
from ...problems.tolerance_problem import ToleranceProblem
from .rule import COST

STEP = 1e-3
"""Relative step of a tolerance where an output has no derivative."""
MOST = 1000
"""Points with derivatives at most, evenly spaced along the front."""
PER_GRADE = 0.5 * np.log(2.0)
"""Relative width of a tolerance per grade: sqrt 2."""


def tolerances_of(problem: ToleranceProblem) -> list[Variable]:
    """Every tolerance, the fixed ones included."""
    return [variable for variable in problem.variables if variable.tolerance]


@dataclass(frozen=True, slots=True, eq=False)
class Slopes:
    """Derivatives at some points of a front.

    `rows` (n,) are the points, `designs` (n, all variables) theirs. `along` has t dy/dt (n,
    tolerances) by requirement y, `source` the output whose derivative it is, and `saved`
    -t dC/dt (n, tolerances) of the cost C.
    """

    rows: NDArray[np.int64]
    designs: Array
    along: Mapping[str, Array]
    source: Mapping[str, str]
    saved: Array


def slopes_of(problem: ToleranceProblem, designs: Array) -> Slopes:
    """The derivatives of the objectives but the cost, and of the limited outputs that have one.

    At most `MOST` designs, evenly spaced. Where an objective has no derivative, that of the output
    that explains it is taken, or a difference.
    """
    rows = np.unique(np.linspace(0, len(designs) - 1, MOST).astype(np.int64))
    selected, tolerances = designs[rows], tolerances_of(problem)
    known = Differentiable.of(problem).gradient(selected)
    names = [name for name in problem.objectives if name != COST]
    limited = [limit.name for limit in problem.limits if limit.count and limit.name != COST]
    names += [name for name in limited if name in known and name not in names]
    at = [problem.names.index(v.name) for v in tolerances]
    wide = np.stack([widths(problem, selected, v) for v in tolerances], axis=1) if tolerances else selected[:, :0]
    along, source = {}, {}
    for name in names:
        source[name] = name if name in known else problem.declaration.explained.get(name, name)
        slopes = known.get(source[name])
        if slopes is None:
            slopes = _differences(problem, selected, source[name], tolerances)
        along[name] = wide * slopes[:, at]
    cost = known[COST] if COST in known else Differentiable.of(problem).cost_slopes(selected)
    with np.errstate(invalid="ignore"):
        saved = -wide * cost[:, at]
    return Slopes(rows, selected, along, source, saved)


def widths(problem: ToleranceProblem, designs: Array, variable: Variable) -> Array:
    """t of t dy/dt (n,); for a grade, the factor of dy/dgrade."""
    if variable.kind is Kind.GRADE:
        return np.full(len(designs), 1.0 / PER_GRADE)
    return problem.column(designs, variable.name)


def _differences(problem: ToleranceProblem, designs: Array, output: str, tolerances: list[Variable]) -> Array:
    """Derivatives (n, all variables) by one-sided differences of the output in a search."""
    base = problem.outputs_of(designs, searching=True)[output]
    derivatives = np.zeros_like(designs)
    for variable in tolerances:
        at, moved = problem.names.index(variable.name), designs.copy()
        step = STEP * widths(problem, designs, variable)
        if not np.any(step):
            continue
        moved[:, at] += step
        change = problem.outputs_of(moved, searching=True)[output] - base
        derivatives[:, at] = np.divide(change, step, out=np.zeros_like(step), where=step != 0.0)
    return derivatives
