"""Processes chosen by sampled scatter: the level at which such a choice keeps an assured promise.

An optimiser picks what the samples underestimate, the more so among alternatives: a confidence that
holds for one allocation fails for the one chosen. Self-calibration repeats what is done, with
processes drawn from their posteriors: sample them, choose, and judge the choice by the processes
drawn. The least level of the norm whose choices are kept as often as promised is used.

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

from .norm import factor_of

Array = NDArray[np.float64]
LEVELS = (0.8, 0.85, 0.9, 0.93, 0.95, 0.96, 0.97, 0.98, 0.985, 0.99, 0.995, 0.998)
"""Confidences of the norm that are tried, the least first."""
REPEATS = 200
"""Times that processes are sampled, chosen and judged: 1.5 % is one standard error of a share."""
STATES = 65_536
"""Allocations that are compared; of more the best ones at `PRICES` of their variance are kept."""
PRICES = np.geomspace(1e-3, 1e3, 25)
AT_ONCE = 1024
"""Allocations that are looked at together, the cheapest first."""
RARE = 0.05
"""Share of samples with an assured choice below which there is none to speak of."""


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """The ways (w,) of making one part: `cost`, `process` (w,) that scatters so (its place among
    all `Processes`), and what it adds to each of r requirements: standard deviation and mean (r, w)
    by the estimates, with `pieces` (r,) the square of an error of the mean over that of one piece.
    """

    cost: Array
    process: NDArray[np.int64]
    std: Array
    mean: Array
    pieces: Array


@dataclass(frozen=True, slots=True, eq=False)
class Processes:
    """What samples tell of processes: degrees of freedom and number of parts (q,), inf if known."""

    df: Array
    n: Array


@dataclass(frozen=True, slots=True)
class Aim:
    """What is promised: a `share` of units between the ends (r, 2) of each requirement's deviation,
    with a `confidence`; `quantile` standard deviations (r,) are to fit to each end.
    """

    share: float
    confidence: float
    ends: Array
    quantile: Array


@dataclass(frozen=True, slots=True)
class Level:
    """A level of the norm, the share of choices at it that are kept, and of samples without any.

    `confidence` is that of the highest level tried where none is sure enough (`sure` is False).
    """

    confidence: float
    kept: float
    without: float
    sure: bool


def calibrated(
    parts: Sequence[Ways], processes: Processes, aim: Aim, rng: np.random.Generator,
    repeats: int = REPEATS,
) -> Level:  # fmt: skip
    """The least level from which on choices are kept with the confidence that is aimed at."""
    made, kept = np.zeros((2, len(LEVELS)))
    table = _Table.of(parts, processes)
    factors = [factor_of(table.kinds, level) for level in LEVELS]
    for _ in range(repeats):
        truth = _drawn(processes.df, rng)
        error = _drawn_errors(processes, truth, rng)
        seen = _Seen(table, truth / _drawn(processes.df, rng), aim)
        before, good = -1, False
        for at, factor in enumerate(factors):
            chosen = seen.cheapest(factor, max(before, 0))
            if chosen is None:
                break
            if chosen != before:
                before, good = chosen, _keeps(parts, table.ways[chosen], truth, error, aim)
            made[at] += 1.0
            kept[at] += good
    share = kept / np.maximum(made, 1.0)
    enough = made >= RARE * repeats
    missed = np.flatnonzero(enough & (share < aim.confidence))
    at = min(int(missed[-1]) + 1 if len(missed) else 0, len(LEVELS) - 1)
    sure = bool(enough[at] and share[at] >= aim.confidence)
    return Level(LEVELS[at], float(share[at]), float(1.0 - made[at] / repeats), sure)


def _drawn_errors(processes: Processes, truth: Array, rng: np.random.Generator) -> Array:
    """Errors of means (q,) over estimated standard deviations, by the variances drawn."""
    scale = np.where(np.isfinite(processes.n), np.sqrt(truth / processes.n), 0.0)
    return np.asarray(scale * rng.standard_normal(len(truth)))


def _drawn(df: Array, rng: np.random.Generator) -> Array:
    """Variances over their estimates (q,) by the posterior, 1 where they are known."""
    finite = np.isfinite(df)
    drawn = rng.chisquare(np.where(finite, df, 1.0))
    return np.asarray(np.where(finite, df / drawn, 1.0))


def _keeps(
    parts: Sequence[Ways], ways: NDArray[np.int64], truth: Array, error: Array, aim: Aim
) -> bool:
    """Whether the units of a choice conform, by the processes as they are (q,)."""
    variance, mean = np.zeros((2, len(aim.ends)))
    for part, way in zip(parts, ways.tolist(), strict=True):
        process = part.process[way]
        variance += part.std[:, way] ** 2 * truth[process]
        mean += part.mean[:, way]
        mean += np.sqrt(part.pieces) * part.std[:, way] * error[process]
    std = np.sqrt(np.maximum(variance, 1e-300))
    yields = ndtr((aim.ends[:, 1] - mean) / std) - ndtr((aim.ends[:, 0] - mean) / std)
    return bool(np.all(yields >= aim.share))


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Allocations in the order of their cost: `ways` (m, parts), and the mean (r, m) of each.

    `kinds` (u,) are the different degrees of freedom, `kind` (q,) names that of a process.
    """

    parts: Sequence[Ways]
    processes: Processes
    ways: NDArray[np.int64]
    mean: Array
    kinds: Array
    kind: NDArray[np.int64]

    @classmethod
    def of(cls, parts: Sequence[Ways], processes: Processes) -> _Table:
        """All allocations; where there are too many, the best by the estimates."""
        kinds, kind = np.unique(processes.df, return_inverse=True)
        rows = len(parts[0].std)
        cost, ways = np.zeros(1), np.zeros((1, 0), dtype=np.int64)
        square, mean = np.zeros((2, rows, 1))
        for part in parts:
            count, before = len(part.cost), len(ways)
            cost = np.add.outer(cost, part.cost).ravel()
            square = (square[:, :, None] + part.std[:, None, :] ** 2).reshape(rows, -1)
            mean = (mean[:, :, None] + part.mean[:, None, :]).reshape(rows, -1)
            ways = np.column_stack([np.repeat(ways, count, axis=0),
                                    np.tile(np.arange(count), before)])  # fmt: skip
            if len(cost) > STATES:
                left = _best(cost, square)
                cost, ways = cost[left], ways[left]
                square, mean = square[:, left], mean[:, left]
        order = np.argsort(cost, kind="stable")
        return cls(parts, processes, ways[order], mean[:, order], kinds, kind.ravel())


