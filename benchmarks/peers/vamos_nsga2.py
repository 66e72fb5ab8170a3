"""NSGA-II of VAMOS on its compiled engine."""

from __future__ import annotations

import numpy as np
import vamos

from tolevo.section import Array

from ..task import Recorder

DISTRIBUTION, LABEL = "vamos-optimization", "NSGA-II, numba"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    problem = vamos.make_problem(
        recorder.batch,
        n_var=len(recorder.low),
        n_obj=2,
        xl=recorder.low,
        xu=recorder.high,
        vectorized=True,
        encoding="real",
    )
    found = vamos.optimize(problem, algorithm="nsgaii", engine="numba", pop_size=100, max_evaluations=budget, seed=seed)
    return np.asarray(found.F)
