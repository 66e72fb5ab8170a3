"""The exact front of a form: from the least cost at given limits to a whole curve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from ...problems.forms import Form
from .choices import Optimum, least_cost
from .combination import Combination
from .path import Path
from .programme import Programme

Array = NDArray[np.float64]
COARSE = 128
"""Limits at which the course of a front with alternatives is found first."""


def front(form: Form, points: int, upper: Array, swept: NDArray[np.bool_]) -> Optimum:
    """About `points` allocations along the front of cost and the `swept` requirements (r,).

    `upper` (r,) are limits that all of them keep; inf where there is none. With one requirement
    swept the points are spread evenly by arc length, with several by a Sobol sequence over them.
    """
    low, high = value_range(form, upper)
    high = np.minimum(high, upper)
    if np.any(high < low):
        return least_cost(form, high[None, :])
    high = np.where(swept, high, upper)
    if np.count_nonzero(swept) != 1:
        sobol = qmc.Sobol(int(np.count_nonzero(swept)), scramble=False)
        sample = sobol.random_base2(max(0, points - 1).bit_length())[:points]
        limits = np.tile(high, (points, 1))
        limits[:, swept] = low[swept] + (high - low)[swept] * sample
        return least_cost(form, limits)
    if len(form.outputs) == 1 and form.combinations == 1 and form.correlation is None:
        return _along_path(form, points, float(high[0]))
    only = int(np.argmax(swept))

    def limits_at(values: Array) -> Array:
        found = np.tile(high, (len(values), 1))
        found[:, only] = values
        return found

    coarse = np.linspace(float(low[only]), float(high[only]), COARSE)
    first = least_cost(form, limits_at(coarse))
    length = _length(np.stack([coarse, first.cost]))
    even = np.interp(np.linspace(0.0, length[-1], points), length, coarse)
    return least_cost(form, limits_at(even))


def _along_path(form: Form, points: int, upper: float) -> Optimum:
    """In closed form, by price; bounds are left to who asks for them."""
    combination = Combination(form, (0,) * len(form.features))
    path = Path(combination)
    t = path.front(points)
    keeps = path.value(t) <= upper
    if not np.all(keeps):
        last = path.least_cost(np.array([[upper]])).t
        t = np.vstack([t[keeps], last])
    nothing = np.full(len(t), np.nan)
    chosen = np.zeros(t.shape, dtype=np.int64)
    return Optimum(chosen, t, combination.cost(t), nothing, nothing[:, None])


def _length(drawn: Array) -> Array:
    """Arc length (n,) along points (2, n), each axis in units of its span."""
    finite = np.where(np.isfinite(drawn), drawn, np.nan)
    span = np.nanmax(finite, axis=1) - np.nanmin(finite, axis=1)
    steps = np.nan_to_num(np.diff(finite, axis=1)) / np.where(span > 0.0, span, 1.0)[:, None]
    return np.concatenate([[0.0], np.cumsum(np.hypot(*steps))])


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

    Every feature is made in the way that contributes least: exact for one requirement without
    correlation and either part zero, else a lower bound.
    """
    r = range(len(form.outputs))
    linear, square = form.offset.astype(float), form.constant.astype(float)
    for feature in form.features:
        parts = np.array([
            [(way.offset[i] if way.offset else 0.0)
             + min(way.linear[i] * way.low, way.linear[i] * way.high) for i in r]
            for way in feature.ways
        ])  # fmt: skip
        spread = np.array([np.multiply(way.spread, way.low) for way in feature.ways])
        linear = linear + parts.min(axis=0)
        square = square + (spread**2).min(axis=0)
    if form.correlation is not None:
        return _least_correlated(form)
    return np.asarray(linear + np.sqrt(square))


def _least_correlated(form: Form) -> Array:
    """Least value (r,) of each requirement over the hull of the ranges of all ways.

    The coefficients are those of the first way: of correlated features all ways have the same.
    """
    features = tuple(
        replace(f, ways=(replace(f.ways[0], low=min(way.low for way in f.ways),
                                 high=max(way.high for way in f.ways)),))
        for f in form.features
    )  # fmt: skip
    combination = Combination(replace(form, features=features), (0,) * len(features))
    least = combination.values(combination.low[None, :])[0]
    for at in range(len(least)):
        limit = np.where(np.arange(len(least)) == at, least, np.inf)
        t, _ = Programme(combination).least_excess(limit)
        least[at] = min(least[at], combination.values(t[None, :])[0, at])
    return np.asarray(least)
