"""A combination of ways: the remaining problem is convex, and separable at given prices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array, Integers
from ...models.costs.joint import Joint
from ...problems.forms import Form, Way
from ...problems.spread import Spread, spread_of
from .prices import Prices

CHORDS = 8
"""Times that a step back within the limits is made longer, where rounding makes it too short."""
HARDLY = 1e-7
"""Fraction of a cost that a step out of the room of rounding may add: more where the tightest leave none."""


@dataclass(frozen=True, slots=True)
class Solved:
    """Least cost at n sets of r limits.

    Tolerances `t` (n, features), `cost` and proven lower `bound` (n,), `multiplier` (n, r): by how
    much the cost falls per unit of each limit. Cost and bound are inf where limits cannot be kept.
    """

    t: Array
    cost: Array
    bound: Array
    multiplier: Array


@dataclass(frozen=True, slots=True)
class Optimum:
    """Least cost at n sets of r limits: a `Solved` with the ways `chosen` (n, features)."""

    chosen: Integers
    t: Array
    cost: Array
    bound: Array
    multiplier: Array

    @classmethod
    def unknown(cls, form: Form, limits: Array, bound: float = np.inf) -> Optimum:
        """No allocation at any of the limits (n, r): infinite costs, and a bound for all of them."""
        shape = len(limits), len(form.features)
        bounds = np.full(shape[0], bound)
        nothing = np.zeros(shape, dtype=np.int64), np.full(shape, np.nan)
        return cls(*nothing, np.full(shape[0], np.inf), bounds, np.zeros_like(limits))

    def at(self, rows: NDArray[np.intp]) -> Optimum:
        """The optima at some of the limits."""
        return Optimum(self.chosen[rows], self.t[rows], self.cost[rows], self.bound[rows], self.multiplier[rows])


@dataclass(frozen=True, eq=False)
class Combination:
    """A `Form` with one way chosen per feature (`chosen`: index per feature).

    Tolerances have shape (n, features), values of the requirements (n, requirements).
    """

    form: Form
    chosen: tuple[int, ...]

    @cached_property
    def ways(self) -> tuple[Way, ...]:
        """The chosen ways."""
        return tuple(f.ways[i] for f, i in zip(self.form.features, self.chosen, strict=True))

    @cached_property
    def counts(self) -> Array:
        """Like parts per feature."""
        return np.array([float(feature.count) for feature in self.form.features])

    @cached_property
    def low(self) -> Array:
        """Least tolerances (features,)."""
        return np.array([way.low for way in self.ways])

    @cached_property
    def high(self) -> Array:
        """Largest tolerances (features,)."""
        return np.array([way.high for way in self.ways])

    @cached_property
    def linear(self) -> Array:
        """m, shape (requirements, features)."""
        return _columns([way.linear for way in self.ways])

    @cached_property
    def spread(self) -> Array:
        """a, shape (requirements, features)."""
        return _columns([way.spread for way in self.ways])

    @cached_property
    def offset(self) -> Array:
        """Constant part of each value (requirements,)."""
        nothing = (0.0,) * len(self.form.outputs)
        offsets = _columns([way.offset or nothing for way in self.ways])
        return np.asarray(self.form.offset + offsets.sum(axis=1))

    @cached_property
    def _joint(self) -> Joint | None:
        return Joint.of([way.curve for way in self.ways])

    def cost(self, t: Array) -> Array:
        """Total cost (n,) of tolerances (n, features)."""
        if self._joint is not None:
            return np.asarray(self.form.base + self._joint.cost(t) @ self.counts)
        costs = [
            count * way.curve.cost(t[:, at]) for at, (way, count) in enumerate(zip(self.ways, self.counts, strict=True))
        ]
        return np.asarray(self.form.base + np.sum(costs, axis=0))

    def slopes(self, t: Array) -> Array:
        """d cost / d t, shape (n, features)."""
        way_slopes = [way.curve.slope(t[:, at]) for at, way in enumerate(self.ways)]
        return np.stack(way_slopes, axis=1) * self.counts

    def parts(self, t: Array) -> Array:
        """s = a t, shape (n, requirements, features)."""
        return np.asarray(t[:, None, :] * self.spread)

    def spread_at(self, t: Array) -> Spread:
        """S of each requirement at tolerances (n, features), and its tangents."""
        return spread_of(self.form, self.parts(t), np.abs(self.high * self.spread))

    def root(self, t: Array) -> Array:
        """S of each requirement (n, requirements)."""
        return self.spread_at(t).value

    def values(self, t: Array) -> Array:
        """The requirements' values (n, requirements)."""
        return np.asarray(self.offset + t @ self.linear.T + self.root(t))

    @cached_property
    def tightest_values(self) -> Array:
        """The requirements' values (requirements,) at the least tolerances."""
        return np.asarray(self.values(self.low[None, :])[0])

    def sizes(self, limit: Array) -> Array:
        """Usual sizes (r,) of the requirements at limits (r,), by which what is small is measured."""
        least, most = np.abs(self.tightest_values), np.abs(self.values(self.high[None, :])[0])
        size = np.maximum(np.where(np.isfinite(limit), np.abs(limit), 0.0), 0.1 * np.minimum(least, most))
        return np.where(size > 0.0, size, np.where(most > 0.0, most, 1.0))

    def gradients(self, t: Array) -> Array:
        """d value / d t, shape (n, requirements, features)."""
        return np.asarray(self.linear + self.spread * self.spread_at(t).direction)

    def best(self, linear: Array, square: Array) -> Array:
        """Tolerances (n, features) of least cost + linear . t + square . t^2 at prices (n, f)."""
        if self._joint is not None:
            t = self._joint.stationary(linear / self.counts, square / self.counts)
            if t is not None:
                return np.clip(t, self.low, self.high)
        t = np.empty_like(linear)
        for at, (way, count) in enumerate(zip(self.ways, self.counts, strict=True)):
            way_prices = linear[:, at] / count, square[:, at] / count
            fixed = way.low == way.high
            t[:, at] = way.low if fixed else way.curve.best(*way_prices, way.low, way.high)
        return t

    def dual(self, multiplier: Array, limit: Array, t: Array) -> Array:
        """A proven lower bound (n,) of the cost at limits (n, r), for any multipliers (n, r) >= 0.

        `t` (n, features) is the reference point; at the optimum and its multipliers the bound is
        the optimum's cost.
        """
        prices = Prices.at(self.form, multiplier, limit, self.spread_at(t))
        ways = enumerate(zip(self.ways, self.counts, strict=True))
        total = np.sum([prices.tolerance(w, at, count)[1] for at, (w, count) in ways], axis=0)
        return prices.bound(self.form, total)


