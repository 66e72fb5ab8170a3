"""Rows in an order of several keys, and the lowest non-domination ranks of rows in such an order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
PASSES = 16
"""Ranks that are looked for one after the other; where more are asked for, all are computed."""


def in_order(*keys: Array) -> Indices:
    """Rows (n,) ordered by the first key (n,), where it is equal by the next ones, then by row.

    It is `np.lexsort` of the reversed keys, several times as fast where the first seldom repeats.
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


def ranks(f: Array) -> Indices:
    """Non-domination rank (n,) of objectives (n, m), the best is 0; equal points rank equally."""
    if f.shape[1] == 1:
        return np.unique(f[:, 0], return_inverse=True)[1].astype(np.int64)
    import moocore

    return np.asarray(moocore.pareto_rank(f), dtype=np.int64)


def lowest_ranks_in_order(f: Array, enough: int) -> Indices:
    """`ranks` (n,) of points (n, m) that are `in_order` of their objectives, the lowest of them.

    Ranks after the one with which `enough` points are reached are not told apart. Of two objectives
    a point is in the first rank where its second is less than that of all points before it, so that
    a pass over the points that are left gives a rank each.
    """
    if f.shape[1] != 2:
        return ranks(f)
    new = np.ones(len(f), dtype=bool)
    np.any(f[1:] != f[:-1], axis=1, out=new[1:])
    second, rest = f[:, 1].copy(), new.nonzero()[0]
    found, rank, reached = np.empty(len(f), dtype=np.int64), 0, 0
    while len(rest) and reached < enough and rank < PASSES:
        values = second.take(rest)
        best = np.ones(len(rest), dtype=bool)
        np.less(values[1:], np.minimum.accumulate(values)[:-1], out=best[1:])
        found[rest[best]] = rank
        rest = rest[~best]
        rank, reached = rank + 1, reached + np.count_nonzero(best)
    found[rest] = rank + ranks(f.take(rest, axis=0)) if reached < enough and len(rest) else rank
    if np.count_nonzero(new) == len(f):
        return found
    return found.take(np.maximum.accumulate(np.where(new, np.arange(len(f)), 0)))
