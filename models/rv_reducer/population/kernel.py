"""Units at first contact and under load, compiled by numba: positions, discs, pins, units innermost.

Turns are those of discs against the mesh in arc minutes; stiffness and torque are N m per arc minute
and N m. These functions call none of another file: numba's cache does not see changes there.
numba is imported with this module alone, where a contact is computed.
"""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import Any

import numba
import numpy as np

from ....section import Single

LANES = 256
"""Units in one block, so that they stay in the cache."""
SOLVED = 128
"""Units whose balances are solved side by side."""


def _closing() -> Any:
    """A compiler whose machine code calls its own copies of other functions, None where this numba has other insides.

    With fastmath the copies of a function in its callers round differently, and the loader takes one of them for all
    that call it by name: the one that was loaded first, which depends on what has been compiled or computed before.
    """
    try:
        from numba.core import codegen, compiler

        code: Any = codegen.JITCodeLibrary
        base: Any = compiler.Compiler
        _ = code._optimize_final_module, code.enable_object_caching, base.compile_extra
    except (ImportError, AttributeError):
        return None

    class Closed(code):
        def _optimize_final_module(self) -> None:
            super()._optimize_final_module()
            with suppress(AttributeError):
                for function in self._final_module.functions:
                    if function.linkage.name == "linkonce_odr" and "6tolevo" in function.name:
                        function.linkage = "internal"

    class Closing(base):
        def compile_extra(self, func: Any) -> Any:
            with suppress(AttributeError):
                library = Closed(self.state.targetctx.codegen(), func.__qualname__)
                library.enable_object_caching()
                self.state.library = library
            return super().compile_extra(func)

    return Closing


_CLOSING = _closing()


def compiled(function: Any, **options: Any) -> Any:
    """A function, compiled. Where `_closing` finds its compiler it gives the same to the last bit whatever was
    compiled or called before; else that may change the last bits.
    """
    given: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": True, "nogil": True}
    if _CLOSING is not None:
        given["pipeline_class"] = _CLOSING
    return numba.njit(**{**given, **options})(function)


def _inlined(function: Any) -> Any:
    return compiled(function, inline="always")


# The placement of a disc, and the turn at which it makes a contact.


@_inlined
def _turned(x: float, y: float, cosine: float, sine: float) -> tuple[float, float]:
    """A vector turned by an angle."""
    return x * cosine - y * sine, x * sine + y * cosine


@compiled
def _disc(axes: Single, disc: Single, circle: Single, terms: Single) -> None:
    """Fills `terms` (8, lanes) of one disc at one position.

    `axes` (6) are cos and sin of eccentric, disc, and eccentric against the cranks; `disc`
    (12, lanes): normal, radial, play, ahead, then real and imaginary parts of turning, offset,
    around, pitch; `circle` (2, lanes). `terms`: changes of the gap along the normal and
    radially, x and y of the pin against the disc, pitch x and y, play, forward turn.
    """
    ex, ey, dx, dy, cx, cy = axes[0], axes[1], axes[2], axes[3], axes[4], axes[5]
    for u in range(disc.shape[1]):
        terms[0, u] = disc[0, u]
        terms[1, u] = disc[1, u]
        x = disc[4, u] * ex - disc[5, u] * ey + disc[6, u] * dx - disc[7, u] * dy
        y = disc[4, u] * ey + disc[5, u] * ex + disc[6, u] * dy + disc[7, u] * dx
        terms[2, u] = circle[0, u] - x
        terms[3, u] = circle[1, u] - y
        terms[4, u], terms[5, u] = _turned(disc[10, u], disc[11, u], dx, dy)
        terms[6, u] = disc[2, u]
        terms[7, u] = disc[3, u] - (disc[8, u] * cy + disc[9, u] * cx)


@_inlined
def _contact(row: Single, sign: Any) -> Any:
    """The coefficients of a contact's turn, or of minus it, taken before the loop over units."""
    return (
        sign * row[0], sign * row[1], sign * row[2], sign * row[3],
        sign * row[4], sign * row[5], sign * row[6], sign * row[7],
    )  # fmt: skip


@_inlined
def _made(contact: Any, across: Single, along: Single, terms: Single, u: int) -> Any:
    """The turn at which the disc of lane `u` makes a contact, with its pin's errors (lanes)."""
    gap, lever, radial, tangential, nx, ny, c, s = contact
    h = gap + lever * (across[u] + terms[0, u]) + radial * terms[1, u]
    h += tangential * along[u] + nx * terms[2, u] + ny * terms[3, u]
    return h + c * terms[4, u] + s * terms[5, u]


@_inlined
def _placed(along: Single, pins: Any, teeth: Any, i: int) -> Any:
    """Displacement (lanes) along the pin circle of the pin of a contact against its tooth, where teeth have errors."""
    return along[pins[i]] + along[teeth[i]] if teeth.size else along[pins[i]]


# First contact.


@_inlined
def _made_in_order(contact: Any, across: Single, along: Single, terms: Single, u: int) -> Any:
    """As `_made`, in the order in which first contacts were always summed; `_made` leaves it to the compiler."""
    gap, lever, radial, tangential, nx, ny, c, s = contact
    h = gap + radial * terms[1, u] + lever * (across[u] + terms[0, u]) + tangential * along[u]
    return h + nx * terms[2, u] + ny * terms[3, u] + c * terms[4, u] + s * terms[5, u]


