"""Who survives: feasible before infeasible, then rank, then crowding; on whole arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .ordering import ranks

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def violation_of(g: Array) -> Array:
    """Total violation (n,) of constraints (n, any number): what is above 0, summed."""
    if not g.shape[1]:
        return np.zeros(len(g))
    return np.asarray(np.maximum(g, 0.0).sum(axis=1))


def crowding_distances(f: Array, rank: Indices) -> Array:
    """Crowding distance (n,) within each rank (Deb et al. 2002), as pymoo has it.

    The sum over the objectives of the gap between the two neighbours, divided by the range of the
    rank and by the number of objectives; infinite at the ends of a rank.
    """
    if not np.count_nonzero(rank):
        return _crowding(f)
    found = np.empty(len(f))
    for level in range(int(rank.max()) + 1):
        rows = (rank == level).nonzero()[0]
        found[rows] = _crowding(f.take(rows, axis=0))
    return found


def _crowding(f: Array) -> Array:
    """`crowding_distances` (n,) of points that all have the same rank."""
    n, m = f.shape
    if n <= 2:  # these are the ends, whatever their values
        return np.full(n, np.inf)
    values, begins = f.T.ravel(), n * np.arange(m)[:, None]
    order = values.reshape(m, n).argsort(axis=1, kind="stable") + begins
    ordered = values.take(order)
    gap = np.full((m, n), np.inf)
    np.subtract(ordered[:, 2:], ordered[:, :-2], out=gap[:, 1:-1])
    span = ordered[:, -1:] - ordered[:, :1]
    if np.count_nonzero(span) == m:
        gap /= span
    else:  # an objective that does not differ says nothing
        gap = np.divide(gap, span, out=np.zeros_like(gap), where=span > 0.0)
    found = np.empty(m * n)
    found[order] = gap
    return np.asarray(found.reshape(m, n).sum(axis=0) / m)


def survivors(
    f: Array, v: Array, count: int, rng: np.random.Generator
) -> tuple[Indices, Indices, Array]:
    """Rows of the best `count` points, their ranks and crowding distances.

    Feasible points by rank, the last rank that fits in part by crowding with ties drawn at random;
    then infeasible ones by total violation `v`. These carry the rank after the last feasible one
    and no crowding.
    """
    kept = v <= 0.0
    if np.count_nonzero(kept) == len(kept):
        return _best(f, count, rng)
    feasible = kept.nonzero()[0]
    if not len(feasible):
        rows = np.argsort(v, kind="stable")[:count]
        return rows, np.zeros(len(rows), dtype=np.int64), np.zeros(len(rows))
    inside, level, crowding = _best(f[feasible], count, rng)
    rows = feasible[inside]
    missing = min(count, len(f)) - len(rows)
    if missing:
        infeasible = np.flatnonzero(v > 0.0)
        more = infeasible[np.argsort(v[infeasible], kind="stable")[:missing]]
        rows = np.concatenate([rows, more])
        level = np.concatenate([level, np.full(missing, level.max() + 1)])
        crowding = np.concatenate([crowding, np.zeros(missing)])
    return rows, level, crowding


def _best(f: Array, count: int, rng: np.random.Generator) -> tuple[Indices, Indices, Array]:
    """`survivors` where all points are feasible; all of them where there are no more."""
    rank = ranks(f)
    last = np.bincount(rank).cumsum().searchsorted(count)  # with this rank they are reached
    inside = (rank <= last).nonzero()[0]
    level = rank.take(inside)
    crowding = crowding_distances(f.take(inside, axis=0), level)
    if len(inside) <= count:
        return inside, level, crowding
    drawn = rng.random(len(inside)).argsort()
    order = drawn.take((-crowding).take(drawn).argsort(kind="stable"))
    if last:
        order = order.take(level.take(order).argsort(kind="stable"))
    order = order[:count]
    return inside.take(order), level.take(order), crowding.take(order)
