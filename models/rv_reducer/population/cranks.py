"""Discs on all of their cranks at once: play that wrong distances of the cranks take up, and bearings that jam.

A crank holds a disc by a bearing that is open by its clearance c and then presses by a linear stiffness. With q_k the
place of journal k less that of its bore, in axes along and across the crank's line, zeta the displacement of the disc
and s the turn (at the crank circle) by which it lags behind, journal k stands off by

    rho_k = q_k - zeta exp(-2 pi i k/K) - i s (forward flank; + i s backward),

and the disc rests where sum (|rho_k| - c_k/2)_+^2 / 2 - t s is least, t the torque over crank circle and stiffness.
That is convex with three unknowns, and Newton's method solves it for many units side by side. Two cranks without
torque leave the turn sqrt(c^2 - d^2)/(2 a_0) to either side, d the error of their distance and c the mean clearance;
from d = c on they jam with (d - c)/2 of squeeze in either bearing.

Lengths are micrometres. This module is imported where discs are coupled. Its compiled functions call none of another
file: numba's cache does not see changes there, nor of the width of blocks and of the options of `kernel`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....section import Array, Single
from ....units import ARCMIN, UM
from ..contact.geometry import ContactGeometry
from .contact import NAMES, PLAY, Slopes, Touch
from .errors import Lattice, Table, crank_lines
from .kernel import LANES, _inlined, compiled
from .units import BaseSample, Coupling

STEPS = 8
"""Most steps of Newton's method, and one for each crank: then units rest within 1e-5 um."""
FEWEST = 6
"""Steps that all units take side by side; then, and at every second step, those that rest are left out."""
SETTLED = np.float32(1e-6)
"""Step [um] that units at rest do not exceed twice in succession: where a bearing is about to press, one is short."""
HALVED = 7
"""The step that is halved, lest two bearings take turns in pressing."""
STIFFENED = np.float32(1e-3)
"""Stiffness, in those of a bearing, that is added to every step, where a disc is free."""
SOFTEST = np.float32(1e-5)
"""The same for derivatives."""
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
        of_units = np.ascontiguousarray(weight, np.float32), (touch.ahead, touch.behind), mesh, self.cranks
        plain = errors.of_discs[:, PLAY]
        _seat_slopes(*of_units, *self._constants, self.places, errors.of_cranks, plain, total)
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
        most, rest, place = (
            np.zeros(units, np.float32),
            np.zeros((3, units), np.float32),
            np.zeros((3, units), np.int32),
        )
        _jam(seats.lattice.directions, seats.cranks, seats._constants[0], most, place, rest)
        return cls(seats, most.astype(float) * seats.coupling.stiffness * UM, place, rest)

    def slopes(self, weight: Array, errors: Slopes) -> Array:
        """Derivatives (names,) of sum(weight force), weight (n,), by `contact.NAMES`."""
        total, seats = np.zeros(len(NAMES)), self.seats
        loaded = (np.where(self.force > 0.0, weight, 0.0) * seats.coupling.stiffness * UM).astype(np.float32)
        at = (seats.lattice.directions, seats.cranks, seats._constants[0], self.place, self.rest)
        _jam_slopes(loaded, *at, errors.of_cranks, total)
        return total


@_inlined
def _stand_off(q: Single, v: Single, k: int, u: int, lc: float, ls: float, sign: float) -> Any:
    """Stand-off (x, y) of bearing k of a disc that rests at v (3, lanes), and its length."""
    x = q[k, 0, u] - (v[0, u] * lc + v[1, u] * ls)
    y = q[k, 1, u] - (v[1, u] * lc - v[0, u] * ls) - sign * v[2, u]
    return x, y, np.sqrt(x * x + y * y) + np.float32(1e-9)


@compiled
def _residuals(axis: Single, cranks: Single, lines: Single, q: Single) -> None:
    """Fills q (cranks, 3, lanes) of one disc, less the displacement and turn by the means of journals and bores, which
    gaps contain, and the turn by the means of the carrier's holes, which all discs have alike; then half the clearance.
    """
    cx, cy, many = axis[4], axis[5], cranks.shape[0]
    part, half = np.float32(1.0 / many), np.float32(0.5)
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
            q[k, 2, u] = half * cranks[k, 4, u]


