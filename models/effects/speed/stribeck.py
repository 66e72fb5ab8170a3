"""Friction that falls from its breakaway to its level in motion."""

from __future__ import annotations

from math import inf

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values, quantity
from ..shapes import Columns, Shape, Weight, speed_unit

SLOWEST, FASTEST = 0.01, 0.7
"""Fractions of the largest speed between which the Stribeck speed lies."""
GONE = 1e-6
"""Fraction of the excess at rest below which it is 0: rows at such speeds say nothing of rest."""


class Stribeck(Shape):
    """Friction s at rest that falls to c as a film builds up, within a speed v_s.

    What viscous friction adds at speed is `viscous_friction`. Reference: Stribeck, Z. VDI 46, 1902;
    the Gaussian form of Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994,
    equation 4 with exponent 2.
    """

    name = "stribeck"
    family = "speed"
    cause = "Contacts rub at low speed, and are separated by their oil film as the speed rises."
    formula = "d (c + e exp(-(v/v_s)^2)), e = s - c"
    needs = (Role.SPEED, Role.DIRECTION)
    mistaken_for = ("friction_hysteresis", "viscous_friction", "delay")
    reference = "Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (
            Weight("excess", "e, excess of the friction at rest over that in motion"),
            Weight("level", "c, friction in motion"),
        )

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        fastest = target.largest.get(Role.SPEED, 0.0)
        ends = (SLOWEST * fastest, FASTEST * fastest) if fastest > 0.0 else (0.0, inf)
        meaning = "v_s, speed at which e has fallen to 1/e of itself"
        return (quantity("speed", speed_unit(target), meaning, *ends, linear=False),)

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        direction = np.asarray(measurements[Role.DIRECTION], dtype=float)
        speed = np.asarray(measurements[Role.SPEED], dtype=float)
        name = self.shape_parameters(target)[0].name
        falls = max(values[name], np.finfo(float).tiny)

        def excess() -> Array:
            left = np.exp(-((speed / falls) ** 2))
            return np.asarray(direction * np.where(left < GONE, 0.0, left))

        return {"excess": excess, "level": lambda: direction}
