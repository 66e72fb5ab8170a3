"""Derivatives of balances of torque, compiled by numba, by the pins that bear and the springs.

With W and H the sums over the bearing pins of a disc of stiffness w and of w dh, play P closed in
the direction of load and c the compliance behind the disc, a balance changes by
dM = (W (db + ds -+ dP) - H)/(1 + c W), sum of dM = 0. The derivative of a turn, of the
torque of a flank or of the force on a pin by each gap is a weight by contact; the turn of the disc
takes the remaining change. All functions are in this file because numba's cache does not see
changes of other files. Importing this needs numba.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from ....arrays import Single

LANES = 256
"""Units in one block, so that they stay in the cache."""


def _compiled(function: Any) -> Any:
    return numba.njit(cache=True, error_model="numpy", fastmath=True, nogil=True)(function)


@_compiled
def _terms(axes: Single, disc: Single, circle: Single, terms: Single) -> None:
    """Fills `terms` (6, lanes) of one disc at one position: changes of gaps, as in `compiled`."""
    ex, ey, dx, dy = axes[0], axes[1], axes[2], axes[3]
    for u in range(disc.shape[1]):
        terms[0, u] = disc[0, u]
        terms[1, u] = disc[1, u]
        x = disc[4, u] * ex - disc[5, u] * ey + disc[6, u] * dx - disc[7, u] * dy
        y = disc[4, u] * ey + disc[5, u] * ex + disc[6, u] * dy + disc[7, u] * dx
        terms[2, u] = circle[0, u] - x
        terms[3, u] = circle[1, u] - y
        terms[4, u] = disc[10, u] * dx - disc[11, u] * dy
        terms[5, u] = disc[10, u] * dy + disc[11, u] * dx


@_compiled
def _closed(
    row: Single, pin_across: Single, pin_along: Single, terms: Single, x: Single, flank: int, into: Single
) -> None:
    """Turn of each lane's disc beyond contact with one pin of `flank`, or 0."""
    gap, lever, radial, tangential = row[0], row[1], row[2], row[3]
    nx, ny, c, s = row[4], row[5], row[6], row[7]
    zero = np.float32(0.0)
    sign = np.float32(1.0) if flank == 0 else np.float32(-1.0)
    for u in range(into.size):
        h = gap + lever * (pin_across[u] + terms[0, u]) + radial * terms[1, u]
        h += tangential * pin_along[u] + nx * terms[2, u] + ny * terms[3, u]
        h += c * terms[4, u] + s * terms[5, u]
        into[u] = sign * max(sign * (x[u] - h), zero)


@_compiled
def _collect(
    closed: Single,
    stiff: float,
    force: float,
    contact: int,
    of_torque: Single,
    of_force: Single,
    star: Any,
    rise: Single,
    fixed: Single,
) -> Any:
    """Adds one contact to its disc's stiffness and to the functional's derivative by its turn.

    Returns whether the contact bears in any lane.
    """
    zero = np.float32(0.0)
    most: Any = zero
    for u in range(closed.size):
        bears = stiff if closed[u] != zero else zero
        rise[u] += bears
        fixed[u] += bears * of_torque[u] + (force * of_force[u] if star[u] == contact else zero)
        most = bears if bears > most else most
    return most > zero


@_compiled
def _factors(rise: Single, fixed: Single, side: Any, behind: float, of_turn: Single, factor: Single) -> None:
    """Factors (discs, lanes) by which w gives a contact's weight through the balance.

    `rise` is W; `fixed` is the derivative of the functional by the turn of the disc alone,
    `of_turn` (lanes) that by the turn of the unit.
    """
    unity, zero, tiny = np.float32(1.0), np.float32(0.0), np.float32(1e-20)
    for u in range(of_turn.size):
        stiffness, common = zero, of_turn[u]
        for d in range(rise.shape[0]):
            if side[d, u] != 0:
                bent = unity / (unity + behind * rise[d, u])
                stiffness += bent * rise[d, u]
                common += bent * fixed[d, u]
        common /= max(stiffness, tiny)
        for d in range(rise.shape[0]):
            if side[d, u] != 0:
                bent = unity / (unity + behind * rise[d, u])
                factor[d, u] = bent * (common + behind * fixed[d, u])
            else:
                factor[d, u] = fixed[d, u] / max(rise[d, u], tiny)


