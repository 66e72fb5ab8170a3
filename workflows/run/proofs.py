"""What is proven about a front: bounds of its points, and the exact front beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from ...algorithms.exact.bounds import proof
from ...algorithms.exact.solver import closed_form, exact_vectors
from ...algorithms.indicators import hypervolume
from ...algorithms.search import SearchResult
from ...problems.tolerance_problem import ToleranceProblem

POINTS = 4000
"""Points of the exact front that a hypervolume is measured by."""
CHECKED = 50
"""Points of the exact front whose bounds are looked at."""
CLOSED = 1e-7
"""Relative gap up to which a front counts as exact."""


@dataclass(frozen=True, slots=True)
class Exact:
    """The exact front of a problem: designs (k, all variables) and its hypervolume."""

    designs: np.ndarray
    hypervolume: float


def with_bounds(frame: pd.DataFrame, problem: ToleranceProblem) -> tuple[pd.DataFrame, str]:
    """The frame with `bound` and `gap_percent`, and what they are proven for.

    Rows that are marked as not feasible keep them empty.
    """
    frame = frame.assign(bound=np.nan, gap_percent=np.nan)
    frame = frame[[name for name in frame if name != "knee"] + ["knee"] * ("knee" in frame)]
    kept = frame[frame["feasible"].astype(bool)] if "feasible" in frame else frame
    values = {name: kept[name].to_numpy(dtype=float) for name in problem.objectives}
    found = proof(problem, values, len(kept))
    if len(kept) and "cost" in values:
        frame.loc[kept.index, "bound"] = found.bound
        frame.loc[kept.index, "gap_percent"] = found.gap_percent(values["cost"])
    return frame, found.statement


def exact_front(problem: ToleranceProblem) -> Exact | None:
    """The exact front, None where there is no closed form or a gap is left in its proof."""
    form = closed_form(problem)
    if form is None or not form.exact:
        return None
    designs = problem.complete(exact_vectors(problem, form, POINTS))
    if not len(designs):
        return None
    values = problem.objective_values(problem.outputs_of(designs, searching=True))
    some = np.unique(np.linspace(0, len(values) - 1, CHECKED).astype(int))
    columns = dict(zip(problem.objectives, values[some].T, strict=True))
    gaps = proof(problem, columns, len(some)).gap_percent(columns["cost"])
    if not np.all(gaps <= 100.0 * CLOSED):
        return None
    return Exact(designs, hypervolume(values, *problem.box()))


def measures(
    found: SearchResult, front: pd.DataFrame, statement: str, exact: Exact | None
) -> dict[str, object]:
    """What the summary says of quality: hypervolume, its ratio to the exact one, gaps, the form."""
    last = found.history[-1].hypervolume if found.history else None
    gap = front["gap_percent"].to_numpy(dtype=float)
    proven = bool(len(gap)) and not np.all(np.isnan(gap))
    return {
        "hypervolume": last,
        "hypervolume_ratio": last / exact.hypervolume if exact and last is not None else None,
        "bound_form": statement,
        "gap_percent_median": float(np.nanmedian(gap)) if proven else None,
        "gap_percent_max": float(np.nanmax(gap)) if proven else None,
    }


def proof_notes(front: pd.DataFrame, statement: str) -> list[str]:
    """What the page and the terminal say of the proof."""
    gap = front["gap_percent"].to_numpy(dtype=float)
    if not len(gap) or np.all(np.isnan(gap)):
        return [statement] if len(gap) else []
    return [f"proven: no allocation of equal or better other objectives costs less than the bound "
            f"({statement}); the points lie {np.nanmedian(gap):.3g} % above it in the median, "
            f"{np.nanmax(gap):.3g} % at most"]  # fmt: skip
