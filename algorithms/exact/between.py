"""Bounds at many limits from the solutions at some: the prices of a neighbour are nearly right."""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...problems.forms import Form
from ...problems.spread import largest_parts
from .choices import Optimum, least_cost
from .prices import less_rounding, spread_at, tabulated

FIRST, SOLVED = 12, 48
"""Sets of limits that are solved first where there are more, and at most."""
LOST = 5e-4
"""Fraction of a cost that a bound by its neighbours' prices may lose before it is solved itself."""
GRID = np.geomspace(0.6, 1.6, 15)
"""Prices that are tried, in units of a neighbour's."""
PAIRS = 1024
"""Combinations of ways that are bounded separately at most."""


def least_bounds(form: Form, limits: Array) -> Array:
    """Proven least costs (n,) at limits (n, r).

    Quantiles take long: at most `SOLVED` sets are solved for them. The others have the Lagrangian
    bounds of their neighbours' prices, or the proven bound at wider limits where it is larger. The
    loss of a bound is estimated from the neighbours' costs: the set that may lose most is solved next.
    """
    if not form.quantiles or len(limits) <= FIRST:
        return least_cost(form, limits).bound
    order = np.lexsort(limits.T[::-1])
    course = _Course(form, limits[order])
    course.solve(np.unique(np.linspace(0, len(order) - 1, FIRST).astype(int)))
    while len(worst := course.worst()):
        course.solve(worst)
    bound = np.empty(len(limits))
    bound[order] = course.bound
    return bound


class _Course:
    """Sets of limits (n, r) in order, some of them solved, with the bounds (n,) of all."""

    def __init__(self, form: Form, limits: Array) -> None:
        self.form, self.limits = form, limits
        self.bound = np.full(len(limits), -np.inf)
        self.cost = np.full(len(limits), np.inf)
        self.solved = np.zeros(len(limits), dtype=bool)
        moving = np.flatnonzero(np.ptp(np.nan_to_num(limits, posinf=0.0), axis=0) > 0.0)
        self._axis = int(moving[0]) if len(moving) == 1 else None

    def solve(self, rows: NDArray[np.intp]) -> None:
        """Solve some sets of limits, and bound those between by them."""
        known = least_cost(self.form, self.limits[rows])
        self.bound[rows], self.cost[rows], self.solved[rows] = known.bound, known.cost, True
        rest = np.flatnonzero(~self.solved)
        place = np.searchsorted(np.flatnonzero(self.solved), rest)
        for side in (-1, 0):
            every = np.flatnonzero(self.solved)
            near = every[np.clip(place + side, 0, len(every) - 1)]
            at = np.searchsorted(rows, near)
            new = (at < len(rows)) & np.isfinite(self.cost[near])
            new[new] = rows[at[new]] == near[new]
            if np.any(new):
                neighbour_bound = _by(self.form, known.at(at[new]), self.limits[rest[new]])
                self.bound[rest[new]] = np.maximum(self.bound[rest[new]], neighbour_bound)
        wider = np.all(self.limits[rows][None, :, :] >= self.limits[rest][:, None, :], axis=2)
        proven = np.where(wider, known.bound[None, :], -np.inf).max(axis=1, initial=-np.inf)
        self.bound[rest] = np.maximum(self.bound[rest], proven)

    def worst(self) -> NDArray[np.intp]:
        """The sets between solved ones whose bounds may lose most, one in each gap."""
        every, rest = np.flatnonzero(self.solved), np.flatnonzero(~self.solved)
        if not len(rest) or len(every) >= SOLVED:
            return np.empty(0, dtype=np.intp)
        above = self._most(every, rest)
        bound, lost = self.bound[rest], np.full(len(rest), np.inf)
        real = np.isfinite(above)
        lost[real] = above[real] - bound[real] - LOST * np.abs(above[real])
        lost[bound == np.inf] = -np.inf  # proven impossible: there is nothing to gain
        gap = np.searchsorted(every, rest)
        worst_rows = [rest[gap == index][np.argmax(lost[gap == index])] for index in np.unique(gap[lost > 0.0])]
        return np.array(worst_rows[: SOLVED - len(every)], dtype=np.intp)

    def _most(self, every: NDArray[np.intp], rest: NDArray[np.intp]) -> Array:
        """Costs (n,) that the unsolved ones hardly exceed: along one limit the chord's."""
        if self._axis is None:
            at = np.searchsorted(every, rest)
            return np.asarray(self.cost[every[np.clip(at - 1, 0, None)]])
        x = self.limits[:, self._axis]
        return np.asarray(np.interp(x[rest], x[every], self.cost[every]))


def _by(form: Form, near: Optimum, limits: Array) -> Array:
    """Lagrangian bounds (n,) at limits (n, r) by the tangents and multiples of prices of `near`."""
    spread = spread_at(form, near.chosen, near.t, largest_parts(form))
    tables, received = tabulated(form, GRID, near.multiplier, limits, spread)
    return np.asarray(form.base + np.max(less_rounding(_combined(tables), received), axis=1).min(axis=0))


def _combined(tables: list[Array]) -> Array:
    """Costs plus prices (combinations, g, n) of every combination of ways, or of the best ways alone."""
    count = int(np.prod([float(len(table)) for table in tables]))
    if count > PAIRS:
        tables = [table.min(axis=0, keepdims=True) for table in tables]

    def joined(first: Array, second: Array) -> Array:
        return np.asarray((first[:, None] + second[None, :]).reshape(-1, *first.shape[1:]))

    return np.asarray(reduce(joined, tables))
