"""Every choice of a front: its rule, its sensitivity, its contributions and its rounded values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...algorithms.run import Run, Shared
from ...algorithms.settings import Budget
from ...problems.limits import limits_of
from ...problems.settings import Bound
from ...problems.tolerance_problem import ToleranceProblem, designs_of
from ...section import Array
from .changes import Rounded, advice, changes, round_design, rounding_sentence
from .choice import COST, ONLY, PREFERRED, RULE_KINDS, ChoiceSettings, Points, choose_rows, meaning_of, sensitivity
from .prices import contributions, prices, slopes_of
from .tolerances import FINER, allocation, rule_message, share_of, step_of, tolerances, values_of


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """The tables `choices`, `sensitivity`, `allocation`, `contributions`, `prices` and `changes`;
    `rounding`: by variable how it is rounded; `tolerances`: what a drawing and a price need to know of each;
    `notes`: rules that failed.
    """

    choices: pd.DataFrame = field(default_factory=pd.DataFrame)
    sensitivity: pd.DataFrame = field(default_factory=pd.DataFrame)
    allocation: pd.DataFrame = field(default_factory=pd.DataFrame)
    contributions: pd.DataFrame = field(default_factory=pd.DataFrame)
    rounding: dict[str, str] = field(default_factory=dict)
    prices: pd.DataFrame = field(default_factory=pd.DataFrame)
    changes: pd.DataFrame = field(default_factory=pd.DataFrame)
    tolerances: tuple[dict[str, Any], ...] = ()
    notes: tuple[str, ...] = ()


class RoundingTask(NamedTuple):
    """The arguments of `round_design` but the problem, for another process."""

    design: Array
    values: Mapping[str, Array]
    bounds: Mapping[str, Bound]
    finer: Mapping[str, Array]


def decide(
    problem: ToleranceProblem, front: pd.DataFrame, settings: ChoiceSettings, shared: Shared | None = None
) -> Decisions:
    """The choices of a front as `problem` reports it; empty tables where it is empty. With `shared`, other processes
    round some of the choices where each takes a sample.
    """
    if front.empty:
        return Decisions()
    designs = designs_of(problem, front)
    points = points_of(problem, front, settings)
    notes: list[str] = []
    choices = choose_rows(points, notes)
    spread = sensitivity(points, problem.costs_of(designs))
    rows = list(dict.fromkeys(choices.values()))
    slopes = slopes_of(problem, designs)
    steps = {v.name: step_of(problem, v, settings) for v in problem.free}
    grades = {v.name: values_of(problem, v, step) for v in problem.free if (step := steps[v.name]) is not None}
    values = {name: np.array(sorted(orderable)) for name, orderable in grades.items()}
    finer = {v.name: np.array(list(values_of(problem, v, FINER))) for v in problem.free if steps[v.name] == PREFERRED}
    tasks = [RoundingTask(designs[at], values, _required_bounds(settings, choices, at), finer) for at in rows]
    if shared is None or not problem.declaration.sampled:
        shared = Run(problem, Budget(), seed=0).results
    rounded = dict(zip(rows, shared(rounded_choice, tasks), strict=True))
    new = {at: one.design for at, one in rounded.items()}
    rules = {v.name: rule_message(problem, v, steps[v.name]) for v in problem.free}
    by_point = {at: " ".join(n for n, choice in choices.items() if choice == at) for at in rows}
    both = {at: (designs[at], new[at]) for at in rows}
    tried = changes(problem, {at: designs[at] for at in _rows_to_try(problem, rows)}, grades)
    return Decisions(
        _table(problem, front, choices, rounded, spread, tried),
        spread,
        allocation(problem, by_point, both, grades, rules, share_of(settings)),
        contributions(problem, slopes),
        rules,
        prices(problem, front, slopes),
        tried,
        tolerances(problem, rules, grades),
        tuple(notes),
    )


def _begun_at(rounded: Array, own: Array) -> str:
    """Where the steps of an advice begin, if the drawing has other values than the design (all variables,) itself."""
    return "" if np.allclose(rounded, own, 1e-9, 0.0) else " These steps begin at the values before rounding."


def rounded_choice(problem: ToleranceProblem, task: RoundingTask) -> Rounded:
    """The design of a task with every value at one that can be ordered."""
    return round_design(problem, *task)


def _rows_to_try(problem: ToleranceProblem, rows: list[int]) -> list[int]:
    """The chosen rows whose single steps are tried: the first alone where each takes a sample."""
    return rows[:1] if problem.declaration.sampled else rows


def _required_bounds(settings: ChoiceSettings, choices: Mapping[str, int], at: int) -> dict[str, Bound]:
    """The bounds that the rules that choose a row require of it, and of the rounded point too."""
    bounds: dict[str, Bound] = {}
    for name, choice in choices.items():
        bounds |= RULE_KINDS[name]().limits(settings) if choice == at and name != ONLY else {}
    return bounds


def points_of(problem: ToleranceProblem, front: pd.DataFrame, settings: ChoiceSettings) -> Points:
    """The front in the form that the rules take."""
    names = problem.objectives
    requested = np.array([settings.weights.get(name, 0.0) for name in names])
    weights = requested if requested.sum() > 0.0 else np.ones(len(names))
    cost = front[COST].to_numpy(dtype=float) if COST in front else None
    return Points(
        front[list(names)].to_numpy(dtype=float),
        names,
        cost,
        weights / weights.sum(),
        _rows_within_limits(problem, front, settings.limits) if settings.limits else None,
        settings.budget,
    )


def _rows_within_limits(
    problem: ToleranceProblem, front: pd.DataFrame, bounds: Mapping[str, Bound]
) -> NDArray[np.bool_]:
    limits = limits_of(bounds, problem.outputs, problem.variables)
    return np.asarray(np.all([limit.kept(front[limit.name].to_numpy(dtype=float)) for limit in limits], axis=0))


def _table(
    problem: ToleranceProblem,
    front: pd.DataFrame,
    choices: dict[str, int],
    rounded: dict[int, Rounded],
    spread: pd.DataFrame,
    tried: pd.DataFrame,
) -> pd.DataFrame:
    """`choices.csv`: the chosen points, unrounded and rounded, and how sure each choice is."""
    after = problem.reported().frame(np.stack([rounded[at].design for at in choices.values()]))
    limits = [limit.name for limit in problem.limits if limit.count]
    broken = [" ".join(name for name in limits if row[f"margin_{name}"] < 0.0) for row in after.to_dict("records")]
    selected = front.iloc[list(choices.values())].reset_index(drop=True)
    columns = ["bound", "gap_percent", *problem.objectives, *problem.names]
    table = selected[[name for name in columns if name in selected]].copy()
    table.insert(0, "choice", list(choices))
    table.insert(1, "meaning", [meaning_of(name) for name in choices])
    table.insert(2, "point", list(choices.values()))
    for name in problem.objectives:
        values = selected[name].to_numpy(dtype=float)
        table[f"rounded_{name}"] = after[name]
        loss = after[name].to_numpy(dtype=float) - values
        fraction = np.divide(loss, np.abs(values), out=np.full_like(loss, np.nan), where=values != 0.0)
        table[f"rounding_loss_{name}_percent"] = 100.0 * fraction
    records = selected.to_dict("records")
    if COST in selected and COST in after:
        table["rounding"] = [
            rounding_sentence(
                problem,
                rounded[point],
                float(selected[COST][at]),
                float(after[COST][at]),
                broken[at],
                {
                    name: (float(selected[name][at]), float(after[name][at]))
                    for name in problem.objectives
                    if name != COST
                },
            )
            for at, point in enumerate(choices.values())
        ]
    table["loosen_first"] = [
        text + _begun_at(rounded[point].design, own)
        if len(steps) and (text := advice(problem, steps, records[at]))
        else ""
        for at, (point, own) in enumerate(zip(choices.values(), designs_of(problem, selected), strict=True))
        for steps in [tried[tried["point"] == point]]
    ]
    table["rounded_feasible"] = after["feasible"]
    table["rounded_violated_limits"] = broken
    if problem.declaration.model_statement:
        table["model"] = problem.model_labels(designs_of(problem, selected))
    same = spread.groupby("choice")["same"].mean() if len(spread) else pd.Series(dtype=float)
    table["unchanged_percent"] = [100.0 * same.get(name, np.nan) for name in choices]
    return table
