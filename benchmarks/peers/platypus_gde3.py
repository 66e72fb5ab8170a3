"""GDE3 of Platypus, with a crossover rate of 0.9 as for all GDE3 here."""

from __future__ import annotations

import random

import numpy as np
from platypus import GDE3, DifferentialEvolution, Problem, Real

from tolevo.section import Array

from ..task import Recorder

DISTRIBUTION, LABEL = "platypus-opt", "GDE3"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    random.seed(seed)
    problem = Problem(len(recorder.low), 2)
    bounds = zip(recorder.low.tolist(), recorder.high.tolist(), strict=True)
    problem.types[:] = [Real(low, high) for low, high in bounds]
    problem.function = lambda x: recorder.one(np.array(x)).tolist()
    variation = DifferentialEvolution(crossover_rate=0.9, step_size=0.5)
    algorithm = GDE3(problem, population_size=100, variator=variation)
    algorithm.run(budget)
    return np.array([list(solution.objectives) for solution in algorithm.result])
