"""Operating points of a hidden-effect trial: what a test bench would visit, well or badly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
RATED = 412.0
"""Rated torque [N m] of the unit on the bench."""
RV_40E = (40, 39, 12, 36)
"""Its pins, teeth of a disc, of the sun and of a planet."""


@dataclass(frozen=True)
class Points:
    """Rows (n,) in the order of measuring: angle [rad], torque [N m], direction, speed [rpm],
    temperature above 20 degC [K], time [s]. `teeth` are those of the unit (pins, a disc, the
    sun, a planet); `declared` whether its configuration says so.
    """

    angle: Array
    torque: Array
    direction: Array
    speed: Array
    tau: Array
    time: Array
    teeth: tuple[int, int, int, int] = RV_40E
    declared: bool = True

    @property
    def pin(self) -> float:
        """How often pins pass per turn of the output: turns of a crank in the housing."""
        return float(self.teeth[1])

    @property
    def crank(self) -> float:
        """Turns of a crank against the output, a disc having one tooth less than there are pins."""
        return float(self.teeth[0])

    @property
    def over(self) -> float:
        """Turns of the sun against the output."""
        return self.crank * self.teeth[3] / self.teeth[2]

    @property
    def excitations(self) -> tuple[float, ...]:
        """Orders of pins, cranks, discs and sun."""
        pin, crank, over = self.pin, self.crank, self.over
        return (pin, crank, 2.0 * pin, 2.0 * crank, over, over + 1.0)

    def __len__(self) -> int:
        return len(self.angle)

    @property
    def largest_torque(self) -> float:
        return float(np.abs(self.torque).max())

    @property
    def scatter_follows(self) -> tuple[Array, ...]:
        """What the size of a scatter may grow with."""
        ways = np.abs(self.torque), self.time
        return (*ways, self.speed) if self.speed.max() > 0.0 else ways


def independent(rng: np.random.Generator, n: int) -> dict[str, Array]:
    """Inputs that do not follow each other."""
    most = RATED * rng.uniform(0.5, 1.5)
    return {
        "angle": rng.uniform(0.0, 2.0 * np.pi, n),
        "torque": rng.uniform(-most, most, n),
        "direction": rng.choice([-1.0, 1.0], n),
        "speed": rng.uniform(3.0, rng.uniform(40.0, 70.0), n),
        "tau": rng.uniform(-5.0, rng.uniform(20.0, 45.0), n),
        "time": np.arange(n, dtype=np.float64) * rng.uniform(0.3, 3.0),
    }


def torque_follows_angle(rng: np.random.Generator, at: dict[str, Array]) -> None:
    """An unbalanced arm: the torque is that of its weight."""
    most = np.abs(at["torque"]).max()
    weight = np.sin(at["angle"] + rng.uniform(0.0, 2.0 * np.pi))
    at["torque"] = most * (weight + 0.15 * rng.normal(size=len(weight)))


def temperature_follows_time(rng: np.random.Generator, at: dict[str, Array]) -> None:
    """A unit that warms up while it is measured."""
    share = at["time"] / at["time"][-1]
    warm = 1.0 - np.exp(-share * rng.uniform(1.0, 3.0))
    at["tau"] = at["tau"].max() * (warm + 0.05 * rng.normal(size=len(share)))


def speed_follows_direction(rng: np.random.Generator, at: dict[str, Array]) -> None:
    """Fast forward, slow back."""
    middle = at["speed"].mean()
    scatter = 0.15 * rng.normal(size=len(at["speed"]))
    faster = rng.uniform(0.3, 0.6) * at["direction"]
    at["speed"] = np.maximum(middle * (1.0 + faster + scatter), 0.5)


POOR: dict[str, Callable[[np.random.Generator, dict[str, Array]], None]] = {
    "torque follows angle": torque_follows_angle,
    "temperature follows time": temperature_follows_time,
    "speed follows direction": speed_follows_direction,
}


def _of(at: dict[str, Array]) -> Points:
    return Points(at["angle"], at["torque"], at["direction"], at["speed"], at["tau"], at["time"])


def points(rng: np.random.Generator, n: int, poor: str | None) -> Points:
    """A design of n rows; `poor` says which inputs are not independent, None that all are."""
    at = independent(rng, n)
    if poor is not None:
        POOR[poor](rng, at)
    return _of(at)


@dataclass(frozen=True)
class Moving(Points):
    """Rows of one record of a motion, at a steady pace [s]: the angle is a sum of sines of the time
    (size [rad], turns per second, phase), the torque that of an unbalanced arm (largest, phase).
    """

    waves: tuple[tuple[float, float, float], ...] = ()
    arm: tuple[float, float] = (0.0, 0.0)

    @property
    def pace(self) -> float:
        return float(self.time[1] - self.time[0])

    def sooner(self, by: float) -> Moving:
        """What was there `by` seconds before each row."""
        return moving_at(self, self.time - by)


def moving_at(of: Moving, time: Array) -> Moving:
    """The motion at other times."""
    turned = [2.0 * np.pi * rate * time + phase for _, rate, phase in of.waves]
    pairs = list(zip(of.waves, turned, strict=True))
    angle = sum((size * np.sin(at) for (size, _, _), at in pairs), np.zeros(len(time)))
    speed = sum((2.0 * np.pi * rate * size * np.cos(at) for (size, rate, _), at in pairs),
                np.zeros(len(time)))  # fmt: skip
    most, phase = of.arm
    return replace(of, angle=angle, torque=most * np.sin(angle + phase),
                   direction=np.where(speed < 0.0, -1.0, 1.0),
                   speed=np.abs(speed) * 30.0 / np.pi)  # fmt: skip


def in_motion(rng: np.random.Generator, n: int, _: str | None) -> Moving:
    """A drive that goes to and fro while it is recorded."""
    time = np.arange(n, dtype=np.float64) * rng.uniform(0.002, 0.01)
    slow = rng.uniform(3.0, 8.0) / time[-1]
    waves = tuple(
        (rng.uniform(0.3, 1.0) / times, slow * times, rng.uniform(0.0, 2.0 * np.pi))
        for times in (1.0, rng.uniform(1.7, 2.9))
    )
    tau = np.full(n, rng.uniform(0.0, 20.0)) + rng.uniform(0.0, 5.0) * time / time[-1]
    arm = (RATED * rng.uniform(0.3, 1.0), rng.uniform(0.0, 2.0 * np.pi))
    still = np.zeros(n)
    return moving_at(Moving(still, still, still, still, tau, time, waves=waves, arm=arm), time)


def own_gear(rng: np.random.Generator, n: int, poor: str | None, declared: bool = True) -> Points:
    """The same of a unit with other tooth numbers."""
    pins = int(rng.choice([k for k in range(24, 62) if k not in (39, 40, 41)]))
    teeth = (pins, pins - 1, int(rng.integers(9, 22)), int(rng.integers(28, 60)))
    return replace(points(rng, n, poor), teeth=teeth, declared=declared)


def loops(rng: np.random.Generator, n: int, poor: str | None) -> Points:
    """Torque cycles on a locked unit; a poor design has one amplitude and warms up meanwhile."""
    cycles = int(np.clip(n // 60, 1, 12))
    most = RATED * rng.uniform(0.5, 1.5)
    sizes = np.full(cycles, most)
    if poor is None:
        sizes = most * rng.uniform(0.3, 1.0, cycles)
        sizes[rng.integers(cycles)] = most
    turns = np.concatenate([[0.0], np.column_stack([sizes, -sizes]).ravel(), [0.0]])
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(turns)))])
    torque = np.interp(np.linspace(0.0, path[-1], n), path, turns)
    step = np.sign(np.gradient(torque))
    at = independent(rng, n)
    at |= {"torque": torque, "direction": np.where(step == 0.0, 1.0, step)}
    at |= {"speed": np.zeros(n), "angle": np.full(n, rng.uniform(0.0, 2.0 * np.pi))}
    if poor is not None:
        temperature_follows_time(rng, at)
    return _of(at)


NAMES = {
    "rotating": ("output_angle_deg", "torque_Nm", "output_speed_rpm", "temperature_C", "direction",
                 "time_s"),
    "lost_motion": ("torque_Nm", "direction", "output_angle_deg", "temperature_C", "time_s"),
}  # fmt: skip


def as_columns(at: Points, kind: str) -> dict[str, NDArray[Any]]:
    """The columns of a measurement table, in the units of its file."""
    found = {
        "output_angle_deg": np.degrees(at.angle),
        "torque_Nm": at.torque,
        "output_speed_rpm": at.speed,
        "temperature_C": at.tau + 20.0,
        "direction": at.direction,
        "time_s": at.time,
    }
    return {name: found[name] for name in NAMES[kind]}
