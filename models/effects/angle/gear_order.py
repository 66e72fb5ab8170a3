"""A wave of any order."""

from __future__ import annotations

from math import inf

import numpy as np

from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values, quantity, value_or_zero
from ..shapes import Columns, Shape, Weight, no_waves, polar, turns

HIGHEST = 130
"""Highest order that is tried where no gear is declared."""
OTHERS = (1, 2, 4)
"""Orders of encoder and mounting, which other effects cover."""


class GearOrder(Shape):
    """A wave over the angle, its order named by its number.

    With a declared gear, an order that no named effect covers (a tooth mesh, a wave generator);
    where no gear is declared, any whole number. Reference: Smith, Gear Noise and Vibration, 2003,
    chapter 9; ISO 21771 for the tooth numbers.
    """

    name = "gear_order"
    family = "geometry by angle"
    cause = "A wheel passes, or turns, so many times per turn of the output."
    formula = "c cos k theta + s sin k theta, k any order"
    needs = (Role.ANGLE,)
    mistaken_for = ("structural_resonance",)
    reference = "Smith, Gear Noise and Vibration, 2003"

    def own_applies(self, target: Target) -> bool:
        return turns(target) and bool(choices(target)) and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        if turns(target) and target.gear is not None:
            return "each order of the gear is covered by another effect"
        return no_waves(target)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("cos", "c, cosine component", low=-inf), Weight("sin", "s, sine component", low=-inf))

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        orders = choices(target)
        ends = (orders[0], orders[-1]) if len(orders) > 1 else (0.0, inf)
        meaning = "k, waves per turn of the output"
        return (quantity("order", "", meaning, *ends, linear=False, choices=orders),)

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        phase = values["order"] * np.asarray(measurements[Role.ANGLE], dtype=float)
        return {"cos": lambda: np.cos(phase), "sin": lambda: np.sin(phase)}

    def described(self, values: Values, target: Target) -> dict[str, tuple[float, str]]:
        description: dict[str, tuple[float, str]] = {}
        for output in self.reached(target):
            cosine, sine = (weight.of(output, target) for weight in self.weights(target))
            description |= polar(values, cosine, sine, f"{target.prefix(output)}%s")
        order = value_or_zero(values, "order")
        if target.gear is not None and (name := target.gear.name_of(order)):
            description[f"order of the {name}"] = (order, "")
        return description


def choices(target: Target) -> tuple[float, ...]:
    """The orders that are tried, rising."""
    if target.gear is not None:
        return target.gear.unnamed
    return tuple(float(k) for k in range(3, HIGHEST + 1) if k not in OTHERS)
