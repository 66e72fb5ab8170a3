"""MOEA/D of pygmo (differential evolution, Tchebycheff), evaluated one by one as it does."""

from __future__ import annotations

import numpy as np
import pygmo

from tolevo.section import Array

from ..task import Recorder
from .pygmo_nsga2 import POPULATION, Batch

DISTRIBUTION, LABEL = "pygmo", "MOEA/D"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    problem = pygmo.problem(Batch(recorder))
    method = pygmo.moead(gen=budget // POPULATION - 1, weight_generation="grid", seed=seed)
    population = pygmo.population(problem, POPULATION, b=pygmo.bfe(), seed=seed)
    return np.asarray(pygmo.algorithm(method).evolve(population).get_f())
