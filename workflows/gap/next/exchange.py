"""Exact designs by exchange: the points that tell the worst pair apart best.

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
"""Weight of the mean over the pairs beside that of the worst."""


def exchanged(contests: Sequence[Contest], count: int, passes: int = PASSES) -> Chosen:
    """Numbers (count,) of the candidates whose least discrimination over the contests is largest;
    a candidate may be chosen more than once. Without `passes` they are added one by one only.
    """
    chosen = np.zeros(0, dtype=np.int64)
    for _ in range(count):
        chosen = np.append(chosen, _best(contests, chosen)[0])
    for _ in range(passes):
        before = _worst([one.level(chosen)[0] for one in contests])
        for at in range(count):
            chosen = _improved(contests, chosen, at)
        if _worst([one.level(chosen)[0] for one in contests]) < (1.0 + BETTER) * before:
            break
    return chosen


def _improved(contests: Sequence[Contest], chosen: Chosen, at: int) -> Chosen:
    """The design with one of its points exchanged, where that is better."""
    rest = np.delete(chosen, at)
    point, level = _best(contests, rest)
    now = _worst([one.level(chosen)[0] for one in contests])
    if level <= (1.0 + BETTER) * now:
        return chosen
    return np.insert(rest, at, point)


def _best(contests: Sequence[Contest], chosen: Chosen) -> tuple[int, float]:
    """The candidate that is best beside these, and what both come to."""
    levels = np.array([one.with_each(chosen) for one in contests])
    merit = (1.0 - MEAN) * levels.min(axis=0) + MEAN * levels.mean(axis=0)
    best = int(np.argmax(merit))
    return best, float(merit[best])


def _worst(levels: Sequence[float]) -> float:
    """The least of the levels, and a little of their mean."""
    return (1.0 - MEAN) * min(levels) + MEAN * float(np.mean(levels))
