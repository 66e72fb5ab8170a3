"""Recommended settings: chosen on half of the seeds, tested on the other half.

A setting that is chosen and tested on the same runs looks better than it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ....arrays import Array
from ....records import Recommendation, Response
from ..records import Level
from .medians import percentile_bootstrap
from .pairs import ALPHA, paired, pairs_needed
from .runs import Runs

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
        text = f"use {_listed(settings)}: {named} is the best of {len(design)}, and nothing is to be changed"
        return Recommendation(response.name, best, settings, False, UNKNOWN, f"{response.name}: {text}.")
    test = paired(held_out[best], held_out[reference], rng)
    improves = (test["effect"] > 0) == runs.larger_is_better
    shown = bool(test["p"] <= ALPHA and improves and test["least"] <= ALPHA)
    recovered = _recovered(held_out[best], held_out[reference], response.best, rng)
    words = _sentence(response, (settings, known), named, test, improves, shown, recovered)
    return Recommendation(response.name, best, settings, shown, recovered, words)


def _recovered(
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


def _listed(settings: Mapping[str, Any]) -> str:
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
    best, reference = map(_listed, settings)
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