@compiled
def _bend(q: Single, lines: Single, sign: float, v: Single, work: Single) -> None:
    """Fills `work` (9, lanes) at v (3, lanes): the pull of the bearings on a disc, then half of their stiffness."""
    zero, unity = np.float32(0.0), np.float32(1.0)
    work[:] = zero
    for k in range(q.shape[0]):
        lc, ls = lines[k, 0], lines[k, 1]
        for u in range(v.shape[1]):
            x, y, away = _stand_off(q, v, k, u, lc, ls, sign)
            pressed = max(away - q[k, 2, u], zero)
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


@compiled
def _solved(work: Single, u: int, more: float, g0: float, g1: float, g2: float) -> Any:
    """The move of lane `u` by which its bearings, stiffer by `more`, take up a pull."""
    a, b, c = work[3, u] + more, work[4, u], work[5, u]
    d, e, f = work[6, u] + more, work[7, u], work[8, u] + more
    m0, m1, m2 = d * f - e * e, c * e - b * f, b * e - c * d
    inverse = np.float32(1.0) / (a * m0 + b * m1 + c * m2)
    s0 = (m0 * g0 + m1 * g1 + m2 * g2) * inverse
    s1 = (m1 * g0 + (a * f - c * c) * g1 + (b * c - a * e) * g2) * inverse
    return s0, s1, (m2 * g0 + (b * c - a * e) * g1 + (a * d - b * b) * g2) * inverse


@compiled
def _rest(q: Single, lines: Single, sign: float, pull: float, v: Single) -> None:
    """Moves v (3, lanes), displacement along and across the first line and lag, to where discs rest."""
    unity, half = np.float32(1.0), np.float32(0.5)
    at, place, work = v.copy(), np.arange(v.shape[1]), np.empty((9, v.shape[1]), np.float32)
    moved, last = np.empty((2, v.shape[1]), np.float32), STEPS + q.shape[0]
    for step in range(1, last + 1):
        most = half if step == HALVED else unity
        _bend(q, lines, sign, at, work)
        for u in range(at.shape[1]):
            s0, s1, s2 = _solved(work, u, STIFFENED, work[0, u], work[1, u], work[2, u] + pull)
            longest = max(abs(s0), max(abs(s1), abs(s2)))
            part = most * FARTHEST / max(FARTHEST, longest)
            at[0, u] += part * s0
            at[1, u] += part * s1
            at[2, u] += part * s2
            moved[step % 2, u] = longest
        if step != last and (step < FEWEST or step % 2):
            continue
        for i in range(3):
            for u in range(place.size):
                v[i, place[u]] = at[i, u]
        q, at, place = _unsettled(np.maximum(moved[0], moved[1]), q, at, place)
        if place.size == 0:
            break
        work, moved = np.empty((9, place.size), np.float32), np.empty((2, place.size), np.float32)


@compiled
def _unsettled(step: Single, q: Single, at: Single, place: Any) -> Any:
    """The lanes whose `step` is long: their q, at and place."""
    which, count = np.empty_like(place), 0
    for u in range(step.size):
        which[count] = u
        count += step[u] >= SETTLED
    left, there = np.empty((*q.shape[:2], count), q.dtype), np.empty((3, count), at.dtype)
    for i in range(3):
        for u in range(count):
            there[i, u] = at[i, which[u]]
        for k in range(q.shape[0]):
            for u in range(count):
                left[k, i, u] = q[k, i, which[u]]
    return left, there, place[which[:count]]


