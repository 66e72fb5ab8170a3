"""Forms of few parts, each a + b/t, whose least cost follows by hand or by looking at all ways."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize

from tolevo.models.costs import CostCurve, Reciprocal
from tolevo.problems.forms import Feature, Form, Way

minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only
Array = NDArray[np.float64]
INF = np.inf


@dataclass(frozen=True)
class Priced(CostCurve):
    """a + b/t, said to be given by the prices of its square."""

    a: float
    b: float

    @property
    def priced(self) -> bool:
        return True

    def cost(self, t: Array) -> Array:
        return self.a + self.b / t

    def slope(self, t: Array) -> Array:
        return -self.b / t**2


def way(
    a: float,
    b: float,
    low: float,
    high: float,
    linear: Sequence[float],
    spread: Sequence[float],
    curve: type[Priced] | type[Reciprocal] = Reciprocal,
) -> Way:
    """One way of a part, with a number per requirement of each coefficient."""
    return Way(curve(a, b), low, high, tuple(linear), tuple(spread))


def form(*features: Sequence[Way], correlation: float | None = None, **more: Any) -> Form:
    """A form of these ways, one tuple per part; a correlation is that of the first two parts."""
    rows, matrix = len(features[0][0].linear), None
    if correlation is not None:
        matrix = np.eye(len(features))
        matrix[0, 1] = matrix[1, 0] = correlation
    parts = tuple(Feature(f"t{at}", tuple(ways), f"c{at}") for at, ways in enumerate(features))
    names = tuple(f"v{row}" for row in range(rows))
    return Form(names, parts, np.zeros(rows), np.zeros(rows), "", correlation=matrix, **more)


def rough_or_fine(parts: int, seed: int = 0, ways: int = 3) -> Form:
    """Two sums of tolerances in the worst case, each way dearer and tighter than the one before."""
    rng = np.random.default_rng(seed)
    features = []
    for _ in range(parts):
        linear, b = rng.uniform(0.3, 2.0, 2).tolist(), rng.uniform(0.5, 2.0)
        ends = [(0.1 * 0.5**at, 2.0 * 0.7**at) for at in range(ways)]
        features.append([way(0.7 * at, b * 0.5**at, low, high, linear, (0.0, 0.0))
                         for at, (low, high) in enumerate(ends)])  # fmt: skip
    return form(*features)


def by_hand(own: Form, limit: Sequence[float]) -> float:
    """Least cost by SLSQP in t for every set of ways of a form of sums in the worst case."""
    best = INF
    for chosen in itertools.product(*(feature.ways for feature in own.features)):
        low, high = np.array([w.low for w in chosen]), np.array([w.high for w in chosen])
        m = np.array([w.linear for w in chosen]).T
        b = np.array([w.curve.b for w in chosen])  # type: ignore[attr-defined]
        if np.any(m @ low > limit):
            continue
        found = minimize(
            lambda t, b=b: np.sum(b / t), low, jac=lambda t, b=b: -b / t**2,
            bounds=np.stack([low, high], axis=1), method="SLSQP",
            constraints=[{"type": "ineq", "fun": lambda t, m=m: limit - m @ t,
                          "jac": lambda t, m=m: -m}],
            options={"ftol": 1e-13, "maxiter": 400},
        )  # fmt: skip
        best = min(best, float(found.fun) + sum(w.curve.a for w in chosen))  # type: ignore[attr-defined]
    return best


def unused(*_: object, **__: object) -> Any:
    """For what a test says is not needed."""
    pytest.fail("not needed here")
