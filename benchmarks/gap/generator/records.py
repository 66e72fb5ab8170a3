"""Records of a hidden-effect trial: a configuration, a table, and the truth kept apart.

Everything follows from the group of the record and its number. The simulation is the trial's own,
or one that is handed in by the name of its model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.gap.generator.composites import BESIDE, Composition, composition
from benchmarks.gap.generator.kinds import KINDS, TABLE, Draw, Kind, Simulator
from benchmarks.gap.generator.noise import NOISES
from benchmarks.gap.generator.outside import OUTSIDE
from benchmarks.gap.generator.populations import Units
from benchmarks.gap.generator.tables import Array, Points

LEAST_LAMBDA = 50.0
TIMED = frozenset(["drift", "creep", "wear", "step_in_time", "daily_swing", "stiffness_that_tires"])
"""What follows the time from the first row on, whatever the clock of a session says."""
NO_SIMULATORS: Mapping[str, Simulator] = {}


@dataclass(frozen=True)
class Hidden:
    """One hidden effect: its name, what it adds (m n,) to the m outputs one after the other, in
    their scales, and the names that may stand beside it.
    """

    name: str
    added: Array
    beside: tuple[str, ...] = ()


@dataclass(frozen=True)
class Truth:
    """What is true of a record; `free` (m n, k) is the gradient of what may be recalibrated,
    `sigma` is the noise in the scales of the outputs, `noise_rms` that of the first output's noise
    in its unit, outliers (5 sigma) aside. Of composed records the first hidden effect dominates,
    and one that is `outside` is the last; `turned`: what a positive reading means is turned over.
    """

    group: str
    kind: str
    number: int
    points: Any
    hidden: tuple[Hidden, ...]
    outside: bool
    poor: str | None
    noise: str
    sigma: float
    noise_rms: float
    free: Array
    turned: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.hidden)


@dataclass(frozen=True)
class Record:
    """What the workflow is given; its name says nothing about what it hides."""

    name: str
    configuration: str
    table: pd.DataFrame


@dataclass(frozen=True)
class Task:
    """How the records of one group are made."""

    kinds: tuple[str, ...]
    effects: int = 1
    poor: bool = False
    outside: bool = False
    noises: tuple[str, ...] = tuple(NOISES)
    n: tuple[int, int] = (60, 2400)
    snr: tuple[float, float] = (0.2, 3.0)
    only: tuple[str, ...] = ()
    composed: bool = False
    rows: tuple[int, ...] = ()
    """Of one machine's record so many rows each, in records that follow each other."""


QUIET = ("white", "autocorrelated", "outliers", "quantised")
BENCH = ("rotating", "rotating", "rotating", "lost_motion")
MODELS = ("rv_transmission", "rv_transmission", "rv_lost_motion")
POSE = ("manipulator_pose",)
GROUPS: dict[str, Task] = {
    "good": Task(BENCH),
    "poor": Task(BENCH, poor=True),
    "pair": Task(("rotating",), effects=2, n=(600, 600), snr=(0.5, 0.5)),
    "clean": Task(BENCH, effects=0, noises=QUIET),
    "size": Task(BENCH, effects=0, noises=("heteroscedastic",)),
    "delay": Task(("rotating",), only=("read_out_lag",)),
    "outside": Task(("rotating",), outside=True, n=(300, 2400), snr=(0.5, 3.0)),
    "models good": Task(MODELS),
    "models poor": Task(MODELS, poor=True),
    "models pair": Task(("rv_transmission",), effects=2, n=(600, 600), snr=(0.5, 0.5)),
    "models clean": Task(MODELS, effects=0, noises=QUIET),
    "batch good": Task(("rv_batch",), snr=(0.2, 1.5)),
    "batch poor": Task(("rv_batch",), snr=(0.2, 1.5), poor=True),
    "batch clean": Task(("rv_batch",), effects=0),
    "assembly good": Task(("assembly",)),
    "assembly poor": Task(("assembly",), poor=True),
    "assembly clean": Task(("assembly",), effects=0),
    "manipulator good": Task(POSE),
    "manipulator poor": Task(POSE, poor=True),
    "manipulator clean": Task(POSE, effects=0, noises=QUIET),
    "manipulator outside": Task(POSE, outside=True, n=(300, 2400), snr=(0.5, 3.0)),
    "dominant": Task(("rotating",), n=(250, 2500), composed=True),
    "own gear": Task(("own gear", "unknown gear"), n=(300, 2400), snr=(0.5, 3.0)),
    "uneven good": Task(BENCH, noises=("heteroscedastic",)),
    "late good": Task(("late",), n=(300, 2400), snr=(0.5, 3.0)),
    "approximate": Task(("bench", "friction"), noises=QUIET, n=(300, 2400), snr=(10.0, 100.0)),
    "rows": Task(
        ("rotating",), noises=("white", "outliers"), n=(16_000, 16_000), snr=(0.5, 5.0), rows=(250, 2000, 16_000)
    ),
    "memory": Task(("presliding", "yielding", "yielding"), n=(300, 2400), snr=(3.0, 30.0)),
    "plays": Task(("plays",), n=(300, 2400), snr=(3.0, 30.0)),
}
BENCH_GROUPS = tuple(name for name in GROUPS if " " not in name)
"""The groups that need no model: `model = "table"`."""


