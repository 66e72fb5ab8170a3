"""Statistics of one response of a study: intervals, noise, analysis of variance, and tests on seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from math import factorial
from typing import Any

import numpy as np
import pandas as pd
import scipy
from scipy.stats import bootstrap, friedmanchisquare, rankdata, t, wilcoxon
from statsmodels.api import OLS
from statsmodels.stats.multitest import multipletests

from ...section import Array
from .plan import LARGER_IS_BETTER, Factor, Level, StudySettings

# The values of one response as an array of settings by replicates.


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


def complete_seeds(values: Array) -> Array:
    """Without the seeds that failed anywhere."""
    return values[:, ~np.isnan(values).any(axis=0)]


# The levels of a key side by side: the value of each seed at each of them.


@dataclass(frozen=True, slots=True)
class Contrast:
    """A key, its levels, and the settings (rows of the design) at each of them."""

    key: str
    levels: tuple[Level, ...]
    members: tuple[np.ndarray, ...]

    def table(self, values: Array) -> Array:
        """Mean over each level, shape (replicates, levels); NaN where a run failed."""
        return np.column_stack([values[rows].mean(axis=0) for rows in self.members])


def contrasts(
    kind: str, design: pd.DataFrame, factors: tuple[Factor, ...], base: Mapping[str, Level]
) -> list[Contrast]:
    """What the design lets one compare: levels of a key, whole settings of a table, or nothing.

    One at a time: the levels of a key with the others as in the run. Factorial: the levels of a key
    over all settings of the others.
    """
    keys = [factor.key for factor in factors]
    if kind == "table":
        names = design[keys].astype(str).agg(", ".join, axis=1)
        rows = tuple(np.array([at]) for at in range(len(design)))
        return [Contrast("", tuple(f"{at}: {name}" for at, name in enumerate(names)), rows)]
    if kind not in ("one_at_a_time", "factorial"):
        return []
    at_base = pd.DataFrame({key: design[key] == base.get(key) for key in keys})
    compared = []
    for key in keys:
        others = at_base.drop(columns=key).all(axis=1).to_numpy()
        usable = others if kind == "one_at_a_time" else np.ones(len(design), dtype=bool)
        levels = _ordered_levels(design.loc[usable, key])
        rows = tuple(np.flatnonzero(usable & (design[key] == level).to_numpy()) for level in levels)
        compared.append(Contrast(key, levels, rows))
    return compared


def _ordered_levels(column: pd.Series) -> tuple[Level, ...]:
    """The different values, numbers by size, names as they come."""
    values = list(dict.fromkeys(column.tolist()))
    names = any(isinstance(value, str) for value in values)
    return tuple(values if names else sorted(values))


# Estimates that the noise of the runs does not inflate, and their intervals.
#
# A product of two values of one setting is taken over two different seeds, so that the noise of a run
# never multiplies itself: mean over r != s of a_r b_s is free of bias whatever the noise. Intervals
# come from a Bayesian bootstrap (Rubin 1981) of settings and of seeds; where both are a sample, the
# variances add, less that of the single runs, which is in both (Cameron, Gelbach, Miller 2011).
# Settings of a Sobol sequence are better than a random sample: their part comes from a jackknife over
# parts of the design that were scrambled apart from each other (Owen 2013, Monte Carlo theory, 17.3).


Statistic = Callable[[Array, Array], Array]
"""From weights of the settings (draws, settings) and of the runs (draws, settings or 1, replicates)
to estimates (draws, statistics)."""
LEVEL = 0.95
DRAWS = 400
BLOCK = 2_000_000
"""Weights that are drawn at a time."""


@dataclass(frozen=True, slots=True)
class Estimates:
    """Values with their intervals, each of shape (statistics,)."""

    value: Array
    low: Array
    high: Array
    level: float = LEVEL


def cross_mean(a: Array, b: Array, weights: Array) -> Array:
    """Weighted mean of a_r b_s over all r != s of the last axis, NaN where there is no such pair.

    A weight of 0 leaves a run out; its values must be finite all the same.
    """
    squares = weights**2
    both = _weighted_sum(weights, a) * _weighted_sum(weights, b) - _weighted_sum(squares, a * b)
    sum_of_squares = squares.sum(-1)
    pairs = weights.sum(-1) ** 2 - sum_of_squares
    usable = pairs > 1e-9 * np.maximum(sum_of_squares, 1e-300)
    return np.where(usable, both / np.where(usable, pairs, 1.0), np.nan)


def _weighted_sum(weights: Array, values: Array) -> Array:
    """Weighted sum over the last axis, without the array of products."""
    return np.asarray(np.einsum("...r,...r->...", weights, values))


def mean_over_settings(values: Array, weights: Array) -> Array:
    """Weighted mean over the last axis without NaN; NaN where no value remains."""
    known = ~np.isnan(values)
    total = (weights * known).sum(-1)
    summed = (weights * np.where(known, values, 0.0)).sum(-1)
    return np.where(total > 0, summed / np.where(total > 0, total, 1.0), np.nan)


def fraction_of(parts: Array, total: Array) -> Array:
    """Parts (draws, statistics) over totals (draws,), 0 where nothing varies."""
    return np.divide(parts, total[:, None], out=np.zeros_like(parts), where=total[:, None] > 0.0)


def random_settings(
    statistic: Statistic, settings: int, replicates: int, rng: np.random.Generator, parts: int = 0, level: float = LEVEL
) -> Estimates:
    """Estimates where the settings are a sample (blocks of a Sobol design, trajectories).

    Each of `parts` equal parts in a row is a sample that is independent of the others.
    """
    value, flat = _value(statistic, settings, replicates)
    all_runs = np.ones((1, 1, replicates))
    if parts:
        leave_one_out = np.repeat(1.0 - np.eye(parts), settings // parts, axis=1)
        rows = np.asarray((parts - 1) * statistic(leave_one_out, all_runs).var(axis=0))
    else:
        rows = _spread(lambda n: statistic(rng.exponential(size=(n, settings)), all_runs), settings)
    seeds = _spread(lambda n: statistic(flat, rng.exponential(size=(n, 1, replicates))), replicates)
    runs = _spread(
        lambda n: statistic(flat, rng.exponential(size=(n, settings, replicates))),
        replicates,
        max(1, BLOCK // (settings * replicates)),
    )
    return _interval_around(value, rows + np.maximum(seeds - runs, 0.0), (parts or settings) - 1, level)


def fixed_settings(statistic: Statistic, replicates: int, rng: np.random.Generator) -> Estimates:
    """Estimates for exactly the settings of the design; the seeds are the sample."""
    value, flat = _value(statistic, 1, replicates)
    variance = _spread(lambda n: statistic(flat, rng.exponential(size=(n, 1, replicates))), replicates)
    return _interval_around(value, variance, replicates - 1)


def _value(statistic: Statistic, settings: int, replicates: int) -> tuple[Array, Array]:
    flat = np.ones((1, settings))
    return statistic(flat, np.ones((1, 1, replicates)))[0], flat


def _spread(draw: Callable[[int], Array], units: int, block: int = DRAWS) -> Array:
    """Variance over the draws, as of a mean of `units` independent values."""
    counts = np.diff(np.append(np.arange(0, DRAWS, min(block, DRAWS)), DRAWS))
    estimates = np.concatenate([draw(int(n)) for n in counts])
    if units < 2:
        return np.full(estimates.shape[1], np.nan)
    # Weights of a Dirichlet distribution spread a mean by (n - 1) / (n + 1) of its variance.
    return np.asarray(estimates.var(axis=0) * (units + 1) / (units - 1))


def _interval_around(value: Array, variance: Array, freedom: int, level: float = LEVEL) -> Estimates:
    half = t.ppf(0.5 + level / 2, max(freedom, 1)) * np.sqrt(variance)
    return Estimates(value, value - half, value + half, level)


# Median of a response at every setting, with its bootstrap interval over the seeds.


percentile_bootstrap = partial(
    bootstrap, vectorized=True, n_resamples=2000, confidence_level=LEVEL, method="percentile"
)
BATCH = 2_000_000
"""Resampled values held at a time, so that thousands of settings fit into memory."""


def medians(runs: Runs, rng: np.random.Generator) -> pd.DataFrame:
    """Columns response, point, median, low, high, level, n, failed, reached; a row per setting.

    NaN where nothing is known: all runs failed, or half of them did not reach the response.
    """
    known = (~np.isnan(runs.array)).sum(axis=1)
    intervals = np.full((len(known), 3), np.nan)
    for count in np.unique(known[known > 0]):
        rows = known == count
        values = np.sort(runs.array[rows], axis=1)[:, :count]  # NaN comes last
        intervals[rows] = interval_of_median(values, rng)
    return pd.DataFrame(
        {"response": runs.response, "point": np.arange(len(known))}
        | dict(zip(("median", "low", "high"), intervals.T, strict=True))
        | {"level": LEVEL, "n": known, "failed": runs.replicates - known}
        | {"reached": np.isfinite(runs.array).sum(axis=1)}
    )


def interval_of_median(values: Array, rng: np.random.Generator) -> Array:
    """Median, low and high, shape (rows, 3), of values (rows, n); NaN where they are infinite."""
    middle = np.median(values, axis=1)
    with np.errstate(invalid="ignore"):
        if values.shape[1] < 2:
            low, high = np.full((2, len(values)), np.nan)
        else:
            batch = max(1, BATCH // values.size)
            interval = percentile_bootstrap((values,), np.median, axis=1, batch=batch, rng=rng).confidence_interval
            low, high = np.asarray(interval.low), np.asarray(interval.high)
        stacked = np.column_stack([middle, low, high])
    return np.where(np.isfinite(stacked), stacked, np.nan)


# The noise of the runs: what the seed changes at one setting.


def noise_share(values: Array, group: int, rng: np.random.Generator) -> Estimates:
    """Share of the noise in the variance of a run over settings and seeds, shape (1,).

    `values` (settings, replicates), NaN where a run failed. `group` settings in a row belong
    together and are sampled together; 0 for settings that are no sample.
    """
    known = ~np.isnan(values)
    counts = np.maximum(known.sum(axis=0), 1)
    filled = np.where(known, values, 0.0)
    centred = np.where(known, values - filled.sum(axis=0) / counts, 0.0)
    settings = len(values)

    def statistic(rows: Array, runs: Array) -> Array:
        rows = np.repeat(rows, max(group, 1), axis=1) if group else np.ones((1, settings))
        runs = np.repeat(runs, group, axis=1) if group and runs.shape[1] > 1 else runs
        weights = runs * known
        within = mean_over_settings(variance(filled, weights), rows)
        between = mean_over_settings(cross_mean(centred, centred, weights), rows)
        total = within + np.maximum(between, 0.0)
        return np.divide(within, total, out=np.zeros_like(within), where=total > 0.0)[:, None]

    if group:
        return random_settings(statistic, settings // group, values.shape[1], rng)
    return fixed_settings(statistic, values.shape[1], rng)


def variance(values: Array, weights: Array) -> Array:
    """Weighted variance over the last axis without bias; NaN where there are less than two runs."""
    total = weights.sum(-1)
    safe = np.where(total > 0, total, 1.0)
    mean = (weights * values).sum(-1) / safe
    spread = (weights * (values - mean[..., None]) ** 2).sum(-1) / safe
    correction = 1.0 - (weights**2).sum(-1) / safe**2
    usable = correction > 1e-9
    return np.where(usable & (total > 0), spread / np.where(usable, correction, 1.0), np.nan)


# Analysis of variance: whether a key matters at all.


def surface_tests(values: Array, design: pd.DataFrame, factors: tuple[Factor, ...]) -> list[dict[str, Any]]:
    """F of every key on the means over the seeds, against what the model does not explain."""
    means = complete_seeds(values).mean(axis=1)
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


# Tests on common seeds: Wilcoxon for pairs of levels, Friedman for all of them.
#
# No significance is claimed where the number of seeds cannot give it.


ALPHA = 0.05
MAX_PAIRED_LEVELS = 12
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
        if len(contrast.levels) > MAX_PAIRED_LEVELS:
            continue
        values = contrast.table(runs.array)
        for i, j in combinations(range(len(contrast.levels)), 2):
            pair = paired_test(values[:, i], values[:, j], rng)
            rows.append({"key": contrast.key, "a": contrast.levels[i], "b": contrast.levels[j]} | pair)
    return corrected(runs.response, "wilcoxon", rows, partial(_reason, needed=pairs_needed))


def paired_test(a: Array, b: Array, rng: np.random.Generator) -> dict[str, Any]:
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


# `tests.csv`: every test of one response.


def tests(
    runs: Runs, design: pd.DataFrame, settings: StudySettings, contrasts: list[Contrast], rng: np.random.Generator
) -> pd.DataFrame:
    """Wilcoxon for pairs, Friedman for more, analysis of variance; Holm within each kind."""
    parts = [
        wilcoxon_tests(runs, contrasts, rng),
        friedman_tests(runs, contrasts),
        _variances(runs, design, settings, contrasts),
    ]
    parts = [part for part in parts if len(part)]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(COLUMNS))


def _variances(runs: Runs, design: pd.DataFrame, settings: StudySettings, contrasts: list[Contrast]) -> pd.DataFrame:
    """Tests of the analysis of variance; none where values are missing for it."""
    if not runs.reached:
        return pd.DataFrame()
    rows: list[dict[str, Any]] = []
    if settings.design.analysis == "latin_hypercube" and complete_seeds(runs.array).shape[1]:
        rows = surface_tests(runs.array, design, settings.factors)
    elif settings.design.analysis != "latin_hypercube":
        rows = [level_test(runs.array, contrast) for contrast in contrasts]
    unknown = "nothing is left to compare with"
    return corrected(runs.response, "anova", rows, lambda row, _: unknown if np.isnan(row["p"]) else "")
