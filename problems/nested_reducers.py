"""Reducers inside another problem: their fronts as cost curves, or their variables nested."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from scipy.special import gammaincinv, ndtri

from ..models.costs import CostCurve
from ..models.propagation.monte_carlo import units_of
from ..models.rv_reducer.geometry import MeanSquare, mean_square
from ..section import Array, Integers
from ..units import ARCMIN
from .rv_backlash import RvBacklash
from .rv_backlash.shift import BEARING, GRADE, Shift, bearing_term, columns_of, ends, grades_of, shift_of, unit_terms
from .settings import Settings, VariableSetting

# The tolerances of a reducer as its mean square backlash needs them: coefficients and costs.


ECCENTRICITY = "eccentricity_um"
INTERFERENCE = "interference_probability"


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Coefficients in arcmin per um; tolerances t (n, 9) of phi_2 with the eccentricity last.

    phi_2 has the mean `constant` + s + bend t_e^2 and the variance sum square_j t_j^2 + bend_square
    t_e^4; phi_1 mean and variance by grade (k,), phi_3 those of a clearance c: slopes by c and c^2.
    s, what modification and stagger leave, lies in [low, high] and keeps mean >= `edge` deviations
    of phi_2 where interference is limited (-inf where not).
    """

    problem: RvBacklash
    names: tuple[str, ...]
    curves: tuple[CostCurve, ...]
    low: Array
    high: Array
    constant: float
    square: Array
    bend: float
    bend_square: float
    grades: Array
    grade_cost: Array
    grade_mean: Array
    grade_variance: Array
    bearing_mean: float
    bearing_variance: float
    shift: Shift
    edge: float

    def with_more(self, lost: float) -> Block:
        """The same with an additional lost motion [arcmin] of every unit."""
        return replace(self, grade_mean=self.grade_mean + lost) if lost else self

    def of_phi_2(self, t: Array) -> tuple[Array, Array]:
        """Mean less s, and variance (n,) of phi_2 at tolerances t (n, 9)."""
        bent = t[..., -1] ** 2
        variance = t**2 @ self.square + self.bend_square * bent**2
        return self.constant + self.bend * bent, variance

    def least_shift(self, mean: Array, variance: Array) -> Array:
        """The s (n,) of least backlash at a mean less s and a variance of phi_2."""
        if not np.isfinite(self.edge):
            return np.full_like(mean, self.shift.low)
        return np.clip(self.edge * np.sqrt(variance) - mean, self.shift.low, self.shift.high)

    def backlash(self, t: Array, bearing: Array, grade: Integers, s: Array) -> MeanSquare:
        """E b^2 [arcmin^2] of designs: `grade` is a place among `grades`."""
        mean, variance = self.of_phi_2(t)
        free = self.grade_mean[grade] + self.bearing_mean * bearing
        free_variance = self.grade_variance[grade] + self.bearing_variance * bearing**2
        return mean_square(free, free_variance, mean + s, variance)

    def cost(self, t: Array, bearing: Array, grade: Integers) -> Array:
        """Cost (n,) of designs."""
        every = np.concatenate([t, bearing[..., None]], axis=-1)
        costs = [curve.cost(every[..., at]) for at, curve in enumerate(self.curves)]
        return np.asarray(np.sum(costs, axis=0) + self.grade_cost[grade])

    def designs(self, t: Array, bearing: Array, grade: Integers, s: Array) -> Array:
        """Full designs (n, all variables) of the reducer's problem."""
        columns = dict(zip(self.names, (*t.T, bearing), strict=True))
        columns |= {GRADE: self.grades[grade], **columns_of(self.problem, self.shift, s)}
        return np.stack([np.asarray(columns[name]) for name in self.problem.names], axis=1)

    def of_designs(self, designs: Array) -> Array:
        """E b^2 (n,) [arcmin^2] of full designs of the reducer's problem."""
        p = self.problem
        t = np.stack([p.column(designs, name) for name in self.names[:-1]], axis=1)
        grade = np.searchsorted(self.grades, p.column(designs, GRADE)).astype(np.int64)
        unit = p.profile(designs)["modification_backlash_arcmin"]
        gain = p.model.output_factor * p.model.stagger_gain
        s = unit - gain * p.column(designs, "stagger_arcmin")
        return self.backlash(t, p.column(designs, BEARING), grade, s).value


