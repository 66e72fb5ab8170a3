"""The front by epsilon-constraints, for models without closed form.

The first objective is minimised under limits on the others (Haimes, Lasdon & Wismer 1971) by SLSQP,
from the neighbours on the front. The rectangle between two neighbours bounds the unknown part of the
front: the largest rectangle is halved next. Between the solved points, the scaled tolerances are
interpolated along the front, with one evaluation a point. Integers are enumerated; sets of integers
that contribute nothing to a coarse front are dropped.
"""

from __future__ import annotations

import itertools

import numpy as np

from ...arrays import Array
from ...errors import Fault, raise_all
from ...problems.interfaces import Accuracy
from ...problems.tolerance_problem import ToleranceProblem
from ..indicators import nondominated
from ..run import Run
from .branch import Branch, joint_front
from .continuation import sampled_front

SETS = 64
"""Sets of integers that are enumerated at most."""
COARSE = 5
"""Points per set of integers before sets are dropped."""
SOLVED = 48
"""Points that are solved; the others are interpolated between them."""


def epsilon_front(run: Run, points: int) -> None:
    """Evaluate designs along the front of a run's problem; `points` are spread over it."""
    problem = run.problem = Accuracy.of(run.problem).smooth()
    unit = scale_of(problem)
    branches = [Branch(run, x, unit) for x in integer_sets(problem)]
    if problem.declaration.sampled:
        sampled_front(run, branches, points)
        return
    for at, branch in enumerate(branches):
        run.phase("ends of the front" if problem.n_obj > 1 else "least cost", 0.2 * at / len(branches))
        branch.begin(run)
    alive = [branch for branch in branches if branch.f]
    if alive and problem.n_obj == 2:
        _front(run, alive, points)


def _front(run: Run, alive: list[Branch], points: int) -> None:
    """From the ends of two objectives to the whole front."""
    for at, branch in enumerate(alive):
        run.phase("coarse front", 0.2 + 0.1 * at / len(alive))
        for _ in range(COARSE):
            branch.halve()
    alive = _contributing(alive)
    _fill(run, alive, max(2, min(SOLVED, points)))
    run.phase("interpolated points", 0.9)
    for branch in alive:
        run.evaluate(branch.between(max(2, points // len(alive))))


def _fill(run: Run, branches: list[Branch], points: int) -> None:
    """Solve in the largest rectangles until the joint front has so many points."""
    while len(joint := joint_front(branches)) < points:
        run.phase("largest gaps of the front", 0.3 + 0.6 * len(joint) / points)
        widest = max(branches, key=lambda branch: branch.widest(joint)[0])
        if not widest.halve(joint):
            return


def scale_of(problem: ToleranceProblem) -> Array:
    """Scale (m,) of the objectives."""
    ideal, nadir = problem.box()
    return np.maximum(nadir - ideal, 1e-12)


def integer_sets(problem: ToleranceProblem) -> list[Array]:
    """Search vectors (variables,) with every set of values of the integer variables.

    Raises InputError where there are more than `SETS`.
    """
    raise_all(integer_faults(problem))
    return [np.array(values) for values in itertools.product(*_choices(problem))]


def integer_faults(problem: ToleranceProblem) -> list[Fault]:
    """A fault where there are more sets of integers than are enumerated."""
    count = int(np.prod([float(len(choice)) for choice in _choices(problem)]))
    if count <= SETS:
        return []
    text = (
        f"exact enumerates at most {SETS} sets of integers for a problem without closed form, "
        f"but this problem has {count}: use hybrid, or fix some of them"
    )
    return [Fault("algorithm.name", text)]


def _choices(problem: ToleranceProblem) -> list[Array]:
    """The values of every integer variable, and one value of every other."""
    return [
        np.arange(np.ceil(low), np.floor(high) + 1.0) if v.integer else np.array([low])
        for v, low, high in zip(problem.free, problem.xl, problem.xu, strict=True)
    ]


def integer_moves(problem: ToleranceProblem, x: Array) -> list[Array]:
    """A search vector (variables,) and those that differ from it in one integer."""
    vectors = [x]
    for at, variable in enumerate(problem.free):
        if variable.integer:
            for value in np.arange(np.ceil(problem.xl[at]), np.floor(problem.xu[at]) + 1.0):
                if value != np.rint(x[at]):
                    moved = x.copy()
                    moved[at] = value
                    vectors.append(moved)
    return vectors


def _contributing(branches: list[Branch]) -> list[Branch]:
    """The branches with a point on the joint front of their coarse points."""
    f = np.vstack([np.array(branch.f) for branch in branches])
    owner = np.repeat(np.arange(len(branches)), [len(branch.f) for branch in branches])
    kept = set(owner[nondominated(f)].tolist())
    return [branch for at, branch in enumerate(branches) if at in kept]
