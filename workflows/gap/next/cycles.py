"""Cycles of the torque, for units whose twist depends on the path that the torque took."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from ....arrays import Array
from ....models.measurable import Column, Role
from ..data import GapData
from .points import Axis, Table, with_labels

CYCLES = 7
"""Number of cycles that are tried, as a power of two."""
PER_CYCLE = 20
"""Number of measurements of a cycle."""
LOCKED = "rv_lost_motion"
PATH = Column("repeat", "", "number of the cycle", False, role=Role.REPEAT)


def along_path(data: GapData) -> bool:
    """Whether measurements depend on the path of the load."""
    return data.target.model == LOCKED


def in_cycles(total: int) -> tuple[int, int]:
    """The number of cycles, and of measurements in each, that give about `total` measurements."""
    count = max(1, round(total / PER_CYCLE))
    return count, max(total // count, 1)


def cycles(data: GapData, axes: Sequence[Axis], rows: int, seed: int) -> Table:
    """A table of cycles of so many rows: the torque from its lower end to its upper one and back,
    other inputs constant in a cycle; the first cycles take the whole range, or one side of it.
    """
    moving = [axis for axis in axes if axis.column.role not in (Role.TORQUE, Role.DIRECTION)]
    ends, other_fractions = _drawn(len(moving), seed)
    torque = next(axis for axis in axes if axis.column.role is Role.TORQUE)
    low, high = torque.at(ends[:, 0]), torque.at(ends[:, 1])
    fraction = (np.arange(rows) + 1.0) / rows
    wave = 1.0 - np.abs(2.0 * fraction - 1.0)
    table = {torque.column.name: (low[:, None] + (high - low)[:, None] * wave).ravel()}
    for at, axis in enumerate(moving):
        table[axis.column.name] = np.repeat(axis.at(other_fractions[:, at]), rows)
    for axis in axes:
        if axis.column.role is Role.DIRECTION:
            table[axis.column.name] = np.tile(np.where(fraction <= 0.5, 1.0, -1.0), len(ends))
    return {**with_labels(data, table), PATH.name: np.repeat(np.arange(len(ends), dtype=float), rows)}


def _drawn(other_inputs: int, seed: int) -> tuple[Array, Array]:
    """Lower and upper ends of the torque (C, 2) and fractions (C, others) of the other inputs."""
    sobol = scipy.stats.qmc.Sobol(2 + other_inputs, rng=np.random.default_rng([seed, 9]))
    fractions = np.asarray(sobol.random_base2(CYCLES))
    ends = np.sort(fractions[:, :2], axis=1)
    ends[:32], ends[32:48, 0], ends[48:64, 1] = (0.0, 1.0), 0.0, 1.0
    return ends, fractions[:, 2:]
