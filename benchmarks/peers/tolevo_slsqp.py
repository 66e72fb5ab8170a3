"""`exact` where no form is known: epsilon-constraints by SLSQP in log tolerances."""

from __future__ import annotations

from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.section import Array

from ..task import Recorder, Task

DISTRIBUTION, LABEL = "tolevo", "exact (SLSQP)"


def suits(task: Task) -> bool:
    """Whether the task is known as a problem of tolevo."""
    return task.problem is not None


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    assert recorder.task.problem is not None
    problem = recorder.task.problem().watched(recorder.note, formless=True)
    return search(problem, Exact(), Budget(evaluations=budget), seed).f