def block_of(problem: RvBacklash) -> Block | str:
    """The coefficients of a reducer's problem, or why it has none."""
    shift = shift_of(problem)
    if shift is None:
        return "its ranges and limits leave the modification no room"
    if problem.change.growth != 0.0:
        return "an effect inflates its spread, which the closed form does not know"
    terms = unit_terms(problem)
    names = tuple(sorted(terms, key=lambda name: name == ECCENTRICITY))
    moments = [terms[name].distribution.raw_moments(4) for name in names]
    if any(abs(m[1]) > 1e-12 or abs(m[3]) > 1e-12 for m in moments):
        return "its errors must be even about their mid-limits"
    linear = np.array([float(terms[name].linear[0]) for name in names]) / ARCMIN
    square = linear**2 * np.array([m[2] for m in moments])
    last = terms[names[-1]]
    q = 0.0 if last.quadratic is None else float(last.quadratic[0]) / ARCMIN
    if q > 0.0:
        return "the eccentricity's mean must bend down"
    grades, phi_1 = grades_of(problem)
    by_grade, by_bearing = phi_1.cumulants(), bearing_term(problem).cumulants()
    ranges = np.array([ends(problem, name) for name in (*names, BEARING)])
    limit = next((bound.high for bound in problem.limits if bound.name == INTERFERENCE), 1.0)
    constant = sum(float(term.constant[0]) for term in terms.values())
    return Block(
        problem=problem,
        names=(*names, BEARING),
        curves=tuple(problem.settings.costs[name] for name in (*names, BEARING)),
        low=ranges[:, 0],
        high=ranges[:, 1],
        constant=(constant + problem.change.effective) / ARCMIN,
        square=square,
        bend=q * moments[-1][2],
        bend_square=q**2 * (moments[-1][4] - moments[-1][2] ** 2),
        grades=grades,
        grade_cost=problem.settings.costs[GRADE].cost(grades),
        grade_mean=by_grade[0] / ARCMIN,
        grade_variance=by_grade[1] / ARCMIN**2,
        bearing_mean=float(by_bearing[0][0]) / ARCMIN,
        bearing_variance=float(by_bearing[1][0]) / ARCMIN**2,
        shift=shift,
        edge=float(ndtri(1.0 - limit)) if limit < 1.0 else -np.inf,
    )


# Cost of a reducer at an rms of its backlash: cost curves for a larger problem.


NODES = 6000
"""Prices at which a curve in closed form is tabulated."""
MIN_GAIN_FRACTION = 1e-6
"""Gain, relative to the largest, below which an error does not count."""


