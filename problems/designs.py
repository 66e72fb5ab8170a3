"""Full designs of a problem as tables hold them: whole numbers as such, choices by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..arrays import Array

if TYPE_CHECKING:
    from .tolerance_problem import ToleranceProblem


def designs_frame(problem: ToleranceProblem, designs: Array) -> pd.DataFrame:
    """Full designs (n, all variables) as a table holds them, a column per variable."""
    columns: dict[str, Any] = {}
    for variable in problem.variables:
        values = problem.column(designs, variable.name)
        columns[variable.name] = values.astype(np.int64) if variable.integer else values
        if variable.labels:
            columns[variable.name] = np.array(variable.labels, dtype=object)[values.astype(int)]
    return pd.DataFrame(columns)


def designs_of(problem: ToleranceProblem, frame: pd.DataFrame) -> Array:
    """Full designs (n, all variables) of a table as `ToleranceProblem.frame` makes it."""
    columns = [
        frame[variable.name].map({label: at for at, label in enumerate(variable.labels)})
        if variable.labels
        else frame[variable.name]
        for variable in problem.variables
    ]
    return np.asarray(np.stack(columns, axis=1), dtype=float)
