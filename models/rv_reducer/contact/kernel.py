"""Rotations under torque, compiled by numba: many units side by side, a crank angle at a time.

Newton's method on the pins of the loaded flank alone converges from any start, because the torque
is convex in the rotation; points where a pin of the other flank bears too, and those without
torque, are solved one by one with bounds. All functions are in this file because numba's cache
does not see changes of other files. numba is imported with this module alone, where a rotation is
computed.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from ....section import Array, Complex
from .geometry import (
    STEEP,
    Axes,
    ContactGeometry,
    Displacements,
    Nominal,
    PartErrors,
    displacements,
    nominal_pin,
    teeth,
    unit,
)

LANES = 128
"""Units solved side by side."""
_ARMLESS = 1e-9
_UNREACHABLE_ROTATION = 1e3
_NUDGE = 1e-6
_STEPS = 200


def _compile(function: Any) -> Any:
    return numba.njit(cache=True, error_model="numpy")(function)


@_compile
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
    steep = abs(bend) > STEEP
    for u in range(gap.size):
        x, y = pin_x[u] - disc_x[u], pin_y[u] - disc_y[u]
        shift, p, q = shifts[u], pitch_x[u], pitch_y[u]
        along = x * nx + y * ny - shift * rn + p * an + q * am
        across = y * nx - x * ny - shift * rt + p * tn + q * tm
        if steep:
            wide, bent = 1.0 + bend * along, bend * across
            length = np.sqrt(wide * wide + bent * bent)
            arc = across / length
            moved = (2.0 * along + bend * (along * along + across * across)) / (1.0 + length)
            moved += cubic * arc * arc * arc
        else:
            square = across * across
            moved = along + square * (0.5 * bend * (1.0 - bend * along) + cubic * across)
        gap[u] = nominal + moved - mixed * shift * across + radius[u]


@_compile
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


@_compile
def _other_flank(arms: Array, gap: Array, at: Array, wrong: Array) -> None:
    """Marks the lanes where a pin with l < 0 bears."""
    for j in range(arms.size):
        arm = arms[j]
        if arm < -_ARMLESS:
            of_pin = gap[j]
            for u in range(at.size):
                wrong[u] = 1.0 if arm * at[u] > of_pin[u] else wrong[u]


@_compile
def _lanes(
    arms: Array, gap: Array, normal: Array, behind: Array, turn: Array, torque: Array, at: Array
) -> tuple[Array, Array]:
    """Rotation of each lane on one flank, and 1 where that does not hold; `at` is start and end.

    `arms` (discs, pins), `gap` (discs, pins, lanes); `normal`, `behind`, `turn` (play taken off),
    `at` (discs, lanes); `torque` (lanes), above 0.
    """
    discs, lanes = at.shape
    slope, moment, bent = np.empty((3, discs, lanes))
    stiffness, need, rotation, wrong = np.empty((4, lanes))
    wrong[:] = 1.0
    for _ in range(_STEPS):
        stiffness[:] = 0.0
        for u in range(lanes):
            need[u] = torque[u]
        for d in range(discs):
            _bearing(arms[d], gap[d], at[d], slope[d], moment[d])
            for u in range(lanes):
                moment[d, u] *= normal[d, u]
                rise = slope[d, u] * normal[d, u]
                bent[d, u] = 1.0 / (1.0 + rise * behind[d, u])
                stiffness[u] += rise * bent[d, u]
                need[u] += (moment[d, u] - rise * turn[d, u]) * bent[d, u]
        for u in range(lanes):
            rotation[u] = need[u] / stiffness[u] if stiffness[u] > 0.0 else 1.0
        moving = 0
        for d in range(discs):
            for u in range(lanes):
                ahead = (rotation[u] + turn[d, u] + moment[d, u] * behind[d, u]) * bent[d, u]
                moving += 1 if abs(ahead - at[d, u]) > 1e-18 else 0
                at[d, u] = ahead
        if moving == 0:
            wrong[:] = 0.0
            break
    for d in range(discs):
        _other_flank(arms[d], gap[d], at[d], wrong)
    return rotation, wrong


@_compile
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


@_compile
def _spring_rotation(
    arms: Array, gap: Array, normal: float, behind: float, target: float, low: float, high: float
) -> float:
    """x in [low, high] with x + behind M(x) = target, or M(x) = 0 where `behind` is infinite."""
    at = low
    for _ in range(_STEPS):
        torque, stiffness = _pins(arms, gap, normal, at)
        if np.isinf(behind):
            miss, rise = torque, stiffness
        else:
            miss, rise = at + behind * torque - target, 1.0 + behind * stiffness
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


@_compile
def _torque_free_bounds(arms: Array, gap: Array, normal: float) -> tuple[float, float]:
    """Bounds of a disc's rotations without torque."""
    low, high = -np.inf, np.inf
    for j in range(arms.size):
        if arms[j] > _ARMLESS:
            high = min(high, gap[j] / arms[j])
        elif arms[j] < -_ARMLESS:
            low = max(low, gap[j] / arms[j])
    if low > high:
        low = _spring_rotation(arms, gap, normal, np.inf, 0.0, high, low)
        high = low
    return low, high