@_compiled
def _spread(
    contact: Any,
    closed: Single,
    factor: Single,
    of_torque: Single,
    of_force: Single,
    star: Any,
    of_contact: Single,
    sums: Single,
) -> Any:
    """Adds the weights of a contact to `sums` (7, lanes), and writes them to `of_contact`.

    `contact` has its row, its `lean`, stiffness and force, and its number.
    Returns the part by the shift modification, with which the lever arm grows by `lean` [1/mm]:
    stiffness goes with the square of the arm, the force on a pin with the arm.
    """
    row, lean, stiff, force, number = contact
    lever, radial, nx, ny = row[1], row[2], row[4], row[5]
    c, s, zero, two = row[6], row[7], np.float32(0.0), np.float32(2.0)
    by_shift = zero
    for u in range(of_contact.size):
        bears = stiff if closed[u] != zero else zero
        through = (factor[u] - of_torque[u]) * bears
        direct = force * of_force[u] if star[u] == number else zero
        a = through - direct
        of_contact[u] = a
        sums[0, u] += a
        sums[1, u] += a * lever
        sums[2, u] += a * radial
        sums[3, u] += a * nx
        sums[4, u] += a * ny
        sums[5, u] += a * c
        sums[6, u] += a * s
        by_shift += a * row[8] - lean * closed[u] * (two * through - direct)
    return by_shift


@_compiled
def _add_disc(sums: Single, axes: Single, z: Single, unit: Single, side: Any, total: Any) -> None:
    """Adds to `total` the weights of one disc (7, lanes) times the errors of disc and unit."""
    ex, ey, dx, dy, cx, cy = axes[0], axes[1], axes[2], axes[3], axes[4], axes[5]
    for u in range(side.size):
        a, lever, radial = sums[0, u], sums[1, u], sums[2, u]
        nx, ny, c, s = sums[3, u], sums[4, u], sums[5, u], sums[6, u]
        px, py = z[2, u] * dx - z[3, u] * dy, z[2, u] * dy + z[3, u] * dx
        rx, ry = z[4, u] * dx - z[5, u] * dy, z[4, u] * dy + z[5, u] * dx
        bx, by = z[10, u] * dx - z[11, u] * dy, z[10, u] * dy + z[11, u] * dx
        total[0] += radial * unit[0, u]
        total[4] += c * px + s * py
        total[5] -= nx * rx + ny * ry
        total[6] += a * (z[7, u] * cy + z[8, u] * cx) - (nx * ex + ny * ey) * z[6, u]
        total[7] += lever * z[0, u]
        total[8] -= radial * z[1, u]
        total[9] += a * side[u] * z[9, u]
        total[10] += nx * unit[1, u] + ny * unit[2, u]
        total[11] += nx * bx + ny * by - a * z[12, u]
        total[12] += a * (z[14, u] * cy + z[15, u] * cx) - (ex * ny - ey * nx) * z[13, u]
        total[13] -= a * z[16, u]
        total[14] += lever


@_compiled
def _add_pin(row: Single, weight: Single, units: Any, of_pin: Single, total: Any) -> None:
    """Adds to `total` the weights of one contact times the errors of its pin (3, units)."""
    placed = hole = radius = np.float32(0.0)
    for u in range(weight.size):
        at = units[u]
        placed += weight[u] * of_pin[0, at]
        hole += weight[u] * of_pin[1, at]
        radius += weight[u] * of_pin[2, at]
    total[1] += row[3] * placed
    total[2] += row[1] * hole
    total[3] -= row[1] * radius


