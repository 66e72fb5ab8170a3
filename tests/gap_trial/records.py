"""Records of a hidden-effect trial: a configuration, a table, and the truth kept apart.

Everything follows from the class of the record and its number. The simulation is the trial's own
(`model = "table"`), or one that is handed in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tests.gap_trial import tables
from tests.gap_trial.hysteresis import LOCKED
from tests.gap_trial.mechanisms import ROTATING, Injected, Mechanism
from tests.gap_trial.noise import NOISES
from tests.gap_trial.outside import OUTSIDE
from tests.gap_trial.tables import POOR, Array, Points

LEAST_LAMBDA = 50.0
UNITS = {
    "output_angle_deg": ("angle", "deg"),
    "torque_Nm": ("torque", "N m"),
    "output_speed_rpm": ("speed", "rpm"),
    "temperature_C": ("temperature", "degC"),
    "direction": ("direction", ""),
    "time_s": ("time", "s"),
}
OUTPUTS = {"rotating": ("te_arcsec", "arcsec"), "lost_motion": ("twist_arcmin", "arcmin")}


@dataclass(frozen=True)
class Hidden:
    """One hidden effect: its name, what it adds (n,) to each output, its numbers, and the names
    that may stand beside it.
    """

    name: str
    added: Array
    numbers: dict[str, float] = field(default_factory=dict)
    beside: tuple[str, ...] = ()


@dataclass(frozen=True)
class Truth:
    """What is true of a record; `free` (n, k) is the gradient of what may be recalibrated."""

    group: str
    kind: str
    number: int
    points: Points
    hidden: tuple[Hidden, ...]
    outside: str
    poor: str | None
    noise: str
    sigma: float
    noise_rms: float
    free: Array

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.hidden)


@dataclass(frozen=True)
class Record:
    """What the workflow is given; its name says nothing about what it hides."""

    name: str
    configuration: str
    table: pd.DataFrame


Simulator = Callable[[Points], tuple[Array, Array]]
"""Predictions (n,) of a simulation and the gradient (n, k) of what may be recalibrated in it."""


def bench(at: Points, scale: float = 1.0) -> tuple[Array, Array]:
    """The trial's own simulation: wind-up, softer near zero, and the ripple of the teeth."""
    windup = at.torque / 108.0 + 0.2 * np.tanh(at.torque / 30.0)
    ripple = 0.02 * np.sin(1560.0 * at.angle)
    return 60.0 * scale * (windup + ripple), np.ones((len(at), 1))


SIMULATORS: dict[str, Simulator] = {"rotating": bench, "lost_motion": partial(bench, scale=1 / 60)}


@dataclass(frozen=True)
class Task:
    """How the records of one group are made."""

    effects: int = 1
    poor: bool = False
    outside: bool = False
    noises: tuple[str, ...] = tuple(NOISES)
    n: tuple[int, int] = (60, 2400)
    snr: tuple[float, float] = (0.2, 3.0)
    only: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ("rotating", "rotating", "rotating", "lost_motion")


GROUPS: dict[str, Task] = {
    "good": Task(),
    "poor": Task(poor=True),
    "pair": Task(effects=2, n=(600, 600), snr=(0.5, 0.5), kinds=("rotating",)),
    "clean": Task(effects=0, noises=("white", "autocorrelated", "outliers", "quantised")),
    "size": Task(effects=0, noises=("heteroscedastic",)),
    "delay": Task(only=("read_out_lag",), kinds=("rotating",)),
    "outside": Task(outside=True, n=(300, 2400), snr=(0.5, 3.0), kinds=("rotating",)),
}


def orthogonal(to: Array, what: Array) -> Array:
    """The part of `what` (n,) or (n, m) that no combination of the columns `to` (n, k) makes."""
    basis, values, _ = np.linalg.svd(to / np.linalg.norm(to, axis=0), full_matrices=False)
    basis = basis[:, values > 1e-9 * values[0]]
    return what - basis @ (basis.T @ what)


def record(
    group: str, number: int, simulators: dict[str, Simulator] | None = None
) -> tuple[Record, Truth]:
    """The record of that number in a group, always the same."""
    rng = np.random.default_rng([sorted(GROUPS).index(group), number])
    task = GROUPS[group]
    kind = task.kinds[rng.integers(len(task.kinds))]
    n, snr = _size(rng, task)
    poor = _poor(rng, kind) if task.poor else None
    at = _points(rng, kind, n, poor)
    predicted, free = (simulators or SIMULATORS).get(kind, SIMULATORS[kind])(at)
    hidden, sigma = _hidden(rng, task, kind, at, free, snr)
    law = task.noises[rng.integers(len(task.noises))]
    reading, noise = _measured(rng, law, sigma, predicted, hidden, at)
    table = _table(kind, at, reading, predicted, simulators)
    truth = Truth(group, kind, number, at, hidden, hidden[0].name if task.outside else "", poor,
                  law, sigma, float(np.sqrt(np.mean(noise**2))), free)  # fmt: skip
    blind = f"r{rng.integers(10**9):09d}"
    return Record(blind, configuration(kind, number, simulators), table), truth


