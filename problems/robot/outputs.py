"""Parameters and outputs that every machine of links and reducers declares."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from ...arrays import Array
from ...declarations import Output, Parameter
from ...models.robot.manipulator import CALIBRATED
from ..settings import Bound

Points = Iterable[Sequence[float] | Array]
AXES = ("", "tilt_", "yaw_")
"""Position, squareness and yaw, as mean squares of a machine are named."""
FLANKS = ("gravity", "free", "held")


def assumed(name: str, default: float, unit: str, meaning: str, high: float) -> Parameter:
    """A positive number that no document prints."""
    return Parameter(name, default, unit, meaning, "assumed", assumed=True, low=0.0, high=high)


PARAMETERS: tuple[Parameter, ...] = (
    Parameter(
        "calibrated",
        "none",
        "",
        "position: commands are corrected for the links of the machine, so that their position errors vanish; the "
        "reducers' errors remain",
        "assumed",
        assumed=True,
        choices=CALIBRATED,
    ),
    Parameter(
        "flanks",
        "gravity",
        "",
        "the flank of a reducer that carries: gravity: that on which gravity holds it at rest, pose by pose; free: "
        "that of the approach; held: always the same",
        "assumed",
        assumed=True,
        choices=FLANKS,
    ),
    assumed("payload_kg", 10.0, "kg", "mass at the tool", 1e5),
    assumed(
        "friction_torque_Nm",
        12.4,
        "Nm",
        "friction of a reducer at its output: gravity holds a flank beyond it (3 % of 412 N m)",
        1e6,
    ),
    assumed("stiffness_Nm_per_arcmin", 108.0, "Nm/arcmin", "stiffness of a reducer", 1e9),
    assumed(
        "hysteresis_arcmin",
        0.0,
        "arcmin",
        "lost motion of friction, 2 friction torques over the stiffness; it adds to the backlash",
        60.0,
    ),
    assumed("precision_weight", 5.0, "", "Q of the reducers' adjusted assembly (document A)", 1e6),
    assumed("reducer_price", 1.0, "", "cost of a reducer in units of the links' cost, as a factor", 1e6),
    Parameter("per_drive", True, "", "reducers may differ; false: all are alike", "assumed", assumed=True),
    Parameter(
        "nested",
        True,
        "",
        "reducers enter by what an rms of their backlash costs; false: every tolerance of them is a variable",
    ),
)

FIXED_OUTPUTS: tuple[Output, ...] = (
    Output("cost", "", "relative cost of links and reducers", low=0.0),
    Output("cost_links", "", "relative cost of the links", low=0.0),
    Output("cost_reducers", "", "relative cost of the reducers", low=0.0),
    Output(
        "pose_accuracy_mm",
        "mm",
        "bidirectional pose accuracy A: quantile of the position error over units, sides of approach, phases and "
        "poses, at the coverage",
        low=0.0,
    ),
    Output("pose_rms_mm", "mm", "R, the rms of the same", low=0.0),
    Output("accuracy_ratio", "", "A/R", low=0.0),
    Output("squareness_mrad", "mrad", "rms tilt of the tool", low=0.0),
    Output("yaw_mrad", "mrad", "rms rotation of the tool about its axis", low=0.0),
    Output(
        "backlash_arcmin", "arcmin", "quantile of a reducer's backlash at its coverage; of the worst drive", low=0.0
    ),
    Output(
        "backlash_rms_arcmin",
        "arcmin",
        "root mean square of a reducer's backlash, hysteresis included; of the worst drive",
        low=0.0,
    ),
    Output(
        "te_amplitude_arcsec",
        "arcsec",
        "quantile of the amplitude of a reducer's transmission error at the coverage; of the worst drive",
        low=0.0,
    ),
    Output(
        "reversal_mm",
        "mm",
        "rms distance of two attained positions, all drives approached from opposite sides",
        low=0.0,
    ),
    Output(
        "iso_vap_mm",
        "mm",
        "multi-directional variation vAP of ISO 9283: largest distance of the means of approaches along three axes; "
        "rms over units and poses",
        low=0.0,
    ),
    Output("path_te_mm", "mm", "rms amplitude of the transmission errors along a path", low=0.0),
    Output(
        "wind_up_mm",
        "mm",
        "rms displacement by gravity's torque on the stiffness of the reducers; no tolerance changes it",
        low=0.0,
    ),
    Output("wind_up_varying_mm", "mm", "rms of the displacement less its mean over the poses", low=0.0),
    Output("held_percent", "%", "poses and drives at which gravity holds a flank", low=0.0, high=100.0),
)
LIMITS: dict[str, Bound] = {}
OBJECTIVES = ("cost", "pose_accuracy_mm", "squareness_mrad", "te_amplitude_arcsec")
STANDS = {"pose_rms_mm": "pose_accuracy_mm", "backlash_rms_arcmin": "backlash_arcmin"}
"""Requirements of the convex form, and the outputs that grow with them."""


def millimetres(points: Points) -> list[list[float]]:
    """Points [m] of a drawing, in tenths of a millimetre."""
    return [[round(1e3 * float(x), 1) + 0.0 for x in point] for point in points]


def sketched(name: str, kind: str, points: Points, shares: Sequence[str] = ()) -> dict[str, Any]:
    """A part of the drawing of a machine: its line [m], and the columns of its fractions of R^2."""
    return {"name": name, "kind": kind, "points": millimetres(points), "shares": list(shares)}


def share_name(variable: str) -> str:
    """`share_origin_1_percent` of the variable `origin_1_um`."""
    return f"share_{variable.rpartition('_')[0]}_percent"


def outputs_of(drives: Iterable[str], links: Iterable[str], priced: Iterable[str]) -> tuple[Output, ...]:
    """All outputs: fractions of R^2 of links and joints, prices of the variables."""
    fractions = [
        Output(f"share_joint_{drive}_percent", "%", f"fraction of R^2 of drive {drive}'s reducer", low=0.0, high=100.0)
        for drive in drives
    ]
    fractions += [Output(share_name(name), "%", f"fraction of R^2 of {name}", low=0.0, high=100.0) for name in links]
    prices = [Output(f"price_{name}", "um", f"reduction of R per unit of cost of {name}", low=0.0) for name in priced]
    return (*FIXED_OUTPUTS, *fractions, *prices)
