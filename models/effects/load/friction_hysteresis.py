"""A hysteresis loop between the two directions of motion or loading."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values, quantity
from ..path import along_path
from ..shapes import Columns, Load, Shape, Weight

LOCKED = "rv_lost_motion"
TABLE = "table"
LOOP, HELD = "compliance", "friction"
MOVING = Weight("half_width", "a, half of the loop")


class FrictionHysteresis(Shape):
    """Hysteresis loop of dry friction between the two directions.

    In motion it depends on the direction, with the input locked on the path of the load. A table
    may be of either kind: its rows decide which parameters are fitted, and the given parameters
    decide which form acts.
    """

    name = "friction_hysteresis"
    family = "load"
    cause = "Dry friction retains part of the twist until the motion, or the load, reverses."
    formula = "a d; input locked: c (play(T, w) - T) along the path"
    needs = (Role.DIRECTION,)
    mistaken_for = ("lost_motion", "viscous_friction", "wear")
    reference = "Visintin, Differential Models of Hysteresis, 1994"

    def own_applies(self, target: Target) -> bool:
        if target.model == LOCKED:
            return Load.role(target) is not None
        return super().own_applies(target)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        meaning = "c, twist per unit of the torque that friction retains"
        loop = Weight(LOOP, meaning, Load.unit(target))
        if target.model == LOCKED:
            return (loop,)
        either = target.model == TABLE and Load.role(target) is not None
        return (MOVING, loop) if either else (MOVING,)

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        if all(weight.stem != LOOP for weight in self.weights(target)):
            return ()
        low, high = Load.share(target, 0.01, 0.5)
        meaning = "w, the load that friction can hold (0.01 to 0.5 of the largest)"
        return (quantity(HELD, Load.unit(target), meaning, low, high, linear=False),)

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        parameters = super().own_parameters(target)
        if target.model != TABLE or target.locked is None:
            return parameters
        return tuple(parameter for parameter in parameters if _of_loop(parameter) == target.locked)

    def missing(self, values: Values, target: Target) -> tuple[str, ...]:
        loop = [parameter for parameter in self.parameters(target) if _of_loop(parameter)]
        if target.model != LOCKED and not {parameter.name for parameter in loop} & set(values):
            return ()
        twists = [parameter.name for parameter in loop if parameter.linear]
        needed = [parameter.name for parameter in loop if not parameter.linear]
        needed += twists[: not set(twists) & set(values)]
        return tuple(name for name in needed if name not in values)

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        def loop() -> Array:
            load = Load.of(measurements)
            return along_path(measurements, load, values[self.shape_parameters(target)[0].name]) - load

        return {MOVING.stem: lambda: np.asarray(measurements[Role.DIRECTION], dtype=float), LOOP: loop}


def _of_loop(parameter: EffectParameter) -> bool:
    return not parameter.stem.endswith(MOVING.stem)
