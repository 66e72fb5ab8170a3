"""A front on a sample by continuation: level after level of the second objective, warm started.

At every level the first objective is minimised at each set of integers that may be best there, from
the designs at the neighbouring levels. A set that is worse by more than `BEATEN` at both of them is
omitted.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Flags
from ...problems.tolerance_problem import ToleranceProblem
from ..run import Run
from .afresh import tested_afresh
from .branch import NEARLY, Branch, joint

RATIO = 0.75
"""Ratio of neighbouring levels of the coarse front."""
BEATEN = 0.02
"""Fraction of the least value by which a set of integers is worse where it is not tried between."""
STEPS = 3
"""Steps to a level that is not reached at once."""
SWEEPS, SAGGING = 2, 1e-3
"""Times that points are solved again from their neighbours, and the excess over the chord of both
from which that is done, in natural logarithms."""
END = 1.03
"""The tight end of the front, as a multiple of the least second objective: beyond it the cost
rises without bound, and chance dominates."""
Levels = dict[float, Array]


def sampled_front(run: Run, branches: list[Branch], points: int) -> None:
    """Compute the front of one or two objectives of a sampled problem, tested on fresh units."""
    if run.problem.n_obj == 1:
        for at, branch in enumerate(branches):
            run.phase("least value", 0.8 * at / len(branches))
            branch.begin(run)
        alive = [branch for branch in branches if branch.f]
        tested_afresh(run, joint(alive)[:1] if alive else [])
    else:
        levels = _between(run, branches, points)
        tested_afresh(run, [_best(branches, level) for level in sorted(levels)])
        run.chosen = undominated(run.problem, run.chosen)


def undominated(problem: ToleranceProblem, x: Array) -> Array:
    """The search vectors (k, variables) that none of those (n, variables) that keep the limits dominates.

    On fresh units a point may come out both dearer and looser than its neighbours: the rounding of a
    processor decides which, and a front has no such end.
    """
    if not len(x):
        return x
    f, g = problem.tested(x)
    kept = f[np.all(g <= 0.0, axis=1)]
    return x[[not np.any(np.all(kept <= point, axis=1) & np.any(kept < point, axis=1)) for point in f]]


def _between(run: Run, branches: list[Branch], points: int) -> Levels:
    """Solve at coarse levels, then where the joint front is widest, until it has `points`."""
    levels = _coarse(run, branches)
    while levels and len(levels) < points:
        run.phase("largest gaps of the front", 0.4 + 0.5 * len(levels) / points)
        below, above = _widest(levels, branches[0].unit)
        level = 0.5 * (below + above)
        tried = _promising(levels[below]) | _promising(levels[above])
        levels[level] = np.array(
            [_solved(branch, level) if promising else np.inf for branch, promising in zip(branches, tried, strict=True)]
        )
    for sweep in range(SWEEPS):
        run.phase("points from their neighbours", 0.8 + 0.1 * sweep / SWEEPS)
        if not _mended(branches, levels):
            break
    return levels


def _mended(branches: list[Branch], levels: Levels) -> bool:
    """Solve points above the chord of their neighbours again from there; whether there were any.

    On doubly logarithmic axes a front is convex, but for kinks where the integers change.
    """
    order = sorted(levels)
    if len(order) < 3:
        return False
    least = np.log([np.min(levels[level]) for level in order])
    at = np.log(order)
    fraction = (at[1:-1] - at[:-2]) / (at[2:] - at[:-2])
    above = least[1:-1] - (1.0 - fraction) * least[:-2] - fraction * least[2:]
    bad = [order[i + 1] for i in np.flatnonzero(above > SAGGING)]
    for level in bad:
        branch = branches[int(np.argmin(levels[level]))]
        for other_level in (order[order.index(level) - 1], order[order.index(level) + 1]):
            near = branches[int(np.argmin(levels[other_level]))]
            near.minimise(0, near.nearest(other_level), near.at_most(1, level))
            if near is not branch:
                branch.minimise(0, near.nearest(other_level), branch.at_most(1, level))
        levels[level] = np.array([_value(candidate, level) for candidate in branches])
    return bool(bad)


def _coarse(run: Run, branches: list[Branch]) -> Levels:
    """From the cheapest design of every set of integers to tighter levels, as far as possible."""
    none = np.full(len(branches[0].unit), np.inf)
    for at, branch in enumerate(branches):
        run.phase("coarse front", 0.4 * at / len(branches))
        start = branch.starts(run)[-1]
        branch.minimise(0, start, none)
        if branch.f:
            branch.minimise(1, branch.y[0], branch.at_most(0, branch.f[0][0] * (1.0 + 1e-6)))
        while branch.f:
            tightest = branch.f[0][1]
            branch.minimise(0, branch.y[0], branch.at_most(1, RATIO * tightest))
            if branch.f[0][1] > 0.95 * tightest:
                break
    high = max((branch.f[-1][1] for branch in branches if branch.f), default=np.nan)
    last = min((b for b in branches if b.f), key=lambda b: b.f[0][1], default=None)
    if last is None:
        return {}
    for _ in range(SWEEPS):
        last.minimise(1, last.y[0], none)
    low = END * last.f[0][1]
    count = int(np.ceil(np.log(low / high) / np.log(RATIO)))
    levels = np.geomspace(low, high, max(count, 2) + 1).tolist()
    return {level: np.array([_solved(b, level) for b in branches]) for level in levels}


def _promising(values: Array) -> Flags:
    """Which sets of integers (n,) are good enough at a level; a set that is not tried is not."""
    return np.asarray(values <= (1.0 + BEATEN) * np.min(values))


def _widest(levels: dict[float, Array], unit: Array) -> tuple[float, float]:
    """The neighbouring levels between which the joint front has its largest gap."""
    order = sorted(levels)
    least = np.array([np.min(levels[level]) for level in order])
    drop = np.where(np.isfinite(least[:-1]), -np.diff(least), unit[0]) / unit[0]
    at = int(np.argmax(np.maximum(drop, 1e-9) * np.diff(order) / unit[1]))
    return order[at], order[at + 1]


def _value(branch: Branch, level: float) -> float:
    """The least first objective that a branch has at a level, or nearly there."""
    return min(_reached(branch, level), default=np.inf)


def _reached(branch: Branch, level: float) -> list[float]:
    """First objectives of the points of a branch up to a level, or nearly there."""
    return [float(f[0]) for f in branch.f if f[1] <= level + NEARLY * branch.unit[1]]


def _best(branches: list[Branch], level: float) -> tuple[Branch, int]:
    """Branch and index of the least first objective at a level: other points there are not part of
    the front, though some are tighter by less than the accuracy of a solution.
    """
    branch = min(branches, key=lambda candidate: _value(candidate, level))
    return branch, int(np.argmin(_reached(branch, level)))


def _solved(branch: Branch, level: float) -> float:
    """The least first objective at a level, from between its neighbours, else from the tighter."""
    limit = branch.at_most(1, level)
    values = np.array([f[1] for f in branch.f])
    above = int(np.searchsorted(values, level))
    if above == 0:  # tighter than the branch reaches
        return np.inf
    tighter, cost_there = branch.y[above - 1], float(branch.f[above - 1][0])
    if above < len(values):
        fraction = (level - values[above - 1]) / max(values[above] - values[above - 1], 1e-12)
        branch.minimise(0, tighter + fraction * (branch.y[above] - tighter), limit)
    if _value(branch, level) > 0.999 * cost_there:
        branch.minimise(0, tighter, limit)
    if _value(branch, level) > 0.999 * cost_there:
        _stepped(branch, level)
    return _value(branch, level)


def _stepped(branch: Branch, level: float) -> None:
    """From the next looser point to a level in steps, where a larger step does not lead there."""
    looser = [f[1] for f in branch.f if f[1] > level]
    if not looser:
        return
    for target in np.geomspace(min(looser), level, STEPS + 1)[1:]:
        start = branch.nearest(float(min(f[1] for f in branch.f if f[1] >= target)))
        branch.minimise(0, start, branch.at_most(1, float(target)))
