"""Analysis of variance by statsmodels: whether a key matters at all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from statsmodels.api import OLS
from statsmodels.stats.anova import AnovaRM

from ..records import Factor
from .contrasts import Contrast
from .resampling import Array
from .runs import complete


def surface_tests(
    values: Array, design: pd.DataFrame, factors: tuple[Factor, ...]
) -> list[dict[str, Any]]:
    """F of every key on the means over the seeds, against what the model does not explain."""
    means = complete(values).mean(axis=1)
    full = OLS(means, model(design, factors)).fit()
    rows = []
    for factor in factors:
        rest = tuple(one for one in factors if one is not factor)
        f, p, _ = full.compare_f_test(OLS(means, model(design, rest)).fit())
        rows.append({"key": factor.key, "statistic": float(f), "p": float(p), "n": len(means)})
    return rows


def level_test(values: Array, contrast: Contrast) -> dict[str, Any]:
    """F of one key with the seeds as blocks (repeated measures), on its levels' means."""
    table = contrast.table(values)
    table = table[~np.isnan(table).any(axis=1)]
    seeds, levels = table.shape
    out = {"key": contrast.key, "statistic": np.nan, "p": np.nan, "n": seeds}
    if seeds < 2 or levels < 2 or np.ptp(table, axis=1).max() == 0.0:
        return out
    long = pd.DataFrame({
        "seed": np.repeat(np.arange(seeds), levels),
        "level": np.tile(np.arange(levels), seeds),
        "value": table.ravel(),
    })  # fmt: skip
    with np.errstate(divide="ignore"):  # no noise at all: F is infinite
        found = AnovaRM(long, "value", "seed", within=["level"]).fit().anova_table.iloc[0]
    return out | {"statistic": float(found["F Value"]), "p": float(found["Pr > F"])}


def model(design: pd.DataFrame, factors: tuple[Factor, ...]) -> Array:
    """Constant, then a line and a curve of each range and the levels of each list."""
    blocks = [np.ones((len(design), 1))]
    for factor in factors:
        cells = design[factor.key]
        if not factor.ranged:
            kept = [one for one in factor.levels if (cells == one).any()][1:]
            blocks.append(np.column_stack([(cells == one).astype(float) for one in kept])
                          if kept else np.empty((len(design), 0)))  # fmt: skip
            continue
        x = cells.to_numpy(dtype=float)
        x = np.log(x) if factor.log else x
        x = (x - x.mean()) / (np.ptp(x) or 1.0)
        blocks.append(np.column_stack([x, x**2]))
    return np.hstack(blocks)