def _size(rng: np.random.Generator, task: Task) -> tuple[int, float]:
    """Rows and signal to noise; with effects, such that lambda = n SNR^2 reaches its least."""
    while True:
        n = round(float(np.exp(rng.uniform(*np.log(task.n)))))
        snr = float(np.exp(rng.uniform(*np.log(task.snr))))
        if task.effects == 0 or n * snr**2 >= LEAST_LAMBDA:
            return n, snr


def _poor(rng: np.random.Generator, kind: str) -> str:
    ways = list(POOR) if kind == "rotating" else ["temperature follows time"]
    return ways[rng.integers(len(ways))]


def _points(rng: np.random.Generator, kind: str, n: int, poor: str | None) -> Points:
    return (tables.loops if kind == "lost_motion" else tables.points)(rng, n, poor)


def _hidden(
    rng: np.random.Generator, task: Task, kind: str, at: Points, free: Array, snr: float
) -> tuple[tuple[Hidden, ...], float]:
    """The effects, scaled to one SNR, and the noise's standard deviation that gives it."""
    if task.effects == 0:
        return (), float(np.exp(rng.uniform(np.log(0.1), np.log(3.0))))
    found = _drawn(rng, task, kind, at, free)
    sizes = [float(np.sqrt(np.mean(orthogonal(free, one.added) ** 2))) for one in found]
    scales = [sizes[0] / size for size in sizes]
    scaled = tuple(
        Hidden(one.name, scale * one.added, _scaled(one.numbers, scale), one.beside)
        for one, scale in zip(found, scales, strict=True)
    )
    return scaled, sizes[0] / snr


def _scaled(numbers: dict[str, float], scale: float) -> dict[str, float]:
    keep = ("T0", "w", "Hz")
    return {name: value * (1.0 if name in keep else scale) for name, value in numbers.items()}


def _drawn(
    rng: np.random.Generator, task: Task, kind: str, at: Points, free: Array
) -> list[Hidden]:
    """Distinct effects, none of which the others or the free parameters nearly make up."""
    library = _library(task, kind)
    while True:
        names = rng.choice(task.only or list(library), task.effects, replace=False)
        found = [_as_hidden(str(name), library[str(name)](rng, at)) for name in names]
        if _apart(found, free):
            return found


def _library(task: Task, kind: str) -> dict[str, Mechanism]:
    if task.outside:
        return OUTSIDE
    return LOCKED if kind == "lost_motion" else ROTATING


def _as_hidden(name: str, found: Injected) -> Hidden:
    return Hidden(name, found.added, found.numbers, found.beside)


def _apart(found: list[Hidden], free: Array) -> bool:
    """Whether each effect keeps half of its power beside the free parameters and the others."""
    for at, one in enumerate(found):
        others = [other.added[:, None] for k, other in enumerate(found) if k != at]
        own = orthogonal(np.ones((len(free), 1)), one.added)
        left = orthogonal(np.hstack([free, *others]), one.added)
        if not (left**2).sum() > 0.5 * (own**2).sum() > 0.0:
            return False
    return True


def _measured(
    rng: np.random.Generator, law: str, sigma: float, predicted: Array,
    hidden: tuple[Hidden, ...], at: Points,
) -> tuple[Array, Array]:  # fmt: skip
    """The readings and their noise."""
    clean = predicted + sum((one.added for one in hidden), np.zeros(len(at)))
    zero = sigma * rng.uniform(-3.0, 3.0)
    reading = clean + zero + sigma * NOISES[law](rng, at)
    if law == "quantised":
        step = sigma * rng.uniform(0.3, 1.0)
        reading = step * np.round(reading / step)
    return reading, reading - clean - zero


def _table(
    kind: str, at: Points, reading: Array, predicted: Array, handed: dict[str, Simulator] | None
) -> pd.DataFrame:
    columns: dict[str, NDArray[np.float64]] = dict(tables.as_columns(at, kind))
    output = OUTPUTS[kind][0]
    columns[output] = reading
    if not (handed and kind in handed):
        columns[f"{output}_predicted"] = predicted
    return pd.DataFrame(columns)


def configuration(kind: str, seed: int, handed: dict[str, Simulator] | None = None) -> str:
    """The TOML of a record."""
    if handed and kind in handed:
        model = {"rotating": "rv_transmission", "lost_motion": "rv_lost_motion"}[kind]
        return f'model = "{model}"\nseed = {seed}\n[free]\n'
    output, unit = OUTPUTS[kind]
    names = dict(UNITS)
    if kind == "lost_motion":
        names.pop("output_speed_rpm")
    names |= {output: ("measured", unit), f"{output}_predicted": ("predicted", unit)}
    lines = [
        f'"{name}" = {{ role = "{role}", unit = "{unit}" }}' for name, (role, unit) in names.items()
    ]
    return "\n".join(['model = "table"', f"seed = {seed}", "[columns]", *lines, ""])