def within(form: Form, optimum: Optimum, limit: Array) -> Optimum:
    """The optima with tolerances moved within upper limits (r,), where their ways allow it.

    Optima at limits that are wider by the room of rounding use that room only where nothing else
    keeps the limits.
    """
    t = optimum.t.copy()
    for row in np.flatnonzero(np.isfinite(optimum.cost)):
        combination = Combination(form, tuple(optimum.chosen[row].tolist()))
        moved = moved_within(combination, t[row], limit, combination.low)
        if moved is not None and combination.cost(moved[None, :])[0] - optimum.cost[row] <= HARDLY * abs(
            optimum.cost[row]
        ):
            t[row] = moved
    return replace(optimum, t=t)


def moved_within(combination: Combination, t: Array, limit: Array, inner: Array) -> Array | None:
    """A point between t and an `inner` one, as near to t as chords allow, that keeps upper limits (r,).

    Values are convex, so that they lie below the chord: where it meets a limit they keep it. None
    where the inner point does not keep the limits.
    """
    values = combination.values(np.stack([t, inner]))
    excess, room = np.maximum(values[0] - limit, 0.0), limit - values[1]
    broken = excess > 0.0
    if not np.any(broken):
        return t
    if np.any(room < 0.0):
        return None
    fraction = float(np.max(excess[broken] / (excess[broken] + room[broken])))
    for _ in range(CHORDS):
        moved = np.asarray(t + fraction * (inner - t))
        if np.all(combination.values(moved[None, :])[0] <= limit):
            return moved
        fraction = min(1.0, 2.0 * fraction + 1e-14)
    return inner


def _columns(rows: Sequence[Sequence[float]]) -> Array:
    return np.array(rows, dtype=float).reshape(len(rows), -1).T
