"""Outputs of elastic units under load, quasi-static and without hysteresis, with derivatives.

Pins press by a linear stiffness along their normals, and every disc turns the carrier through a
spring: the balances of `contact.mesh`, with gaps that are linear in the errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from importlib import import_module
from types import ModuleType
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from ....section import Array, Single
from ....units import ARCMIN
from ..contact.contact import LOST_MOTION_SHARE, Engine, uses_numba
from .contact import NAMES, Slopes, packed
from .errors import Lattice, Scaled, Table

# Stiffness and torques of a population under load.


LEAST_SHARE = 1e-4
"""Fraction of rated torque that replaces zero in the transmission error: one flank bears."""


@dataclass(frozen=True, slots=True)
class Loading:
    """Stiffness, both assumptions, and torques.

    `normal_stiffness` [N/m] of a pin contact along its normal, `series_stiffness` [N m/rad] between
    one disc and the carrier (`inf` without); `rated_torque` and `te_torque`, at which the
    transmission error is taken, [N m] at the carrier. Raises ValueError where one is not above 0
    (`te_torque`: below 0).
    """

    normal_stiffness: float = 2e8
    series_stiffness: float = 58.5 / ARCMIN
    rated_torque: float = 412.0
    te_torque: float = 412.0

    def __post_init__(self) -> None:
        wrong = [
            f"{field.name} must be above 0, got {getattr(self, field.name)}"
            for field in fields(self)
            if field.name != "te_torque" and not getattr(self, field.name) > 0.0
        ]
        if not self.te_torque >= 0.0:
            wrong.append(f"te_torque must not be below 0, got {self.te_torque}")
        if wrong:
            raise ValueError("; ".join(wrong))

    def torque(self, case: str) -> float:
        """Torque at the carrier [N m] in a load case.

        "forward" and "backward" are those of lost motion; "none" is no torque, "rated" and
        "te" are `rated_torque` and `te_torque`.
        """
        small = LOST_MOTION_SHARE * self.rated_torque
        return {
            "forward": small,
            "backward": -small,
            "none": 0.0,
            "rated": self.rated_torque,
            "te": max(self.te_torque, LEAST_SHARE * self.rated_torque),
        }[case]


@dataclass(frozen=True, slots=True, eq=False)
class Springs:
    """Stiffness by contact of a lattice, as the kernels take it.

    `stiff` [N m/arcmin] of a disc's turn against its mesh, `force` [N/arcmin] the growth of the
    pin's force, signed as its lever arm; `lean` [1/mm] is how the arm grows with the shift
    modification. `behind` [arcmin/(N m)] is the compliance between a disc and the carrier.
    """

    stiff: Single
    force: Single
    lean: Single
    behind: np.float32

    @classmethod
    def of(cls, table: Table, loading: Loading) -> Springs:
        """The springs of a loading at a table's modification."""
        force = loading.normal_stiffness * table.arm * ARCMIN
        behind = np.float32(1.0 / (loading.series_stiffness * ARCMIN))
        columns = (force * table.arm, force, table.arm_by_shift / table.arm)
        stiff, of_force, lean = (column.astype(np.float32) for column in columns)
        return cls(stiff, of_force, lean, behind)

    @property
    def arrays(self) -> tuple[Single, Single, Single, np.float32]:
        """The fields, as the kernels take them."""
        return self.stiff, self.force, self.lean, self.behind


CASES: Mapping[str, tuple[str, ...]] = {
    "lost_motion": ("forward", "backward"),
    "preload_torque": ("none",),
    "preload_torque_max": ("none",),
    "peak_pin_force": ("rated",),
    "transmission_error": ("te",),
}
"""Load cases of each output."""
OUTPUTS = tuple(CASES)
TE_POSITIONS = 251
"""Positions at which a unit's transmission error at rated torque is 3.6 % too small in the
mean, its 99 % quantile 2 %: the turn's waves of orders 39 to 80 are met at every phase. With
61 positions the deficits are 9 and 6 %, with 1021 they are 1 %. They are larger for primes that are
nearly a multiple of 1/k of the teeth (59: 26 %, 79, 97 and 137: 14 %, 127 and 157: 10 %)."""
HALF_ARCSEC = 30.0
"""Half an arc minute in arc seconds: from peak to peak to the transmission error."""


