"""NSGA-II of Platypus, with its defaults."""

from __future__ import annotations

import random

import numpy as np
from platypus import NSGAII, Problem, Real

from tolevo.section import Array

from ..task import Recorder

DISTRIBUTION, LABEL = "platypus-opt", "NSGA-II"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    random.seed(seed)
    problem = Problem(len(recorder.low), 2)
    bounds = zip(recorder.low.tolist(), recorder.high.tolist(), strict=True)
    problem.types[:] = [Real(low, high) for low, high in bounds]
    problem.function = lambda x: recorder.one(np.array(x)).tolist()
    algorithm = NSGAII(problem, population_size=100)
    algorithm.run(budget)
    return np.array([list(solution.objectives) for solution in algorithm.result])
