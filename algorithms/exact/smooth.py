"""A problem in the form for SLSQP: scaled coordinates, values and derivatives at one design."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtri

from ...arrays import Array
from ...journal import recalled_columns
from ...problems.interfaces import Differentiable
from ...problems.limits import Limit
from ...problems.tolerance_problem import ToleranceProblem
from ..run import Run

STEP = 1e-4
"""Finite difference in scaled coordinates: above the noise of a propagation, below its curvature."""
SURE = 1e-10
"""Fraction of units outside of their limits below which a yield no longer matters."""


@dataclass(eq=False)
class Smooth:
    """The continuous variables of a problem at fixed integers `x`, scaled to y in [0, 1].

    A tolerance above zero is scaled by its logarithm. Derivatives are those of the model where it
    has them for all objectives and limits, else one batch of forward differences. The least value of a
    percentage is constrained by its `probits`.
    """

    run: Run
    x: Array
    _values: tuple[Array, Array, Array] | None = field(default=None, init=False)
    _slopes: tuple[Array, Array, Array] | None = field(default=None, init=False)
    _rates: Array = field(default_factory=lambda: np.ones(0), init=False)

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
        sides = [bound for limit in problem.limits for bound in _percentages(limit)]
        self.least = np.array([] if problem.declaration.sampled else sides)

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
            constraints, self._rates = self.constraints(g[0])
            self._values = y.copy(), f[0], constraints
        return self._values[1:]

    def constraints(self, g: Array) -> tuple[Array, Array]:
        """Constraints (k,) by which a search keeps limits, and their derivatives by its violations g (k,)."""
        return probits(g, self.least) if np.any(np.isfinite(self.least)) else (g, np.ones_like(g))

    def slopes(self, y: Array) -> tuple[Array, Array]:
        """Derivatives in y of the objectives (m, size) and constraints (k, size)."""
        if self._slopes is None or not np.array_equal(self._slopes[0], y):
            derivatives = self._exact(y) if self.analytic else self._differences(y)
            self._slopes = y.copy(), *derivatives
        return self._slopes[1:]

    def _exact(self, y: Array) -> tuple[Array, Array]:
        problem, x = self.run.problem, self.vectors(y[None, :])
        designs = problem.complete(x)
        slopes = recalled_columns((designs,), lambda: dict(Differentiable.of(problem).gradient(designs)))
        slopes |= {name: unit for name, unit in _units(problem).items() if name not in slopes}
        columns = [problem.names.index(v.name) for v in problem.free if not v.integer]
        width = self.high - self.low
        rate = np.where(self.log, x[0, self.moving] * np.log(_ratio(self)), width)
        df = np.stack([slopes[name][0, columns] * rate for name in problem.objectives])
        rows = [sign * slopes[limit.name][0, columns] * rate for limit in problem.limits for sign in limit.slopes()]
        dg = np.array(rows).reshape(problem.n_ieq_constr, len(y))
        self.values(y)
        return df, dg * self._rates[:, None]

    def _differences(self, y: Array) -> tuple[Array, Array]:
        base = self.values(y)
        step = np.where(y > 0.5, -STEP, STEP)
        f, g = self.run.evaluate(self.vectors(y + np.diag(step)))
        moved = f, np.array([self.constraints(row)[0] for row in g])
        df, dg = ((m - b).T / step for m, b in zip(moved, base, strict=True))
        return df, dg


def probits(g: Array, least: Array) -> tuple[Array, Array]:
    """1 - z/z0 (k,) of violations g (k,), and its derivative by them.

    z = -Phi^-1(q/2) of the fraction q outside of the limits is nearly in proportion to the inverse of
    the spread where the yield itself is flat: SLSQP would stop on the plateau near 100 percent. z0 is
    that of the `least` percentages (k,), NaN for limits of other kinds, which stay as they are.
    """
    asked = np.isfinite(least)
    low = np.where(asked, least, 50.0)
    tail, most = 1.0 - 0.01 * low * (1.0 - g), 1.0 - 0.01 * low
    z, z0 = (-ndtri(0.5 * np.clip(q, SURE, 1.0)) for q in (tail, most))
    inside = (tail > SURE) & (tail < 1.0)
    fall = np.where(inside, 0.01 * low * 0.5 * np.sqrt(2.0 * np.pi) * np.exp(0.5 * z**2), 0.0)
    return np.where(asked, 1.0 - z / z0, g), np.where(asked, fall / z0, 1.0)


def _percentages(limit: Limit) -> list[float]:
    """The least percentage of each side of a limit, NaN where it is none."""
    least = limit.low if limit.of_percentage and 0.0 < limit.low < 100.0 * (1.0 - SURE) else np.nan
    return [end for side, end in ((limit.low, least), (limit.high, np.nan)) if np.isfinite(side)]


def _ratio(smooth: Smooth) -> Array:
    return np.asarray(np.where(smooth.log, smooth.high / np.where(smooth.log, smooth.low, 1.0), 1.0))


def _units(problem: ToleranceProblem) -> dict[str, Array]:
    """Derivatives (1, all variables) of the variables themselves, which may be limited too."""
    unit = np.eye(len(problem.names))
    return {name: unit[at][None, :] for at, name in enumerate(problem.names)}
