"""Causes that no effect of the library has, but for a few that it has by now."""

from __future__ import annotations

import numpy as np

from benchmarks.gap.generator.mechanisms import Injected, Mechanism
from benchmarks.gap.generator.tables import Points


def cubic_torque(rng: np.random.Generator, at: Points) -> Injected:
    return Injected((at.torque / at.largest_torque) ** 3)


def third_root_of_torque(rng: np.random.Generator, at: Points) -> Injected:
    return Injected(np.cbrt(at.torque))


def order_57(rng: np.random.Generator, at: Points) -> Injected:
    return Injected(np.sin(57.0 * at.angle + rng.uniform(0.0, 2.0 * np.pi)))


def order_33_and_a_half(rng: np.random.Generator, at: Points) -> Injected:
    return Injected(np.sin(33.5 * at.angle + rng.uniform(0.0, 2.0 * np.pi)))


def wave_with_square_of_torque(rng: np.random.Generator, at: Points) -> Injected:
    return Injected(np.cos(at.angle + rng.uniform(0.0, 6.28)) * at.torque**2)


def rising_exponential_of_temperature(rng: np.random.Generator, at: Points) -> Injected:
    return Injected(np.expm1(rng.uniform(0.05, 0.12) * at.tau))


def step_in_time(rng: np.random.Generator, at: Points) -> Injected:
    return Injected(np.where(at.time > rng.uniform(0.3, 0.7) * at.time[-1], 1.0, 0.0))


def even_torque(rng: np.random.Generator, at: Points) -> Injected:
    return Injected(at.torque**2)


def progressive_torque(rng: np.random.Generator, at: Points) -> Injected:
    """A rubber coupling: its twist falls behind the torque, and more than any contact's does."""
    share = at.torque / at.largest_torque
    return Injected(np.sign(share) * np.abs(share) ** rng.uniform(1.5, 2.5))


def degressive_torque(rng: np.random.Generator, at: Points) -> Injected:
    """Asperities crushed one after the other: a Hertz-like law with another exponent."""
    share = at.torque / at.largest_torque
    return Injected(np.sign(share) * np.abs(share) ** rng.uniform(0.4, 0.52))


def friction_of_load(rng: np.random.Generator, at: Points) -> Injected:
    """Friction with the size of the torque, whatever its sign; turns over with the direction."""
    return Injected(at.direction * np.abs(at.torque) ** rng.uniform(0.8, 1.2))


def stribeck_friction(rng: np.random.Generator, at: Points) -> Injected:
    """What friction has at low speed above that of sliding."""
    return Injected(at.direction * np.exp(-at.speed / (rng.uniform(0.1, 0.25) * at.speed.max())))


def power_loss(rng: np.random.Generator, at: Points) -> Injected:
    """Torque times speed."""
    return Injected(at.torque * at.speed)


def wave_that_grows_with_temperature(rng: np.random.Generator, at: Points) -> Injected:
    """A seat that loosens as it warms: its eccentricity has the size of the temperature."""
    return Injected(np.cos(at.angle + rng.uniform(0.0, 6.28)) * (at.tau - at.tau.min()))


def daily_swing(rng: np.random.Generator, at: Points) -> Injected:
    """The hall's temperature, which nobody wrote down, over a few days."""
    days = rng.uniform(1.6, 4.4) * at.time / at.time[-1]
    return Injected(np.sin(2.0 * np.pi * days + rng.uniform(0.0, 6.28)))


def softer_when_warm(rng: np.random.Generator, at: Points) -> Injected:
    """A compliance with the square of the temperature, none at 20 degC."""
    return Injected(at.torque * at.tau**2)


OUTSIDE: dict[str, Mechanism] = {
    one.__name__: one
    for one in (
        cubic_torque, third_root_of_torque, order_57, order_33_and_a_half,
        wave_with_square_of_torque, rising_exponential_of_temperature, step_in_time, even_torque,
        progressive_torque, degressive_torque, friction_of_load, stribeck_friction, power_loss,
        wave_that_grows_with_temperature, daily_swing, softer_when_warm,
    )
}  # fmt: skip
SINCE_INSIDE = {"friction_of_load": "load_friction", "stribeck_friction": "stribeck", "power_loss": "load_viscous"}
"""Those that the library has by now, and under what name: records that cannot tell them apart are
scored by it.
"""
