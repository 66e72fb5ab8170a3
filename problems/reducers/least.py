"""Least cost plus price times mean square backlash: the allocations and proven lower bounds.

At a price kappa of E b^2 the stationary tolerances satisfy separately C_j'(t_j) + 2 p a_j
t_j = 0 with one price p = kappa dE/dv of the variance of phi_2 for all of them. p is the fixed
point of a map that contracts by a third; all prices are solved at once.

The bound. For a range [l, h] of the eccentricity its mean, which bends down, is replaced by the
chord, which is below it; then E b^2 is convex, and lies above its tangent at any point. Cost plus
tangent is minimised tolerance by tolerance. The least over all ranges is a lower bound, whatever
the iteration did.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from ...models.rv_reducer.mean_square import mean_square
from .block import Block

PASSES = 32
"""Times the price of the variance is corrected: its error falls to a third each time."""
HALVINGS, ROUGH = 52, 24
"""Steps of the bisection for the eccentricity, in the last passes and before."""
THINNEST, WIDER = 0.01, 1.35
"""Width [um] of the first range of the eccentricity about its optimum, and how the next grow."""


@dataclass(frozen=True, slots=True, eq=False)
class Least:
    """Allocations (n,) of least cost + kappa E b^2: t (n, 9) and bearing (n,) [um], s [arcmin]."""

    t: Array
    bearing: Array
    s: Array
    cost: Array
    square: Array
    """E b^2 [arcmin^2]."""


def least(block: Block, kappa: Array, grade: Integers, near: Least | None = None, passes: int = PASSES) -> Least:
    """The allocations at prices (n,) [per arcmin^2], each in a grade (n,) of `block.grades`.

    From those at prices `near` by fewer `passes` do.
    """
    if near is None:
        t = np.tile(np.sqrt(block.low * block.high)[:-1], (len(kappa), 1))
        bearing = np.full(len(kappa), np.sqrt(block.low[-1] * block.high[-1]))
    else:
        t, bearing = near.t, near.bearing
    for done in range(passes):
        s, price, by_mean, by_free = _prices(block, kappa, grade, t, bearing)
        nothing = np.zeros_like(price)
        columns = [
            curve.best(nothing, price * square, low, high)
            for curve, square, low, high in zip(
                block.curves[:-2], block.square[:-1], block.low, block.high, strict=False
            )
        ]
        t = np.stack([*columns, _eccentricity(block, price, by_mean, HALVINGS if done + 4 > passes else ROUGH)], axis=1)
        bearing = block.curves[-1].best(
            by_free * block.bearing_mean, kappa * block.bearing_variance, float(block.low[-1]), float(block.high[-1])
        )
    s = block.least_shift(*block.of_phi_2(t))
    backlash = block.backlash(t, bearing, grade, s)
    return Least(t, bearing, s, block.cost(t, bearing, grade), backlash.value)


def _prices(block: Block, kappa: Array, grade: Integers, t: Array, bearing: Array) -> tuple[Array, Array, Array, Array]:
    """s, and the prices of variance and mean of phi_2 and of the mean of the rest, each (n,)."""
    mean, variance = block.of_phi_2(t)
    s = block.least_shift(mean, variance)
    backlash = block.backlash(t, bearing, grade, s)
    follows = (s > block.shift.low) & (s < block.shift.high)  # s keeps the mean at the edge
    edge = block.edge if np.isfinite(block.edge) else 0.0
    more = np.where(follows, backlash.by_mean * 0.5 * edge / np.sqrt(variance), 0.0)
    by_mean = np.where(follows, 0.0, backlash.by_mean)
    return s, kappa * (backlash.by_variance + more), kappa * by_mean, kappa * backlash.by_free


def _eccentricity(block: Block, price: Array, by_mean: Array, halvings: int) -> Array:
    """The eccentricity (n,) [um]: its slope over t rises, so that bisection finds the root."""
    curve = block.curves[-2]
    low = np.full_like(price, block.low[-2])
    high = np.full_like(price, block.high[-2])

    def slope(t: Array) -> Array:
        two, four = price * block.square[-1] + by_mean * block.bend, price * block.bend_square
        return np.asarray(curve.slope(t) + 2.0 * two * t + 4.0 * four * t**3)

    for _ in range(halvings):
        middle = 0.5 * (low + high)
        rises = slope(middle) > 0.0
        low, high = np.where(rises, low, middle), np.where(rises, middle, high)
    return 0.5 * (low + high)


def lower_bound(block: Block, kappa: Array, grade: Integers, near: Least) -> Array:
    """Proven lower bounds (n,) of cost + kappa E b^2 over all allocations of each grade.

    The ranges of the eccentricity are thin about that of `near`, and wider farther off.
    """
    low, high = float(block.low[-2]), float(block.high[-2])
    away = THINNEST * WIDER ** np.arange(np.ceil(np.log((high - low) / THINNEST) / np.log(WIDER)))
    offsets = np.concatenate([[low - high], -away[::-1], away, [high - low]])
    edges = np.clip(near.t[:, -1] + offsets[:, None], low, high)
    bounds = np.full(len(kappa), np.inf)
    for first, last in pairwise(edges):
        real = np.flatnonzero(last > first)
        if len(real):
            in_cell = _in_cell(block, kappa, grade, near, first, last, real)
            bounds[real] = np.minimum(bounds[real], in_cell)
    return bounds if high > low else _in_cell(block, kappa, grade, near, edges[0], edges[0], ...)


def _in_cell(
    block: Block, prices: Array, grades: Integers, whole: Least, first: Array, last: Array, rows: Any
) -> Array:
    """The same of some rows with the eccentricity between `first` and `last`."""
    near = Least(*(getattr(whole, name)[rows] for name in Least.__dataclass_fields__))
    kappa, grade, low, high = prices[rows], grades[rows], first[rows], last[rows]
    x = near.t.copy()
    x[:, -1] = np.clip(x[:, -1], low, high)
    ecc, bent = x[:, -1], block.bend * x[:, -1] ** 2
    mean, variance = block.of_phi_2(x)
    chord = block.bend * ((low + high) * ecc - low * high)
    free = block.grade_mean[grade] + block.bearing_mean * near.bearing
    free_variance = block.grade_variance[grade] + block.bearing_variance * near.bearing**2
    s = block.least_shift(mean, variance)
    at = mean_square(free, free_variance, mean - bent + chord + s, variance)
    deviation = np.sqrt(variance)
    by_t = block.square * x / deviation[:, None]
    by_t[:, -1] += 2.0 * block.bend_square * ecc**3 / deviation
    price = kappa * at.by_variance * 2.0 * deviation  # of the deviation
    nu = np.zeros_like(kappa)
    slopes = np.zeros_like(x)
    edge = 0.0
    if np.isfinite(block.edge):  # mean >= edge deviations, loosened by the tangent of the mean
        edge = max(block.edge, 0.0)
        nu = np.where(s > block.shift.low, kappa * at.by_mean, 0.0)
    slopes += (price + nu * edge)[:, None] * by_t
    slopes[:, -1] += kappa * at.by_mean * block.bend * (low + high) - nu * 2.0 * block.bend * ecc
    by_bearing = kappa * (at.by_free * block.bearing_mean + 2.0 * block.bearing_variance * near.bearing)
    by_s = kappa * at.by_mean - nu
    value = kappa * at.value - nu * (mean + s - edge * deviation)
    value = value - np.sum(slopes * x, axis=1) - by_bearing * near.bearing - by_s * s
    value = value + np.minimum(by_s * block.shift.low, by_s * block.shift.high)
    value = value + block.grade_cost[grade]
    for index, slope in enumerate([*slopes.T, by_bearing]):
        ends = float(block.low[index]), float(block.high[index])
        curve, rising = block.curves[index], np.maximum(slope, 0.0)
        y = np.where(slope > 0.0, curve.best(rising, np.zeros_like(rising), *ends), ends[1])
        if index == len(slopes.T) - 1:
            y = np.clip(y, low, high)  # cost and price together are convex
        value = value + curve.cost(y) + slope * y
    return np.asarray(value)
