"""Stage 8: block bootstrap over the whole selection."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...models.inputs.distribution import Array
from .analysis import Analysis
from .fit import Fit
from .select import Search, select

Replicate = Mapping[str, Mapping[str, float]]
"""Effects that a replicate names, with their parameters."""


@dataclass(frozen=True)
class Spread:
    """What the replicates of a bootstrap named, and their numbers."""

    replicates: tuple[Replicate, ...]
    level: float

    def frequency(self, name: str) -> float:
        """Share of the replicates that name an effect."""
        return float(np.mean([name in one for one in self.replicates]))

    def interval(self, owner: str, name: str, linear: tuple[float, float]) -> tuple[float, float]:
        """Percentiles of a number over the replicates that have it; of fewer than 20, `linear`."""
        values = [one[owner][name] for one in self.replicates if owner in one]
        if len(values) < 20 or not np.all(np.isfinite(linear)):
            return linear
        tail = 0.5 * (1.0 - self.level)
        low, high = np.quantile(values, [tail, 1.0 - tail])
        return float(low), float(high)


def bootstrap(analysis: Analysis, fit: Fit, workers: int = 1) -> Spread:
    """The selection again on records with the residuals of `fit`, drawn in blocks."""
    count, settings = analysis.setup.plan.settings.bootstrap, analysis.setup.plan.settings
    seeds = range(count)
    task = partial(_replicate, analysis.search, fit, analysis.setup.plan.seed)
    if workers > 1:
        with ProcessPoolExecutor(workers) as pool:
            found = list(pool.map(task, seeds, chunksize=max(1, count // (4 * workers))))
    else:
        found = [task(seed) for seed in seeds]
    return Spread(tuple(found), settings.interval)


def _replicate(search: Search, fit: Fit, seed: int, number: int) -> Replicate:
    rng = np.random.default_rng([seed, 4, number])
    again = replace(search, fitter=search.fitter.of_record(_drawn(search, fit, rng)))
    found = select(again, quick=True).fit
    return {
        member.name: member.candidate.values(member.shape, coefficients)
        for member, coefficients in zip(found.members, found.coefficients, strict=True)
    }


def _drawn(search: Search, fit: Fit, rng: np.random.Generator) -> Array:
    """A whitened record: what the fit says, and its residuals in stretches drawn anew."""
    y = search.fitter.y
    fitted = y - fit.residual
    outputs = len(search.fitter.space.noises)
    n = search.fitter.space.readings
    length = max(1, round(n ** (1.0 / 3.0)))
    stretches = int(np.ceil(n / length))
    starts = rng.integers(0, n, stretches)
    rows = ((starts[:, None] + np.arange(length)).ravel() % n)[:n]
    parts = [fit.residual[k * n : (k + 1) * n] for k in range(outputs)]
    inflated = np.sqrt(n / max(n - len(fit.free) - sum(map(len, fit.coefficients)), 1))
    noise = np.concatenate([(part - part.mean())[rows] * inflated for part in parts])
    tail = np.zeros(len(y) - len(noise))
    return np.asarray(fitted + np.concatenate([noise, tail]))