@dataclass(frozen=True, eq=False)
class PricedCurve(CostCurve):
    """Least cost V of a root mean square t, from its conjugate at many prices kappa of t^2.

    `t`, `cost_at` and `kappa` (n,) belong to allocations of least cost + kappa t^2, t rising: V has
    the slope -2 kappa t there. Between them it is a cubic in ln t. `margin` is how much that lies
    above the proven tangents at most: it is taken off, so that V is a lower bound. `price` is a
    factor of the whole cost.
    """

    t: Array
    cost_at: Array
    kappa: Array
    margin: float = 0.0
    price: float = 1.0
    label: str = field(default="")

    @classmethod
    def of(
        cls, t: Array, cost_at: Array, kappa: Array, proven: Array, price: float = 1.0, label: str = ""
    ) -> PricedCurve:
        """The curve of allocations, t rising, with proven lower bounds (n,) of cost + kappa t^2."""
        plain = cls(t, cost_at, kappa, 0.0, 1.0)
        fraction = np.linspace(0.0, 1.0, 9)[:-1]
        tried = np.append((t[:-1, None] + np.diff(t)[:, None] * fraction).ravel(), t[-1])
        at = np.clip(np.searchsorted(t, tried), 1, len(t) - 1)
        tangents = [proven[at - side] - kappa[at - side] * tried**2 for side in (0, 1)]
        above = plain.cost(tried) - np.maximum(*tangents)
        return cls(t, cost_at, kappa, max(0.0, float(above.max())), price, label)

    @cached_property
    def _splines(self) -> list[scipy.interpolate.PPoly]:
        """Cost over ln t, and its first and second derivative."""
        spline = scipy.interpolate.CubicHermiteSpline(np.log(self.t), self.cost_at, -2.0 * self.kappa * self.t**2)
        return [spline, spline.derivative(), spline.derivative().derivative()]

    @cached_property
    def _inverse(self) -> tuple[Array, Array]:
        """ln kappa, rising, and ln t there; the last of those at one bound."""
        return np.log(self.kappa[::-1]), np.log(self.t[::-1])

    @property
    def priced(self) -> bool:
        return True

    def _inside(self, t: Array) -> Array:
        return np.asarray(np.clip(np.asarray(t, dtype=float), self.t[0], self.t[-1]))

    def cost(self, t: Array) -> Array:
        """Beyond the last t the cost stays; below the first it is infinite."""
        t = np.asarray(t, dtype=float)
        priced = self.price * (self._splines[0](np.log(self._inside(t))) - self.margin)
        return np.where(t < self.t[0] * (1.0 - 1e-12), np.inf, priced)

    def slope(self, t: Array) -> Array:
        inside = self._inside(t)
        return np.asarray(self.price * np.minimum(self._splines[1](np.log(inside)), 0.0) / inside)

    def best(self, linear: Array, square: Array, low: float, high: float) -> Array:
        if np.any(linear):
            return super().best(linear, square, low, high)
        unpriced = np.asarray(square) / self.price
        with np.errstate(divide="ignore"):
            x = np.interp(np.log(np.maximum(unpriced, 0.0)), *self._inverse)
        # a secant step on the spline: the residual is rounding
        rise = 2.0 * unpriced * np.exp(2.0 * x)
        bend = self._splines[2](x) + 2.0 * rise
        step = np.where(bend > 0.0, (self._splines[1](x) + rise) / np.where(bend > 0.0, bend, 1.0), 0.0)
        return np.asarray(np.clip(np.exp(x - np.clip(step, -0.02, 0.02)), low, high))

    def price_at(self, t: Array) -> Array:
        """kappa (n,), without the factor, at an rms t (n,)."""
        inside = self._inside(t)
        return np.asarray(-self._splines[1](np.log(inside)) / (2.0 * inside**2))


