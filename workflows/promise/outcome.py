"""What a run says of its promise: in one sentence, by statement, and what it hangs on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ...problems.promise import ASSURANCE, ASSURED, STATEMENTS, YIELD, Promise
from ...problems.promising import Promising
from ...problems.stack import Stack
from ...problems.stack.anew import cheapest_at, with_statement
from ...problems.tolerance_problem import ToleranceProblem
from .least import cheapest
from .next_parts import next_parts
from .shapes import bootstrapped, doubt, shapely, withheld

COSTS = ("statement", "cost", "dearer_percent", YIELD, ASSURANCE)


@dataclass(frozen=True, slots=True)
class PromiseOutcome:
    """What `summary.json` says, a sentence, and the tables of the same names."""

    summary: dict[str, Any]
    sentence: str
    costs: pd.DataFrame
    next_parts: pd.DataFrame


def promise_outcome(
    problem: ToleranceProblem, front: pd.DataFrame, point: int
) -> PromiseOutcome | None:
    """The promise at one point of a front; None where nothing is promised or found."""
    if isinstance(problem, Promising) and problem.promise is not None and not front.empty:
        return _of_deviations(problem, problem.promise, front.iloc[point], point)
    if not isinstance(problem, Stack) or problem.promises is None or front.empty:
        return None
    promise, row = problem.promises.promise, front.iloc[point]
    levels = {name: float(row[name]) for name in problem.objectives if name != "cost"}
    stack = cheapest_at(problem, levels)
    costs = by_statement(stack)
    ranking = next_parts(with_statement(stack, ASSURED))
    why = withheld(problem)
    names = [name for name in row.index if str(name).split(".")[-1] == ASSURANCE]
    assurance = min(float(row[name]) for name in names)
    summary: dict[str, Any] = promise.table() | {
        "point": point,
        ASSURANCE: assurance,
        "assured_withheld": why,
        "costs": {one["statement"]: one["cost"] for one in costs.to_dict("records")},
        "hangs_on": str(ranking["part"].iloc[0]) if len(ranking) else None,
    }
    if (level := problem.promises.level) is not None:
        summary |= {"level_percent": 100.0 * level.confidence, "level_sure": level.sure,
                    "without_choice_percent": 100.0 * level.without}  # fmt: skip
    if shapely(problem):
        design = problem.designs_of(front.iloc[[point]])[0]
        summary["bootstrap_percent"] = bootstrapped(problem, design)
    return PromiseOutcome(summary, sentence(summary, promise.words(), costs), costs, ranking)


def _of_deviations(
    problem: Promising, promise: Promise, row: pd.Series, point: int
) -> PromiseOutcome:
    """The promise of a problem that gives variances: its assurance, and what withholds the word."""
    samples = [(name, one) for name, _, one in problem.samples()]
    summary: dict[str, Any] = promise.table() | {
        "point": point,
        ASSURANCE: float(row[ASSURANCE]),
        "assured_withheld": [f"{name} {why}" for name, one in samples if (why := doubt(one))],
        "hangs_on": None,
    }
    nothing = pd.DataFrame({"statement": [], "cost": []})
    return PromiseOutcome(summary, sentence(summary, promise.words(), nothing), nothing,
                          pd.DataFrame())  # fmt: skip


def by_statement(stack: Stack) -> pd.DataFrame:
    """The least cost by each statement, its plug-in yield and its assurance."""
    rows = []
    for statement in STATEMENTS:
        own = with_statement(stack, statement)
        least = cheapest(own)
        found = dict.fromkeys((YIELD, ASSURANCE), np.nan)
        if np.isfinite(least.cost):
            outputs = own.outputs_of(least.design[None, :])
            for name in found:
                each = [float(value[0]) for key, value in outputs.items()
                        if key.split(".")[-1] == name]  # fmt: skip
                found[name] = min(each)
        rows.append({"statement": statement, "cost": least.cost, **found})
    table = pd.DataFrame(rows)
    table["dearer_percent"] = 100.0 * (table["cost"] / table["cost"].iloc[0] - 1.0)
    return table[list(COSTS)]


def sentence(summary: dict[str, Any], words: str, costs: pd.DataFrame) -> str:
    """The promise in one sentence, and what it costs."""
    kept = float(summary[ASSURANCE])
    told = f"Promised: {words}"
    if summary["assured_withheld"] and summary["statement"] == ASSURED:
        told += (f" (if all parts were normal; it is not called assured, for "
                 f"{'; '.join(summary['assured_withheld'])})")  # fmt: skip
    told += f"; over what the samples leave open it is kept with a probability of {kept:.1f} %"
    if "bootstrap_percent" in summary:
        told += f", by the Bayesian bootstrap {float(summary['bootstrap_percent']):.1f} %"
    by = costs.set_index("statement")["cost"]
    if by.empty:
        return f"{told}."
    if np.isfinite(by.get(ASSURED, np.nan)) and np.isfinite(by.iloc[0]):
        told += (f". At the least cost the estimates alone would ask for {by.iloc[0]:.4g}, an "
                 f"expected yield for {by.get('predictive', np.nan):.4g}, assurance for "
                 f"{by[ASSURED]:.4g}")  # fmt: skip
    elif not np.isfinite(by.get(ASSURED, np.nan)):
        told += ". There is no assured choice: even the tightest tolerances do not assure it"
    if summary["hangs_on"]:
        told += f". It hangs most on {summary['hangs_on']}: measure more of it first"
    return f"{told}."
