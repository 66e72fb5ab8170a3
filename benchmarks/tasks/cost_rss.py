"""Cost against the root sum of squares of 9 or 12 independent tolerances.

cost = sum_j a_j + b_j / t_j, variation = sqrt(sum_j S_j^2 t_j^2), 0.005 <= t_j <= 0.1 mm.

The front: where no bound acts, the derivatives of cost + m variation^2 vanish at
t_j = (b_j / (2 m S_j^2))^(1/3); clipped to the bounds this is optimal as well, since the problem is
separable and convex in t_j^2. A sweep of the multiplier m gives the whole front.
"""

from __future__ import annotations

import numpy as np

from tolevo.section import Array

from ..parts import Parts, WatchedParts
from ..task import Task

LOW, HIGH = 0.005, 0.1
POINTS = 20_000
A = np.array([1.86, 0.62, 1.21, 0.94, 1.55, 0.48, 2.03, 1.12, 0.77, 1.68, 0.55, 1.34])
B = np.array([0.041, 0.093, 0.012, 0.164, 0.027, 0.078, 0.019, 0.135, 0.056, 0.102, 0.033, 0.066])
S = np.array([1.0, 2.0, 0.5, 1.0, 0.8, 1.5, 0.3, 1.2, 0.6, 0.9, 1.8, 0.4])
"""Coefficients [-], [mm] and sensitivities [-], drawn once between usual ends and rounded."""


def cost_rss(variables: int) -> Task:
    a, b, s = A[:variables], B[:variables], S[:variables]

    def evaluate(t: Array) -> Array:
        cost = a.sum() + (b / t).sum(axis=1)
        return np.stack([cost, np.sqrt((s * t) ** 2 @ np.ones(variables))], axis=1)

    note = f"cost and root sum of squares of {variables} tolerances; front by Lagrange"
    low, high = np.full(variables, LOW), np.full(variables, HIGH)
    front = evaluate(optima(b, s, POINTS))
    parts = Parts(a[:, None], b[:, None], s, LOW, HIGH)

    def problem() -> WatchedParts:
        return WatchedParts(parts, evaluate)

    return Task(f"{variables} variables", low, high, evaluate, front, note, problem, parts)


def optima(b: Array, s: Array, points: int) -> Array:
    """Pareto-optimal tolerances (points, variables)."""
    ends = [b / (2.0 * s**2 * t**3) for t in (HIGH, LOW)]
    multipliers = np.geomspace(ends[0].min(), ends[1].max(), points)[:, None]
    return np.clip(np.cbrt(b / (2.0 * multipliers * s**2)), LOW, HIGH)
