"""SPEA2 of DEAP in the loop of its NSGA-II: the other selection it ships for two objectives."""

from __future__ import annotations

import random

import numpy as np
from deap import algorithms, base, tools

from tolevo.section import Array

from ..task import Recorder
from .deap_nsga2 import POPULATION, Individual, evaluate

DISTRIBUTION, LABEL = "deap", "SPEA2"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    random.seed(seed)
    low, high = recorder.low.tolist(), recorder.high.tolist()
    toolbox = base.Toolbox()
    toolbox.register("mate", tools.cxSimulatedBinaryBounded, low=low, up=high, eta=20.0)
    toolbox.register("mutate", tools.mutPolynomialBounded, low=low, up=high, eta=20.0, indpb=1.0 / len(low))
    pairs = list(zip(low, high, strict=True))
    population = [Individual(random.uniform(a, b) for a, b in pairs) for _ in range(POPULATION)]
    evaluate(recorder, population)
    archive = tools.selSPEA2(population, POPULATION)
    while recorder.count + POPULATION <= budget:
        parents = tools.selRandom(archive, POPULATION)  # SPEA2 selects by its archive
        children = algorithms.varAnd(parents, toolbox, cxpb=0.9, mutpb=1.0)
        evaluate(recorder, children)
        archive = tools.selSPEA2(archive + children, POPULATION)
    return np.array([one.fitness.values for one in archive])
