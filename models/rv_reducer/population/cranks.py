"""Discs on all of their cranks at once: play that wrong distances of the cranks take up, and bearings that jam.

A crank holds a disc by a bearing that is open by its clearance c and then presses by a linear stiffness. With q_k the
place of journal k less that of its bore, in axes along and across the crank's line, zeta the displacement of the disc
and s the turn (at the crank circle) by which it lags behind, journal k stands off by

    rho_k = q_k - zeta exp(-2 pi i k/K) - i s (forward flank; + i s backward),

and the disc rests where sum (|rho_k| - c_k/2)_+^2 / 2 - t s is least, t the torque over crank circle and stiffness.
That is convex with three unknowns, and Newton's method solves it for many units side by side. Two cranks without
torque leave the turn sqrt(c^2 - d^2)/(2 a_0) to either side, d the error of their distance and c the mean clearance;
from d = c on they jam with (d - c)/2 of squeeze in either bearing.

Lengths are micrometres. numba is imported with this module alone, where discs are coupled, and its functions are all
here because its cache does not see changes of other files.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from ....section import Array, Single
from ....units import ARCMIN, UM
from ..contact.geometry import ContactGeometry
from .contact import NAMES, PLAY, Slopes, Touch
from .errors import Lattice, Table, crank_lines
from .units import BaseSample, Coupling

LANES = 256
"""Units in one block, so that they stay in the cache."""
STEPS = 8
"""Steps of Newton's method, and one for each crank: then units rest within 1e-5 um."""
HALVED = 7
"""The step that is halved, lest two bearings take turns in pressing."""
STIFFENED = np.float32(1e-3)
"""Stiffness, in those of a bearing, that is added to every step, where a disc is free."""
FARTHEST = np.float32(2.0)
"""Longest step [um]."""
COLUMNS = ("eccentricity", "crank_phase", "bore_radial", "bore_tangential", "crank_bearing")
HOLE = ("crank_hole_radial", "crank_hole_tangential")
"""Errors of a crank at a disc, then of its hole in the carrier: the columns of `standardised`."""


def standardised(geometry: ContactGeometry, sample: BaseSample) -> Single:
    """What zones of 1 make of the cranks: (discs, cranks, 7, n), micrometres."""
    z, shape = sample.z, sample.z["bore_radial"].shape
    ahead = 1e-3 * geometry.nominal.eccentricity / UM  # um per mrad
    size = {"crank_phase": ahead * z["crank_phase"], "crank_bearing": 0.5 * (1.0 + z["crank_bearing"])}
    of_discs = [size.get(name, z[name]) for name in COLUMNS]
    columns = [*of_discs, *(np.broadcast_to(z[name][:, None], shape) for name in HOLE)]
    return np.ascontiguousarray(np.moveaxis(np.stack(columns), (0, 1), (2, 1)), dtype=np.float32)


def scaled(of_cranks: Single, size: Mapping[str, float]) -> Single:
    """The cranks of zones, or mid-limits, of `size` by name of the error."""
    names = [name.removesuffix("_radial").removesuffix("_tangential") for name in (*COLUMNS, *HOLE)]
    return of_cranks * np.array([size.get(name, 0.0) for name in names], np.float32)[:, None]


@dataclass(frozen=True, slots=True, eq=False)
class Seats:
    """Where n units rest on their cranks.

    `cranks` (discs, cranks, 7, n) are their errors; `places` (positions, discs, 2, 3, n), forward and backward: x and y
    of the disc's displacement in the housing [um], and the turn [arcmin] to the flank that the bearings leave, without
    the wind-up of bearings at true distances.
    """

    lattice: Lattice
    coupling: Coupling
    cranks: Single
    places: Single

    @classmethod
    def of(cls, lattice: Lattice, coupling: Coupling, cranks: Single) -> Seats:
        """The seats of cranks with these errors at all positions."""
        places = np.empty((*lattice.shape, 2, 3, cranks.shape[-1]), np.float32)
        found = cls(lattice, coupling, cranks, places)
        _seats(lattice.directions, cranks, *found._constants, places)
        return found

    @property
    def _constants(self) -> tuple[Single, np.float32, np.float32]:
        """Lines of the cranks (cranks, 2), the pull t [um], and the turn [arcmin] of 1 um at the crank circle."""
        geometry = self.lattice.geometry
        lines, circle = crank_lines(geometry).conj().ravel(), geometry.nominal.centre_distance
        pull = self.coupling.torque / (circle * self.coupling.stiffness * UM)
        turn = geometry.play_factor * UM / circle / ARCMIN
        return np.stack([lines.real, lines.imag], axis=1).astype(np.float32), np.float32(pull), np.float32(turn)

    def slopes(self, weight: Array, touch: Touch, table: Table, errors: Slopes) -> Array:
        """What the seats change in the derivatives (names,) of sum(weight y) by `contact.NAMES`.

        `weight` and the contacts of `touch` are (positions, units).
        """
        mesh, total = (table.values, self.lattice.disc, self.lattice.directions), np.zeros(len(NAMES))
        _seat_slopes(
            np.ascontiguousarray(weight, np.float32),
            (touch.ahead, touch.behind),
            mesh,
            self.cranks,
            *self._constants,
            self.places,
            errors.of_cranks,
            errors.of_discs[:, PLAY],
            total,
        )
        return np.asarray(total / self.lattice.geometry.output_ratio)


