"""The end of a search on a sample: its points are tested on fresh units, and solved again.

A search on one sample fits the chance in it: its limits hold there to the last digit, and on fresh
units half of its points would break them. Therefore every point is solved again with its limits
moved by the excess on fresh units.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...arrays import Array
from ..run import Run
from .branch import Branch

ROUNDS, ALONE, SPARE = 3, 6, 4
"""Times that a point of a front, or a single point, is solved with its limits moved, and further
times that it is moved inside them where it is not."""
BEYOND, MARGIN = 1.2, 3e-4
"""Factor and fraction of a limit by which it is moved farther than fresh units require, so that
few rounds suffice."""
OF_TAIL = 0.02
"""Fraction of the distance from a lower limit on a percentage to 100, by which it is moved
farther."""
HALVED = 10
"""Times that the step to the tightest tolerances is halved, where nothing else keeps the limits."""
FAR = 0.5
"""Fraction of a limit by which it is moved at most."""


def tested_afresh(run: Run, points: Sequence[tuple[Branch, int]]) -> None:
    """Hand points, each by its branch and index, to the run as its result.

    A point that breaks a limit on fresh units is solved again with the limit moved by the excess.
    """
    for done, (branch, at) in enumerate(points):
        run.phase("fresh units", 0.9 + 0.1 * done / len(points))
        run.choose(feasible_afresh(run, branch, branch.y[at], branch.f[at], search=True))


def feasible_afresh(run: Run, branch: Branch, y: Array, f: Array, search: bool) -> Array:
    """The search vector (1, variables) of a point, after its limits hold on fresh units.

    With `search` it is solved again with every limit moved by the difference between fresh units
    and the sample, and the cheapest point accepted on fresh units is taken; else the nearest.
    """
    limit = np.full(len(f), np.inf)
    limit[1:] = f[1:]
    accepted: list[tuple[float, Array]] = []
    rounds = ALONE if run.problem.n_obj == 1 else ROUNDS
    for _ in range(rounds if search else 0):
        excess = _excess_afresh(run, branch, y, accepted)
        violation = branch.smooth.values(y)[1]
        moved = np.where(excess != violation, excess - violation + _farther(run), 0.0)
        y = branch.solved(0, branch.restored(y, moved, FAR), limit, moved)
    _excess_afresh(run, branch, y, accepted)
    return min(accepted, key=lambda point: point[0])[1] if accepted else _pushed(run, branch, y)


def _excess_afresh(run: Run, branch: Branch, y: Array, accepted: list[tuple[float, Array]]) -> Array:
    """Violations (constraints,) on fresh units; a point without any joins `accepted`."""
    x = branch.smooth.vectors(y[None, :])
    values, excess = run.problem.tested(x)
    if np.all(excess <= 0.0):
        accepted.append((float(values[0, 0]), x))
    return branch.smooth.constraints(excess[0])[0]


def _pushed(run: Run, branch: Branch, y: Array) -> Array:
    """The search vector (1, variables) of a point that is moved inside its limits on fresh units."""
    slack, farther = np.zeros(run.problem.n_ieq_constr), _farther(run)
    for _ in range(SPARE):
        x = branch.smooth.vectors(y[None, :])
        excess = branch.smooth.constraints(run.problem.tested(x)[1][0])[0]
        if not np.any(excess > 0.0):
            break
        violation = branch.smooth.values(y)[1]
        slack = np.where(excess > 0.0, np.maximum(slack, -violation) + BEYOND * excess + farther, slack)
        y = branch.restored(y, slack, FAR)
    else:
        y = _tightened(run, branch, y)
    return branch.smooth.vectors(y[None, :])


def _tightened(run: Run, branch: Branch, y: Array) -> Array:
    """The point, where it breaks limits with all its tolerances tighter alike, by no more than it must be."""

    def kept(fraction: float) -> bool:
        x = branch.smooth.vectors(np.where(branch.smooth.log, (1.0 - fraction) * y, y)[None, :])
        return not np.any(run.problem.tested(x)[1] > 0.0)

    if kept(0.0) or not kept(1.0):
        return y
    low, high = 0.0, 1.0
    for _ in range(HALVED):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if kept(middle) else (middle, high)
    return np.asarray(np.where(branch.smooth.log, (1.0 - high) * y, y))


def _farther(run: Run) -> Array:
    """The fraction by which limits (constraints,) are moved beyond what fresh units require."""
    fractions = []
    for limit in run.problem.limits:
        tail = 100.0 - limit.low if limit.of_percentage else np.inf
        fraction = OF_TAIL * tail / limit.low if 0.0 < tail < limit.low else MARGIN
        fractions += [min(MARGIN, fraction)] * limit.count
    return np.array(fractions)
