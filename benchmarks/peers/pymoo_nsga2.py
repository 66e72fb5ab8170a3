"""NSGA-II of pymoo by `minimize`, with its defaults."""

from __future__ import annotations

from typing import Any

from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.optimize import minimize

from tolevo.section import Array

from ..task import Recorder

DISTRIBUTION, LABEL = "pymoo", "NSGA-II"


class Batch(Problem):
    def __init__(self, recorder: Recorder) -> None:
        super().__init__(len(recorder.low), n_obj=2, xl=recorder.low, xu=recorder.high)
        self.recorder = recorder

    def __deepcopy__(self, memo: Any) -> Batch:
        return self  # pymoo copies algorithms, and they hold their problem

    def _evaluate(self, x: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"] = self.recorder.batch(x)


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    found = minimize(Batch(recorder), NSGA2(pop_size=100), ("n_eval", budget), seed=seed)
    values: Array = found.F
    return values