@_compile
def balance(
    arms: Array, gap: Array, normal: Array, behind: Array, turn: Array, play: Array, torque: float, direction: int
) -> float:
    """Rotation against the mesh of one unit at one angle, as `Mesh.rotation` computes it.

    `arms`, `gap` (discs, pins); `normal`, `behind`, `turn`, `play` (discs).
    """
    discs = arms.shape[0]
    lows, highs = np.empty(discs), np.empty(discs)
    least, most = -np.inf, np.inf
    for d in range(discs):
        lows[d], highs[d] = _torque_free_bounds(arms[d], gap[d], normal[d])
        least = max(least, lows[d] - play[d] - turn[d])
        most = min(most, highs[d] + play[d] - turn[d])
    forward = torque > 0.0 or (torque == 0.0 and direction > 0)
    at = most if forward else least
    if least > most:
        at = 0.5 * (least + most)
    elif torque == 0.0:
        return at
    low, high = -_UNREACHABLE_ROTATION, _UNREACHABLE_ROTATION
    for _ in range(_STEPS):
        miss, rise = -torque, 0.0
        for d in range(discs):
            turned = at + turn[d]
            nearest = min(max(turned, lows[d]), highs[d])
            beyond = turned - nearest
            if not (play[d] > 0.0 and abs(beyond) <= play[d]):
                target = turned - min(max(beyond, -play[d]), play[d])
                x = target
                if behind[d] > 0.0:
                    x = _spring_rotation(
                        arms[d], gap[d], normal[d], behind[d], target, min(nearest, target), max(nearest, target)
                    )
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


@_compile
def _place(axes: Array, disc: Array, x: Array, y: Array, turn: Array) -> None:
    """Displacement of the centre and forward turn of one disc: `axes` (6), `disc` (11, lanes)."""
    ex, ey, dx, dy, cx, cy = axes
    turning_x, turning_y, offset_x, offset_y = disc[0], disc[1], disc[2], disc[3]
    around_x, around_y, angle = disc[4], disc[5], disc[6]
    for u in range(turn.size):
        x[u] = turning_x[u] * ex - turning_y[u] * ey + offset_x[u] * dx - offset_y[u] * dy
        y[u] = turning_x[u] * ey + turning_y[u] * ex + offset_x[u] * dy + offset_y[u] * dx
        turn[u] = angle[u] - (around_x[u] * cy + around_y[u] * cx)


