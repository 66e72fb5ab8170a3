"""Causes that no effect of the library has: the right answer is that they are not named."""

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


OUTSIDE: dict[str, Mechanism] = {
    one.__name__: one
    for one in (
        cubic_torque, third_root_of_torque, order_57, order_33_and_a_half,
        wave_with_square_of_torque, rising_exponential_of_temperature, step_in_time, even_torque,
    )
}  # fmt: skip
