"""Rotations under torque, compiled by numba: many units side by side, a crank angle at a time.

Newton's method on the pins of the loaded flank alone converges from any start, because the torque
is convex in the rotation; points where a pin of the other flank bears too, and those without
torque, are solved one by one with bounds. All functions are in this file because numba's cache
does not see changes of others.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LANES = 64
"""Units solved side by side."""
_ARMLESS = 1e-9
_FAR = 1e3
_NUDGE = 1e-6
_STEPS = 200


def _compiled(function: Any) -> Any:
    return numba.njit(cache=True, error_model="numpy")(function)


@_compiled
def _gap(
    row: Array,
    pin_x: Array,
    pin_y: Array,
    radius: Array,
    disc_x: Array,
    disc_y: Array,
    shifts: Array,
    pitch_x: Array,
    pitch_y: Array,
    gap: Array,
) -> None:
    """Gaps of one pin for all lanes: `row` of the table, the rest (lanes), each contiguous."""
    nominal, nx, ny, bend, cubic, mixed = row[1], row[2], row[3], row[4], row[5], row[6]
    rn, rt, an, am, tn, tm = row[7], row[8], row[9], row[10], row[11], row[12]
    for u in range(gap.size):
        x, y = pin_x[u] - disc_x[u], pin_y[u] - disc_y[u]
        shift, p, q = shifts[u], pitch_x[u], pitch_y[u]
        along = x * nx + y * ny - shift * rn + p * an + q * am
        across = y * nx - x * ny - shift * rt + p * tn + q * tm
        wide, bent = 1.0 + bend * along, bend * across
        length = np.sqrt(wide * wide + bent * bent)
        ratio = across / length
        circle = (2.0 * along + bend * (along * along + across * across)) / (1.0 + length)
        change = cubic * ratio * ratio * ratio - mixed * shift * across
        gap[u] = nominal + circle + change + radius[u]


@_compiled
def _bearing(arms: Array, gap: Array, at: Array, slope: Array, moment: Array) -> None:
    """Sums of l^2 and l g over the pins with l > 0 that bear at each lane's rotation."""
    slope[:] = 0.0
    moment[:] = 0.0
    for j in range(arms.size):
        arm = arms[j]
        if arm > _ARMLESS:
            of_pin = gap[j]
            for u in range(at.size):
                g = of_pin[u]
                bears = arm if arm * at[u] > g else 0.0
                slope[u] += bears * arm
                moment[u] += bears * g


@_compiled
def _other_flank(arms: Array, gap: Array, at: Array, wrong: Array) -> None:
    """Marks the lanes where a pin with l < 0 bears."""
    for j in range(arms.size):
        arm = arms[j]
        if arm < -_ARMLESS:
            of_pin = gap[j]
            for u in range(at.size):
                wrong[u] = 1.0 if arm * at[u] > of_pin[u] else wrong[u]


@_compiled
def _lanes(
    arms: Array, gap: Array, normal: Array, behind: Array, turn: Array, torque: Array, at: Array
) -> tuple[Array, Array]:
    """Rotation of each lane on one flank, and 1 where that does not hold; `at` is start and end.

    `arms` (discs, pins), `gap` (discs, pins, lanes); `normal`, `behind`, `turn` (play taken off),
    `at` (discs, lanes); `torque` (lanes), above 0.
    """
    discs, lanes = at.shape
    slope, moment, bent = np.empty((3, discs, lanes))
    stiffness, need, found, wrong = np.empty((4, lanes))
    wrong[:] = 1.0
    for _ in range(_STEPS):
        stiffness[:] = 0.0
        need[:] = torque
        for d in range(discs):
            _bearing(arms[d], gap[d], at[d], slope[d], moment[d])
            for u in range(lanes):
                moment[d, u] *= normal[d, u]
                rise = slope[d, u] * normal[d, u]
                bent[d, u] = 1.0 / (1.0 + rise * behind[d, u])
                stiffness[u] += rise * bent[d, u]
                need[u] += (moment[d, u] - rise * turn[d, u]) * bent[d, u]
        for u in range(lanes):
            found[u] = need[u] / stiffness[u] if stiffness[u] > 0.0 else 1.0
        moved = 0.0
        for d in range(discs):
            for u in range(lanes):
                ahead = (found[u] + turn[d, u] + moment[d, u] * behind[d, u]) * bent[d, u]
                moved = max(moved, abs(ahead - at[d, u]))
                at[d, u] = ahead
        if moved <= 1e-18:
            wrong[:] = 0.0
            break
    for d in range(discs):
        _other_flank(arms[d], gap[d], at[d], wrong)
    return found, wrong


@_compiled
def _pins(arms: Array, gap: Array, normal: float, at: float) -> tuple[float, float]:
    """Torque and stiffness of a disc's pins at its rotation `at`."""
    torque = stiffness = 0.0
    for j in range(arms.size):
        arm = arms[j]
        closed = arm * at - gap[j]
        if closed > 0.0 and abs(arm) > _ARMLESS:
            torque += arm * closed
            stiffness += arm * arm
    return normal * torque, normal * stiffness


