"""The exact front of a form: from the least cost at given limits to a whole curve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from ...problems.forms import Form
from ...section import Array, Flags
from .bounds import convex_pieces
from .choices import Watch, contributions, ignore_progress, least_cost
from .combination import Combination, Optimum, Path, arc_length
from .programme import Programme

COARSE = 128
"""Limits at which a front with alternatives is solved first."""


def front(
    form: Form,
    points: int,
    upper: Array,
    swept: Flags | None = None,
    most: float = np.inf,
    watch: Watch = ignore_progress,
) -> Optimum:
    """About `points` allocations along the front of cost and the swept requirements.

    `upper` (r,) are limits that all of them keep, inf where there is none, `most` is one on the
    cost; `swept` (r,) marks the requirements that are objectives (all of them, if not given): those
    of one name are one objective. With one objective in addition to the cost the points are spread
    evenly by arc length, with several by a Sobol sequence. `watch` is called as they are solved.
    """
    swept = np.ones(len(upper), dtype=bool) if swept is None else swept
    form = convex_pieces(form)
    smooth = all(feature.ways[0].curve.smooth for feature in form.features)  # prices reach the whole front
    if form.separable and form.combinations == 1 and swept[0] and smooth:
        return _along_path(form, points, float(upper[0]), most)
    low, high = value_range(form, upper)
    high = np.minimum(high, upper)
    if np.any(high < low) or not np.any(swept):
        return least_cost(form, np.where(swept, high, upper)[None, :])
    names = np.array(form.outputs)
    rows = [names == name for name in dict.fromkeys(names[swept].tolist())]
    ends = [(float(low[mask].max()), float(high[mask].max())) for mask in rows]
    if len(rows) == 1:
        coarse = np.linspace(*ends[0], min(COARSE, 2 * points))
        return _by_limits(form, points, rows[0], coarse, upper, most, watch)
    sample = scipy.stats.qmc.Sobol(len(rows), scramble=False).random_base2(int(np.ceil(np.log2(points))))
    limits = np.tile(upper, (points, 1))
    for mask, (first, last), fraction in zip(rows, ends, sample[:points].T, strict=True):
        limits[:, mask] = (first + (last - first) * fraction)[:, None]
    return least_cost(form, limits, watch)


def _by_limits(form: Form, points: int, rows: Flags, coarse: Array, upper: Array, most: float, watch: Watch) -> Optimum:
    """The optima at limits of the requirements `rows`, spread by arc length of a coarse front."""

    def limits(values: Array) -> Array:
        upper_limits = np.tile(upper, (len(values), 1))
        upper_limits[:, rows] = values[:, None]
        return upper_limits

    part = len(coarse) / (len(coarse) + points)
    first = least_cost(form, limits(coarse), lambda optimum, share: watch(optimum, part * share))
    kept = first.cost <= most
    begin = max(0, int(np.argmax(kept)) - 1)  # 0 where all are kept or none
    coarse, cost = coarse[begin:], first.cost[begin:]
    length = arc_length(np.stack([coarse, cost]))
    even = np.interp(np.linspace(0.0, length[-1], points), length, coarse)
    return least_cost(form, limits(even), lambda optimum, share: watch(optimum, part + (1.0 - part) * share))


def _along_path(form: Form, points: int, upper: float, most: float) -> Optimum:
    """The front in closed form, by price; its bounds are not computed (NaN)."""
    combination = Combination(form, (0,) * len(form.features))
    t = Path(combination).front(points, upper, most)
    nothing = np.full(len(t), np.nan)
    chosen = np.zeros(t.shape, dtype=np.int64)
    return Optimum(chosen, t, combination.cost(t), nothing, nothing[:, None])


def value_range(form: Form, upper: Array) -> tuple[Array, Array]:
    """Least and largest value (r,) of each requirement that an allocation of least cost can have.

    The largest is that of the cheapest allocation within limits (r,), or without any where none
    keeps them.
    """
    cheapest = least_cost(form, upper[None, :])
    if not np.isfinite(cheapest.cost[0]):
        cheapest = least_cost(form, np.full((1, len(form.outputs)), np.inf))
    combination = Combination(form, tuple(cheapest.chosen[0].tolist()))
    return tightest(form), combination.values(cheapest.t)[0]


def tightest(form: Form) -> Array:
    """Least value (r,) of each requirement.

    Every feature is made in the way that contributes least: this is exact for one requirement
    without correlation whose linear or root part is zero, else a lower bound.
    """
    if form.correlation is not None:
        return _least_correlated(form)
    linear, square, parts = form.offset, form.constant, []
    for feature in form.features:
        own_linear, own_square = contributions(feature)
        linear, square = linear + own_linear.min(axis=0), square + own_square.min(axis=0)
        parts.append(np.sqrt(own_square.min(axis=0)))
    least = np.sqrt(square)
    if form.joint is not None:  # they rise with every scale, because all laws are unimodal
        rows = form.joint.rows
        tangent = form.joint.tangent(np.stack(parts, axis=1)[None, rows])
        least[rows] = (tangent.value - tangent.value_error)[0]
    return np.asarray(linear + least)


def _least_correlated(form: Form) -> Array:
    """Least value (r,) of each requirement over the hull of the ranges of all ways.

    The coefficients are those of the first way: of correlated features all ways have the same.
    """
    features = tuple(
        replace(f, ways=(replace(f.ways[0], low=min(way.low for way in f.ways), high=max(way.high for way in f.ways)),))
        for f in form.features
    )
    combination = Combination(replace(form, features=features), (0,) * len(features))
    least = combination.tightest_values.copy()
    for at in range(len(least)):
        limit = np.where(np.arange(len(least)) == at, least, np.inf)
        t, _ = Programme(combination).least_excess(limit)
        least[at] = min(least[at], combination.values(t[None, :])[0, at])
    return np.asarray(least)
