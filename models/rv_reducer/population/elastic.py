"""Outputs of elastic units under load, quasi-static and without hysteresis, with derivatives.

Pins press by a linear stiffness along their normals, and every disc turns the carrier through a
spring: the balances of `contact.mesh`, with gaps that are linear in the errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ....section import Array, Integers, Single
from ....units import ARCMIN
from ..contact.contact import LOST_MOTION_SHARE
from .contact import NAMES, Slopes, contacts_of, pack_errors
from .errors import Lattice, Scaled, Table

# Stiffness and torques of a population under load.


LEAST_SHARE = 1e-4
"""Fraction of rated torque that replaces zero in the transmission error: one flank bears."""


MAY_BE_ZERO = ("te_torque", "load_torque", "friction")


@dataclass(frozen=True, slots=True)
class Loading:
    """Stiffness, both assumptions, and torques.

    `normal_stiffness` [N/m] of a pin contact along its normal, `series_stiffness` [N m/rad] between
    one disc and the carrier (`inf` without); `rated_torque`, `te_torque`, at which the
    transmission error is taken, and `load_torque`, at which the pin force is (0: `rated_torque`),
    [N m] at the carrier; `friction` is the coefficient between a tooth and a pin that does not turn. Raises ValueError
    where one is not above 0 (the last three: below 0).
    """

    normal_stiffness: float = 2e8
    series_stiffness: float = 58.5 / ARCMIN
    rated_torque: float = 412.0
    te_torque: float = 412.0
    load_torque: float = 0.0
    friction: float = 0.08

    def __post_init__(self) -> None:
        wrong = [
            f"{field.name} must be above 0, got {getattr(self, field.name)}"
            for field in fields(self)
            if field.name not in MAY_BE_ZERO and not getattr(self, field.name) > 0.0
        ]
        for name in MAY_BE_ZERO:
            if not getattr(self, name) >= 0.0:
                wrong.append(f"{name} must not be below 0, got {getattr(self, name)}")
        if wrong:
            raise ValueError("; ".join(wrong))

    def torque(self, case: str) -> float:
        """Torque at the carrier [N m] in a load case.

        "forward" and "backward" are those of lost motion; "none" is no torque, "rated" and
        "te" are `load_torque`, else `rated_torque`, and `te_torque`; "whole" and "half" are that of
        `rated_torque`.
        """
        small = LOST_MOTION_SHARE * self.rated_torque
        return {
            "forward": small,
            "backward": -small,
            "none": 0.0,
            "rated": self.load_torque or self.rated_torque,
            "whole": self.rated_torque,
            "half": 0.5 * self.rated_torque,
            "te": max(self.te_torque, LEAST_SHARE * self.rated_torque),
        }[case]


@dataclass(frozen=True, slots=True, eq=False)
class Springs:
    """Stiffness by contact of a lattice, as the kernels take it.

    `stiff` [N m/arcmin] of a disc's turn against its mesh, `force` [N/arcmin] the growth of the
    pin's force, signed as its lever arm; `lean` [1/mm] is how the arm grows with the shift
    modification. `behind` [arcmin/(N m)] is the compliance between a disc and the carrier. `friction`
    [N m/arcmin] is the growth of the frictional torque at the carrier, signed as the lever arm.
    """

    stiff: Single
    force: Single
    lean: Single
    behind: np.float32
    friction: Single

    @classmethod
    def of(cls, lattice: Lattice, table: Table, loading: Loading) -> Springs:
        """The springs of a loading at a table's modification."""
        force = loading.normal_stiffness * table.arm * ARCMIN
        behind = np.float32(1.0 / (loading.series_stiffness * ARCMIN))
        friction = force * loading.friction * sliding_arms(lattice)
        columns = (force * table.arm, force, table.arm_by_shift / table.arm, friction)
        stiff, of_force, lean, of_friction = (column.astype(np.float32) for column in columns)
        return cls(stiff, of_force, lean, behind, of_friction)

    @property
    def arrays(self) -> tuple[Single, Single, Single, np.float32, Single]:
        """The fields, as the kernels take them."""
        return self.stiff, self.force, self.lean, self.behind, self.friction