@partial(compiled, fastmath={"contract", "nnan", "ninf", "nsz"})  # sums in the order in which they are written
def _nearest(
    rows: Single,
    pins: Any,
    teeth: Any,
    across: Single,
    along: Single,
    terms: Single,
    sign: float,
    best: Single,
    which: Any,
) -> None:
    """The least of sign * h over contacts, and its pin, by lane.

    Contacts are taken by twos, and all lanes are stored: processors store some of the lanes slowly.
    """
    last = rows.shape[0] - 1
    for i in range(0, rows.shape[0], 2):
        k = min(i + 1, last)  # the last of an odd number twice: it is no nearer than itself
        one, other = _contact(rows[i], sign), _contact(rows[k], sign)
        one_across, other_across = across[pins[i]], across[pins[k]]
        one_along, other_along = _placed(along, pins, teeth, i), _placed(along, pins, teeth, k)
        place, next_place = np.int32(i), np.int32(k)
        for u in range(best.size):
            h = _made_in_order(one, one_across, one_along, terms, u)
            g = _made_in_order(other, other_across, other_along, terms, u)
            later = g < h
            nearer, pin = g if later else h, next_place if later else place
            closer = nearer < best[u]
            which[u] = pin if closer else which[u]
            best[u] = min(best[u], nearer)


@compiled
def _displace(seat: Single, first: int, sign: float, terms: Single) -> None:
    """Displaces a disc by its seat (3, units), or back, and gives it the play that the seat leaves."""
    for u in range(terms.shape[1]):
        terms[2, u] -= sign * seat[0, first + u]
        terms[3, u] -= sign * seat[1, first + u]
        terms[6, u] = seat[2, first + u]


@compiled
def touch(contacts: Any, errors: Any, seats: Single, turns: Any) -> None:
    """Fills `turns` at first contact: forward, backward, and the contacts that make them.

    The four arrays have the shape (positions, units); a contact is a row of the table. `contacts`:
    table (contacts, 9), pins (contacts), teeth (contacts, or none), start and stop (positions, discs, 2), axes
    (positions, discs, 6). `errors`: across and along (pins, units), discs (discs, 12, units),
    circle (2, units). `teeth` are rows that `along` has after those of the pins. `seats` are the places of
    `cranks.Seats` (positions, discs, 2, 3, units), of no position where discs turn about their centres by their mean
    play.
    """
    rows, pins, teeth, start, stop, axes = contacts
    across, along, discs, circle = errors
    high, low, ahead, behind = turns
    seated = seats.shape[0] > 0
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
                if seated:
                    _displace(seats[a, d, 0], first, plus, terms)
                i, k = start[a, d, 0], stop[a, d, 0]
                best[:] = far
                which[:] = 0
                _nearest(rows[i:k], pins[i:k], teeth[i:k], lane_across, lane_along, terms, plus, best, which)
                for u in range(lanes):
                    at = best[u] + terms[6, u] - terms[7, u]
                    if at < high[a, first + u]:
                        high[a, first + u] = at
                        ahead[a, first + u] = i + which[u]
                if seated:
                    _displace(seats[a, d, 0], first, minus, terms)
                    _displace(seats[a, d, 1], first, plus, terms)
                i, k = start[a, d, 1], stop[a, d, 1]
                best[:] = far
                which[:] = 0
                _nearest(rows[i:k], pins[i:k], teeth[i:k], lane_across, lane_along, terms, minus, best, which)
                for u in range(lanes):
                    at = -best[u] - terms[6, u] - terms[7, u]
                    if at > low[a, first + u]:
                        low[a, first + u] = at
                        behind[a, first + u] = i + which[u]


@compiled
def differences(column: Any, ahead: Any, behind: Any, slope: Single) -> None:
    """Fills `slope` (positions, units) with a column of the table (contacts) forward less backward."""
    for a in range(slope.shape[0]):
        for u in range(slope.shape[1]):
            slope[a, u] = column[ahead[a, u]] - column[behind[a, u]]


