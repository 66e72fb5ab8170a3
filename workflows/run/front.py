"""From the archive of a search to the reported front."""

from __future__ import annotations

import moocore
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...algorithms.indicators import nondominated
from ...algorithms.search import SearchResult
from ...problems.tolerance_problem import ToleranceProblem

Array = NDArray[np.float64]
CANDIDATES = 1000
"""Archive points recomputed at full accuracy: those of the lowest non-domination ranks."""


def reported_front(problem: ToleranceProblem, found: SearchResult) -> pd.DataFrame:
    """The non-dominated feasible points of the archive, every value at full accuracy.

    The search may have ranked by a coarser propagation, so the best ranks are recomputed and
    filtered anew. Sorted by the objectives; empty where no point is feasible.
    """
    chosen = _candidates(found)
    if not len(chosen):
        return pd.DataFrame(columns=[*problem.names, *(o.name for o in problem.outputs)])
    frame = problem.reported().frame(problem.complete(found.x[chosen]))
    frame = frame[frame.pop("feasible").to_numpy(dtype=bool)]
    frame = frame[nondominated(frame[list(problem.objectives)].to_numpy())]
    frame = frame.sort_values(list(problem.objectives), kind="stable").reset_index(drop=True)
    frame["bound"], frame["gap_percent"] = np.nan, np.nan
    frame["knee"] = knee(frame[list(problem.objectives)].to_numpy())
    return frame


def _candidates(found: SearchResult) -> NDArray[np.int64]:
    feasible = np.flatnonzero(np.all(found.g <= 0.0, axis=1))
    _, first = np.unique(found.x[feasible], axis=0, return_index=True)
    feasible = feasible[np.sort(first)]
    if len(feasible) <= CANDIDATES:
        return feasible
    values = found.f[feasible]
    rank = values[:, 0] if values.shape[1] == 1 else moocore.pareto_rank(values)
    return np.sort(feasible[np.argsort(rank, kind="stable")[:CANDIDATES]])


def nearest_miss(problem: ToleranceProblem, found: SearchResult) -> pd.DataFrame:
    """The evaluated design with the least total violation, at full accuracy (one row or none)."""
    if not len(found.x):
        return pd.DataFrame()
    violation = np.sum(np.maximum(found.g, 0.0), axis=1)
    best = int(np.argmin(violation))
    return problem.reported().frame(problem.complete(found.x[best : best + 1]))


def knee(values: Array) -> NDArray[np.bool_]:
    """Marks the point farthest below the chord between the ends of a two-objective front."""
    marked = np.zeros(len(values), dtype=bool)
    if values.shape[1] != 2 or len(values) < 3:
        return marked
    span = values.max(axis=0) - values.min(axis=0)
    scaled = (values - values.min(axis=0)) / np.where(span > 0.0, span, 1.0)
    marked[int(np.argmin(scaled.sum(axis=1)))] = True
    return marked


def drop_dominated(
    front: pd.DataFrame, references: pd.DataFrame, objectives: tuple[str, ...]
) -> tuple[pd.DataFrame, int]:
    """The front without points that a reference meeting all limits dominates, and their number."""
    if not len(references) or not len(front):
        return front, 0
    names = list(objectives)
    values, others = front[names].to_numpy(), references[references["feasible"]][names].to_numpy()
    better = np.all(others[None] <= values[:, None], axis=2)
    better &= np.any(others[None] < values[:, None], axis=2)
    kept = front[~np.any(better, axis=1)].reset_index(drop=True)
    kept["knee"] = knee(kept[names].to_numpy())
    return kept, len(front) - len(kept)
