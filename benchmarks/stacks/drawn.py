"""Stacks drawn at random, with quantiles and yields among their limits, and what is best known.

The best known cost is that of `exact` and of a search that is told no form: SLSQP on the outputs
themselves, from random designs, in every process next to the best. Nothing of a bound takes part.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read_table
from tolevo.problems.forms import Form
from tolevo.problems.stack.problem import Stack
from tolevo.problems.tolerance_problem import ToleranceProblem

from ..outcome import kept_values

EVEN = ("uniform", "triangular", "trapezoid", "normal", "truncated_normal")
LIMITS = ("half-width", "root sum square", "worst case", "centred yield", "one-sided yield",
          "yield off the middle")  # fmt: skip
SHARES = 90.0, 95.0, 99.0, 99.73, 99.9
SIGMAS = 1.8
"""Limits of yields in root sums of squares of half-widths: so many are moderate."""
SKEWED, WITH_WAYS = 0.15, 0.25
"""Shares of the stacks with a skewed part, and with parts made by one of two processes."""
EVALUATIONS = 1500
"""Evaluations of the search that is told no form."""
ROUNDING = 1e-9
"""Share of a cost by which a bound may lie above it."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """A stack: how its requirements are limited, whether the theorem's conditions hold, results.

    `best` is the best known cost, inf where no design is found that keeps the limits; `gap` what
    `exact` proves of its own design [percent].
    """

    seed: int
    limits: tuple[str, ...]
    even: bool
    ways: bool
    best: float
    bound: float
    gap: float
    seconds: float

    @property
    def found(self) -> bool:
        """Whether any design is known that keeps the limits."""
        return bool(np.isfinite(self.best))

    @property
    def exact(self) -> bool:
        """Whether the gap is to vanish: even deviations, yields centred or one-sided."""
        return self.even and LIMITS[-1] not in self.limits

    @property
    def sound(self) -> bool:
        """Whether the bound is not above the best known cost."""
        return bool(self.bound <= self.best * (1.0 + ROUNDING))


class Formless(Stack):
    """A stack that does not tell its form."""

    def form(self) -> Form | None:
        return None

    def guide(self) -> Form | None:
        return None


def tables(rng: np.random.Generator) -> tuple[dict[str, Any], tuple[str, ...], bool, bool]:
    """A configuration, the kinds of its limits, whether all deviations are even, and any ways."""
    parts = int(rng.integers(2, 11))
    count = int(rng.integers(1, min(parts, 3) + 1))
    kinds = tuple(rng.choice(LIMITS, count).tolist())
    skewed, several = rng.random() < SKEWED, rng.random() < WITH_WAYS
    slopes = rng.uniform(0.3, 2.0, (count, parts)) * rng.choice([-1.0, 1.0], (count, parts))
    slopes *= (rng.random((count, parts)) < 0.7) | (np.arange(parts) % count
                                                    == np.arange(count)[:, None])  # fmt: skip
    rows = [_part(at, slopes[:, at], several and at < 3, rng) for at in range(parts)]
    if skewed:
        rows[0] |= {"distribution": "skew_normal", "skew": 3.0}
    loose = np.array([max(way["t_max"] for way in row.get("process", [row])) for row in rows])
    tight = np.array([min(way["t_min"] for way in row.get("process", [row])) for row in rows])
    limits: dict[str, Any] = {}
    requirements = []
    for at, kind in enumerate(kinds):
        share = rng.uniform(0.15, 0.5)
        wide = np.abs(slopes[at]) * (tight + share * (loose - tight))
        size = float(np.sum(wide) if kind == "worst case" else np.linalg.norm(wide))
        own, asked = _limited(kind, size, rng)
        requirements.append({"name": f"r{at}", "unit": "mm"} | own)
        limits[f"r{at}"] = asked
    found = {
        "problem": "stack", "objectives": {"minimise": ["cost"]}, "limits": limits,
        "requirement": requirements, "part": rows, "algorithm": {"name": "exact"},
        "propagation": {"coverage": float(rng.choice(SHARES)) / 100.0},
    }  # fmt: skip
    return found, kinds, not skewed, several


def _limited(kind: str, size: float, rng: np.random.Generator) -> tuple[dict[str, Any], dict[str, float]]:
    """What a requirement says of itself, and its limit."""
    methods = {"half-width": "monte_carlo", "worst case": "worst_case"}
    if "yield" not in kind:
        return {"method": methods.get(kind, "rss")}, {"variation": size}
    share = float(rng.choice(SHARES))
    room = SIGMAS * size
    off = rng.uniform(1.05, 1.8)
    ends = {
        "centred yield": {"lower": -room, "upper": room},
        "one-sided yield": {"upper": room} if rng.random() < 0.5 else {"lower": -room},
        "yield off the middle": {"lower": -room, "upper": off * room},
    }[kind]
    return {"method": "rss", "nominal": 0.0} | ends, {"yield_percent": share}


def _part(at: int, slopes: Any, several: bool, rng: np.random.Generator) -> dict[str, Any]:
    low = 0.01 * rng.uniform(0.5, 2.0)
    found: dict[str, Any] = {
        "name": f"p{at}", "unit": "mm", "distribution": str(rng.choice(EVEN)),
        "sensitivity": {f"r{i}": float(s) for i, s in enumerate(slopes) if s != 0.0},
    }  # fmt: skip
    ways = [
        {"t_min": low * fine, "t_max": 30.0 * low * fine,
         "cost": {"model": "reciprocal", "a": float(base), "b": float(rng.uniform(0.5, 3.0) * low)}}
        for fine, base in ((1.0, rng.uniform(1.0, 2.0)), (2.0, rng.uniform(0.5, 1.5)))
    ]  # fmt: skip
    if several:
        return found | {"process": [way | {"name": f"w{i}"} for i, way in enumerate(ways)]}
    return found | ways[0]


def problem_of(table: dict[str, Any]) -> Stack:
    problem = read_table(table, []).problem
    assert isinstance(problem, Stack)
    return problem


def run(seed: int) -> Drawn:
    """One stack."""
    start = time.process_time()
    table, kinds, even, several = tables(np.random.default_rng(seed))
    problem = problem_of(table)
    own = _cheapest(problem, Budget(evaluations=EVALUATIONS), seed)
    other = _cheapest(Formless(problem.given), Budget(evaluations=EVALUATIONS), seed)
    found = proof(problem, {"cost": np.array([np.inf])}, 1)
    bound = float(found.bound[0])
    gap = 100.0 * (own - bound) / bound
    seconds = time.process_time() - start
    return Drawn(seed, kinds, even, several, min(own, other), bound, gap, seconds)


def _cheapest(problem: ToleranceProblem, budget: Budget, seed: int) -> float:
    """Cost of the cheapest design found that keeps the limits by the outputs, inf for none."""
    found = search(problem, Exact(), budget, seed)
    x = np.vstack([found.x, found.chosen])
    if not len(x):
        return float("inf")
    return float(np.min(kept_values(problem, x)["cost"], initial=np.inf))