def orthogonal(to: Array, what: Array) -> Array:
    """The part of `what` (n,) or (n, m) that no combination of the columns `to` (n, k) makes."""
    if to.shape[1] == 0:
        return what
    basis, values, _ = np.linalg.svd(to / np.linalg.norm(to, axis=0), full_matrices=False)
    basis = basis[:, values > 1e-9 * values[0]]
    return np.asarray(what - basis @ (basis.T @ what))


def record(group: str, number: int, simulators: Mapping[str, Simulator] = NO_SIMULATORS) -> tuple[Record, Truth]:
    """The record of that number in a group, always the same.

    Raises KeyError where its kind has no simulation of its own and none is handed in.
    """
    task = GROUPS[group]
    machine, part = divmod(number, len(task.rows) or 1)
    rng = np.random.default_rng([list(GROUPS).index(group), machine])
    name = task.kinds[rng.integers(len(task.kinds))]
    kind = KINDS[name]
    n, snr = _size(rng, task, len(kind.outputs))
    parts = composition(rng) if task.composed else None
    poor = str(rng.choice(kind.ways)) if task.poor or (parts and parts.poor) else None
    at = kind.points(rng, n, poor)
    predicted = (kind.simulate or simulators[kind.model])(at, int(rng.integers(1, 10**6)))
    if isinstance(at, Units):
        at = replace(at, drawn=predicted)
    if parts is None:
        hidden, sigma = _hidden(rng, task, kind, at, snr)
    else:
        hidden, sigma = _composed(rng, kind, at, parts)
    laws = [law for law in task.noises if law in kind.noises]
    law = laws[rng.integers(len(laws))]
    reading, noise = _measured(rng, kind, law, sigma, predicted, hidden, at)
    turned = parts is not None and parts.turned
    sign = -1.0 if turned else 1.0
    table = _table(kind, at, sign * reading, sign * predicted)
    if parts is not None and not TIMED & {one.name for one in hidden}:
        table = in_sessions(np.random.default_rng([number, n]), table)
    good = np.abs(noise[:n]) < 5.0 * sigma
    size = kind.sizes[0] * float(np.sqrt(np.mean(noise[:n][good] ** 2)))
    outside = task.outside or (parts is not None and parts.outside)
    truth = Truth(group, name, number, at, hidden, outside, poor, law, sigma, float(size),
                  kind.free(n), turned)  # fmt: skip
    if task.rows:
        truth, table = _part_of(np.random.default_rng([machine, part]), truth, table, task.rows[part])
    blind = f"r{rng.integers(10**9) + part:09d}"
    return Record(blind, configuration(kind, number, at), table), truth


def _part_of(rng: np.random.Generator, truth: Truth, table: pd.DataFrame, count: int) -> tuple[Truth, pd.DataFrame]:
    """So many rows of a record with one output, at random, in their order."""
    rows = np.sort(rng.choice(len(table), count, replace=False))
    whole = {name: value for name, value in vars(truth.points).items() if isinstance(value, np.ndarray)}
    points = replace(truth.points, **{name: value[rows] for name, value in whole.items()})
    hidden = tuple(replace(one, added=one.added[rows]) for one in truth.hidden)
    return replace(truth, points=points, hidden=hidden, free=truth.free[rows]), table.iloc[rows]