@compiled
def touch_slopes(weights: Any, touching: Any, contacts: Any, slopes: Any, total: Any) -> None:
    """Adds to `total` the slopes of sum(weight * (forward - backward)) in the order of `contact.NAMES`.

    `weights` (positions, units) of the forward and of the backward flank, `touching` the contacts of that shape;
    `contacts`: table, pin, tooth and disc of each contact, axes; `slopes`: the standardised errors of unit
    (3, units), discs (discs, 17, units) and pins (3, pins, units) as `contact.Slopes` packs them; of teeth
    the first of the three.
    """
    ahead, behind = touching
    rows, pins, teeth, disc_of, axes = contacts
    of_unit, of_discs, of_pins = slopes
    for a in range(ahead.shape[0]):
        for u in range(ahead.shape[1]):
            for flank in range(2):
                w = weights[flank][a, u]
                if w == 0.0:
                    continue
                sw = w if flank == 0 else -w
                i = ahead[a, u] if flank == 0 else behind[a, u]
                j, d = pins[i], disc_of[i]
                row, axis, z = rows[i], axes[a, d], of_discs[d, :, u]
                ex, ey, dx, dy, cx, cy = axis[0], axis[1], axis[2], axis[3], axis[4], axis[5]
                lever, nx, ny = row[1], row[4], row[5]
                total[0] += sw * row[2] * of_unit[0, u]
                total[1] += sw * row[3] * of_pins[0, j, u]
                if teeth.size:
                    total[4] += sw * row[3] * of_pins[0, teeth[i], u]
                total[2] += sw * lever * of_pins[1, j, u]
                total[3] -= sw * lever * of_pins[2, j, u]
                px, py = _turned(z[2], z[3], dx, dy)
                total[4] += sw * (row[6] * px + row[7] * py)
                rx, ry = _turned(z[4], z[5], dx, dy)
                total[5] -= sw * (nx * rx + ny * ry)
                total[6] -= sw * (nx * ex + ny * ey) * z[6]
                total[6] += sw * (z[7] * cy + z[8] * cx)
                total[7] += sw * lever * z[0]
                total[8] -= sw * row[2] * z[1]
                total[9] += w * z[9]
                total[10] += sw * (nx * of_unit[1, u] + ny * of_unit[2, u])
                bx, by = _turned(z[10], z[11], dx, dy)
                total[11] += sw * (nx * bx + ny * by) - sw * z[12]
                total[12] -= sw * (ex * ny - ey * nx) * z[13]
                total[12] += sw * (z[14] * cy + z[15] * cx)
                total[13] -= sw * z[16]
                total[14] += sw * lever
                total[15] += sw * row[8]


# Two cranks that turn apart, each as far as the play of its planet allows.


_CUTS = 8
"""Steps by which the cranks are sought at which discs bear last; as a rule two or three are enough."""
_MET = 2e-5
"""Turn [arcmin] by which discs may bear later than at the best cranks that are tried."""
_WITHIN = 0.999
"""Fraction of the play of bearings that the distance of the journals takes up at most."""


@compiled
def _nearest_disc(
    gaps: Any, play: Any, axes: Single, factor: float, way: float, apart: float
) -> tuple[float, float, int]:
    """The disc that bears first where two cranks are `apart`, its place, and how that grows with `apart`."""
    place, slope, which = 1e9, 0.0, 0
    for d in range(gaps.size):
        cx, cy = way * axes[d, 4], axes[d, 5]
        part = apart * cy * factor / max(play[d], 1e-9)
        left = np.sqrt(max(1.0 - part * part, 1e-6))
        at = gaps[d] + play[d] * left + apart * cx
        if at < place:
            place, slope, which = at, cx - part * cy * factor / left, d
    return place, slope, which


@compiled
def meet(axes: Single, touches: Any, play: Single, planets: Any, sizes: Any, into: Any) -> None:
    """First contact of two discs or more whose two cranks turn apart: forward and backward, the least of the places of
    the discs is greatest.

    `touches` (2, discs, positions, units) are the first contacts of each disc and flank, with its `play` (discs,
    units); `planets` (2, units) half of the mean play of both planets and a quarter of their difference; `sizes`
    the play factor, and the turn of the mesh by a turn of both cranks, in which turns of cranks are counted [arcmin].
    Where cranks are apart, the discs turn against each other, the distance of their journals takes up play, and both
    planets lose |apart + difference| of their mean play.
    Fills `into`: the backlash beyond that of the tighter planet (positions, units), its derivatives by each first
    contact and by the play there (2, discs, positions, units), and by the size ln(planets) (positions, units).
    """
    backlash, by_gap, by_play, by_size = into
    factor, gear = sizes
    discs = axes.shape[1]
    gaps, own = np.empty(discs), np.empty(discs)
    for a in range(axes.shape[0]):
        axis = axes[a]
        for u in range(backlash.shape[1]):
            mean, most = planets[0, u], planets[0, u]
            for d in range(discs):
                own[d] = play[d, u]
                most = min(most, _WITHIN * own[d] / max(factor * abs(axis[d, 5]), 1e-6))
            total = size = 2.0 * gear * abs(planets[1, u])
            for flank in range(2):
                way = 1.0 - 2.0 * flank
                balanced = -way * planets[1, u]
                even = min(max(balanced, -most), most)
                for d in range(discs):
                    gaps[d] = touches[flank, d, a, u] - own[d]
                apart = even
                at, slope, first = _nearest_disc(gaps, own, axis, factor, way, apart)
                last, below, above = first, 0.0, 0.0
                if abs(slope) > gear:  # discs bear later if both planets do not
                    side = 1.0 if slope > 0.0 else -1.0
                    start, below, place = even, side * slope - gear, at
                    apart = side * most
                    at, slope, last = _nearest_disc(gaps, own, axis, factor, way, apart)
                    end = apart
                    above, value = side * slope - gear, at - gear * abs(apart - even)
                    for _ in range(_CUTS):
                        if above >= 0.0:
                            break
                        width = side * (end - start)
                        ahead = (value - place - above * width) / (below - above)
                        apart = start + side * min(max(ahead, 0.0), width)
                        if place + below * ahead - max(place, value) < _MET:
                            apart = start if place > value else end
                            break
                        at, slope, which = _nearest_disc(gaps, own, axis, factor, way, apart)
                        net, here = side * slope - gear, at - gear * abs(apart - even)
                        if net > 0.0:
                            start, below, place, first = apart, net, here, which
                        else:
                            end, above, value, last = apart, net, here, which
                    at, slope, which = _nearest_disc(gaps, own, axis, factor, way, apart)
                    first = last if above >= 0.0 else first
                total += at - gear * abs(apart - balanced)
                bears = gear if apart > balanced else (-gear if apart < balanced else slope)
                size += bears * balanced
                if abs(apart) == mean:
                    size += (slope - bears) * apart
                part = -above / (below - above) if first != last else 1.0
                for d in range(discs):
                    weight = part * (d == first) + (1.0 - part) * (d == last) if first != last else 1.0 * (d == first)
                    left = apart * axis[d, 5] * factor / max(own[d], 1e-9)
                    by_gap[flank, d, a, u] = weight
                    by_play[flank, d, a, u] = weight / np.sqrt(max(1.0 - left * left, 1e-6))
            backlash[a, u], by_size[a, u] = total, size


