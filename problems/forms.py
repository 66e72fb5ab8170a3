"""Closed forms of a problem's cost and rows, and the least values that they can take."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from operator import attrgetter
from typing import Any, Protocol

import numpy as np

from ..models.capability.knowledge import Surplus
from ..models.costs import CostCurve
from ..models.propagation.convolution import Even
from ..models.propagation.symmetric_sum import SymmetricSum, Tangent
from ..section import Array, Flags, Integers
from .limits import keeps


class CostBound(Protocol):
    """Lower bounds of the cost of a problem that has no convex form."""

    @property
    def missing(self) -> str:
        """Why there are none, empty where there are some."""
        ...

    @property
    def statement(self) -> str:
        """What they hold for."""
        ...

    def least_costs(self, values: Mapping[str, Array], points: int) -> Array:
        """Bounds (points,) at the limits and at values (points,) of the objectives; inf where no design keeps them."""
        ...

    def estimate(self, values: Mapping[str, float]) -> SampledNeed | None:
        """What a sample shows to be needed at the limits and values of the objectives, None where it shows nothing."""
        ...


class SampledNeed(Protocol):
    """A share of units that allocations need, estimated from a sample."""

    @property
    def needed(self) -> float:
        """The share."""
        ...

    @property
    def units(self) -> int:
        """Units of the sample."""
        ...

    def margins(self, design: Array) -> tuple[Array, Array]:
        """What a full design (variables,) has beyond the needed share, and beyond limits that need no sample (m,), 0 or
        more where it keeps them, and the derivatives (m, variables) by what is not an integer.
        """
        ...

    def share(self, design: Array, searching: bool = True) -> tuple[float, Array]:
        """The share at a full design (variables,), and its derivatives (variables,) by what is not an integer; on the
        units that points are reported on where not `searching`.
        """
        ...


@dataclass(frozen=True, slots=True)
class Way:
    """One way of making a feature: cost curve, range of t (low may equal high), coefficients.

    `linear` (m_ij), `spread` (a_ij) and `offset` (o_ij) hold one number per requirement; an empty
    offset is zero. `choice` is the value that the feature's choice variable takes for it.
    """

    curve: CostCurve
    low: float
    high: float
    linear: tuple[float, ...]
    spread: tuple[float, ...]
    offset: tuple[float, ...] = ()
    choice: float = 0.0


@dataclass(frozen=True, slots=True)
class Piece:
    """One independent deviation `weight` z, z ~ `law`, of a feature or of what is fixed."""

    weight: float
    law: Even


@dataclass(frozen=True, eq=False)
class Quantile:
    """The quantile at a `probability` >= 1/2 of what features deviate.

    Feature j deviates by s_j sum over its `pieces` of weight z; `fixed` pieces deviate as well.
    """

    probability: float
    pieces: tuple[tuple[Piece, ...], ...]
    fixed: tuple[Piece, ...] = ()


class Quantiles:
    """The quantiles among the requirements of a form, all at once.

    Deviations that several of them have in common are one term of one sum, with a weight of its own
    (0 where it is left out) in each.
    """

    def __init__(self, rows: Sequence[Quantile | None]) -> None:
        self.rows = np.array([at for at, quantile in enumerate(rows) if quantile is not None], dtype=int)
        known = [quantile for quantile in rows if quantile is not None]
        self.probability = np.array([quantile.probability for quantile in known])
        weight: dict[tuple[int, int, Even], Array] = {}
        for row, quantile in enumerate(known):
            for at, pieces in enumerate((*quantile.pieces, quantile.fixed)):
                owner = at if at < len(quantile.pieces) else -1
                for place, piece in enumerate(pieces):
                    column = weight.setdefault((owner, place, piece.law), np.zeros(len(known)))
                    column[row] += abs(piece.weight)
        self._sum = SymmetricSum([law for _, _, law in weight])
        self._owner = np.array([owner for owner, _, _ in weight], dtype=int)
        self._weight = np.array(list(weight.values())).reshape(len(weight), len(known)).T

    def tangent(self, s: Array, sure: bool = True) -> Tangent:
        """Values (n, k) of the k quantiles and gradients (n, k, features) at scales of that shape.

        The errors of both are included; those of gradients are wider than necessary unless `sure`.
        """
        n, k, features = s.shape
        featured = self._owner >= 0
        scale = np.where(featured, s[:, :, np.maximum(self._owner, 0)], 1.0) * self._weight
        quantiles = self._sum.quantile(scale.reshape(n * k, -1), np.tile(self.probability, n), sure)
        gradient, doubt = np.zeros((2, features, n, k))
        slopes, errors = (
            np.where(self._weight > 0.0, values.reshape(n, k, -1), 0.0) * self._weight
            for values in (quantiles.gradient, quantiles.gradient_error)
        )
        np.add.at(gradient, self._owner[featured], np.moveaxis(slopes, 2, 0)[featured])
        np.add.at(doubt, self._owner[featured], np.moveaxis(errors, 2, 0)[featured])
        side = np.where(s < 0.0, -1.0, 1.0)
        value, error = (values.reshape(n, k) for values in (quantiles.value, quantiles.value_error))
        return Tangent(value, side * np.moveaxis(gradient, 0, 2), error, np.moveaxis(doubt, 0, 2))


@dataclass(frozen=True, slots=True)
class Feature:
    """A toleranced feature, made in one of several ways; `count` like parts share one tolerance.

    `variable` is the design variable that t is (empty where t only stands for the choice), `choice`
    the design variable that names the way (empty where there is nothing to choose).
    """

    variable: str
    ways: tuple[Way, ...]
    choice: str = ""
    count: int = 1


@dataclass(frozen=True, eq=False)
class Form:
    """The convex form of a problem; see the module for its formula.

    `outputs` names the requirements, in the order of the coefficients. `settled` holds the
    best values of the variables that the form does not search. `relaxed` names the
    limits that it leaves out: with any, it still bounds the cost from below. `exact` says that
    its values are those of the outputs; else they are lower bounds of them. `statement` says in
    words what is proven. `tested` names limits that it leaves out as well, but that are rarely met:
    its optimum counts where it keeps them.

    `quantiles` holds for each requirement what its S is, None for a root; empty: all are roots.
    `most` (r,) are the requirements' own upper limits, in place of a limit of the problem (on a
    yield); inf where the limit is on the output. `also` are forms for designs that this one
    leaves out: the proven bound is the least of all.
    """

    outputs: tuple[str, ...]
    features: tuple[Feature, ...]
    offset: Array
    constant: Array
    statement: str
    base: float = 0.0
    correlation: Array | None = None
    exact: bool = True
    settled: Mapping[str, float] = field(default_factory=dict)
    relaxed: tuple[str, ...] = ()
    quantiles: tuple[Quantile | None, ...] = ()
    most: tuple[float, ...] = ()
    also: tuple[Form, ...] = ()
    tested: tuple[str, ...] = ()
    stands: Mapping[str, str] = field(default_factory=dict)
    """By requirement, an output that it stands for: what is proven holds at equal requirements."""
    surpluses: tuple[Surplus | None, ...] = ()
    """By requirement, what uncertain processes add under its root; empty: nothing anywhere."""
    labels: tuple[tuple[str, str], ...] = ()
    """By requirement, which part of its output it is ("upper limit of gap"), and its unit; empty: it
    is the output."""
    only_bounds: bool = False
    """Whether its values are too far below those of the outputs to search by."""

    @property
    def rows(self) -> tuple[Quantile | None, ...]:
        """What S of each requirement is: a quantile, or None for a root."""
        return self.quantiles or (None,) * len(self.outputs)

    @cached_property
    def joint(self) -> Quantiles | None:
        """All quantiles of the form, None where there is none."""
        return Quantiles(self.rows) if any(quantile is not None for quantile in self.rows) else None

    def requesting_outputs(self, row: str) -> tuple[str, str]:
        """Outputs that ask for a requirement: itself and what it stands for."""
        return row, self.stands.get(row, row)

    @property
    def own_limits(self) -> Array:
        """The requirements' own upper limits (r,), inf where they have none."""
        return np.array(self.most) if self.most else np.full(len(self.outputs), np.inf)

    @property
    def separable(self) -> bool:
        """Whether prices alone make it separable: one root without correlation."""
        alone = len(self.outputs) == 1 and self.correlation is None and self.rows == (None,)
        return alone and not self.surpluses

    @property
    def combinations(self) -> int:
        """Number of ways to choose one way per feature."""
        return int(np.prod([float(len(feature.ways)) for feature in self.features]))

    def choices(self) -> Iterator[tuple[int, ...]]:
        """Every choice of one way per feature."""
        return product(*(range(len(feature.ways)) for feature in self.features))

    def made_in(self, chosen: Sequence[int]) -> Form:
        """The form with the chosen way of each feature alone."""
        return self.with_ways(lambda at, feature: (feature.ways[chosen[at]],))

    def with_ways(self, ways: Callable[[int, Feature], Iterable[Way]]) -> Form:
        """The form with the ways that a function of the place of each feature, and of the feature, gives."""
        features = tuple(replace(feature, ways=tuple(ways(at, feature))) for at, feature in enumerate(self.features))
        return replace(self, features=features)


