"""GDE3 of pymoo by `minimize`, with the crossover rate that suits these problems."""

from __future__ import annotations

from pymoo.algorithms.moo.gde3 import GDE3
from pymoo.optimize import minimize

from tolevo.section import Array

from ..task import Recorder
from .pymoo_nsga2 import Batch

DISTRIBUTION, LABEL = "pymoo", "GDE3 CR 0.9"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    algorithm = GDE3(pop_size=100, CR=0.9)
    values: Array = minimize(Batch(recorder), algorithm, ("n_eval", budget), seed=seed).F
    return values
