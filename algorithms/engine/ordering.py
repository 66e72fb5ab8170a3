"""Rows in an order of several keys, and the lowest non-domination ranks of ordered rows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array, Flags, Integers

PASSES = 16
"""Ranks that are computed one after the other; where more are needed, all are computed at once."""


def in_order(*keys: NDArray[Any]) -> Integers:
    """Rows (n,) ordered by the first key (n,), where it is equal by the next ones, then by row.

    The order is that of `np.lexsort` of the reversed keys, several times as fast where values of the
    first key seldom repeat.
    """
    order = keys[0].argsort()
    value = keys[0].take(order)
    same = value[1:] == value[:-1]
    if np.count_nonzero(same):
        tied = np.zeros(len(order), dtype=bool)
        tied[1:] = same
        tied[:-1] |= same
        at = tied.nonzero()[0]
        rows = order.take(at)
        order[at] = rows.take(np.lexsort((rows, *(key.take(rows) for key in reversed(keys)))))
    return order


def ranks(f: Array) -> Integers:
    """Non-domination rank (n,) of objectives (n, m), the best is 0; equal points rank equally."""
    if f.shape[1] == 1:
        return np.unique(f[:, 0], return_inverse=True)[1].astype(np.int64)
    import moocore

    return np.asarray(moocore.pareto_rank(f), dtype=np.int64)


def lowest_ranks_in_order(f: Array, enough: int) -> Integers:
    """`ranks` (n,) of points (n, m) that are `in_order` of their objectives, the lowest of them.

    Ranks after the one with which `enough` points are reached are not distinguished. With two
    objectives each rank takes one pass over the remaining points.
    """
    if f.shape[1] != 2:
        return ranks(f)
    first, second = f.T
    assigned, rest = np.zeros(len(f), dtype=np.int64), np.arange(len(f))
    for rank in range(1, PASSES + 1):
        rest = rest[~_lowest(first.take(rest), second.take(rest))]
        assigned[rest] = rank
        if len(rest) <= max(0, len(f) - enough):
            return assigned
    assigned[rest] += ranks(f.take(rest, axis=0))
    return assigned


def _lowest(first: Array, second: Array) -> Flags:
    """Which of the points in order, of two objectives (n,) each, are not dominated.

    The second objective is less than that of all points before, or the point equals the last point
    for which that is true.
    """
    least = np.minimum.accumulate(second)
    lower = np.ones(len(first), dtype=bool)
    np.less(second[1:], least[:-1], out=lower[1:])
    last = np.maximum.accumulate(np.where(lower, first, -np.inf))
    lowest: Flags = (second == least) & (first == last)
    return lowest
