"""The next measurement of a batch: further units, at the ends of configured ranges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ....gap_next_records import Separation
from ....models.effects.population.law import Law
from ....models.measurable import Role
from ..ending_records import MORE
from ..likelihood import BatchLikelihood
from ..noise import Noise
from ..plan import NextPlan
from ..population import Scatter, exchanged_names
from ..result import Ending
from ..setup import Setup
from .field import Ahead
from .points import with_labels
from .rows import base_at, placed
from .separations import CERTAIN, FEWEST

MOST = 10**6
QUANTILES = 1000
"""Number of quantiles that represent a law."""


def further_units(setup: Setup, noises: Sequence[Noise], wanted: NextPlan, spread: bool) -> Ahead:
    """Units like those of the batch; with `spread` at the ends of the configured ranges in turn."""
    count, table = wanted.readings, setup.data.measurements.table
    rows = np.random.default_rng([setup.plan.seed, 11]).integers(len(setup.data), size=count)
    columns: dict[str, NDArray[Any]] = {}
    for column in setup.data.target.columns:
        if column.text or column.role is Role.REPEAT:
            continue
        columns[column.name] = np.asarray(table[column.name])[rows]
        span = wanted.ranges.get(column.name)
        if spread and span is not None:
            columns[column.name] = np.resize(span.values or (span.low, span.high), count)
    whole = with_labels(setup.data, columns or {"": np.zeros(count)})
    return Ahead(setup, noises, whole, base_at(setup, placed(setup.data, whole)))


def of_scatter(end: Ending, best: Scatter, rival: Scatter, count: int) -> Separation:
    """The separation of two effects on the scatter by further units: the log likelihood ratio of a
    unit has a mean and a variance, which add up over units.
    """
    law = end.analysis.initial_null_model.batch.law
    laws = [effect.changed(law) for effect in (best, rival)]
    kinds = [effect.likelihood(law)[0] for effect in (best, rival)]
    moments = [_moments(right, wrong) for right, wrong in zip(laws, kinds[::-1], strict=True)]
    names, instead = exchanged_names(best, rival)
    ahead, n = rival.distance, len(end.setup.data)
    chance = _chance(moments, ahead, count)
    tried = np.unique(np.geomspace(FEWEST, MOST, 400).astype(int)).tolist()
    short = [k for k in tried if _chance(moments, ahead, k) < CERTAIN]
    needed = next((k for k in tried if not short or k > short[-1]), 0)
    settings = end.analysis.search.settings
    alone = _chance(moments, ahead, count, settings.set_distance)
    now, then = (2.0 * moments[0][0] * k for k in (n, n + count))
    text = f"{MORE}: {count} further units: probability {chance:.2f} that the right one fits better; "
    text += f"{needed} units for {CERTAIN}" if needed else f"no number reaches {CERTAIN}"
    return Separation(names, instead, now, then, chance, chance, alone, needed, text)


def _moments(right: Law, wrong: BatchLikelihood) -> tuple[float, float]:
    """Mean and variance of the log likelihood ratio of a unit of the right law to the wrong one."""
    fractions = (np.arange(QUANTILES) + 0.5) / QUANTILES
    x = np.asarray(right.histogram.ppf(fractions), dtype=np.float64)
    ratio = right(x) - wrong.changed(wrong.best(x))(x)
    return float(max(ratio.mean(), 0.0)), float(ratio.var())


def _chance(moments: Sequence[tuple[float, float]], ahead: float, count: int, by: float = 0.0) -> float:
    """The probability that the right one is ahead by more than `by` after `count` units; the prior
    probability of each follows from its fit.
    """
    prior = 1.0 / (1.0 + np.exp(-0.5 * ahead))
    chance = 0.0
    for weight, (mean, variance), start in zip((prior, 1.0 - prior), moments, (ahead, -ahead), strict=True):
        gained = start + 2.0 * count * mean - by
        chance += weight * ndtr(gained / np.sqrt(max(4.0 * count * variance, 1e-12)))
    return float(chance)