class _Seen:
    """Allocations by one sample of the processes: variances `seen` (q,) over the estimates."""

    def __init__(self, table: _Table, seen: Array, aim: Aim) -> None:
        self.table, self.aim = table, aim
        self.square, self.doubt = [], []
        for part in table.parts:
            error = part.pieces[:, None] / table.processes.n[part.process]
            one = part.std**2 * seen[part.process] * (1.0 + error)
            own = np.zeros((len(table.kinds), *one.shape))
            own[table.kind[part.process], :, np.arange(len(part.cost))] = one.T**2
            self.square.append(one)
            self.doubt.append(own)
        self.known: dict[int, tuple[Array, Array]] = {}

    def cheapest(self, factor: Array, first: int) -> int | None:
        """The first allocation from a place on that keeps the ends by the norm of factors (u,)."""
        for start in range(first - first % AT_ONCE, len(self.table.ways), AT_ONCE):
            rows = slice(start, start + AT_ONCE)
            square, doubt = self._sums(rows)
            surplus = np.sqrt(np.tensordot(factor**2, doubt, axes=1))
            reach = self.aim.quantile[:, None] * np.sqrt(square + surplus)
            mean, ends = self.table.mean[:, rows], self.aim.ends
            fits = np.all((mean + reach <= ends[:, 1:]) & (mean - reach >= ends[:, :1]), axis=0)
            if np.any(fits):
                return start + int(np.argmax(fits))
        return None

    def _sums(self, rows: slice) -> tuple[Array, Array]:
        """Sums of variances (r, k) and, by degrees of freedom, of their squares (u, r, k)."""
        if rows.start not in self.known:
            ways = self.table.ways[rows].T
            self.known[rows.start] = (
                sum(one[:, way] for one, way in zip(self.square, ways, strict=True)),
                sum(own[:, :, way] for own, way in zip(self.doubt, ways, strict=True)),
            )
        return self.known[rows.start]


def _best(cost: Array, square: Array) -> NDArray[np.int64]:
    """Those of allocations that are among the best at some price of their variances (r, m)."""
    size = (square / np.maximum(square.max(axis=1, keepdims=True), 1e-300)).sum(axis=0)
    span = max(float(np.ptp(cost)), 1e-300)
    each = max(1, STATES // (16 * len(PRICES)))
    found = [np.argpartition(cost / span + price * size, each)[:each] for price in PRICES]
    return np.unique(np.concatenate(found))
