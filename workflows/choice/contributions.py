"""Which tolerance matters how much at a point: shares of an objective in percent."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...declarations import Kind, Variable
from ...problems.tolerance_problem import ToleranceProblem

Array = NDArray[np.float64]
STEP = 1e-3
"""Relative step of a tolerance where an output has no derivative."""
MOST = 1000
"""Points with contributions at most, evenly spaced along the front."""
PER_GRADE = 0.5 * np.log(2.0)
"""Relative width of a tolerance per grade: sqrt 2."""


def contributions(problem: ToleranceProblem, designs: Array) -> pd.DataFrame:
    """Share [%] of every free tolerance in every objective but the cost, of designs (n, all).

    The share is t dy/dt over the sum of its magnitudes: of a root sum of squares exactly the share
    of the variance. One row per point and output: `point`, `output`, `explained` (the output
    whose derivative is taken, where the objective has none), and a column per tolerance. The sign
    stays: wider may be better.
    """
    free = [v for v in problem.free if v.tolerance]
    names = [name for name in problem.objectives if name != "cost"]
    if not free or not names or not len(designs):
        return pd.DataFrame()
    rows = np.unique(np.linspace(0, len(designs) - 1, MOST).astype(int))
    known = problem.gradient(designs[rows])
    frames = []
    for name in names:
        source = name if name in known else problem.explained.get(name, name)
        slopes = known.get(source)
        slopes = _differences(problem, designs[rows], source, free) if slopes is None else slopes
        shares = _shares(problem, designs[rows], slopes, free)
        frame = pd.DataFrame(shares, columns=[v.name for v in free])
        frame.insert(0, "point", rows)
        frame.insert(1, "output", name)
        frame.insert(2, "explained", source)
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def _widths(problem: ToleranceProblem, designs: Array, variable: Variable) -> Array:
    """t of t dy/dt (n,); of a grade, what it is multiplied with is dy/dgrade."""
    if variable.kind is Kind.GRADE:
        return np.full(len(designs), 1.0 / PER_GRADE)
    return problem.column(designs, variable.name)


def _shares(
    problem: ToleranceProblem, designs: Array, slopes: Array, free: list[Variable]
) -> Array:
    each = np.stack(
        [_widths(problem, designs, v) * slopes[:, problem.names.index(v.name)] for v in free],
        axis=1,
    )
    whole = np.abs(each).sum(axis=1, keepdims=True)
    shares = np.divide(each, whole, out=np.zeros_like(each), where=whole > 0.0)
    return np.asarray(100.0 * shares)


def _differences(
    problem: ToleranceProblem, designs: Array, output: str, free: list[Variable]
) -> Array:
    """Derivatives (n, all variables) by one-sided differences, as a search sees the output."""
    base = problem.outputs_of(designs, searching=True)[output]
    found = np.zeros_like(designs)
    for variable in free:
        at, moved = problem.names.index(variable.name), designs.copy()
        step = STEP * _widths(problem, designs, variable)
        moved[:, at] += step
        found[:, at] = (problem.outputs_of(moved, searching=True)[output] - base) / step
    return found
