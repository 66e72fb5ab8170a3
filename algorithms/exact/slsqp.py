"""SLSQP (Kraft 1988) of scipy, with exact derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

Array = NDArray[np.float64]
_minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only


@dataclass(frozen=True, slots=True)
class Found:
    """Where SLSQP stopped: x (n,), multipliers (constraints,) >= 0, whether it converged."""

    x: Array
    multiplier: Array
    converged: bool


def slsqp(
    objective: Callable[[Array], tuple[float, Array]],
    margins: Callable[[Array], tuple[Array, Array]],
    start: Array,
    low: Array,
    high: Array,
    tolerance: float,
    iterations: int,
) -> Found:
    """Minimise an objective over low <= x <= high with margins >= 0.

    Both functions return values and derivatives: (n,) of the objective, (constraints, n) of the
    margins.
    """
    found = _minimize(
        lambda x: objective(x)[0],
        np.clip(start, low, high),
        jac=lambda x: objective(x)[1],
        bounds=optimize.Bounds(low, high),
        constraints=[
            {"type": "ineq", "fun": lambda x: margins(x)[0], "jac": lambda x: margins(x)[1]}
        ],
        method="SLSQP",
        options={"ftol": tolerance, "maxiter": iterations},
    )
    multiplier = np.maximum(np.asarray(found.multipliers, dtype=float), 0.0)
    return Found(np.clip(found.x, low, high), multiplier, bool(found.success))


def ascend(dual: Callable[[Array], float], start: Array) -> Array:
    """Maximise a concave function of x >= 0 by L-BFGS-B (Byrd, Lu, Nocedal & Zhu 1995)."""
    bounds = optimize.Bounds(np.zeros(len(start)), np.full(len(start), np.inf))
    found = _minimize(lambda x: -dual(x), start, bounds=bounds, method="L-BFGS-B")
    return np.asarray(np.maximum(found.x, 0.0), dtype=float)
