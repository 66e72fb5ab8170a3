"""The kinds of measurement: their points, tables, simulations and hidden mechanisms."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.gap.generator import approximate, memory, tables
from benchmarks.gap.generator.assemblies import ASSEMBLY, Builds, Faults, assembled, builds
from benchmarks.gap.generator.hysteresis import LOCKED
from benchmarks.gap.generator.manipulators import (
    MANIPULATOR,
    OUTPUTS,
    OUTSIDE_POSES,
    POOR_POSES,
    SCALES,
    of_poses,
    poses,
    upright,
)
from benchmarks.gap.generator.mechanisms import ROTATING, Injected
from benchmarks.gap.generator.noise import NOISES
from benchmarks.gap.generator.populations import BATCH, POOR_BATCH, Units, units
from benchmarks.gap.generator.tables import POOR, Array, Points

Draw = Callable[[np.random.Generator, Any], Injected]
Simulator = Callable[[Any, int], Array]
"""Predictions at points, all outputs one after the other (m n,); the number is a seed."""
WITHOUT_ZERO = ("backlash_arcmin", "_mm", "_Nm")
"""How outputs end that are no angles, or a population's: their zero is not free."""


@dataclass(frozen=True)
class Kind:
    """A kind of measurement; a `population` has no noise but that of its units.

    `columns` makes the table, `roles` its roles and units for `model = "table"`. Outputs that are
    not equally noisy are in units of their `scales` until they come into the table. `outside` are
    its own causes that no effect of the library has, `parameters` those of the model.
    """

    model: str
    outputs: tuple[str, ...]
    unit: str
    points: Callable[[np.random.Generator, int, str | None], Any]
    columns: Callable[[Any], Mapping[str, NDArray[Any]]]
    mechanisms: Mapping[str, Draw]
    simulate: Simulator | None
    ways: tuple[str, ...]
    noises: tuple[str, ...] = tuple(NOISES)
    roles: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    population: bool = False
    scales: tuple[float, ...] = ()
    outside: Mapping[str, Draw] = field(default_factory=dict)
    parameters: Mapping[str, str] = field(default_factory=dict)

    @property
    def zeros(self) -> NDArray[np.bool_]:
        """Which outputs (m,) have a zero that is free."""
        return np.array([not one.endswith(WITHOUT_ZERO) for one in self.outputs])

    @property
    def sizes(self) -> Array:
        """The scale (m,) of each output."""
        return np.array(self.scales or np.ones(len(self.outputs)))

    def free(self, n: int) -> Array:
        """Gradient (m n, k) of the zeros that are always free."""
        zeros = np.eye(len(self.outputs))[:, self.zeros]
        return np.asarray(np.repeat(zeros, n, axis=0), dtype=np.float64)


def bench(at: Points, _: int, scale: float = 1.0) -> Array:
    """The trial's own simulation: wind-up, softer near zero, and the ripple of the teeth."""
    windup = at.torque / 108.0 + 0.2 * np.tanh(at.torque / 30.0)
    ripple = 0.02 * np.sin(1560.0 * at.angle)
    return 60.0 * scale * (windup + ripple)


def smooth(at: Points, _: int = 0) -> Array:
    """The bench's simulation without its ripple."""
    return 60.0 * (at.torque / 108.0 + 0.2 * np.tanh(at.torque / 30.0))


def late(rng: np.random.Generator, at: tables.Moving) -> Injected:
    """The channel of the output is recorded some steps after those of the inputs, or before."""
    by = float(rng.choice([-1.0, 1.0])) * rng.uniform(0.5, 8.0) * at.pace
    return Injected(smooth(at.sooner(by)) - smooth(at))


def static(at: Points, _: int) -> Array:
    """A drive that holds its load, without friction."""
    return at.torque


def assembly(at: Builds, _: int) -> Array:
    return assembled(at, Faults()).T.ravel()


def of_batch(at: Units) -> dict[str, NDArray[Any]]:
    lots = np.array([f"lot {'ABCDE'[one]}" for one in at.lot.tolist()], dtype=object)
    return {"unit": np.arange(1, len(at) + 1), "lot": lots, "temperature_C": at.tau + 20.0}


