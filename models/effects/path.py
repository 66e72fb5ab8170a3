"""The play operator along a path, without a loop over its points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ..measurable import Role
from .effect import Measurements

FEW = 0.1
"""Reversals per row above which rows are not a path."""
MOSTLY = 0.9
"""Fraction of the load's path that must go in the stated direction."""
TWIST = 0.1
"""[rad] Largest twist of a locked unit."""


def play(x: Array, width: float, starts: NDArray[np.bool_] | None = None) -> Array:
    """Output (n,) of a play of half-width `width` [unit of x], driven along the path x (n,).

    p_i = max(x_i - w, min(x_i + w, p_(i-1))): the output rests until the input has crossed the
    play. A path begins where `starts` (n,) is true, at rest and never loaded before (p = 0 within
    the play). The steps are clips; clips compose to clips, so their running composition takes
    log2(n) passes over the whole path. Reference: Visintin, Differential Models of Hysteresis.
    """
    low, high = x - width, x + width
    begins = np.zeros(len(x), dtype=bool) if starts is None else starts.copy()
    begins[:1] = True
    fresh = np.clip(0.0, low[begins], high[begins])
    low[begins] = high[begins] = fresh  # a path does not depend on the path before it
    step = 1
    while step < len(x):
        # the clip of rows i-step+1..i after that of the rows before it
        before_low, before_high = low[:-step], high[:-step]
        new_low = np.clip(before_low, low[step:], high[step:])
        new_high = np.clip(before_high, low[step:], high[step:])
        low[step:], high[step:] = new_low, new_high
        step *= 2
    return low


def along_path(measurements: Measurements, x: Array, width: float) -> Array:
    """`play` over rows in the order of measurement; each unit and repeat has a separate path."""
    order, starts = measurements.in_order, _starts(measurements)
    values = np.empty(len(x))
    values[order] = play(x[order], width, starts)
    return values


def follows_load(measurements: Measurements) -> bool:
    """Whether the rows are a load path on a unit at rest: the direction is that of the load's
    steps, it seldom reverses, and nothing moves.
    """
    load = next((role for role in (Role.TORQUE, Role.FORCE) if role in measurements), None)
    if load is None or Role.DIRECTION not in measurements or _moves(measurements):
        return False
    order, within = measurements.in_order, ~_starts(measurements)[1:]
    steps = np.diff(np.asarray(measurements[load], dtype=float)[order])[within]
    sign = np.asarray(measurements[Role.DIRECTION], dtype=float)[order]
    reversals = int(np.count_nonzero(np.diff(sign)))
    along = float(0.5 * (sign[1:] + sign[:-1])[within] @ steps)
    return 0 < reversals <= FEW * len(sign) and along > MOSTLY * float(np.abs(steps).sum())


def _moves(measurements: Measurements) -> bool:
    """Whether a speed is not 0, or the angle changes from row to row by more than a twist."""
    if Role.SPEED in measurements and np.any(measurements[Role.SPEED]):
        return True
    angle = measurements[Role.ANGLE] if Role.ANGLE in measurements else np.zeros(len(measurements))
    steps = np.abs(np.diff(np.asarray(angle, dtype=float)[measurements.in_order]))
    return bool(np.ptp(angle) > TWIST and np.median(steps) > 0.0)


def _starts(measurements: Measurements) -> NDArray[np.bool_]:
    """Where (n,) a path begins, in the order of measurement."""
    order, starts = measurements.in_order, np.zeros(len(measurements), dtype=bool)
    starts[:1] = True
    for role in (Role.UNIT, Role.REPEAT):
        if role in measurements:
            labels = measurements[role][order]
            starts[1:] |= np.asarray(labels[1:] != labels[:-1], dtype=bool)
    return starts
