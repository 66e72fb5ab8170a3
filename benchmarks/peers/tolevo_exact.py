"""`exact` by a form: the convex form is built, then its front, by price.

Where that is the task's function itself, it evaluates no model: its points are what it reports,
evaluated once, in one batch. Where the form is a bound, its points are corrected by the full model,
whose evaluations for that are within the time and not counted.
"""

from __future__ import annotations

import numpy as np

from tolevo.algorithms.exact.front import front
from tolevo.algorithms.exact.solver import Exact, closed_form
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.section import Array

from ..task import Recorder, Task

DISTRIBUTION, LABEL = "tolevo", "exact"
POINTS = 1000
CORRECTED = 20
"""Points of a front that is corrected by the full model."""
REPEATS = 25
"""Times that a run is measured where it is short."""
UNCUT = True
"""Its few points all come at the end: a run cut short would have none."""


def suits(task: Task) -> bool:
    """Whether there is a form."""
    return task.parts is not None or (task.problem is not None and closed_form(task.problem()) is not None)


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    parts, problem = recorder.task.parts, recorder.task.problem
    if parts is None:
        assert problem is not None
        watched = problem().watched(recorder.note)
        return search(watched, Exact(CORRECTED), Budget(), seed).f
    found = front(parts.form(), POINTS, np.full(1, np.inf))
    chosen = found.chosen[:, np.array(parts.ways) > 1].astype(float)
    return recorder.batch(np.hstack([found.t, chosen]))
