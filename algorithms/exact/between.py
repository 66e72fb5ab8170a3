"""Bounds at many limits from the solutions at some: the prices of a neighbour are nearly right."""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ...problems.forms import Form
from ...problems.spread import Spread, largest_parts, spread_of
from .choices import Optimum, least_cost
from .prices import ROUNDING, Prices

Array = NDArray[np.float64]
SOLVED = 48
"""Sets of limits that are solved where there are more."""
GRID = np.geomspace(0.6, 1.6, 15)
"""Prices that are tried, in units of a neighbour's."""
PAIRS = 1024
"""Combinations of ways that are told apart."""


def least_bounds(form: Form, limits: Array) -> Array:
    """Proven least costs (n,) at limits (n, r).

    Of quantiles, which take long, at most `SOLVED` are solved; the others have the Lagrangian
    bounds of their neighbours' prices, and no less than what is proven at wider limits.
    """
    if not form.quantiles or len(limits) <= SOLVED:
        return least_cost(form, limits).bound
    order = np.lexsort(limits.T[::-1])
    some = order[np.unique(np.linspace(0, len(order) - 1, SOLVED).astype(int))]
    known = least_cost(form, limits[some])
    found = np.full(len(limits), -np.inf)
    found[some] = known.bound
    rest = np.setdiff1d(order, some)
    rank = np.argsort(order)
    place = np.searchsorted(rank[some], rank[rest])
    for side in (-1, 0):
        at = np.clip(place + side, 0, len(some) - 1)
        real = np.isfinite(known.cost[at])
        if np.any(real):
            near = known.at(at[real])
            found[rest[real]] = np.maximum(found[rest[real]], _by(form, near, limits[rest[real]]))
    wider = np.all(limits[some][None, :, :] >= limits[:, None, :], axis=2)
    proven = np.where(wider, known.bound[None, :], -np.inf).max(axis=1)
    return np.asarray(np.maximum(found, proven))


def _by(form: Form, near: Optimum, limits: Array) -> Array:
    """Lagrangian bounds (n,) at limits (n, r) by the tangents and multiples of prices of `near`."""
    n, shape = len(limits), (len(GRID), len(limits))
    spread = np.stack(
        [np.array([way.spread for way in feature.ways])[near.chosen[:, at]]
         for at, feature in enumerate(form.features)], axis=2)  # fmt: skip
    once = spread_of(form, near.t[:, None, :] * spread, largest_parts(form))
    every, grid = np.tile(np.arange(n), len(GRID)), np.repeat(GRID, n)[:, None]
    tangent = Spread(once.value[every], once.direction[every], once.intercept[every])
    prices = Prices.at(form, grid * near.multiplier[every], limits[every], tangent)
    tables = [
        prices.ways(feature, at)[1].reshape(-1, *shape) for at, feature in enumerate(form.features)
    ]
    received = prices.received.reshape(shape)
    total = _combined(tables)
    slack = ROUNDING * (np.abs(total) + np.abs(received))
    return np.asarray(form.base + np.max(total - received - slack, axis=1).min(axis=0))


def _combined(tables: list[Array]) -> Array:
    """Costs plus prices (combinations, g, n): every combination of ways, or the least of each."""
    count = int(np.prod([float(len(table)) for table in tables]))
    if count > PAIRS:
        tables = [table.min(axis=0, keepdims=True) for table in tables]

    def joined(one: Array, other: Array) -> Array:
        return np.asarray((one[:, None] + other[None, :]).reshape(-1, *one.shape[1:]))

    return np.asarray(reduce(joined, tables))