# Balances of torque under load.
#
# Newton's method on the pins of the loaded flank alone, for many units side by side, converges from
# any start because the torque is convex in the turn. Units where a pin of the other flank bears too,
# and those without torque, are solved one by one with bounds.


Mesh = tuple[Single, Single, Any]
"""Gaps (contacts, lanes), stiffness (contacts), and contacts by disc and flank (discs, 2, 2)."""
Discs = tuple[Single, Single, Single, Any]
"""Terms (discs, 8, lanes), first contact backward and forward (discs, lanes), and their rests."""
State = tuple[Single, Any, Single, Single]
"""Turns of discs, flanks that take their torque (discs, lanes); turn of the unit, depth (lanes)."""
_STEPS = 60
_SETTLED = np.float32(2e-6)
"""Change [arcmin] of a disc's turn below which Newton's method has ended."""
_FAR = np.float32(1e9)
_NUDGE = 1e-6
"""Turn [arcmin] beyond first contact from which a balance starts where nothing bears."""


@compiled
def _gaps(
    rows: Single, pins: Any, teeth: Any, across: Single, along: Single, terms: Single, first: int, gaps: Single
) -> None:
    """Fills `gaps` (contacts, lanes) from row `first` on with turns to contact."""
    unity = np.float32(1.0)
    for i in range(rows.shape[0]):
        contact = _contact(rows[i], unity)
        opening, shifted, into = across[pins[i]], _placed(along, pins, teeth, i), gaps[first + i]
        for u in range(terms.shape[1]):
            into[u] = _made(contact, opening, shifted, terms, u)


@compiled
def _bounds(gaps: Single, span: Any, low: Single, high: Single) -> None:
    """First contact of one disc backward and forward; `span` (2, 2) is its contacts by flank."""
    high[:], low[:] = _FAR, -_FAR
    for i in range(span[0, 0], span[1, 1]):
        gap, forward = gaps[i], i < span[0, 1]
        for u in range(high.size):
            high[u] = min(high[u], gap[u] if forward else _FAR)
            low[u] = max(low[u], -_FAR if forward else gap[u])


@compiled
def _bearing(mesh: Mesh, d: int, flank: int, at: Single, rise: Single, moment: Single) -> None:
    """Sums of stiffness and of stiffness times gap over the pins that bear at `at` (lanes)."""
    gaps, stiff, spans = mesh
    sign = np.float32(1.0) if flank == 0 else np.float32(-1.0)
    zero = np.float32(0.0)
    rise[:], moment[:] = zero, zero
    for i in range(spans[d, flank, 0], spans[d, flank, 1]):
        gap, k = gaps[i], stiff[i]
        for u in range(at.size):
            g = sign * gap[u]
            bears = k if at[u] > g else zero
            rise[u] += bears
            moment[u] += bears * g


