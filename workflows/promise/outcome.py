"""The promise of a run: in one sentence, by statement, and the part it depends on most."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ...arrays import Array
from ...problems.designs import designs_of
from ...problems.promise import ASSURANCE, ASSURED, STATEMENTS, YIELD, Promise
from ...problems.stack import Stack
from ...problems.tolerance_problem import ToleranceProblem
from .anew import cheapest_at, with_statement
from .least import Least, cheapest
from .limits import promised_limits
from .next_parts import next_parts
from .shapes import any_not_normal, bootstrapped, withheld

SURE = 2.0
"""Standard errors by which an assurance by units may fall short of the confidence."""
COSTS = ("statement", "cost", "dearer_percent", YIELD, ASSURANCE)


@dataclass(frozen=True, slots=True)
class PromiseOutcome:
    """The entries of `summary.json`, a sentence, and the tables of the same names."""

    summary: dict[str, Any]
    sentence: str
    costs: pd.DataFrame
    next_parts: pd.DataFrame


def promise_outcome(
    problem: ToleranceProblem, front: pd.DataFrame, point: int, drawing: Array | None = None
) -> PromiseOutcome | None:
    """The promise at a point of a front; None where nothing is promised, or no point exists.

    `drawing` is the full design (all variables,) of that point as it is rounded, where it is known.
    """
    promise = problem.promise
    if promise is None or front.empty or not promised_limits(problem):
        return None
    row, design = front.iloc[point], designs_of(problem, front.iloc[[point]])[0]
    levels = {name: float(row[name]) for name in problem.objectives if name != "cost"}
    cheapest_problem = cheapest_at(problem, levels)
    least = {
        statement: _least(with_statement(cheapest_problem, statement), design, promise, levels)
        for statement in STATEMENTS
    }
    costs = by_statement(cheapest_problem, least)
    ranking = next_parts(with_statement(cheapest_problem, ASSURED), least=least[ASSURED])
    summary: dict[str, Any] = promise.table() | {
        "point": point,
        ASSURANCE: _least_of(dict(row), ASSURANCE),
        "assured_withheld": withheld(problem),
        "costs": {record["statement"]: record["cost"] for record in costs.to_dict("records")},
        "hangs_on": str(ranking["part"].iloc[0]) if len(ranking) else None,
    }
    if promise.statement == ASSURED and problem.declaration.sampled:
        doubt = SURE * _least_of(dict(row), f"{ASSURANCE}_error")
        summary["kept"] = bool(summary[ASSURANCE] + doubt >= promise.confidence_percent)
    if isinstance(problem, Stack):
        summary |= _of_stack(problem, design)
    if drawing is not None:
        summary |= _of_drawing(problem, drawing)
    return PromiseOutcome(summary, sentence(summary, promise.words(), costs), costs, ranking)


def _least(problem: ToleranceProblem, design: Array, promise: Promise, levels: Mapping[str, float]) -> Least:
    """The least cost by a statement; with one objective and the statement of the run it is that of
    the run, where the problem is tested on units or nothing is cheaper.
    """
    stated = problem.promise
    assert stated is not None
    if levels or stated.statement != promise.statement:
        return cheapest(problem, design)
    of_run = Least(float(problem.cost_of(design[None, :])[0]), design)
    least = of_run if problem.declaration.sampled else cheapest(problem, design)
    return least if least.cost <= of_run.cost else of_run


def _of_stack(problem: Stack, design: Array) -> dict[str, Any]:
    """The level of the norm, and the assurance by the Bayesian bootstrap."""
    entries: dict[str, Any] = {}
    if problem.promises is not None and (level := problem.promises.level) is not None:
        entries |= {
            "level_percent": 100.0 * level.confidence,
            "level_sure": level.sure,
            "without_choice_percent": 100.0 * level.without,
        }
    if any_not_normal(problem):
        entries["bootstrap_percent"] = bootstrapped(problem, design)
    return entries


def _of_drawing(problem: ToleranceProblem, drawing: Array) -> dict[str, Any]:
    """Whether a rounded full design (all variables,) keeps the promise, and how surely."""
    designs, outputs = drawing[None, :], problem.outputs_of(drawing[None, :])
    promised = promised_limits(problem)
    kept = all(
        np.all(limit.kept(problem.values(designs, outputs, limit.name)))
        for limit in problem.limits
        if limit.name in promised
    )
    values = {name: float(value[0]) for name, value in outputs.items()}
    return {"rounded_kept": kept, f"rounded_{ASSURANCE}": _least_of(values, ASSURANCE)}


def by_statement(problem: ToleranceProblem, least: Mapping[str, Least]) -> pd.DataFrame:
    """The least cost by each statement, its plug-in yield and its assurance."""
    promise, rows = problem.promise, []
    assert promise is not None
    for statement, allocation in least.items():
        assurances: dict[str, float] = dict.fromkeys((YIELD, ASSURANCE), np.nan)
        if np.isfinite(allocation.cost):
            outputs = with_statement(problem, statement).outputs_of(allocation.design[None, :])
            values = {name: float(value[0]) for name, value in outputs.items()}
            assurances = {YIELD: _least_of(values, promise.of), ASSURANCE: _least_of(values, ASSURANCE)}
        rows.append({"statement": statement, "cost": allocation.cost, **assurances})
    table = pd.DataFrame(rows)
    table["dearer_percent"] = 100.0 * (table["cost"] / table["cost"].iloc[0] - 1.0)
    return table[list(COSTS)]


def _least_of(row: Mapping[Any, Any], name: str) -> float:
    """The least of an output over all requirements."""
    values = [value for key, value in row.items() if str(key).split(".")[-1] == name]
    return min(map(float, values), default=float("nan"))


def sentence(summary: dict[str, Any], words: str, costs: pd.DataFrame) -> str:
    """The promise in one sentence, and what it costs."""
    kept = float(summary[ASSURANCE])
    text = f"Promised: {words}"
    if summary["assured_withheld"] and summary["statement"] == ASSURED:
        text += f" (if all parts were normal; it is not called assured, for {'; '.join(summary['assured_withheld'])})"
    text += f"; given the uncertainty of the samples it is kept with a probability of {kept:.1f} %"
    if summary.get("kept") is False:
        text += ", less than the confidence that was asked for: it is not assured"
    if summary.get("rounded_kept") is False:
        text += (
            f"; as rounded for the drawing it is not kept (probability "
            f"{float(summary[f'rounded_{ASSURANCE}']):.1f} %): state finer steps in "
            "[rounding]"
        )
    if "bootstrap_percent" in summary:
        text += f", by the Bayesian bootstrap {float(summary['bootstrap_percent']):.1f} %"
    by = costs.set_index("statement")["cost"]
    if by.empty:
        return f"{text}."
    if np.isfinite(by.get(ASSURED, np.nan)) and np.isfinite(by.iloc[0]):
        text += (
            f". At the least cost the estimates alone would ask for {by.iloc[0]:.4g}, an expected yield for "
            f"{by.get('predictive', np.nan):.4g}, assurance for {by[ASSURED]:.4g}"
        )
    elif not np.isfinite(by.get(ASSURED, np.nan)) and "kept" not in summary:
        text += ". There is no assured choice: even the tightest tolerances do not assure it"
    if summary["hangs_on"]:
        text += f". It depends most on {summary['hangs_on']}: measure more of it first"
    return f"{text}."
