"""What a study needs and what it returns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...algorithms.settings import AlgorithmSettings, Budget
from ...problems.interfaces import Checks
from ...problems.tolerance_problem import ToleranceProblem
from .records import StudyData, StudySettings

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class Point:
    """One setting of the design: what runs there. `problem` is its number in the plan."""

    problem: int
    algorithm: AlgorithmSettings
    budget: Budget
    engine: str


@dataclass(frozen=True)
class StudyPlan:
    """A resolved study: `points` belong to the rows of `design`, `settings` say what it is.

    `time_limit_s` is that of one run (wall time), None where there is none.
    """

    settings: StudySettings
    design: pd.DataFrame
    points: tuple[Point, ...]
    problems: tuple[ToleranceProblem, ...]
    time_limit_s: float | None = None

    @cached_property
    def seeds(self) -> tuple[int, ...]:
        """Seed of each replicate, the same at every point; more replicates keep the first ones."""
        return tuple(
            int(np.random.SeedSequence(self.settings.seed, spawn_key=(k,)).generate_state(1)[0])
            for k in range(self.settings.seeds)
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know before trusting the study."""
        texts = [text for problem in self.problems for text in Checks.of(problem).cautions()]
        if any(point.budget.time_limit_s is not None for point in self.points):
            texts.append("algorithm.time_limit_s ends a run by the clock: no two studies are equal")
        return tuple(dict.fromkeys(texts))

    @property
    def total(self) -> int:
        """Number of runs."""
        return len(self.points) * self.settings.seeds


@dataclass(frozen=True, slots=True)
class StudyOutcome:
    """How a study ended: "done" or "interrupted", and where its files are."""

    status: str
    folder: Path
    lines: tuple[str, ...]
    data: StudyData | None = None


@dataclass(frozen=True, slots=True)
class StudyProgress:
    """State of a study. `remaining` is a time [s], None before the first run has ended."""

    done: int
    running: int
    failed: int
    total: int
    seconds: float
    remaining: float | None
    note: str = ""
