"""Alternative ways of making a feature: branch and bound over them, for many limits at once.

Every node fixes the ways of the first features. Its bound is a Lagrangian one at a few prices
around those of the best allocation known: separable, so that the ways still open are each taken at
their best. A node is left at all limits where its bound shows that it cannot be cheaper; where
nothing is left open the allocation is solved. What the search did not enter, because `LEAVES`
solved allocations are enough, counts with its bound: what is returned is always proven.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...problems.forms import Form
from .combination import Combination
from .path import Path
from .prices import ROUNDING, Prices
from .programme import Programme

Array = NDArray[np.float64]
GRID = np.unique(np.concatenate([np.geomspace(0.02, 50.0, 15), np.geomspace(0.7, 1.4, 13)]))
"""Prices at which nodes are bounded, in units of the best known allocation's own."""
LEAVES = 4096
"""Allocations that are solved at most."""
CLOSE = 1e-10
"""A node whose bound is this close to the best cost cannot improve it noticeably."""


@dataclass(frozen=True, slots=True)
class Optimum:
    """Least cost at n sets of r limits: a `Solved` with the ways `chosen` (n, features)."""

    chosen: NDArray[np.int64]
    t: Array
    cost: Array
    bound: Array
    multiplier: Array


def least_cost(form: Form, limits: Array) -> Optimum:
    """The cheapest allocation that keeps each set of upper limits (n, r) of a form.

    Cost and bound are inf where no allocation can keep them.
    """
    search = _Search(form, np.asarray(limits, dtype=float))
    search.leaf((0,) * len(form.features), np.ones(len(limits), dtype=bool))
    if form.combinations > 1:
        search.run()
    return Optimum(search.chosen, search.t, search.cost, search.bound, search.multiplier)


@dataclass(eq=False)
class _Search:
    form: Form
    limits: Array
    leaves: int = 0
    seen: set[tuple[int, ...]] = field(default_factory=set)
    tables: list[Array] = field(default_factory=list)
    received: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        n, features = len(self.limits), len(self.form.features)
        self.separable = len(self.form.outputs) == 1 and self.form.correlation is None
        self.chosen = np.zeros((n, features), dtype=np.int64)
        self.t = np.full((n, features), np.nan)
        self.multiplier = np.zeros_like(self.limits)
        self.cost, self.bound = np.full(n, np.inf), np.full(n, np.inf)
        self.floor = cost_range(self.form)[0]

    def leaf(self, chosen: tuple[int, ...], alive: NDArray[np.bool_]) -> None:
        """Solve one combination at the limits `alive`, once."""
        self.seen.add(chosen)
        self.leaves += 1
        combination = Combination(self.form, chosen)
        solver = Path(combination) if self.separable else Programme(combination)
        solved = solver.least_cost(self.limits[alive])
        self.bound[alive] = np.minimum(self.bound[alive], solved.bound)
        own = solved.cost < self.cost[alive]
        better = np.flatnonzero(alive)[own]
        self.cost[better], self.t[better] = solved.cost[own], solved.t[own]
        self.chosen[better], self.multiplier[better] = chosen, solved.multiplier[own]

    # ---------------------------------------------------------------- bounds of nodes

    def tabulate(self) -> None:
        """Cost plus price of every way at the grid of prices around the best known (ways, g, n)."""
        n = len(self.limits)
        multiplier = self._scaled_multipliers()
        t = np.where(np.isnan(self.t), _middle(self.form), self.t)
        s = t[:, None, :] * _spread(self.form, self.chosen)
        every = np.tile(np.arange(n), len(GRID))
        grid = np.repeat(GRID, n)[:, None]
        prices = Prices.at(self.form, grid * multiplier[every], self.limits[every], s[every])
        shape = (len(GRID), n)
        self.received = prices.received.reshape(shape)
        self.tables = [
            np.stack([
                prices.tolerance(way, at, float(feature.count))[1].reshape(shape)
                for way in feature.ways
            ])
            for at, feature in enumerate(self.form.features)
        ]  # fmt: skip

    def _scaled_multipliers(self) -> Array:
        """The best known multipliers (n, r), those of other limits where none are known."""
        known = np.isfinite(self.cost) & np.any(self.multiplier > 0.0, axis=1)
        usual = np.median(self.multiplier[known], axis=0) if known.any() else 1.0
        return np.asarray(np.where(known[:, None], self.multiplier, usual))

    def bounds(self, ways: tuple[int, ...]) -> Array:
        """Lower bounds (n,) with the first features made in `ways`."""
        decided = [self.tables[at][way] for at, way in enumerate(ways)]
        open_ = [table.min(axis=0) for table in self.tables[len(ways) :]]
        total = np.sum([*decided, *open_], axis=0)
        slack = ROUNDING * (np.abs(total) + np.abs(self.received))
        return np.asarray(self.form.base + np.max(total - self.received - slack, axis=0))

    def run(self) -> None:
        """Branch and bound, begun from the ways that the prices themselves choose."""
        for _ in range(2):
            self.tabulate()
            total = np.sum([table.min(axis=0) for table in self.tables], axis=0)
            at = np.argmax(total - self.received, axis=0)
            columns = np.arange(len(self.limits))
            picked = np.stack([np.argmin(table, axis=0)[at, columns] for table in self.tables])
            for ways in sorted({tuple(column) for column in picked.T.tolist()} - self.seen):
                self.leaf(ways, np.ones(len(self.limits), dtype=bool))
        self.node((), np.ones(len(self.limits), dtype=bool))

    def node(self, ways: tuple[int, ...], alive: NDArray[np.bool_]) -> None:
        """Enter a node at the limits where it may hold something cheaper."""
        if len(ways) == len(self.form.features):
            if ways not in self.seen:
                self.leaf(ways, alive)
            return
        bounds = self.bounds(ways)
        known = np.where(np.isfinite(self.cost), self.cost, 0.0)
        enter = alive & (bounds < self.cost - CLOSE * np.abs(known)) & (self.leaves < LEAVES)
        left = alive & ~enter
        self.bound[left] = np.minimum(self.bound[left], np.maximum(bounds[left], self.floor))
        if np.any(enter):
            for way in range(len(self.form.features[len(ways)].ways)):
                self.node((*ways, way), enter)


def cost_range(form: Form) -> tuple[float, float]:
    """Cost without any limit, and that of every feature at its dearest."""
    ends = np.zeros(2)
    for feature in form.features:
        each = [way.curve.cost(np.array([way.high, way.low])) for way in feature.ways]
        ends += feature.count * np.array([np.min(each), np.max(each)])
    return float(form.base + ends[0]), float(form.base + ends[1])


def _spread(form: Form, chosen: NDArray[np.int64]) -> Array:
    """a (n, r, features) of the chosen ways."""
    columns = [
        np.array([way.spread for way in feature.ways])[chosen[:, at]]
        for at, feature in enumerate(form.features)
    ]
    return np.stack(columns, axis=2)


def _middle(form: Form) -> Array:
    """The middle of each feature's first range."""
    return np.array([0.5 * (f.ways[0].low + f.ways[0].high) for f in form.features])
