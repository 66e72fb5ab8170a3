"""The course of a search: its value by generation, and the evaluations at which it reached a level.

A hypervolume in every generation would cost as much as an array engine itself. Values are collected;
hypervolumes are computed at few generations and, where a level was passed between two of them, by
bisection, because the hypervolume of all evaluated designs never falls.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import Array, Flags, Integers
from .indicators import hypervolume, nondominated

CURVE = ("generation", "evaluations", "cpu_s", "value", "feasible_fraction")
"""Columns of a curve."""
PER_OCTAVE = {1: 64}
"""Generations of a curve between g and 2 g by the number of objectives, where a value is cheap."""
FEW = 4
BLOCK = 20_000
"""Feasible values after which their front replaces them, so that memory is bounded."""


class Batch(NamedTuple):
    """A generation: evaluations and CPU time up to its end, its feasible fraction, and its feasible
    designs, by the numbers of their evaluations (n,) and their objectives (n, objectives).
    """

    generation: int
    evaluations: int
    cpu_s: float
    feasible_fraction: float
    numbers: Integers
    values: Array


@dataclass(frozen=True, slots=True)
class Box:
    """Ideal and nadir (objectives,) of the normalised hypervolume."""

    ideal: tuple[float, ...]
    nadir: tuple[float, ...]

    def hypervolume(self, values: Array) -> float:
        """Normalised hypervolume of objectives (n, objectives)."""
        return hypervolume(values, np.array(self.ideal), np.array(self.nadir))


def charted(generation: int, per_octave: int) -> bool:
    """Whether a generation (from 1) belongs to a curve, at any end of the curve."""
    step = 1 << max(0, generation.bit_length() - per_octave.bit_length())
    return generation % step == 0


class Course:
    """The course of one search, by its batches.

    The value of a curve is, with one objective, the least feasible value so far (NaN before the
    first), else the hypervolume of all feasible values. `level` is the value that the search is to
    reach: from above with one objective, from below for a hypervolume; NaN where there is none.
    """

    def __init__(self, box: Box, level: float) -> None:
        self.box = box
        self.level = level
        self.objectives = len(box.ideal)
        self.front = np.empty((0, self.objectives))
        self.reached_at: tuple[float, float] = (np.nan, np.nan)
        self.batches = 0
        self.evaluations = 0
        self.feasible = 0
        self._rows: list[tuple[float, ...]] = []
        self._open: list[Batch] = []
        self._waiting = 0
        self._per_octave = PER_OCTAVE.get(self.objectives, FEW)

    def add(self, f: Array, feasible: Flags, cpu_s: float) -> None:
        """Take in a batch: objectives (n, objectives), feasible (n,), CPU time used so far [s]."""
        self.batches += 1
        rows = np.flatnonzero(feasible)
        fraction = len(rows) / len(f) if len(f) else 0.0
        numbers = (self.evaluations + rows + 1).astype(np.int64)
        self.evaluations += len(f)
        self.feasible += len(rows)
        feasible_values = f if len(rows) == len(f) else f[rows]
        self._open.append(Batch(self.batches, self.evaluations, cpu_s, fraction, numbers, feasible_values))
        self._waiting += len(rows)
        if self._waiting > BLOCK:
            self._settle()

    def curve(self) -> Array:
        """Rows (k, columns of `CURVE`); the last batch is always one of them."""
        self._settle(last=True)
        return np.array(self._rows, dtype=float).reshape(-1, len(CURVE))

    @property
    def value(self) -> float:
        """The value at the end; NaN where one objective has no feasible design."""
        return self._value(self.front)

    def _settle(self, last: bool = False) -> None:
        """Chart the open batches and replace their values by the front."""
        group: list[Batch] = []
        for batch in self._open:
            group.append(batch)
            end = last and batch is self._open[-1]
            if end or charted(batch.generation, self._per_octave):
                self._chart(group)
                group = []
        self._open = group
        self._waiting = sum(len(batch.values) for batch in group)

    def _chart(self, group: list[Batch]) -> None:
        """Add the last batch of a group to the curve, after those before it."""
        before, news = self.front, np.concatenate([batch.values for batch in group])
        if len(news):
            merged = np.concatenate([before, news])
            self.front = merged[nondominated(merged)]
        value = self._value(self.front)
        if np.isnan(self.reached_at[0]) and self._reached(value):
            self.reached_at = self._passed(before, news, group)
        last = group[-1]
        self._rows.append((last.generation, last.evaluations, last.cpu_s, value, last.feasible_fraction))

    def _passed(self, before: Array, news: Array, group: list[Batch]) -> tuple[float, float]:
        """Evaluations, and CPU time at the end of their batch, at which the level was passed."""
        low, high = 0, len(news)
        while high - low > 1:
            middle = (low + high) // 2
            reached = self._reached(self._value(np.concatenate([before, news[:middle]])))
            low, high = (low, middle) if reached else (middle, high)
        evaluations = int(np.concatenate([batch.numbers for batch in group])[high - 1])
        return evaluations, next(batch.cpu_s for batch in group if batch.evaluations >= evaluations)

    def _reached(self, value: float) -> bool:
        return bool(value <= self.level if self.objectives == 1 else value >= self.level)

    def _value(self, values: Array) -> float:
        if self.objectives > 1:
            return self.box.hypervolume(values)
        return float(values.min()) if len(values) else np.nan