@compiled
def _rest_of_two(q: Single, sign: float, pull: float, lag: Single, v: Single) -> None:
    """As `_rest` of two cranks, whose forces are equal and opposite: X (1 - C/sqrt(D^2 + X^2)) = t for twice the lag X,
    the error D of the distance and the mean clearance C. That is convex, so that Newton's method from C + t on ends.

    `lag` (lanes) is filled with X where it is forward, and read where it is backward.
    """
    unity, half = np.float32(1.0), np.float32(0.5)
    if sign > 0.0:
        for u in range(lag.size):
            lag[u] = q[0, 2, u] + q[1, 2, u] + pull
        for _ in range(STEPS):
            for u in range(lag.size):
                c, d, x = q[0, 2, u] + q[1, 2, u], q[0, 0, u] + q[1, 0, u], lag[u]
                inverse = unity / np.sqrt(d * d + x * x)
                slope = unity - c * d * d * inverse * inverse * inverse
                lag[u] = x - (x - x * c * inverse - pull) / slope
    for u in range(lag.size):
        d, x = q[0, 0, u] + q[1, 0, u], lag[u]
        away = np.sqrt(d * d + x * x)
        part = half * (away + q[0, 2, u] - q[1, 2, u]) / away
        v[0, u] = q[0, 0, u] - part * d
        v[1, u] = q[0, 1, u] - sign * (half - part) * x
        v[2, u] = half * x


@compiled
def _seats(axes: Single, cranks: Single, lines: Single, pull: Any, turn: Any, into: Single) -> None:
    """Fills `into`, the places of `Seats`, at all positions (positions, discs, 6)."""
    many, units = cranks.shape[1], cranks.shape[3]
    part = np.float32(1.0 / many)
    for first in range(0, units, LANES):
        last = min(first + LANES, units)
        lanes, of_discs = last - first, cranks[:, :, :, first:last].copy()
        q, v = np.empty((many, 3, lanes), np.float32), np.empty((3, lanes), np.float32)
        lag = np.empty(lanes, np.float32)
        for a in range(axes.shape[0]):
            for d in range(axes.shape[1]):
                axis = axes[a, d]
                _residuals(axis, of_discs[d], lines, q)
                cx = axis[0] * axis[4] + axis[1] * axis[5]
                cy = axis[1] * axis[4] - axis[0] * axis[5]
                for flank in range(2):
                    sign = np.float32(1.0 - 2.0 * flank)
                    if many == 2:
                        _rest_of_two(q, sign, pull, lag, v)
                    else:
                        v[:2] = np.float32(0.0)
                        v[2] = part * pull
                        for k in range(many):
                            for u in range(lanes):
                                v[2, u] += part * q[k, 2, u]
                        _rest(q, lines, sign, pull, v)
                    for u in range(lanes):
                        into[a, d, flank, 0, first + u] = v[0, u] * cx - v[1, u] * cy
                        into[a, d, flank, 1, first + u] = v[0, u] * cy + v[1, u] * cx
                        into[a, d, flank, 2, first + u] = turn * (v[2, u] - part * pull)


@compiled
def _responses(q: Single, lines: Single, sign: float, v: Single, p: Single, by: Single, work: Single) -> None:
    """Fills derivatives of p . v by places and clearances, `by` (cranks, 3, lanes), of discs that rest at v (3, lanes).

    The rest keeps J' F = t, with J the derivative of rho by v and A the stiffness of a bearing: dv = -H^-1 J' A dq.
    """
    zero, unity, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    _bend(q, lines, sign, v, work)
    for u in range(v.shape[1]):
        work[0, u], work[1, u], work[2, u] = _solved(work, u, SOFTEST, p[0, u], p[1, u], p[2, u])
    for k in range(q.shape[0]):
        lc, ls = lines[k, 0], lines[k, 1]
        for u in range(v.shape[1]):
            x, y, away = _stand_off(q, v, k, u, lc, ls, sign)
            pressed = max(away - q[k, 2, u], zero)
            nx, ny, across = x / away, y / away, pressed / away
            bears = unity if pressed > zero else zero
            moved_x = -(lc * work[0, u] + ls * work[1, u])
            moved_y = ls * work[0, u] - lc * work[1, u] - sign * work[2, u]
            pushed = nx * moved_x + ny * moved_y
            by[k, 0, u] = -across * moved_x - (bears - across) * nx * pushed
            by[k, 1, u] = -across * moved_y - (bears - across) * ny * pushed
            by[k, 2, u] = half * bears * pushed


