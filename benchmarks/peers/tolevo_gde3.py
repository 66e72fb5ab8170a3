"""The array GDE3, asked and told directly, with the settings of pymoo's row."""

from __future__ import annotations

import numpy as np

from tolevo.algorithms.engine import GDE3Engine
from tolevo.section import Array

from ..task import Recorder
from .tolevo_nsga2 import POPULATION, evolve, space

DISTRIBUTION, LABEL = "tolevo", "array GDE3 CR 0.9"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    rng = np.random.default_rng(seed)
    return evolve(GDE3Engine(space(recorder), POPULATION, rng, rate=0.9), recorder, budget)
