"""Racing: settings that are behind beyond chance get no further seeds.

After some seeds the settings still in the race are ranked within each seed (Friedman's ranks, which
take any shape of the response, and common random numbers as they are). A setting leaves where its
mean rank is behind that of the leader by more than z sqrt(k (k + 1) / (6 n)), k settings and n
seeds: the standard deviation of the difference of two mean ranks where no setting differs, more
than it is where the others differ as well. z is that of alpha / (k - 1), so that the best setting
stays with a probability of 1 - alpha however many there are and look at it after look: look j has
alpha / (j (j + 1)) of the whole alpha, whatever number of seeds is asked for (F-Race of Birattari
et al. 2002, with a bound on the whole family in place of a test per look).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm, rankdata

from ...arrays import Array

ALPHA = 0.05
"""Chance that the best setting of all leaves."""
FIRST = 5
"""Seeds before anything leaves."""
LEADERS = "leaders.csv"
"""Settings that are not behind beyond chance: as a table it is the design of a study on a finer
problem."""
STOPPED = "stopped"
"""Status of a run that is not made, as its setting is behind beyond chance."""


def looks(seeds: int) -> Iterator[int]:
    """Numbers of seeds after which settings are compared: 5, 7, 10, 14, 20, 28, ... below all."""
    at, step = float(FIRST), 2.0**0.5
    while round(at) < seeds:
        yield round(at)
        at *= step


def behind(costs: Array, look: int) -> NDArray[np.bool_]:
    """Which settings (k,) are behind the leader at a look (from 1); costs (k, seeds), less is
    better, infinite where a run failed or did not get there.
    """
    settings, seeds = costs.shape
    if settings < 2:
        return np.zeros(settings, dtype=bool)
    mean = rankdata(costs, axis=0).mean(axis=1)
    level = ALPHA / (look * (look + 1)) / (settings - 1)
    least = norm.isf(level) * np.sqrt(settings * (settings + 1) / (6.0 * seeds))
    return np.asarray(mean - mean.min() > least)


def trailing_settings(costs: Sequence[Array], racing: NDArray[np.bool_], look: int) -> NDArray[np.bool_]:
    """Settings (points,) of those still `racing` that are behind in every response.

    A setting that leads in one of them stays in all.
    """
    trailing = np.zeros(len(racing), dtype=bool)
    trailing[racing] = np.all([behind(response_costs[racing], look) for response_costs in costs], axis=0)
    return trailing


def leaders(design: pd.DataFrame, costs: Sequence[Array]) -> pd.DataFrame:
    """The settings (rows of `design`) that are behind in none or not every response, by their ranks
    in the first; a run that was not made counts as the worst.
    """
    leading = ~trailing_settings(costs, np.ones(len(design), dtype=bool), 1)
    order = np.argsort(rankdata(costs[0], axis=0).mean(axis=1), kind="stable")
    return design.iloc[[row for row in order if leading[row]]].drop_duplicates()
