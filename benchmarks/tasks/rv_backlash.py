"""configs/rv40e_proven.toml as a function: cost against effective backlash, few interfere.

Document B's formula as printed, by convolution on the lattice of a report: on the coarser one of a
search more units interfere than in truth, and the proven front would break its limit. That front is
the best one: allocations of `exact` with a lower bound of the cost beside each, kept in
rv_backlash_front.csv; `python -m benchmarks.tasks.rv_backlash` makes it anew.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np

from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.models.propagation import Convolution, Propagation
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.section import Array

from ..configured import Source
from ..outcome import kept_values
from ..parts import Watched
from ..task import Task

STORED = Path(__file__).with_name("rv_backlash_front.csv")
POINTS = 60
PATIENCE = 4.0
"""CPU time of a run in that of the other tasks: an evaluation takes a millisecond."""


class WatchedRv(Watched, RvBacklash):
    """The problem whose evaluations are noted, in the accuracy of a report."""

    @cached_property
    def _searching(self) -> Propagation:
        return Convolution(errors=False)


SOURCE = Source("rv40e_proven.toml", WatchedRv)


def rv_backlash() -> Task:
    return SOURCE.task("rv_backlash", "cost and effective backlash of the RV-40E-121, at most 5 % "
                       "interfere; front: proven", stored()[:, :2], PATIENCE)  # fmt: skip


def stored() -> Array:
    """Cost, backlash ['] and the bound of the cost at that backlash (k, 3)."""
    return np.loadtxt(STORED, delimiter=",")


def proven() -> Array:
    """`stored`, anew: about a minute."""
    problem = RvBacklash(SOURCE.settings())
    found = search(problem, Exact(points=POINTS), Budget(), seed=1)
    out = kept_values(problem, found.chosen)
    values = {name: out[name] for name in problem.objectives}
    bound = proof(problem, values, POINTS).bound
    return np.column_stack([*values.values(), bound])


if __name__ == "__main__":
    np.savetxt(STORED, proven(), delimiter=",", fmt="%.12g")
