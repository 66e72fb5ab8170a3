"""First contact of many units by array operations, where numba is not installed.

The same formulas as `compiled`: at each position, disc and flank all contacts of all units at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ....section import Single

BLOCK = 512
"""Units in one block."""


def _disc(axes: Single, disc: Single, circle: Single) -> tuple[Single, Single, Single]:
    """Terms of the gap (7, n), play and forward turn (n,) of one disc at one position."""
    ex, ey, dx, dy, cx, cy = axes
    turning, offset = disc[4] + 1j * disc[5], disc[6] + 1j * disc[7]
    around, pitch = disc[8] + 1j * disc[9], disc[10] + 1j * disc[11]
    centre = turning * (ex + 1j * ey) + offset * (dx + 1j * dy)
    turned = pitch * (dx + 1j * dy)
    away = circle[0] + 1j * circle[1] - centre
    terms = np.stack([np.ones_like(disc[0]), disc[0], disc[1], away.real, away.imag, turned.real, turned.imag]).astype(
        np.float32
    )
    ahead = disc[3] - np.imag(around * (cx + 1j * cy))
    return terms, disc[2], ahead.astype(np.float32)


def touch(contacts: Any, errors: Any, turns: Any) -> None:
    """As `compiled.touch`."""
    rows, pins, start, stop, axes = contacts
    across, along, discs, circle = errors
    high, low, ahead, behind = turns
    columns = [0, 1, 2, 4, 5, 6, 7]
    for first in range(0, across.shape[1], BLOCK):
        part = slice(first, first + BLOCK)
        pin_across, pin_along = across[:, part], along[:, part]
        for a in range(start.shape[0]):
            ends: list[list[tuple[Any, Any]]] = [[], []]
            for d in range(start.shape[1]):
                terms, play, turn = _disc(axes[a, d], discs[d][:, part], circle[:, part])
                for flank, sign in ((0, 1.0), (1, -1.0)):
                    i, k = start[a, d, flank], stop[a, d, flank]
                    contacts, pin = rows[i:k], pins[i:k]
                    h = contacts[:, columns] @ terms
                    h += contacts[:, 1:2] * pin_across[pin] + contacts[:, 3:4] * pin_along[pin]
                    closest = np.argmin(sign * h, axis=0)
                    at = np.take_along_axis(h, closest[None, :], axis=0)[0]
                    ends[flank].append((at + sign * play - turn, i + closest))
            for flank, into, contact in ((0, high, ahead), (1, low, behind)):
                by_disc = np.stack([turns_of_disc for turns_of_disc, _ in ends[flank]])
                best = np.argmin(by_disc, axis=0) if flank == 0 else np.argmax(by_disc, axis=0)
                chosen = np.stack([contacts_of_disc for _, contacts_of_disc in ends[flank]])
                into[a, part] = np.take_along_axis(by_disc, best[None, :], axis=0)[0]
                contact[a, part] = np.take_along_axis(chosen, best[None, :], axis=0)[0]


def pull_back(weight: Single, touching: Any, contacts: Any, slopes: Any, total: Any) -> None:
    """As `compiled.pull_back`."""
    ahead, behind = touching
    rows, pins, disc_of, axes = contacts
    of_unit, of_discs, of_pins = slopes
    a, u = np.nonzero(weight)
    w = weight[a, u]
    for contact, sign in ((ahead[a, u], 1.0), (behind[a, u], -1.0)):
        d, sw, row = disc_of[contact], sign * w, rows[contact].T
        z, pin = of_discs[d, :, u].T, of_pins[:, pins[contact], u]
        ex, ey, dx, dy, cx, cy = axes[a, d].T
        eccentric, disc, crank = ex + 1j * ey, dx + 1j * dy, cx + 1j * cy
        normal, direction = row[4] + 1j * row[5], row[6] + 1j * row[7]
        parts = [
            sw * row[2] * of_unit[0, u],
            sw * row[3] * pin[0],
            sw * row[1] * pin[1],
            -sw * row[1] * pin[2],
            sw * along_direction(direction, (z[2] + 1j * z[3]) * disc),
            -sw * along_direction(normal, (z[4] + 1j * z[5]) * disc),
            sw * (np.imag((z[7] + 1j * z[8]) * crank) - along_direction(normal, eccentric * z[6])),
            sw * row[1] * z[0],
            -sw * row[2] * z[1],
            w * z[9],
            sw * along_direction(normal, of_unit[1, u] + 1j * of_unit[2, u]),
            sw * (along_direction(normal, (z[10] + 1j * z[11]) * disc) - z[12]),
            sw * (np.imag((z[14] + 1j * z[15]) * crank) - along_direction(normal, 1j * eccentric * z[13])),
            -sw * z[16],
            sw * row[1],
            sw * row[8],
        ]
        total += [float(np.sum(part, dtype=np.float64)) for part in parts]


def along_direction(direction: Any, vector: Any) -> Any:
    """The scalar product of two plane vectors as complex numbers."""
    return np.real(vector * np.conj(direction))
