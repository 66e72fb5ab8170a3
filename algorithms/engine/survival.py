"""Who survives: feasible before infeasible, then rank, then crowding; on whole arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def violation_of(g: Array) -> Array:
    """Total violation (n,) of constraints (n, any number): what is above 0, summed."""
    return np.asarray(np.maximum(g, 0.0).sum(axis=1))


def ranks(f: Array) -> Indices:
    """Non-domination rank (n,) of objectives (n, m), the best is 0; equal points rank equally."""
    if f.shape[1] == 1:
        return np.unique(f[:, 0], return_inverse=True)[1].astype(np.int64)
    import moocore

    return np.asarray(moocore.pareto_rank(f), dtype=np.int64)


def crowding_distances(f: Array, rank: Indices) -> Array:
    """Crowding distance (n,) within each rank (Deb et al. 2002), as pymoo has it.

    The sum over the objectives of the gap between the two neighbours, divided by the range of the
    rank and by the number of objectives; infinite at the ends of a rank.
    """
    found = np.zeros(len(f))
    for values in f.T:
        order = np.lexsort((values, rank))
        value, level = values[order], rank[order]
        new = np.ones(len(f) + 1, dtype=bool)
        np.not_equal(level[1:], level[:-1], out=new[1:-1])
        bounds = np.flatnonzero(new)
        starts, ends = bounds[:-1], bounds[1:] - 1
        gap = np.empty(len(f))
        gap[1:-1] = value[2:] - value[:-2]
        gap[starts] = gap[ends] = np.inf
        span = np.repeat(value[ends] - value[starts], np.diff(bounds))
        np.divide(gap, span, out=gap, where=span > 0.0)
        gap[span <= 0.0] = 0.0  # an objective that does not differ says nothing
        found[order] += gap
    few = np.bincount(rank)[rank] <= 2  # one or two points are the ends, whatever their values
    found[few] = np.inf
    return np.asarray(found / f.shape[1])


def survivors(
    f: Array, v: Array, count: int, rng: np.random.Generator
) -> tuple[Indices, Indices, Array]:
    """Rows of the best `count` points, their ranks and crowding distances.

    Feasible points by rank, the last rank that fits in part by crowding with ties drawn at random;
    then infeasible ones by total violation `v`. These carry the rank after the last feasible one
    and no crowding.
    """
    feasible = np.flatnonzero(v <= 0.0)
    if not len(feasible):
        rows = np.argsort(v, kind="stable")[:count]
        return rows, np.zeros(len(rows), dtype=np.int64), np.zeros(len(rows))
    values = f if len(feasible) == len(f) else f[feasible]
    rank = ranks(values)
    last = _last_rank(rank, count)
    inside = np.flatnonzero(rank <= last)
    level = rank[inside]
    crowding = crowding_distances(values[inside], level)
    if len(inside) > count:
        order = np.lexsort((rng.random(len(inside)), -crowding, level))[:count]
        inside, level, crowding = inside[order], level[order], crowding[order]
    rows = feasible[inside]
    missing = min(count, len(f)) - len(rows)
    if missing:
        infeasible = np.flatnonzero(v > 0.0)
        more = infeasible[np.argsort(v[infeasible], kind="stable")[:missing]]
        rows = np.concatenate([rows, more])
        level = np.concatenate([level, np.full(missing, last + 1)])
        crowding = np.concatenate([crowding, np.zeros(missing)])
    return rows, level, crowding


def _last_rank(rank: Indices, count: int) -> int:
    """The rank with which `count` points are reached, or the worst where there are fewer."""
    reached = np.cumsum(np.bincount(rank))
    return min(int(np.searchsorted(reached, count)), len(reached) - 1)
