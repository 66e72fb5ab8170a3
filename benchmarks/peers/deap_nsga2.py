"""NSGA-II of DEAP: the loop of its example, with batches evaluated at once."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
from deap import algorithms, base, tools

from tolevo.section import Array

from ..task import Recorder

DISTRIBUTION, LABEL = "deap", "NSGA-II"
POPULATION = 100


class Fitness(base.Fitness):
    weights = (-1.0, -1.0)


class Individual(list[float]):
    def __init__(self, values: Any) -> None:
        super().__init__(values)
        self.fitness = Fitness()


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    random.seed(seed)
    low, high = recorder.low.tolist(), recorder.high.tolist()
    toolbox = base.Toolbox()
    toolbox.register("mate", tools.cxSimulatedBinaryBounded, low=low, up=high, eta=20.0)
    toolbox.register("mutate", tools.mutPolynomialBounded, low=low, up=high, eta=20.0, indpb=1.0 / len(low))
    pairs = list(zip(low, high, strict=True))
    population = [
        Individual(random.uniform(a, b) for a, b in pairs) for _ in range(POPULATION)
    ]  # fmt: skip
    evaluate(recorder, population)
    population = tools.selNSGA2(population, POPULATION)  # no selection: sets the crowding distance
    while recorder.count + POPULATION <= budget:
        parents = tools.selTournamentDCD(population, POPULATION)
        children = algorithms.varAnd(parents, toolbox, cxpb=0.9, mutpb=1.0)
        evaluate(recorder, children)
        population = tools.selNSGA2(population + children, POPULATION)
    return np.array([one.fitness.values for one in population])


def evaluate(recorder: Recorder, individuals: list[Individual]) -> None:
    values = recorder.batch(np.array(individuals)).tolist()
    for one, value in zip(individuals, values, strict=True):
        one.fitness.values = tuple(value)