@compiled
def _lanes(mesh: Mesh, discs: Discs, behind: float, torque: float, state: State, wrong: Any, work: Single) -> None:
    """Balance of every lane on one flank; `wrong` (lanes) where that does not hold.

    The depth of `state` is the turn beyond first contact, start and end; `work` has the shape
    (2 discs + 2, lanes).
    """
    (terms, low, high, _), (x, side, turn_of_unit, depth) = discs, state
    many, lanes = x.shape
    flank, sign = (0, np.float32(1.0)) if torque > 0.0 else (1, np.float32(-1.0))
    size, unity, zero = np.float32(abs(torque)), np.float32(1.0), np.float32(0.0)
    rise, moment, stiffness, need = work[:many], work[many:-2], work[-2], work[-1]
    need[:] = _FAR
    for d in range(many):
        for u in range(lanes):
            nearest = high[d, u] if flank == 0 else -low[d, u]
            need[u] = min(need[u], nearest + terms[d, 6, u] - sign * terms[d, 7, u])
    wrong[:] = True
    for u in range(lanes):
        turn_of_unit[u] = need[u]
    for d in range(many):
        for u in range(lanes):
            x[d, u] = need[u] + depth[u] + sign * terms[d, 7, u] - terms[d, 6, u]
    for _ in range(_STEPS):
        stiffness[:], need[:] = zero, size
        for d in range(many):
            _bearing(mesh, d, flank, x[d], rise[d], moment[d])
            for u in range(lanes):
                turn = sign * terms[d, 7, u] - terms[d, 6, u]
                bent = unity / (unity + rise[d, u] * behind)
                stiffness[u] += rise[d, u] * bent
                need[u] += (moment[d, u] - rise[d, u] * turn) * bent
        for u in range(lanes):
            need[u] = need[u] / max(stiffness[u], np.float32(1e-20))
        most = zero
        for d in range(many):
            for u in range(lanes):
                turn = sign * terms[d, 7, u] - terms[d, 6, u]
                bent = unity / (unity + rise[d, u] * behind)
                ahead = (need[u] + turn + moment[d, u] * behind) * bent
                most = max(most, abs(ahead - x[d, u]))
                x[d, u] = ahead
        if most <= _SETTLED:
            wrong[:] = False
            break
    for u in range(lanes):
        depth[u] = need[u] - turn_of_unit[u]
        turn_of_unit[u] = sign * need[u]
    for d in range(many):
        for u in range(lanes):
            opposite = low[d, u] if flank == 0 else -high[d, u]
            loaded = rise[d, u] > zero
            free = zero if loaded else np.float32(2.0) * terms[d, 6, u]
            jammed = low[d, u] > high[d, u] and not loaded
            wrong[u] = wrong[u] or x[d, u] + free < opposite or jammed
            x[d, u] = sign * (x[d, u] if loaded else max(x[d, u], opposite))  # within its play
            side[d, u] = np.int8(sign) if loaded else np.int8(0)


@compiled
def _pins(mesh: Mesh, d: int, u: int, x: float) -> tuple[float, float, float]:
    """Torque forward, torque of all pins, and stiffness of a disc's pins at its turn x."""
    gaps, stiff, spans = mesh
    forward = torque = rise = 0.0
    middle = spans[d, 0, 1]
    for i in range(spans[d, 0, 0], spans[d, 1, 1]):
        closed, k = x - gaps[i, u], stiff[i]
        if i < middle and closed > 0.0:
            forward += k * closed
        if (i < middle) == (closed > 0.0):
            torque += k * closed
            rise += k
    return forward, torque, rise


@compiled
def _bent(mesh: Mesh, d: int, u: int, behind: float, target: float, low: float, high: float) -> Any:
    """The turn x in [low, high] with x + behind M(x) = target."""
    x = 0.5 * (low + high)
    for _ in range(_STEPS):
        _, torque, rise = _pins(mesh, d, u, x)
        miss = x + behind * torque - target
        low, high = max(low, x) if miss < 0.0 else low, min(high, x) if miss >= 0.0 else high
        ahead = x - miss / (1.0 + behind * rise)
        if not low <= ahead <= high:
            ahead = 0.5 * (low + high)
        if abs(ahead - x) <= 1e-12:
            return ahead
        x = ahead
    return x


@compiled
def _rests(mesh: Mesh, discs: Discs) -> None:
    """Fills the rests (2, discs, lanes): turns between which a disc's pins hold no torque.

    Where pins of both flanks bear at once it is the turn at which they balance.
    """
    _, low, high, rest = discs
    for d in range(low.shape[0]):
        for u in range(low.shape[1]):
            rest[0, d, u], rest[1, d, u] = low[d, u], high[d, u]
            if low[d, u] <= high[d, u]:
                continue
            least, most = np.float64(high[d, u]), np.float64(low[d, u])
            x = 0.5 * (least + most)
            for _ in range(_STEPS):
                _, torque, rise = _pins(mesh, d, u, x)
                least, most = (x, most) if torque < 0.0 else (least, x)
                ahead = x - torque / rise
                if not least <= ahead <= most:
                    ahead = 0.5 * (least + most)
                away, x = abs(ahead - x), ahead
                if away <= 1e-9:
                    break
            rest[0, d, u], rest[1, d, u] = x, x


@compiled
def _loaded(
    mesh: Mesh, d: int, u: int, turned: float, play: float, low: float, high: float, behind: float
) -> tuple[float, int, float, float, float]:
    """A disc that the carrier has turned to `turned`, between rests `low` and `high` of its pins.

    Returns its turn against the mesh, the flank that takes its torque, the torque of the forward
    flank, and the torque and stiffness that act on the carrier.
    """
    target, toward = min(max(turned, low), high), 0
    if turned > high + play:
        target, toward = turned - play, 1
    elif turned < low - play:
        target, toward = turned + play, -1
    x = target
    if toward != 0 and behind > 0.0:
        x = _bent(mesh, d, u, behind, target, min(low, target), max(high, target))
    forward, torque, rise = _pins(mesh, d, u, x)
    if toward == 0:
        torque = rise = 0.0
    return x, toward, forward, torque, rise / (1.0 + rise * behind)


