"""SLSQP (Kraft 1988) of scipy, with exact derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from ...section import Array


@dataclass(frozen=True, slots=True)
class LocalOptimum:
    """Where SLSQP stopped: x (n,) and multipliers (constraints,) >= 0."""

    x: Array
    multiplier: Array


class _Enough(Exception):
    """The budget of evaluations is used up."""


class _Steps:
    """Counts evaluations and keeps the last whole step."""

    def __init__(self, objective: Callable[[Array], float], start: Array, most: int) -> None:
        self._objective, self.last, self._remaining = objective, start, most

    def objective(self, x: Array) -> float:
        self._remaining -= 1
        if self._remaining < 0:
            raise _Enough
        return self._objective(x)

    def keep(self, x: Array) -> None:
        self.last = np.array(x)


def slsqp(
    objective: Callable[[Array], float],
    slopes: Callable[[Array], Array],
    margins: Callable[[Array], Array],
    margin_slopes: Callable[[Array], Array],
    start: Array,
    ends: tuple[Array, Array],
    tolerance: float,
    iterations: int,
    evaluations: int = 10_000,
) -> LocalOptimum:
    """Minimise an objective between `ends`, each (n,), with margins (constraints,) >= 0.

    `slopes` (n,) and `margin_slopes` (constraints, n) are their derivatives. After so many
    `evaluations` the last whole step is the result: at a kink of a sample line searches do not end. Where nothing
    can move, the multipliers are zero.
    """
    low, high = ends
    if np.all(low >= high):
        only = np.clip(start, low, high)
        return LocalOptimum(only, np.zeros(len(margins(only))))
    steps = _Steps(objective, np.clip(start, low, high), evaluations)
    minimize: Any = scipy.optimize.minimize  # its stubs know arrays of one dimension only
    try:
        result = minimize(
            steps.objective,
            steps.last,
            jac=slopes,
            bounds=scipy.optimize.Bounds(low, high),
            constraints=[{"type": "ineq", "fun": margins, "jac": margin_slopes}],
            method="SLSQP",
            options={"ftol": tolerance, "maxiter": iterations},
            callback=steps.keep,
        )
    except _Enough:
        return LocalOptimum(np.clip(steps.last, low, high), np.zeros(0))
    multiplier = np.maximum(np.asarray(result.multipliers, dtype=float), 0.0)
    return LocalOptimum(np.clip(result.x, low, high), multiplier)


def ascend(
    dual: Callable[[Array], Any], start: Array, high: Array | float = np.inf, slopes: bool = False, **options: float
) -> Array:
    """Maximise a concave function of x (n,) from 0 to `high` by L-BFGS-B (Byrd, Lu, Nocedal & Zhu 1995).

    With `slopes` the function returns its value and its slopes (n,).
    """
    if not len(start):  # scipy refuses bounds of nothing
        return start

    def negative(x: Array) -> Any:
        if not slopes:
            return -dual(x)
        value, slope = dual(x)
        return -value, -slope

    bounds = scipy.optimize.Bounds(np.zeros(len(start)), np.broadcast_to(high, start.shape))
    minimize: Any = scipy.optimize.minimize
    result = minimize(negative, start, jac=slopes, bounds=bounds, method="L-BFGS-B", options=options)
    return np.asarray(np.maximum(result.x, 0.0), dtype=float)
