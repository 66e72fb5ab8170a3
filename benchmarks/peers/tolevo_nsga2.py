"""The array NSGA-II, asked and told directly, with the settings of pymoo's."""

from __future__ import annotations

import numpy as np

from tolevo.algorithms.engine import ArrayEngine, NSGA2Engine, Space
from tolevo.section import Array

from ..task import Recorder

DISTRIBUTION, LABEL = "tolevo", "array NSGA-II"
POPULATION = 100


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    rng, rate = np.random.default_rng(seed), 1.0 / len(recorder.low)
    engine = NSGA2Engine(space(recorder), POPULATION, rng, mutation=(rate, 20.0))
    return evolve(engine, recorder, budget)


def space(recorder: Recorder) -> Space:
    """The box, all of it real, as every contender is given it."""
    return Space(recorder.low, recorder.high, np.zeros(len(recorder.low), dtype=bool), 2)


def evolve(engine: ArrayEngine, recorder: Recorder, budget: int) -> Array:
    """The population's objectives when the budget is used."""
    none = np.empty((POPULATION, 0))
    for _ in range(budget // POPULATION):
        x = engine.ask()
        engine.tell(x, recorder.batch(x), none)
    return engine.f
