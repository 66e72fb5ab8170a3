"""Forms of points alone: all choices of ways are computed, and the cheapest feasible choice counts.

Machines without inspection have no tolerance to search. Forms of such machines alone have few
choices, which prices of the squares cannot separate under doubt of their scatter.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...problems.forms import Feature, Form
from .combination import Optimum

MOST = 300_000
"""Choices of ways that are computed at most."""


def only_points(form: Form) -> bool:
    """Whether all ways of a form of roots are points, and few enough to compute all choices."""
    points = all(way.low == way.high for feature in form.features for way in feature.ways)
    rooted = form.joint is None and form.correlation is None
    return points and rooted and form.combinations <= MOST


def least_of_points(form: Form, limits: Array) -> Optimum:
    """The cheapest choice that keeps each set of upper limits (n, r); its cost is its own bound.

    Cost and bound are inf where none keeps them.
    """
    cost, values = _every(form)
    order = np.argsort(cost, kind="stable")
    shape = tuple(len(feature.ways) for feature in form.features)
    optimum = Optimum.unknown(form, limits)
    for row, limit in enumerate(limits):
        fits = np.all(values[:, order] <= limit[:, None], axis=0)
        if not np.any(fits):
            continue
        best = int(order[int(np.argmax(fits))])
        ways = np.array(np.unravel_index(best, shape), dtype=np.int64)
        optimum.chosen[row] = ways
        optimum.cost[row] = optimum.bound[row] = cost[best]
        optimum.t[row] = [f.ways[way].low for f, way in zip(form.features, ways, strict=True)]
    return optimum


def _every(form: Form) -> tuple[Array, Array]:
    """Cost (m,) and requirements (r, m) of every choice, the last feature changing fastest."""
    cost, linear = np.full(1, form.base), form.offset[:, None].copy()
    square = form.constant[:, None].copy()
    for feature in form.features:
        costs, ends, squares = _points(feature, len(form.outputs))
        cost = np.add.outer(cost, costs).ravel()
        linear, square = _outer(linear, ends), _outer(square, squares)
    shape = tuple(len(feature.ways) for feature in form.features)
    ways = np.unravel_index(np.arange(len(cost)), shape)
    for row, surplus in enumerate(form.surpluses):
        if surplus is not None:
            way_squares = [
                _points(feature, len(form.outputs))[2][row, way]
                for feature, way in zip(form.features, ways, strict=True)
            ]
            square[row] += surplus.value(np.stack(way_squares, axis=1))[0]
    return cost, linear + np.sqrt(square)


def _outer(sums: Array, more: Array) -> Array:
    """All sums (r, m w) of the sums (r, m) and the contributions (r, w) of a further feature's ways."""
    return np.asarray((sums[:, :, None] + more[:, None, :]).reshape(len(sums), -1))


def _points(feature: Feature, rows: int) -> tuple[Array, Array, Array]:
    """Cost (w,), linear terms and squares (r, w) of the ways of a feature."""
    t = np.array([way.low for way in feature.ways])
    cost = np.array([float(way.curve.cost(t[at : at + 1])[0]) for at, way in enumerate(feature.ways)])
    linear = np.array([way.linear for way in feature.ways]).T * t
    offset = np.array([way.offset or (0.0,) * rows for way in feature.ways]).T
    square = (np.array([way.spread for way in feature.ways]).T * t) ** 2
    return feature.count * cost, linear + offset, square