@compiled
def _balance(
    mesh: Mesh, discs: Discs, u: int, behind: float, torque: float, start: float, state: State
) -> tuple[float, float]:
    """Turn and torque of the forward flanks of one unit; fills turns and flanks of its discs.

    Newton's method between bounds, from `start`.
    """
    (terms, _, _, rest), (x, side, _, _) = discs, state
    many, least, most = x.shape[0], -1e9, 1e9
    for d in range(many):
        least = max(least, rest[0, d, u] - terms[d, 6, u] - terms[d, 7, u])
        most = min(most, rest[1, d, u] + terms[d, 6, u] - terms[d, 7, u])
    at, below, above = float(start), -1e9, 1e9
    if torque == 0.0:
        at = 0.5 * (least + most)
    forward = 0.0
    for _ in range(2 * _STEPS):
        miss, rise, forward = -torque, 0.0, 0.0
        for d in range(many):
            turned, play = at + terms[d, 7, u], terms[d, 6, u]
            low, high = rest[0, d, u], rest[1, d, u]
            disc = _loaded(mesh, d, u, turned, play, low, high, behind)
            x[d, u], side[d, u], ahead, held, stiffness = disc
            forward, miss, rise = forward + ahead, miss + held, rise + stiffness
        if abs(miss) <= 1e-9 * abs(torque) + 1e-9:
            break
        below, above = (at, above) if miss < 0.0 else (below, at)
        ahead = most + _NUDGE if miss < 0.0 else least - _NUDGE
        if rise > 0.0:
            ahead = at - miss / rise
        if not below < ahead < above:
            ahead = 0.5 * (below + above)
        if abs(ahead - at) <= 1e-13:
            break
        at = ahead
    return at, forward


@compiled
def _open(discs: Discs, state: State, squeezed: Any) -> None:
    """The middle of the play without torque, by lane; `squeezed` where pins bear."""
    (terms, low, high, _), (x, side, turn, _) = discs, state
    half = np.float32(0.5)
    for u in range(turn.size):
        least, most, squeezed[u] = -_FAR, _FAR, False
        for d in range(x.shape[0]):
            squeezed[u] = squeezed[u] or low[d, u] > high[d, u]
            least = max(least, low[d, u] - terms[d, 6, u] - terms[d, 7, u])
            most = min(most, high[d, u] + terms[d, 6, u] - terms[d, 7, u])
            x[d, u] = half * (low[d, u] + high[d, u])
            side[d, u] = 0
        turn[u] = half * (least + most)
        squeezed[u] = squeezed[u] or least > most


@compiled
def _largest(mesh: Mesh, force: Single, x: Single, place: int, shift: int, peaks: Any) -> None:
    """Raises the peaks (lanes) to the largest pin force here, with its position and contact."""
    (gaps, _, spans), (peak, where, which) = mesh, peaks
    at = np.int32(place)
    for d in range(x.shape[0]):
        for i in range(spans[d, 0, 0], spans[d, 1, 1]):
            gap, k, contact = gaps[i], force[i], np.int32(shift + i)
            for u in range(peak.size):
                bears = k * (x[d, u] - gap[u])
                higher = bears > peak[u]
                peak[u] = bears if higher else peak[u]
                where[u] = at if higher else where[u]
                which[u] = contact if higher else which[u]


@compiled
def _case(mesh: Mesh, discs: Discs, behind: float, torque: float, state: State, held: Single, work: Single) -> None:
    """The balances of all lanes at one position under a torque on the discs.

    `held` (lanes) is filled with the torque of the forward flanks where there is no other torque.
    """
    turn = state[2]
    wrong = np.empty(turn.size, np.bool_)
    if torque == 0.0:
        _open(discs, state, wrong)
    else:
        _lanes(mesh, discs, behind, torque, state, wrong, work)
    for u in range(turn.size):
        if wrong[u]:
            start, precise = turn[u], np.float64(behind)
            turn[u], forward = _balance(mesh, discs, u, precise, torque, start, state)
            if torque == 0.0:
                held[u] = forward