@dataclass(frozen=True, slots=True, eq=False)
class Balances:
    """Balances of n units at every position under the torques of load cases.

    `turn` (cases, positions, n) [arcmin] is the turn of the units against their meshes, `disc`
    (cases, positions, discs, n) [arcmin] that of every disc against its mesh, after play and
    springs, `side` of that shape the flank that takes its torque (0: none does). `preload`
    (positions, n) [N m] is the torque of the forward flanks in the case "none"; `peak` (n,) [N] the
    largest pin force in the case "rated", at position `peak_position` on contact `peak_contact`.
    """

    turn: Single
    disc: Single
    side: NDArray[np.int8]
    preload: Single
    peak: Single
    peak_position: NDArray[np.int32]
    peak_contact: NDArray[np.int32]

    @classmethod
    def empty(cls, cases: int, positions: int, discs: int, n: int) -> Balances:
        """Room for the balances of n units."""
        return cls(
            np.zeros((cases, positions, n), np.float32),
            np.zeros((cases, positions, discs, n), np.float32),
            np.zeros((cases, positions, discs, n), np.int8),
            np.zeros((positions, n), np.float32),
            np.zeros(n, np.float32),
            np.zeros(n, np.int32),
            np.zeros(n, np.int32),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Elastic:
    """Elastic outputs of n units: `values` by name, each (n,), for the requested ones of `OUTPUTS`.

    `lost_motion` [arcmin]: mean rotation over the turn at +3 % minus at -3 % of rated torque,
    without the involute stage. `preload_torque` [N m]: torque of the forward flanks, at the
    carrier, with no torque on it, mean over the turn, and `preload_torque_max` its maximum; 0 where
    no pin is squeezed, which play in the crank bearings does not release. `peak_pin_force` [N]:
    maximum over the turn at rated torque. `transmission_error` [arcsec]: half peak to peak of the
    rotation over the positions, at `te_torque`; see `TE_POSITIONS`.
    """

    lattice: Lattice
    table: Table
    units: Scaled
    springs: Springs
    cases: Mapping[str, int]
    balances: Balances
    values: Mapping[str, Array]
    engine: Engine

    def rotation(self, case: str) -> Array:
        """Rotation of the carrier [arcmin], (positions, n), in a load case of `cases`."""
        turn = self.balances.turn[self.cases[case]]
        return np.asarray(turn, dtype=float) / self.lattice.geometry.output_ratio

    def pull_back(self, errors: Slopes, weights: Mapping[str, Array]) -> Array:
        """Derivatives (names,) of sum(weight * output) by `NAMES`, for weights (n,) by output.

        Those of maxima are those of the position, and of the pin, that makes them.
        """
        total, units = np.zeros(len(NAMES)), packed(self.units)
        balances, lattice = self.balances, self.lattice
        kernel = _kernel("pull_back", self.engine)
        for case, by_kind in self._by_case(weights).items():
            rows = np.flatnonzero((by_kind != 0.0).any(axis=(0, 2)))
            kernel.pull_back(
                tuple(weight[rows] for weight in by_kind),
                (self.table.values, lattice.pin, lattice.start[rows], lattice.stop[rows], lattice.directions[rows]),
                self.springs.arrays,
                units,
                (balances.disc[case, rows], balances.side[case, rows], balances.peak_contact),
                (errors.of_unit, errors.of_discs, errors.of_pins),
                total,
            )
        total[NAMES.index("dr_rp")] *= 1e3  # from micrometres to millimetres
        return total

    def _by_case(self, weights: Mapping[str, Array]) -> dict[int, Single]:
        """By load case, weights (3, positions, n) of the turn, the forward flanks and the peak."""
        shape = self.balances.turn.shape[1:]
        by_case: dict[int, Single] = {}
        for name, weight in weights.items():
            for case in CASES[name]:
                at = self.cases[case]
                into = by_case.setdefault(at, np.zeros((3, *shape), np.float32))
                self._add(into, name, case, weight)
        return by_case

    def _add(self, into: Single, name: str, case: str, weight: Array) -> None:
        """Adds the weights of an output in a load case."""
        balances, ratio = self.balances, self.lattice.geometry.output_ratio
        positions, units = into.shape[1:]
        unit = np.arange(units)
        if name == "lost_motion":
            sign = 1.0 if case == "forward" else -1.0
            into[0] += sign * weight / (positions * ratio)
        elif name == "preload_torque":
            into[1] += weight * ratio / positions
        elif name == "preload_torque_max":
            into[1, balances.preload.argmax(axis=0), unit] += weight * ratio
        elif name == "peak_pin_force":
            into[2, balances.peak_position, unit] += weight
        else:
            turn = balances.turn[self.cases[case]]
            into[0, turn.argmax(axis=0), unit] += HALF_ARCSEC / ratio * weight
            into[0, turn.argmin(axis=0), unit] -= HALF_ARCSEC / ratio * weight


def elastic(
    lattice: Lattice,
    table: Table,
    units: Scaled,
    loading: Loading,
    engine: Engine = "auto",
    outputs: Sequence[str] = OUTPUTS,
) -> Elastic:
    """The outputs named, of all units; a load case is computed once for all that need it."""
    torques = list(dict.fromkeys(loading.torque(case) for name in outputs for case in CASES[name]))
    cases = {case: torques.index(loading.torque(case)) for name in outputs for case in CASES[name]}
    springs, ratio = Springs.of(table, loading), lattice.geometry.output_ratio
    balances = Balances.empty(len(torques), *lattice.shape, units.units)
    _kernel("compiled", engine).balances(
        (table.values, lattice.pin, lattice.start, lattice.stop, lattice.directions),
        springs.arrays,
        packed(units),
        np.array(torques) / ratio,
        cases.get("rated", -1),
        tuple(getattr(balances, field.name) for field in fields(balances)),
    )
    values = {name: _value(name, cases, balances, ratio) for name in outputs}
    return Elastic(lattice, table, units, springs, cases, balances, values, engine)


def _kernel(name: str, engine: Engine) -> ModuleType:
    return import_module(f".elastic_{name if uses_numba(engine) else 'arrays'}", __package__)


def _value(name: str, cases: Mapping[str, int], balances: Balances, ratio: float) -> Array:
    """An output (n,) from the balances."""
    turns = [balances.turn[cases[case]] for case in CASES[name]]
    if name == "lost_motion":
        return np.asarray(np.mean(turns[0] - turns[1], axis=0, dtype=np.float64) / ratio)
    if name == "preload_torque":
        return np.asarray(np.mean(balances.preload, axis=0, dtype=np.float64) * ratio)
    if name == "preload_torque_max":
        return np.asarray(balances.preload.max(axis=0).astype(np.float64) * ratio)
    if name == "peak_pin_force":
        return balances.peak.astype(np.float64)
    return np.asarray(np.ptp(turns[0], axis=0).astype(np.float64) * (HALF_ARCSEC / ratio))


# Derivatives of balances of torque, compiled by numba, by the pins that bear and the springs.
#
# With W and H the sums over the bearing pins of a disc of stiffness w and of w dh, play P closed in
# the direction of load and c the compliance behind the disc, a balance changes by
# dM = (W (db + ds -+ dP) - H)/(1 + c W), sum of dM = 0. The derivative of a turn, of the
# torque of a flank or of the force on a pin by each gap is a weight by contact; the turn of the disc
# takes the remaining change. All functions are in this file because numba's cache does not see
# changes of other files. Importing this needs numba.


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
