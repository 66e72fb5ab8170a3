"""Processes of a stack that are chosen by sampled scatter: the level that keeps such a choice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...models.capability import Aim, Level, Processes, Ways, calibrated
from ..promise import ASSURED, Promise
from .definition import Part
from .measured import Measured
from .parts_as_made import spread_and_mean

POINTS = 6
"""Tolerances that represent a range in the choices that are tested."""
NEVER = 1.0 - 1e-12
"""Level of the norm where no level is sure: hardly any allocation keeps it."""


def level_of(requirements: Sequence[Measured], promise: Promise, seed: int) -> Level | None:
    """The level of the norm; None where no sampled process is chosen among others, or no assurance
    is asked for. A stated level is taken as it is.
    """
    parts, bounded = requirements[0].parts, [measured for measured in requirements if measured.mechanism.bounded]
    if promise.statement != ASSURED or not bounded or not chosen_by_sample(parts):
        return None
    if promise.level_percent is not None:
        return Level(0.01 * promise.level_percent, float("nan"), float("nan"), sure=True)
    owners: list[tuple[int, str]] = []
    df: list[float] = []
    n: list[float] = []
    for at, part in enumerate(parts):
        for number in range(len(part.processes)):
            if _owner(part, at, number) not in owners:
                known = part.knowledge_of(number)
                owners.append(_owner(part, at, number))
                df.append(np.inf if known is None else known.df)
                n.append(np.inf if known is None else known.n)
    ways = [_ways(part, at, bounded, owners) for at, part in enumerate(parts)]
    level = calibrated(
        ways, Processes(np.array(df), np.array(n)), _aim(bounded, promise), np.random.default_rng([seed, len(parts)])
    )
    return level if level.sure else Level(NEVER, level.kept_fraction, level.without, sure=False)


def chosen_by_sample(parts: Sequence[Part]) -> bool:
    """Whether a part has several processes, one of them known by a sample."""
    return any(part.sampled and len(part.processes) > 1 for part in parts)


def _owner(part: Part, at: int, number: int) -> tuple[int, str]:
    """Part and machine: a machine scatters alike with and without inspection."""
    machine = part.processes[number].machine
    return at, "" if machine is None else machine.name


def _aim(bounded: Sequence[Measured], promise: Promise) -> Aim:
    """The promise of every requirement with limits."""
    ends = np.array([[measured.mechanism.lower, measured.mechanism.upper] for measured in bounded])
    ends -= np.array([[measured.mechanism.centre] for measured in bounded])
    both = np.all(np.isfinite(ends), axis=1)
    quantile = np.array([promise.quantile(two_sided) for two_sided in both.tolist()])
    return Aim(promise.fraction, promise.confidence, ends, quantile)


def _ways(part: Part, at: int, bounded: Sequence[Measured], owners: Sequence[tuple[int, str]]) -> Ways:
    """All processes of a part, at points of their ranges."""
    cost, owner, spread, mean = [], [], [], []
    for number, process in enumerate(part.processes):
        ends = process.low, process.high
        t = np.array([process.low]) if ends[0] == ends[1] else np.geomspace(*ends, POINTS)
        made = spread_and_mean(part, process, t)
        price = np.zeros(len(t)) if process.curve is None else process.curve.cost(t)
        cost.append(part.count * price)
        owner += [owners.index(_owner(part, at, number))] * len(t)
        spread.append(made[0])
        mean.append(made[1])
    spreads, means = np.concatenate(spread), np.concatenate(mean)
    variance = np.array([measured.linear.covariance[at, at] for measured in bounded])
    squares = np.array(
        [np.sum(measured.mechanism.sensitivities[measured.mechanism.owners == at] ** 2) for measured in bounded]
    )
    slope = np.array([measured.linear.slope[at] for measured in bounded])
    moving = np.array([measured.linear.mean[at] for measured in bounded])
    return Ways(
        cost=np.concatenate(cost),
        process=np.array(owner, dtype=np.int64),
        std=np.sqrt(variance)[:, None] * spreads,
        mean=slope[:, None] * means + moving[:, None] * spreads,
        pieces=np.divide(slope**2, squares, out=np.zeros_like(slope), where=squares > 0.0),
    )