# S of every requirement of a form: roots and quantiles, with the tangents that bound them.


MIN_SPREAD = 1e-100
"""A smaller value counts as no spread: a price per square of it would overflow."""
ROUNDING = 1e-14
"""Relative allowance for the rounding of the tangent of a norm."""


@dataclass(frozen=True, slots=True)
class Spread:
    """S (n, r) at parts s, its derivatives (n, r, features), and S >= intercept + direction . s.

    The `intercept` (n, r) is lowered by what rounding and an unfinished series may add; it needs
    the largest parts that are considered.
    """

    value: Array
    direction: Array
    intercept: Array


def spread_of(form: Form, s: Array, most: Array | None = None) -> Spread:
    """S at parts s (n, r, features); `most` (r, features) are the largest ones considered."""
    towards = s if form.correlation is None else s @ form.correlation
    square = np.maximum(form.constant + np.sum(towards * s, axis=2), 0.0)
    value = np.sqrt(square)
    safe = np.where(value > 0.0, value, 1.0)
    direction, intercept = towards / safe[..., None], form.constant / safe
    for row, surplus in enumerate(form.surpluses):
        if surplus is not None:  # a norm: its tangent planes lie below it
            more, rise = surplus.value(s[:, row] ** 2)
            root = np.sqrt(square[:, row] + more)
            safe_root = np.where(root > 0.0, root, 1.0)[:, None]
            value[:, row] = root
            direction[:, row] = (towards[:, row] + s[:, row] * rise) / safe_root
            along = np.sum(direction[:, row] * s[:, row], axis=1)
            intercept[:, row] = (root - along) - ROUNDING * (root + np.abs(along))
    if form.joint is not None:
        rows = form.joint.rows
        tangent = form.joint.tangent(s[:, rows], sure=most is not None)
        doubt = tangent.value_error
        if most is not None:
            with np.errstate(invalid="ignore"):
                reach = np.where(most[rows] != 0.0, tangent.gradient_error * np.abs(most[rows]), 0.0)
            doubt = doubt + np.where(np.isfinite(reach), reach, np.inf).sum(axis=2)
        value[:, rows], direction[:, rows] = tangent.value, tangent.gradient
        intercept[:, rows] = tangent.value - np.sum(tangent.gradient * s[:, rows], axis=2) - doubt
    return Spread(np.where(value > MIN_SPREAD, value, 0.0), direction, intercept)


