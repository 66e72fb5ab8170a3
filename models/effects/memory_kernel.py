"""Recursions along a path, compiled by numba: a row depends on all rows before it.

numba is imported with this module alone, where an effect with memory acts.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from ...section import Array

FINE = 0.2
"""Largest step of an integration, as a fraction of the presliding length."""
TINY = float(np.finfo(float).tiny) ** 0.5
SATURATED = 12.0
"""Presliding lengths after which the state is that of steady sliding."""


def _compile(function: Any) -> Any:
    return numba.njit(cache=True, error_model="numpy")(function)


@_compile
def carry(kept: Array, added: Array) -> Array:
    """z_i = kept_i z_(i-1) + added_i (n,); a path begins where nothing is kept."""
    z = np.empty(kept.size)
    before = 0.0
    for i in range(kept.size):
        before = kept[i] * before + added[i]
        z[i] = before
    return z


@_compile
def bouc_wen(steps: Array, length: float, share: float, exponent: float) -> Array:
    """State z (n,) of dz/dx = (1 - (share sgn(dx z) + 1 - share) |z|^exponent)/length along steps (n,) of
    x, by the midpoint rule; a step that is not a number begins a path, with z = 0.
    """
    z = np.empty(steps.size)
    state = 0.0
    for i in range(steps.size):
        move = steps[i] / length
        if np.isnan(move):
            z[i] = state = 0.0
            continue
        move = min(max(move, -SATURATED), SATURATED)
        count = int(np.ceil(abs(move) / FINE))
        part = move / count if count else 0.0
        way = 1.0 if part > 0.0 else -1.0
        for _ in range(count):
            half = state
            for weight in (0.5, 1.0):
                sign = way if half > 0.0 else -way
                half = state + weight * part * (1.0 - (share * sign + 1.0 - share) * abs(half) ** exponent)
            state = min(max(half, -1.0), 1.0)
        z[i] = state
    return z


@_compile
def stick_slip(x: Array, starts: Array, width: float, breakaway: float) -> Array:
    """Deviation y - x (n,) of a table that follows x (n,) by a play of half-width `width`: it sticks until the
    drive has been wound up by `breakaway` beyond the play, and then slips until that is released.
    """
    off = np.empty(x.size)
    y = 0.0
    for i in range(x.size):
        if starts[i]:
            y = x[i]
        if x[i] - y > width + breakaway:
            y = x[i] - width
        elif y - x[i] > width + breakaway:
            y = x[i] + width
        off[i] = y - x[i]
    return off


@_compile
def left_by_stick_slip(x: Array, starts: Array, points: Array, y: Array) -> Array:
    """Fraction (k,) of the squares of y (n,) about its mean that `stick_slip`, in any size and with any offset,
    leaves at each of `points` (k, 2), the width and the breakaway.
    """
    fractions = np.empty(len(points))
    of = y - y.mean()
    squares = max((of * of).sum(), TINY)
    for k in range(len(points)):
        width, breakaway = points[k]
        table = total = square = product = 0.0
        for i in range(x.size):
            if starts[i]:
                table = x[i]
            if x[i] - table > width + breakaway:
                table = x[i] - width
            elif table - x[i] > width + breakaway:
                table = x[i] + width
            off = table - x[i]
            total += off
            square += off * off
            product += off * of[i]
        fractions[k] = 1.0 - product * product / (max(square - total * total / x.size, TINY) * squares)
    return fractions


@_compile
def behind_plays(x: Array, starts: Array, radii: Array) -> Array:
    """Deviations p - x (n, k) of the outputs p of plays of half-widths `radii` (k,), driven along x (n,):
    p_i = max(x_i - r, min(x_i + r, p_(i-1))), at rest (p = x) where a path begins. Reference: Visintin,
    Differential Models of Hysteresis.
    """
    off = np.empty((x.size, radii.size))
    for k in range(radii.size):
        r, p = radii[k], 0.0
        for i in range(x.size):
            p = x[i] if starts[i] else max(x[i] - r, min(x[i] + r, p))
            off[i, k] = p - x[i]
    return off
