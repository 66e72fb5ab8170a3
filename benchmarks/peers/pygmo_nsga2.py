"""NSGA-II of pygmo, evaluated in batches; its default mutation rate of 0.01 would stall here."""

from __future__ import annotations

import numpy as np
import pygmo

from tolevo.section import Array

from ..task import Recorder

DISTRIBUTION, LABEL = "pygmo", "NSGA-II"
POPULATION = 100


class Batch:
    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder

    def __deepcopy__(self, memo: object) -> Batch:
        return self  # pygmo copies its problems

    def get_nobj(self) -> int:
        return 2

    def get_bounds(self) -> tuple[Array, Array]:
        return self.recorder.low, self.recorder.high

    def fitness(self, x: Array) -> Array:
        return self.recorder.one(x)

    def batch_fitness(self, x: Array) -> Array:
        values: Array = self.recorder.batch(x.reshape(-1, len(self.recorder.low))).ravel()
        return values


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    problem = pygmo.problem(Batch(recorder))
    rate = 1.0 / len(recorder.low)
    method = pygmo.nsga2(gen=budget // POPULATION - 1, m=rate, eta_m=20.0, seed=seed)
    method.set_bfe(pygmo.bfe())
    population = pygmo.population(problem, POPULATION, b=pygmo.bfe(), seed=seed)
    return np.asarray(pygmo.algorithm(method).evolve(population).get_f())