@_compiled
def _bent(
    arms: Array, gap: Array, normal: float, behind: float, wanted: float, low: float, high: float
) -> float:
    """x in [low, high] with x + behind M(x) = wanted, or M(x) = 0 where `behind` is infinite."""
    at = low
    for _ in range(_STEPS):
        torque, stiffness = _pins(arms, gap, normal, at)
        if np.isinf(behind):
            miss, rise = torque, stiffness
        else:
            miss, rise = at + behind * torque - wanted, 1.0 + behind * stiffness
        if miss < 0.0:
            low = max(low, at)
        else:
            high = min(high, at)
        ahead = at - miss / rise if rise > 0.0 else 0.5 * (low + high)
        if not low < ahead < high:
            ahead = 0.5 * (low + high)
        if abs(ahead - at) <= 1e-19:
            break
        at = ahead
    return at


@_compiled
def _without_torque(arms: Array, gap: Array, normal: float) -> tuple[float, float]:
    """Bounds of a disc's rotations without torque."""
    low, high = -np.inf, np.inf
    for j in range(arms.size):
        if arms[j] > _ARMLESS:
            high = min(high, gap[j] / arms[j])
        elif arms[j] < -_ARMLESS:
            low = max(low, gap[j] / arms[j])
    if low > high:
        low = _bent(arms, gap, normal, np.inf, 0.0, high, low)
        high = low
    return low, high


@_compiled
def balance(
    arms: Array,
    gap: Array,
    normal: Array,
    behind: Array,
    turn: Array,
    play: Array,
    torque: float,
    direction: int,
) -> float:
    """Rotation against the mesh of one unit at one angle, as `Mesh.rotation` finds it.

    `arms`, `gap` (discs, pins); `normal`, `behind`, `turn`, `play` (discs).
    """
    discs = arms.shape[0]
    lows, highs = np.empty(discs), np.empty(discs)
    least, most = -np.inf, np.inf
    for d in range(discs):
        lows[d], highs[d] = _without_torque(arms[d], gap[d], normal[d])
        least = max(least, lows[d] - play[d] - turn[d])
        most = min(most, highs[d] + play[d] - turn[d])
    forward = torque > 0.0 or (torque == 0.0 and direction > 0)
    at = most if forward else least
    if least > most:
        at = 0.5 * (least + most)
    elif torque == 0.0:
        return at
    low, high = -_FAR, _FAR
    for _ in range(_STEPS):
        miss, rise = -torque, 0.0
        for d in range(discs):
            turned = at + turn[d]
            nearest = min(max(turned, lows[d]), highs[d])
            beyond = turned - nearest
            if not (play[d] > 0.0 and abs(beyond) <= play[d]):
                wanted = turned - min(max(beyond, -play[d]), play[d])
                x = wanted
                if behind[d] > 0.0:
                    x = _bent(
                        arms[d], gap[d], normal[d], behind[d], wanted,
                        min(nearest, wanted), max(nearest, wanted),
                    )  # fmt: skip
                held, stiffness = _pins(arms[d], gap[d], normal[d], x)
                miss += held
                rise += stiffness / (1.0 + stiffness * behind[d])
        if abs(miss) <= 1e-13 * abs(torque) + 1e-12:
            break
        if miss < 0.0:
            low = at
        else:
            high = at
        ahead = at - miss / rise if rise > 0.0 else at - np.sign(miss) * _NUDGE
        if not low < ahead < high:
            ahead = 0.5 * (low + high)
        if abs(ahead - at) <= 1e-18:
            break
        at = ahead
    return at


@_compiled
def rotations(
    table: Array,
    pins: Array,
    centre: Array,
    disc: Array,
    normal: Array,
    compliance: Array,
    torque: Array,
    direction: int,
    found: Array,
) -> None:
    """Fills `found` (units, angles) with rotations against the mesh; torques there as well."""
    units, count = torque.shape
    discs, pin_count = table.shape[1], table.shape[2]
    warm = np.ones((discs, units))
    for a in range(count):
        for first in range(0, units, LANES):
            last = min(first + LANES, units)
            lanes = last - first
            gap = np.empty((discs, pin_count, lanes))
            for d in range(discs):
                for j in range(pin_count):
                    _gap(
                        table[a, d, j],
                        pins[0, d, j, first:last],
                        pins[1, d, j, first:last],
                        pins[2, d, j, first:last],
                        centre[0, a, d, first:last],
                        centre[1, a, d, first:last],
                        disc[0, d, first:last],
                        disc[1, d, first:last],
                        disc[2, d, first:last],
                        gap[d, j],
                    )
            loads = torque[first:last, a].copy()
            k = normal[first:last, a].T.copy()
            behind = compliance[first:last, a].T.copy()
            turn, play = centre[2, a, :, first:last].copy(), disc[3, :, first:last].copy()
            arms = table[a, :, :, 0].copy()
            sign = 1.0 if loads[0] > 0.0 else -1.0
            wrong = np.ones(lanes)
            if np.all(loads * sign > 0.0):
                start = warm[:, first:last].copy()
                turned, wrong = _lanes(
                    arms * sign, gap, k, behind, turn * sign - play, loads * sign, start
                )
                warm[:, first:last] = start
                found[first:last, a] = turned * sign
            for u in range(lanes):
                if wrong[u] > 0.0:
                    found[first + u, a] = balance(
                        arms, gap[:, :, u].copy(), k[:, u].copy(), behind[:, u].copy(),
                        turn[:, u].copy(), play[:, u].copy(), loads[u], direction,
                    )  # fmt: skip