def largest_parts(form: Form) -> Array:
    """The largest parts (r, features) of any way."""
    return np.stack(
        [
            np.max([np.abs(np.multiply(way.spread, way.high)) for way in feature.ways], axis=0)
            for feature in form.features
        ],
        axis=1,
    )


# The least value that a requirement of a form can have, and the allocation that has it.


MAX_CORNERS = 4096
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
    trading = _trading_features(form)
    kept = [list(range(len(feature.ways))) for feature in form.features]
    if form.combinations > MAX_CORNERS:
        kept = [ways if at in trading else _nondominated_ways(form.features[at], ways) for at, ways in enumerate(kept)]
    too_many = np.prod([float(len(ways)) for ways in kept]) > MAX_CORNERS
    if form.correlation is not None or too_many or len(trading) > 1:
        return [None] * len(rows)
    corner = _corner(form, trading, kept)
    return [_least_corner(corner, row, limits, trading) for row in rows]


def _least_corner(corner: _Corner, row: int, limits: Array, trading: list[int]) -> Least | None:
    others = np.arange(len(limits)) != row
    least, most = _trading_range(corner, limits, others)
    moved = np.where(corner.slopes[:, row] >= 0.0, least, most)
    values = corner.values + corner.slopes * moved[:, None]
    possible = (least <= most) & np.all(keeps(values, limits)[:, others], axis=1)
    if not np.any(possible):
        return None
    best = int(np.argmin(np.where(possible, values[:, row], np.inf)))
    t = corner.t[best].copy()
    t[trading] += moved[best]
    return Least(float(values[best, row]), tuple(corner.ways[best].tolist()), t)


def _trading_range(corner: _Corner, limits: Array, others: Flags) -> tuple[Array, Array]:
    """How far (c,) the trading feature must and may go for the limits of the `others`."""
    slopes, room = corner.slopes, limits - corner.values
    at = np.divide(room, slopes, out=np.zeros_like(room), where=slopes != 0.0)
    least = np.max(np.where(others & (slopes < 0.0), at, 0.0), axis=1, initial=0.0)
    most = np.min(np.where(others & (slopes > 0.0), at, np.inf), axis=1, initial=np.inf)
    return np.maximum(least, 0.0), np.minimum(most, corner.width)


def _nondominated_ways(feature: Feature, ways: list[int]) -> list[int]:
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


def _trading_features(form: Form) -> list[int]:
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
    cheapest = _cheapest_corner(form)
    at_cheapest = least_value(cheapest, row, limits)
    if least is None or at_cheapest is None:
        return None
    low = _cost(cheapest, (0,) * len(form.features), at_cheapest.t)
    return np.array([low, least.value]), np.array([_cost(form, least.chosen, least.t), at_cheapest.value])


def _cheapest_corner(form: Form) -> Form:
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
