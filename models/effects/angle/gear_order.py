"""A wave of any order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf

import numpy as np

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import EffectParameter, Readings, Target, quantity, value_or_zero
from ..shapes import Shape, Weight, no_waves, polar, turns

HIGHEST = 130
"""Highest order that is tried where no gear is declared."""
OTHERS = (1, 2, 4)
"""Orders of encoder and mounting, which have effects of their own."""


class GearOrder(Shape):
    """A wave over the angle, its order named by its number.

    With a declared gear, an order that no named effect covers (a tooth mesh, a wave generator);
    where no gear is declared, any whole number. Reference: Smith, Gear Noise and
    Vibration, 2003, chapter 9; ISO 21771 for the tooth numbers.
    """

    name = "gear_order"
    family = "geometry by angle"
    cause = "Some wheel passes, or turns, so many times per turn of the output."
    formula = "c cos k theta + s sin k theta, k any order"
    needs = (Role.ANGLE,)
    mistaken_for = ("structural_resonance",)
    reference = "Smith, Gear Noise and Vibration, 2003"

    def own_applies(self, target: Target) -> bool:
        return turns(target) and bool(choices(target)) and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        if turns(target) and target.gear is not None:
            return "every order of the gear has an effect of its own"
        return no_waves(target)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("cos", "c, cosine component", low=-inf), Weight("sin", "s, sine component", low=-inf))

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        orders = choices(target)
        ends = (orders[0], orders[-1]) if orders else (0.0, inf)
        if len(orders) == 1:
            ends = (0.0, inf)
        meaning = "k, waves per turn of the output"
        return (quantity("order", "", meaning, *ends, linear=False, choices=orders),)

    def columns(
        self, readings: Readings, values: Mapping[str, float], target: Target
    ) -> Mapping[str, Callable[[], Array]]:
        phase = values["order"] * np.asarray(readings[Role.ANGLE], dtype=float)
        return {"cos": lambda: np.cos(phase), "sin": lambda: np.sin(phase)}

    def described(self, values: Mapping[str, float], target: Target) -> dict[str, tuple[float, str]]:
        description: dict[str, tuple[float, str]] = {}
        weights = self.weights(target)
        for output in self.reached(target):
            c, s = (weight.of(output, target) for weight in weights)
            description |= polar(values, c, s, f"{target.prefix(output)}%s")
        if target.gear is not None and (name := target.gear.name_of(value_or_zero(values, "order"))):
            description[f"order of the {name}"] = (value_or_zero(values, "order"), "")
        return description


def choices(target: Target) -> tuple[float, ...]:
    """The orders that are tried, rising."""
    if target.gear is not None:
        return target.gear.unnamed
    return tuple(float(k) for k in range(3, HIGHEST + 1) if k not in OTHERS)
