"""A lower bound of costs on a condition, where nothing is proven: that the other objective is convex.

Let Q(t) be the least value of an objective at tolerances t, all else at its best within the limits. At a least cost
under Q <= L with the price lambda of L (Karush, Kuhn & Tucker 1951) and convex cost curves, every t with Q(t) <= L has

    cost(t) >= cost* + cost*' (t - t*) >= cost* - lambda Q'(t*) (t - t*) >= cost* - lambda e,

where Q lies nowhere more than e below its tangent plane. e is 0 where Q is convex. That is not proven: it is tried at
the middle of chords between random tolerances, Q((a + b)/2) <= (Q(a) + Q(b))/2, at the same integers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array
from ..run import Run, Shared, recalled_results
from ..settings import Budget
from .local import Branch

ENDS, KINDS = 3, 2
"""Random tolerances at the integers of a kind, each two of which are the ends of a chord; kinds of integers at most."""


@dataclass(frozen=True, slots=True)
class Convexity:
    """The largest `excess` of Q over the middle of a chord, and the number of `chords`, `above` of which have any."""

    excess: float
    chords: int
    above: int


class Held(NamedTuple):
    """Tolerances that are held: the search vector x (variables,), the scale of the objectives, and the objective."""

    x: Array
    unit: Array
    objective: int


def least_value(problem: ToleranceProblem, task: Held) -> Array:
    """Q at the tolerances of a task, on the larger sample of a problem, and the search vector (1 + variables,).

    NaN where no limits are kept.
    """
    finer = problem.finer()
    tolerances = np.array([v.tolerance and not v.integer for v in finer.free])
    branch = Branch(Run(finer, Budget(), seed=0), task.x, task.unit, held=tolerances)
    start = branch.smooth.scaled(task.x[None, :])[0]
    if not branch.smooth.size:
        f, g = finer.searched(task.x[None, :])
        return np.append(f[0, task.objective] if np.all(g <= 0.0) else np.nan, task.x)
    found = branch.minimise(task.objective, start, np.full(len(task.unit), np.inf))
    if found is None:
        return np.append(np.nan, task.x)
    return np.append(found[task.objective], branch.smooth.vectors(branch.y[0][None, :])[0])


def convexity(
    problem: ToleranceProblem, x: Array, objective: int, unit: Array, rng: np.random.Generator, shared: Shared
) -> Convexity | None:
    """How far Q is from convex over the tolerances of points x (n, variables), at some of their integers.

    `unit` (m,) is the scale of the objectives; `shared` computes values in other processes. None where no two
    points have the same integers.
    """
    integer = np.array([v.integer for v in problem.free])
    tolerance = np.array([v.tolerance and not v.integer for v in problem.free])
    kinds, owner = np.unique(x[:, integer], axis=0, return_inverse=True)
    members = [x[np.ravel(owner) == at] for at in range(len(kinds))]
    several = [points for points in members if len(points) > 1 and np.any(np.ptp(points[:, tolerance], axis=0) > 0.0)]
    if not several:
        return None
    places = np.unique(np.linspace(0, len(several) - 1, min(KINDS, len(several))).astype(int))
    ends = np.concatenate([_random_points(several[at], tolerance, rng) for at in places])
    pairs = np.array([
        (first + ENDS * kind, second + ENDS * kind)
        for kind in range(len(places))
        for first, second in combinations(range(ENDS), 2)
    ])  # fmt: skip
    at_ends = _values(problem, ends, objective, unit, shared)
    chords = 0.5 * (at_ends[pairs[:, 0]] + at_ends[pairs[:, 1]])  # the rest begins between what was found at the ends
    excess = _values(problem, chords[:, 1:], objective, unit, shared)[:, 0] - chords[:, 0]
    excess = excess[np.isfinite(excess)]
    if not len(excess):
        return None
    return Convexity(max(0.0, float(excess.max())), len(excess), int(np.count_nonzero(excess > 0.0)))


def _random_points(points: Array, tolerance: Array, rng: np.random.Generator) -> Array:
    """Search vectors (`ENDS`, variables): tolerances in the ranges of those of points, the rest from one of them."""
    drawn = points[rng.integers(len(points), size=ENDS)].copy()
    low, high = points.min(axis=0), points.max(axis=0)
    uniform = low + (high - low) * rng.random(drawn.shape)
    return np.where(tolerance, uniform, drawn)


def _values(problem: ToleranceProblem, x: Array, objective: int, unit: Array, shared: Shared) -> Array:
    """Q at search vectors (n, variables), and those at which it was found (n, 1 + variables)."""
    tasks = [Held(vector, unit, objective) for vector in x]
    inputs: Iterable[Array] = (x, unit, np.array(objective))
    return np.asarray(recalled_results(shared, least_value, tasks, inputs), dtype=float)
