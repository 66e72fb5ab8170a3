"""NSPSO of pygmo (swarm with non-dominated sorting), evaluated in batches."""

from __future__ import annotations

import numpy as np
import pygmo

from tolevo.section import Array

from ..task import Recorder
from .pygmo_nsga2 import POPULATION, Batch

DISTRIBUTION, LABEL = "pygmo", "NSPSO"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    problem = pygmo.problem(Batch(recorder))
    method = pygmo.nspso(gen=budget // POPULATION - 1, memory=True, seed=seed)
    method.set_bfe(pygmo.bfe())
    population = pygmo.population(problem, POPULATION, b=pygmo.bfe(), seed=seed)
    return np.asarray(pygmo.algorithm(method).evolve(population).get_f())