@dataclass(frozen=True, slots=True, eq=False)
class Jam:
    """The largest `force` [N] on a crank bearing over the turn (n,), without torque and without pins.

    `place` (3, n): at which position, disc and crank; `rest` (3, n) [um] is where that disc rests.
    """

    seats: Seats
    force: Array
    place: NDArray[np.int32]
    rest: Single

    @classmethod
    def of(cls, seats: Seats) -> Jam:
        """The jam of units in their seats."""
        units = seats.cranks.shape[-1]
        most, place, rest = (
            np.zeros(units, np.float32),
            np.zeros((3, units), np.int32),
            np.zeros((3, units), np.float32),
        )
        _jam(seats.lattice.directions, seats.cranks, seats._constants[0], most, place, rest)
        return cls(seats, most.astype(float) * seats.coupling.stiffness * UM, place, rest)

    def slopes(self, weight: Array, errors: Slopes) -> Array:
        """Derivatives (names,) of sum(weight force), weight (n,), by `contact.NAMES`."""
        total, seats = np.zeros(len(NAMES)), self.seats
        loaded = np.where(self.force > 0.0, weight, 0.0) * seats.coupling.stiffness * UM
        _jam_slopes(
            loaded,
            seats.lattice.directions,
            seats.cranks,
            seats._constants[0],
            self.place,
            self.rest,
            errors.of_cranks,
            total,
        )
        return total


def _compiled(function: Any) -> Any:
    return numba.njit(cache=True, error_model="numpy", fastmath=True, nogil=True)(function)


@_compiled
def _residuals(axis: Single, cranks: Single, lines: Single, q: Single) -> None:
    """Fills q (cranks, 2, lanes) of one disc, less the displacement and turn by the means of journals and bores, which
    gaps contain, and the turn by the means of the carrier's holes, which all discs have alike.
    """
    cx, cy, many = axis[4], axis[5], cranks.shape[0]
    part = np.float32(1.0 / many)
    for u in range(cranks.shape[2]):
        zr = zt = turned = np.float32(0.0)
        for k in range(many):
            lc, ls = lines[k, 0], lines[k, 1]
            a, b = cx * lc + cy * ls, cy * lc - cx * ls
            x = cranks[k, 0, u] * a - cranks[k, 1, u] * b - cranks[k, 2, u]
            y = cranks[k, 0, u] * b + cranks[k, 1, u] * a - cranks[k, 3, u]
            zr += part * (x * lc - y * ls)
            zt += part * (x * ls + y * lc)
            turned += part * (y + cranks[k, 6, u])
            q[k, 0, u], q[k, 1, u] = x + cranks[k, 5, u], y + cranks[k, 6, u]
        for k in range(many):
            lc, ls = lines[k, 0], lines[k, 1]
            q[k, 0, u] -= zr * lc + zt * ls
            q[k, 1, u] -= zt * lc - zr * ls + turned


