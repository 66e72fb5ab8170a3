"""Several runs side by side: hypervolume in one box, and cost at equal value."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ..algorithms.archive import hypervolume
from ..records import Axis, Compared, Comparison, RunResult

LEVELS = 7
"""Levels of the second objective at which costs are compared."""
COST = "cost"


def compare_runs(runs: Mapping[str, RunResult]) -> tuple[Comparison | None, tuple[str, ...]]:
    """The runs with the objectives of the first one, and remarks on the others.

    None where fewer than two remain.
    """
    whole = {label: run for label, run in runs.items() if len(run.front) and run.objectives}
    remarks = [f"{label}: has no front to compare" for label in runs if label not in whole]
    if not whole:
        return None, tuple(remarks)
    first, first_run = next(iter(whole.items()))
    names = [axis.name for axis in first_run.objectives]
    alike = {}
    for label, run in whole.items():
        others = [axis.name for axis in run.objectives]
        if sorted(others) == sorted(names):
            alike[label] = run
        else:
            remarks.append(f"{label}: minimises {', '.join(others)}, and {first} {', '.join(names)}: left out")
    if len(alike) < 2:
        return None, tuple(remarks)
    ideal, nadir, note = _box(alike, names)
    result = Comparison(
        title="Comparison of " + ", ".join(alike),
        objectives=first_run.objectives,
        runs=tuple(Compared(label, run.front, run.references) for label, run in alike.items()),
        table=_table(alike, names, ideal, nadir),
        equal=_cost_at_levels(alike, first_run.objectives),
        notes=(note, *remarks),
    )
    return result, tuple(remarks)


def _box(runs: Mapping[str, RunResult], names: list[str]) -> tuple[np.ndarray, np.ndarray, str]:
    """Ideal and nadir that all runs are measured by."""
    ends = []
    for key, of_fronts in (("ideal", np.min), ("nadir", np.max)):
        stated = [run.summary.get(key) or {} for run in runs.values()]
        known = [[box.get(name) for name in names] for box in stated]
        if all(isinstance(value, int | float) for row in known for value in row):
            ends.append(np.array(known, dtype=float))
        else:
            fronts = [run.front[names].to_numpy(dtype=float) for run in runs.values()]
            ends.append(np.array([of_fronts(values, axis=0) for values in fronts]))
    ideal, nadir = ends[0].min(axis=0), ends[1].max(axis=0)
    same = bool(np.all(ends[0] == ideal) and np.all(ends[1] == nadir))
    note = "Hypervolumes are measured in the box that all runs share."
    if not same:
        note = (
            "The runs have different boxes of ideal and nadir: hypervolumes are measured in the "
            "box that contains all of them, and differ from those of the runs themselves."
        )
    return ideal, np.maximum(nadir, ideal + 1e-12), note


def _table(runs: Mapping[str, RunResult], names: list[str], ideal: np.ndarray, nadir: np.ndarray) -> pd.DataFrame:
    rows = []
    for label, run in runs.items():
        values = run.front[names].to_numpy(dtype=float)
        row = {"run": label, "points": len(values), "hypervolume": hypervolume(values, ideal, nadir)}
        row |= {f"least {name}": low for name, low in zip(names, values.min(axis=0), strict=True)}
        row |= {key: run.summary.get(key) for key in ("evaluations", "seconds", "status", "seed")}
        statement = run.summary.get("model_statement")
        rows.append(row | ({"model": statement} if statement else {}))
    table = pd.DataFrame(rows)
    table.insert(3, "share_of_best_percent", 100.0 * table["hypervolume"] / (table["hypervolume"].max() or np.nan))
    return table


def _cost_at_levels(runs: Mapping[str, RunResult], objectives: tuple[Axis, ...]) -> pd.DataFrame:
    """Cost of the cheapest point at levels of the other objective that all runs reach."""
    others = [axis.name for axis in objectives if axis.name != COST]
    if len(others) != 1 or len(objectives) != 2:
        return pd.DataFrame()
    fronts = {label: run.front[[COST, others[0]]] for label, run in runs.items()}
    low = max(front[others[0]].min() for front in fronts.values())
    high = min(front[others[0]].max() for front in fronts.values())
    if not low < high:
        return pd.DataFrame()
    rows = []
    for level in np.linspace(low, high, LEVELS):
        costs = {label: front.loc[front[others[0]] <= level, COST].min() for label, front in fronts.items()}
        rows.append({others[0]: level} | {f"cost, {label}": cost for label, cost in costs.items()})
    return pd.DataFrame(rows)
