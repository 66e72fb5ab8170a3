"""Parts as their machines make them: what their tolerances and choices of process come to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...arrays import Array, Integers
from ...models.inputs import Normal
from ...models.machines import GoodPartsBySpread
from ...models.machines.offers import Offer
from ...models.stack import AsMade, Tolerances
from .definition import Part, Process


def processes_of(offers: Sequence[Offer]) -> tuple[Process, ...]:
    """Each machine, with and without inspection, as a process."""
    return tuple(
        Process(way.low, way.high, way.curve, way.label, way.machine) for offer in offers for way in offer.ways()
    )


def scale_of(part: Part) -> float:
    """Half-width t of the part per standard deviation, by its own (normal) distribution."""
    assert isinstance(part.distribution, Normal)
    return 1.0 / part.distribution.sigma


def by_spread(part: Part, process: Process) -> GoodPartsBySpread:
    """An inspected process by the spread of its good parts, in units of half-widths t."""
    assert process.machine is not None
    return GoodPartsBySpread(process.machine, process.low, process.high, scale_of(part))


def spread_and_mean(part: Part, process: Process, t: Array) -> tuple[Array, Array]:
    """Spread, as a half-width of the part's distribution, and mean of good parts (n,)."""
    if process.machine is None:
        return t, np.zeros_like(t)
    good_parts = process.machine.good_parts(t)
    return scale_of(part) * good_parts.std, good_parts.mean


def as_made(parts: Sequence[Part], t: Array, chosen: Integers) -> Tolerances:
    """Parts of n designs of half-widths t (n, p) by the processes chosen (n, p)."""
    if not any(part.by_machine for part in parts):
        return t
    spread, mean = t.copy(), np.zeros_like(t)
    for at, part in enumerate(parts):
        for number, process in enumerate(part.processes):
            rows = chosen[:, at] == number
            if process.machine is not None and np.any(rows):
                spread[rows, at], mean[rows, at] = spread_and_mean(part, process, t[rows, at])
    return AsMade(t, spread, mean, chosen)


def ends_as_made(parts: Sequence[Part]) -> tuple[Tolerances, Tolerances]:
    """Least and largest limit, spread and size of the mean of each part, (1, p) each."""
    ends = [_ends(part) for part in parts]
    low, high = (np.array([[pair[side] for pair in part_ends] for part_ends in ends]) for side in (0, 1))
    if not any(part.by_machine for part in parts):
        return low[:, 0].reshape(1, -1), high[:, 0].reshape(1, -1)
    return (
        AsMade(*(low[:, at].reshape(1, -1) for at in range(3))),
        AsMade(*(high[:, at].reshape(1, -1) for at in range(3))),
    )


def _ends(part: Part) -> list[tuple[float, float]]:
    """Least and largest limit, spread, and size of the mean of a part.

    The spread of good parts rises with the limit; their mean is nearest to 0 at the tightest.
    """
    limits, spreads, means = [], [], []
    for process in part.processes:
        t = np.array([process.low, process.high])
        spread, mean = spread_and_mean(part, process, t)
        limits += t.tolist()
        spreads += spread.tolist()
        means += np.abs(mean).tolist()
    return [(min(values), max(values)) for values in (limits, spreads, means)]


def limits_of(part: Part, spread: Array, chosen: Integers) -> Array:
    """Half-widths t (n,) of a part at spreads (n,) of its good parts, by the process chosen."""
    t = spread.copy()
    for number, process in enumerate(part.processes):
        rows = chosen == number
        if process.machine is None or not np.any(rows):
            continue
        if process.low == process.high:
            t[rows] = process.low
        else:
            t[rows] = by_spread(part, process).limit(spread[rows])
    return t
