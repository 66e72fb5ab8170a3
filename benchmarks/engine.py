# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""Array engines against pymoo on one core: `python benchmarks/engine.py`.

Cost sum a/t against the root sum of squares of s t, 9 parts, whose exact front is known (Lagrange).
All that is compared takes turns in this one process; medians of the seeds, CPU time. Watching the
hypervolume is not counted.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.moo.gde3 import GDE3
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.core.termination import NoTermination
from pymoo.operators.sampling.rnd import FloatRandomSampling

from tolevo.algorithms.archive import hypervolume
from tolevo.algorithms.engine import ArrayEngine, GDE3Engine, NSGA2Engine, Space

Array = NDArray[np.float64]
COST, SENSITIVITY = np.linspace(0.5, 2.0, 9), np.linspace(2.0, 0.5, 9)
LOW, HIGH = 0.02, 0.3
POPULATION, SEEDS, LIMIT = 100, 5, 15_000


def objectives(t: Array) -> Array:
    spread = np.sqrt(((SENSITIVITY * t) ** 2).sum(axis=1))
    return np.column_stack([(COST / t).sum(axis=1), spread])


class CostAndSpread(Problem):
    def __init__(self) -> None:
        super().__init__(n_var=9, n_obj=2, xl=LOW, xu=HIGH)

    def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"] = objectives(x)


def exact_front(count: int = 20_000) -> Array:
    multiplier = np.geomspace(1e-1, 1e7, count)[:, None]
    t = np.clip((COST / (2.0 * multiplier * SENSITIVITY**2)) ** (1.0 / 3.0), LOW, HIGH)
    return np.unique(objectives(t), axis=0)


FRONT = exact_front()
BOX = FRONT.min(axis=0), FRONT.max(axis=0)
BEST = hypervolume(FRONT, *BOX)


class OnArrays:
    def __init__(self, make: Callable[[Space, np.random.Generator], ArrayEngine], seed: int):
        space = Space(np.full(9, LOW), np.full(9, HIGH), np.zeros(9, dtype=bool), 2)
        self.engine = make(space, np.random.default_rng(seed))

    def step(self) -> None:
        x = self.engine.ask()
        self.engine.tell(x, objectives(x), np.zeros((len(x), 0)))

    def values(self) -> Array:
        return self.engine.f


class OnPymoo:
    def __init__(self, make: Callable[[], Any], seed: int) -> None:
        self.algorithm = make()
        self.algorithm.setup(CostAndSpread(), seed=seed, termination=NoTermination())

    def step(self) -> None:
        self.algorithm.next()

    def values(self) -> Array:
        return np.asarray(self.algorithm.pop.get("F"))


def gde3(low: float, high: float, rate: float = 0.9) -> Callable[[int], OnArrays]:
    return lambda seed: OnArrays(lambda space, rng: GDE3Engine(space, POPULATION, rng, rate, (low, high)), seed)


MUTATION = (1.0 / 9.0, 20.0)
COMPARED: dict[str, Callable[[int], OnArrays | OnPymoo]] = {
    "array NSGA-II": lambda seed: OnArrays(
        lambda space, rng: NSGA2Engine(space, POPULATION, rng, mutation=MUTATION), seed
    ),
    "pymoo NSGA-II": lambda seed: OnPymoo(lambda: NSGA2(POPULATION), seed),
    "array GDE3, F in [0, 1]": gde3(0.0, 1.0),
    "array GDE3, F in [0.2, 0.9]": gde3(0.2, 0.9),
    "array GDE3, F = 0.5": gde3(0.5, 0.5),
    "array GDE3, F in [0, 1], CR 0.5": gde3(0.0, 1.0, 0.5),
    "pymoo GDE3, CR 0.9": lambda seed: OnPymoo(lambda: GDE3(POPULATION, CR=0.9, sampling=FloatRandomSampling()), seed),
}


def run(search: OnArrays | OnPymoo) -> tuple[float, float, float, float]:
    """Evaluations and CPU seconds to 99 %, microseconds per evaluation, final share."""
    cpu, done, evaluations, seconds, share = 0.0, 0, np.nan, np.nan, 0.0
    while done < LIMIT:
        start = time.process_time()
        search.step()
        cpu += time.process_time() - start
        done += POPULATION
        share = hypervolume(search.values(), *BOX) / BEST
        if share >= 0.99 and np.isnan(evaluations):
            evaluations, seconds = done, cpu
    return evaluations, seconds, cpu / done * 1e6, share


def main() -> None:
    found: dict[str, list[tuple[float, ...]]] = {name: [] for name in COMPARED}
    for seed in range(SEEDS):
        for name, make in COMPARED.items():
            found[name].append(run(make(seed)))
    print(f"population {POPULATION}, {LIMIT} evaluations, medians of {SEEDS} seeds")
    medians = {name: np.median(rows, axis=0) for name, rows in found.items()}
    for name, (evaluations, seconds, each, share) in medians.items():
        reached = f"99 % after {evaluations:5.0f} evaluations, {seconds:.4f} s CPU"
        print(f"{name:32}{'99 % not reached' if np.isnan(seconds) else reached}; "
              f"{each:.1f} us/evaluation; {100.0 * share:.2f} % at the end")  # fmt: skip
    ratio = medians["pymoo NSGA-II"][2] / medians["array NSGA-II"][2]
    print(f"NSGA-II, CPU per evaluation: pymoo / array = {ratio:.1f} (at least 10 wanted)")


if __name__ == "__main__":
    main()
