"""First contact of many units, compiled by numba: positions, discs, pins, and units innermost.

The formulas are those of `arrays`. All functions are in this file because numba's cache does not
see changes of other files. Importing this needs numba.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from ....section import Single

LANES = 256
"""Units in one block, so that they stay in the cache."""


def _compiled(function: Any) -> Any:
    return numba.njit(cache=True, error_model="numpy", fastmath=True, nogil=True)(function)


@_compiled
def _disc(axes: Single, disc: Single, circle: Single, terms: Single) -> None:
    """Fills `terms` (8, lanes) of one disc at one position.

    `axes` (6) are cos and sin of eccentric, disc, and eccentric against the cranks; `disc`
    (12, lanes): normal, radial, play, ahead, then real and imaginary parts of turning, offset,
    around, pitch; `circle` (2, lanes). `terms`: changes of the gap along the normal and
    radially, x and y of the pin against the disc, pitch x and y, play, forward turn.
    """
    ex, ey, dx, dy, cx, cy = axes[0], axes[1], axes[2], axes[3], axes[4], axes[5]
    for u in range(terms.shape[1]):
        terms[0, u] = disc[0, u]
        terms[1, u] = disc[1, u]
        x = disc[4, u] * ex - disc[5, u] * ey + disc[6, u] * dx - disc[7, u] * dy
        y = disc[4, u] * ey + disc[5, u] * ex + disc[6, u] * dy + disc[7, u] * dx
        terms[2, u] = circle[0, u] - x
        terms[3, u] = circle[1, u] - y
        terms[4, u] = disc[10, u] * dx - disc[11, u] * dy
        terms[5, u] = disc[10, u] * dy + disc[11, u] * dx
        terms[6, u] = disc[2, u]
        terms[7, u] = disc[3, u] - (disc[8, u] * cy + disc[9, u] * cx)


@_compiled
def _nearest(
    rows: Single, pins: Any, across: Single, along: Single, terms: Single, sign: float, best: Single, which: Any
) -> None:
    """The least of sign * h over contacts, and its pin, by lane."""
    for i in range(rows.shape[0]):
        j = pins[i]
        gap, lever, radial, tangential = (sign * rows[i, 0], sign * rows[i, 1], sign * rows[i, 2], sign * rows[i, 3])
        nx, ny, c, s = sign * rows[i, 4], sign * rows[i, 5], sign * rows[i, 6], sign * rows[i, 7]
        pin_across, pin_along = across[j], along[j]
        place = np.int32(i)
        for u in range(best.size):
            h = gap + lever * (pin_across[u] + terms[0, u]) + radial * terms[1, u]
            h += tangential * pin_along[u] + nx * terms[2, u] + ny * terms[3, u]
            h += c * terms[4, u] + s * terms[5, u]
            nearer = h < best[u]
            best[u] = h if nearer else best[u]
            which[u] = place if nearer else which[u]


@_compiled
def touch(contacts: Any, errors: Any, turns: Any) -> None:
    """Fills `turns` at first contact: forward, backward, and the contacts that make them.

    The four arrays have the shape (positions, units); a contact is a row of the table. `contacts`:
    table (contacts, 9), pins (contacts), start and stop (positions, discs, 2), axes
    (positions, discs, 6). `errors`: across and along (pins, units), discs (discs, 12, units),
    circle (2, units).
    """
    rows, pins, start, stop, axes = contacts
    across, along, discs, circle = errors
    high, low, ahead, behind = turns
    far = np.float32(1e9)
    plus, minus = np.float32(1.0), np.float32(-1.0)
    for first in range(0, across.shape[1], LANES):
        last = min(first + LANES, across.shape[1])
        lanes = last - first
        lane_across, lane_along = across[:, first:last].copy(), along[:, first:last].copy()
        of_discs, centre = discs[:, :, first:last].copy(), circle[:, first:last].copy()
        terms = np.empty((8, lanes), np.float32)
        best = np.empty(lanes, np.float32)
        which = np.empty(lanes, np.int32)
        for a in range(start.shape[0]):
            high[a, first:last] = far
            low[a, first:last] = -far
            for d in range(start.shape[1]):
                _disc(axes[a, d], of_discs[d], centre, terms)
                i, k = start[a, d, 0], stop[a, d, 0]
                best[:] = far
                which[:] = 0
                _nearest(rows[i:k], pins[i:k], lane_across, lane_along, terms, plus, best, which)
                for u in range(lanes):
                    at = best[u] + terms[6, u] - terms[7, u]
                    if at < high[a, first + u]:
                        high[a, first + u] = at
                        ahead[a, first + u] = i + which[u]
                i, k = start[a, d, 1], stop[a, d, 1]
                best[:] = far
                which[:] = 0
                _nearest(rows[i:k], pins[i:k], lane_across, lane_along, terms, minus, best, which)
                for u in range(lanes):
                    at = -best[u] - terms[6, u] - terms[7, u]
                    if at > low[a, first + u]:
                        low[a, first + u] = at
                        behind[a, first + u] = i + which[u]


@_compiled
def pull_back(weight: Single, touching: Any, contacts: Any, slopes: Any, total: Any) -> None:
    """Adds to `total` (16) the slopes of sum(weight * (forward - backward)) in order of `gradient`.

    `weight` (positions, units), `touching` the contacts forward and backward of that shape;
    `contacts`: table, pin and disc of each contact, axes; `slopes`: the standardised errors of unit
    (3, units), discs (discs, 17, units) and pins (3, pins, units) as `gradient.Slopes` packs them.
    """
    ahead, behind = touching
    rows, pins, disc_of, axes = contacts
    of_unit, of_discs, of_pins = slopes
    for a in range(weight.shape[0]):
        for u in range(weight.shape[1]):
            w = weight[a, u]
            if w == 0.0:
                continue
            for flank in range(2):
                sw = w if flank == 0 else -w
                i = ahead[a, u] if flank == 0 else behind[a, u]
                j, d = pins[i], disc_of[i]
                row, axis, z = rows[i], axes[a, d], of_discs[d, :, u]
                ex, ey, dx, dy, cx, cy = axis[0], axis[1], axis[2], axis[3], axis[4], axis[5]
                lever, nx, ny = row[1], row[4], row[5]
                total[0] += sw * row[2] * of_unit[0, u]
                total[1] += sw * row[3] * of_pins[0, j, u]
                total[2] += sw * lever * of_pins[1, j, u]
                total[3] -= sw * lever * of_pins[2, j, u]
                px, py = z[2] * dx - z[3] * dy, z[2] * dy + z[3] * dx
                total[4] += sw * (row[6] * px + row[7] * py)
                rx, ry = z[4] * dx - z[5] * dy, z[4] * dy + z[5] * dx
                total[5] -= sw * (nx * rx + ny * ry)
                total[6] -= sw * (nx * ex + ny * ey) * z[6]
                total[6] += sw * (z[7] * cy + z[8] * cx)
                total[7] += sw * lever * z[0]
                total[8] -= sw * row[2] * z[1]
                total[9] += w * z[9]
                total[10] += sw * (nx * of_unit[1, u] + ny * of_unit[2, u])
                bx, by = z[10] * dx - z[11] * dy, z[10] * dy + z[11] * dx
                total[11] += sw * (nx * bx + ny * by) - sw * z[12]
                total[12] -= sw * (ex * ny - ey * nx) * z[13]
                total[12] += sw * (z[14] * cy + z[15] * cx)
                total[13] -= sw * z[16]
                total[14] += sw * lever
                total[15] += sw * row[8]
