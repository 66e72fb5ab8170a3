"""The interface of everything that runs tasks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

ATTEMPTS = 3
"""Workers that may be lost in a task before it is given up."""


class Task(Protocol):
    """A task: a picklable value with a name. Equal keys are equal tasks."""

    @property
    def key(self) -> str:
        """The name."""
        ...


@dataclass(frozen=True, slots=True)
class Lost:
    """In place of a result: `ATTEMPTS` workers were lost in the task."""

    reason: str


TaskT = TypeVar("TaskT", bound=Task)
Result = TypeVar("Result")


class Closing:
    """A context that is closed at its end."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End what still runs."""


class Executor(Closing, ABC):
    """Runs pure functions of tasks. A context: leaving it ends what still runs."""

    workers: int
    """Tasks that run at once, as far as is known."""

    @abstractmethod
    def completed(
        self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Result | Lost]]:
        """Tasks with their results, as they end.

        `source` hands out the next task, None where there is none at the moment; it is asked again
        after each result. It ends when nothing runs and there is no task. A lost worker's task is
        run again; what `function` raises is raised here.
        """
