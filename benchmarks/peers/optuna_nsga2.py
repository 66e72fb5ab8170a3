"""NSGA-II of Optuna, a trial at a time, its history in memory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import optuna

from tolevo.section import Array

from ..task import Recorder

DISTRIBUTION, LABEL = "optuna", "NSGA-II"


def run(recorder: Recorder, seed: int, budget: int) -> Array:
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    ends = tuple(zip(recorder.low.tolist(), recorder.high.tolist(), strict=True))

    def objectives(trial: optuna.Trial) -> Sequence[float]:
        x = [trial.suggest_float(f"x{at}", *pair) for at, pair in enumerate(ends)]
        values: list[float] = recorder.one(np.array(x)).tolist()
        return values

    sampler = optuna.samplers.NSGAIISampler(population_size=100, seed=seed)
    study = optuna.create_study(directions=["minimize", "minimize"], sampler=sampler)
    study.optimize(objectives, n_trials=budget)
    return np.array([trial.values for trial in study.best_trials])
