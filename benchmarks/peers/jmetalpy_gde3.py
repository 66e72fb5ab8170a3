"""GDE3 of jMetalPy, with a crossover rate of 0.9 as for all GDE3 here."""

from __future__ import annotations

import logging
import random

import numpy as np
from jmetal.algorithm.multiobjective.gde3 import GDE3
from jmetal.util.termination_criterion import StoppingByEvaluations

from tolevo.section import Array

from ..task import Recorder
from .jmetalpy_nsga2 import OneByOne

DISTRIBUTION, LABEL = "jmetalpy", "GDE3"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    logging.getLogger("jmetal").setLevel(logging.WARNING)
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - jMetalPy draws from the global generators
    algorithm = GDE3(
        problem=OneByOne(recorder),
        population_size=100,
        cr=0.9,
        f=0.5,
        termination_criterion=StoppingByEvaluations(budget),
    )
    algorithm.run()
    return np.array([solution.objectives for solution in algorithm.result()])
