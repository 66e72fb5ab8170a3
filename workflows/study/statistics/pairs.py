"""Tests on common seeds: Wilcoxon for pairs of levels, Friedman for all of them.

No significance is claimed where the number of seeds cannot give it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import combinations
from math import factorial
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import friedmanchisquare, rankdata, wilcoxon
from statsmodels.stats.multitest import multipletests

from ....arrays import Array
from .contrasts import Contrast
from .medians import interval_of_median
from .runs import Runs

ALPHA = 0.05
MOST = 12
"""Levels up to which all pairs are compared."""
COLUMNS = (
    "response",
    "key",
    "kind",
    "a",
    "b",
    "n",
    "statistic",
    "p",
    "p_holm",
    "effect",
    "difference",
    "low",
    "high",
    "significant",
    "reason",
)


def wilcoxon_tests(runs: Runs, contrasts: list[Contrast], rng: np.random.Generator) -> pd.DataFrame:
    """Every pair of levels of every key; Holm's correction is over all of the response.

    `effect` is the matched-pairs rank-biserial correlation (Kerby 2014), positive where a is
    larger; `difference` the median of a - b over the seeds, with its bootstrap interval.
    """
    rows: list[dict[str, Any]] = []
    for contrast in contrasts:
        if len(contrast.levels) > MOST:
            continue
        values = contrast.table(runs.array)
        for i, j in combinations(range(len(contrast.levels)), 2):
            pair = paired(values[:, i], values[:, j], rng)
            rows.append({"key": contrast.key, "a": contrast.levels[i], "b": contrast.levels[j]} | pair)
    return corrected(runs.response, "wilcoxon", rows, partial(_reason, needed=pairs_needed))


def paired(a: Array, b: Array, rng: np.random.Generator) -> dict[str, Any]:
    """Wilcoxon's signed-rank test of two levels; a seed that failed at one of them is left out."""
    both = ~np.isnan(a) & ~np.isnan(b)
    a, b = a[both], b[both]
    with np.errstate(invalid="ignore"):
        difference = np.where(a == b, 0.0, a - b)  # two runs that did not get there are equal
    moved = difference[difference != 0.0]
    result: dict[str, Any] = {"n": len(a), "differ": len(moved), "statistic": np.nan, "p": 1.0, "effect": 0.0}
    if len(a):
        result |= dict(zip(("difference", "low", "high"), interval_of_median(difference[None], rng)[0], strict=True))
    if len(moved):
        test = wilcoxon(moved)
        ranks = rankdata(np.abs(moved))
        effect = float((np.sign(moved) * ranks).sum() / ranks.sum())
        result |= {"statistic": float(test.statistic), "p": float(test.pvalue), "effect": effect}
    return result | {"least": least_p(len(moved))}


def least_p(pairs: int) -> float:
    """The smallest p that the two-sided signed-rank test of so many pairs can give."""
    return min(1.0, 2.0 ** (1 - pairs))


def pairs_needed(tests: int) -> int:
    """Pairs from which one of so many tests can be significant after Holm's correction."""
    return int(np.ceil(1 + np.log2(tests / ALPHA) - 1e-12))


def friedman_tests(runs: Runs, contrasts: list[Contrast]) -> pd.DataFrame:
    """All levels of every key that has more than two; `effect` is Kendall's W."""
    rows = [
        {"key": contrast.key} | _friedman(contrast.table(runs.array))
        for contrast in contrasts
        if len(contrast.levels) > 2
    ]
    return corrected(runs.response, "friedman", rows, _reason)


def _friedman(values: Array) -> dict[str, Any]:
    """Seeds that failed at one level are left out."""
    whole = values[~np.isnan(values).any(axis=1)]
    seeds, levels = whole.shape
    ranks = rankdata(whole, axis=1) if seeds else whole
    same = bool(np.all(ranks == ranks[:, :1]))
    result = {"n": seeds, "differ": 0 if same else seeds, "statistic": np.nan, "p": 1.0, "effect": 0.0}
    if seeds >= 2 and not same:
        test = friedmanchisquare(*ranks.T)
        effect = float(test.statistic) / (seeds * (levels - 1))
        result |= {"statistic": float(test.statistic), "p": float(test.pvalue), "effect": effect}
    return result | {"least": min(1.0, float(factorial(levels)) ** (1 - seeds))}


def corrected(
    response: str, kind: str, rows: list[dict[str, Any]], reason: Callable[[dict[Any, Any], int], str]
) -> pd.DataFrame:
    """The rows as a table, corrected by Holm; NaN as p counts as 1.

    `reason` states why a row of so many tests cannot be significant, empty where it can be.
    """
    if not rows:
        return pd.DataFrame(columns=list(COLUMNS))
    frame = pd.DataFrame(rows).assign(response=response, kind=kind)
    frame["p_holm"] = multipletests(frame["p"].fillna(1.0), method="holm")[1]
    frame["reason"] = [reason(row, len(frame)) for row in frame.to_dict("records")]
    frame["significant"] = (frame["p_holm"] <= ALPHA) & (frame["reason"] == "")
    return frame.reindex(columns=list(COLUMNS))


def _reason(row: dict[Any, Any], tests: int, needed: Callable[[int], int] | None = None) -> str:
    """Why no significance can be claimed; empty where it can."""
    if row["n"] == 0:
        return "no seed has a run on both sides that did not fail"
    if row["differ"] == 0:
        return f"all {row['n']} seeds give the same on both sides"
    if row["least"] * tests <= ALPHA:
        return ""
    among = f" (times {tests} tests, Holm)" if tests > 1 else ""
    text = f"{row['differ']} seeds that differ never fall below p = {row['least']:.4g}{among}"
    return f"{text}; {needed(tests)} are needed" if needed else f"{text}; more seeds are needed"