@compiled
def _add_cranks(
    w: Single, axis: Single, lines: Single, z: Single, by: Single, p: Single, sign: float, mean: Any, total: Any
) -> None:
    """Adds w (lanes) times derivatives by places and clearances, times the errors z (cranks, 7, lanes), to `total`.

    `mean`, 1/cranks or 0, is the part of every crank in the means that gaps contain, by which p . v is less.
    """
    for k in range(z.shape[0]):
        lc, ls = lines[k, 0], lines[k, 1]
        a, b = axis[4] * lc + axis[5] * ls, axis[5] * lc - axis[4] * ls
        eccentric = phase = bore = clearance = hole = np.float32(0.0)
        for u in range(w.size):
            of_hole = by[k, 1, u] - mean * sign * p[2, u]
            x = w[u] * (by[k, 0, u] - mean * (p[0, u] * lc + p[1, u] * ls))
            y = w[u] * (of_hole - mean * (p[1, u] * lc - p[0, u] * ls))
            eccentric += (x * a + y * b) * z[k, 0, u]
            phase += (y * a - x * b) * z[k, 1, u]
            bore += x * z[k, 2, u] + y * z[k, 3, u]
            clearance += w[u] * by[k, 2, u] * z[k, 4, u]
            hole += w[u] * (by[k, 0, u] * z[k, 5, u] + of_hole * z[k, 6, u])
        total[6] += eccentric
        total[9] += clearance
        total[11] -= bore
        total[12] += phase
        total[16] += hole


@compiled
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
    """As `Seats.slopes` says: of sign h + play at each flank, h the gap of the displaced disc, less the plain play."""
    rows, disc_of, axes = mesh
    many, mean, chosen = cranks.shape[1], np.float32(1.0 / cranks.shape[1]), np.empty(LANES, np.int64)
    for a in range(weight.shape[0]):
        for d in range(axes.shape[1]):
            axis = axes[a, d]
            cx = axis[0] * axis[4] + axis[1] * axis[5]
            cy = axis[1] * axis[4] - axis[0] * axis[5]
            for flank in range(2):
                sign, seat, contacts = np.float32(1.0 - 2.0 * flank), places[a, d, flank], touching[flank][a]
                first = 0
                while True:
                    first, lanes = _touching(weight[a], contacts, disc_of, d, first, chosen)
                    if lanes == 0:
                        break
                    of_disc, z = np.empty((2, many, 7, lanes), np.float32)
                    q, by = np.empty((2, many, 3, lanes), np.float32)
                    v, p = np.empty((2, 3, lanes), np.float32)
                    work, w = np.empty((9, lanes), np.float32), np.empty(lanes, np.float32)
                    lost = np.float32(0.0)
                    for i in range(lanes):
                        u = chosen[i]
                        nx, ny, x, y = rows[contacts[u], 4], rows[contacts[u], 5], seat[0, u], seat[1, u]
                        w[i] = weight[a, u]
                        lost += w[i] * plain[d, u]
                        p[0, i], p[1, i], p[2, i] = -sign * (nx * cx + ny * cy), -sign * (ny * cx - nx * cy), turn
                        v[0, i], v[1, i], v[2, i] = x * cx + y * cy, y * cx - x * cy, seat[2, u] / turn + mean * pull
                    for k in range(many):
                        for error in range(7):
                            for i in range(lanes):
                                of_disc[k, error, i] = cranks[d, k, error, chosen[i]]
                                z[k, error, i] = errors[d, k, error, chosen[i]]
                    _residuals(axis, of_disc, lines, q)
                    _responses(q, lines, sign, v, p, by, work)
                    _add_cranks(w, axis, lines, z, by, p, sign, mean, total)
                    total[9] -= lost


@compiled
def _touching(weight: Single, contacts: Any, disc_of: Any, disc: int, first: int, chosen: Any) -> tuple[int, int]:
    """Fills `chosen` with units from `first` on that have a weight and touch with this disc.

    Returns the unit from which to go on, and the number of units.
    """
    count, u = 0, first
    while u < weight.size and count < chosen.size:
        if weight[u] != 0.0 and disc_of[contacts[u]] == disc:
            chosen[count] = u
            count += 1
        u += 1
    return u, count


