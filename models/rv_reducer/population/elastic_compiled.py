"""Balances of torque of many units, compiled by numba: positions, discs, pins, and units innermost.

Newton's method on the pins of the loaded flank alone, for many units side by side, converges from
any start because the torque is convex in the turn. Units where a pin of the other flank bears too,
and those without torque, are solved one by one with bounds. Turns are those of discs against the
mesh in arc minutes; stiffness and torque are N m per arc minute and N m. The formulas are those of
`elastic_arrays`. All functions are in this file because numba's cache does not see changes of
other files. Importing this needs numba.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from ....section import Single

Mesh = tuple[Single, Single, Any]
"""Gaps (contacts, lanes), stiffness (contacts), and contacts by disc and flank (discs, 2, 2)."""
Discs = tuple[Single, Single, Single, Any]
"""Terms (discs, 8, lanes), first contact backward and forward (discs, lanes), and their rests."""
State = tuple[Single, Any, Single, Single]
"""Turns of discs, flanks that take their torque (discs, lanes); turn of the unit, depth (lanes)."""
LANES = 128
"""Units solved side by side, so that they stay in the cache."""
_STEPS = 60
_SETTLED = np.float32(2e-6)
"""Change [arcmin] of a disc's turn below which Newton's method has ended."""
_FAR = np.float32(1e9)
_NUDGE = 1e-6
"""Turn [arcmin] beyond first contact from which a balance starts where nothing bears."""


def _compiled(function: Any) -> Any:
    return numba.njit(cache=True, error_model="numpy", fastmath=True, nogil=True)(function)


@_compiled
def _disc(axes: Single, disc: Single, circle: Single, terms: Single) -> None:
    """Fills `terms` (8, lanes) of one disc at one position, as in `compiled`."""
    ex, ey, dx, dy, cx, cy = axes[0], axes[1], axes[2], axes[3], axes[4], axes[5]
    for u in range(terms.shape[1]):
        terms[0, u], terms[1, u] = disc[0, u], disc[1, u]
        x = disc[4, u] * ex - disc[5, u] * ey + disc[6, u] * dx - disc[7, u] * dy
        y = disc[4, u] * ey + disc[5, u] * ex + disc[6, u] * dy + disc[7, u] * dx
        terms[2, u], terms[3, u] = circle[0, u] - x, circle[1, u] - y
        terms[4, u] = disc[10, u] * dx - disc[11, u] * dy
        terms[5, u] = disc[10, u] * dy + disc[11, u] * dx
        terms[6, u] = disc[2, u]
        terms[7, u] = disc[3, u] - (disc[8, u] * cy + disc[9, u] * cx)


@_compiled
def _gaps(rows: Single, pins: Any, across: Single, along: Single, terms: Single, first: int, gaps: Single) -> None:
    """Fills `gaps` (contacts, lanes) from row `first` on with turns to contact."""
    for i in range(rows.shape[0]):
        j = pins[i]
        row = rows[i]
        gap, lever, radial, tangential = row[0], row[1], row[2], row[3]
        nx, ny, c, s = row[4], row[5], row[6], row[7]
        opening, shifted, into = across[j], along[j], gaps[first + i]
        for u in range(terms.shape[1]):
            h = gap + lever * (opening[u] + terms[0, u]) + radial * terms[1, u]
            h += tangential * shifted[u] + nx * terms[2, u] + ny * terms[3, u]
            into[u] = h + c * terms[4, u] + s * terms[5, u]


@_compiled
def _bounds(gaps: Single, span: Any, low: Single, high: Single) -> None:
    """First contact of one disc backward and forward; `span` (2, 2) is its contacts by flank."""
    high[:], low[:] = _FAR, -_FAR
    for i in range(span[0, 0], span[1, 1]):
        gap, forward = gaps[i], i < span[0, 1]
        for u in range(high.size):
            high[u] = min(high[u], gap[u] if forward else _FAR)
            low[u] = max(low[u], -_FAR if forward else gap[u])


@_compiled
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


@_compiled
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
    turn_of_unit[:], wrong[:] = need, True
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


@_compiled
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


@_compiled
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


@_compiled
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


@_compiled
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


@_compiled
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


@_compiled
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


@_compiled
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


@_compiled
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


@_compiled
def balances(contacts: Any, springs: Any, errors: Any, torques: Any, rated: int, into: Any) -> None:
    """Balances of all units at all positions under `torques` (cases) on the discs.

    `contacts` and `errors` as in `compiled.touch`; `springs` in the order of the fields of
    `Springs`. Fills `into`, arrays in the order of the fields of `elastic.Balances`: turns, discs
    and sides of every case, the preload of the case without torque, and the peak with its position
    and contact of the case `rated`, if any.
    """
    rows, pins, start, stop, axes = contacts
    stiff, force, _, behind = springs
    across, along, discs, circle = errors
    turn, x, side, preload, peak, where, which = into
    many, wide = start.shape[1], 0
    for a in range(start.shape[0]):
        wide = max(wide, stop[a, many - 1, 1] - start[a, 0, 0])
    spans = np.empty((many, 2, 2), np.int64)
    for first in range(0, across.shape[1], LANES):
        last = min(first + LANES, across.shape[1])
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
                spans[d, :, 0], spans[d, :, 1] = start[a, d] - i, stop[a, d] - i
                _disc(axes[a, d], of_discs[d], centre, terms[d])
                table, numbers = rows[begin:end], pins[begin:end]
                _gaps(table, numbers, opening, shifted, terms[d], begin - i, gaps)
                _bounds(gaps, spans[d], low[d], high[d])
            mesh = gaps, stiff[i : i + wide], spans
            _rests(mesh, of_lanes)
            for case in range(torques.size):
                state = place[case], toward[case], turned[case], depth[case]
                _case(mesh, of_lanes, behind, torques[case], state, preload[a, first:last], work)
                if case == rated:
                    _largest(mesh, force[i : i + wide], place[case], a, i, peaks)
            x[:, a, :, first:last], side[:, a, :, first:last] = place, toward
            turn[:, a, first:last] = turned
