"""Declarations of the model `serial_arm`: nominal table, errors, and free parameters."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

import numpy as np

from ...declarations import Parameter, Value, completed
from ...units import MM, MRAD, UM
from .chain import Chain

MOST = 9
"""Joints of a chain."""
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
    Parameter("joints", 6, "", "revolute joints of the chain", _SOURCE, low=1, high=MOST),
    *(_nominal(column, joint) for joint in range(1, MOST + 1) for column in TABLE),
    *(
        Parameter(error(kind, joint), 0.0, unit, f"{meaning} {joint}", low=-inf)
        for joint in range(1, MOST + 1)
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