@_compiled
def _rest(q: Single, cranks: Single, lines: Single, sign: float, pull: float, v: Single, work: Single) -> None:
    """Moves v (3, lanes), displacement along and across the first line and lag, to where discs rest."""
    zero, unity, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    for step in range(1, STEPS + q.shape[0] + 1):
        most = half if step == HALVED else unity
        work[:] = zero
        for k in range(q.shape[0]):
            lc, ls = lines[k, 0], lines[k, 1]
            for u in range(v.shape[1]):
                x = q[k, 0, u] - (v[0, u] * lc + v[1, u] * ls)
                y = q[k, 1, u] - (v[1, u] * lc - v[0, u] * ls) - sign * v[2, u]
                away = np.sqrt(x * x + y * y) + np.float32(1e-9)
                pressed = max(away - half * cranks[k, 4, u], zero)
                nx, ny, across = x / away, y / away, pressed / away
                along = (unity if pressed > zero else zero) - across
                hxx, hxy, hyy = across + along * nx * nx, along * nx * ny, across + along * ny * ny
                gx, gy = pressed * nx, pressed * ny
                ax, ay = ls * hxy - lc * hxx, ls * hyy - lc * hxy
                bx, by = -ls * hxx - lc * hxy, -ls * hxy - lc * hyy
                work[0, u] += lc * gx - ls * gy
                work[1, u] += ls * gx + lc * gy
                work[2, u] += sign * gy
                work[3, u] += ls * ay - lc * ax
                work[4, u] -= ls * ax + lc * ay
                work[5, u] -= sign * ay
                work[6, u] -= ls * bx + lc * by
                work[7, u] -= sign * by
                work[8, u] += hyy
        for u in range(v.shape[1]):
            a, b, c = work[3, u] + STIFFENED, work[4, u], work[5, u]
            d, e, f = work[6, u] + STIFFENED, work[7, u], work[8, u] + STIFFENED
            g0, g1, g2 = work[0, u], work[1, u], work[2, u] + pull
            m0, m1, m2 = d * f - e * e, c * e - b * f, b * e - c * d
            inverse = unity / (a * m0 + b * m1 + c * m2)
            s0 = (m0 * g0 + m1 * g1 + m2 * g2) * inverse
            s1 = (m1 * g0 + (a * f - c * c) * g1 + (b * c - a * e) * g2) * inverse
            s2 = (m2 * g0 + (b * c - a * e) * g1 + (a * d - b * b) * g2) * inverse
            part = most * FARTHEST / max(FARTHEST, max(abs(s0), max(abs(s1), abs(s2))))
            v[0, u] += part * s0
            v[1, u] += part * s1
            v[2, u] += part * s2


@_compiled
def _seats(axes: Single, cranks: Single, lines: Single, pull: Any, turn: Any, into: Single) -> None:
    """Fills `into`, the places of `Seats`, at all positions (positions, discs, 6)."""
    many, units = cranks.shape[1], cranks.shape[3]
    part, half = np.float32(1.0 / many), np.float32(0.5 / many)
    for first in range(0, units, LANES):
        last = min(first + LANES, units)
        of_discs = cranks[:, :, :, first:last].copy()
        q, v = np.empty((many, 2, last - first), np.float32), np.empty((3, last - first), np.float32)
        work = np.empty((9, last - first), np.float32)
        for a in range(axes.shape[0]):
            for d in range(axes.shape[1]):
                axis = axes[a, d]
                _residuals(axis, of_discs[d], lines, q)
                cx = axis[0] * axis[4] + axis[1] * axis[5]
                cy = axis[1] * axis[4] - axis[0] * axis[5]
                for flank in range(2):
                    v[:2] = np.float32(0.0)
                    v[2] = part * pull
                    for k in range(many):
                        for u in range(last - first):
                            v[2, u] += half * of_discs[d, k, 4, u]
                    _rest(q, of_discs[d], lines, np.float32(1.0 - 2.0 * flank), pull, v, work)
                    for u in range(last - first):
                        into[a, d, flank, 0, first + u] = v[0, u] * cx - v[1, u] * cy
                        into[a, d, flank, 1, first + u] = v[0, u] * cy + v[1, u] * cx
                        into[a, d, flank, 2, first + u] = turn * (v[2, u] - part * pull)


