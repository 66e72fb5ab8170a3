"""Declarations of the manipulator's models, by the names of configurations.

Shared by the problem `pose_accuracy` and the model `manipulator_pose`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...arrays import Array
from ...declarations import Parameter, Value
from ...units import MM
from .geometry import Manipulator, TaskRing
from .indices import INDICES
from .sources import NAMES, error_vector

_ASSUMED = "assumed: the document's Table 1 is lost"
_RING = "document M, section Sensitivity analysis"
INDEX_CHOICES = (*INDICES, "every_pose")
DOTTED = "elementary_errors."


def _length(name: str, default: Value, meaning: str, low: float = 0.0) -> Parameter:
    return Parameter(name, default, "mm", meaning, _ASSUMED, assumed=True, low=low, high=1e6, open_low=low == 0.0)


PARAMETERS: tuple[Parameter, ...] = (
    _length("half_length_mm", 60.0, "platform attachments 1 and 2 from its middle, tangentially"),
    _length("half_width_mm", 45.0, "platform attachment 3 from its middle, radially"),
    _length("hinge_offset_mm", 150.0, "height of chain 3's hinge", low=-1e6),
    _length("arm_length_mm", (400.0, 400.0, 260.0), "lengths of the arms"),
    _length("rod_length_mm", (480.0, 480.0, 420.0), "lengths of the rods"),
    _length("joint_distance_mm", (80.0, 80.0, 100.0), "distances of the joints on a joint line"),
    Parameter("ring_r_mm", (300.0, 650.0), "mm", "radii of the ring", _RING, low=-1e6, high=1e6),
    Parameter(
        "ring_z_mm",
        (100.0, 300.0),
        "mm",
        "heights of the ring (document M: 200 mm in all)",
        "assumed: where the 200 mm begin",
        assumed=True,
        low=-1e6,
        high=1e6,
    ),
    Parameter(
        "index",
        "plane",
        "",
        "mean over the ring: of sizes or rms, by the plane's area or by the ring's volume; or every pose",
        "document M: plane",
        choices=INDEX_CHOICES,
    ),
    Parameter(
        "follow_up",
        "fixed",
        "",
        "follow-up plane of chain 3: at the azimuth commanded (M1), or turned by its rod (M2)",
        "assumed",
        assumed=True,
        choices=("fixed", "rod"),
    ),
)
"""Parameters of both."""

ERRORS = Parameter("elementary_errors", {}, "", "elementary errors by name; omitted errors are 0", choices=NAMES)
COMPENSATION = Parameter(
    "compensation",
    "none",
    "",
    "position: outputs are the residual errors after the command is corrected until the position is exact",
    choices=("none", "position"),
)


def manipulator(parameters: Mapping[str, Value]) -> Manipulator:
    """The machine (SI) of `parameters` by declared name; omitted ones keep their defaults."""
    p = _completed(parameters)
    return Manipulator(
        half_length=p["half_length_mm"] * MM,
        half_width=p["half_width_mm"] * MM,
        hinge_offset=p["hinge_offset_mm"] * MM,
        arm_length=_metres(p["arm_length_mm"]),
        rod_length=_metres(p["rod_length_mm"]),
        joint_distance=_metres(p["joint_distance_mm"]),
        follow_up=p["follow_up"],
    )


def task_ring(parameters: Mapping[str, Value]) -> TaskRing:
    """The task ring (SI) of `parameters` by declared name."""
    p = _completed(parameters)
    return TaskRing(_metres(p["ring_r_mm"]), _metres(p["ring_z_mm"]))


def elementary_errors(parameters: Mapping[str, Value]) -> Array:
    """All 63 errors (63,) [m, rad] of the table `elementary_errors`.

    A single error may also be given in `parameters` as `elementary_errors.NAME`, the name that a
    recalibration uses. Raises InputError.
    """
    table: dict[str, Any] = dict(parameters.get(ERRORS.name, {}))  # type: ignore[arg-type]
    table |= {name.removeprefix(DOTTED): value for name, value in parameters.items() if name.startswith(DOTTED)}
    return error_vector(table, "parameters.elementary_errors")


def _completed(parameters: Mapping[str, Value]) -> dict[str, Any]:
    return {p.name: p.default for p in PARAMETERS} | dict(parameters)


def _metres(lengths: Any) -> Any:
    """A list of millimetres in metres."""
    return tuple((np.asarray(lengths, dtype=float) * MM).tolist())
