"""A reducer as part of a larger allocation: its cost at an rms of its backlash."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from scipy.special import gammaincinv

from ...arrays import Array, Integers
from ...models.propagation.monte_carlo import units_of
from ..rv_backlash import RvBacklash
from .block import Block, block_of
from .curve import PricedCurve
from .front import ReducerFront, ends_of

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
        while len(kept) > 1 and _above(square, costs, kept[-2], kept[-1], at):
            kept.pop()
        kept.append(at)
    square, costs = square[kept], costs[kept]
    kappa = -scipy.interpolate.PchipInterpolator(square, costs).derivative()(square)
    return PricedCurve(np.sqrt(square), costs, np.maximum(kappa, 1e-9))


def _above(x: Array, y: Array, first: int, middle: int, last: int) -> bool:
    """Whether the middle point lies on or above the chord of the other two."""
    chord = y[first] + (y[last] - y[first]) * (x[middle] - x[first]) / (x[last] - x[first])
    return bool(y[middle] >= chord)
