"""What a run needs and what it returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ...algorithms.settings import AlgorithmSettings, Budget
from ...problems.tolerance_problem import ToleranceProblem
from ...records import RunResult
from ..choice import ChoiceSettings


@dataclass(frozen=True, slots=True)
class RunPlan:
    """A resolved run; `configuration` is the TOML text that repeats it.

    `engine` is "pymoo" or "array". With `reference_search` the GA searches the least cost as a
    reference for a problem without published allocations as well.
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


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """How a run ended: "done", "interrupted" or "no_feasible_point", and where its files are."""

    status: str
    folder: Path
    lines: tuple[str, ...]
    result: RunResult
