"""Problems with limits as functions that every contender can take.

Not every library takes constraints. All are given the same two objectives, and a design that breaks
a limit has values beyond all that keep it, the further the more it breaks (Deb 2000).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tolevo.configuration.reader import read
from tolevo.problems.settings import Settings
from tolevo.section import Array

from .parts import Watched, beyond
from .task import Task

CONFIGS = Path(__file__).parents[1] / "configs"
BEYOND = 10.0
"""Values of designs that break a limit, in the largest of the best front, at least."""


@dataclass(frozen=True, slots=True)
class Source:
    """A configuration and the class that notes what is evaluated of it."""

    configuration: str
    kind: type[Watched]

    def settings(self) -> Settings:
        """The settings of the configured problem."""
        problem = read(CONFIGS / self.configuration).problem
        assert problem is not None
        return problem.given

    def task(self, name: str, note: str, front: Array, patience: float = 1.0) -> Task:
        """The task, whose best front (k, 2) is known."""
        settings = self.settings()
        whole, edge = self.kind(settings), BEYOND * front.max(axis=0)

        def evaluate(x: Array) -> Array:
            return beyond(*whole.searched(x), edge)

        def problem() -> Watched:
            found = self.kind(settings)
            found.edge = edge
            return found

        return Task(name, whole.xl, whole.xu, evaluate, front, note, problem, patience=patience)
