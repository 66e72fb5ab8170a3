"""Exact designs by exchange: the points that separate the worst pair best.

Reference: Fedorov, Theory of Optimal Experiments, 1972; Atkinson & Fedorov, Biometrika 62, 1975.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .contest import Chosen, Contest

PASSES = 3
BETTER = 1e-4
"""Relative gain for which a point is exchanged."""
MEAN = 0.02
"""Weight of the mean over the pairs; the worst pair has the rest."""


def exchanged(contests: Sequence[Contest], count: int) -> Chosen:
    """Indices (count,) of the candidates whose least discrimination over the contests is largest; a
    candidate may be chosen more than once.

    Points are exchanged from two starts: the best ones added one by one, and in turn those that are
    best for each contest alone. For a rival that follows any few points, adding a single point
    shows no difference.
    """
    starts = [added(contests, count)]
    if len(contests) > 1:
        alternating = np.concatenate([np.sort(added([contest], count)) for contest in contests])
        starts.append(alternating[:: len(contests)][:count])
    designs = [_settled(contests, start) for start in starts]
    return max(designs, key=lambda design: _level(contests, design))


def added(contests: Sequence[Contest], count: int) -> Chosen:
    """The design without exchange: the best candidate given the chosen ones is added one by one."""
    chosen = np.zeros(0, dtype=np.int64)
    for _ in range(count):
        chosen = np.append(chosen, _best(contests, chosen)[0])
    return chosen


def _settled(contests: Sequence[Contest], chosen: Chosen) -> Chosen:
    """A design whose points are exchanged in turn until that gains nothing."""
    for _ in range(PASSES):
        before = _level(contests, chosen)
        for at in range(len(chosen)):
            chosen = _improved(contests, chosen, at)
        if _level(contests, chosen) < (1.0 + BETTER) * before:
            break
    return chosen


def _improved(contests: Sequence[Contest], chosen: Chosen, at: int) -> Chosen:
    """The design with one of its points exchanged, where that is better."""
    rest = np.delete(chosen, at)
    point, level = _best(contests, rest)
    return np.insert(rest, at, point) if level > (1.0 + BETTER) * _level(contests, chosen) else chosen


def _best(contests: Sequence[Contest], chosen: Chosen) -> tuple[int, float]:
    """The candidate that is best given the chosen ones, and the level of both together."""
    levels = np.array([contest.with_each(chosen) for contest in contests])
    merit = (1.0 - MEAN) * levels.min(axis=0) + MEAN * levels.mean(axis=0)
    best = int(np.argmax(merit))
    return best, float(merit[best])


def _level(contests: Sequence[Contest], chosen: Chosen) -> float:
    """The least of the levels of a design, and a little of their mean."""
    levels = [contest.level(chosen)[0] for contest in contests]
    return (1.0 - MEAN) * min(levels) + MEAN * float(np.mean(levels))
