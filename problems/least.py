"""The least value that a requirement of a form can have, and the allocation that has it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from operator import attrgetter
from typing import Any

import numpy as np

from ..arrays import Array, Flags, Integers
from .forms import Feature, Form, Way
from .limits import keeps
from .spread import spread_of

MOST = 4096
"""Most combinations of ways that are evaluated."""


@dataclass(frozen=True, slots=True)
class Least:
    """A bound from below of a requirement's value, and the ways and t (features,) that are near it.

    `value` is met where no tolerance both scatters and lowers the requirement.
    """

    value: float
    chosen: tuple[int, ...]
    t: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Corner:
    """All combinations of ways (c) at their tightest: t (c, f), values (c, r), and what the trading
    feature does: `slopes` (c, r) over a `width` (c,).
    """

    ways: Integers
    t: Array
    values: Array
    slopes: Array
    width: Array


def least_value(form: Form, row: int, limits: Array) -> Least | None:
    """The least value of one requirement while the others keep upper limits (r,).

    All tolerances are at their tightest. One feature without spread may trade one requirement for
    another; it then goes as far as the limits let it. None where more do, where deviations are
    correlated, or where no combination of ways keeps the limits.
    """
    return least_values(form, [row], limits)[0]


def least_values(form: Form, rows: Sequence[int], limits: Array) -> list[Least | None]:
    """`least_value` of each of some requirements."""
    trading = _trading(form)
    kept = [list(range(len(feature.ways))) for feature in form.features]
    if form.combinations > MOST:
        kept = [ways if at in trading else _undominated(form.features[at], ways) for at, ways in enumerate(kept)]
    too_many = np.prod([float(len(ways)) for ways in kept]) > MOST
    if form.correlation is not None or too_many or len(trading) > 1:
        return [None] * len(rows)
    corner = _corner(form, trading, kept)
    return [_least(corner, row, limits, trading) for row in rows]


def _least(corner: _Corner, row: int, limits: Array, trading: list[int]) -> Least | None:
    others = np.arange(len(limits)) != row
    least, most = _course(corner, limits, others)
    moved = np.where(corner.slopes[:, row] >= 0.0, least, most)
    values = corner.values + corner.slopes * moved[:, None]
    possible = (least <= most) & np.all(keeps(values, limits)[:, others], axis=1)
    if not np.any(possible):
        return None
    best = int(np.argmin(np.where(possible, values[:, row], np.inf)))
    t = corner.t[best].copy()
    t[trading] += moved[best]
    return Least(float(values[best, row]), tuple(corner.ways[best].tolist()), t)


def _course(corner: _Corner, limits: Array, others: Flags) -> tuple[Array, Array]:
    """How far (c,) the trading feature must and may go for the limits of the `others`."""
    slopes, room = corner.slopes, limits - corner.values
    at = np.divide(room, slopes, out=np.zeros_like(room), where=slopes != 0.0)
    least = np.max(np.where(others & (slopes < 0.0), at, 0.0), axis=1, initial=0.0)
    most = np.min(np.where(others & (slopes > 0.0), at, np.inf), axis=1, initial=np.inf)
    return np.maximum(least, 0.0), np.minimum(most, corner.width)


def _undominated(feature: Feature, ways: list[int]) -> list[int]:
    """The ways of a feature that have something less than any other at their tightest.

    A way that is nowhere below another, in mean and scatter of each requirement, is left out.
    """
    rows = len(feature.ways[0].linear)
    least = np.array(
        [
            [
                *np.minimum(np.multiply(way.linear, way.low), np.multiply(way.linear, way.high))
                + np.array(way.offset or (0.0,) * rows),
                *np.abs(np.multiply(way.spread, way.low)),
            ]
            for way in (feature.ways[at] for at in ways)
        ]
    )
    undominated: list[int] = []
    for at in np.argsort(least.sum(axis=1), kind="stable").tolist():
        if not any(np.all(least[earlier] <= least[at]) for earlier in undominated):
            undominated.append(at)
    return sorted(ways[at] for at in undominated)


def _corner(form: Form, trading: list[int], kept: list[list[int]]) -> _Corner:
    ways = np.array(list(product(*kept)))

    def every(values: Callable[[Way], Any]) -> Array:
        """Values of the ways of all combinations (c, features), or (c, r, features)."""
        by_feature = [np.array([values(way) for way in feature.ways]) for feature in form.features]
        return np.stack([of_ways[ways[:, at]] for at, of_ways in enumerate(by_feature)], axis=-1)

    low, high, linear, spread = (every(attrgetter(name)) for name in ("low", "high", "linear", "spread"))
    offset = every(lambda way: way.offset or (0.0,) * len(form.outputs))
    tangent = spread_of(form, spread * low[:, None, :])
    fixed = np.ones(len(form.features), dtype=bool)
    fixed[trading] = False
    means = np.minimum(linear * low[:, None, :], linear * np.where(fixed, high, low)[:, None, :])
    # what rounding and an unfinished series may add to a quantile is in its intercept
    along = np.sum(tangent.direction * spread * low[:, None, :], axis=2) + tangent.intercept
    rooted = np.array([quantile is None for quantile in form.rows])
    least = np.where(rooted, tangent.value, along)
    values = form.offset + offset.sum(axis=2) + means.sum(axis=2) + least
    slopes = linear[:, :, trading].sum(axis=2)
    return _Corner(ways, low, values, slopes, (high - low)[:, trading].sum(axis=1))


def _trading(form: Form) -> list[int]:
    """The features without spread that lower one requirement as they grow."""
    return [
        at
        for at, feature in enumerate(form.features)
        if any(np.any(np.array(way.linear) < 0.0) for way in feature.ways)
        and not any(np.any(way.spread) for way in feature.ways)
    ]


def ends_of_front(form: Form, row: int, limits: Array) -> tuple[Array, Array] | None:
    """Ideal and nadir (2,) of cost and one requirement, from proven least values.

    The other requirements keep upper limits (r,). The nadir is the cost of the allocation of least
    value, and the least value of the cheapest allocation. None where these are not known.
    """
    least = least_value(form, row, limits)
    cheapest = _cheapest(form)
    at_cheapest = least_value(cheapest, row, limits)
    if least is None or at_cheapest is None:
        return None
    low = _cost(cheapest, (0,) * len(form.features), at_cheapest.t)
    return np.array([low, least.value]), np.array([_cost(form, least.chosen, least.t), at_cheapest.value])


def _cheapest(form: Form) -> Form:
    """The form with every feature in its cheapest way, as loose as that goes if it has a cost."""
    features = []
    for feature in form.features:
        costs = [float(way.curve.cost(np.array([way.high]))[0]) for way in feature.ways]
        way = feature.ways[int(np.argmin(costs))]
        costly = np.ptp(way.curve.cost(np.array([way.low, way.high]))) > 0.0
        features.append(replace(feature, ways=(replace(way, low=way.high) if costly else way,)))
    return replace(form, features=tuple(features))


def _cost(form: Form, chosen: tuple[int, ...], t: Array) -> float:
    costs = [
        feature.count * float(feature.ways[at].curve.cost(np.array([half_width]))[0])
        for feature, at, half_width in zip(form.features, chosen, t, strict=True)
    ]
    return float(form.base + sum(costs))
