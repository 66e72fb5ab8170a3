"""What a run needs and what it returns."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ...algorithms.settings import AlgorithmSettings, Budget
from ...problems.tolerance_problem import ToleranceProblem, designs_of
from ...records import CommandOutcome, RunResult
from ...section import Array
from .choice import ChoiceSettings

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class RunPlan:
    """A resolved run; `configuration` is the TOML text that repeats it.

    `engine` is "pymoo" or "array". With `reference_search` the GA searches the least cost as a
    reference for a problem without published allocations as well. `workbook` are the bytes of the
    configuration where it is one: the run writes it with its result. `start` are the search vectors
    (n, variables) that the search begins from, `start_notes` what the user should know of them.
    """

    problem: ToleranceProblem
    algorithm: AlgorithmSettings
    budget: Budget
    seed: int
    references: bool
    configuration: str
    title: str
    engine: str = "pymoo"
    choice: ChoiceSettings = field(default_factory=ChoiceSettings)
    reference_search: bool = False
    workbook: bytes = field(default=b"", repr=False)
    start: Array | None = field(default=None, repr=False)
    start_notes: tuple[str, ...] = ()


RunOutcome = CommandOutcome[RunResult]


def chosen_point(result: RunResult) -> int:
    """Row of the knee of a front, or of its only point."""
    choices = result.choices
    return 0 if choices is None or choices.empty else int(choices["point"].iloc[0])


# What backlash means in a run, shown on the units of one of its points.


SHOWN = ("cost", "yield_percent", "interference_probability")
"""Outputs of the shown point that the page repeats, in addition to the one that is limited."""

MAX_LIMIT_DISTANCE = 0.1
"""Fraction of the limit by which a point may miss it to be shown in place of the knee."""


def add_units(result: RunResult, problem: ToleranceProblem) -> RunResult:
    """The result with the limits of validity, and one unit and the population of its shown point.

    Unchanged for problems without them.
    """
    validity = problem.validity()
    if validity:
        result = replace(result, summary={**result.summary, "validity": list(validity)})
    comparison = problem
    chosen = shown_point(result.front, comparison)
    if chosen is None:
        return result
    row, reason = chosen
    shown = comparison.shown_units(designs_of(problem, result.front.iloc[[row]])[0])
    limit = problem.shown_limit()
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
        result,
        summary={**result.summary, "units": units},
        unit_turn=shown.turn,
        population=shown.population,
        torque_rotation=shown.torque_rotation,
    )


def shown_point(front: pd.DataFrame, problem: ToleranceProblem) -> tuple[int, str] | None:
    """Row of the point whose units are shown, and by what it was chosen; None without any.

    The point nearest to the problem's limit; where none is `MAX_LIMIT_DISTANCE`, the knee.
    """
    limit = problem.shown_limit()
    if limit is None or front.empty or limit[0] not in front:
        return None
    name, most = limit
    distance = np.abs(front[name].to_numpy(dtype=float) / most - 1.0)
    if distance.min() > MAX_LIMIT_DISTANCE and "knee" in front and front["knee"].any():
        return int(np.argmax(front["knee"].to_numpy(dtype=bool))), "the knee"
    return int(np.argmin(distance)), f"the point nearest to {name} {most:g}"
