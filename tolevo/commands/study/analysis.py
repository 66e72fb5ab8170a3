"""Statistics of a study: the effects of its settings, and the noise of its runs."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from ...page_data import records
from ...records import Recommendation, Response, StudyResult, Varied, Verdict
from ...section import Array
from .plan import LARGER_IS_BETTER, Hypothesis, Level, StudyData, StudySettings
from .sensitivity import sensitivity
from .statistics import (
    ALPHA,
    LEVEL,
    Contrast,
    Runs,
    contrasts,
    interval_of_median,
    medians,
    paired_test,
    pairs_needed,
    percentile_bootstrap,
    runs_of,
    tests,
)

__all__ = ["analyse"]

# The course of a run over its generations at each level of a key: median and interval.


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


# Whether an interpretation of a figure holds by the tests.


def verdicts(hypotheses: tuple[Hypothesis, ...], tests: pd.DataFrame) -> tuple[Verdict, ...]:
    """A verdict with its sentence for every hypothesis whose levels were compared."""
    outcomes = []
    for hypothesis in hypotheses:
        verdict, because = _verdict(hypothesis, _row(hypothesis, tests))
        words = f"{hypothesis.figure}, “{hypothesis.says}”: {verdict}. {because}"
        outcomes.append(
            Verdict(
                hypothesis.figure, hypothesis.key, (hypothesis.a, hypothesis.b), hypothesis.response, verdict, words
            )
        )
    return tuple(outcomes)


def _row(hypothesis: Hypothesis, tests: pd.DataFrame) -> dict[str, Any] | None:
    """The comparison of the two levels, turned so that `a` comes first."""
    of_key = tests[
        (tests["kind"] == "wilcoxon") & (tests["key"] == hypothesis.key) & (tests["response"] == hypothesis.response)
    ]
    for row in records(of_key):
        if (row["a"], row["b"]) == (hypothesis.a, hypothesis.b):
            return row
        if (row["a"], row["b"]) == (hypothesis.b, hypothesis.a):
            turned = {
                "effect": -row["effect"],
                "difference": -row["difference"],
                "low": -row["high"],
                "high": -row["low"],
            }
            return row | turned
    return None


def _verdict(hypothesis: Hypothesis, row: dict[str, Any] | None) -> tuple[str, str]:
    if row is None:
        text = f"The study has no comparison of {hypothesis.a} with {hypothesis.b} in {hypothesis.response}"
        return "undecided", f"{text}."
    if row["reason"]:
        return "undecided", f"{str(row['reason']).capitalize()}."
    if pd.isna(row["difference"]):  # a run that ended early may only have had the smaller budget
        text = f"Too many runs did not reach {hypothesis.response} within the budget of their setting"
        return "undecided", f"{text}, and what they would have needed is not known."
    evidence = _evidence(hypothesis, row)
    if not row["significant"]:
        return "not shown", f"{evidence}: no difference is shown."
    better = (row["effect"] > 0) == (hypothesis.response in LARGER_IS_BETTER)
    return ("holds" if better == hypothesis.better else "does not hold: it is the other way round", f"{evidence}.")


def _evidence(hypothesis: Hypothesis, row: dict[str, Any]) -> str:
    size = (
        f"{hypothesis.response} at {hypothesis.a} less that at {hypothesis.b} is "
        f"{row['difference']:.3g}{_interval(row)} in the median"
    )
    return f"{size} (rank correlation {row['effect']:.2f}, p = {row['p_holm']:.2g} after Holm, {row['n']} seeds)"


def _interval(row: dict[str, Any]) -> str:
    if pd.isna(row["low"]) or pd.isna(row["high"]):
        return ""
    return f" [{row['low']:.3g}, {row['high']:.3g}]"


# Recommended settings: chosen on half of the seeds, tested on the other half.
#
# A setting that is chosen and tested on the same runs looks better than it is.


UNKNOWN = (np.nan, np.nan, np.nan)
MIDDLE = "the setting in the middle"


def recommendation(
    runs: Runs, design: pd.DataFrame, base: Mapping[str, Level], response: Response, rng: np.random.Generator
) -> Recommendation:
    """The setting with the best median over the even replicates, tested on the odd ones.

    Its sentence says which setting to use: the best observed, or the run's own where the test does not show that
    the other is better. A failed run counts as the worst. The reference is the run configuration's own setting where
    the design has it, else the setting in the middle.
    """
    costs = runs.costs()
    chosen, held_out = costs[:, ::2], runs.array[:, 1::2]
    # Ties in the median (half of the runs not there) are broken by how many got there.
    rank = np.lexsort([np.isinf(chosen).sum(axis=1), np.median(chosen, axis=1)])
    best, reference, named = int(rank[0]), int(rank[len(rank) // 2]), MIDDLE
    same = (design[list(base)] == pd.Series(base, dtype=object)).all(axis=1).to_numpy()
    matching = np.flatnonzero(same & bool(base))
    if len(matching):
        reference, named = int(matching[0]), "the run's own setting"
    keys = [name for name in map(str, design.columns) if not name.startswith("_")]
    settings = {key: design[key].iloc[best] for key in keys}
    known = {key: design[key].iloc[reference] for key in keys}
    if np.isinf(np.median(chosen[best])):
        text = f"{response.name}: at most half of the runs of any setting reach it, so that none is recommended."
        return Recommendation(response.name, best, settings, False, UNKNOWN, text)
    if best == reference:
        text = f"use {_list_settings(settings)}: {named} is the best of {len(design)}, and nothing is to be changed"
        return Recommendation(response.name, best, settings, False, UNKNOWN, f"{response.name}: {text}.")
    test = paired_test(held_out[best], held_out[reference], rng)
    improves = (test["effect"] > 0) == runs.larger_is_better
    shown = bool(test["p"] <= ALPHA and improves and test["least"] <= ALPHA)
    recovered = _recovered_fraction(held_out[best], held_out[reference], response.best, rng)
    words = _sentence(response, (settings, known), named, test, improves, shown, recovered)
    return Recommendation(response.name, best, settings, shown, recovered, words)


def _recovered_fraction(
    best: Array, reference: Array, ideal: float | None, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Fraction of the reference's distance from the ideal that the best setting recovers."""
    both = np.isfinite(best) & np.isfinite(reference)
    if ideal is None or both.sum() < 2:
        return UNKNOWN

    def recovered_fraction(a: Array, b: Array, axis: int = -1) -> Array:
        missed = np.abs(ideal - b).sum(axis=axis)
        gained = missed - np.abs(ideal - a).sum(axis=axis)
        return np.asarray(np.divide(gained, missed, out=np.zeros_like(gained), where=missed > 0.0))

    pair = (best[both], reference[both])
    low, high = percentile_bootstrap(pair, recovered_fraction, paired=True, rng=rng).confidence_interval
    return float(recovered_fraction(pair[0][None], pair[1][None])[0]), float(low), float(high)


