"""The play operator along a path, without a loop over its points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..inputs.distribution import Array
from ..measurable import Role
from .effect import Readings


def play(x: Array, width: float, starts: NDArray[np.bool_] | None = None) -> Array:
    """Output (n,) of a play of half-width `width` [unit of x], driven along the path x (n,).

    p_i = max(x_i - w, min(x_i + w, p_(i-1))): the output stands until the input has crossed the
    play. A path begins where `starts` (n,) is true, at rest and never loaded before (p = 0 within
    the play). The steps are clips; clips compose to clips, so their running composition takes
    log2(n) passes over the whole path. Reference: Visintin, Differential Models of Hysteresis.
    """
    low, high = x - width, x + width
    begins = np.zeros(len(x), dtype=bool) if starts is None else starts.copy()
    begins[:1] = True
    fresh = np.clip(0.0, low[begins], high[begins])
    low[begins] = high[begins] = fresh  # nothing before a beginning is remembered
    step = 1
    while step < len(x):
        # the clip of rows i-step+1..i after that of the rows before it
        before_low, before_high = low[:-step], high[:-step]
        new_low = np.clip(before_low, low[step:], high[step:])
        new_high = np.clip(before_high, low[step:], high[step:])
        low[step:], high[step:] = new_low, new_high
        step *= 2
    return low


def along_path(readings: Readings, x: Array, width: float) -> Array:
    """`play` over rows in the order of measuring; each unit and repeat is a path of its own."""
    order = np.arange(len(x)) if readings.order is None else readings.order
    marks = [readings[role][order] for role in (Role.UNIT, Role.REPEAT) if role in readings]
    starts = np.zeros(len(x), dtype=bool)
    for mark in marks:
        starts[1:] |= _differs(mark)
    found = np.empty(len(x))
    found[order] = play(x[order], width, starts)
    return found


def _differs(labels: NDArray[Any]) -> NDArray[np.bool_]:
    return np.asarray(labels[1:] != labels[:-1], dtype=bool)
