"""The front by epsilon-constraints, for models without closed form.

The first objective is minimised under limits on the others (Haimes, Lasdon & Wismer 1971) by SLSQP,
begun from the neighbours on the front. The rectangle between two neighbours is what their front can
still miss: the largest one is halved next. Between the points so found, the scaled tolerances are
interpolated along the front, which costs one evaluation a point. Integers are enumerated; sets of
them that contribute nothing to a coarse front are left.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from ...errors import refuse
from ...problems.tolerance_problem import ToleranceProblem
from ..indicators import nondominated
from ..run import Run
from .slsqp import slsqp
from .smooth import Smooth

Array = NDArray[np.float64]
SETS = 64
"""Sets of integers that are enumerated at most."""
COARSE = 5
"""Points per set of integers before sets are left."""
SOLVED = 48
"""Points that are solved; the others are interpolated between them."""
STARTS, TRIES = 32, 3
"""Random designs per set of integers, and how many of them a search is begun from at most."""
RESTORED, NEARLY = 4, 1e-3
"""Steps back to limits that SLSQP breaks, and the violation up to which they are taken."""
ANALYTIC, NUMERIC = (1e-7, 40), (1e-5, 15)
"""Tolerance and most steps of SLSQP, with derivatives of the model and with differences."""


class Branch:
    """The front at one set of integers: points in the order of the second objective."""

    def __init__(self, run: Run, x: Array, unit: Array) -> None:
        self.smooth = Smooth(run, x)
        self.unit = unit
        self.y: list[Array] = []
        self.f: list[Array] = []
        self.barren: set[tuple[float, float]] = set()

    def minimise(self, objective: int, start: Array, limit: Array) -> Array | None:
        """Objectives (m,) of the least `objective` with f <= limit; kept where it is feasible."""
        own, unit, smooth = np.isfinite(limit), self.unit, self.smooth

        def margins(y: Array) -> Array:
            f, g = smooth.values(y)
            return np.concatenate([(limit[own] - f[own]) / unit[own], -g])

        def margin_slopes(y: Array) -> Array:
            df, dg = smooth.slopes(y)
            return np.concatenate([-df[own] / unit[own, None], -dg])

        found = slsqp(
            lambda y: float(smooth.values(y)[0][objective] / unit[objective]),
            lambda y: smooth.slopes(y)[0][objective] / unit[objective],
            margins,
            margin_slopes,
            start,
            (np.zeros(smooth.size), np.ones(smooth.size)),
            *(ANALYTIC if smooth.analytic else NUMERIC),
        )
        y = self._restored(found.x)
        f, g = smooth.values(y)
        if np.any(g > 1e-6):
            return None
        at = int(np.searchsorted([one[1] for one in self.f], f[1])) if len(f) > 1 else 0
        self.y.insert(at, y)
        self.f.insert(at, f)
        return f

    def _restored(self, y: Array) -> Array:
        """A point beside y that keeps the limits which SLSQP breaks by its tolerance.

        A design that breaks a limit by the last digits is not feasible, and would be lost.
        """
        for _ in range(RESTORED):
            broken = (g := self.smooth.values(y)[1]) > 0.0
            if not np.any(broken) or np.any(g > NEARLY):
                break
            step = np.linalg.lstsq(self.smooth.slopes(y)[1][broken], 1.1 * g[broken] + 1e-12)[0]
            y = np.clip(y - step, 0.0, 1.0)
        return y

    def adopt(self, x: Array, f: Array) -> None:
        """Take over designs (n, variables) of a front, in the order of the second objective."""
        self.y, self.f = list(self.smooth.scaled(x)), list(f)

    def begin(self, run: Run) -> None:
        """The ends of the front, from the best of a few designs drawn at random.

        With one objective, which has no neighbours to begin from, all of them are tried.
        """
        none = np.full(len(self.unit), np.inf)
        y = np.vstack([np.full(self.smooth.size, 0.5), run.rng.random((STARTS, self.smooth.size))])
        f, g = run.evaluate(self.smooth.vectors(y))
        broken = np.sum(np.maximum(g, 0.0), axis=1)
        for objective in range(min(2, len(self.unit))):
            order = np.lexsort([f[:, objective], broken])
            starts = [*self.y, *y[order[:TRIES]]]
            for start in starts:
                end = self.minimise(objective, start, none)
                if end is not None and len(end) > 1:
                    self._settle(objective, end)
                    break

    def _settle(self, objective: int, end: Array) -> None:
        """The least of the other one of two objectives at the end of the front of one."""
        if len(end) != 2:
            return
        at = next(i for i, f in enumerate(self.f) if f is end)
        limit = np.full(2, np.inf)
        limit[objective] = end[objective] + 1e-9 * self.unit[objective]
        self.minimise(1 - objective, self.y[at], limit)

    def widest(self) -> tuple[float, int]:
        """The largest rectangle between neighbours, and the index of its first point.

        Rectangles in which nothing was found are left out.
        """
        if len(self.f) < 2:
            return 0.0, 0
        f = np.array(self.f) / self.unit
        area = np.abs(np.diff(f[:, 0]) * np.diff(f[:, 1]))
        area[[self._key(at) in self.barren for at in range(len(area))]] = 0.0
        return float(area.max()), int(np.argmax(area))

    def _key(self, at: int) -> tuple[float, float]:
        return float(self.f[at][1]), float(self.f[at + 1][1])

    def halve(self) -> bool:
        """Solve half-way in the largest rectangle; whether there was one."""
        area, at = self.widest()
        if area <= 0.0:
            return False
        key, limit = self._key(at), np.full(len(self.unit), np.inf)
        limit[1] = 0.5 * (key[0] + key[1])
        found = self.minimise(0, 0.5 * (self.y[at] + self.y[at + 1]), limit)
        if found is None or not key[0] < found[1] < key[1]:
            self.barren.add(key)
        return True

    def between(self, count: int) -> Array:
        """Search vectors (about count, variables) interpolated along the front."""
        f = np.array(self.f) / self.unit
        if len(f) < 2 or f.shape[1] != 2:
            return self.smooth.vectors(np.array(self.y))
        steps = np.hypot(*np.diff(f, axis=0).T)
        length = np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-12))])
        course = PchipInterpolator(length, np.array(self.y), axis=0)
        return self.smooth.vectors(course(np.linspace(0.0, length[-1], count)))


def epsilon_front(run: Run, points: int) -> None:
    """Evaluate designs along the front of a run's problem; `points` are spread over it."""
    problem = run.problem
    unit = scale_of(problem)
    branches = [Branch(run, x, unit) for x in integer_sets(problem)]
    for at, branch in enumerate(branches):
        run.phase("ends of the front", 0.2 * at / len(branches))
        branch.begin(run)
    alive = [branch for branch in branches if branch.f]
    if problem.n_obj == 1 or not alive:
        return
    for at, branch in enumerate(alive):
        run.phase("coarse front", 0.2 + 0.1 * at / len(alive))
        for _ in range(COARSE):
            branch.halve()
    alive = _contributing(alive)
    most = max(2, min(SOLVED, points)) * len(alive)
    for done in range(sum(len(branch.f) for branch in alive), most):
        run.phase("largest gaps of the front", 0.3 + 0.6 * done / most)
        if not max(alive, key=lambda branch: branch.widest()[0]).halve():
            break
    run.phase("points between", 0.9)
    for branch in alive:
        run.evaluate(branch.between(max(2, points // len(alive))))


def scale_of(problem: ToleranceProblem) -> Array:
    """Scale (m,) of the objectives."""
    ideal, nadir = problem.box()
    return np.maximum(nadir - ideal, 1e-12)


def integer_sets(problem: ToleranceProblem) -> list[Array]:
    """Search vectors (variables,) with every set of values of the integer variables.

    Raises InputError where there are more than `SETS`.
    """
    choices = [
        np.arange(np.ceil(low), np.floor(high) + 1.0) if v.integer else np.array([low])
        for v, low, high in zip(problem.free, problem.xl, problem.xu, strict=True)
    ]
    count = int(np.prod([float(len(choice)) for choice in choices]))
    if count > SETS:
        text = (f"exact enumerates at most {SETS} sets of integers where it has no closed form, "
                f"here are {count}: use hybrid, or fix some of them")  # fmt: skip
        raise refuse("algorithm.name", text)
    return [np.array(one) for one in itertools.product(*choices)]


def integer_moves(problem: ToleranceProblem, x: Array) -> list[Array]:
    """A search vector (variables,) and those that differ from it in one integer."""
    found = [x]
    for at, variable in enumerate(problem.free):
        if variable.integer:
            for value in np.arange(np.ceil(problem.xl[at]), np.floor(problem.xu[at]) + 1.0):
                if value != np.rint(x[at]):
                    other = x.copy()
                    other[at] = value
                    found.append(other)
    return found


def _contributing(branches: list[Branch]) -> list[Branch]:
    """The branches with a point on the joint front of their coarse points."""
    f = np.vstack([np.array(branch.f) for branch in branches])
    owner = np.repeat(np.arange(len(branches)), [len(branch.f) for branch in branches])
    kept = set(owner[nondominated(f)].tolist())
    return [branch for at, branch in enumerate(branches) if at in kept]
