"""What came out of a search, in truth, and the word beside a figure that is promised."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tolevo.problems.tolerance_problem import ToleranceProblem

Array = NDArray[np.float64]


def verdict(kept: bool | None) -> str:
    """Whether a promise is kept; empty where nothing is promised (None)."""
    return "" if kept is None else "met" if kept else "MISSED"


def kept_values(problem: ToleranceProblem, x: Array) -> dict[str, Array]:
    """Outputs (n,) of the search vectors that keep all limits, at the accuracy of a report."""
    designs = problem.complete(x)
    out = problem.outputs_of(designs, errors=False)
    kept = np.all(problem.violations(designs, out) <= 0.0, axis=1)
    return {name: values[kept] for name, values in out.items()}