def _list_settings(settings: Mapping[str, Any]) -> str:
    """The keys of a setting with their values."""
    return ", ".join(
        f"{key} = {value:.4g}" if isinstance(value, float) else f"{key} = {value}" for key, value in settings.items()
    )


def _sentence(
    response: Response,
    settings: tuple[Mapping[str, Any], Mapping[str, Any]],
    named: str,
    test: dict[str, Any],
    improves: bool,
    shown: bool,
    recovered: tuple[float, float, float],
) -> str:
    """Which of two settings to use, the best observed or the reference `named`, and why."""
    best, reference = map(_list_settings, settings)
    half = f"{test['n']} seeds that did not choose it"
    if not test["n"]:
        return f"{response.name}: use {best}, the best observed; there is no other seed to test it with."
    if not shown:
        why = "" if improves else ", and on those it is the worse one"
        if test["least"] > ALPHA:
            why = f"; at least {2 * pairs_needed(1)} seeds are needed to show it"
        if named == MIDDLE:  # one that ranks lower is no better advice
            return (
                f"{response.name}: use {best}, the best observed, or any other: the {half} do not show that it beats "
                f"{named} ({reference}; p = {test['p']:.2g}){why}."
            )
        return (
            f"{response.name}: use {reference}, {named}: {best} is the best observed, but the {half} do not show "
            f"that it is better (p = {test['p']:.2g}){why}."
        )
    text = (
        f"{response.name}: use {best}: it beats {named} ({reference}) on {half} (p = {test['p']:.2g}, rank "
        f"correlation {abs(test['effect']):.2f})"
    )
    if np.isnan(recovered[0]):
        return f"{text}."
    return (
        f"{text} and recovers {100 * recovered[0]:.0f} % [{100 * recovered[1]:.0f}, "
        f"{100 * recovered[2]:.0f}] of what that misses of the best possible."
    )


