"""NSGA-II of jMetalPy, with the operators of its example."""

from __future__ import annotations

import logging
import random

import numpy as np
from jmetal.algorithm.multiobjective.nsgaii import NSGAII
from jmetal.core.problem import FloatProblem
from jmetal.core.solution import FloatSolution
from jmetal.operator.crossover import SBXCrossover
from jmetal.operator.mutation import PolynomialMutation
from jmetal.util.termination_criterion import StoppingByEvaluations

from tolevo.section import Array

from ..task import Recorder

DISTRIBUTION, LABEL = "jmetalpy", "NSGA-II"


class OneByOne(FloatProblem):
    def __init__(self, recorder: Recorder) -> None:
        super().__init__()
        self.recorder = recorder
        self.lower_bound, self.upper_bound = recorder.low.tolist(), recorder.high.tolist()
        self.obj_directions = [self.MINIMIZE, self.MINIMIZE]

    def number_of_objectives(self) -> int:
        return 2

    def number_of_constraints(self) -> int:
        return 0

    def evaluate(self, solution: FloatSolution) -> FloatSolution:
        solution.objectives = self.recorder.one(np.array(solution.variables)).tolist()
        return solution

    def name(self) -> str:
        return self.recorder.task.name


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    logging.getLogger("jmetal").setLevel(logging.WARNING)
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - jMetalPy draws from the global generators
    problem = OneByOne(recorder)
    algorithm = NSGAII(
        problem=problem,
        population_size=100,
        offspring_population_size=100,
        mutation=PolynomialMutation(1.0 / len(recorder.low), 20),
        crossover=SBXCrossover(1.0, 20),
        termination_criterion=StoppingByEvaluations(budget),
    )
    algorithm.run()
    return np.array([solution.objectives for solution in algorithm.result()])
