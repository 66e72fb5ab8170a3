"""The whole front of one requirement in one combination of ways, along the price nu.

At the least cost under V(t) = offset + sum m_j t_j + S <= L, S = sqrt(constant + sum a_j^2 t_j^2),
there is a multiplier lambda >= 0 with (Karush 1939, Kuhn & Tucker 1951)

    -dC_j/dt_j = lambda (m_j + a_j^2 t_j / S)      inside of the range of t_j.

With lambda = 2 nu S this is -dC_j/dt_j = 2 nu S m_j + 2 nu a_j^2 t_j: for m = 0 every t_j follows
from nu alone, in closed form for the usual curves; for S = 0 nu stands for lambda itself; else S is
the root of S - S(t(nu, S)), which rises with S. V falls as nu rises, so the nu of a limit is a root
as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...models.roots import bracketed_roots
from .combination import Combination, Solved

DECADES = 40.0
"""Prices are searched from 1e-40 to 1e40 of the units of cost and requirement."""
COARSE = 128
"""Prices that the arc length of a front is measured at."""


@dataclass(frozen=True, eq=False)
class Path:
    """The tolerances of least cost of a `Combination` with one requirement, by price."""

    combination: Combination

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Logarithms of a price at which all is loosest, and one at which all is tightest."""
        x = np.linspace(-DECADES, DECADES, 81) * np.log(10.0)
        value = self.value(self.at(np.exp(x)))
        if not value[-1] < value[0]:  # nothing that costs anything moves it
            return float(x[0]), float(x[-1])
        loosest = np.flatnonzero(value >= value[0])[-1]
        tightest = np.flatnonzero(value <= value[-1])[0]
        return float(x[loosest]), float(x[max(tightest, loosest + 1)])

    @cached_property
    def tightest(self) -> Array:
        """The tolerances (features,) of least V; a feature that lowers it is at its widest."""
        return np.asarray(self.at(np.exp(np.array([self.ends[1]])))[0])

    @cached_property
    def cheapest(self) -> Array:
        """The tightest tolerances (features,) of least cost: some are tighter at no cost."""
        return np.asarray(self.at(np.exp(np.array([self.ends[0]])))[0])

    @cached_property
    def _rooted(self) -> bool:
        return bool(self.combination.root(self.combination.high[None, :])[0, 0] > 0.0)

    def value(self, t: Array) -> Array:
        """V (n,)."""
        return self.combination.values(t)[:, 0]

    def at(self, price: Array) -> Array:
        """Tolerances (n, features) at prices nu (n,)."""
        c, nu = self.combination, price[:, None]
        if not self._rooted:
            return c.best(nu * c.linear[0], np.zeros((len(nu), len(c.low))))
        squares = nu * c.spread[0] ** 2
        if not np.any(c.linear):
            return c.best(np.zeros_like(squares), squares)
        return c.best(2.0 * self._root(price)[:, None] * nu * c.linear[0], squares)

    def _root(self, price: Array) -> Array:
        """The S (n,) that equals the S of the tolerances of least cost at it."""
        c = self.combination
        low, high = (float(c.root(end[None, :])[0, 0]) for end in (c.low, c.high))

        def excess(root: Array, nu: Array) -> Array:
            nu, flat = nu.ravel()[:, None], root.ravel()[:, None]
            t = c.best(2.0 * flat * nu * c.linear[0], nu * c.spread[0] ** 2)
            return root - c.root(t)[:, 0].reshape(root.shape)

        roots = bracketed_roots(excess, (low * (1.0 - 1e-9), high * (1.0 + 1e-9)), price)
        return np.asarray(roots.x)

    # ---------------------------------------------------------------- at given limits

    def least_cost(self, limits: Array) -> Solved:
        """Least cost at upper limits (n, 1) of the requirement."""
        c, limit = self.combination, limits[:, 0]
        loosest, tightest = (float(self.value(t[None, :])[0]) for t in (c.high, self.tightest))
        least = float(c.cost(c.high[None, :])[0])
        inner = (limit < float(self.value(self.cheapest[None, :])[0])) & (limit >= tightest)
        t = np.where((limit >= loosest)[:, None], c.high, self.cheapest)
        bound, multiplier = np.full(len(limit), least), np.zeros_like(limits)
        if np.any(inner):
            t[inner], bound[inner], multiplier[inner] = self._inside(limits[inner])
        cost, bound = c.cost(t), np.maximum(bound, least)
        cost[limit < tightest], bound[limit < tightest] = np.inf, np.inf
        return Solved(t, cost, np.minimum(bound, cost), multiplier)

    def _inside(self, limits: Array) -> tuple[Array, Array, Array]:
        """Tolerances, bounds and multipliers at limits that bind."""
        limit = limits[:, 0]
        roots = bracketed_roots(self._excess, self.ends, limit)
        prices = tuple(np.exp(np.asarray(end)) for end in roots.bracket)
        outside, inside = (self.at(price) for price in prices)
        met = self.value(outside) <= limit  # a root to the last digit
        inside = np.where(met[:, None], outside, inside)
        inside = np.where((self.value(inside) <= limit)[:, None], inside, self.tightest)
        multiplier = self._multiplier(prices[1], inside)
        bounds = [
            self.combination.dual(self._multiplier(price, t), limits, t)
            for price, t in zip(prices, (outside, inside), strict=True)
        ]
        return self._between(inside, outside, limit), np.maximum(*bounds), multiplier

    def _excess(self, x: Array, upper: Array) -> Array:
        """V less a limit at logarithms of the price, any shape."""
        return self.value(self.at(np.exp(x.ravel()))).reshape(x.shape) - upper

    def _multiplier(self, price: Array, t: Array) -> Array:
        """lambda (n, 1) of a price nu (n,)."""
        return price[:, None] * (2.0 * self.combination.root(t) if self._rooted else 1.0)

    def _between(self, inside: Array, outside: Array, limit: Array) -> Array:
        """The cheapest point between two optima of one price: curves with kinks jump between them.

        V is convex, so that it crosses the limit once between them.
        """
        differ = np.max(np.abs(outside / inside - 1.0), axis=1) > 1e-9
        if not np.any(differ):
            return inside
        low, high = np.zeros(len(limit)), np.where(differ, 1.0, 0.0)
        for _ in range(60):
            middle = 0.5 * (low + high)
            kept = self.value(inside + middle[:, None] * (outside - inside)) <= limit
            low, high = np.where(kept, middle, low), np.where(kept, high, middle)
        between = inside + low[:, None] * (outside - inside)
        better = self.combination.cost(between) < self.combination.cost(inside)
        return np.where(better[:, None], between, inside)

    # ---------------------------------------------------------------- the whole front

    def front(self, count: int, upper: float = np.inf, most: float = np.inf) -> Array:
        """`count` tolerances (count, features) along the front, evenly by its arc length.

        It begins where V keeps `upper` and ends where the cost keeps `most`.
        """
        ends = self._begin(upper), self._end(most)
        x = np.linspace(ends[0], max(ends), COARSE)
        t = self.at(np.exp(x))
        length = arc_length(np.stack([self.value(t), self.combination.cost(t)]))
        even = np.linspace(0.0, length[-1], count)
        return self.at(np.exp(np.interp(even, length, x)))

    def _begin(self, upper: float) -> float:
        """Logarithm of the least price at which V keeps a limit."""
        value = self.value(self.at(np.exp(np.array(self.ends))))
        if not value[1] < upper < value[0]:
            return self.ends[0]
        return float(bracketed_roots(self._excess, self.ends, upper).bracket[1])

    def _end(self, most: float) -> float:
        """Logarithm of the largest price at which the cost keeps a limit."""
        cost = self.combination.cost(self.at(np.exp(np.array(self.ends))))
        if not cost[0] < most < cost[1]:
            return self.ends[1]

        def excess(x: Array) -> Array:
            t = self.at(np.exp(x.ravel()))
            return self.combination.cost(t).reshape(x.shape) - most

        roots = bracketed_roots(excess, self.ends)
        return float(roots.bracket[0])


def arc_length(drawn: Array) -> Array:
    """Arc length (n,) along points (2, n), each axis in units of its span."""
    finite = np.where(np.isfinite(drawn), drawn, np.nan)
    span = np.nanmax(finite, axis=1) - np.nanmin(finite, axis=1)
    steps = np.nan_to_num(np.diff(finite, axis=1)) / np.where(span > 0.0, span, 1.0)[:, None]
    return np.concatenate([[0.0], np.cumsum(np.hypot(*steps))])
