"""What the compiled kernel of populations computes, by arrays in double precision, slowly.

The functions have the names, arguments and effects of those of `population.kernel`; balances are
those of the loaded contact (`contact.geometry.Mesh`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from tolevo.models.rv_reducer.contact.geometry import Gaps, Mesh
from tolevo.models.rv_reducer.population import kernel
from tolevo.units import ARCMIN

FLANKS = np.array([1.0, -1.0])
TINY = 1e-20
NO_TORQUE = 1e-9
"""Torque of a disc [N m] that counts as none."""


@contextmanager
def by_arrays() -> Iterator[None]:
    """The population's kernel is replaced by this module."""
    with pytest.MonkeyPatch.context() as patch:
        for function in (touch, touch_slopes, balances, balance_slopes, add_friction):
            patch.setattr(kernel, function.__name__, function)
        yield


def along(direction: Any, vector: Any) -> Any:
    """The scalar product of two plane vectors as complex numbers."""
    return np.real(vector * np.conj(direction))


class Position:
    """Contacts of one position: their rows, pins, discs and flanks (1 forward, -1 backward)."""

    def __init__(self, contacts: Any, a: int) -> None:
        rows, pins, teeth, start, stop, axes = contacts
        self.first, last = int(start[a, 0, 0]), int(stop[a, -1, -1])
        self.rows, self.pins = rows[self.first : last].astype(float), pins[self.first : last]
        self.teeth = teeth[self.first : last]
        self.disc = np.repeat(np.arange(start.shape[1]), (stop[a, :, 1] - start[a, :, 0]))
        self.sign = np.concatenate([np.repeat(FLANKS, count) for count in stop[a] - start[a]])
        self.axes = axes[a].astype(float)

    def gaps(self, errors: Any) -> tuple[Any, Any, Any]:
        """Turns to contact (contacts, n), play and forward turn (discs, n) [arcmin]."""
        across, pin_along, discs, circle = (one.astype(float) for one in errors)
        e, disc, crank = (self.axes[:, k] + 1j * self.axes[:, k + 1] for k in (0, 2, 4))
        turning, offset, around, pitch = (discs[:, k] + 1j * discs[:, k + 1] for k in (4, 6, 8, 10))
        centre = turning * e[:, None] + offset * disc[:, None]
        away, turned = circle[0] + 1j * circle[1] - centre, pitch * disc[:, None]
        ahead = discs[:, 3] - np.imag(around * crank[:, None])
        gap, lever, radial, tangential, nx, ny, c, s, _ = (column[:, None] for column in self.rows.T)
        d = self.disc
        placed = pin_along[self.pins] + (pin_along[self.teeth] if len(self.teeth) else 0.0)
        turns = gap + lever * (across[self.pins] + discs[d, 0]) + radial * discs[d, 1]
        turns += tangential * placed + along(nx + 1j * ny, away[d]) + along(c + 1j * s, turned[d])
        return turns, discs[:, 2], ahead

    def closed(self, gaps: Any, x: Any) -> Any:
        """Turn beyond each contact of discs turned by x (discs, n), 0 where the contact is open."""
        beyond = x[self.disc] - gaps
        return np.where(self.sign[:, None] * beyond > 0.0, beyond, 0.0)

    def by_disc(self, of_contacts: Any) -> Any:
        """Sums (discs, ...) over the contacts of each disc."""
        return np.stack([of_contacts[self.disc == d].sum(axis=0) for d in range(len(self.axes))])


def touch(contacts: Any, errors: Any, seats: Any, turns: Any) -> None:
    """As `kernel.touch`."""
    high, low, ahead, behind = turns
    for a in range(len(high)):
        position = Position(contacts, a)
        gaps, play, turn = position.gaps(errors)
        made = position.sign[:, None] * (gaps - turn[position.disc]) + play[position.disc]
        for sign, into, contact in ((1.0, high, ahead), (-1.0, low, behind)):
            of_flank = np.where(position.sign[:, None] == sign, made, np.inf)
            contact[a], into[a] = position.first + of_flank.argmin(axis=0), sign * of_flank.min(axis=0)


def touch_slopes(weights: Any, touching: Any, contacts: Any, slopes: Any, total: Any) -> None:
    """As `kernel.touch_slopes`."""
    rows, pins, teeth, disc_of, axes = contacts
    discs = axes.shape[1]
    for a in range(len(axes)):
        for contact, sign, weight in zip(touching, FLANKS, weights, strict=True):
            part = np.unique(contact[a])
            of_contact = sign * weight[a].astype(float) * (part[:, None] == contact[a])
            side = np.full((discs, weight.shape[1]), sign)
            spaces = teeth[part] if len(teeth) else teeth
            add(of_contact, rows[part].astype(float), pins[part], spaces, disc_of[part], axes[a], side, slopes, total)


def balances(contacts: Any, springs: Any, errors: Any, torques: Any, rated: int, into: Any) -> None:
    """As `kernel.balances`."""
    stiff, force, _, behind, _ = springs
    turn, x, side, preload, peak, where, which = into
    for a in range(len(contacts[3])):
        position = Position(contacts, a)
        part = slice(position.first, position.first + len(position.rows))
        k, of_force = stiff[part].astype(float), force[part].astype(float)
        mesh, gaps = mesh_of(position, errors, k / of_force, of_force, float(behind))
        for case, torque in enumerate(torques):
            rotation = mesh.rotation(float(torque))
            turn[case, a] = rotation[:, 0] / ARCMIN
            pressed, turned = mesh.pressed(rotation)
            x[case, a] = turned[:, 0].T / ARCMIN
            side[case, a] = np.where(np.abs(pressed[:, 0].T) > NO_TORQUE, np.sign(pressed[:, 0].T), 0.0)
            closed = position.closed(gaps, turned[:, 0].T / ARCMIN)
            if torque == 0.0:
                preload[a] = np.sum((k * (position.sign > 0.0))[:, None] * closed, axis=0)
            if case == rated:
                forces = of_force[:, None] * closed
                higher = forces.max(axis=0) > peak
                which[higher] = position.first + forces.argmax(axis=0)[higher]
                where[higher], peak[higher] = a, forces.max(axis=0)[higher]


