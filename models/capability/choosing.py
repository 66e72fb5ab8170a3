"""Processes chosen by sampled scatter: the level at which such a choice conforms as promised.

An optimiser prefers processes whose scatter the samples underestimate, the more so the more
alternatives there are: a confidence that holds for a fixed allocation fails for the chosen
allocation. Self-calibration repeats the procedure with processes drawn from their posteriors: they
are sampled, a choice is made, and the choice is tested by the processes drawn. The least level of
the norm whose choices conform to their limits as often as promised is used.

Reference: Loh (1987), Calibrating confidence coefficients, J. American Statistical Association
82(397), 155-162; Beran (1987), Prepivoting to reduce level error of confidence sets, Biometrika
74(3), 457-468.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ...arrays import Array
from .norm import factor_of

RISKS = (0.4, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01)
"""Levels of the norm that are tried, as fractions of the allowed risk: 0.98 first for 0.95.

A sample that makes a choice look safe makes its repeats look safe as well. With all levels down to
the confidence itself, 93 and 89 % of the choices among 9 x 3 machines with 10 and 20 parts of each
conformed (200 repeats): self-calibration may raise the level of two fifths, and not lower it.
"""
REPEATS = 200
"""Repeats of sampling, choosing and testing: the standard error of a fraction is 1.5 %."""
STATES = 65_536
"""Allocations that are compared; of more, only the best at `PRICES` of their variance."""
PRICES = np.geomspace(1e-3, 1e3, 25)
AT_ONCE = 1024
"""Allocations that are tested together, the cheapest first."""
RARE = 0.05
"""Fraction of samples with an assured choice below which a level counts as without choice."""


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """The alternatives (w,) for making a part: `cost` (w,) and `process` (w,), the index in
    `Processes`.

    `std` and `mean` (r, w) are the estimated contributions to each of r requirements; `pieces` (r,)
    is the square of an error of the mean over that of a single piece.
    """

    cost: Array
    process: NDArray[np.int64]
    std: Array
    mean: Array
    pieces: Array


@dataclass(frozen=True, slots=True, eq=False)
class Processes:
    """Samples of processes: degrees of freedom and number of parts (q,), inf if known."""

    df: Array
    n: Array


@dataclass(frozen=True, slots=True)
class Aim:
    """The promise: with a `confidence`, the deviations of a fraction `share` of the units lie
    between the `ends` (r, 2) of each requirement; `quantile` standard deviations (r,) must fit to
    each end.
    """

    share: float
    confidence: float
    ends: Array
    quantile: Array


@dataclass(frozen=True, slots=True)
class Level:
    """A level of the norm, the fraction of choices that conform, and of samples without a choice.

    `confidence` is that of the highest level tried where none is sufficient (`sure` is False).
    """

    confidence: float
    kept_fraction: float
    without: float
    sure: bool


def calibrated(
    parts: Sequence[Ways], processes: Processes, aim: Aim, rng: np.random.Generator, repeats: int = REPEATS
) -> Level:
    """The least level from which on choices conform with the confidence of the aim.

    Where no level with a choice reaches it, the last level is returned and is not `sure`.
    """
    levels = tuple(1.0 - risk * (1.0 - aim.confidence) for risk in RISKS)
    choices, conforming_choices = np.zeros((2, len(levels)))
    table = _Table.of(parts, processes)
    factors = [factor_of(table.kinds, level) for level in levels]
    for _ in range(repeats):
        truth = _variance_ratios(processes.df, rng)
        error = _mean_errors(processes, truth, rng)
        sample = _Sampled(table, truth / _variance_ratios(processes.df, rng), aim)
        previous, conforming = -1, False
        for at, factor in enumerate(factors):
            chosen = sample.cheapest(factor, max(previous, 0))
            if chosen is None:
                break
            if chosen != previous:
                previous, conforming = chosen, table.conforms(chosen, truth, error, aim)
            choices[at] += 1.0
            conforming_choices[at] += conforming
    kept_fraction = conforming_choices / np.maximum(choices, 1.0)
    enough = choices >= RARE * repeats
    missed = np.flatnonzero(enough & (kept_fraction < aim.confidence))
    at = min(int(missed[-1]) + 1 if len(missed) else 0, len(levels) - 1)
    sure = bool(enough[at] and kept_fraction[at] >= aim.confidence)
    return Level(levels[at], float(kept_fraction[at]), float(1.0 - choices[at] / repeats), sure)


def _mean_errors(processes: Processes, truth: Array, rng: np.random.Generator) -> Array:
    """Errors of means (q,) over estimated standard deviations, given the drawn variances."""
    scale = np.where(np.isfinite(processes.n), np.sqrt(truth / processes.n), 0.0)
    return np.asarray(scale * rng.standard_normal(len(truth)))


def _variance_ratios(df: Array, rng: np.random.Generator) -> Array:
    """Variances over their estimates (q,), drawn from the posterior; 1 where they are known."""
    finite = np.isfinite(df)
    chi_square = rng.chisquare(np.where(finite, df, 1.0))
    return np.asarray(np.where(finite, df / chi_square, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Allocations in the order of their cost: `choices` (m, parts) as places among the alternatives
    (w,) of all parts, `uses` (m, w) the same as ones and zeros, and the mean (r, m) of each.

    `process` (w,), `std` and `pieces` (w, r) are of all alternatives; `kinds` (u,) are the
    different degrees of freedom, `kind` (q,) is the index of a process among them.
    """

    choices: NDArray[np.int64]
    uses: Array
    mean: Array
    process: NDArray[np.int64]
    std: Array
    means: Array
    pieces: Array
    n: Array
    kinds: Array
    kind: NDArray[np.int64]

    @classmethod
    def of(cls, parts: Sequence[Ways], processes: Processes) -> _Table:
        """All allocations; where there are too many, the best by the estimates."""
        kinds, kind = np.unique(processes.df, return_inverse=True)
        rows, place = len(parts[0].std), 0
        cost, choices = np.zeros(1), np.zeros((1, 0), dtype=np.int64)
        square, mean = np.zeros((2, rows, 1))
        for part in parts:
            count, before = len(part.cost), len(choices)
            cost = np.add.outer(cost, part.cost).ravel()
            square = (square[:, :, None] + part.std[:, None, :] ** 2).reshape(rows, -1)
            mean = (mean[:, :, None] + part.mean[:, None, :]).reshape(rows, -1)
            choices = np.column_stack([np.repeat(choices, count, axis=0), np.tile(place + np.arange(count), before)])
            place += count
            if len(cost) > STATES:
                best = _best(cost, square)
                cost, choices = cost[best], choices[best]
                square, mean = square[:, best], mean[:, best]
        order = np.argsort(cost, kind="stable")
        choices, uses = choices[order], np.zeros((len(order), place))
        uses[np.arange(len(choices))[:, None], choices] = 1.0
        return cls(
            choices,
            uses,
            mean[:, order],
            process=np.concatenate([part.process for part in parts]),
            std=np.concatenate([part.std.T for part in parts]),
            means=np.concatenate([part.mean.T for part in parts]),
            pieces=np.concatenate([np.tile(part.pieces, (len(part.cost), 1)) for part in parts]),
            n=processes.n,
            kinds=kinds,
            kind=kind.ravel(),
        )

    def conforms(self, chosen: int, truth: Array, error: Array, aim: Aim) -> bool:
        """Whether the units of an allocation conform, by true variances and mean errors (q,)."""
        choices = self.choices[chosen]
        process, std = self.process[choices], self.std[choices]
        spread = np.sqrt(np.maximum(np.sum(std**2 * truth[process][:, None], axis=0), 1e-300))
        off = self.means[choices] + np.sqrt(self.pieces[choices]) * std * error[process][:, None]
        ends = (aim.ends - off.sum(axis=0)[:, None]) / spread[:, None]
        return bool(np.all(ndtr(ends[:, 1]) - ndtr(ends[:, 0]) >= aim.share))


