"""SMPSO of jMetalPy, with the settings of its example."""

from __future__ import annotations

import logging
import random

import numpy as np
from jmetal.algorithm.multiobjective.smpso import SMPSO
from jmetal.operator.mutation import PolynomialMutation
from jmetal.util.archive import CrowdingDistanceArchive
from jmetal.util.termination_criterion import StoppingByEvaluations

from tolevo.section import Array

from ..task import Recorder
from .jmetalpy_nsga2 import OneByOne

DISTRIBUTION, LABEL = "jmetalpy", "SMPSO"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    logging.getLogger("jmetal").setLevel(logging.WARNING)
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - jMetalPy draws from the global generators
    algorithm = SMPSO(
        problem=OneByOne(recorder),
        swarm_size=100,
        mutation=PolynomialMutation(1.0 / len(recorder.low), 20),
        leaders=CrowdingDistanceArchive(100),
        termination_criterion=StoppingByEvaluations(budget),
    )
    algorithm.run()
    return np.array([solution.objectives for solution in algorithm.result()])
