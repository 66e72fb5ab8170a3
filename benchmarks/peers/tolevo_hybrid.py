"""`hybrid`: evolution from exact seeds where there is a form, polished by gradients."""

from __future__ import annotations

from tolevo.algorithms.hybrid import Hybrid
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.section import Array

from ..task import Recorder, Task

DISTRIBUTION, LABEL = "tolevo", "hybrid"


def suits(task: Task) -> bool:
    """Whether the task is known as a problem of tolevo."""
    return task.problem is not None


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    assert recorder.task.problem is not None
    problem = recorder.task.problem().watched(recorder.note)
    return search(problem, Hybrid(), Budget(evaluations=budget), seed).f
