"""The course of a run over its generations at each level of a key: median and interval."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..records import StudyData
from .contrasts import Contrast
from .medians import interval_of_median
from .resampling import LEVEL

COLUMNS = ("key", "level", "generation", "median", "low", "high", "level_of_interval", "n", "optimum")
SHOWN = 80
"""Generations of a course at most."""


def courses(data: StudyData, contrasts: list[Contrast], rng: np.random.Generator) -> pd.DataFrame:
    """One row per key, level and generation; NaN while half of the runs have no feasible design.

    `optimum` is the exact value of that setting, NaN where none is proven.
    """
    optimum = data.exact.set_index("point")["value"]
    parts = [
        _course(data.curves.of(int(rows[0])), rng).assign(
            key=contrast.key, level=level, optimum=optimum.get(int(rows[0]), np.nan)
        )
        for contrast in contrasts
        for level, rows in zip(contrast.levels, contrast.members, strict=True)
    ]
    parts = [part for part in parts if len(part)]
    if not parts:
        return pd.DataFrame(columns=list(COLUMNS))
    return pd.concat(parts, ignore_index=True).reindex(columns=list(COLUMNS))


def _course(curves: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The course at one setting, by its curves, over the generations that all of its runs have."""
    wide = curves.pivot_table(index="generation", columns="replicate", values="value", dropna=False)
    wide = wide.fillna(np.inf)  # no feasible design yet
    whole = curves.groupby("generation")["replicate"].nunique()
    wide = wide.loc[whole[whole == whole.max()].index] if len(whole) else wide
    if wide.empty:
        return pd.DataFrame()
    chosen = np.unique(np.linspace(0, len(wide) - 1, SHOWN).astype(int))
    intervals = interval_of_median(wide.to_numpy()[chosen], rng)
    columns = dict(zip(("median", "low", "high"), intervals.T, strict=True))
    return pd.DataFrame({"generation": wide.index[chosen]} | columns).assign(level_of_interval=LEVEL, n=wide.shape[1])
