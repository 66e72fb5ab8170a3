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
TABLE: Mapping[str, tuple[str, str]] = {
    "d": ("mm", "offset along the axis of joint"),
    "a": ("mm", "length of the common normal after joint"),
    "alpha": ("deg", "twist about the common normal after joint"),
    "offset": ("deg", "angle that is added to the reading of joint"),
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
        turned = axis.startswith("r")
        units = ("deg", "mrad") if turned else ("mm", "um")
        meaning = f"{'rotation vector' if turned else 'position'} of the {stem}, {axis[-1]}"
        parameters += [
            Parameter(f"nominal_{stem}_{axis}_{units[0]}", 0.0, units[0], meaning),
            Parameter(f"{stem}_{axis}_{units[1]}", 0.0, units[1], f"error of the {meaning}"),
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
    bounds |= {f"base_{axis}_{'mrad' if axis[0] == 'r' else 'um'}": 20.0 if axis[0] == "r" else 5000.0 for axis in BASE}
    return bounds | {f"tool_{axis}_um": 5000.0 for axis in TOOL}


def chain_of(parameters: Mapping[str, Value]) -> Chain:
    """The chain (SI) of parameters by declared name; omitted ones keep their defaults."""
    p = {n: v for n, v in completed(PARAMETERS, parameters).items() if isinstance(v, int | float)}
    joints = range(1, int(p["joints"]) + 1)

    def nominals(column: str, unit: float) -> np.ndarray:
        return unit * np.array([p[nominal(column, joint)] for joint in joints], dtype=float)

    def errors(kind: str, unit: float) -> np.ndarray:
        return unit * np.array([p[error(kind, joint)] for joint in joints], dtype=float)

    def frame(stem: str, axes: tuple[str, ...]) -> np.ndarray:
        lengths = [
            (f"nominal_{stem}_{x}_mm", MM, f"{stem}_{x}_um", UM)
            if x[0] != "r"
            else (f"nominal_{stem}_{x}_deg", DEG, f"{stem}_{x}_mrad", MRAD)
            for x in axes
        ]
        return np.array([p[n] * big + p[e] * small for n, big, e, small in lengths])

    return Chain(
        zero=nominals("offset", DEG) + errors("zero", MRAD),
        d=nominals("d", MM) + errors("d", UM),
        a=nominals("a", MM) + errors("a", UM),
        alpha=nominals("alpha", DEG) + errors("alpha", MRAD),
        beta=errors("beta", MRAD),
        base=frame("base", BASE),
        tool=frame("tool", TOOL),
    )
