"""Analysis of variance: whether a key matters at all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import scipy
from statsmodels.api import OLS

from ....arrays import Array
from ..records import Factor
from .contrasts import Contrast
from .runs import complete


def surface_tests(values: Array, design: pd.DataFrame, factors: tuple[Factor, ...]) -> list[dict[str, Any]]:
    """F of every key on the means over the seeds, against what the model does not explain."""
    means = complete(values).mean(axis=1)
    full = OLS(means, model(design, factors)).fit()
    rows = []
    for factor in factors:
        rest = tuple(other for other in factors if other is not factor)
        f, p, _ = full.compare_f_test(OLS(means, model(design, rest)).fit())
        rows.append({"key": factor.key, "statistic": float(f), "p": float(p), "n": len(means)})
    return rows


def level_test(values: Array, contrast: Contrast) -> dict[str, Any]:
    """F of one key with the seeds as blocks, on its levels' means.

    Repeated measures: the mean square of k levels over that of what neither levels nor the n seeds
    explain, with k - 1 and (k - 1)(n - 1) degrees of freedom (Girden 1992, ANOVA: repeated
    measures). By sums, as statsmodels makes a table of (k n)^2: 75 GB of 100,000 runs.
    """
    table = contrast.table(values)
    table = table[~np.isnan(table).any(axis=1)]
    seeds, levels = table.shape
    result = {"key": contrast.key, "statistic": np.nan, "p": np.nan, "n": seeds}
    if seeds < 2 or levels < 2 or np.ptp(table, axis=1).max() == 0.0:
        return result
    freedom = levels - 1, (levels - 1) * (seeds - 1)
    by_level, by_seed = table.mean(axis=0), table.mean(axis=1, keepdims=True)
    between = seeds * np.sum((by_level - table.mean()) ** 2) / freedom[0]
    within = np.sum((table - by_level - by_seed + table.mean()) ** 2) / freedom[1]
    with np.errstate(divide="ignore"):  # no noise at all: F is infinite
        statistic = float(np.divide(between, within))
    return result | {"statistic": statistic, "p": float(scipy.stats.f.sf(statistic, *freedom))}


def model(design: pd.DataFrame, factors: tuple[Factor, ...]) -> Array:
    """Constant, then a line and a curve of each range and the levels of each list."""
    blocks = [np.ones((len(design), 1))]
    for factor in factors:
        cells = design[factor.key]
        if not factor.ranged:
            levels = [level for level in factor.levels if (cells == level).any()][1:]
            blocks.append(
                np.column_stack([(cells == level).astype(float) for level in levels])
                if levels
                else np.empty((len(design), 0))
            )
            continue
        x = cells.to_numpy(dtype=float)
        x = np.log(x) if factor.log else x
        x = (x - x.mean()) / (np.ptp(x) or 1.0)
        blocks.append(np.column_stack([x, x**2]))
    return np.hstack(blocks)
