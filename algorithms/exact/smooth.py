"""A problem in the form for SLSQP: scaled coordinates, values and derivatives at one design."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...arrays import Array
from ...problems.interfaces import Differentiable
from ...problems.tolerance_problem import ToleranceProblem
from ..run import Run

STEP = 1e-4
"""Finite difference in scaled coordinates: above the noise of a propagation, below its curvature."""


@dataclass(eq=False)
class Smooth:
    """The continuous variables of a problem at fixed integers `x`, scaled to y in [0, 1].

    A tolerance above zero is scaled by its logarithm. Derivatives are those of the model where it
    has them for all objectives and limits, else one batch of forward differences.
    """

    run: Run
    x: Array
    _values: tuple[Array, Array, Array] | None = field(default=None, init=False)
    _slopes: tuple[Array, Array, Array] | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        problem = self.run.problem
        self.moving = np.array([not v.integer for v in problem.free])
        ends = np.where(self.moving, [problem.xl, problem.xu], self.x)
        free = [problem.names.index(v.name) for v in problem.free if not v.integer]
        self.low, self.high = problem.complete(ends)[:, free]  # the ranges at these integers
        kinds = [v.tolerance for v in problem.free if not v.integer]
        self.log = np.array(kinds, dtype=bool) & (self.low > 0.0)
        names = {*problem.objectives, *(limit.name for limit in problem.limits)}
        known = {*Differentiable.of(problem).gradient(problem.complete(self.x[None, :])[:0]), *problem.names}
        self.analytic = names <= known

    @property
    def size(self) -> int:
        """Number of scaled coordinates."""
        return int(self.moving.sum())

    def vectors(self, y: Array) -> Array:
        """Search vectors (n, variables) of scaled coordinates (n, size)."""
        y = np.clip(y, 0.0, 1.0)
        low, high = np.where(self.log, self.low, 1.0), np.where(self.log, self.high, 2.0)
        values = np.where(self.log, low * (high / low) ** y, self.low + (self.high - self.low) * y)
        x = np.tile(self.x, (len(y), 1))
        x[:, self.moving] = np.clip(values, self.low, self.high)
        return x

    def scaled(self, x: Array) -> Array:
        """Scaled coordinates (n, size) of search vectors (n, variables)."""
        t = x[:, self.moving]
        low, high = np.where(self.log, self.low, 1.0), np.where(self.log, self.high, 2.0)
        span, width = np.log(high / low), self.high - self.low  # 0 where a process holds one tolerance
        logs = np.log(np.where(self.log, t, 1.0) / low) / np.where(span > 0.0, span, 1.0)
        return np.clip(np.where(self.log, logs, (t - self.low) / np.where(width > 0.0, width, 1.0)), 0.0, 1.0)

    def values(self, y: Array) -> tuple[Array, Array]:
        """Objectives (m,) and constraints (k,) at y (size,); asked twice, evaluated once."""
        if self._values is None or not np.array_equal(self._values[0], y):
            f, g = self.run.evaluate(self.vectors(y[None, :]))
            self._values = y.copy(), f[0], g[0]
        return self._values[1:]

    def slopes(self, y: Array) -> tuple[Array, Array]:
        """Derivatives in y of the objectives (m, size) and constraints (k, size)."""
        if self._slopes is None or not np.array_equal(self._slopes[0], y):
            derivatives = self._exact(y) if self.analytic else self._differences(y)
            self._slopes = y.copy(), *derivatives
        return self._slopes[1:]

    def _exact(self, y: Array) -> tuple[Array, Array]:
        problem, x = self.run.problem, self.vectors(y[None, :])
        slopes = Differentiable.of(problem).gradient(problem.complete(x))
        slopes |= {name: unit for name, unit in _units(problem).items() if name not in slopes}
        columns = [problem.names.index(v.name) for v in problem.free if not v.integer]
        width = self.high - self.low
        rate = np.where(self.log, x[0, self.moving] * np.log(_ratio(self)), width)
        df = np.stack([slopes[name][0, columns] * rate for name in problem.objectives])
        rows = [sign * slopes[limit.name][0, columns] * rate for limit in problem.limits for sign in limit.slopes()]
        return df, np.array(rows).reshape(problem.n_ieq_constr, len(y))

    def _differences(self, y: Array) -> tuple[Array, Array]:
        base = self.values(y)
        step = np.where(y > 0.5, -STEP, STEP)
        moved = self.run.evaluate(self.vectors(y + np.diag(step)))
        df, dg = ((m - b).T / step for m, b in zip(moved, base, strict=True))
        return df, dg


def _ratio(smooth: Smooth) -> Array:
    return np.asarray(np.where(smooth.log, smooth.high / np.where(smooth.log, smooth.low, 1.0), 1.0))


def _units(problem: ToleranceProblem) -> dict[str, Array]:
    """Derivatives (1, all variables) of the variables themselves, which may be limited too."""
    unit = np.eye(len(problem.names))
    return {name: unit[at][None, :] for at, name in enumerate(problem.names)}
