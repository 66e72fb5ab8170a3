"""The uncertainty of the parameters: a block bootstrap of the whole selection."""

from __future__ import annotations

import secrets
import time
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...arrays import Array
from ...errors import RunError
from ..execution import Execution, Lost, executor_of
from .analysis import Analysis
from .fit import Fit, is_term
from .progress import GapProgress, Report, silent
from .replicates import Replicate, Replicates
from .select import Search, select

PHASE = "bootstrap"
CHUNK = 4
"""Largest number of replicates that a process computes together."""


@dataclass(frozen=True)
class Spread:
    """The effects that the replicates of a bootstrap identified, with their parameters."""

    replicates: tuple[Replicate, ...]
    level: float

    def frequency(self, name: str) -> float:
        """Fraction of the replicates that identify an effect."""
        return float(np.mean([name in replicate for replicate in self.replicates]))

    def interval(self, owner: str, name: str, linear: tuple[float, float]) -> tuple[float, float]:
        """Percentiles of a parameter over the replicates with it; `linear` for fewer than 20."""
        values = [replicate[owner][name] for replicate in self.replicates if owner in replicate]
        if len(values) < 20 or not np.all(np.isfinite(linear)):
            return linear
        tail = 0.5 * (1.0 - self.level)
        low, high = np.quantile(values, [tail, 1.0 - tail])
        return float(low), float(high)


@dataclass(frozen=True)
class Chunk:
    """The numbers of replicates that are computed together, for the analysis called `name`."""

    numbers: tuple[int, ...]
    name: str

    @property
    def key(self) -> str:
        """A unique name, wherever it runs."""
        return f"{self.name}-{self.numbers[0]}-{self.numbers[-1]}"

    @property
    def called(self) -> str:
        """The chunk in words."""
        return f"replicates {self.numbers[0]} to {self.numbers[-1]}"


def bootstrap(
    analysis: Analysis, fit: Fit, replicates: Replicates, workers: Execution | int = 1, report: Report = silent
) -> Spread:
    """The selection repeated on records with the residuals of `fit`, drawn in blocks.

    Replicates that have ended are not repeated. Raises RunError where processes are lost.
    """
    plan = analysis.setup.plan
    count = plan.settings.bootstrap
    missing = replicates.missing(count)
    task = partial(_replicates, analysis.search, fit, plan.seed)
    begin, ended_before = time.monotonic(), len(replicates.ended)
    report(GapProgress(PHASE, count - len(missing), count))
    with executor_of(workers) as executor:
        size = max(1, min(CHUNK, len(missing) // (4 * max(1, executor.workers))))
        name = secrets.token_hex(8)
        chunks = iter([Chunk(tuple(missing[at : at + size]), name) for at in range(0, len(missing), size)])
        for chunk, outcome in executor.completed(task, lambda: next(chunks, None)):
            if isinstance(outcome, Lost):
                raise RunError(
                    f"{chunk.called}: {outcome.reason}; finished replicates are kept in "
                    f"{replicates.path}, continue with --resume"
                )
            replicates.add(outcome)
            done, remaining = len(replicates.ended) - ended_before, len(replicates.missing(count))
            report(GapProgress(PHASE, count - remaining, count, (time.monotonic() - begin) * remaining / done))
    return Spread(tuple(replicates.ended[number] for number in range(count)), plan.settings.interval)


def _replicates(search: Search, fit: Fit, seed: int, chunk: Chunk) -> dict[int, Replicate]:
    return {number: _replicate(search, fit, seed, number) for number in chunk.numbers}


def _replicate(search: Search, fit: Fit, seed: int, number: int) -> Replicate:
    rng = np.random.default_rng([seed, 4, number])
    again = replace(search, fitter=search.fitter.of_record(_drawn(search, fit, rng)))
    selected = select(again, quick=True).fit
    # the generic terms are in every replicate, as in the answer
    if fit.terms:
        selected = again.fitter.refined([*selected.members, *fit.terms])
    return {
        member.name: member.candidate.values(member.shape, coefficients)
        for member, coefficients in zip(selected.members, selected.coefficients, strict=True)
        if not is_term(member)
    }


def _drawn(search: Search, fit: Fit, rng: np.random.Generator) -> Array:
    """A whitened record: the prediction of the fit, and its residuals redrawn in stretches."""
    space, y = search.fitter.space, search.fitter.y
    n = space.rows_per_output
    length = max(1, round(n ** (1.0 / 3.0)))
    starts = rng.integers(0, n, int(np.ceil(n / length)))
    rows = ((starts[:, None] + np.arange(length)).ravel() % n)[:n]
    parts = [fit.residual[k * n : (k + 1) * n] for k in range(len(space.noises))]
    inflated = np.sqrt(n / max(n - len(fit.free) - sum(map(len, fit.coefficients)), 1))
    noise = np.concatenate([(part - part.mean())[rows] * inflated for part in parts])
    return np.asarray(y - fit.residual + np.pad(noise, (0, space.prior)))