@dataclass(frozen=True, eq=False)
class Clipped:
    """Least cost of a root mean square t of independent errors, each with its reciprocal cost.

    t^2 = sum (gain_i h_i)^2 with half-widths h_i in [low, high] and costs b_i/h_i; at a price kappa
    of t^2 h_i = (b_i / (2 kappa gain_i^2))^(1/3), clipped.
    """

    gain: Array
    b: Array
    low: float
    high: float

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest t."""
        size = float(np.linalg.norm(self.gain))
        return size * self.low, size * self.high

    @cached_property
    def _prices(self) -> Array:
        """Prices at which any error that counts is between its ends, falling."""
        counts = self.gain > MIN_GAIN_FRACTION * self.gain.max()
        inner = self.b[counts] / (2.0 * self.gain[counts] ** 2)
        return np.geomspace((inner / self.low**3).max(), (inner / self.high**3).min(), NODES)

    def half_widths(self, kappa: Array) -> Array:
        """h (n, errors) at prices kappa (n,) of t^2."""
        with np.errstate(divide="ignore", over="ignore"):
            free = np.cbrt(self.b / (2.0 * np.asarray(kappa)[:, None] * self.gain**2))
        return np.clip(free, self.low, self.high)

    @cached_property
    def curve(self) -> PricedCurve:
        """The least cost over t."""
        h, kappa = self.half_widths(self._prices), self._prices
        t, cost = self.rms(h), np.sum(self.b / h, axis=1)
        apart = np.append(True, np.diff(t) > 1e-12 * t[1:])
        t, cost, kappa = t[apart], cost[apart], kappa[apart]
        return PricedCurve.of(t, cost, kappa, cost + kappa * t**2)

    def allocation(self, t: Array) -> Array:
        """h (n, errors) of least cost at root mean squares t (n,), by bisection on the price."""
        t = np.asarray(t, dtype=float)
        low = np.full(len(t), np.log(self._prices[-1]) - 1.0)
        high = np.full(len(t), np.log(self._prices[0]) + 1.0)
        for _ in range(70):
            middle = 0.5 * (low + high)
            tight = self.rms(self.half_widths(np.exp(middle))) < t
            low, high = np.where(tight, low, middle), np.where(tight, middle, high)
        return self.half_widths(np.exp(0.5 * (low + high)))

    def rms(self, h: Array) -> Array:
        """t (n,) of half-widths (n, errors)."""
        return np.asarray(np.sqrt(h**2 @ self.gain**2))


# Least cost plus price times mean square backlash: the allocations and proven lower bounds.
#
# At a price kappa of E b^2 the stationary tolerances satisfy separately C_j'(t_j) + 2 p a_j
# t_j = 0 with one price p = kappa dE/dv of the variance of phi_2 for all of them. p is the fixed
# point of a map that contracts by a third; all prices are solved at once.
#
# The bound. For a range [l, h] of the eccentricity its mean, which bends down, is replaced by the
# chord, which is below it; then E b^2 is convex, and lies above its tangent at any point. Cost plus
# tangent is minimised tolerance by tolerance. The least over all ranges is a lower bound, whatever
# the iteration did.


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


def least_cost_allocations(
    block: Block, kappa: Array, grade: Integers, near: Least | None = None, passes: int = PASSES
) -> Least:
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
            in_cell = _bound_in_cell(block, kappa, grade, near, first, last, real)
            bounds[real] = np.minimum(bounds[real], in_cell)
    return bounds if high > low else _bound_in_cell(block, kappa, grade, near, edges[0], edges[0], ...)


def _bound_in_cell(
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


# The front of a reducer: least cost against the mean square of its backlash, grade by grade.


PRICES = np.geomspace(1e-2, 3e3, 2000)
"""Prices of an arcmin^2, in units of the cost of one."""
STEPS = 5
"""Secant steps to a mean square: the curve knows the price to four digits already."""
PASSES_FROM_NEIGHBOUR = 12
"""Passes from one price to the next of these steps: an error falls to 1e-6."""
RELATIVE_SPACING = 1e-12
"""Relative distance of neighbouring root mean squares above which two allocations differ."""


@dataclass(frozen=True, eq=False)
class ReducerFront:
    """A proven front: a curve of cost per grade, and the allocations behind it."""

    block: Block
    curves: tuple[PricedCurve, ...]

    @classmethod
    def of(cls, block: Block) -> ReducerFront:
        """The front of a block, solved and proven at `PRICES`."""
        return cls(block, tuple(_curve(block, at) for at in range(len(block.grades))))

    @property
    def evaluations(self) -> int:
        """Prices that were solved."""
        return len(PRICES) * len(self.curves)

    def allocation(self, rms: Array, grade: Integers) -> Least:
        """The allocations (n,) of least cost at root mean squares [arcmin] in a grade each.

        By secants on the price.
        """
        wanted = np.asarray(rms, dtype=float) ** 2
        known = [float(self.curves[g].price_at(np.array([t]))[0]) for t, g in zip(rms, grade, strict=True)]
        x = np.log(np.clip(known, PRICES[0], PRICES[-1]))
        before = x - 1e-3
        made = least_cost_allocations(self.block, np.exp(before), grade)
        missed = np.log(made.square / wanted)
        for _ in range(STEPS):
            made = least_cost_allocations(self.block, np.exp(x), grade, made, PASSES_FROM_NEIGHBOUR)
            now = np.log(made.square / wanted)
            rise = np.where(x != before, (now - missed) / np.where(x != before, x - before, 1.0), 0)
            step = np.where(rise < 0.0, -now / np.where(rise < 0.0, rise, -1.0), 0.0)
            before, missed, x = x, now, x + np.clip(step, -0.05, 0.05)
        return least_cost_allocations(self.block, np.exp(x), grade, made, 2 * PASSES_FROM_NEIGHBOUR)


def ends_of(block: Block) -> tuple[float, float]:
    """Least and largest rms [arcmin] of the front of a block, over all grades."""
    count = len(block.grades)
    prices, grade = np.repeat(PRICES[[0, -1]], count), np.tile(np.arange(count), 2)
    square = least_cost_allocations(block, prices, grade).square
    return float(np.sqrt(square.min())), float(np.sqrt(square.max()))


def _curve(block: Block, at: int) -> PricedCurve:
    grade = np.full(len(PRICES), at)
    allocations = least_cost_allocations(block, PRICES, grade)
    proven = lower_bound(block, PRICES, grade, allocations)
    order = np.argsort(PRICES)[::-1]  # the highest price has the least rms
    t = np.sqrt(allocations.square)[order]
    apart = np.append(True, np.diff(t) > RELATIVE_SPACING * t[1:])
    kept = order[apart]
    return PricedCurve.of(
        np.sqrt(allocations.square)[kept],
        allocations.cost[kept],
        PRICES[kept],
        proven[kept],
        label=f"grade {block.grades[at]:g}",
    )


# A reducer as part of a larger allocation: its cost at an rms of its backlash.


SCATTER = 0.4
"""Standard deviation over mean of the backlash of units of which only the rms is known [assumed];
that of the RV-40E at its least costs is 0.3 to 0.5."""
RATIO = float(gammaincinv(SCATTER**-2, 0.9973) * SCATTER**2 / np.sqrt(1.0 + SCATTER**2))
"""Their 99.73 % quantile over their rms."""
STORED = ("t", "cost_at", "kappa", "margin")
"""Fields of a curve of a proven front that a run stores."""
KNOTS = 33
"""Root mean squares at which quantiles along a front are tabulated."""


@dataclass(frozen=True, eq=False)
class Nested:
    """A front of cost against rms backlash [arcmin], one curve per `grade`.

    `source` says in words where it is from. `block` holds the tolerances behind a proven front; a
    front of points (`points`: rms, cost) has none and proves nothing.
    """

    source: str
    tables: Mapping[str, Any]
    """The tables of a configuration that mean the same reducer."""
    problem: RvBacklash | None = None
    points: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    hysteresis: float = 0.0
    """Lost motion of friction [arcmin] that adds to the backlash."""
    price: float = 1.0
    given_front: ReducerFront | None = field(default=None, repr=False)
    of: Nested | None = field(default=None, repr=False)
    """The same reducer at another price, whose front this one has."""

    def with_(self, hysteresis: float, price: float) -> Nested:
        """The same reducer with a hysteresis [arcmin] and a factor of its cost."""
        if (hysteresis, price) == (self.hysteresis, self.price):
            return self
        variants = self._variants
        if (hysteresis, price) not in variants:
            of = self if hysteresis == self.hysteresis else None
            variant = replace(self, hysteresis=hysteresis, price=price, given_front=None, of=of)
            variants[hysteresis, price] = variant
        return variants[hysteresis, price]

    @cached_property
    def _variants(self) -> dict[tuple[float, float], Nested]:
        """Variants that were asked for: each front is computed once."""
        return {}

    @property
    def proven(self) -> bool:
        """Whether its least cost is proven."""
        return self.problem is not None

    @cached_property
    def block(self) -> Block | None:
        """The coefficients of its tolerances, None of a front of points."""
        if self.problem is None:
            return None
        coefficients = block_of(self.problem)
        assert isinstance(coefficients, Block)  # checked where it was read
        return coefficients.with_more(self.hysteresis)

    @cached_property
    def front(self) -> ReducerFront | None:
        """The proven front; computed once."""
        if self.of is not None:
            return self.of.front
        if self.given_front is not None or self.block is None:
            return self.given_front
        return ReducerFront.of(self.block)

    @cached_property
    def curves(self) -> tuple[PricedCurve, ...]:
        """Proven least costs (or those of the points) by rms, one per grade."""
        if self.front is not None:
            return tuple(replace(curve, price=self.price) for curve in self.front.curves)
        return (replace(curve_of_points(*self.points), price=self.price),)

    @property
    def grades(self) -> Array:
        """The grades of the involute gears, one per curve; 0 of a front of points."""
        return self.block.grades if self.block is not None else np.zeros(1)

    @property
    def front_known(self) -> ReducerFront | None:
        """The front if it has been computed."""
        if self.of is not None:
            return self.of.front_known
        return self.given_front or self.__dict__.get("front")

    @cached_property
    def range(self) -> tuple[float, float]:
        """Least and largest rms; of a proven front by its first and last price alone."""
        if self.front_known is None and self.block is not None:
            return ends_of(self.block)
        return (min(float(curve.t[0]) for curve in self.curves), max(float(curve.t[-1]) for curve in self.curves))

    @property
    def key(self) -> str:
        """What its front depends on, as a digest."""
        text = json.dumps([self.tables, self.hysteresis], sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()

    def stored_arrays(self) -> dict[str, Array]:
        """The proven front as arrays by name; empty of a front of points."""
        if self.front is None:
            return {}
        return {
            f"{self.key}.{at}.{name}": np.asarray(getattr(curve, name))
            for at, curve in enumerate(self.front.curves)
            for name in STORED
        }

    def adopt(self, arrays: Mapping[str, Array]) -> bool:
        """Take a front from arrays; whether they are of this reducer."""
        if self.block is None or self.front_known is not None:
            return True
        try:
            parts = [[arrays[f"{self.key}.{at}.{name}"] for name in STORED] for at in range(len(self.block.grades))]
        except KeyError:
            return False
        curves = tuple(PricedCurve(t, cost_at, kappa, float(margin)) for t, cost_at, kappa, margin in parts)
        object.__setattr__(self.of or self, "given_front", ReducerFront(self.block, curves))
        return True

    def _costs(self, rms: Array) -> Array:
        return np.stack([curve.cost(rms) + curve.price * curve.margin for curve in self.curves])

    def cost(self, rms: Array) -> Array:
        """Least cost (n,) of reducers of at most an rms (n,)."""
        return np.asarray(self._costs(rms).min(axis=0))

    def slope(self, rms: Array) -> Array:
        """Its derivative (n,), in the cheapest grade."""
        slopes = np.stack([curve.slope(rms) for curve in self.curves])
        return np.asarray(np.take_along_axis(slopes, self.grade_at(rms)[None, :], axis=0)[0])

    def grade_at(self, rms: Array) -> Integers:
        """The cheapest grade (n,), as a place among `grades`."""
        return np.asarray(np.argmin(self._costs(rms), axis=0))

    def designs(self, rms: Array) -> Array:
        """Full designs (n, all variables of its problem) of least cost at an rms (n,)."""
        assert self.front is not None and self.block is not None
        grade = self.grade_at(rms)
        most = np.array([float(curve.t[-1]) for curve in self.curves])[grade]
        allocation = self.front.allocation(np.minimum(rms, most), grade)
        return self.block.designs(allocation.t, allocation.bearing, grade, allocation.s)

    @cached_property
    def _quantiles(self) -> scipy.interpolate.PchipInterpolator:
        rms = np.geomspace(*self.range, KNOTS)
        if self.problem is None:
            return scipy.interpolate.PchipInterpolator(rms, rms * RATIO)
        quantiles = self.problem.outputs_of(self.designs(rms), errors=False)["backlash_arcmin"]
        return scipy.interpolate.PchipInterpolator(rms, quantiles)

    def quantile(self, rms: Array) -> Array:
        """Quantile of the backlash (n,) [arcmin] along the front, at the reducer's coverage."""
        return np.asarray(self._quantiles(np.clip(rms, *self.range)))

    def backlashes(self, design: Array | float, points: Array) -> Array:
        """Backlash and hysteresis (units,) [arcmin] of units: `points` (units, dimensions) in
        (0, 1); of a full design of its problem, or of a front of points at an rms.
        """
        if self.problem is None:
            shape = 1.0 / SCATTER**2
            rms = float(np.asarray(design).ravel()[0])
            mean = rms / np.sqrt(1.0 + SCATTER**2)
            return np.asarray(gammaincinv(shape, points[:, 0]) * mean / shape)
        total = self.problem.total(np.atleast_2d(design))
        backlash = units_of(total, points)[0]
        return np.asarray(backlash * (10800.0 / np.pi) + self.hysteresis)

    @property
    def dimensions(self) -> int:
        """Independent errors of a unit."""
        return 1 if self.problem is None else len(self.problem.variables) - 3


