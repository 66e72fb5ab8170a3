"""The step of measurements that are whole multiples of it."""

from __future__ import annotations

import numpy as np

from ....arrays import Array

FINEST = 1e-6
"""Least step, as a fraction of the range of the measurements, that is searched for."""
OFF = 0.06
"""Rms deviation from the multiples, in steps, that is allowed: for random values it is 0.29."""
LEAST = 5
"""Distinct values below which any numbers may be multiples of a step, unless they recur."""


def step_of(values: Array) -> float | None:
    """The step q of measurements (n,) that are all whole multiples of q, None where they are not.

    The smallest difference of two values is about a step; the sum of all the differences, counted
    in steps, gives it exactly.
    """
    levels = np.unique(values)
    if len(levels) < 3 or (len(levels) < LEAST and len(values) < 4 * len(levels)):
        return None
    gaps = np.diff(levels)
    gaps = gaps[gaps > FINEST * np.ptp(levels)]
    counts = np.round(gaps / float(np.min(gaps)))
    step = float(gaps.sum() / counts.sum())
    counts = np.round(levels / step)
    step = float(levels @ counts) / max(float(counts @ counts), 1.0)
    off = levels / step - np.round(levels / step)
    return step if float(np.sqrt(np.mean(off**2))) < OFF else None
