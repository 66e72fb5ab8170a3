"""Declarations of the model `serial_arm`: nominal table, errors, and free parameters."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...section import Array, Output, Parameter, Section, Value, completed
from ...units import MM, MRAD, UM
from ..inputs import Distribution
from ..measurable import NO_CHANGES, Column, MeasurableModel
from . import MAX_JOINTS
from .kinematics import Chain, positions

DEG = np.pi / 180.0
SI = {"mm": MM, "um": UM, "deg": DEG, "mrad": MRAD}
"""SI units in the units of the declarations."""
TABLE: Mapping[str, tuple[str, str]] = {
    "d": ("mm", "offset along the axis of joint"),
    "a": ("mm", "length of the common normal after joint"),
    "alpha": ("deg", "twist about the common normal after joint"),
    "offset": ("deg", "angle that is added to the measured angle of joint"),
}
"""Columns of the Denavit-Hartenberg table: unit and meaning."""
ERRORS: Mapping[str, tuple[str, str, float]] = {
    "zero": ("mrad", "error of the zero of joint", 20.0),
    "d": ("um", "error of d of joint", 5000.0),
    "a": ("um", "error of a of joint", 5000.0),
    "alpha": ("mrad", "error of alpha of joint", 20.0),
    "beta": ("mrad", "rotation about y after joint (Hayati)", 20.0),
}
"""The five errors of a joint: unit, meaning, and the tolerance that a recalibration has."""
BASE = ("x", "y", "z", "rx", "ry", "rz")
TOOL = ("x", "y", "z")
_UR5 = {
    "d": (89.159, 0.0, 0.0, 109.15, 94.65, 82.3),
    "a": (0.0, -425.0, -392.25, 0.0, 0.0, 0.0),
    "alpha": (90.0, 0.0, 0.0, 90.0, -90.0, 0.0),
    "offset": (0.0,) * 6,
}
_SOURCE = "Universal Robots, DH parameters of the UR5"


def frame_units(axis: str) -> tuple[str, str]:
    """Units of a coordinate of base or tool, and of its error."""
    return ("deg", "mrad") if axis.startswith("r") else ("mm", "um")


def _nominal(column: str, joint: int) -> Parameter:
    unit, meaning = TABLE[column]
    default = _UR5[column][joint - 1] if joint <= len(_UR5[column]) else 0.0
    return Parameter(nominal(column, joint), default, unit, f"{meaning} {joint}", _SOURCE)


def nominal(column: str, joint: int) -> str:
    """Name of a nominal number of the table."""
    return f"nominal_{column}_{joint}_{TABLE[column][0]}"


def error(kind: str, joint: int) -> str:
    """Name of an error of a joint."""
    return f"{kind}_{joint}_{ERRORS[kind][0]}"


def joint_of(name: str) -> int:
    """The joint that a parameter belongs to; 0 for base, tool and the whole arm."""
    return int(next((part for part in name.split("_") if part.isdigit()), 0))


def _frame(stem: str, axes: tuple[str, ...]) -> list[Parameter]:
    """Nominal place of base or tool in the measurement, and its error."""
    parameters = []
    for axis in axes:
        unit, error_unit = frame_units(axis)
        meaning = f"{'position' if unit == 'mm' else 'rotation vector'} of the {stem}, {axis[-1]}"
        parameters += [
            Parameter(f"nominal_{stem}_{axis}_{unit}", 0.0, unit, meaning),
            Parameter(f"{stem}_{axis}_{error_unit}", 0.0, error_unit, f"error of the {meaning}"),
        ]
    return parameters


PARAMETERS: tuple[Parameter, ...] = (
    Parameter("joints", 6, "", "revolute joints of the chain", _SOURCE, low=1, high=MAX_JOINTS),
    *(_nominal(column, joint) for joint in range(1, MAX_JOINTS + 1) for column in TABLE),
    *(
        Parameter(error(kind, joint), 0.0, unit, f"{meaning} {joint}", low=-inf)
        for joint in range(1, MAX_JOINTS + 1)
        for kind, (unit, meaning, _) in ERRORS.items()
    ),
    *_frame("base", BASE),
    *_frame("tool", TOOL),
)


def free_of(parameters: Mapping[str, Value]) -> dict[str, float]:
    """Tolerances of the parameters that a recalibration moves: errors of joints, base and tool.

    beta replaces d where the next axis is parallel; one of the two is sufficient.
    """
    values = completed(PARAMETERS, parameters)
    bounds = {}
    for joint in range(1, int(float(str(values["joints"]))) + 1):
        parallel = float(str(values[nominal("alpha", joint)])) % 180.0 == 0.0
        for kind, (_, _, tolerance) in ERRORS.items():
            if kind != ("d" if parallel else "beta"):
                bounds[error(kind, joint)] = tolerance
    for stem, axes in (("base", BASE), ("tool", TOOL)):
        for axis in axes:
            _, unit = frame_units(axis)
            bounds[f"{stem}_{axis}_{unit}"] = 20.0 if unit == "mrad" else 5000.0
    return bounds


def chain_of(parameters: Mapping[str, Value]) -> Chain:
    """The chain (SI) of parameters by declared name; omitted ones keep their defaults."""
    p = {n: v for n, v in completed(PARAMETERS, parameters).items() if isinstance(v, int | float)}
    joints = range(1, int(p["joints"]) + 1)

    def nominals(column: str) -> np.ndarray:
        return SI[TABLE[column][0]] * np.array([p[nominal(column, joint)] for joint in joints], dtype=float)

    def errors(kind: str) -> np.ndarray:
        return SI[ERRORS[kind][0]] * np.array([p[error(kind, joint)] for joint in joints], dtype=float)

    def coordinate(stem: str, axis: str) -> float:
        unit, error_unit = frame_units(axis)
        return p[f"nominal_{stem}_{axis}_{unit}"] * SI[unit] + p[f"{stem}_{axis}_{error_unit}"] * SI[error_unit]

    return Chain(
        zero=nominals("offset") + errors("zero"),
        d=nominals("d") + errors("d"),
        a=nominals("a") + errors("a"),
        alpha=nominals("alpha") + errors("alpha"),
        beta=errors("beta"),
        base=np.array([coordinate("base", axis) for axis in BASE]),
        tool=np.array([coordinate("tool", axis) for axis in TOOL]),
    )


# `[[joint]]`, `[base]` and `[tool]`: a serial arm as a configuration writes it.


TABLES = ("joint", "base", "tool")
OF_ALLOCATIONS = (
    "mass_kg",
    "mass",
    "centre_of_mass_mm",
    "range_deg",
    "reducer",
    *(f"{kind}_{unit}" for kind, (unit, _, _) in ERRORS.items()),
)
"""Keys of a row that an allocation of tolerances reads; a model alone has no use for them."""


def read_chain(top: Section) -> dict[str, Value]:
    """The parameters that these tables define; every fault is reported at its place."""
    values = _table_frame(top.section("base"), "base", BASE) | _table_frame(top.section("tool"), "tool", TOOL)
    if "joint" not in top:
        return values
    rows = top.tables("joint")
    if not 1 <= len(rows) <= MAX_JOINTS:
        top.fault("joint", f"is no chain: it has {len(rows)} rows, and needs 1 to {MAX_JOINTS}")
        return values
    joints = [_joint(top.item("joint", at), at + 1) for at in range(len(rows))]
    for joint in joints:
        values |= joint
    _check(top, joints)
    return values | {"joints": len(rows)}


def _joint(section: Section, joint: int) -> dict[str, Value]:
    """A row: d, a and alpha are required, since defaults would be those of another arm."""
    values: dict[str, Value] = {}
    for column, (unit, meaning) in TABLE.items():
        name = f"{column}_{unit}"
        value = section.quantity(name, unit)
        if value is not None:
            values[nominal(column, joint)] = value
        elif name not in section and column not in section and column != "offset":
            section.fault(name, f"is missing: the {meaning} {joint}; write 0 where there is none")
    values.setdefault(nominal("offset", joint), 0.0)
    section.accept(OF_ALLOCATIONS)
    section.finish()
    return values


def _check(top: Section, rows: list[dict[str, Value]]) -> None:
    """Faults of a table whose joints do not make a chain."""

    def value(column: str, joint: int) -> float | None:
        entry = rows[joint - 1].get(nominal(column, joint))
        return float(entry) if isinstance(entry, int | float) else None

    last = len(rows)
    for joint in range(1, last):
        alpha = value("alpha", joint)
        if value("a", joint) == 0.0 and alpha is not None and alpha % 180.0 == 0.0:
            top.item("joint", joint - 1).fault(
                "", f"is no chain: joints {joint} and {joint + 1} turn about one axis (a and alpha are 0)"
            )
    lengths = [value(column, joint) for joint in range(1, last + 1) for column in ("a", "d")]
    if None not in lengths and not any(lengths):
        top.fault("joint", "is no chain: every a and d is 0")


def _table_frame(section: Section, stem: str, axes: tuple[str, ...]) -> dict[str, Value]:
    values: dict[str, Value] = {}
    for axis in axes:
        unit, _ = frame_units(axis)
        value = section.quantity(f"{axis}_{unit}", unit)
        if value is not None:
            values[f"nominal_{stem}_{axis}_{unit}"] = value
    section.finish()
    return values


# Positions of a serial arm, as measured by a laser tracker.


class SerialArm(MeasurableModel):
    """Positions of a point on the last link of a chain of revolute joints.

    Written as a Denavit-Hartenberg table (`[[joint]]` with `d_mm`, `a_mm`, `alpha_deg`,
    `offset_deg`), `[base]` and `[tool]`; the UR5 by default. Five errors a joint, and those of base
    and tool, may be recalibrated.
    """

    columns = tuple(
        Column(f"joint_{joint}_deg", "deg", f"commanded angle of joint {joint}") for joint in range(1, MAX_JOINTS + 1)
    )
    outputs = tuple(Output(f"{axis}_mm", "mm", f"measured position, {axis}") for axis in "xyz")
    parameters = PARAMETERS
    free: ClassVar[Mapping[str, float]] = free_of({})
    tables = TABLES

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        self.chain = chain_of(parameters or {})
        self.columns = type(self).columns[: len(self.chain.d)]  # type: ignore[misc]

    @classmethod
    def written(cls, top: Section) -> dict[str, Value]:
        return read_chain(top)

    @classmethod
    def free_of(cls, parameters: Mapping[str, Value]) -> Mapping[str, float]:
        return free_of(parameters)

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        angles = np.column_stack([np.radians(table[column.name]) for column in self.columns])
        position = positions(self.chain, angles) / MM
        return {output.name: position[:, at] for at, output in enumerate(self.outputs)}
