"""Lower limits of costs that are not proven: on the condition that the other objective is convex, and estimated.

Let Q(t) be the least value of an objective at tolerances t, all else at its best within the limits. At a least cost
under Q <= L with the price lambda of L (Karush, Kuhn & Tucker 1951) and convex cost curves, every t with Q(t) <= L has

    cost(t) >= cost* + cost*' (t - t*) >= cost* - lambda Q'(t*) (t - t*) >= cost* - lambda e,

where Q lies nowhere more than e below its tangent plane. e is 0 where Q is convex. That is not proven: it is tried at
the middle of chords between random tolerances, Q((a + b)/2) <= (Q(a) + Q(b))/2, at the same integers.

What an allocation needs may also be known as a share of units that a sample estimates (`SampledNeed`): the least cost
at which that share is enough is solved for at every set of integers, without a proof that the optimum is global.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from ...problems.forms import SampledNeed
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array
from ..run import Run, Shared, recalled_results
from ..settings import Budget
from .local import Branch
from .slsqp import slsqp

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


PRECISION, MOST_STEPS = 1e-3, 60
"""Cost to which the estimate is solved, and steps of SLSQP at most."""
KEPT = 0.01
"""Margin by which an estimate may fall short of what is needed."""


class Asked(NamedTuple):
    """Values of the objectives that the least cost is estimated at, and a full design (variables,) to begin from."""

    values: dict[str, float]
    design: Array


def estimated_optimum(problem: ToleranceProblem, task: Asked) -> Array:
    """The least cost found at which what is needed is met, the share that is met on fresh units, and the full design
    (2 + variables,); NaN where none was found.

    It is searched from the design of the task at every set of integers.
    """
    known = problem.cost_bound()
    need = None if known is None else known.estimate(task.values)
    best = np.full(2 + len(task.design), np.nan)
    if need is None:
        return best
    integers = [problem.names.index(v.name) for v in problem.free if v.integer]
    moving = [problem.names.index(v.name) for v in problem.free if not v.integer]
    ranges = [np.rint(problem.interval(problem.names[at])).astype(int) for at in integers]

    def improved(start: Array) -> Array:
        found = _estimated(problem, need, start, moving)
        cost = np.nan if found is None else float(problem.cost_of(found[None, :])[0])
        return best if found is None or cost >= best[0] else np.array([cost, 0.0, *found])

    for chosen in product(*(range(first, last + 1) for first, last in ranges)):
        design = task.design.copy()
        design[integers] = chosen
        best = improved(design)
    if np.isfinite(best[0]):
        best = improved(best[2:])  # once more: a kink of the sample stops a search
        best[1] = need.share(best[2:], searching=False)[0]
    return best


def _estimated(problem: ToleranceProblem, need: SampledNeed, start: Array, moving: list[int]) -> Array | None:
    """The full design (variables,) that is found with the integers of a start, None where the need is not met."""
    ends = np.array([problem.interval(problem.names[at]) for at in moving]).reshape(-1, 2)
    low, width = ends[:, 0], ends[:, 1] - ends[:, 0]
    last: tuple[Array, tuple[Array, Array]] = np.empty(0), (np.empty(0), np.empty(0))

    def complete(y: Array) -> Array:
        design = start.copy()
        design[moving] = low + width * y
        return design

    def margins(y: Array) -> tuple[Array, Array]:
        nonlocal last
        if not np.array_equal(last[0], y):
            values, slopes = need.margins(complete(y))
            last = y.copy(), (values, width * slopes[:, moving])
        return last[1]

    if margins(np.zeros(len(moving)))[0][0] < 0.0:  # not with the tightest tolerances
        return None
    y = slsqp(
        lambda y: float(problem.cost_of(complete(y)[None, :])[0]),
        lambda y: width * problem.cost_slopes(complete(y)[None, :])[0][moving],
        lambda y: margins(y)[0],
        lambda y: margins(y)[1],
        np.clip((start[moving] - low) / np.where(width > 0.0, width, 1.0), 0.0, 1.0),
        (np.zeros(len(moving)), np.ones(len(moving))),
        PRECISION,
        MOST_STEPS,
    ).x
    return complete(y) if np.all(margins(y)[0] >= -KEPT) else None
