"""From the archive of a search to the reported front."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...algorithms.archive import ROOM, lowest_ranks
from ...algorithms.indicators import nondominated
from ...algorithms.search import SearchResult
from ...arrays import Array
from ...problems.designs import designs_of
from ...problems.interfaces import Accuracy
from ...problems.tolerance_problem import ToleranceProblem

EXACT = "exact, least cost within the limits"
"""Label of the exact optimum among the references."""
FEW = 100
"""Designs recomputed at most where every design is tested on a sample of fresh units."""
MOST = 20_000
"""Designs recomputed at full accuracy at most."""


def reported_front(problem: ToleranceProblem, result: SearchResult) -> pd.DataFrame:
    """The non-dominated feasible points of the archive, every value at full accuracy.

    The search may have ranked by a coarser propagation, so the best ranks are recomputed and
    filtered again; only the remaining designs are verified. Sorted by the objectives; empty where
    no point is feasible.
    """
    candidates = result.chosen if len(result.chosen) else result.x[_candidates(problem, result)]
    whole, designs = Accuracy.of(problem).reported(), problem.complete(candidates)
    values = whole.outputs_of(designs, errors=False) if len(designs) else {}
    rows = _best(whole, designs, values) if len(designs) else np.arange(0)
    if not len(rows):
        return pd.DataFrame(columns=[*problem.names, *(o.name for o in problem.outputs)])
    frame = whole.frame(designs[rows], {name: column[rows] for name, column in values.items()})
    names = list(problem.objectives)
    frame = frame.drop(columns="feasible").sort_values(names, kind="stable")
    frame = frame.reset_index(drop=True)
    frame["knee"] = knee(frame[names].to_numpy())
    return frame


def _best(problem: ToleranceProblem, designs: Array, values: Mapping[str, Array]) -> NDArray[np.int64]:
    """Rows of the feasible designs that no other feasible one dominates."""
    finite = np.isfinite(problem.objective_values(values)).all(axis=1)
    rows = np.flatnonzero(finite & np.all(problem.violations(designs, values) <= 0.0, axis=1))
    return rows[nondominated(problem.objective_values(values)[rows])] if len(rows) else rows


def _candidates(problem: ToleranceProblem, result: SearchResult) -> NDArray[np.int64]:
    """Rows of the archive that may be on the front; more than the most are thinned evenly."""
    room, most = (FEW, FEW) if problem.declaration.sampled else (ROOM, MOST)
    rows = lowest_ranks(result.x, result.f, room)
    if len(rows) <= most:
        return rows
    order = rows[np.lexsort(result.f[rows].T[::-1])]
    return np.sort(order[np.linspace(0, len(order) - 1, most).astype(np.int64)])


def nearest_miss(problem: ToleranceProblem, result: SearchResult) -> pd.DataFrame:
    """The evaluated design with the least total violation, at full accuracy (one row or none)."""
    if not len(result.miss):
        return pd.DataFrame()
    return Accuracy.of(problem).reported().frame(problem.complete(result.miss))


def knee(values: Array) -> NDArray[np.bool_]:
    """Marks the point farthest below the chord between the ends of a two-objective front."""
    marked = np.zeros(len(values), dtype=bool)
    if values.shape[1] != 2 or len(values) < 3:
        return marked
    span = values.max(axis=0) - values.min(axis=0)
    scaled = (values - values.min(axis=0)) / np.where(span > 0.0, span, 1.0)
    marked[int(np.argmin(scaled.sum(axis=1)))] = True
    return marked


def middle_point(front: pd.DataFrame) -> pd.Series[Any]:
    """The point in the middle of a front by cost."""
    order = front["cost"].astype(float).argsort(kind="stable")
    return front.iloc[int(order.iloc[len(front) // 2])]


def labelled(fronts: Mapping[str, pd.DataFrame | None]) -> pd.DataFrame | None:
    """Fronts below each other, each with its label; None without any."""
    frames = [front.assign(label=label) for label, front in fronts.items() if front is not None]
    if not frames:
        return None
    joined = pd.concat(frames, ignore_index=True)
    return joined[["label", *(name for name in joined if name != "label")]]


def with_references(
    front: pd.DataFrame, references: pd.DataFrame, problem: ToleranceProblem
) -> tuple[pd.DataFrame, int, int]:
    """The front joined with the references within reach, without the points that they dominate.

    A reference can join where it meets all limits and lies in the search space; the exact optimum
    does not take the place of the one point of a single-objective run. Returns the front, the
    number of points removed and the number of references joined.
    """
    if problem.n_obj == 1 and len(references):
        references = references[references["label"] != EXACT]
    if not len(references):
        return front, 0, 0
    names = list(problem.objectives)
    eligible = references[references["feasible"].astype(bool) & inside(references, problem)]
    eligible = eligible.drop(columns=["label", "feasible", "violated_limits"], errors="ignore")
    eligible = eligible.assign(knee=False)
    merged = pd.concat([front, eligible]) if len(front) else eligible
    remaining = nondominated(merged[names].to_numpy())
    joined = int(remaining[len(front) :].sum())
    merged = merged[remaining].sort_values(names, kind="stable").reset_index(drop=True)
    whole = {v.name: "int64" for v in problem.variables if v.integer and not v.labels}
    merged = merged.astype(whole)
    merged["knee"] = knee(merged[names].to_numpy())
    return merged, len(front) - int(remaining[: len(front)].sum()), joined


def inside(references: pd.DataFrame, problem: ToleranceProblem) -> NDArray[np.bool_]:
    """Which rows lie in the search ranges and have the fixed values."""
    bounds = {v.name: (problem.xl[i], problem.xu[i]) for i, v in enumerate(problem.free)}
    bounds |= {name: (value, value) for name, value in problem.fixed.items()}
    designs = designs_of(problem, references)
    low, high = np.array([bounds[name] for name in problem.names]).T
    return np.asarray(np.all((designs >= low) & (designs <= high), axis=1))