def add_friction(contacts: Any, springs: Any, errors: Any, x: Any, into: Any) -> None:
    """As `kernel.add_friction`."""
    for a in range(len(contacts[3])):
        position = Position(contacts, a)
        part = slice(position.first, position.first + len(position.rows))
        closed = position.closed(position.gaps(errors)[0], x[a].astype(float))
        into[a] += springs[4][part].astype(float) @ closed


def mesh_of(position: Position, errors: Any, arm: Any, force: Any, behind: float) -> tuple[Mesh, Any]:
    """The mesh at a position, whose other pins have no lever arm, and its gaps [arcmin]."""
    gaps, play, turn = position.gaps(errors)
    discs = len(play)
    lever = np.zeros((1, discs, int(position.pins.max()) + 1))
    lever[0, position.disc, position.pins] = arm
    gap = np.ones((gaps.shape[1], *lever.shape))
    gap[:, 0, position.disc, position.pins] = gaps.T * arm * ARCMIN
    turned, free = (angles.T[:, None] * ARCMIN for angles in (turn, play))
    stiffness = np.full((1, 1, 1, 1), force[0] / arm[0] / ARCMIN)
    return Mesh.of(Gaps(gap, lever, turned, free), 1.0, stiffness, np.full((1, 1, discs), behind * ARCMIN)), gaps


def balance_slopes(
    weights: Any, contacts: Any, springs: Any, errors: Any, balance: Any, slopes: Any, total: Any
) -> None:
    """As `kernel.balance_slopes`."""
    of_turn, of_preload, of_peak, of_friction = (one.astype(float) for one in weights)
    stiff, force, lean, behind, friction = (np.asarray(one, dtype=float) for one in springs)
    x, side, which = balance
    for a in range(len(of_turn)):
        position = Position(contacts, a)
        part = np.arange(position.first, position.first + len(position.rows))
        closed = position.closed(position.gaps(errors)[0], x[a].astype(float))
        bears = stiff[part, None] * (closed != 0.0)
        squeezed = bears * of_preload[a] * (position.sign > 0.0)[:, None]
        direct = force[part, None] * of_peak[a] * (part[:, None] == which)
        direct = direct + friction[part, None] * of_friction[a] * (closed != 0.0)
        rise, fixed = position.by_disc(bears), position.by_disc(squeezed + direct)
        bent = (side[a] != 0) / (1.0 + behind * rise)
        common = (of_turn[a] + np.sum(bent * fixed, axis=0)) / np.maximum(np.sum(bent * rise, axis=0), TINY)
        factor = np.where(side[a] != 0, bent * (common + behind * fixed), fixed / np.maximum(rise, TINY))
        through = factor[position.disc] * bears - squeezed
        total[15] -= np.sum(lean[part, None] * closed * (2.0 * through - direct))
        pins, teeth, axes = position.pins, position.teeth, contacts[5][a]
        add(through - direct, position.rows, pins, teeth, position.disc, axes, side[a], slopes, total)


def add(
    weight: Any, rows: Any, pins: Any, teeth: Any, disc: Any, axes: Any, side: Any, slopes: Any, total: Any
) -> None:
    """Adds weights of contacts (contacts, n) times the errors of pins, discs and unit to `total`."""
    of_unit, of_discs, of_pins = (one.astype(float) for one in slopes)
    placed, hole, radius = (one[pins] * weight for one in of_pins)
    total[1] += np.sum(rows[:, 3:4] * placed)
    total[4] += np.sum(rows[:, 3:4] * of_pins[0][teeth] * weight) if len(teeth) else 0.0
    total[2] += np.sum(rows[:, 1:2] * hole)
    total[3] -= np.sum(rows[:, 1:2] * radius)
    total[15] += np.sum(rows[:, 8:9] * weight)
    for d, z in enumerate(of_discs):
        chosen = disc == d
        all_of, (lever, radial, nx, ny, c, s) = (
            weight[chosen].sum(axis=0),
            rows[chosen, 1:8].T[[0, 1, 3, 4, 5, 6]] @ weight[chosen],
        )
        eccentric, own, crank = (axes[d, k].astype(float) + 1j * axes[d, k + 1].astype(float) for k in (0, 2, 4))
        normal, direction = nx + 1j * ny, c + 1j * s
        parts = {
            0: radial * of_unit[0],
            4: along(direction, (z[2] + 1j * z[3]) * own),
            5: -along(normal, (z[4] + 1j * z[5]) * own),
            6: all_of * np.imag((z[7] + 1j * z[8]) * crank) - along(normal, eccentric * z[6]),
            7: lever * z[0],
            8: -radial * z[1],
            9: all_of * side[d] * z[9],
            10: along(normal, of_unit[1] + 1j * of_unit[2]),
            11: along(normal, (z[10] + 1j * z[11]) * own) - all_of * z[12],
            12: all_of * np.imag((z[14] + 1j * z[15]) * crank) - along(normal, 1j * eccentric * z[13]),
            13: -all_of * z[16],
            14: lever,
        }  # fmt: skip
        for name, part in parts.items():
            total[name] += float(np.sum(part))
