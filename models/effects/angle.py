"""Effects that follow the angle: waves of orders of the gear, and pulses of defects."""

from __future__ import annotations

from math import cos, inf, log, pi, tau

import numpy as np

from ...errors import Fault
from ...section import Array
from ..gear import CRANK, DECLARED, PINS, SUN, SUN_OVER_CARRIER
from ..measurable import Role
from .effect import EffectParameter, Measurements, Target, Values, quantity, value_or_zero
from .shapes import Columns, OneColumn, Orders, Shape, Weight, no_waves, polar, turns


class EccentricError(Orders):
    """Order of the cranks (40): they are eccentric by a wrong amount."""

    name = "eccentric_error"
    family = "geometry by angle"
    cause = "The error of a crank recurs many times (RV-40E: 40) per turn of the output."
    formula = "c cos k theta + s sin k theta, k the order of the cranks (40)"
    mistaken_for = ("pin_circle_runout", "structural_resonance")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    follows = ((CRANK, 1.0),)


HIGHEST = 130
"""Highest order that is tried where no gear is declared."""
ENCODER_MOUNTING_ORDERS = (1, 2, 4)
"""Orders of encoder and mounting, which other effects cover."""


class GearOrder(Shape):
    """A wave over the angle, its order named by its number.

    With a declared gear, an order that no named effect covers (a tooth mesh, a wave generator);
    where no gear is declared, any whole number of which the rows show two waves, with two rows in each.
    Reference: Smith, Gear Noise and Vibration, 2003,
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

    def lacks(self, measurements: Measurements, target: Target) -> str:
        few = Role.ANGLE in measurements and not orders_shown(target, measurements)
        return f"fewer than {WAVES} waves of an order over the angle" if few else super().lacks(measurements, target)

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
    return tuple(float(k) for k in range(3, HIGHEST + 1) if k not in ENCODER_MOUNTING_ORDERS)


WAVES = 2
"""Waves of an order that nobody declared, at least."""
IN_STEP = 0.7
"""Mean of the wave whose length is one step of the angle, from which rows are in equal steps."""
FINE = 1e-5
"""Part of the range of an angle that is no step, but the noise of its encoder."""


def orders_shown(target: Target, measurements: Measurements) -> tuple[float, ...]:
    """The orders that are tried; where no gear declares them, those of which the rows show several waves."""
    angle = np.asarray(measurements[Role.ANGLE], dtype=float)
    reach, most = float(np.ptp(angle)), highest_order(angle)
    declared = target.gear is not None
    return tuple(k for k in choices(target) if declared or (WAVES * tau <= k * reach and k <= most))


def highest_order(angle: Array) -> float:
    """The highest order whose waves are no others of rows (n,) in equal steps of the angle [rad]: half of the rows
    per turn; any order of other rows.
    """
    reach = float(np.ptp(angle))
    steps = np.diff(np.sort(angle))
    steps = steps[steps > FINE * reach]
    if not len(steps):
        return inf
    per_turn = tau / float(np.median(steps))
    return 0.5 * per_turn if abs(np.mean(np.exp(1j * per_turn * angle))) > IN_STEP else inf


def unheld_orders(measurements: Measurements, target: Target) -> list[Fault]:
    """Faults of declared orders whose waves are others of these rows."""
    if target.gear is None or target.gear.kind != DECLARED or Role.ANGLE not in measurements or not turns(target):
        return []
    most = highest_order(np.asarray(measurements[Role.ANGLE], dtype=float))
    text = "has more waves per turn than half of the rows, {:.6g}: they would be those of another order; leave it out"
    return [Fault(f"gear.orders.{name}", text.format(most)) for name, k in target.gear.orders.items() if k > most]


class OutputEccentricity(Orders):
    """One wave per turn of the output."""

    name = "output_eccentricity"
    family = "geometry by angle"
    cause = "The output, or the encoder on it, is mounted off its axis."
    formula = "c cos 1 theta + s sin 1 theta"
    mistaken_for = ("encoder_harmonics",)
    reference = "Sanchez-Brea and Morlanes, Meas. Sci. Technol. 19, 2008"
    orders = (1,)


class PinCircleRunout(Orders):
    """Order of the pins (39): the pin circle runs out."""

    name = "pin_circle_runout"
    family = "geometry by angle"
    cause = "Every tooth of a disc (39 in the RV-40E) meets the same runout of the pin circle."
    formula = "c cos k theta + s sin k theta, k the order in which pins pass (39)"
    mistaken_for = ("eccentric_error", "pitch_defect", "structural_resonance")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    follows = ((PINS, 1.0),)


BELL, ENDING = 1.0, 2.0
"""Forms of the pulse: it dies away, or begins and ends with the contact."""


class PitchDefect(OneColumn):
    """A pulse at every passing of the pins, 39 times per turn: a pin is defective.

    How a defect is rolled over is not known: the pulse dies away on both sides (von Mises, the
    default), or begins and ends with the contact (a raised cosine, as of a cam). At a
    hundred noise levels the residual of the wrong form has harmonics that would be identified as
    other effects.
    """

    name = "pitch_defect"
    family = "geometry by angle"
    cause = "A defective pin is passed by each tooth of a disc (39 in the RV-40E)."
    formula = (
        "h exp(k (cos(n theta - p) - 1)), n the order in which pins pass (39), k from the pulse's "
        "width at half its height; or, of the same width, a raised cosine that ends"
    )
    needs = (Role.ANGLE,)
    mistaken_for = ("pin_circle_runout", "two_disc_error", "load_sharing")
    reference = "von Mises pulse and raised cosine: Mardia and Jupp, Directional Statistics, 2000, section 3.5"
    weight = Weight("height", "h, height of the pulse", low=-inf)

    def own_applies(self, target: Target) -> bool:
        has_pins = target.gear is not None and target.gear.has(PINS)
        return has_pins and turns(target) and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        return no_waves(target, PINS)

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        middle = "p, position of the pulse in a pitch"
        width = "width of the pulse at half its height, as a fraction of the pitch"
        form = "1: dies away, 2: ends at twice that width"
        return (
            quantity("position", "deg", middle, 0.0, 360.0, linear=False),
            quantity("width", "", width, 0.03, 0.25, linear=False),
            quantity("form", "", form, BELL, ENDING, linear=False, choices=(BELL, ENDING)),
        )

    def missing(self, values: Values, target: Target) -> tuple[str, ...]:
        return tuple(name for name in super().missing(values, target) if name != "form")

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        scans = target.gear.orders[PINS] if target.gear else 0.0
        phase = scans * measurements[Role.ANGLE] - np.radians(values["position_deg"])
        if values.get("form", BELL) == ENDING:
            away = np.abs((phase + pi) % tau - pi) / (tau * values["width"])
            return np.asarray(np.cos(0.5 * pi * np.minimum(away, 1.0)) ** 2)
        sharpness = log(2.0) / (1.0 - cos(pi * values["width"]))
        return np.asarray(np.exp(sharpness * (np.cos(phase) - 1.0)))


class SunRunout(Orders):
    """Orders of the sun (120 and 121): the sun gear runs out."""

    name = "sun_runout"
    family = "geometry by angle"
    cause = "The sun turns 121 times (RV-40E) per turn of the output, 120 against the carrier."
    formula = "the orders of the sun against the carrier and in the housing (120 and 121), as above"
    mistaken_for = ("structural_resonance",)
    reference = "Smith, Gear Noise and Vibration, 2003"
    follows = ((SUN_OVER_CARRIER, 1.0), (SUN, 1.0))


class TwoDiscError(Orders):
    """Twice the orders of pins and cranks (78, 80): errors common to both discs."""

    name = "two_disc_error"
    family = "geometry by angle"
    cause = "Two discs half a turn apart cancel odd waves and double what is common to both."
    formula = "twice the orders of pins and cranks (78 and 80), as above"
    mistaken_for = ("load_sharing", "pitch_defect", "structural_resonance")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    follows = ((PINS, 2.0), (CRANK, 2.0))