def sliding_arms(lattice: Lattice) -> Array:
    """Distance [m] (contacts,) of contacts from the pitch point: r_p sqrt(1 + k1^2 - 2 k1 cos phi) - r_rp.

    A disc turns about the pitch point, as fast as the carrier, against pins that stand still: friction mu F at
    this arm is a torque at the carrier.
    """
    nominal = lattice.geometry.nominal
    root = np.sqrt(1.0 + nominal.k1**2 - 2.0 * nominal.k1 * np.cos(lattice.phase))
    return np.asarray(np.abs(nominal.pin_circle_radius * root - nominal.pin_radius))


CASES: Mapping[str, tuple[str, ...]] = {
    "lost_motion": ("forward", "backward"),
    "preload_torque": ("none",),
    "preload_torque_max": ("none",),
    "peak_pin_force": ("rated",),
    "transmission_error": ("te",),
    "stiffness": ("whole", "half"),
    "running_torque": ("none",),
}
"""Load cases of each output."""
OUTPUTS = tuple(CASES)
RUNNING = "running_torque"
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
    rotation over the positions, at `te_torque`; see `TE_POSITIONS`. `stiffness` [N m/arcmin]: the
    growth of the torque from half to all of the rated one over that of the mean rotation over the
    turn, as makers state it (b/a), without the involute stage. `running_torque` [N m]: friction of all
    squeezed pins, at the carrier, with no torque on it, mean over the turn.
    """

    lattice: Lattice
    table: Table
    units: Scaled
    springs: Springs
    cases: Mapping[str, int]
    balances: Balances
    values: Mapping[str, Array]

    def rotation(self, case: str) -> Array:
        """Rotation of the carrier [arcmin], (positions, n), in a load case of `cases`."""
        turn = self.balances.turn[self.cases[case]]
        return np.asarray(turn, dtype=float) / self.lattice.geometry.output_ratio

    def friction(self) -> Single:
        """Frictional torque of the pins at the carrier, without torque on it [N m], (positions, n)."""
        from . import kernel

        torque, errors = np.zeros_like(self.balances.preload), pack_errors(self.units)
        kernel.add_friction(
            contacts_of(self.lattice, self.table, errors[1]),
            self.springs.arrays,
            errors,
            self.balances.disc[self.cases["none"]],
            torque,
        )
        return torque

    def torque_rotation(self, torques: Array, chosen: Integers) -> Array:
        """Rotation of the carrier [arcmin], mean over the turn, of `chosen` units under `torques` [N m], by unit:
        (torques, units). Without friction and without the involute stage.
        """
        errors = tuple(np.ascontiguousarray(values[..., chosen]) for values in pack_errors(self.units))
        balances = _balanced(self.lattice, self.table, self.springs, errors, torques)
        return np.asarray(balances.turn.mean(axis=1, dtype=np.float64) / self.lattice.geometry.output_ratio)

    def pull_back(self, errors: Slopes, weights: Mapping[str, Array]) -> Array:
        """Derivatives (names,) of sum(weight * output) by `NAMES`, for weights (n,) by output.

        Those of maxima are those of the position, and of the pin, that makes them.
        """
        from . import kernel

        total, units = np.zeros(len(NAMES)), pack_errors(self.units)
        balances = self.balances
        for case, by_kind in self._by_case(weights).items():
            rows = np.flatnonzero((by_kind != 0.0).any(axis=(0, 2)))
            kernel.balance_slopes(
                tuple(weight[rows] for weight in by_kind),
                contacts_of(self.lattice, self.table, units[1], rows),
                self.springs.arrays,
                units,
                (balances.disc[case, rows], balances.side[case, rows], balances.peak_contact),
                (errors.of_unit, errors.of_discs, errors.of_pins),
                total,
            )
        total[NAMES.index("dr_rp")] *= 1e3  # from micrometres to millimetres
        return total

    def _by_case(self, weights: Mapping[str, Array]) -> dict[int, Single]:
        """By load case, weights (4, positions, n) of the turn, the forward flanks, the peak and friction."""
        shape = self.balances.turn.shape[1:]
        by_case: dict[int, Single] = {}
        for name, weight in weights.items():
            for case in CASES[name]:
                at = self.cases[case]
                into = by_case.setdefault(at, np.zeros((4, *shape), np.float32))
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
        elif name == "stiffness":
            sign = 1.0 if case == "half" else -1.0
            wind_up = _mean_change(balances, self.cases, name, ratio)
            into[0] += sign * weight * self.values[name] / wind_up / (positions * ratio)
        elif name == "preload_torque":
            into[1] += weight * ratio / positions
        elif name == "preload_torque_max":
            into[1, balances.preload.argmax(axis=0), unit] += weight * ratio
        elif name == "running_torque":
            into[3] += weight / positions
        elif name == "peak_pin_force":
            into[2, balances.peak_position, unit] += weight
        else:
            turn = balances.turn[self.cases[case]]
            into[0, turn.argmax(axis=0), unit] += HALF_ARCSEC / ratio * weight
            into[0, turn.argmin(axis=0), unit] -= HALF_ARCSEC / ratio * weight


def elastic(
    lattice: Lattice, table: Table, units: Scaled, loading: Loading, outputs: Sequence[str] = OUTPUTS
) -> Elastic:
    """The outputs named, of all units; a load case is computed once for all that need it."""
    torques = list(dict.fromkeys(loading.torque(case) for name in outputs for case in CASES[name]))
    cases = {case: torques.index(loading.torque(case)) for name in outputs for case in CASES[name]}
    springs, ratio = Springs.of(lattice, table, loading), lattice.geometry.output_ratio
    balances = _balanced(lattice, table, springs, pack_errors(units), np.array(torques), cases.get("rated", -1))
    values = {name: _value(name, cases, balances, ratio, loading) for name in outputs if name != RUNNING}
    found = Elastic(lattice, table, units, springs, cases, balances, values)
    if RUNNING in outputs:
        values[RUNNING] = found.friction().mean(axis=0, dtype=np.float64)
    return found


def _balanced(
    lattice: Lattice, table: Table, springs: Springs, errors: tuple[Single, ...], torques: Array, rated: int = -1
) -> Balances:
    """Balances of units of packed `errors` under torques (cases,) [N m]; the largest pin force in the case `rated`."""
    from . import kernel

    balances = Balances.empty(len(torques), *lattice.shape, errors[0].shape[1])
    kernel.balances(
        contacts_of(lattice, table, errors[1]),
        springs.arrays,
        errors,
        torques / lattice.geometry.output_ratio,
        rated,
        tuple(getattr(balances, field.name) for field in fields(balances)),
    )
    return balances


def _mean_change(balances: Balances, cases: Mapping[str, int], name: str, ratio: float) -> Array:
    """Mean rotation over the turn (n,) [arcmin] from the second to the first load case of an output."""
    first, second = (balances.turn[cases[case]] for case in CASES[name])
    return np.asarray(np.mean(first - second, axis=0, dtype=np.float64) / ratio)


def _value(name: str, cases: Mapping[str, int], balances: Balances, ratio: float, loading: Loading) -> Array:
    """An output (n,) from the balances."""
    if name == "lost_motion":
        return _mean_change(balances, cases, name, ratio)
    if name == "stiffness":
        return (loading.torque("whole") - loading.torque("half")) / _mean_change(balances, cases, name, ratio)
    if name == "preload_torque":
        return np.asarray(np.mean(balances.preload, axis=0, dtype=np.float64) * ratio)
    if name == "preload_torque_max":
        return np.asarray(balances.preload.max(axis=0).astype(np.float64) * ratio)
    if name == "peak_pin_force":
        return balances.peak.astype(np.float64)
    turn = balances.turn[cases[CASES[name][0]]]
    return np.asarray(np.ptp(turn, axis=0).astype(np.float64) * (HALF_ARCSEC / ratio))
