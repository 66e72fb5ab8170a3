"""What depends on the rows before: friction that builds up, creep, backlash that sticks, in many small steps.

Each law is stepped along the motion between two rows, so that it does not hang on how the rows lie.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from benchmarks.gap.generator.mechanisms import Injected, Mechanism
from benchmarks.gap.generator.tables import RATED, Array, Moving, Points

BETWEEN = 16
"""Steps from one row to the next."""


def driven(rng: np.random.Generator, n: int, _: str | None) -> Moving:
    """A drive that goes to and fro, slowly at first and faster later, under a load of its own that holds
    now and then.
    """
    time = np.arange(n, dtype=np.float64) * rng.uniform(0.005, 0.02)
    cycles = rng.uniform(5.0, 9.0)
    share = time / time[-1]
    phase = 2.0 * np.pi * cycles * (share + rng.uniform(0.4, 1.0) * share**2)
    size, other = rng.uniform(0.5, 1.5), rng.uniform(0.2, 0.5)
    times, start = rng.uniform(1.6, 2.6), rng.uniform(0.0, 2.0 * np.pi)
    angle = size * (np.sin(phase) + other * np.sin(times * phase + start))
    speed = np.gradient(angle, time)
    holds = np.sin(2.0 * np.pi * rng.uniform(2.0, 4.0) * share + rng.uniform(0.0, 6.0))
    most = RATED * rng.uniform(0.3, 1.0)
    torque = most * np.clip(1.5 * holds + 0.3 * np.sin(2.0 * np.pi * rng.uniform(6.0, 11.0) * share), -1.0, 1.0)
    tau = np.full(n, rng.uniform(0.0, 20.0)) + rng.uniform(0.0, 5.0) * share
    direction = np.where(speed < 0.0, -1.0, 1.0)
    return Moving(angle, torque, direction, np.abs(speed) * 30.0 / np.pi, tau, time)


def between(values: Array) -> Array:
    """A column (n,) with its steps divided."""
    rows = np.arange(len(values))
    fine = np.linspace(0.0, rows[-1], BETWEEN * rows[-1] + 1)
    return np.asarray(np.interp(fine, rows, values))


def stepped(step: Callable[[float, float, float], float], x: Array, beside: Array) -> Array:
    """The state at the rows (n,) of a law that is given its state, the step of x and another column."""
    state, fine, other = 0.0, np.diff(between(x)).tolist(), between(beside).tolist()
    states = [state]
    for dx, here in zip(fine, other[1:], strict=True):
        state = step(state, dx, here)
        states.append(state)
    return np.array(states[::BETWEEN])


def presliding(rng: np.random.Generator, at: Points, falls: bool) -> Injected:
    """Dahl's friction, or LuGre's, which falls with the speed."""
    length = rng.uniform(0.01, 0.08) * float(np.ptp(at.angle))
    slow, excess = rng.uniform(0.08, 0.3) * float(at.speed.max()), rng.uniform(0.5, 1.5) if falls else 0.0

    def step(z: float, dx: float, speed: float) -> float:
        level = 1.0 + excess * float(np.exp(-((speed / slow) ** 2)))
        return z + (dx - z * abs(dx) / level) / length

    return Injected(stepped(step, at.angle, at.speed))


def bouc_wen(rng: np.random.Generator, at: Points, of_load: bool) -> Injected:
    x = at.torque if of_load else at.angle
    length, share = rng.uniform(0.08, 0.4) * float(np.ptp(x)), rng.uniform(0.5, 0.7)

    def step(z: float, dx: float, _: float) -> float:
        return z + (dx - share * abs(dx) * abs(z) * z - (1.0 - share) * dx * z * z) / length

    return Injected((-1.0 if of_load else 1.0) * stepped(step, x, x))


def yielding(rng: np.random.Generator, at: Points, parts: int) -> Injected:
    """One or two dampers beside springs, under the load."""
    reach = float(at.time[-1])
    pace = reach / (len(at) - 1) / BETWEEN
    constants = (rng.uniform(0.03, 0.2) * reach,) if parts == 1 else (0.01 * reach, rng.uniform(0.1, 0.25) * reach)
    total = np.zeros(len(at))
    for weight, constant in zip((1.0, rng.uniform(0.7, 1.5)), constants, strict=False):
        load = between(at.torque)
        states = np.zeros(len(load))
        for row in range(1, len(load)):
            states[row] = states[row - 1] + (load[row] - states[row - 1]) * -np.expm1(-pace / constant)
        total += weight * states[::BETWEEN]
    return Injected(total)


def sticking(rng: np.random.Generator, at: Points) -> Injected:
    """A table that follows its drive by a play, sticks and jumps."""
    width = rng.uniform(0.01, 0.05) * float(np.ptp(at.angle))
    windup = rng.uniform(0.5, 1.5) * width
    place, off = float(at.angle[0]), np.empty(len(at))
    for row, drive in enumerate(at.angle.tolist()):
        if abs(drive - place) > width + windup:
            place = drive - np.copysign(width, drive - place)
        off[row] = place - drive
    return Injected(off)


def dead_zone(rng: np.random.Generator, at: Points) -> Injected:
    """Clearance under a load of which friction holds a part."""
    half = 0.5 * float(np.ptp(at.torque))
    held, up = rng.uniform(0.06, 0.2) * half, rng.uniform(0.1, 0.3) * half
    acting, found = 0.0, np.empty(len(at))
    for row, load in enumerate(at.torque.tolist()):
        acting = min(max(acting, load - held), load + held)
        found[row] = min(max(acting / up, -1.0), 1.0)
    return Injected(found)


def slipping(rng: np.random.Generator, at: Points) -> Injected:
    """Friction elements along the travel, two to twelve, each with a limit of its own."""
    limits = float(np.ptp(at.angle)) * rng.uniform(0.01, 0.4, int(rng.integers(2, 13)))
    force, before, found = np.zeros(len(limits)), float(at.angle[0]), np.empty(len(at))
    for row, here in enumerate(at.angle.tolist()):
        force = np.clip(force + (here - before), -limits, limits)
        before = here
        found[row] = force.sum()
    return Injected(found)


PRESLIDING: Mapping[str, Mechanism] = {
    "dahl_friction": partial(presliding, falls=False),
    "lugre_friction": partial(presliding, falls=True),
    "bouc_wen_hysteresis": partial(bouc_wen, of_load=False),
}
"""Of a friction that is recorded while a drive moves to and fro."""
YIELDING: Mapping[str, Mechanism] = {
    "bouc_wen_hysteresis": partial(bouc_wen, of_load=True),
    "load_creep": partial(yielding, parts=1),
    "double_load_creep": partial(yielding, parts=2),
    "stick_slip_backlash": sticking,
    "dead_zone_with_friction": dead_zone,
}
"""Of an output angle that is recorded under a load."""
PLAYS: Mapping[str, Mechanism] = {"prandtl_ishlinskii": slipping}
"""The general form, which no effect of the library has."""
