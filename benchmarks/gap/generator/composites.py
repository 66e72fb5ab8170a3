"""Records in which one effect dominates: smaller ones beside it, one of them perhaps in no library.

What measured data look like: one effect explains 90 to 99.9 % of the squared gap, and one to three
more of half to five noise levels lie beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.gap.generator.mechanisms import Injected, Mechanism
from benchmarks.gap.generator.outside import (
    cubic_torque,
    daily_swing,
    even_torque,
    rising_exponential_of_temperature,
    softer_when_warm,
    step_in_time,
    wave_that_grows_with_temperature,
    wave_with_square_of_torque,
)
from benchmarks.gap.generator.tables import Points

LARGE, SMALL = (10.0, 100.0), (0.5, 5.0)
"""Rms in noise levels of the effect that dominates, and of those beside it."""
OUTSIDE_SHARE, POOR_SHARE, TURNED_SHARE = 0.5, 0.5, 0.1
"""Of the records: one effect outside of the library, a poor design, the output's sign turned."""


def torque_times_square_of_speed(rng: np.random.Generator, at: Points) -> Injected:
    """A wind-up that the speed lets grow: odd in the load."""
    return Injected(at.torque * at.speed**2)


def stiffness_that_tires(rng: np.random.Generator, at: Points) -> Injected:
    """Torque times time: a joint that loosens while it is measured."""
    return Injected(at.torque * at.time)


def warm_fan(rng: np.random.Generator, at: Points) -> Injected:
    """Speed times temperature, the same in both directions."""
    return Injected(at.speed * at.tau)


def grease_that_thins(rng: np.random.Generator, at: Points) -> Injected:
    """A viscous drag whose viscosity falls with the temperature, against that at 20 degC."""
    thinner = np.expm1(-rng.uniform(0.02, 0.05) * at.tau)
    return Injected(at.direction * at.speed * thinner)


BESIDE: Mapping[str, Mechanism] = {
    one.__name__: one
    for one in (
        torque_times_square_of_speed, stiffness_that_tires, warm_fan, grease_that_thins,
        cubic_torque, even_torque, rising_exponential_of_temperature, softer_when_warm,
        step_in_time, daily_swing, wave_that_grows_with_temperature, wave_with_square_of_torque,
    )
}  # fmt: skip
"""Causes that no effect of the library has, products of two variables among them."""


@dataclass(frozen=True)
class Composition:
    """What a record is made of: signal to noise of each effect, the largest first, whether the
    last one is outside of the library, whether the design is poor, whether the output is turned.
    """

    ratios: tuple[float, ...]
    outside: bool
    poor: bool
    turned: bool


def composition(rng: np.random.Generator) -> Composition:
    """Drawn anew for each record."""
    small = np.exp(rng.uniform(*np.log(SMALL), size=int(rng.integers(1, 4))))
    large = float(np.exp(rng.uniform(*np.log(LARGE))))
    chances = (rng.random(3) < (OUTSIDE_SHARE, POOR_SHARE, TURNED_SHARE)).tolist()
    return Composition((large, *small.tolist()), *chances)
