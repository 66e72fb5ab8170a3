"""What every contender is given: two objectives of a batch of designs, and the best front."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import moocore
import numpy as np
from numpy.typing import NDArray

from .parts import Parts, Watched

Array = NDArray[np.float64]
REFERENCE = 1.1


class OutOfTime(Exception):
    """A run has used the CPU time it is given."""


@dataclass(frozen=True, slots=True)
class Task:
    """Minimise `evaluate`, (n, variables) to (n, 2), in the box; `front` (k, 2) is the best.

    `problem` makes the same as a problem of tolevo, `parts` are its coefficients where cost and
    variation are separable. A run may take `patience` times the CPU time of others.
    """

    name: str
    low: Array
    high: Array
    evaluate: Callable[[Array], Array]
    front: Array
    note: str
    problem: Callable[[], Watched] | None = None
    parts: Parts | None = None
    patience: float = 1.0

    def share(self, values: Array) -> float:
        """Hypervolume of `values` over that of the front, both normalised by the front's box."""
        ideal, nadir = self.front.min(axis=0), self.front.max(axis=0)
        own, best = (
            float(moocore.hypervolume((f - ideal) / (nadir - ideal), ref=[REFERENCE, REFERENCE]))
            for f in (values, self.front)
        )
        return own / best


@dataclass(slots=True)
class Recorder:
    """Evaluates for a contender and notes when each value was known, in CPU seconds.

    Nothing is computed from the values before the run is over.
    """

    task: Task
    seconds: float
    batches: list[Array] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    start: float = field(default_factory=time.process_time)

    @property
    def low(self) -> Array:
        return self.task.low

    @property
    def high(self) -> Array:
        return self.task.high

    def batch(self, x: Array) -> Array:
        """Objectives (n, 2) of designs (n, variables).

        Raises OutOfTime once the run has used its CPU time.
        """
        values = self.task.evaluate(x)
        self.note(values)
        return values

    def note(self, values: Array) -> None:
        """Objectives (n, 2) that have just been evaluated. Raises OutOfTime as `batch` does."""
        now = time.process_time() - self.start
        if now > self.seconds:
            raise OutOfTime
        self.batches.append(values)
        self.times.append(now)

    def one(self, x: Array) -> Array:
        """Objectives (2,) of one design, for contenders that take no batches."""
        row: Array = self.batch(x[None, :])[0]
        return row

    @property
    def count(self) -> int:
        return sum(len(values) for values in self.batches)

    @property
    def each(self) -> float:
        """CPU seconds per evaluation, nan where there is none."""
        return self.times[-1] / self.count if self.times else np.nan

    @property
    def seen(self) -> float:
        """Share of the hypervolume that all evaluated designs have, 0 where there is none."""
        return self.task.share(np.vstack(self.batches)) if self.batches else 0.0

    def reached(self, share: float) -> tuple[float, float]:
        """Evaluations and CPU seconds until all evaluated designs had `share` of the hypervolume.

        Infinite where they never had. The hypervolume never falls, so the first time is bisected.
        """
        if not self.batches:
            return np.inf, np.inf
        values = np.vstack(self.batches)
        if self.task.share(values) < share:
            return np.inf, np.inf
        low, high = 0, len(values)
        while high - low > 1:
            middle = (low + high) // 2
            enough = self.task.share(values[:middle]) >= share
            low, high = (low, middle) if enough else (middle, high)
        ends = np.cumsum([len(values) for values in self.batches])
        return high, self.times[int(np.searchsorted(ends, high))]