@_compiled
def _responses(
    q: Single, cranks: Single, lines: Single, sign: float, v: Any, p: Any, by_place: Any, by_clearance: Any
) -> None:
    """Fills derivatives of p . v by places (cranks, 2) and clearances (cranks) of one unit that rests at v.

    The rest keeps J' F = t, with J the derivative of rho by v and A the stiffness of a bearing: dv = -H^-1 J' A dq.
    """
    a = d = f = 1e-6
    b = c = e = 0.0
    for k in range(q.shape[0]):
        lc, ls = lines[k, 0], lines[k, 1]
        x = q[k, 0] - (v[0] * lc + v[1] * ls)
        y = q[k, 1] - (v[1] * lc - v[0] * ls) - sign * v[2]
        away = np.sqrt(x * x + y * y) + 1e-9
        pressed = max(away - 0.5 * cranks[k, 4], 0.0)
        nx, ny, across = x / away, y / away, pressed / away
        along = (1.0 if pressed > 0.0 else 0.0) - across
        hxx, hxy, hyy = across + along * nx * nx, along * nx * ny, across + along * ny * ny
        ax, ay = ls * hxy - lc * hxx, ls * hyy - lc * hxy
        bx, by = -ls * hxx - lc * hxy, -ls * hxy - lc * hyy
        a, b, c = a + ls * ay - lc * ax, b - ls * ax - lc * ay, c - sign * ay
        d, e, f = d - ls * bx - lc * by, e - sign * by, f + hyy
    m0, m1, m2 = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * m0 + b * m1 + c * m2
    l0 = (m0 * p[0] + m1 * p[1] + m2 * p[2]) / determinant
    l1 = (m1 * p[0] + (a * f - c * c) * p[1] + (b * c - a * e) * p[2]) / determinant
    l2 = (m2 * p[0] + (b * c - a * e) * p[1] + (a * d - b * b) * p[2]) / determinant
    for k in range(q.shape[0]):
        lc, ls = lines[k, 0], lines[k, 1]
        x = q[k, 0] - (v[0] * lc + v[1] * ls)
        y = q[k, 1] - (v[1] * lc - v[0] * ls) - sign * v[2]
        away = np.sqrt(x * x + y * y) + 1e-9
        pressed = max(away - 0.5 * cranks[k, 4], 0.0)
        nx, ny, across = x / away, y / away, pressed / away
        bears = 1.0 if pressed > 0.0 else 0.0
        moved_x, moved_y = -(lc * l0 + ls * l1), ls * l0 - lc * l1 - sign * l2
        pushed = nx * moved_x + ny * moved_y
        by_place[k, 0] = -across * moved_x - (bears - across) * nx * pushed
        by_place[k, 1] = -across * moved_y - (bears - across) * ny * pushed
        by_clearance[k] = 0.5 * bears * pushed


@_compiled
def _add_cranks(
    w: float, axis: Single, lines: Single, z: Single, by_disc: Any, by_hole: Any, by_clearance: Any, total: Any
) -> None:
    """Adds w times derivatives by places of journals and bores, of holes, and by clearances to `total`; z (cranks, 7)."""
    for k in range(z.shape[0]):
        a = axis[4] * lines[k, 0] + axis[5] * lines[k, 1]
        b = axis[5] * lines[k, 0] - axis[4] * lines[k, 1]
        x, y = w * by_disc[k, 0], w * by_disc[k, 1]
        total[6] += (x * a + y * b) * z[k, 0]
        total[12] += (y * a - x * b) * z[k, 1]
        total[11] -= x * z[k, 2] + y * z[k, 3]
        total[9] += w * by_clearance[k] * z[k, 4]
        total[16] += w * (by_hole[k, 0] * z[k, 5] + by_hole[k, 1] * z[k, 6])


