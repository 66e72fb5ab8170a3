"""Rounding of many variables: changes are priced one by one, and made where they pay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from .neighbours import Mask, Neighbours
from .ranking import Ranking, best

ROUNDS = 40
"""Rounds of pricing at most."""
PAIRS = 24
"""Pairs of changes that are evaluated per round."""
LENGTHS = 24
"""Lengths of a series of changes that are evaluated per round."""
TINY = 1e-12
"""Room below which there is none."""


@dataclass(frozen=True, slots=True, eq=False)
class Prices:
    """What every single change (k,) of a design adds: `use` (k, columns) and `cost` (k,).

    `base_use` (columns,) and `base_cost` are those of the design itself; see `Ranking.use`.
    """

    base_use: Array
    base_cost: float
    use: Array
    cost: Array


def by_moves(near: Neighbours, ranking: Ranking, most: int) -> Mask:
    """The best choices (at most `most`, k) of neighbours that a search by prices finds.

    Each round evaluates every single change, the pairs that look best where the effects of two
    changes are added, and two series: single changes in the order of their saving per use of the
    remaining room, and pairs that save without a variable in common. A round grows with the
    variables.
    """
    count = len(near.at)
    masks = np.stack([np.zeros(count, dtype=bool), near.nearest])
    known = ranking.keys(near.designs(masks))
    masks, known = _few(masks, known, most)
    for _ in range(ROUNDS):
        at, key = masks[0], known[0]
        singles = at ^ np.eye(count, dtype=bool)
        use, cost = ranking.use(near.designs(np.vstack([at[None], singles])))
        prices = Prices(use[0], float(cost[0]), use[1:] - use[0], cost[1:] - cost[0])
        series = np.vstack([_singles(at, prices), *_pairs(at, prices, ranking)])
        keys = np.vstack([ranking.ranked(use[1:], cost[1:]), ranking.keys(near.designs(series))])
        masks, known = _few(np.vstack([masks, singles, series]), np.vstack([known, keys]), most)
        if tuple(known[0].tolist()) >= tuple(key.tolist()):
            break
    return masks


def _few(masks: Mask, keys: Array, most: int) -> tuple[Mask, Array]:
    """The best `most` of them, in order."""
    order = best(keys)[:most]
    return masks[order], keys[order]


def _singles(at: Mask, prices: Prices) -> Mask:
    """Changes that save, in the order of their saving per use of the remaining room."""
    room = np.maximum(-prices.base_use, TINY)
    used = np.max(np.maximum(prices.use, 0.0) / room, axis=1, initial=0.0)
    rows = np.flatnonzero(prices.cost < 0.0)
    order = rows[np.argsort(prices.cost[rows] / (used[rows] + TINY), kind="stable")]
    return _first(at, order[:, None], prices)


def _pairs(at: Mask, prices: Prices, ranking: Ranking) -> tuple[Mask, Mask]:
    """The best pairs by added effects, and a series of pairs without a variable in common."""
    first, second = np.triu_indices(len(at), 1)
    use = prices.base_use + prices.use[first] + prices.use[second]
    keys = ranking.ranked(use, prices.base_cost + prices.cost[first] + prices.cost[second])
    order = best(keys)[: 4 * len(at)]
    pairs = np.stack([first[order], second[order]], axis=1)
    alone = np.repeat(at[None], min(PAIRS, len(pairs)), axis=0)
    for row, pair in enumerate(pairs[:PAIRS].tolist()):
        alone[row, pair] ^= True
    base = ranking.ranked(prices.base_use[None], np.array([prices.base_cost]))[0]
    pays = [tuple(key) < tuple(base.tolist()) for key in keys[order].tolist()]
    return alone, _first(at, _apart(pairs[np.array(pays, dtype=bool)]), prices)


def _apart(pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs, from the first, that have no variable in common."""
    taken, disjoint = set[int](), []
    for first, second in pairs.tolist():
        if first not in taken and second not in taken:
            taken |= {first, second}
            disjoint.append((first, second))
    return np.array(disjoint, dtype=np.int64).reshape(-1, 2)


def _first(at: Mask, groups: NDArray[np.int64], prices: Prices) -> Mask:
    """The design after the first n of the groups (g, size) of changes: several n around the largest
    that keeps to the remaining room where effects are added.
    """
    if not len(groups):
        return np.empty((0, len(at)), dtype=bool)
    total = prices.base_use + np.cumsum(prices.use[groups].sum(axis=1), axis=0)
    fits = np.all(total <= np.maximum(prices.base_use, 0.0), axis=1)
    most = len(groups) if np.all(fits) else int(np.argmin(fits))
    ends = np.unique(np.clip(most + np.arange(-LENGTHS // 2, LENGTHS // 2), 1, len(groups)))
    masks = np.repeat(at[None], len(ends), axis=0)
    for row, end in enumerate(ends.tolist()):
        masks[row, groups[:end].ravel()] ^= True
    return masks
