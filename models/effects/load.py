"""Effects of the load: compliance, play, and friction of loaded contacts."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from ...section import Array
from ..gear import PINS
from ..measurable import Role
from .effect import EffectParameter, Measurements, Target, Values, kind_of, quantity
from .measurements import play_along_path
from .shapes import POSITIONS, Columns, Load, LoadShape, Orders, Shape, Weight, lacks_loads


class BearingClearance(LoadShape):
    """Dead band: the clearance is taken up over a small torque."""

    name = "bearing_clearance"
    family = "load"
    dimensions = POSITIONS
    cause = "Rolling elements are loaded one after another until the clearance is taken up."
    formula = "c clip(T/T0, -1, 1)"
    mistaken_for = ("lost_motion", "torsional_compliance", "hertz_stiffening")
    reference = "Harris and Kotzalas, Essential Concepts of Bearing Technology, 2006"
    weight = Weight("half_width", "c, half of the dead band")

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        low, high = Load.share(target, 0.02, 0.5)
        meaning = "T0, the load that takes up the clearance (0.02 to 0.5 of the largest)"
        return (quantity("load", Load.unit(target), meaning, low, high, linear=False),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        up = values[self.shape_parameters(target)[0].name]
        return np.clip(Load.of(measurements) / max(up, np.finfo(float).tiny), -1.0, 1.0)


class DirectionalOffset(Shape):
    """Dry friction with different magnitudes in + and - motion.

    It does not apply to positions: of these the half sum of both is `friction_hysteresis`, and the half
    difference its zero. Reference: Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994,
    section 2.1 (friction that depends on the direction).
    """

    name = "directional_offset"
    family = "load"
    cause = "Friction of seals, flanks or preload is greater in one direction than in the other."
    formula = "a (d > 0) - b (d < 0)"
    needs = (Role.DIRECTION,)
    of_rows = True
    mistaken_for = ("friction_hysteresis", "gauge_bias")
    reference = "Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994"

    def own_applies(self, target: Target) -> bool:
        positions = all(kind_of(output.unit) in POSITIONS for output in target.outputs)
        return not positions and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        return "of an angle or a position it is friction_hysteresis and a zero"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("forward", "a, friction in + motion"), Weight("backward", "b, friction in - motion"))

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        direction = np.asarray(measurements[Role.DIRECTION], dtype=float)
        return {"forward": lambda: np.maximum(direction, 0.0), "backward": lambda: np.minimum(direction, 0.0)}


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
    cause = "Dry friction, along an axis also play, changes its side where the motion, or the load, reverses."
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
        along = all(kind_of(output.unit) == "length" for output in target.outputs)
        # ISO 230-2: the reversal error is the difference of the two directions, of either sign
        moving = replace(MOVING, low=-inf, meaning="a, half of the reversal error") if along else MOVING
        return (moving, loop) if either else (moving,)

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
        return tuple(parameter for parameter in parameters if _belongs_to_loop(parameter) == target.locked)

    def missing(self, values: Values, target: Target) -> tuple[str, ...]:
        loop = [parameter for parameter in self.parameters(target) if _belongs_to_loop(parameter)]
        if target.model != LOCKED and not {parameter.name for parameter in loop} & set(values):
            return ()
        twists = [parameter.name for parameter in loop if parameter.linear]
        needed = [parameter.name for parameter in loop if not parameter.linear]
        needed += twists[: not set(twists) & set(values)]
        return tuple(name for name in needed if name not in values)

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        def loop() -> Array:
            load = Load.of(measurements)
            return play_along_path(measurements, load, values[self.shape_parameters(target)[0].name]) - load

        return {MOVING.stem: lambda: np.asarray(measurements[Role.DIRECTION], dtype=float), LOOP: loop}


def _belongs_to_loop(parameter: EffectParameter) -> bool:
    return not parameter.stem.endswith(MOVING.stem)


class HertzStiffening(LoadShape):
    """Hertzian twist, with the torque to the power 2/3."""

    name = "hertz_stiffening"
    family = "load"
    dimensions = POSITIONS
    cause = "Contacts flatten under load and stiffen: their approach grows with T^(2/3)."
    formula = "c sgn(T) |T|^(2/3)"
    mistaken_for = ("torsional_compliance", "bearing_clearance", "lost_motion")
    reference = "Johnson, Contact Mechanics, 1985, section 4.2"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight(f"at_1_{Load.unit(target)}", "c, the twist at a load of 1"),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        load = Load.of(measurements)
        return np.asarray(np.sign(load) * np.cbrt(load) ** 2)


class LoadFriction(LoadShape):
    """Coulomb friction of loaded contacts, in proportion to the magnitude of the load.

    Reference: Palmgren's torque of a rolling bearing under load, M = mu F d/2 (Harris and
    Kotzalas, Essential Concepts of Bearing Technology, 2006, chapter 10); of a whole drive
    Bittencourt and Gunnarsson, J. Dyn. Syst. Meas. Control 134, 2012.
    """

    name = "load_friction"
    family = "load"
    cause = "The friction of teeth and bearings grows with the load."
    formula = "a |T| d"
    needs = (Role.TORQUE, Role.DIRECTION)
    mistaken_for = ("friction_hysteresis", "load_viscous")
    reference = "Bittencourt and Gunnarsson, J. Dyn. Syst. Meas. Control 134, 2012"

    def lacks(self, measurements: Measurements, target: Target) -> str:
        return lacks_loads(measurements) or super().lacks(measurements, target)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, half of the loop per unit of load", Load.unit(target)),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(np.abs(Load.of(measurements)) * measurements[Role.DIRECTION])


class LoadSharing(Orders):
    """Twice the order of the pins (78), in proportion to the signed torque."""

    name = "load_sharing"
    family = "load"
    cause = "The two discs share the load unevenly, twice per tooth of a disc."
    formula = "T (c cos k theta + s sin k theta), k twice the order in which pins pass (78)"
    needs = (Role.ANGLE, Role.TORQUE)
    mistaken_for = ("two_disc_error", "pitch_defect")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    follows = ((PINS, 2.0),)

    def per(self, target: Target) -> str:
        return Load.unit(target)

    def factor(self, measurements: Measurements) -> Array:
        return Load.of(measurements)


class LostMotion(LoadShape):
    """Offset with the sign of the torque."""

    name = "lost_motion"
    family = "load"
    dimensions = POSITIONS
    cause = "A gap is crossed when the torque changes its sign."
    formula = "c sgn(T)"
    mistaken_for = ("bearing_clearance", "friction_hysteresis", "hertz_stiffening")
    reference = "Nordin and Gutman, Automatica 38, 2002"
    weight = Weight("half_width", "c, half of the lost motion")

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.sign(Load.of(measurements))


class TorsionalCompliance(LoadShape):
    """Elastic twist in proportion to the torque."""

    name = "torsional_compliance"
    family = "load"
    dimensions = POSITIONS
    cause = "Shafts, bearings and housing twist elastically, in proportion to the torque."
    formula = "T/K"
    of_stiffness = True
    mistaken_for = ("hertz_stiffening", "bearing_clearance", "lost_motion")
    reference = "Timoshenko, Strength of Materials, 1955"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("compliance", "1/K, twist per unit of torque", Load.unit(target)),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return Load.of(measurements)