@_compiled
def _seat_slopes(
    weight: Single,
    touching: Any,
    mesh: Any,
    cranks: Single,
    lines: Single,
    pull: Any,
    turn: Any,
    places: Single,
    errors: Single,
    plain: Single,
    total: Any,
) -> None:
    """As `Seats.add_slopes` says: of sign h + play at each flank, h the gap of the displaced disc."""
    rows, disc_of, axes = mesh
    discs, many, units = cranks.shape[0], cranks.shape[1], cranks.shape[3]
    q = np.empty((discs, many, 2, units), np.float32)
    by_disc, by_hole, by_clearance = np.empty((many, 2)), np.empty((many, 2)), np.empty(many)
    p, v = np.empty(3), np.empty(3)
    for a in range(weight.shape[0]):
        for d in range(discs):
            _residuals(axes[a, d], cranks[d], lines, q[d])
        for u in range(units):
            w = weight[a, u]
            if w == 0.0:
                continue
            for flank in range(2):
                i = touching[flank][a, u]
                d, sign = disc_of[i], 1.0 - 2.0 * flank
                axis, row, seat = axes[a, d], rows[i], places[a, d, flank, :, u]
                cx = axis[0] * axis[4] + axis[1] * axis[5]
                cy = axis[1] * axis[4] - axis[0] * axis[5]
                v[0], v[1] = seat[0] * cx + seat[1] * cy, seat[1] * cx - seat[0] * cy
                v[2] = seat[2] / turn + pull / many
                p[0] = -sign * (row[4] * cx + row[5] * cy)
                p[1] = -sign * (row[5] * cx - row[4] * cy)
                p[2] = turn
                _responses(q[d, :, :, u], cranks[d, :, :, u], lines, sign, v, p, by_hole, by_clearance)
                for k in range(many):  # less the means that gaps contain
                    lc, ls = lines[k, 0], lines[k, 1]
                    by_hole[k, 1] -= sign * p[2] / many
                    by_disc[k, 0] = by_hole[k, 0] - (p[0] * lc + p[1] * ls) / many
                    by_disc[k, 1] = by_hole[k, 1] - (p[1] * lc - p[0] * ls) / many
                _add_cranks(w, axis, lines, errors[d, :, :, u], by_disc, by_hole, by_clearance, total)
                total[9] -= w * plain[d, u]


@_compiled
def _jam(axes: Single, cranks: Single, lines: Single, most: Single, place: Any, rest: Single) -> None:
    """Fills the squeeze [um] (n,) of the bearing that is squeezed most over the turn, its place, and the rest there."""
    many, units = cranks.shape[1], cranks.shape[3]
    zero, unity, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    for first in range(0, units, LANES):
        last = min(first + LANES, units)
        of_discs = cranks[:, :, :, first:last].copy()
        q, v = np.empty((many, 2, last - first), np.float32), np.empty((3, last - first), np.float32)
        work = np.empty((9, last - first), np.float32)
        for a in range(axes.shape[0]):
            for d in range(axes.shape[1]):
                _residuals(axes[a, d], of_discs[d], lines, q)
                v[:] = zero
                _rest(q, of_discs[d], lines, unity, zero, v, work)
                for k in range(many):
                    lc, ls = lines[k, 0], lines[k, 1]
                    for u in range(last - first):
                        x = q[k, 0, u] - (v[0, u] * lc + v[1, u] * ls)
                        y = q[k, 1, u] - (v[1, u] * lc - v[0, u] * ls) - v[2, u]
                        pressed = np.sqrt(x * x + y * y) - half * of_discs[d, k, 4, u]
                        if pressed > most[first + u]:
                            most[first + u] = pressed
                            place[0, first + u], place[1, first + u], place[2, first + u] = a, d, k
                            rest[:, first + u] = v[:, u]


@_compiled
def _jam_slopes(
    weight: Array, axes: Single, cranks: Single, lines: Single, place: Any, rest: Single, errors: Single, total: Any
) -> None:
    """Adds to `total` the derivatives of sum(weight squeeze)."""
    many = cranks.shape[1]
    q = np.empty((many, 2, 1), np.float32)
    by_place, by_clearance, p, v = np.empty((many, 2)), np.empty(many), np.empty(3), np.empty(3)
    for u in range(weight.size):
        if weight[u] == 0.0:
            continue
        a, d, k = place[0, u], place[1, u], place[2, u]
        one = cranks[d, :, :, u : u + 1].copy()
        _residuals(axes[a, d], one, lines, q)
        v[:] = rest[:, u]
        lc, ls = lines[k, 0], lines[k, 1]
        x = q[k, 0, 0] - (v[0] * lc + v[1] * ls)
        y = q[k, 1, 0] - (v[1] * lc - v[0] * ls) - v[2]
        away = np.sqrt(x * x + y * y) + 1e-9
        x, y = x / away, y / away
        p[0], p[1], p[2] = ls * y - lc * x, -ls * x - lc * y, -y
        _responses(q[:, :, 0], one[:, :, 0], lines, 1.0, v, p, by_place, by_clearance)
        by_place[k, 0] += x
        by_place[k, 1] += y
        by_clearance[k] -= 0.5
        _add_cranks(weight[u], axes[a, d], lines, errors[d, :, :, u], by_place, by_place, by_clearance, total)
