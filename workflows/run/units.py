"""What backlash means in a run, shown on the units of one of its points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from ...problems.designs import designs_of
from ...problems.interfaces import Comparison, Page
from ...problems.tolerance_problem import ToleranceProblem
from ...records import RunResult

SHOWN = ("cost", "yield_percent", "interference_probability")
"""Outputs of the shown point that the page repeats, in addition to the one that is limited."""

NEAR = 0.1
"""Fraction of the limit by which a point may miss it to be shown in place of the knee."""


def with_units(result: RunResult, problem: ToleranceProblem) -> RunResult:
    """The result with the limits of validity, and one unit and the population of its shown point.

    Unchanged for problems without them.
    """
    validity = Page.of(problem).validity()
    if validity:
        result = replace(result, summary={**result.summary, "validity": list(validity)})
    comparison = Comparison.of(problem)
    chosen = shown_point(result.front, comparison)
    if chosen is None:
        return result
    row, reason = chosen
    shown = comparison.shown_units(designs_of(problem, result.front.iloc[[row]])[0])
    limit = comparison.shown_limit()
    if shown is None or limit is None:
        return result
    point = result.front.iloc[row]
    units = {
        "point": row,
        "chosen": reason,
        "words": list(shown.words),
        "limit": limit[1],
        "quantile": float(point[limit[0]]),
        "coverage_percent": 100.0 * problem.settings.propagation.coverage,
        **{name: float(point[name]) for name in SHOWN if name in point},
    }
    return replace(
        result, summary={**result.summary, "units": units}, unit_turn=shown.turn, population=shown.population
    )


def shown_point(front: pd.DataFrame, comparison: Comparison) -> tuple[int, str] | None:
    """Row of the point whose units are shown, and by what it was chosen; None without any.

    The point nearest to the problem's limit; where none is `NEAR`, the knee.
    """
    limit = comparison.shown_limit()
    if limit is None or front.empty or limit[0] not in front:
        return None
    name, most = limit
    distance = np.abs(front[name].to_numpy(dtype=float) / most - 1.0)
    if distance.min() > NEAR and "knee" in front and front["knee"].any():
        return int(np.argmax(front["knee"].to_numpy(dtype=bool))), "the knee"
    return int(np.argmin(distance)), f"the point nearest to {name} {most:g}"