@_compiled
def _weighed(of_turn: Single, of_preload: Single, of_peak: Single, first: int, units: Any) -> tuple[int, int]:
    """Fills `units` with those from `first` on that have a weight.

    Returns the unit from which to go on, and the number of units.
    """
    count, u = 0, first
    while u < of_turn.size and count < units.size:
        if of_turn[u] != 0.0 or of_preload[u] != 0.0 or of_peak[u] != 0.0:
            units[count] = u
            count += 1
        u += 1
    return u, count


@_compiled
def pull_back(weights: Any, contacts: Any, springs: Any, errors: Any, balance: Any, slopes: Any, total: Any) -> None:
    """Adds to `total` (16) the slopes of the weighted sum of the outputs of one load case.

    `weights` (positions, units) are those of the turn, of the torque of the forward flanks and of
    the largest pin force. `balance`: turns and sides (positions, discs, units), and the contact
    (units) with that force; the rest as in `balances` and `compiled.pull_back`.
    """
    of_turn, of_preload, of_peak = weights
    rows, pins, start, stop, axes = contacts
    stiff, force, lean, behind = springs
    across, along, discs, circle = errors
    x, side, which = balance
    of_unit, of_discs, of_pins = slopes
    many, wide, zero = start.shape[1], 0, np.float32(0.0)
    for a in range(start.shape[0]):
        wide = max(wide, stop[a, many - 1, 1] - start[a, 0, 0])
    indices, nothing = np.empty(LANES, np.int64), np.zeros(LANES, np.float32)
    terms, weight = np.empty((6, LANES), np.float32), np.empty(LANES, np.float32)
    closed, sums = np.empty((wide, LANES), np.float32), np.empty((7, LANES), np.float32)
    rise, fixed, factor = np.empty((3, many, LANES), np.float32)
    bearing = np.empty(wide, np.bool_)
    for a in range(start.shape[0]):
        u, base = 0, start[a, 0, 0]
        while True:
            u, n = _weighed(of_turn[a], of_preload[a], of_peak[a], u, indices)
            if n == 0:
                break
            units, lanes = indices[:n], slice(0, n)
            lane_across, lane_along, star = across[:, units], along[:, units], which[units]
            turn, torque, load = of_turn[a][units], of_preload[a][units], of_peak[a][units]
            toward, by_unit = side[a][:, units], of_unit[:, units]
            rise[:] = zero
            fixed[:] = zero
            for d in range(many):
                _terms(axes[a, d], discs[d][:, units], circle[:, units], terms)
                turned = x[a, d][units]
                for flank in range(2):
                    taken = torque if flank == 0 else nothing[lanes]
                    for i in range(start[a, d, flank], stop[a, d, flank]):
                        j, into = pins[i], closed[i - base, lanes]
                        _closed(rows[i], lane_across[j], lane_along[j], terms, turned, flank, into)
                        bearing[i - base] = _collect(
                            into, stiff[i], force[i], i, taken, load, star, rise[d, lanes], fixed[d, lanes]
                        )
            _factors(rise, fixed, toward, behind, turn, factor)
            for d in range(many):
                sums[:] = zero
                for flank in range(2):
                    taken = torque if flank == 0 else nothing[lanes]
                    for i in range(start[a, d, flank], stop[a, d, flank]):
                        if not bearing[i - base]:
                            continue
                        contact = rows[i], lean[i], stiff[i], force[i], i
                        into, of_disc = closed[i - base, lanes], factor[d, lanes]
                        total[15] += _spread(contact, into, of_disc, taken, load, star, weight[lanes], sums)
                        _add_pin(rows[i], weight[lanes], units, of_pins[:, pins[i]], total)
                _add_disc(sums, axes[a, d], of_discs[d][:, units], by_unit, toward[d], total)
