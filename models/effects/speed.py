"""Effects of the speed: viscous friction, drag, Stribeck friction, and resonance."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...section import Array
from ..measurable import Role
from .effect import EffectParameter, Measurements, Target, Values, quantity
from .shapes import Columns, Load, OneColumn, Shape, SignedSpeed, Weight, lacks_loads, no_waves, speed_unit


class LoadViscous(Shape):
    """Products of load and speed, with the sign of the load and against the motion.

    The first is a compliance that grows with the speed (or a load that is measured late), the
    second the viscous friction of loaded contacts. Reference: Bittencourt and Gunnarsson,
    J. Dyn. Syst. Meas. Control 134, 2012, equation 13; Waiboer, Aarts and Jonker, Multibody
    Dynamics, 2005.
    """

    name = "load_viscous"
    family = "speed"
    cause = "Films between loaded teeth are thinner, and shear more with the speed."
    formula = "a T v + b |T| v d"
    needs = (Role.TORQUE, Role.SPEED, Role.DIRECTION)
    mistaken_for = ("viscous_friction", "load_friction", "torsional_compliance")
    reference = "Bittencourt and Gunnarsson, J. Dyn. Syst. Meas. Control 134, 2012"

    def own_applies(self, target: Target) -> bool:
        return Load.applies(target, self.needs)

    def lacks(self, measurements: Measurements, target: Target) -> str:
        return lacks_loads(measurements) or super().lacks(measurements, target)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        per = f"({Load.unit(target)} {speed_unit(target)})"
        return (
            Weight("signed", "a, with the sign of the load", per, low=-inf),
            Weight("drag", "b, against the motion", per),
        )

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        load, speed = Load.of(measurements), np.asarray(measurements[Role.SPEED], dtype=float)
        return {
            "signed": lambda: np.asarray(load * speed),
            "drag": lambda: np.asarray(np.abs(load) * speed * measurements[Role.DIRECTION]),
        }


SLOWEST, FASTEST = 0.01, 0.7
"""Fractions of the largest speed between which the Stribeck speed lies."""
GONE = 1e-6
"""Fraction of the excess at rest below which it is 0: rows at such speeds say nothing of rest."""


FORMS = (1.0, 2.0)
"""Exponents with which the excess at rest falls."""


class Stribeck(Shape):
    """Friction s at rest that falls to c as a film builds up, within a speed v_s.

    What viscous friction adds at speed is `viscous_friction`. Reference: Stribeck, Z. VDI 46, 1902;
    Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994, equation 4: exponent 1 is the form
    of Tustin (J. IEE 94, 1947), exponent 2, which holds where none is given, the Gaussian one.
    """

    name = "stribeck"
    family = "speed"
    cause = "Contacts rub at low speed, and are separated by their oil film as the speed rises."
    formula = "d (c + e exp(-(v/v_s)^n)), e = s - c, n 1 or 2"
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
        form = "n, exponent with which e falls"
        return (
            quantity("speed", speed_unit(target), meaning, *ends, linear=False),
            quantity("exponent", "", form, *FORMS, linear=False, choices=FORMS),
        )

    def missing(self, values: Values, target: Target) -> tuple[str, ...]:
        return tuple(name for name in super().missing(values, target) if name != "exponent")

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        direction = np.asarray(measurements[Role.DIRECTION], dtype=float)
        speed = np.asarray(measurements[Role.SPEED], dtype=float)
        name = self.shape_parameters(target)[0].name
        falls = max(values[name], np.finfo(float).tiny)

        def excess() -> Array:
            left = np.exp(-((speed / falls) ** values.get("exponent", FORMS[1])))
            return np.asarray(direction * np.where(left < GONE, 0.0, left))

        return {"excess": excess, "level": lambda: direction}


Waves = NDArray[np.complex128]


class StructuralResonance(Shape):
    """Fixed frequency: a wave of any order, magnified where it meets a resonance."""

    name = "structural_resonance"
    family = "speed"
    cause = "A wave of some order excites a natural frequency of the structure at some speed."
    formula = "Re[(c - j s) H exp(j k theta)], H = 1/(1 - r^2 + 2 j z r), r = k v d/f"
    needs = (Role.ANGLE, Role.SPEED)
    mistaken_for = ("eccentric_error", "pin_circle_runout", "two_disc_error", "sun_runout")
    reference = "Den Hartog, Mechanical Vibrations, 1985, section 2.9"

    def own_applies(self, target: Target) -> bool:
        turning = all(target.units.get(role) == unit for role, unit in ((Role.ANGLE, "rad"), (Role.SPEED, "rpm")))
        return turning and target.gear is not None and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        return no_waves(target)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (
            Weight("cos", "c, cosine component of the excitation", low=-inf),
            Weight("sin", "s, its sine component", low=-inf),
        )

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        order = "k, order of the excitation in waves per turn of the angle: those of the gear"
        orders = target.gear.waves if target.gear is not None else ()
        first, last = (orders[0], orders[-1]) if orders else (0.0, inf)
        fastest = target.largest.get(Role.SPEED, 0.0) / 60.0
        # between a quarter of the slowest wave at full speed and just above the quickest
        bounds = (0.25 * first * fastest, 1.1 * last * fastest)
        low, high = bounds if fastest > 0.0 else (0.0, inf)
        return (
            quantity("frequency", "Hz", "f, the natural frequency", low, high, linear=False),
            quantity("damping", "", "z, fraction of the critical damping", 0.005, 0.3, linear=False),
            quantity("order", "", order, first, last, linear=False, choices=orders),
        )

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        wave = response(measurements, values["order"], values["frequency_Hz"], values["damping"])
        return {"cos": lambda: np.ascontiguousarray(wave.real), "sin": lambda: wave.imag.copy()}


def response(measurements: Measurements, order: float, frequency: float, damping: float) -> Waves:
    """H exp(j k theta) (n,), complex; against the direction the wave runs backwards in time."""
    turning = measurements[Role.SPEED] / 60.0
    if Role.DIRECTION in measurements:
        turning = turning * measurements[Role.DIRECTION]
    ratio = order * turning / max(frequency, np.finfo(float).tiny)
    answer = 1.0 / (1.0 - ratio**2 + 2j * damping * ratio)
    return np.asarray(answer * np.exp(1j * order * measurements[Role.ANGLE]))


class ViscousFriction(SignedSpeed):
    """Friction in proportion to the speed."""

    name = "viscous_friction"
    family = "speed"
    cause = "Grease is sheared, and its drag is proportional to the speed."
    formula = "a v d"
    mistaken_for = ("read_out_lag", "windage", "friction_hysteresis")
    separated_by: ClassVar[Mapping[str, str]] = {
        "read_out_lag": "record runs that accelerate: a lag follows the speed itself, friction the torque it needs"
    }
    reference = "Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, per unit of speed", speed_unit(target)),)


class Windage(OneColumn):
    """Drag with the square of the speed."""

    name = "windage"
    family = "speed"
    cause = "Air and oil are displaced, with a drag that grows with the square of the speed."
    formula = "a v^2 d"
    needs = (Role.SPEED, Role.DIRECTION)
    mistaken_for = ("viscous_friction", "read_out_lag")
    reference = "Townsend, Dudley's Gear Handbook, 1991"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        squared = "rpm^2" if speed_unit(target) == "rpm" else "(m/s)^2"
        return (Weight("rate", "a, per squared unit of speed", squared),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.SPEED] ** 2 * measurements[Role.DIRECTION])
