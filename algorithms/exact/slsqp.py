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
    """Where SLSQP stopped: x (n,) and multipliers (constraints,) >= 0."""

    x: Array
    multiplier: Array


def slsqp(
    objective: Callable[[Array], float],
    slopes: Callable[[Array], Array],
    margins: Callable[[Array], Array],
    margin_slopes: Callable[[Array], Array],
    start: Array,
    ends: tuple[Array, Array],
    tolerance: float,
    iterations: int,
) -> Found:
    """Minimise an objective between `ends`, each (n,), with margins (constraints,) >= 0.

    `slopes` (n,) and `margin_slopes` (constraints, n) are their derivatives.
    """
    low, high = ends
    found = _minimize(
        objective,
        np.clip(start, low, high),
        jac=slopes,
        bounds=optimize.Bounds(low, high),
        constraints=[{"type": "ineq", "fun": margins, "jac": margin_slopes}],
        method="SLSQP",
        options={"ftol": tolerance, "maxiter": iterations},
    )
    multiplier = np.maximum(np.asarray(found.multipliers, dtype=float), 0.0)
    return Found(np.clip(found.x, low, high), multiplier)


def ascend(dual: Callable[[Array], float], start: Array) -> Array:
    """Maximise a concave function of x >= 0 by L-BFGS-B (Byrd, Lu, Nocedal & Zhu 1995)."""
    bounds = optimize.Bounds(np.zeros(len(start)), np.full(len(start), np.inf))
    found = _minimize(lambda x: -dual(x), start, bounds=bounds, method="L-BFGS-B")
    return np.asarray(np.maximum(found.x, 0.0), dtype=float)