@_compile
def rotations(
    table: Array,
    axes: Array,
    pins: Array,
    discs: Array,
    normal: Array,
    compliance: Array,
    torque: Array,
    direction: int,
    rotation: Array,
) -> None:
    """Fills `rotation` (angles, units) with rotations against the mesh under torques there.

    `table` (angles, discs, pins, 13), `axes` (6, angles, discs), `pins` (3, discs, pins, units),
    `discs` (11, discs, units), `normal`, `compliance` (units, angles, discs), `torque`
    (units, angles).
    """
    for first in range(0, torque.shape[0], LANES):
        part = slice(first, min(first + LANES, torque.shape[0]))
        of_pins, of_discs = pins[:, :, :, part].copy(), discs[:, :, part].copy()
        lanes = of_pins.shape[3]
        warm = np.ones((table.shape[1], lanes))
        x, y, turn = np.empty_like(warm), np.empty_like(warm), np.empty_like(warm)
        gap = np.empty((table.shape[1], table.shape[2], lanes))
        for a in range(torque.shape[1]):
            for d in range(turn.shape[0]):
                _place(axes[:, a, d], of_discs[:, d], x[d], y[d], turn[d])
                for j in range(gap.shape[1]):
                    _gap(
                        table[a, d, j],
                        of_pins[0, d, j],
                        of_pins[1, d, j],
                        of_pins[2, d, j],
                        x[d],
                        y[d],
                        of_discs[8, d],
                        of_discs[9, d],
                        of_discs[10, d],
                        gap[d, j],
                    )
            loads, play = torque[part, a].copy(), of_discs[7]
            k, behind = normal[part, a].T.copy(), compliance[part, a].T.copy()
            arms = table[a, :, :, 0].copy()
            sign = 1.0 if loads[0] > 0.0 else -1.0
            wrong = np.ones(loads.size)
            if np.all(loads * sign > 0.0):
                turned, wrong = _lanes(arms * sign, gap, k, behind, turn * sign - play, loads * sign, warm)
                rotation[a, part] = turned * sign
            for u in range(loads.size):
                if wrong[u] > 0.0:
                    rotation[a, first + u] = balance(
                        arms,
                        gap[:, :, u].copy(),
                        k[:, u].copy(),
                        behind[:, u].copy(),
                        turn[:, u].copy(),
                        play[:, u].copy(),
                        loads[u],
                        direction,
                    )


# The inputs of the kernel, from the errors of the parts.


def rotation(
    geometry: ContactGeometry,
    errors: PartErrors,
    angles: Array,
    normal: Array,
    series: Array,
    torque: Array,
    direction: int,
) -> Array:
    """Rotation of the carrier [rad], (units, angles), as `Mesh.rotation` computes it.

    `normal` [N/m] and `series` [N m/rad] stiffness fit (units, angles, discs), `torque` [N m] fits
    (units, angles).
    """
    displacement, axes = displacements(geometry, errors), Axes.at(geometry, angles)
    shape = (errors.units, angles.size, geometry.discs)
    turns = np.empty((angles.size, errors.units))
    rotations(
        _table(geometry, angles, axes),
        _parts(axes.eccentric, axes.disc, axes.crank),
        _packed_pins(displacement),
        _packed_discs(displacement),
        np.broadcast_to(normal, shape),
        np.broadcast_to(1.0 / series, shape),
        np.broadcast_to(torque / geometry.output_ratio, shape[:2]),
        direction,
        turns,
    )
    return turns.T / geometry.output_ratio


def _parts(*values: Complex) -> Array:
    """Real and imaginary parts, one after the other."""
    return np.stack([part for vector in values for part in (vector.real, vector.imag)])


def _packed_pins(displacement: Displacements) -> Array:
    """Displacements (x, y) of pins and change of the gap, (3, discs, pins, units)."""
    of_pins = (displacement.pins.real, displacement.pins.imag, displacement.across)
    return np.stack([np.moveaxis(column, 0, -1) for column in of_pins])


def _packed_discs(displacement: Displacements) -> Array:
    """Displacements, turns, play, shift and pitch of discs, (11, discs, units)."""
    directions = _parts(displacement.turning.T, displacement.offset.T, displacement.around.T)
    by_disc = (
        displacement.angle,
        displacement.play,
        displacement.shift,
        displacement.pitch.real,
        displacement.pitch.imag,
    )
    return np.concatenate([directions, np.stack([column.T for column in by_disc])])


def _table(geometry: ContactGeometry, angles: Array, axes: Axes) -> Array:
    """The nominal profile at each pin, (angles, discs, pins, 13), in the housing's axes."""
    phi = geometry.phase(angles)
    nominal = Nominal.at(geometry, phi)
    normal = nominal.normal * unit(geometry.pin_angles)
    turned, tooth = np.multiply(-1j, nominal_pin(geometry, phi)), teeth(geometry, axes)
    along, across = (np.real(turned * direction.conj()) for direction in (nominal.normal, nominal.tangent))
    columns = [
        nominal.lever,
        nominal.gap,
        normal.real,
        normal.imag,
        nominal.bend,
        nominal.cubic,
        nominal.mixed,
        np.real(nominal.radial * nominal.normal.conj()),
        np.real(nominal.radial * nominal.tangent.conj()),
        along * tooth.real,
        along * tooth.imag,
        across * tooth.real,
        across * tooth.imag,
    ]
    return np.stack(columns, axis=-1)