def of_assembly(at: Builds) -> dict[str, NDArray[Any]]:
    errors = {f"dtheta_{one + 1}_mrad": at.errors[:, one] for one in range(4)}
    return {"unit": np.arange(1, len(at) + 1), **errors, "precision_weight": at.weight}


def roles(kind: str) -> dict[str, tuple[str, str]]:
    found = {
        "output_angle_deg": ("angle", "deg"),
        "torque_Nm": ("torque", "N m"),
        "output_speed_rpm": ("speed", "rpm"),
        "temperature_C": ("temperature", "degC"),
        "direction": ("direction", ""),
        "time_s": ("time", "s"),
    }
    return {name: found[name] for name in tables.NAMES[kind]}


TABLE = "table"
ROTATING_TABLE = Kind(
    TABLE, ("te_arcsec",), "arcsec", tables.points, partial(tables.as_columns, kind="rotating"),
    ROTATING, bench, tuple(POOR), roles=roles("rotating"),
)  # fmt: skip
LOCKED_TABLE = Kind(
    TABLE, ("twist_arcmin",), "arcmin", tables.loops,
    partial(tables.as_columns, kind="lost_motion"), LOCKED, partial(bench, scale=1.0 / 60.0),
    ("temperature follows time",), roles=roles("lost_motion"),
)  # fmt: skip
OF_TEETH = ("pin_circle_runout", "eccentric_error", "two_disc_error", "sun_runout", "load_sharing",
            "pitch_defect")  # fmt: skip
OF_ONE_ORDER = OF_TEETH[:2]


def any_order(rng: np.random.Generator, at: Points) -> Injected:
    """A wave of pins or cranks whose gear nobody declared: its number is its name."""
    return ROTATING[str(rng.choice(OF_ONE_ORDER))](rng, at)


KINDS: dict[str, Kind] = {
    "rotating": ROTATING_TABLE,
    "own gear": replace(ROTATING_TABLE, points=tables.own_gear,
                        mechanisms={name: ROTATING[name] for name in OF_TEETH}),
    "unknown gear": replace(ROTATING_TABLE, points=partial(tables.own_gear, declared=False),
                            mechanisms={"gear_order": any_order}),
    "late": replace(ROTATING_TABLE, points=tables.in_motion, mechanisms={"delay": late},
                    simulate=smooth, noises=("white",)),
    "bench": replace(ROTATING_TABLE, mechanisms=approximate.BENCH),
    "friction": replace(ROTATING_TABLE, outputs=("friction_Nm",), unit="N m", points=tables.in_motion,
                        mechanisms=approximate.FRICTION, simulate=static, noises=("white", "outliers")),
    "presliding": replace(ROTATING_TABLE, outputs=("friction_Nm",), unit="N m", points=memory.driven,
                          mechanisms=memory.PRESLIDING, simulate=static, noises=("white", "outliers")),
    "yielding": replace(ROTATING_TABLE, points=memory.driven, mechanisms=memory.YIELDING, simulate=smooth,
                        noises=("white", "outliers")),
    "plays": replace(ROTATING_TABLE, outputs=("friction_Nm",), unit="N m", points=memory.driven,
                     mechanisms=memory.PLAYS, simulate=static, noises=("white",)),
    "lost_motion": LOCKED_TABLE,
    "rv_transmission": replace(ROTATING_TABLE, model="rv_transmission", simulate=None),
    "rv_lost_motion": replace(LOCKED_TABLE, model="rv_lost_motion", simulate=None),
    "rv_batch": Kind(
        "rv_batch", WITHOUT_ZERO[:1], "arcmin", units, of_batch, BATCH, None, POOR_BATCH, ("white",),
        population=True, parameters={"model": "document"},  # whose law the causes of BATCH follow
    ),
    "assembly": Kind(
        "assembly", tuple(f"delta_{one}_mrad" for one in range(1, 5)), "mrad", builds, of_assembly,
        ASSEMBLY, assembly, ("chain 2 like chain 1",), ("white", "outliers", "quantised"),
    ),
    "manipulator_pose": Kind(
        "manipulator_pose", OUTPUTS, "mm", poses, of_poses, MANIPULATOR, upright, POOR_POSES,
        scales=tuple(SCALES.tolist()), outside=OUTSIDE_POSES,
    ),
}  # fmt: skip
