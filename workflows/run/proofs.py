"""What is proven about a front: the bounds of its points, and the exact front."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...algorithms.exact.between import least_bounds
from ...algorithms.exact.bounds import Proof, proof, row_limits
from ...algorithms.exact.solver import Exact as ExactSettings
from ...algorithms.exact.solver import closed_form, exact_vectors
from ...algorithms.indicators import hypervolume
from ...algorithms.search import SearchResult
from ...errors import ModelError
from ...problems.interfaces import Provable
from ...problems.least import least_value
from ...problems.tolerance_problem import ToleranceProblem
from .plan import RunPlan

POINTS = 4000
"""Points of the exact front that a hypervolume is measured by."""
SOLVED = 256
"""Points that are solved where each needs its own programme; the others lie between them."""
DRAWN = 400
"""Points of the exact front that are drawn."""
CHECKED = 50
"""Points of the exact front whose bounds are checked."""
EXACT = 1e-3
"""Gap [percent] below which a point counts as optimal."""
INFORMATIVE = 25.0
"""Median gap [percent] beyond which a bound that leaves limits out is not informative."""
CLOSED = 1e-7
"""Relative gap up to which a front counts as exact."""


@dataclass(frozen=True, slots=True)
class Exact:
    """The exact front of a problem: designs (k, all variables) and its hypervolume."""

    designs: np.ndarray
    hypervolume: float


def informative(problem: ToleranceProblem, proven: Proof, gap_percent: NDArray[np.float64]) -> bool:
    """Whether bounds say something of points (n,) that lie so far above them: where limits are
    left out, the points may be held back by those alone. Where that are all limits of a least cost,
    the bound is the cost of the loosest tolerances, and says nothing.
    """
    limits = {limit.name for limit in problem.limits if limit.count}
    if problem.n_obj == 1 and limits and limits <= set(proven.omitted_limits):
        return False
    return not proven.omitted_limits or bool(np.nanmedian(gap_percent) <= INFORMATIVE)


def with_bounds(
    frame: pd.DataFrame, problem: ToleranceProblem, within: NDArray[np.bool_] | None = None
) -> tuple[pd.DataFrame, Proof]:
    """The frame with `bound` and `gap_percent`, and the proof of its feasible points.

    Both are NaN in rows that are marked as not feasible, or that are not `within` the search space
    (n,). Where a point disproves its bound all are NaN and the statement says so.
    """
    frame = frame.assign(bound=np.nan, gap_percent=np.nan)
    frame = frame[[name for name in frame if name != "knee"] + ["knee"] * ("knee" in frame)]
    eligible = frame[frame["feasible"].astype(bool)] if "feasible" in frame else frame
    eligible = eligible if within is None else eligible[within[frame.index.isin(eligible.index)]]
    form = Provable.of(problem).form()
    rows = () if form is None else tuple(name for name in form.stands if name in eligible)
    names = dict.fromkeys((*problem.objectives, *rows))
    values = {name: eligible[name].to_numpy(dtype=float) for name in names}
    try:
        bounds = proof(problem, values, len(eligible))
    except ModelError as error:
        return frame, Proof.without(len(frame), f"{error}; please report it")
    if len(eligible) and "cost" in values:
        frame.loc[eligible.index, "bound"] = bounds.bound
        frame.loc[eligible.index, "gap_percent"] = bounds.gap_percent(values["cost"])
    return frame, bounds


def solved_front(plan: RunPlan, result: SearchResult) -> np.ndarray | None:
    """Search vectors (k, variables) of the exact front, where the run itself has solved it whole.

    None where it has fewer points than are solved for otherwise.
    """
    solved = isinstance(plan.algorithm, ExactSettings) and plan.problem.n_obj == 2
    x = result.chosen if len(result.chosen) else result.x
    return x if solved and len(x) >= SOLVED else None


def exact_front(problem: ToleranceProblem, known: np.ndarray | None = None) -> Exact | None:
    """The exact front of one or two objectives, through its `known` points where there are some.

    None where there is no closed form or its proof has a gap. No number of points shows the
    hypervolume of more objectives well enough to measure by.
    """
    form = closed_form(problem)
    if form is None or not form.exact or problem.n_obj > 2:
        return None
    alone = len(form.outputs) == 1 and form.correlation is None and known is None
    x = exact_vectors(problem, form, POINTS if alone else SOLVED) if known is None else known
    if not len(x):
        return None
    selected = np.unique(np.linspace(0, len(x) - 1, CHECKED).astype(int))
    if form.tested and np.any(problem.tested(x)[1] > 0.0):
        return None
    values = _objectives(problem, x[selected])
    columns = dict(zip(problem.objectives, values.T, strict=True))
    bounds = proof(problem, columns, len(selected))
    if not np.all(columns["cost"] - bounds.bound <= CLOSED * np.abs(columns["cost"])):
        return None
    if not alone:
        x = _between(problem, x)
    return Exact(problem.complete(x), hypervolume(_objectives(problem, x), *problem.box()))


def exact_table(problem: ToleranceProblem, exact: Exact | None) -> pd.DataFrame | None:
    """Objectives of at most `DRAWN` points of the exact front; None where it is not known."""
    if exact is None or problem.n_obj < 2:
        return None
    selected = np.unique(np.linspace(0, len(exact.designs) - 1, DRAWN).astype(int))
    values = problem.objective_values(problem.outputs_of(exact.designs[selected], searching=True))
    table = pd.DataFrame(values, columns=list(problem.objectives))
    return table.sort_values(list(problem.objectives), kind="stable", ignore_index=True)


def _objectives(problem: ToleranceProblem, x: np.ndarray) -> np.ndarray:
    """Objectives (k, objectives) of search vectors (k, variables)."""
    return problem.objective_values(problem.outputs_of(problem.complete(x), searching=True))


def _between(problem: ToleranceProblem, x: np.ndarray) -> np.ndarray:
    """Search vectors of a front and points between those that differ in no integer.

    Cost and requirements are convex there, so that the points lie on or below the chords.
    """
    if len(x) < 2:
        return x
    x = x[np.argsort(_objectives(problem, x)[:, 0], kind="stable")]
    integer = np.array([v.integer for v in problem.free])
    same = np.all(x[1:, integer] == x[:-1, integer], axis=1)
    intervals = max(1, POINTS // max(len(x), SOLVED))
    fraction = np.arange(1, intervals)[:, None, None] / intervals
    inner = x[:-1][same] + fraction * np.diff(x, axis=0)[same]
    return np.asarray(np.vstack([x, inner.reshape(-1, x.shape[1])]))


def measures(result: SearchResult, front: pd.DataFrame, proven: Proof, exact: Exact | None) -> dict[str, object]:
    """Quality for the summary: hypervolume, its ratio to the exact one, gaps, the form."""
    last = result.history[-1].hypervolume if result.history else None
    gap = front["gap_percent"].to_numpy(dtype=float)
    known = bool(len(gap)) and not np.all(np.isnan(gap))
    return {
        "hypervolume": last,
        "hypervolume_ratio": last / exact.hypervolume if exact and last is not None else None,
        "bound_form": proven.statement,
        "gap_percent_median": float(np.nanmedian(gap)) if known else None,
        "gap_percent_max": float(np.nanmax(gap)) if known else None,
    }


def end_notes(problem: ToleranceProblem, front: pd.DataFrame) -> list[str]:
    """How much of each end of a front of cost and one requirement is missing, if it is proven."""
    form = closed_form(problem)
    names = [name for name in problem.objectives if name != "cost"]
    if form is None or not len(front) or len(names) != 1 or problem.n_obj != 2:
        return []
    if names[0] not in form.outputs:  # a requirement stands for it, whose end says nothing of it
        return []
    row, limits = form.outputs.index(names[0]), row_limits(problem, form)
    limits[row] = np.inf
    least = least_value(form, row, limits)
    cheapest = float(least_bounds(form, limits[None, :])[0])
    ends = [
        (names[0], float(front[names[0]].min()), None if least is None else least.value),
        ("cost", float(front["cost"].min()), cheapest),
    ]
    units = {output.name: f" {output.unit}".rstrip() for output in problem.outputs}
    return [
        f"end of the front: the least {name} is {reached:.4g}{units[name]}; none below {proven:.4g}{units[name]} is "
        f"possible ({_missing(reached, proven)} missing at most)"
        for name, reached, proven in ends
        if proven is not None and np.isfinite(proven)
    ]


def _missing(reached: float, proven: float) -> str:
    """Distance of an end of a front from the proven end, relative to it where that is above 0."""
    if proven <= 0.0:
        return f"{reached - proven:.2g}"
    return percent(100.0 * (reached - proven) / proven)


def proof_notes(problem: ToleranceProblem, front: pd.DataFrame, proven: Proof) -> list[str]:
    """What the page and the terminal say of the proof."""
    gap = front["gap_percent"].to_numpy(dtype=float)
    if not len(gap) or np.all(np.isnan(gap)):
        return [proven.statement] if len(gap) else []
    if not informative(problem, proven, gap):
        return [
            f"the bound is not informative: the points lie {np.nanmedian(gap):.3g} % above it "
            f"in the median, because it leaves out limits that hold them back ({proven.statement})"
        ]
    return [
        f"proven: no allocation of equal or better other objectives costs less than the bound "
        f"({proven.statement}); the points lie {distance_words(np.nanmedian(gap))} above it in the "
        f"median, {distance_words(np.nanmax(gap))} at most"
    ]


def percent(value: float) -> str:
    """An upper limit of a gap in words: a rounding error is not printed as 1e-09 %."""
    return "0.001 %" if value < EXACT else f"{value:.2g} %"


def distance_words(value: float | np.floating[Any]) -> str:
    """A distance [percent] in words: a rounding error is not printed as a number."""
    return "less than 0.001 %" if value < EXACT else f"{value:.3g} %"