def in_sessions(rng: np.random.Generator, table: pd.DataFrame) -> pd.DataFrame:
    """Half of the tables cut into two to four sessions, each with a clock that begins anew."""
    if rng.random() < 0.5:
        return table
    count = int(rng.integers(2, 5))
    session = np.minimum(np.arange(len(table)) * count // len(table), count - 1)
    began = table["time_s"].groupby(session).transform("min")
    return table.assign(time_s=table["time_s"] - began, session=session + 1)


def _size(rng: np.random.Generator, task: Task, outputs: int) -> tuple[int, float]:
    """Rows and signal to noise; with effects, such that lambda reaches its least."""
    while True:
        n = round(float(np.exp(rng.uniform(*np.log(task.n)))))
        snr = float(np.exp(rng.uniform(*np.log(task.snr))))
        if task.effects == 0 or outputs * n * snr**2 >= LEAST_LAMBDA:
            return n, snr


def _hidden(rng: np.random.Generator, task: Task, kind: Kind, at: Any, snr: float) -> tuple[tuple[Hidden, ...], float]:
    """The effects, scaled to one SNR, and the noise's standard deviation that gives it."""
    spread = float(np.std(at.drawn)) if kind.population else 0.0
    if task.effects == 0:
        return (), spread or float(np.exp(rng.uniform(np.log(0.1), np.log(3.0))))
    free = kind.free(len(at))
    found = _drawn(rng, task, kind, at, free)
    sizes = [float(np.sqrt(np.mean(orthogonal(free, one.added) ** 2))) for one in found]
    wanted = snr * spread if kind.population else sizes[0]
    scaled = tuple(
        Hidden(one.name, wanted / size * one.added, one.beside) for one, size in zip(found, sizes, strict=True)
    )
    return scaled, spread or sizes[0] / snr


def _composed(rng: np.random.Generator, kind: Kind, at: Any, parts: Composition) -> tuple[tuple[Hidden, ...], float]:
    """Effects of their own signal to noise each, the largest first, and the noise's deviation."""
    free, sigma = kind.free(len(at)), float(np.exp(rng.uniform(np.log(0.1), np.log(3.0))))
    while True:
        inside = len(parts.ratios) - parts.outside
        names = rng.choice(list(kind.mechanisms), inside, replace=False).tolist()
        draws: list[tuple[str, Draw]] = [(name, kind.mechanisms[name]) for name in names]
        if parts.outside:
            name = str(rng.choice(list(BESIDE)))
            draws.append((name, BESIDE[name]))
        drawn = [(name, draw(rng, at)) for name, draw in draws]
        found = [Hidden(name, one.added, one.beside) for name, one in drawn]
        if _apart(found, free):
            break
    scaled = []
    for one, ratio in zip(found, parts.ratios, strict=True):
        size = float(np.sqrt(np.mean(orthogonal(free, one.added) ** 2)))
        scaled.append(Hidden(one.name, ratio * sigma / size * one.added, one.beside))
    return tuple(scaled), sigma


def _drawn(rng: np.random.Generator, task: Task, kind: Kind, at: Any, free: Array) -> list[Hidden]:
    """Distinct effects, none of which the others or the free parameters nearly make up."""
    library: Mapping[str, Draw] = kind.mechanisms
    if task.outside:
        library = kind.outside or OUTSIDE
    while True:
        names = rng.choice(task.only or list(library), task.effects, replace=False).tolist()
        drawn = {name: library[name](rng, at) for name in names}
        found = [Hidden(name, one.added, one.beside) for name, one in drawn.items()]
        if _apart(found, free):
            return found


def _apart(found: list[Hidden], free: Array) -> bool:
    """Whether each effect keeps half of its power beside the free parameters and the others."""
    for at, one in enumerate(found):
        others = [other.added[:, None] for k, other in enumerate(found) if k != at]
        own = one.added if free.shape[1] == 0 else one.added - one.added.mean()
        left = orthogonal(np.hstack([free, *others]), one.added)
        if not (left**2).sum() > 0.5 * (own**2).sum() > 0.0:
            return False
    return True


def _measured(
    rng: np.random.Generator, kind: Kind, law: str, sigma: float, predicted: Array,
    hidden: tuple[Hidden, ...], at: Any,
) -> tuple[Array, Array]:  # fmt: skip
    """The readings of all outputs and their noise; the noise of a population is its units."""
    clean = predicted + sum((one.added for one in hidden), np.zeros(len(predicted)))
    if kind.population:
        return clean, predicted - predicted.mean()
    m = len(kind.outputs)
    zero = np.repeat(sigma * rng.uniform(-3.0, 3.0, m) * kind.zeros, len(at))
    noise = np.concatenate([NOISES[law](rng, at) for _ in range(m)])
    reading = clean + zero + sigma * noise
    if law == "quantised":
        step = sigma * rng.uniform(0.3, 1.0)
        reading = step * np.round(reading / step)
    return reading, reading - clean - zero


def _table(kind: Kind, at: Any, reading: Array, predicted: Array) -> pd.DataFrame:
    columns: dict[str, NDArray[Any]] = dict(kind.columns(at))
    shape = (len(kind.outputs), len(at))
    readings = kind.sizes[:, None] * reading.reshape(shape)
    columns |= dict(zip(kind.outputs, readings, strict=True))
    if kind.model == TABLE:
        columns[f"{kind.outputs[0]}_predicted"] = predicted
    return pd.DataFrame(columns)


def configuration(kind: Kind, seed: int, at: Any) -> str:
    """The TOML of a record; a model may recalibrate its zeros alone, a table has its gear declared
    unless the points say otherwise.
    """
    given = "".join(f'parameters.{name} = "{value}"\n' for name, value in kind.parameters.items())
    head = f'model = "{kind.model}"\nseed = {seed}\n{given}'
    if kind.model != TABLE:
        return f"{head}[free]\n"
    output = kind.outputs[0]
    names = {**kind.roles, output: ("measured", kind.unit)}
    names[f"{output}_predicted"] = ("predicted", kind.unit)
    lines = [f'"{name}" = {{ role = "{role}", unit = "{unit}" }}' for name, (role, unit) in names.items()]
    gear = _gear(at) if isinstance(at, Points) and at.declared else ""
    return "\n".join([f"{head}{gear}[columns]", *lines, ""])


def _gear(at: Points) -> str:
    names = ("pins", "cycloid_teeth", "sun_teeth", "planet_teeth")
    lines = [f"{name} = {count}" for name, count in zip(names, at.teeth, strict=True)]
    return "\n".join(["[gear]", 'kind = "rv"', *lines, ""])
