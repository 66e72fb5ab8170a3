"""Survival on whole arrays: feasible before infeasible points, then by rank, then by crowding."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Integers
from .ordering import lowest_ranks_in_order


def violation_of(g: Array) -> Array:
    """Total violation (n,) of constraints (n, any number): the sum of the positive ones."""
    if not g.shape[1]:
        return np.zeros(len(g))
    return np.asarray(np.maximum(g, 0.0).sum(axis=1))


def crowding_distances(f: Array, rank: Integers) -> Array:
    """Crowding distance (n,) within each rank (Deb et al. 2002) of points `in_order`, as pymoo's.

    The sum over the objectives of the gap between the two neighbours, divided by the range of the
    rank and by the number of objectives; infinite at the ends of a rank.
    """
    crowding = _crowding_of_two if f.shape[1] == 2 else _crowding
    if not np.count_nonzero(rank):
        return crowding(f)
    distances = np.empty(len(f))
    for level in range(int(rank.max()) + 1):
        rows = (rank == level).nonzero()[0]
        distances[rows] = crowding(f.take(rows, axis=0))
    return distances


def _crowding_of_two(f: Array) -> Array:
    """`crowding_distances` (n,) of points of one rank, in order: of the second objective, reversed.

    Of equal points the first has the gaps before them and the last those after them.
    """
    distances = np.full(len(f), np.inf)
    if len(f) > 2:
        span = f[-1] - f[0]
        gap = (f[2:] - f[:-2]) / span if span[0] > 0.0 else np.zeros((len(f) - 2, 2))
        np.add(gap[:, 0], gap[:, 1], out=distances[1:-1])
        distances *= 0.5
    return distances


def _crowding(f: Array) -> Array:
    """`crowding_distances` (n,) of points that all have the same rank."""
    if len(f) <= 2:  # these are the ends, whatever their values
        return np.full(len(f), np.inf)
    distances, gap = np.zeros(len(f)), np.empty(len(f))
    for values in f.T:
        order = values.argsort(kind="stable")
        value = values.take(order)
        span = value[-1] - value[0]
        if span > 0.0:  # an objective that does not differ carries no information
            np.subtract(value[2:], value[:-2], out=gap[1:-1])
            gap[0] = gap[-1] = np.inf
            gap /= span
            distances[order] += gap
    distances /= f.shape[1]
    return distances


def survivors(f: Array, v: Array, count: int, rng: np.random.Generator) -> tuple[Integers, Integers, Array]:
    """Rows of the best `count` points, their ranks and crowding distances.

    Feasible points by rank, the last rank that fits in part by crowding with ties drawn at random;
    then infeasible points by total violation `v`, with the rank after the last feasible one and a
    crowding of 0.
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


def _best(f: Array, count: int, rng: np.random.Generator) -> tuple[Integers, Integers, Array]:
    """`survivors` where all points are feasible."""
    sequence = np.lexsort(f.T[::-1])
    f = f.take(sequence, axis=0)
    rank = lowest_ranks_in_order(f, count)
    last = np.bincount(rank).cumsum().searchsorted(count)  # the rank with which `count` is reached
    inside = (rank <= last).nonzero()[0]
    level = rank.take(inside)
    crowding = crowding_distances(f.take(inside, axis=0), level)
    rows = sequence.take(inside)
    if len(rows) <= count:
        return rows, level, crowding
    drawn = rng.random(len(rows)).argsort()
    order = drawn.take((-crowding).take(drawn).argsort(kind="stable"))
    if last:
        order = order.take(level.take(order).argsort(kind="stable"))
    order = order[:count]
    return rows.take(order), level.take(order), crowding.take(order)
