"""`exact` in closed form: the convex form is built, then its front, by price.

It evaluates no model: its points are what it reports, evaluated by the function of the task once,
in one batch.
"""

from __future__ import annotations

import numpy as np

from tolevo.algorithms.exact.front import front

from ..task import Array, Recorder, Task

DISTRIBUTION, LABEL = "tolevo", "exact"
POINTS = 1000
REPEATS = 25
"""Times that a run is measured where it is short."""


def suits(task: Task) -> bool:
    """Whether there is a closed form."""
    return task.parts is not None


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    parts = recorder.task.parts
    assert parts is not None
    found = front(parts.form(), POINTS, np.full(1, np.inf))
    chosen = found.chosen[:, np.array(parts.ways) > 1].astype(float)
    return recorder.batch(np.hstack([found.t, chosen]))