@compiled
def balances(contacts: Any, springs: Any, errors: Any, torques: Any, rated: int, into: Any) -> None:
    """Balances of all units at all positions under `torques` (cases) on the discs.

    `contacts` and `errors` as in `touch`; `springs` in the order of the fields of
    `Springs`. Fills `into`, arrays in the order of the fields of `elastic.Balances`: turns, discs
    and sides of every case, the preload of the case without torque, and the peak with its position
    and contact of the case `rated`, if any.
    """
    rows, pins, teeth, start, stop, axes = contacts
    stiff, force, _, behind, _ = springs
    across, along, discs, circle = errors
    turn, x, side, preload, peak, where, which = into
    many, wide = start.shape[1], 0
    for a in range(start.shape[0]):
        wide = max(wide, stop[a, many - 1, 1] - start[a, 0, 0])
    spans = np.empty((many, 2, 2), np.int64)
    for first in range(0, across.shape[1], SOLVED):
        last = min(first + SOLVED, across.shape[1])
        lanes = last - first
        opening, shifted = across[:, first:last].copy(), along[:, first:last].copy()
        of_discs, centre = discs[:, :, first:last].copy(), circle[:, first:last].copy()
        terms, gaps = np.empty((many, 8, lanes), np.float32), np.empty((wide, lanes), np.float32)
        low, high = np.empty((many, lanes), np.float32), np.empty((many, lanes), np.float32)
        place = np.empty((torques.size, many, lanes), np.float32)  # kernels need them contiguous
        toward, turned = np.empty(place.shape, np.int8), np.empty((torques.size, lanes), np.float32)
        depth = np.full((torques.size, lanes), np.float32(0.3))
        work, rest = np.empty((2 * many + 2, lanes), np.float32), np.empty((2, many, lanes))
        of_lanes = terms, low, high, rest
        peaks = peak[first:last], where[first:last], which[first:last]
        for a in range(start.shape[0]):
            i = start[a, 0, 0]
            for d in range(many):
                begin, end = start[a, d, 0], stop[a, d, 1]
                for flank in range(2):
                    spans[d, flank, 0], spans[d, flank, 1] = start[a, d, flank] - i, stop[a, d, flank] - i
                _disc(axes[a, d], of_discs[d], centre, terms[d])
                table, numbers, of_teeth = rows[begin:end], pins[begin:end], teeth[begin:end]
                _gaps(table, numbers, of_teeth, opening, shifted, terms[d], begin - i, gaps)
                _bounds(gaps, spans[d], low[d], high[d])
            mesh = gaps, stiff[i : i + wide], spans
            _rests(mesh, of_lanes)
            for case in range(torques.size):
                state = place[case], toward[case], turned[case], depth[case]
                _case(mesh, of_lanes, behind, torques[case], state, preload[a, first:last], work)
                if case == rated:
                    _largest(mesh, force[i : i + wide], place[case], a, i, peaks)
            for case in range(torques.size):  # loops: an array assigned to a slice takes seconds to compile
                for u in range(lanes):
                    turn[case, a, first + u] = turned[case, u]
                for d in range(many):
                    for u in range(lanes):
                        x[case, a, d, first + u] = place[case, d, u]
                        side[case, a, d, first + u] = toward[case, d, u]


@compiled
def add_friction(contacts: Any, springs: Any, errors: Any, x: Single, into: Single) -> None:
    """Adds to `into` (positions, units) the frictional torque of the pins that bear at the turns `x` (positions, discs,
    units) of the discs.
    """
    rows, pins, teeth, start, stop, axes = contacts
    across, along, discs, circle = errors
    friction, units = springs[4], across.shape[1]
    terms, closed = np.empty((8, units), np.float32), np.empty(units, np.float32)
    for a in range(start.shape[0]):
        for d in range(start.shape[1]):
            _disc(axes[a, d], discs[d], circle, terms)
            for flank in range(2):
                for i in range(start[a, d, flank], stop[a, d, flank]):
                    placed = _placed(along, pins, teeth, i)
                    _closed(rows[i], across[pins[i]], placed, terms, x[a, d], flank, closed)
                    for u in range(units):
                        into[a, u] += friction[i] * closed[u]


# Derivatives of balances of torque by the pins that bear and the springs.
#
# With W and H the sums over the bearing pins of a disc of stiffness w and of w dh, play P closed in
# the direction of load and c the compliance behind the disc, a balance changes by
# dM = (W (db + ds -+ dP) - H)/(1 + c W), sum of dM = 0. The derivative of a turn, of the
# torque of a flank or of the force on a pin by each gap is a weight by contact; the turn of the disc
# takes the remaining change.


@compiled
def _closed(
    row: Single, pin_across: Single, pin_along: Single, terms: Single, x: Single, flank: int, into: Single
) -> None:
    """Turn of each lane's disc beyond contact with one pin of `flank`, or 0."""
    unity, zero = np.float32(1.0), np.float32(0.0)
    contact, sign = _contact(row, unity), unity if flank == 0 else -unity
    for u in range(into.size):
        h = _made(contact, pin_across, pin_along, terms, u)
        into[u] = sign * max(sign * (x[u] - h), zero)


