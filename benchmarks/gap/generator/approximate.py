"""Effects of the library whose form is off: what dominates the gap of a machine is never a formula.

A law is drawn until the published formula, at its best, leaves 1 to 10 % of the law's rms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from benchmarks.gap.generator.mechanisms import Injected, Mechanism
from benchmarks.gap.generator.tables import Array, Points

LEAST_OFF, MOST_OFF = 0.01, 0.10
"""Rms that the formula leaves, as a fraction of the law's."""
Law = Callable[[np.random.Generator, Points], Array]
Form = Callable[[Points], tuple[Array, ...]]
"""The candidates (n, m) for the columns of a formula, one for each of its nonlinear parameter's values."""


def level(rng: np.random.Generator, at: Points) -> Array:
    """A level of dry friction that grows with the load."""
    load = (np.abs(at.torque) / at.largest_torque) ** rng.uniform(0.7, 1.5)
    return np.asarray(at.direction * (1.0 + rng.uniform(0.05, 0.4) * load))


def dip(rng: np.random.Generator, at: Points) -> Array:
    """Dry friction that is greater at low speed, and falls off as an exponential."""
    slow = np.exp(-at.speed / (rng.uniform(0.05, 0.3) * at.speed.max()))
    return np.asarray(at.direction * (1.0 + rng.uniform(0.05, 0.5) * slow))


def asymmetric(rng: np.random.Generator, at: Points) -> Array:
    """Dry friction that is greater in one direction."""
    return np.asarray(at.direction + rng.uniform(-0.1, 0.1))


def rounded(rng: np.random.Generator, at: Points) -> Array:
    """Dry friction that follows a reversal over a presliding length (Dahl), in the order of the rows."""
    length, moved = rng.uniform(0.002, 0.05), np.abs(np.diff(at.angle, prepend=at.angle[0]))
    friction, state = np.empty(len(at)), float(at.direction[0])
    for row, (direction, step) in enumerate(zip(at.direction.tolist(), moved.tolist(), strict=True)):
        state = direction + (state - direction) * np.exp(-step / length)
        friction[row] = state
    return friction


def stribeck_of_other_exponent(rng: np.random.Generator, at: Points) -> Array:
    """Friction that falls with the speed to another power than the second."""
    share = at.speed / (rng.uniform(0.08, 0.3) * at.speed.max())
    excess = rng.uniform(0.3, 1.5) * np.exp(-(share ** rng.uniform(0.6, 1.5)))
    return np.asarray(at.direction * (1.0 + excess))


def power_of_speed(rng: np.random.Generator, at: Points) -> Array:
    """A drag that grows a little less, or more, than in proportion to the speed."""
    return np.asarray(at.direction * at.speed ** rng.uniform(0.85, 1.15))


def power_of_torque(rng: np.random.Generator, at: Points, low: float, high: float) -> Array:
    """A twist with the torque to another power."""
    return np.asarray(np.sign(at.torque) * np.abs(at.torque) ** rng.uniform(low, high))


def loaded_eccentricity(rng: np.random.Generator, at: Points) -> Array:
    """A ring off its axis, by more under load."""
    wave = np.cos(at.angle + rng.uniform(0.0, 2.0 * np.pi))
    return np.asarray(wave * (1.0 + rng.uniform(0.05, 0.4) * np.abs(at.torque) / at.largest_torque))


def one(column: Callable[[Points], Array]) -> Form:
    return lambda at: (column(at)[:, None],)


def falling(at: Points) -> tuple[Array, ...]:
    """The columns of Stribeck's law in its Gaussian form."""
    speeds = np.geomspace(0.02, 0.7, 40) * at.speed.max()
    return tuple(np.column_stack([at.direction, at.direction * np.exp(-((at.speed / v) ** 2))]) for v in speeds)


def waved(at: Points) -> tuple[Array, ...]:
    return (np.column_stack([np.cos(at.angle), np.sin(at.angle)]),)


def left_by(form: Form, at: Points, law: Array) -> float:
    """The rms that the formula and a constant leave of a law (n,), as a fraction of the rms of the law."""
    own = law - law.mean()
    least = min(float(np.linalg.norm(own - x @ np.linalg.lstsq(x, own, rcond=None)[0]))
                for x in (part - part.mean(axis=0) for part in form(at)))  # fmt: skip
    return least / float(np.linalg.norm(own))


def off_form(
    rng: np.random.Generator, at: Points, laws: tuple[Law, ...], form: Form, beside: tuple[str, ...] = ()
) -> Injected:
    """A law of which the formula leaves as much as it should."""
    while True:
        law = laws[int(rng.integers(len(laws)))]
        added = law(rng, at)
        if LEAST_OFF <= left_by(form, at, added) <= MOST_OFF or law is asymmetric:
            return Injected(added, beside)


DRY: Form = one(lambda at: at.direction)
DRAG: Form = one(lambda at: at.speed * at.direction)
FRICTION: Mapping[str, Mechanism] = {
    "friction_hysteresis": partial(off_form, laws=(level, dip, asymmetric, rounded), form=DRY,
                                   beside=("stribeck", "load_friction", "directional_offset")),
    "stribeck": partial(off_form, laws=(stribeck_of_other_exponent,), form=falling),
    "viscous_friction": partial(off_form, laws=(power_of_speed,), form=DRAG),
}  # fmt: skip
"""Laws of a drive that moves to and fro while its friction is recorded; and the names that may stand
beside, or for, the one that dominates: they contain it."""
BENCH: Mapping[str, Mechanism] = {
    "friction_hysteresis": partial(off_form, laws=(level, dip), form=DRY, beside=("stribeck", "load_friction")),
    "torsional_compliance": partial(off_form, laws=(partial(power_of_torque, low=0.85, high=1.2),),
                                    form=one(lambda at: at.torque)),
    "hertz_stiffening": partial(off_form, laws=(partial(power_of_torque, low=0.56, high=0.78),),
                                form=one(lambda at: np.sign(at.torque) * np.cbrt(at.torque) ** 2)),
    "output_eccentricity": partial(off_form, laws=(loaded_eccentricity,), form=waved),
}  # fmt: skip
"""Laws of a unit on a test bench whose inputs are independent."""
