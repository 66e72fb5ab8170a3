"""Balances of torque of many units, and their derivatives, by arrays where numba is not installed.

Balances are those of `contact.mesh`, a position at a time; the derivatives are the formulas of
`elastic_pull_back`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....section import Array, Single
from ....units import ARCMIN
from ..contact.geometry import Gaps, Mesh
from .arrays import along_direction

BLOCK = 256
"""Units in one block, so that they stay in the cache."""
_TINY = 1e-20
_NONE = 1e-9
"""Torque of a disc [N m] that counts as none."""


def _terms(axes: Single, disc: Single, circle: Single) -> tuple[Array, Array, Array]:
    """Terms of the gaps (7, n), play and forward turn (n,) of one disc at one position."""
    ex, ey, dx, dy, cx, cy = axes.astype(float)
    errors = disc.astype(float)
    turning, offset = errors[4] + 1j * errors[5], errors[6] + 1j * errors[7]
    around, pitch = errors[8] + 1j * errors[9], errors[10] + 1j * errors[11]
    away = circle[0] + 1j * circle[1] - turning * (ex + 1j * ey) - offset * (dx + 1j * dy)
    turned = pitch * (dx + 1j * dy)
    terms = np.stack([np.ones_like(errors[0]), errors[0], errors[1], away.real, away.imag, turned.real, turned.imag])
    return terms, errors[2], np.asarray(errors[3] - np.imag(around * (cx + 1j * cy)))


class _Position:
    """The contacts of one position: their disc, and the gaps (contacts, n) of some units."""

    def __init__(self, rows: Single, pins: Any, start: Any, stop: Any) -> None:
        self.part = slice(int(start[0, 0]), int(stop[-1, -1]))
        self.rows, self.pins = rows[self.part], pins[self.part]
        self.disc = np.repeat(np.arange(len(start)), (stop[:, 1] - start[:, 0]))
        forward = [np.repeat([1.0, -1.0], count) for count in stop - start]
        self.sign = np.concatenate(forward)

    def gaps(
        self, axes: Single, across: Single, along: Single, discs: Single, circle: Single
    ) -> tuple[Array, Array, Array]:
        """Gaps (contacts, n), play and forward turn (discs, n) [arcmin]."""
        of_discs = [_terms(axis, disc, circle) for axis, disc in zip(axes, discs, strict=True)]
        gap, play, turn = (np.stack(part) for part in zip(*of_discs, strict=True))
        rows = self.rows.astype(float)
        turns = np.empty((len(rows), across.shape[1]))
        for d in range(len(discs)):
            turns[self.disc == d] = rows[self.disc == d][:, [0, 1, 2, 4, 5, 6, 7]] @ gap[d]
        turns += rows[:, 1:2] * across[self.pins] + rows[:, 3:4] * along[self.pins]
        return turns, play, turn

    def closed(self, gaps: Array, x: Array) -> Array:
        """Turn beyond each contact of discs turned by x (discs, n), 0 where the contact is open."""
        beyond = x[self.disc] - gaps
        return np.where(self.sign[:, None] * beyond > 0.0, beyond, 0.0)

    def by_disc(self, of_contacts: Array, discs: int) -> Array:
        """Sums (discs, ...) over the contacts of each disc."""
        return np.stack([of_contacts[self.disc == d].sum(axis=0) for d in range(discs)])


def balances(contacts: Any, springs: Any, errors: Any, torques: Any, rated: int, into: Any) -> None:
    """As `elastic_compiled.balances`."""
    rows, pins, start, stop, axes = contacts
    stiff, force, _, behind = springs
    across, along, discs, circle = errors
    turn, x, side, preload, peak, where, which = into
    for a in range(len(start)):
        position = _Position(rows, pins, start[a], stop[a])
        k, of_force = stiff[position.part].astype(float), force[position.part].astype(float)
        for first in range(0, across.shape[1], BLOCK):
            u = slice(first, first + BLOCK)
            gaps, play, ahead = position.gaps(axes[a], across[:, u], along[:, u], discs[:, :, u], circle[:, u])
            mesh = _mesh(position, gaps, play, ahead, k / of_force, of_force, float(behind))
            for case, torque in enumerate(torques):
                rotation = mesh.rotation(float(torque))
                turn[case, a, u] = rotation[:, 0] / ARCMIN
                place, side[case, a, :, u] = _discs(mesh, rotation)
                x[case, a, :, u] = place
                closed = position.closed(gaps, place)
                if torque == 0.0:
                    preload[a, u] = np.sum((k * (position.sign > 0.0))[:, None] * closed, axis=0)
                if case == rated:
                    forces = of_force[:, None] * closed
                    most = forces.max(axis=0)
                    higher = most > peak[u]
                    which[u] = np.where(higher, position.part.start + forces.argmax(axis=0), which[u])
                    where[u] = np.where(higher, a, where[u])
                    peak[u] = np.where(higher, most, peak[u])


def _mesh(position: _Position, gaps: Array, play: Array, turn: Array, arm: Array, force: Array, behind: float) -> Mesh:
    """The mesh at one position; pins that are not contacts of the lattice have no lever arm."""
    n, discs = gaps.shape[1], len(play)
    lever = np.zeros((1, discs, int(position.pins.max()) + 1))
    lever[0, position.disc, position.pins] = arm
    gap = np.ones((n, *lever.shape))
    gap[:, 0, position.disc, position.pins] = gaps.T * arm * ARCMIN
    turned, free = (angles.T[:, None] * ARCMIN for angles in (turn, play))
    stiffness = np.full((1, 1, 1, 1), force[0] / arm[0] / ARCMIN)
    return Mesh.of(Gaps(gap, lever, turned, free), 1.0, stiffness, np.full((1, 1, discs), behind * ARCMIN))


def _discs(mesh: Mesh, rotation: Array) -> tuple[Array, NDArray[np.int8]]:
    """Turns of the discs [arcmin] after play and springs, and the flank that bears, (discs, n)."""
    torque, turned = mesh.pressed(rotation)
    bears = np.where(np.abs(torque[:, 0].T) > _NONE, np.sign(torque[:, 0].T), 0.0)
    return turned[:, 0].T / ARCMIN, bears.astype(np.int8)


def pull_back(weights: Any, contacts: Any, springs: Any, errors: Any, balance: Any, slopes: Any, total: Any) -> None:
    """As `elastic_pull_back.pull_back`."""
    of_turn, of_preload, of_peak = weights
    rows, pins, start, stop, axes = contacts
    stiff, force, lean, behind = springs
    across, along, discs, circle = errors
    x, side, which = balance
    of_unit, of_discs, of_pins = slopes
    for a in range(len(start)):
        u = np.flatnonzero((of_turn[a] != 0) | (of_preload[a] != 0) | (of_peak[a] != 0))
        position = _Position(rows, pins, start[a], stop[a])
        table = rows[position.part].astype(float)
        gaps, _, _ = position.gaps(axes[a], across[:, u], along[:, u], discs[:, :, u], circle[:, u])
        closed = position.closed(gaps, x[a][:, u].astype(float))
        bears = stiff[position.part, None] * (closed != 0.0)
        squeezed = bears * of_preload[a, u] * (position.sign > 0.0)[:, None]
        star = np.arange(position.part.start, position.part.stop)[:, None] == which[u]
        direct = force[position.part, None] * of_peak[a, u] * star
        many, toward = len(discs), side[a][:, u]
        factor = _factors(
            position.by_disc(bears, many),
            position.by_disc(squeezed + direct, many),
            toward,
            float(behind),
            of_turn[a, u],
        )
        through = factor[position.disc] * bears - squeezed
        weight = through - direct
        lean_of = lean[position.part, None] * closed * (2.0 * through - direct)
        total[15] += np.sum(table[:, 8:9] * weight - lean_of)
        placed, hole, radius = (of_pins[k][position.pins][:, u] * weight for k in range(3))
        total[1] += np.sum(table[:, 3:4] * placed)
        total[2] += np.sum(table[:, 1:2] * hole)
        total[3] -= np.sum(table[:, 1:2] * radius)
        for d in range(many):
            of_disc = position.disc == d
            sums = np.stack(
                [weight[of_disc].sum(axis=0), *(table[of_disc, k] @ weight[of_disc] for k in (1, 2, 4, 5, 6, 7))]
            )
            _add_disc(sums, axes[a, d], of_discs[d][:, u], of_unit[:, u], toward[d], total)


def _factors(rise: Array, fixed: Array, side: Any, behind: float, of_turn: Single) -> Array:
    """Factors by which a contact's stiffness gives its weight through the balance."""
    loaded = side != 0
    bent = loaded / (1.0 + behind * rise)
    common = (of_turn + np.sum(bent * fixed, axis=0)) / np.maximum(np.sum(bent * rise, axis=0), _TINY)
    alone = fixed / np.maximum(rise, _TINY)
    return np.where(loaded, bent * (common + behind * fixed), alone)


