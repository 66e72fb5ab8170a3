"""The exact front of a form: from the least cost at given limits to a whole curve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from ...problems.forms import Form
from ...section import Array, Flags
from .bounds import convex_pieces
from .choices import Watch, contributions, has_only_point_ways, ignore_progress, least_cost
from .combination import Combination, Optimum, Path, arc_length
from .programme import Programme

COARSE = 128
"""Limits at which a front with alternatives is solved first."""
ENVELOPED = 64
"""Combinations of ways of one requirement up to which a front is the lower envelope of theirs."""


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
    curves = [way.curve for feature in form.features for way in feature.ways]
    smooth = all(curve.smooth for curve in curves)  # prices reach the whole front
    if form.separable and form.combinations == 1 and swept[0] and smooth:
        return _along_path(form, points, float(upper[0]), most)
    if form.separable and form.combinations <= ENVELOPED and swept[0] and smooth and not has_only_point_ways(form):
        return _along_envelope(form, points, float(upper[0]), most)
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


def _along_envelope(form: Form, points: int, upper: float, most: float) -> Optimum:
    """The lower envelope of the fronts of all combinations, each by price; its bounds are not computed (NaN).

    Each of these fronts is convex: a point that is below the tangents of all others is on the envelope. At the
    value of any other the least cost is solved for.
    """
    every = [path for path in (Path(Combination(form, chosen)) for chosen in form.choices()) if path.keeps(upper)]
    pairs = [(path, path.drawn(upper, most)) for path in every]
    pairs = [(path, (x, value, cost)) for path, (x, value, cost) in pairs if cost[0] <= most]
    if not pairs:
        return Optimum.unknown(form, np.array([[upper]]))
    paths, drawn = zip(*pairs, strict=True)
    values = np.unique(np.concatenate([value for _, value, _ in drawn]))
    costs = np.stack([np.interp(values, v[::-1], c[::-1], left=np.inf, right=np.inf) for _, v, c in drawn])
    least = costs.min(axis=0)
    falls = np.flatnonzero(least < np.concatenate([[np.inf], np.minimum.accumulate(least)[:-1]]))
    best, number = np.argmin(costs[:, falls], axis=0), np.arange(len(falls))
    begins = 1 + np.flatnonzero(np.diff(best))  # of pieces of the envelope; what lies before has no length
    begins = begins if 2 * len(begins) <= points - 2 else begins[:0]
    steps = np.diff(arc_length(np.stack([values[falls], least[falls]])))
    length = np.concatenate([[0.0], np.cumsum(np.where(np.diff(best) == 0, steps, 0.0))])
    even = np.interp(np.linspace(0.0, length[-1], points - len(begins)), length, number)
    even[[0, -1]] = number[[0, -1]]  # ends that are points have no length
    places = np.sort(np.concatenate([even, begins]))
    at, made = np.interp(places, number, values[falls]), best[np.rint(places).astype(np.int64)]
    t, cost, value = np.empty((points, len(form.features))), np.empty(points), np.empty(points)
    for which in np.unique(made):
        (x, v, _), own = drawn[which], made == which
        t[own] = paths[which].at(np.exp(np.interp(at[own], v[::-1], x[::-1])))
        cost[own], value[own] = paths[which].combination.cost(t[own]), paths[which].value(t[own])
    below = np.stack([path.below(value, *curve) for path, curve in zip(paths, drawn, strict=True)])
    below[made, np.arange(points)] = np.inf
    nothing = np.full(points, np.nan)
    chosen = np.array([path.combination.chosen for path in paths])[made]
    optimum = Optimum(chosen, t, cost, nothing, nothing[:, None])
    if len(near := np.flatnonzero(np.any(below < cost, axis=0))):
        solved = least_cost(form, value[near, None])
        for name in Optimum.__dataclass_fields__:
            getattr(optimum, name)[near] = getattr(solved, name)
    return optimum


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
