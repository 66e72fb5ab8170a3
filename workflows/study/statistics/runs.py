"""The values of one response as an array of settings by replicates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from ....arrays import Array
from ..records import LARGER_IS_BETTER


@dataclass(frozen=True, slots=True)
class Runs:
    """One response: `array` of shape (settings, replicates).

    NaN where a run failed. A run that ended well without reaching what the response asks for (99 %
    of the optimum) has the worst value there is: an infinite one.
    """

    response: str
    array: Array
    larger_is_better: bool

    @property
    def reached(self) -> bool:
        """Whether every run that did not fail has a finite value."""
        return not bool(np.isinf(self.array).any())

    @property
    def replicates(self) -> int:
        """Seeds per setting."""
        return int(self.array.shape[1])

    def costs(self) -> Array:
        """The values turned so that less is better, a failed run worst of all."""
        turned = -self.array if self.larger_is_better else self.array
        return np.where(np.isnan(turned), np.inf, turned)


def runs_of(table: pd.DataFrame, response: str, settings: int) -> Runs:
    """The values of `response` in the study table of `settings` settings."""
    larger = response in LARGER_IS_BETTER
    worst = -np.inf if larger else np.inf
    done = table["status"] == "done"
    value = table[response].astype(float).where(table[response].notna() | ~done, worst)
    value = value.where(done)
    replicates = int(table["replicate"].max()) + 1
    values = np.full((settings, replicates), np.nan)
    values[table["point"].to_numpy(dtype=int), table["replicate"].to_numpy(dtype=int)] = value
    return Runs(response, values, larger)


def complete(values: Array) -> Array:
    """Without the seeds that failed anywhere."""
    return values[:, ~np.isnan(values).any(axis=0)]
