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
TOLERANCE, ITERATIONS = 1e-7, 40


class Branch:
    """The front at one set of integers: points in the order of the second objective."""

    def __init__(self, run: Run, x: Array, unit: Array) -> None:
        self.smooth = Smooth(run, x)
        self.unit = unit
        self.y: list[Array] = []
        self.f: list[Array] = []

    def minimise(self, objective: int, start: Array, limit: Array) -> Array | None:
        """Objectives (m,) of the least `objective` with f <= limit; kept where it is feasible."""
        own = np.isfinite(limit)

        def value(y: Array) -> tuple[float, Array]:
            point = self.smooth.at(y)
            unit = self.unit[objective]
            return float(point.f[objective]) / unit, point.df[objective] / unit

        def margins(y: Array) -> tuple[Array, Array]:
            point = self.smooth.at(y)
            room = (limit[own] - point.f[own]) / self.unit[own]
            slopes = -point.df[own] / self.unit[own, None]
            return np.concatenate([room, -point.g]), np.concatenate([slopes, -point.dg])

        ends = np.zeros(self.smooth.size), np.ones(self.smooth.size)
        found = slsqp(value, margins, start, *ends, TOLERANCE, ITERATIONS)
        last = self.smooth.at(found.x)
        if np.any(last.g > 1e-6):
            return None
        at = int(np.searchsorted([f[1] for f in self.f], last.f[1])) if len(last.f) > 1 else 0
        self.y.insert(at, found.x)
        self.f.insert(at, last.f)
        return last.f

    def begin(self) -> bool:
        """The ends of the front; whether there is one."""
        none = np.full(len(self.unit), np.inf)
        middle = np.full(self.smooth.size, 0.5)
        first = self.minimise(0, middle, none)
        if len(self.unit) == 1:
            return first is not None
        start = self.y[0] if self.y else middle
        second = self.minimise(1, start, none)
        return first is not None or second is not None

    def widest(self) -> tuple[float, int]:
        """The largest rectangle between neighbours, and the index of its first point."""
        f = np.array(self.f) / self.unit
        area = np.abs(np.diff(f[:, 0]) * np.diff(f[:, 1]))
        return (float(area.max()), int(np.argmax(area))) if len(area) else (0.0, 0)

    def halve(self, at: int) -> None:
        """Solve half-way between two neighbours."""
        limit = np.full(len(self.unit), np.inf)
        limit[1] = 0.5 * (self.f[at][1] + self.f[at + 1][1])
        self.minimise(0, 0.5 * (self.y[at] + self.y[at + 1]), limit)

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
    unit = np.maximum(np.subtract(*problem.box()[::-1]), 1e-12)
    branches = [Branch(run, x, unit) for x in integer_sets(problem)]
    alive = []
    for at, branch in enumerate(branches):
        run.phase("ends of the front", 0.2 * at / len(branches))
        if branch.begin():
            alive.append(branch)
    if problem.n_obj == 1:
        return
    for branch in alive:
        for _ in range(COARSE):
            branch.halve(branch.widest()[1])
    alive = _contributing(alive)
    solved = max(2, min(SOLVED, points))
    for done in range(sum(len(b.f) for b in alive), solved * len(alive)):
        run.phase("largest gaps of the front", 0.3 + 0.6 * done / (solved * len(alive)))
        area, at, branch = max(((*b.widest(), b) for b in alive), key=lambda one: one[0])
        if area <= 0.0:
            break
        branch.halve(at)
    run.phase("points between", 0.9)
    for branch in alive:
        run.evaluate(branch.between(max(2, points // len(alive))))


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


def _contributing(branches: list[Branch]) -> list[Branch]:
    """The branches with a point on the joint front of their coarse points."""
    f = np.vstack([np.array(branch.f) for branch in branches])
    owner = np.repeat(np.arange(len(branches)), [len(branch.f) for branch in branches])
    kept = set(owner[nondominated(f)].tolist())
    return [branch for at, branch in enumerate(branches) if at in kept]
