"""What designs require of factors and replicates."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ....errors import Fault
from ..records import Factor, Level


def replicate_faults(seeds: int, statistic: str) -> list[Fault]:
    """A fault where one seed per setting confounds the noise of a run with an effect."""
    if seeds >= 2:
        return []
    text = f"is {seeds}: {statistic} need at least 2 replicates, or the noise of a run counts as an"
    return [Fault("seeds", f"{text} effect of the settings")]


def level_faults(factors: tuple[Factor, ...], kind: str) -> list[Fault]:
    """A fault of every factor that has no levels to go through."""
    return [
        Fault(
            f"vary.{factor.key}",
            f"has one level or none: {kind} needs two or more; give a list of values, or `levels` with low and high",
        )
        for factor in factors
        if len(factor.grid()) < 2
    ]


def small(name: str, value: int, least: int, statistic: str) -> list[Fault]:
    """A fault where `value` is below what a statistic needs."""
    return [] if value >= least else [Fault(name, f"is {value}: {statistic} at least {least}")]


def unit_cube(factors: tuple[Factor, ...]) -> dict[str, object]:
    """The keys as SALib describes them, each from 0 to 1."""
    names = [factor.key for factor in factors]
    return {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}


def frame_of(factors: tuple[Factor, ...], shares: NDArray[np.float64]) -> pd.DataFrame:
    """The values of the factors at `shares` (n, factors), each in [0, 1]."""
    columns = zip(factors, shares.T.tolist(), strict=True)
    return pd.DataFrame({factor.key: column(map(factor.at, values)) for factor, values in columns})


def column(values: Iterable[Level]) -> pd.Series:
    """A column that keeps whole numbers whole and names as they are."""
    return pd.Series(list(values), dtype=object).infer_objects()