# From the runs of a study to its statistics.


BEST = MappingProxyType({"hypervolume_ratio": 1.0, "gap_percent": 0.0, "feasible_fraction": 1.0})
"""The best value of a response that there can be."""
FAILED = (
    "{failed} of {total} runs failed. A failed run is left out together with the runs of its seed that it would be "
    "compared with: in a test the pair, in Friedman's and the analysis of variance the seed, in a Sobol block or a "
    "Morris step the seed in that block or step; a recommendation counts it as the worst"
)


def analyse(settings: StudySettings, data: StudyData, rng: np.random.Generator) -> StudyResult:
    """All statistics of a finished study; the same data and generator give the same result."""
    design = data.design.reset_index(drop=True)
    keys = [factor.key for factor in settings.factors]
    key_contrasts = contrasts(settings.design.analysis, design, settings.factors, settings.base)
    responses = tuple(Response(name, name in LARGER_IS_BETTER, BEST.get(name)) for name in settings.responses)
    all_runs = [runs_of(data.table, name, len(design)) for name in settings.responses]
    tested = _concatenate_tables([tests(runs, design, settings, key_contrasts, rng) for runs in all_runs])
    alone = key_contrasts if settings.design.analysis == "one_at_a_time" else []
    return StudyResult(
        title=settings.title,
        kind=settings.design.kind,
        design=design[keys],
        table=data.table,
        responses=responses,
        varied=tuple(
            Varied(factor.key, settings.base.get(factor.key), factor.categorical, factor.log)
            for factor in settings.factors
        ),
        medians=_concatenate_tables([medians(runs, rng) for runs in all_runs]),
        sensitivity=_concatenate_tables([sensitivity(runs, design, settings, key_contrasts, rng) for runs in all_runs]),
        tests=tested,
        courses=courses(data, alone, rng),
        course_of=settings.objectives[0] if len(settings.objectives) == 1 else "hypervolume",
        recommendations=tuple(
            recommendation(runs, design, settings.base, response, rng)
            for runs, response in zip(all_runs, responses, strict=True)
        ),
        verdicts=verdicts(settings.hypotheses, tested),
        notes=(*data.notes, *_notes(settings, data.table, all_runs, tested)),
        configuration=settings.configuration,
        mechanism=settings.labels.stated(),
    )


def _concatenate_tables(parts: list[pd.DataFrame]) -> pd.DataFrame:
    full = [part for part in parts if len(part)]
    return pd.concat(full, ignore_index=True) if full else parts[0]


def _notes(settings: StudySettings, table: pd.DataFrame, all_runs: list[Runs], tested: pd.DataFrame) -> list[str]:
    """What the reader must know: failures, what is left out and why."""
    notes = []
    failed = int((table["status"] == "failed").sum())
    if failed:
        notes.append(FAILED.format(failed=failed, total=len(table)))
    for runs in all_runs:
        if not runs.reached:
            count = int(np.isinf(runs.array).sum())
            notes.append(
                f"{runs.response}: {count} of {runs.array.size} runs did not reach it within the budget of their "
                "setting; they count as worse than all others in ranks, and the response has no variance to divide"
            )
    if settings.seeds < 2:
        notes.append("one seed per setting: noise and effects are confounded, and nothing is tested")
    pairs = tested[tested["kind"] == "wilcoxon"] if len(tested) else tested
    counts = pairs.groupby("response").size() if len(pairs) else pd.Series(dtype=int)
    needed = max((pairs_needed(int(count)) for count in counts), default=0)
    if settings.seeds < needed:
        text = f"{settings.seeds} seeds cannot show a difference at p = {ALPHA} among so many comparisons"
        notes.append(f"{text}: {needed} can")
    return notes