class _Sampled:
    """Allocations by a sample of the processes: sampled variances (q,) over the estimates."""

    def __init__(self, table: _Table, variance_ratio: Array, aim: Aim) -> None:
        self.table, self.aim, process = table, aim, table.process
        square = table.std**2 * variance_ratio[process][:, None] * (1.0 + table.pieces / table.n[process][:, None])
        doubt = np.zeros((len(square), len(table.kinds), square.shape[1]))
        doubt[np.arange(len(square)), table.kind[process]] = square**2
        self.terms = np.hstack([square, doubt.reshape(len(square), -1)])
        self.cached: dict[int, Array] = {}

    def cheapest(self, factor: Array, first: int) -> int | None:
        """The first allocation from a place on that conforms by the norm of factors (u,)."""
        rows, (low, high) = len(self.aim.ends), self.aim.ends.T
        for start in range(first - first % AT_ONCE, len(self.table.choices), AT_ONCE):
            sums, mean = self._sums(start), self.table.mean[:, start : start + AT_ONCE].T
            doubt = sums[:, rows:].reshape(len(sums), len(factor), rows)
            surplus = np.sqrt(np.sum(factor[:, None] ** 2 * doubt, axis=1))
            reach = self.aim.quantile * np.sqrt(sums[:, :rows] + surplus)
            fits = np.all((mean + reach <= high) & (mean - reach >= low), axis=1)
            if (at := int(np.argmax(fits))) or fits[0]:
                return start + at
        return None

    def _sums(self, start: int) -> Array:
        """Sums of variances and, by degrees of freedom, of their squares (k, r + u r)."""
        if start not in self.cached:
            self.cached[start] = self.table.uses[start : start + AT_ONCE] @ self.terms
        return self.cached[start]


def _best(cost: Array, square: Array) -> NDArray[np.int64]:
    """Indices of allocations that are best at some price of their variances (r, m)."""
    size = (square / np.maximum(square.max(axis=1, keepdims=True), 1e-300)).sum(axis=0)
    span = max(float(np.ptp(cost)), 1e-300)
    per_price = max(1, STATES // (16 * len(PRICES)))
    cheapest = [np.argpartition(cost / span + price * size, per_price)[:per_price] for price in PRICES]
    return np.unique(np.concatenate(cheapest))
