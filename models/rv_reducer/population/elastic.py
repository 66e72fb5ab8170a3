"""What elastic units show under load, quasi-static and without hysteresis, with derivatives.

Pins press by a linear stiffness along their normals, and every disc turns the carrier through a
spring: the balances of `contact.mesh`, with gaps that are linear in the errors.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from ....units import ARCMIN
from ..contact.performance import LOST_MOTION_SHARE
from .gradient import NAMES, Slopes
from .lattice import Lattice
from .scaled import Scaled
from .table import Table
from .touch import Engine, Single, packed, uses_numba

Array = NDArray[np.float64]
OUTPUTS = (
    "lost_motion",
    "preload_torque",
    "preload_torque_max",
    "peak_pin_force",
    "transmission_error",
)
LEAST_SHARE = 1e-4
"""Share of the rated torque that stands for none in the transmission error: one flank bears."""


@dataclass(frozen=True, slots=True)
class Loading:
    """Stiffness and torques.

    `normal_stiffness` [N/m] of a pin contact along its normal, `series_stiffness` [N m/rad] between
    one disc and the carrier (`inf` without); `rated_torque` and `te_torque`, at which the
    transmission error is taken, [N m] at the carrier.
    """

    normal_stiffness: float = 2e8
    series_stiffness: float = 58.5 / ARCMIN
    rated_torque: float = 412.0
    te_torque: float = 412.0

    def torque(self, case: str) -> float:
        """Torque of a load case [N m]."""
        least = LEAST_SHARE * self.rated_torque
        small = LOST_MOTION_SHARE * self.rated_torque
        return {
            "forward": small,
            "backward": -small,
            "none": 0.0,
            "rated": self.rated_torque,
            "te": max(self.te_torque, least),
        }[case]


@dataclass(frozen=True, slots=True, eq=False)
class Balances:
    """Balances of n units at every position under the torques of load cases.

    `turn` (cases, positions, n) [arcmin] is what the units turn their meshes by, `disc`
    (cases, positions, discs, n) [arcmin] what each disc is turned by against its mesh, after play
    and springs, `side` of that shape the flank that takes its torque (0: none does). `preload`
    (positions, n) [N m] is the torque of the forward flanks in the case without torque; `peak` (n,)
    [N] the largest pin force over the positions in the case "rated", at position `where` on contact
    `which`.
    """

    turn: Single
    disc: Single
    side: NDArray[np.int8]
    preload: Single
    peak: Single
    where: NDArray[np.int32]
    which: NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Springs:
    """Stiffness by contact of a lattice: `stiff` [N m/arcmin] and `force` [N/arcmin] (signed).

    `behind` [arcmin/(N m)] is the compliance of a disc's spring, `lean` [1/mm] by contact how the
    lever arm grows with the shift modification.
    """

    stiff: Single
    force: Single
    lean: Single
    behind: np.float32

    @classmethod
    def of(cls, table: Table, loading: Loading) -> Springs:
        """The springs of a loading at a table's modification."""
        force = loading.normal_stiffness * table.arm * ARCMIN
        single = [
            np.asarray(one, dtype=np.float32)
            for one in (force * table.arm, force, table.arm_by_shift / table.arm)
        ]
        return cls(*single, np.float32(1.0 / (loading.series_stiffness * ARCMIN)))


@dataclass(frozen=True, slots=True, eq=False)
class Elastic:
    """Elastic outputs of n units, each (n,) and present where it was asked for, by `OUTPUTS`.

    `lost_motion` [arcmin]: mean rotation over the turn at +3 % minus at -3 % of rated torque,
    without the involute stage. `preload_torque` [N m]: torque of the forward flanks at the carrier
    without torque on it, mean over the turn, and `preload_torque_max` its maximum; 0 where no pin
    is squeezed. `peak_pin_force` [N]: maximum over the turn at rated torque. `transmission_error`
    [arcsec]: half peak to peak over the positions, at `te_torque`. `values` holds them by name.
    """

    lattice: Lattice
    table: Table
    units: Scaled
    springs: Springs
    cases: tuple[str, ...]
    balances: Balances
    values: Mapping[str, Array]
    engine: Engine

    def rotation(self, case: str) -> Array:
        """Rotation of the carrier [arcmin], (positions, n), in a load case of `cases`."""
        turn = self.balances.turn[self.cases.index(case)]
        return np.asarray(turn, dtype=float) / self.lattice.geometry.output_ratio

    def pull_back(self, errors: Slopes, weights: Mapping[str, Array]) -> Array:
        """Derivatives (names,) of sum(weight * output) by `NAMES`, for weights (n,) by output.

        Those of maxima are those of the position, and of the pin, that makes them.
        """
        total = np.zeros(len(NAMES))
        discs, circle = packed(self.units)
        springs, found, lattice = self.springs, self.balances, self.lattice
        kernel = _kernel("pull_back", self.engine)
        for case, of_turn, of_preload, of_peak in self._weights(weights):
            at = self.cases.index(case)
            rows = np.flatnonzero(np.any((of_turn != 0) | (of_preload != 0) | (of_peak != 0), 1))
            kernel.pull_back(
                of_turn[rows], of_preload[rows], of_peak[rows], found.which, self.table.values,
                springs.lean, springs.stiff, springs.force, lattice.pin, lattice.start[rows],
                lattice.stop[rows], lattice.directions[rows], self.units.across, self.units.along,
                discs, circle, springs.behind, found.disc[at, rows], found.side[at, rows],
                errors.of_unit, errors.of_discs, errors.of_pins, total,
            )  # fmt: skip
        total[14] *= 1e3
        return total

    def _weights(
        self, weights: Mapping[str, Array]
    ) -> Iterator[tuple[str, Single, Single, Single]]:
        """By load case, weights (positions, n) of the turn, the forward flanks and the peak."""
        shape = self.balances.turn.shape[1:]
        ratio, every = self.lattice.geometry.output_ratio, np.arange(shape[1])
        by_case = {case: np.zeros((3, *shape), np.float32) for case in self.cases}
        for name, weight in weights.items():
            if name == "lost_motion":
                by_case["forward"][0] += weight / (shape[0] * ratio)
                by_case["backward"][0] -= weight / (shape[0] * ratio)
            elif name == "preload_torque":
                by_case["none"][1] += weight / shape[0] * ratio
            elif name == "preload_torque_max":
                by_case["none"][1][self.balances.preload.argmax(axis=0), every] += weight * ratio
            elif name == "peak_pin_force":
                by_case["rated"][2][self.balances.where, every] += weight
            elif name == "transmission_error":
                case = _te_case(self.cases)
                turn = self.balances.turn[self.cases.index(case)]
                by_case[case][0][turn.argmax(axis=0), every] += 30.0 / ratio * weight
                by_case[case][0][turn.argmin(axis=0), every] -= 30.0 / ratio * weight
            else:
                raise KeyError(name)
        yield from ((case, *of) for case, of in by_case.items() if np.any(of))