def curve_of_points(rms: tuple[float, ...], cost: tuple[float, ...]) -> PricedCurve:
    """A smooth curve through the lower convex hull of points of cost over rms squared."""
    order = np.argsort(rms)
    square, costs = np.array(rms)[order] ** 2, np.array(cost)[order]
    kept: list[int] = []
    for at in range(len(square)):
        if kept and costs[at] >= costs[kept[-1]]:
            continue
        while len(kept) > 1 and _is_above_chord(square, costs, kept[-2], kept[-1], at):
            kept.pop()
        kept.append(at)
    square, costs = square[kept], costs[kept]
    kappa = -scipy.interpolate.PchipInterpolator(square, costs).derivative()(square)
    return PricedCurve(np.sqrt(square), costs, np.maximum(kappa, 1e-9))


def _is_above_chord(x: Array, y: Array, first: int, middle: int, last: int) -> bool:
    """Whether the middle point lies on or above the chord of the other two."""
    chord = y[first] + (y[last] - y[first]) * (x[middle] - x[first]) / (x[last] - x[first])
    return bool(y[middle] >= chord)


# The reducer of document B with its modification: the reducer where none is named.


MODIFICATION = {"stagger_arcmin": 0.0, "dr_rp_mm": -0.04, "dr_p_mm": -0.07}
"""Document B's equidistance and shift modification, without stagger."""
TABLES: dict[str, Any] = {
    "problem": "rv_backlash",
    "parameters": {"reading": "printed"},
    "variables": {name: {"value": value} for name, value in MODIFICATION.items()},
    "objectives": {"minimise": ["cost", "backlash_rms_arcmin"]},
}


@lru_cache(maxsize=1)
def documents_reducer() -> Nested:
    """An RV-40E-121 by document B's closed form as printed, its modification fixed."""
    fixed = {name: VariableSetting(value=value) for name, value in MODIFICATION.items()}
    problem = RvBacklash(
        Settings(parameters={"reading": "printed"}, variables=fixed, objectives=("cost", "backlash_rms_arcmin"))
    )
    return Nested("rv_backlash as printed, document B's modification", TABLES, problem)
