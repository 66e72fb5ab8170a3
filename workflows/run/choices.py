"""The choices of a front, as parts of the result of a run."""

from __future__ import annotations

from dataclasses import asdict, replace

import pandas as pd

from ...problems.interfaces import Page
from ...problems.tolerance_problem import ToleranceProblem
from ...records import Axis, RunResult
from ..choice.decide import Decisions
from .plan import RunPlan
from .proofs import Exact, exact_table

TABLES = {
    "front": "front.csv",
    "references": "references.csv",
    "convergence": "convergence.csv",
    "before": "front_without_effects.csv",
    "moved": "allocation_moved.csv",
    "choices": "choices.csv",
    "choice_sensitivity": "choice_sensitivity.csv",
    "allocation": "allocation.csv",
    "contributions": "contributions.csv",
    "exact_front": "exact_front.csv",
    "overlays": "overlays.csv",
    "unit_turn": "unit_turn.csv",
    "population": "population.csv",
    "assumptions_cost": "assumptions_cost.csv",
    "requirements": "requirements.csv",
    "drivers": "drivers.csv",
    "prices": "prices.csv",
    "changes": "changes.csv",
    "relaxed": "relaxed.csv",
    "promise": "promise.csv",
    "next_parts": "next_parts.csv",
    "capability": "capability.csv",
}
"""The files of the tables of a `RunResult`, by its field; `overlays` holds several fronts."""
FORMAT = 1
"""Version of the files of a run: `summary.json` names it; a reader refuses what is newer."""


def with_choices(result: RunResult, decisions: Decisions, plan: RunPlan, exact: Exact | None) -> RunResult:
    """The result with its choices, and with all that the page needs in the summary."""
    summary = dict(result.summary) | {
        "choices": _short(decisions.choices, plan.problem),
        "rounding": _rounding(decisions, plan),
        "format": FORMAT,
        "title": result.title,
        **_mechanism(plan.problem),
        "axes": {"objectives": _axes(result.objectives), "variables": _axes(result.variables)},
        "bars": [asdict(bar) for bar in result.bars],
    }
    return replace(
        result,
        summary=summary,
        choices=_none_if_empty(decisions.choices),
        choice_sensitivity=_none_if_empty(decisions.sensitivity),
        allocation=_none_if_empty(decisions.allocation),
        contributions=_none_if_empty(decisions.contributions),
        prices=_none_if_empty(decisions.prices),
        changes=_none_if_empty(decisions.changes),
        tolerances=decisions.tolerances,
        exact_front=exact_table(plan.problem, exact),
    )


def chosen_point(result: RunResult) -> int:
    """Row of the knee of a front, or of its only point."""
    choices = result.choices
    return 0 if choices is None or choices.empty else int(choices["point"].iloc[0])


def _mechanism(problem: ToleranceProblem) -> dict[str, object]:
    """The stated properties of the mechanism; empty where nothing but its name is stated."""
    known = Page.of(problem).mechanism()
    return {"mechanism": known} if set(known) - {"name"} else {}


def _short(choices: pd.DataFrame, problem: ToleranceProblem) -> dict[str, object]:
    """By rule: the row of the front, its objectives, and what rounding does to them."""
    columns = ["point", "meaning", *problem.objectives, "rounded_feasible", "unchanged_percent"]
    columns += [f"rounded_{name}" for name in problem.objectives]
    columns += ["model"] if "model" in choices else []
    return {str(row["choice"]): {name: row[name] for name in columns} for row in choices.to_dict("records")}


def _rounding(decisions: Decisions, plan: RunPlan) -> list[dict[str, str]]:
    """How each variable is rounded, and whether the configuration says so."""
    return [
        {"variable": name, "rule": rule, "set_by": "configuration" if name in plan.choice.steps else "default"}
        for name, rule in decisions.rounding.items()
    ]


def _axes(axes: tuple[Axis, ...]) -> list[dict[str, str]]:
    return [asdict(axis) for axis in axes]


def _none_if_empty(frame: pd.DataFrame) -> pd.DataFrame | None:
    return None if frame.empty else frame
