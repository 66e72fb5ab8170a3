"""The step of readings that are whole multiples of one."""

from __future__ import annotations

import numpy as np

from ...inputs.distribution import Array

FINEST = 1e-6
"""Step, as a share of the readings' range, below which none is looked for."""
OFF = 0.06
"""Steps (rms) that readings may be off the multiples: of a random share it is 0.29."""
LEAST = 5
"""Different readings below which any numbers may be multiples of something, unless they recur."""


def step_of(values: Array) -> float | None:
    """The step q of readings (n,) that are all q times a whole number, None where they are not.

    The smallest difference of two readings is about a step; the sum of all the differences, counted
    in steps, says it exactly.
    """
    levels = np.unique(values)
    if len(levels) < 3 or (len(levels) < LEAST and len(values) < 4 * len(levels)):
        return None
    gaps = np.diff(levels)
    gaps = gaps[gaps > FINEST * np.ptp(levels)]
    counts = np.round(gaps / float(np.min(gaps)))
    step = float(gaps.sum() / counts.sum())
    whole = np.round(levels / step)
    step = float(levels @ whole) / max(float(whole @ whole), 1.0)
    off = levels / step - np.round(levels / step)
    return step if float(np.sqrt(np.mean(off**2))) < OFF else None