def elastic(
    lattice: Lattice,
    table: Table,
    units: Scaled,
    loading: Loading,
    engine: Engine = "auto",
    outputs: Sequence[str] = OUTPUTS,
) -> Elastic:
    """The elastic outputs named, of all units."""
    cases = _cases(outputs, loading)
    springs = Springs.of(table, loading)
    ratio = lattice.geometry.output_ratio
    torques = np.array([loading.torque(case) for case in cases]) / ratio
    found = balances(lattice, table, units, springs, cases, torques, engine)
    values = _values(outputs, cases, found, ratio)
    return Elastic(lattice, table, units, springs, cases, found, values, engine)


def balances(
    lattice: Lattice,
    table: Table,
    units: Scaled,
    springs: Springs,
    cases: tuple[str, ...],
    torques: Array,
    engine: Engine,
) -> Balances:
    """Balances under torques [N m] on the discs, by load case."""
    (positions, discs), n = lattice.shape, units.units
    found = Balances(
        np.zeros((len(cases), positions, n), np.float32),
        np.zeros((len(cases), positions, discs, n), np.float32),
        np.zeros((len(cases), positions, discs, n), np.int8),
        np.zeros((positions, n), np.float32),
        np.zeros(n, np.float32),
        np.zeros(n, np.int32),
        np.zeros(n, np.int32),
    )
    rated = cases.index("rated") if "rated" in cases else -1
    _kernel("compiled", engine).balances(
        table.values, springs.stiff, springs.force, lattice.pin, lattice.start, lattice.stop,
        lattice.directions, units.across, units.along, *packed(units), springs.behind, torques,
        rated, found.disc, found.side, found.turn, found.preload, found.peak, found.where,
        found.which,
    )  # fmt: skip
    return found


def _kernel(name: str, engine: Engine):
    return import_module(f".elastic_{name}" if uses_numba(engine) else ".elastic_arrays", __package__)


def _cases(outputs: Sequence[str], loading: Loading) -> tuple[str, ...]:
    """Load cases that outputs need, in the order of their balances."""
    needed: list[str] = []
    if "lost_motion" in outputs:
        needed += ["forward", "backward"]
    if "preload_torque" in outputs or "preload_torque_max" in outputs:
        needed += ["none"]
    if "peak_pin_force" in outputs:
        needed += ["rated"]
    if "transmission_error" in outputs and not (
        "rated" in needed and loading.te_torque == loading.rated_torque
    ):
        needed += ["te"]
    return tuple(needed)


def _te_case(cases: tuple[str, ...]) -> str:
    return "te" if "te" in cases else "rated"


def _values(
    outputs: Sequence[str], cases: tuple[str, ...], found: Balances, ratio: float
) -> dict[str, Array]:
    values = {}
    turn = {case: found.turn[at] for at, case in enumerate(cases)}
    for name in outputs:
        if name == "lost_motion":
            value = np.mean(turn["forward"] - turn["backward"], axis=0, dtype=float) / ratio
        elif name == "preload_torque":
            value = np.mean(found.preload, axis=0, dtype=float) * ratio
        elif name == "preload_torque_max":
            value = np.max(found.preload, axis=0) * ratio
        elif name == "peak_pin_force":
            value = found.peak
        else:
            value = np.ptp(turn[_te_case(cases)], axis=0) * 30.0 / ratio
        values[name] = np.asarray(value, dtype=float)
    return values