@compiled
def _collect(
    closed: Single,
    stiff: float,
    force: float,
    friction: float,
    contact: int,
    of_torque: Single,
    of_force: Single,
    of_friction: Single,
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
        fixed[u] += friction * of_friction[u] if closed[u] != zero else zero
        most = bears if bears > most else most
    return most > zero


@compiled
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


@compiled
def _spread(
    contact: Any,
    closed: Single,
    factor: Single,
    of_torque: Single,
    of_force: Single,
    of_friction: Single,
    star: Any,
    of_contact: Single,
    sums: Single,
) -> Any:
    """Adds the weights of a contact to `sums` (7, lanes), and writes them to `of_contact`.

    `contact` has its row, its `lean`, stiffness, force and friction, and its number.
    Returns the part by the shift modification, with which the lever arm grows by `lean` [1/mm]:
    stiffness goes with the square of the arm, the force on a pin and its friction with the arm.
    """
    row, lean, stiff, force, friction, number = contact
    lever, radial, nx, ny = row[1], row[2], row[4], row[5]
    c, s, zero, two = row[6], row[7], np.float32(0.0), np.float32(2.0)
    by_shift = zero
    for u in range(of_contact.size):
        bears = stiff if closed[u] != zero else zero
        through = (factor[u] - of_torque[u]) * bears
        direct = force * of_force[u] if star[u] == number else zero
        direct += friction * of_friction[u] if closed[u] != zero else zero
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


@compiled
def _add_disc(sums: Single, axes: Single, z: Single, unit: Single, side: Any, total: Any) -> None:
    """Adds to `total` the weights of one disc (7, lanes) times the errors of disc and unit."""
    ex, ey, dx, dy, cx, cy = axes[0], axes[1], axes[2], axes[3], axes[4], axes[5]
    for u in range(side.size):
        a, lever, radial = sums[0, u], sums[1, u], sums[2, u]
        nx, ny, c, s = sums[3, u], sums[4, u], sums[5, u], sums[6, u]
        px, py = _turned(z[2, u], z[3, u], dx, dy)
        rx, ry = _turned(z[4, u], z[5, u], dx, dy)
        bx, by = _turned(z[10, u], z[11, u], dx, dy)
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


@compiled
def _add_tooth(row: Single, weight: Single, units: Any, of_tooth: Single, total: Any) -> None:
    """Adds to `total` the weights of one contact times the error of its tooth (units)."""
    for u in range(weight.size):
        total[4] += row[3] * weight[u] * of_tooth[units[u]]


@compiled
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


@compiled
def _weighed(
    of_turn: Single, of_preload: Single, of_peak: Single, of_friction: Single, first: int, units: Any
) -> tuple[int, int]:
    """Fills `units` with those from `first` on that have a weight.

    Returns the unit from which to go on, and the number of units.
    """
    count, u = 0, first
    while u < of_turn.size and count < units.size:
        if of_turn[u] != 0.0 or of_preload[u] != 0.0 or of_peak[u] != 0.0 or of_friction[u] != 0.0:
            units[count] = u
            count += 1
        u += 1
    return u, count


@compiled
def balance_slopes(
    weights: Any, contacts: Any, springs: Any, errors: Any, balance: Any, slopes: Any, total: Any
) -> None:
    """Adds to `total` (16) the slopes of the weighted sum of the outputs of one load case.

    `weights` (positions, units) are those of the turn, of the torque of the forward flanks, of the largest pin force
    and of the frictional torque. `balance`: turns and sides (positions, discs, units), and the contact
    (units) with that force; the rest as in `balances` and `touch_slopes`.
    """
    of_turn, of_preload, of_peak, of_friction = weights
    rows, pins, teeth, start, stop, axes = contacts
    stiff, force, lean, behind, friction = springs
    across, along, discs, circle = errors
    x, side, which = balance
    of_unit, of_discs, of_pins = slopes
    many, wide, zero = start.shape[1], 0, np.float32(0.0)
    for a in range(start.shape[0]):
        wide = max(wide, stop[a, many - 1, 1] - start[a, 0, 0])
    indices, nothing = np.empty(LANES, np.int64), np.zeros(LANES, np.float32)
    terms, weight = np.empty((8, LANES), np.float32), np.empty(LANES, np.float32)
    closed, sums = np.empty((wide, LANES), np.float32), np.empty((7, LANES), np.float32)
    rise, fixed, factor = np.empty((3, many, LANES), np.float32)
    bearing = np.empty(wide, np.bool_)
    for a in range(start.shape[0]):
        u, base = 0, start[a, 0, 0]
        while True:
            u, n = _weighed(of_turn[a], of_preload[a], of_peak[a], of_friction[a], u, indices)
            if n == 0:
                break
            units, lanes = indices[:n], slice(0, n)
            lane_across, lane_along, star = across[:, units], along[:, units], which[units]
            turn, torque, load = of_turn[a][units], of_preload[a][units], of_peak[a][units]
            rubbed = of_friction[a][units]
            toward, by_unit = side[a][:, units], of_unit[:, units]
            rise[:] = zero
            fixed[:] = zero
            for d in range(many):
                _disc(axes[a, d], discs[d][:, units], circle[:, units], terms)
                turned = x[a, d][units]
                for flank in range(2):
                    taken = torque if flank == 0 else nothing[lanes]
                    for i in range(start[a, d, flank], stop[a, d, flank]):
                        into, placed = closed[i - base, lanes], _placed(lane_along, pins, teeth, i)
                        _closed(rows[i], lane_across[pins[i]], placed, terms, turned, flank, into)
                        bearing[i - base] = _collect(
                            into,
                            stiff[i],
                            force[i],
                            friction[i],
                            i,
                            taken,
                            load,
                            rubbed,
                            star,
                            rise[d, lanes],
                            fixed[d, lanes],
                        )
            _factors(rise, fixed, toward, behind, turn, factor)
            for d in range(many):
                sums[:] = zero
                for flank in range(2):
                    taken = torque if flank == 0 else nothing[lanes]
                    for i in range(start[a, d, flank], stop[a, d, flank]):
                        if not bearing[i - base]:
                            continue
                        contact = rows[i], lean[i], stiff[i], force[i], friction[i], i
                        into, of_disc = closed[i - base, lanes], factor[d, lanes]
                        total[15] += _spread(contact, into, of_disc, taken, load, rubbed, star, weight[lanes], sums)
                        _add_pin(rows[i], weight[lanes], units, of_pins[:, pins[i]], total)
                        if teeth.size:
                            _add_tooth(rows[i], weight[lanes], units, of_pins[0, teeth[i]], total)
                _add_disc(sums, axes[a, d], of_discs[d][:, units], by_unit, toward[d], total)