def _add_disc(sums: Array, axes: Single, z: Single, unit: Single, side: Any, total: Any) -> None:
    """Adds to `total` the weights of one disc (7, n) times the errors of disc and unit."""
    ex, ey, dx, dy, cx, cy = axes.astype(float)
    eccentric, disc, crank = ex + 1j * ey, dx + 1j * dy, cx + 1j * cy
    weight, lever, radial = sums[:3]
    normal, direction = sums[3] + 1j * sums[4], sums[5] + 1j * sums[6]
    parts = {
        0: radial * unit[0],
        4: along_direction(direction, (z[2] + 1j * z[3]) * disc),
        5: -along_direction(normal, (z[4] + 1j * z[5]) * disc),
        6: weight * np.imag((z[7] + 1j * z[8]) * crank) - along_direction(normal, eccentric * z[6]),
        7: lever * z[0],
        8: -radial * z[1],
        9: weight * side * z[9],
        10: along_direction(normal, unit[1] + 1j * unit[2]),
        11: along_direction(normal, (z[10] + 1j * z[11]) * disc) - weight * z[12],
        12: weight * np.imag((z[14] + 1j * z[15]) * crank) - along_direction(normal, 1j * eccentric * z[13]),
        13: -weight * z[16],
        14: lever,
    }
    for name, part in parts.items():
        total[name] += float(np.sum(part, dtype=np.float64))
