"""configs/rv40e_backlash.toml as a function: cost against the backlash of units in contact.

512 units at 61 positions an evaluation, at most 5 % interfere. The best front is the best known:
what `exact` evaluated and found, kept in rv_reducer_front.csv; `python -m
benchmarks.tasks.rv_reducer` makes it anew.
"""

from __future__ import annotations

from pathlib import Path

import moocore
import numpy as np

from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.problems.rv_reducer import RvReducer
from tolevo.section import Array

from ..configured import Source
from ..parts import Watched
from ..task import Task

STORED = Path(__file__).with_name("rv_reducer_front.csv")
POINTS = 30
PATIENCE = 4.0
"""CPU time of a run in that of the other tasks: an evaluation takes milliseconds."""


class WatchedReducer(Watched, RvReducer):
    """The problem whose evaluations are noted."""


SOURCE = Source("rv40e_backlash.toml", WatchedReducer)


def rv_reducer() -> Task:
    front = np.loadtxt(STORED, delimiter=",")
    return SOURCE.task("rv_reducer", "cost and backlash of the RV-40E-121 in contact, 61 positions "
                       "of 512 units, at most 5 % interfere; front: best known", front,
                       PATIENCE)  # fmt: skip


def best_known() -> Array:
    """Front (k, 2) of all that `exact` evaluated, on the sample that a search sees."""
    problem = RvReducer(SOURCE.settings())
    found = search(problem, Exact(points=POINTS), Budget(), seed=1).f
    best: Array = found[moocore.is_nondominated(found, keep_weakly=False)]
    return best[np.argsort(best[:, 1])]


if __name__ == "__main__":
    np.savetxt(STORED, best_known(), delimiter=",", fmt="%.12g")
