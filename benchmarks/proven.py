"""`hybrid` against the proven optimum: 4 parts, 36 process sets, least cost under one limit.

What is proven: branch and bound of `exact` (choices.least_cost), and apart from it the best of all
36 sets, each by the root of its price. A seed counts where it finds the optimum at all limits.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from scipy.optimize import brentq
from scipy.special import ndtri

from tolevo.algorithms.exact.choices import least_cost
from tolevo.algorithms.hybrid import Hybrid
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read
from tolevo.problems.settings import Bound, Settings
from tolevo.problems.tolerance_problem import ToleranceProblem
from tolevo.section import Array

from .parts import Parts, WatchedParts
from .tasks.mixed_process import PARTS, evaluate

LIMITS = (0.02, 0.03, 0.045, 0.06, 0.08, 0.11, 0.15, 0.2)
"""Limits on the variation [mm]; its range is 0.0125 to 0.25."""
EVALUATIONS = 4000
CONFORMING = 99.73
"""Yield that is asked for [%]."""


@dataclass(frozen=True, slots=True)
class Case:
    """How the limit is set, and how near to the optimum's cost counts as the optimum.

    The processes must be those of the optimum.
    """

    text: str
    problem: Callable[[float], ToleranceProblem]
    limits: tuple[float, ...]
    near: float
    promised: bool


@dataclass(frozen=True, slots=True)
class Found:
    """One run: cost over the proven optimum minus 1, inf where nothing keeps the limit."""

    seed: int
    excess: float
    optimal: bool


def cases(quick: bool) -> Iterator[tuple[Case, list[Found]]]:
    seeds, every = (3, 4) if quick else (10, 1)
    limits = LIMITS[::every]
    for case in (
        Case("limit on variation", limited, limits, 1e-9, True),
        Case("limit on variation, no form and no exact seed", formless, limits, 1e-6, False),
        Case("limit on yield, relaxed form", conforming, limits[::2], 3e-2, False),
    ):
        yield case, [run(case, at, seed) for seed in range(1, seeds + 1) for at in case.limits]


def run(case: Case, limit: float, seed: int) -> Found:
    problem = case.problem(limit)
    found = search(problem, Hybrid(), Budget(evaluations=EVALUATIONS), seed)
    if not len(found.f):
        return Found(seed, np.inf, False)
    at = int(np.argmin(found.f[:, 0]))
    chosen = np.rint(found.x[at, [variable.integer for variable in problem.free]])
    cost, ways = proven(limit)
    excess = float(found.f[at, 0]) / cost - 1.0
    return Found(seed, excess, abs(excess) <= case.near and np.array_equal(chosen, ways))


def proven(limit: float) -> tuple[float, Array]:
    """Least cost and the process of each part, by branch and bound."""
    best = least_cost(PARTS.form(), np.array([[limit]]))
    return float(best.cost[0]), best.chosen[0].astype(float)


def limited(limit: float) -> ToleranceProblem:
    """A stack as a user writes it."""
    return written({"limits": {"variation": limit}})


def conforming(limit: float) -> ToleranceProblem:
    """Limits of the requirement such that the wanted yield needs this variation.

    The requirement is normal with a third of the variation as standard deviation. The yield itself
    is estimated from a sample, so that the cost is met within the noise of that, 1 or 2 %.
    """
    half = limit / 3.0 * float(ndtri(0.5 + 0.005 * CONFORMING))
    ends = {"nominal": 0.0, "lower": -half, "upper": half}
    requirement = PARTS.tables()["requirement"] | ends
    return written({"requirement": requirement, "limits": {"yield_percent": CONFORMING}})


def formless(limit: float) -> ToleranceProblem:
    """The same, but nothing is known of its form."""
    settings = Settings(objectives=("cost",), limits={"variation": Bound(high=limit)})
    return WatchedParts(PARTS, evaluate, settings).watched(lambda _: None, formless=True)


def written(more: dict[str, Any]) -> ToleranceProblem:
    tables = PARTS.tables() | {"objectives": {"minimise": ["cost"]}} | more
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "stack.toml")
        path.write_text(tomli_w.dumps(tables | {"algorithm": {"name": "hybrid"}}), encoding="utf-8")
        problem = read(path).problem
    assert problem is not None
    return problem


def of_all_sets(parts: Parts, limit: float) -> float:
    """Least cost at a limit that binds, every process set on its own."""
    sets = product(*(range(count) for count in parts.ways))
    return min(of_set(parts, np.array(chosen), limit) for chosen in sets)


def of_set(parts: Parts, chosen: Any, limit: float) -> float:
    """Least cost of one process set, by the root of the price of its variation."""
    part = np.arange(len(parts.s))
    a, b = parts.a[part, chosen], parts.b[part, chosen]

    def tolerances(log_price: float) -> Any:
        t = np.cbrt(b / (2.0 * np.exp(log_price) * parts.s**2))
        return np.clip(t, parts.low, parts.high)

    def excess(log_price: float) -> float:
        return float(np.sqrt(((parts.s * tolerances(log_price)) ** 2).sum())) / limit - 1.0

    t = tolerances(float(brentq(excess, -10.0, 25.0, xtol=1e-14, rtol=1e-14)))
    return float((a + b / t).sum())
