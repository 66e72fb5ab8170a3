"""Cost curves as configurations write them, their extra terms, and sums of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ..section import POSITIVE, Array, Range, Section
from .costs import (
    CURVES,
    Combined,
    CostCurve,
    Exponential,
    Reciprocal,
    ReciprocalPower,
    ReciprocalSquared,
    Table,
    stationary_power,
)


def read_curve(section: Section, default: CostCurve | None = None) -> CostCurve | None:
    """The curve that a table states; without `model` it changes coefficients of the default."""
    name = section.text("model", CURVES)
    base: dict[str, Any] = {}
    if "model" not in section and default is not None:
        name, base = name_of(default), asdict(default)  # type: ignore[call-overload]
    if name is None:
        if "model" not in section:
            section.fault("model", f"is missing; one of {', '.join(CURVES)}")
        return None
    kind = CURVES[name]
    keys = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    values = {key: section.numbers(key) if name == "table" else section.number(key) for key in keys}
    for key in keys:
        if key not in section and key not in base:
            section.fault(key, f"is missing: the cost model {name} needs {', '.join(keys)}")
    section.finish()
    stated = base | {key: value for key, value in values.items() if value is not None}
    if len(stated) < len(keys):
        return None
    curve = kind(**stated)
    faults = curve.faults()
    for key, message in faults:
        section.fault(key, message)
    return None if faults else curve


def name_of(curve: CostCurve) -> str:
    """The configuration name of a curve."""
    return CURVES.name_of(type(curve))


def curve_table(curve: CostCurve) -> dict[str, Any]:
    """The table that states a curve."""
    coefficients: dict[str, Any] = asdict(curve)  # type: ignore[call-overload]
    return {"model": name_of(curve)} | {
        key: list(value) if isinstance(value, tuple) else value for key, value in coefficients.items()
    }


# Costs of a part in addition to its manufacture: its fraction of a set-up, its inspection.


NOT_NEGATIVE = Range(low=0.0)
EXTRAS = ("setup", "inspection")
"""Keys of the costs that are added to that of making a part."""


@dataclass(frozen=True, slots=True)
class Setup:
    """A set-up at a `price` for a `lot` of so many parts."""

    price: float
    lot: int

    @property
    def per_part(self) -> float:
        """Cost per part of the lot."""
        return self.price / self.lot


def read_setup(section: Section) -> Setup | None:
    """`setup = { price = 120, lot = 50 }`, None where there is none or it is at fault."""
    if "setup" not in section:
        section.accept(("setup",))
        return None
    table = section.section("setup")
    price, lot = table.number("price", within=NOT_NEGATIVE), table.integer("lot", Range(low=1))
    for key, meaning in (("price", "the price of a set-up"), ("lot", "the number of parts in a lot")):
        if key not in table and isinstance(section.take("setup"), dict):
            table.fault(key, f"is missing: {meaning}")
    table.finish()
    return None if price is None or lot is None else Setup(price, lot)


def read_extras(section: Section) -> float:
    """What `setup` and `inspection = { price = 0.4 }` add to the cost of a part; 0 without them."""
    setup, inspection = read_setup(section), 0.0
    if "inspection" in section:
        table = section.section("inspection")
        price = table.number("price", within=POSITIVE)
        if "price" not in table:
            table.fault("price", "is missing: the cost of inspecting a part")
        for key in ("u", "guard", "scrap", "rework", "required"):
            if key in table:
                table.take(key)
                table.fault(key, "needs a scatter that does not depend on t: state sigma in a machine")
        table.finish()
        inspection = price or 0.0
    section.accept(("inspection",))
    return inspection + (setup.per_part if setup else 0.0)


def read_extras_by(section: Section, keys: Sequence[str]) -> dict[str, float]:
    """The same for each of `keys`, for which the price of a set-up may differ:
    `setup = { price = { IT6 = 240, IT7 = 120 }, lot = 50 }`.
    """
    stated = section.take("setup")
    prices = stated.get("price") if isinstance(stated, dict) else None
    if not isinstance(prices, dict):
        return dict.fromkeys(keys, read_extras(section))
    table, setup = section.section("setup").section("price"), section.of("setup", stated)
    price_of = {key: table.number(key, within=NOT_NEGATIVE) for key in keys}
    lot = setup.integer("lot", Range(low=1))
    setup.accept(("price",))
    if "lot" not in setup:
        setup.fault("lot", "is missing: the number of parts in a lot")
    for key in keys:
        if key not in table:
            table.fault(key, "is missing: state the set-up of each grade, or a single price for all")
    for part in (table, setup):
        part.finish()
    inspection = read_extras(section.having("setup", {"price": 0.0, "lot": 1}))
    return {key: inspection + (price or 0.0) / (lot or 1) for key, price in price_of.items()}


def add_constant_cost(curve: CostCurve, more: float) -> CostCurve:
    """The curve with a constant added."""
    if more == 0.0:
        return curve
    if isinstance(curve, Table):
        return replace(curve, cost_at=tuple(cost + more for cost in curve.cost_at))
    if isinstance(curve, SumOfCurves):
        return SumOfCurves((*curve.terms, (1.0, Reciprocal(more, 0.0))))
    if not hasattr(curve, "a"):
        return SumOfCurves(((1.0, curve), (1.0, Reciprocal(more, 0.0))))
    return replace(curve, a=curve.a + more)  # type: ignore[type-var]


SCALED = (Reciprocal, ReciprocalSquared, ReciprocalPower, Exponential, Combined)
"""Curves whose cost is in proportion to a, b and c together."""


def times(curve: CostCurve, factor: float) -> CostCurve:
    """The curve with every cost multiplied by `factor`."""
    if isinstance(curve, Table):
        return replace(curve, cost_at=tuple(factor * cost for cost in curve.cost_at))
    if factor == 1.0:
        return curve
    if isinstance(curve, SumOfCurves):
        return SumOfCurves(tuple((factor * weight, one) for weight, one in curve.terms))
    if not isinstance(curve, SCALED):
        return SumOfCurves(((factor, curve),))
    scaled: dict[str, Any] = {key: factor * getattr(curve, key) for key in ("a", "b", "c") if hasattr(curve, key)}
    return replace(curve, **scaled)


def weighted_sum(terms: Sequence[tuple[float, CostCurve]]) -> CostCurve:
    """The curve of sum of weight C(t), weights >= 0: one of the reciprocal family where all are of one exponent."""
    scaled = [times(curve, weight) for weight, curve in terms if weight > 0.0]
    powers = [curve for curve in scaled if not _is_constant(curve)]
    constant = float(np.sum([curve.cost(np.ones(1))[0] for curve in scaled if _is_constant(curve)]))
    if not powers:
        return Reciprocal(constant, 0.0)
    joint = Joint.of(powers)
    if len(powers) == 1:
        return add_constant_cost(powers[0], constant)
    if joint is None or not isinstance(joint.k, float):
        every = [*powers, Reciprocal(constant, 0.0)] if constant else powers
        return SumOfCurves(tuple((1.0, curve) for curve in every))
    a, b = constant + float(joint.a.sum()), float(joint.b.sum())
    return Reciprocal(a, b) if joint.k == 1.0 else ReciprocalPower(a, b, joint.k)


def _is_constant(curve: CostCurve) -> bool:
    return isinstance(curve, Reciprocal) and curve.b == 0.0


@dataclass(frozen=True, slots=True)
class SumOfCurves(CostCurve):
    """The sum of weights times curves."""

    terms: tuple[tuple[float, CostCurve], ...]

    def cost(self, t: Array) -> Array:
        return np.asarray(sum(weight * curve.cost(t) for weight, curve in self.terms))

    def slope(self, t: Array) -> Array:
        return np.asarray(sum(weight * curve.slope(t) for weight, curve in self.terms))

    @property
    def bends(self) -> tuple[float, ...]:
        return tuple(sorted({t for _, curve in self.terms for t in curve.bends}))

    @property
    def smooth(self) -> bool:
        return all(curve.smooth for _, curve in self.terms)

    def best(self, linear: Array, square: Array, low: float, high: float) -> Array:
        """As in the base class; between two entries of tables the sum is smooth and convex."""
        (weight, only), *more = self.terms
        if not more:
            return only.best(linear / weight, square / weight, low, high)
        knots = sorted({t for _, c in self.terms if isinstance(c, Table) for t in c.t if low < t < high})
        if not knots:
            return super(SumOfCurves, self).best(linear, square, low, high)
        ends = np.array([low, *knots, high])
        inside = [
            super(SumOfCurves, self).best(linear, square, first * (1.0 + INSIDE), last * (1.0 - INSIDE))
            for first, last in pairwise(ends.tolist())
        ]
        candidates = np.vstack([np.broadcast_to(ends[:, None], (len(ends), len(linear))), *inside])
        values = self.cost(candidates) + linear * candidates + square * candidates**2
        return np.asarray(candidates[np.argmin(values, axis=0), np.arange(len(linear))])


INSIDE = 1e-12
"""Relative distance from an entry of a table at which the slope is that of the interval beside it."""


# Several curves of the reciprocal family combined: whole matrices of tolerances at once.


EXPONENTS = {Reciprocal: 1.0, ReciprocalSquared: 2.0}


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """C_j(t) = a_j + b_j/t^k_j of features j; coefficients (features,), tolerances (n, features).

    k is a single number where it is the same for all.
    """

    a: Array
    b: Array
    k: float | Array

    @classmethod
    def of(cls, curves: Sequence[CostCurve]) -> Joint | None:
        """The curves combined; None where a curve is of another family."""
        coefficients = []
        for curve in curves:
            if not isinstance(curve, Reciprocal | ReciprocalSquared | ReciprocalPower):
                return None
            k = curve.k if isinstance(curve, ReciprocalPower) else EXPONENTS[type(curve)]
            coefficients.append((curve.a, curve.b, k))
        a, b, k_of = np.array(coefficients, dtype=float).T
        return cls(a, b, float(k_of[0]) if np.all(k_of == k_of[0]) else k_of)

    def cost(self, t: Array) -> Array:
        """C (n, features)."""
        return np.asarray(self.a + self.b / (t if np.all(self.k == 1.0) else t**self.k))

    def stationary(self, linear: Array, square: Array) -> Array | None:
        """As `CostCurve.stationary`, for prices (n, features)."""
        return stationary_power(self.b, self.k, linear, square)
