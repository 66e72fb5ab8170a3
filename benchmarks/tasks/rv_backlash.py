"""`rv_backlash` as a plain function of 12 variables: cost against effective backlash.

The tooth modification is fixed at -0.04 and -0.07 mm, so that no limit is left: not every peer
takes constraints. Document B's formula as printed, by convolution, as a run searches. No closed
form is known: the best front is the union of long runs, kept in rv_backlash_front.csv;
`python -m benchmarks.tasks.rv_backlash` makes it anew.
"""

from __future__ import annotations

from pathlib import Path

import moocore
import numpy as np

from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Settings, VariableSetting

from ..parts import Watched
from ..task import Array, Task

STORED = Path(__file__).with_name("rv_backlash_front.csv")
FIXED = {"dr_rp_mm": -0.04, "dr_p_mm": -0.07}


class WatchedRv(Watched, RvBacklash):
    """The problem whose evaluations are noted."""


def problem() -> RvBacklash:
    return RvBacklash(settings())


def watched() -> WatchedRv:
    return WatchedRv(settings())


def settings() -> Settings:
    fixed = {name: VariableSetting(value=value) for name, value in FIXED.items()}
    return Settings(parameters={"reading": "printed"}, variables=fixed)


def rv_backlash() -> Task:
    whole = problem()

    def evaluate(x: Array) -> Array:
        return whole.objective_values(whole.outputs_of(whole.complete(x), searching=True))

    note = "cost and effective backlash of the RV-40E-121; front: union of long runs"
    front = np.loadtxt(STORED, delimiter=",")
    return Task("rv_backlash", whole.xl, whole.xu, evaluate, front, note, watched)


def long_runs() -> Array:
    """Front (k, 2) of 3 long runs each of GDE3 and NSGA-II, in bounded steps of the objectives."""
    from pymoo.algorithms.moo.gde3 import GDE3
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.optimize import minimize

    found = []
    for seed in range(3):
        for algorithm in (GDE3(pop_size=400, CR=0.9), NSGA2(pop_size=400)):
            found.append(minimize(problem(), algorithm, ("n_gen", 600), seed=seed).F)
    union = np.vstack(found)
    best: Array = union[moocore.is_nondominated(union, keep_weakly=False)]
    return best[np.argsort(best[:, 1])]


if __name__ == "__main__":
    np.savetxt(STORED, long_runs(), delimiter=",", fmt="%.12g")
