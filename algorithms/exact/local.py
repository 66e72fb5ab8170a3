"""Local searches by SLSQP: a problem in scaled coordinates with its derivatives, and one branch of a front."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy
from scipy.special import ndtri

from ...journal import recall_columns
from ...problems.limits import Limit
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array, Flags
from ..archive import nondominated
from ..run import Run
from ..settings import Budget
from .slsqp import slsqp

# A problem in the form for SLSQP: scaled coordinates, values and derivatives at one design.


STEP = 1e-4
"""Finite difference in scaled coordinates: above the noise of a propagation, below its curvature."""
MIN_TAIL_PROBABILITY = 1e-10
"""Fraction of units outside of their limits below which a yield no longer matters."""


@dataclass(eq=False)
class Smooth:
    """The continuous variables of a problem at fixed integers `x`, scaled to y in [0, 1]; those `held`
    (variables,) stay as they are in `x`.

    A tolerance above zero is scaled by its logarithm. Derivatives are those of the model where it
    has them for all objectives and limits, else one batch of forward differences. The least value of a
    percentage is constrained by its `probits`.
    """

    run: Run
    x: Array
    held: Flags | None = None
    _values: tuple[Array, Array, Array] | None = field(default=None, init=False)
    _slopes: tuple[Array, Array, Array] | None = field(default=None, init=False)
    _rates: Array = field(default_factory=lambda: np.ones(0), init=False)

    def __post_init__(self) -> None:
        problem = self.run.problem
        whole = np.array([v.integer for v in problem.free])
        self.moving = ~whole if self.held is None else ~(whole | self.held)
        ends = np.where(self.moving, [problem.xl, problem.xu], self.x)
        moving = [v for v, moves in zip(problem.free, self.moving, strict=True) if moves]
        self.columns = [problem.names.index(v.name) for v in moving]
        self.low, self.high = problem.complete(ends)[:, self.columns]  # the ranges at these integers
        self.log = np.array([v.tolerance for v in moving], dtype=bool) & (self.low > 0.0)
        names = {*problem.objectives, *(limit.name for limit in problem.limits)}
        known = {*problem.slopes(problem.complete(self.x[None, :])[:0]), *problem.names}
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
        slopes = recall_columns((designs,), lambda: dict(problem.slopes(designs)))
        slopes |= {name: unit for name, unit in _units(problem).items() if name not in slopes}
        columns, width = self.columns, self.high - self.low
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
    z, z0 = (-ndtri(0.5 * np.clip(q, MIN_TAIL_PROBABILITY, 1.0)) for q in (tail, most))
    inside = (tail > MIN_TAIL_PROBABILITY) & (tail < 1.0)
    fall = np.where(inside, 0.01 * low * 0.5 * np.sqrt(2.0 * np.pi) * np.exp(0.5 * z**2), 0.0)
    return np.where(asked, 1.0 - z / z0, g), np.where(asked, fall / z0, 1.0)


def _percentages(limit: Limit) -> list[float]:
    """The least percentage of each side of a limit, NaN where it is none."""
    least = limit.low if limit.of_percentage and 0.0 < limit.low < 100.0 * (1.0 - MIN_TAIL_PROBABILITY) else np.nan
    return [end for side, end in ((limit.low, least), (limit.high, np.nan)) if np.isfinite(side)]


def _ratio(smooth: Smooth) -> Array:
    return np.asarray(np.where(smooth.log, smooth.high / np.where(smooth.log, smooth.low, 1.0), 1.0))


def _units(problem: ToleranceProblem) -> dict[str, Array]:
    """Derivatives (1, all variables) of the variables themselves, which may be limited too."""
    unit = np.eye(len(problem.names))
    return {name: unit[at][None, :] for at, name in enumerate(problem.names)}


# One branch of a front by epsilon-constraints: its points at one set of integers.


STARTS, TRIES = 32, 3
"""Random designs per set of integers, and how many of them a search is begun from at most."""
RESTORED, NEARLY = 4, 1e-3
"""Steps back to limits that SLSQP breaks, and the violation up to which they are taken."""
RESTARTS, GAINED = 3, 1e-3
"""Times that SLSQP restarts where it stopped on a sample, as long as it gains such a fraction: at a
kink it stops early, and a restart continues."""
SETTLED = 1e-5
"""Fraction of a value by which a restart gains at least, to be followed by another."""
HALVED = 10
"""Times that the step to a point which keeps the limits is halved, where nothing else keeps them."""
VIOLATION_TOLERANCE = 1e-6
"""Violation of a limit that counts as none."""
ANALYTIC, NUMERIC, SAMPLED = (1e-7, 40), (1e-5, 15), (1e-5, 40, 25)
"""Tolerance and most steps of SLSQP, with derivatives of the model, with differences, and on the
average of a sample, which has kinks: there most evaluations as well."""


class Branch:
    """The front at one set of integers: points in the order of the second objective."""

    def __init__(self, run: Run, x: Array, unit: Array, held: Flags | None = None) -> None:
        self.smooth = Smooth(run, x, held)
        self.unit = unit
        self.y: list[Array] = []
        self.f: list[Array] = []
        self.barren: set[tuple[float, float]] = set()

    def on(self, problem: ToleranceProblem) -> Branch:
        """The same integers of another problem, without points."""
        return Branch(type(self.smooth.run)(problem, Budget(), seed=0), self.smooth.x, self.unit)

    def tightest(self, y: Array) -> Array:
        """The vector (size,) of a point with every tolerance at its tightest."""
        return np.where(self.smooth.log, 0.0, y)

    def minimise(self, objective: int, start: Array, limit: Array) -> Array | None:
        """Objectives (m,) of the least `objective` with f <= limit; recorded where it is feasible."""
        sampled = self.smooth.run.problem.declaration.sampled
        y = self.solved(objective, start, limit, np.zeros(1))
        f, g = self.smooth.values(y)
        for _ in range(RESTARTS if sampled else 0):
            again = self.solved(objective, y, limit, np.zeros(1))
            better, broken = self.smooth.values(again)
            wrong = np.any(g > NEARLY) or np.any(f > limit + NEARLY * self.unit)
            gained = better[objective] < f[objective] - GAINED * abs(f[objective])
            right = np.all(broken <= NEARLY) and np.all(better <= limit + NEARLY * self.unit)
            if not (wrong or (gained and right)):
                break
            y, f, g = again, better, broken
        if sampled and len(f) == 1 and np.any(g > NEARLY):  # the kinks of a few units
            y = self.moved_inside(y, start, lambda at: not np.any(self.smooth.values(at)[1] > 0.0))
            f, g = self.smooth.values(y)
        if np.any(g > (NEARLY if sampled else VIOLATION_TOLERANCE)):
            return None
        at = int(np.searchsorted([point[1] for point in self.f], f[1])) if len(f) > 1 else 0
        self.y.insert(at, y)
        self.f.insert(at, f)
        return f

    def moved_inside(self, y: Array, inside: Array, kept: Callable[[Array], bool]) -> Array:
        """A point (size,) moved to one `inside` by no more than it must be for it to be `kept`; as it is where that one
        is not.
        """
        if kept(y) or not kept(inside):
            return y
        low, high = 0.0, 1.0
        for _ in range(HALVED):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if kept(y + middle * (inside - y)) else (middle, high)
        return np.asarray(y + high * (inside - y))

    def solved(self, objective: int, start: Array, limit: Array, slack: Array) -> Array:
        """Where SLSQP ends (size,) with f <= limit and violations of limits g <= -slack.

        `slack` fits (constraints,), normalised as they are.
        """
        limited, unit, smooth = np.isfinite(limit), self.unit, self.smooth

        def margins(y: Array) -> Array:
            f, g = smooth.values(y)
            return np.concatenate([(limit[limited] - f[limited]) / unit[limited], -g - slack])

        def margin_slopes(y: Array) -> Array:
            df, dg = smooth.slopes(y)
            return np.concatenate([-df[limited] / unit[limited, None], -dg])

        solution = slsqp(
            lambda y: float(smooth.values(y)[0][objective] / unit[objective]),
            lambda y: smooth.slopes(y)[0][objective] / unit[objective],
            margins,
            margin_slopes,
            start,
            (np.zeros(smooth.size), np.ones(smooth.size)),
            *self._effort,
        )
        return self.restored(solution.x, slack)

    @property
    def _effort(self) -> tuple[Any, ...]:
        if not self.smooth.analytic:
            return NUMERIC
        return SAMPLED if self.smooth.run.problem.declaration.sampled else ANALYTIC

    def restored(self, y: Array, slack: Array, most: float = NEARLY) -> Array:
        """A point near y that keeps the limits which SLSQP breaks by its tolerance.

        A design that breaks a limit by its last digits is not feasible, and would be discarded.
        """
        for _ in range(RESTORED):
            broken = (g := self.smooth.values(y)[1] + slack) > 0.0
            if not np.any(broken) or np.any(g > most):
                break
            step = np.linalg.lstsq(self.smooth.slopes(y)[1][broken], 1.1 * g[broken] + 1e-12)[0]
            y = np.clip(y - step, 0.0, 1.0)
        return y

    def adopt(self, x: Array, f: Array) -> None:
        """Take over designs (n, variables) of a front, in the order of the second objective."""
        self.y, self.f = list(self.smooth.scaled(x)), list(f)

    def begin(self, run: Run) -> None:
        """Solve the ends of the front, from the best starts of the problem or of random designs.

        With one objective, whose points have no neighbours as starts, all of them are tried.
        """
        none = np.full(len(self.unit), np.inf)
        y = self.starts(run)
        f, g = run.evaluate(self.smooth.vectors(y))
        broken = np.sum(np.maximum(g, 0.0), axis=1)
        for objective in range(min(2, len(self.unit))):
            order = np.lexsort([f[:, objective], broken])
            tries = min(TRIES, 2) if run.problem.declaration.sampled else TRIES
            starts = [*self.y, *y[order[:tries]]]
            for start in starts:
                end = self.minimise(objective, start, none)
                if end is not None and len(end) > 1:
                    self._settle(objective, end)
                    break
        if self.f and len(self.unit) == 1:
            self._improve()

    def _improve(self) -> None:
        """Restart at the least value where SLSQP stopped, as long as that gains."""
        for _ in range(RESTARTS):
            at = int(np.argmin([f[0] for f in self.f]))
            best = float(self.f[at][0])
            again = self.minimise(0, self.y[at], np.full(1, np.inf))
            if again is None or not again[0] < best - SETTLED * abs(best):
                return

    def starts(self, run: Run) -> Array:
        """Scaled coordinates (n, size) to begin from: first those of the run with the integers of the branch."""
        own = run.start[np.all(np.rint(run.start) == np.rint(self.smooth.x), axis=1, where=~self.smooth.moving)]
        given = self.smooth.scaled(own[np.unique(np.linspace(0, len(own) - 1, min(len(own), STARTS)).astype(int))])
        provided = run.problem.starts()
        if len(provided):
            free = [run.problem.names.index(v.name) for v in run.problem.free]
            return np.vstack([given, self.smooth.scaled(provided[:, free])])
        names = [variable.name for variable in run.problem.free if not variable.integer]
        drawn = run.rng.random((STARTS, self.smooth.size))[:, np.argsort(np.argsort(names))]
        return np.vstack([given, np.full(self.smooth.size, 0.5), drawn])

    def at_most(self, objective: int, value: float) -> Array:
        """Limits (m,) that hold one objective at a value and leave the others free."""
        limit = np.full(len(self.unit), np.inf)
        limit[objective] = value
        return limit

    def _settle(self, objective: int, end: Array) -> None:
        """Minimise the other of two objectives at the end of the front of one."""
        if len(end) != 2:
            return
        at = next(i for i, f in enumerate(self.f) if f is end)
        level = end[objective] + 1e-9 * self.unit[objective]
        self.minimise(1 - objective, self.y[at], self.at_most(objective, level))

    def nearest(self, level: float) -> Array:
        """Scaled coordinates (size,) of the point whose second objective is nearest to a level."""
        return self.y[int(np.argmin([abs(f[1] - level) for f in self.f]))]

    def widest(self, others: Array | None = None) -> tuple[float, int]:
        """The largest rectangle between neighbours, and the index of its first point.

        Rectangles without a point inside are omitted, and those whose best corner is dominated by
        one of the `others` (n, objectives).
        """
        if len(self.f) < 2:
            return 0.0, 0
        points = np.array(self.f)
        f = points / self.unit
        area = np.abs(np.diff(f[:, 0]) * np.diff(f[:, 1]))
        area[[self._key(at) in self.barren for at in range(len(area))]] = 0.0
        if others is not None:
            corner = np.minimum(points[:-1], points[1:])
            beaten = np.all(others[:, None, :] < corner[None, :, :], axis=2).any(axis=0)
            area[beaten] = 0.0
        return float(area.max()), int(np.argmax(area))

    def _key(self, at: int) -> tuple[float, float]:
        return float(self.f[at][1]), float(self.f[at + 1][1])

    def halve(self, others: Array | None = None) -> bool:
        """Solve half-way in the largest rectangle (see `widest`); whether there was one."""
        area, at = self.widest(others)
        if area <= 0.0:
            return False
        key = self._key(at)
        between = 0.5 * (self.y[at] + self.y[at + 1])
        objectives = self.minimise(0, between, self.at_most(1, 0.5 * (key[0] + key[1])))
        if objectives is None or not key[0] < objectives[1] < key[1]:
            self.barren.add(key)
        return True

    def between(self, count: int) -> Array:
        """Search vectors (about count, variables) interpolated along the front."""
        f = np.array(self.f) / self.unit
        if len(f) < 2 or f.shape[1] != 2:
            return self.smooth.vectors(np.array(self.y))
        steps = np.hypot(*np.diff(f, axis=0).T)
        length = np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-12))])
        course = scipy.interpolate.PchipInterpolator(length, np.array(self.y), axis=0)
        return self.smooth.vectors(course(np.linspace(0.0, length[-1], count)))


def joint_front_points(branches: list[Branch]) -> list[tuple[Branch, int]]:
    """Branch and index of the points that no point of any branch dominates, by objective 2, 1."""
    places = [(branch, at) for branch in branches for at in range(len(branch.f))]
    f = np.array([branch.f[at] for branch, at in places])
    rows = np.flatnonzero(nondominated(f))
    return [places[int(row)] for row in rows[np.lexsort(f[rows].T)]]


def joint_front(branches: list[Branch]) -> Array:
    """Objectives (n, objectives) of the points that no point of any branch dominates."""
    return np.array([branch.f[at] for branch, at in joint_front_points(branches)])