@compiled
def _jam(axes: Single, cranks: Single, lines: Single, most: Single, place: Any, rest: Single) -> None:
    """Fills the squeeze [um] (n,) of the bearing that is squeezed most over the turn, its place, and the rest there."""
    many, units = cranks.shape[1], cranks.shape[3]
    zero, unity, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    for first in range(0, units, LANES):
        last = min(first + LANES, units)
        lanes, of_discs = last - first, cranks[:, :, :, first:last].copy()
        q, v = np.empty((many, 3, lanes), np.float32), np.empty((3, lanes), np.float32)
        every, bound = np.arange(lanes), np.empty(lanes, np.float32)
        for a in range(axes.shape[0]):
            for d in range(axes.shape[1]):
                _residuals(axes[a, d], of_discs[d], lines, q)
                v[:] = zero
                if many == 2:
                    for u in range(lanes):
                        apart = q[0, 0, u] + q[1, 0, u]
                        unequal = half * (q[0, 2, u] - q[1, 2, u])
                        open_by = q[0, 2, u] + q[1, 2, u]
                        unequal *= min(abs(apart) / max(open_by, np.float32(1e-9)), unity)  # free: both in proportion
                        v[0, u] = q[0, 0, u] - half * apart - (unequal if apart > zero else -unequal)
                        v[1, u] = q[0, 1, u]
                    at, left, there = every, q, v
                else:
                    bound[:] = zero
                    for k in range(many):
                        for u in range(lanes):
                            pressed = max(np.sqrt(q[k, 0, u] ** 2 + q[k, 1, u] ** 2) - q[k, 2, u], zero)
                            bound[u] += pressed * pressed
                    for u in range(lanes):  # at rest the sum of the squares is least
                        bound[u] = np.sqrt(bound[u]) - most[first + u] + SETTLED
                    left, there, at = _unsettled(bound, q, v, every)
                    _rest(left, lines, unity, zero, there)
                for k in range(many):
                    lc, ls = lines[k, 0], lines[k, 1]
                    for i in range(at.size):
                        u, pressed = first + at[i], _stand_off(left, there, k, i, lc, ls, unity)[2] - left[k, 2, i]
                        if pressed > most[u]:
                            most[u] = pressed
                            place[0, u], place[1, u], place[2, u] = a, d, k
                            for j in range(3):
                                rest[j, u] = there[j, i]


@compiled
def _jam_slopes(
    weight: Single, axes: Single, cranks: Single, lines: Single, place: Any, rest: Single, errors: Single, total: Any
) -> None:
    """Adds to `total` the derivatives of sum(weight squeeze)."""
    many, zero, unity = cranks.shape[1], np.float32(0.0), np.float32(1.0)
    q, by, work = np.empty((many, 3, 1), np.float32), np.empty((many, 3, 1), np.float32), np.empty((9, 1), np.float32)
    v, p = np.empty((3, 1), np.float32), np.empty((3, 1), np.float32)
    for u in range(weight.size):
        if weight[u] == 0.0:
            continue
        a, d, k = place[0, u], place[1, u], place[2, u]
        one, z = cranks[d, :, :, u : u + 1].copy(), errors[d, :, :, u : u + 1].copy()
        _residuals(axes[a, d], one, lines, q)
        for i in range(3):
            v[i, 0] = rest[i, u]
        lc, ls = lines[k, 0], lines[k, 1]
        x, y, away = _stand_off(q, v, k, 0, lc, ls, unity)
        x, y = x / away, y / away
        p[0, 0], p[1, 0], p[2, 0] = ls * y - lc * x, -ls * x - lc * y, -y
        _responses(q, lines, unity, v, p, by, work)
        by[k, 0, 0] += x
        by[k, 1, 0] += y
        by[k, 2, 0] -= np.float32(0.5)
        _add_cranks(weight[u : u + 1], axes[a, d], lines, z, by, p, unity, zero, total)
