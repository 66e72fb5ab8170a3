"""Pose errors of one manipulator, as a measuring machine sees them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...declarations import Output, Value
from ...errors import raise_all
from ...units import MM
from ..inputs.distribution import Array, Distribution
from ..measurable import NO_CHANGES, Column, MeasurableModel, Role
from . import declared
from .compensation import compensated
from .faults import faults
from .forward import exact_pose
from .sources import MRAD, SOURCES

ACTED_ON = "acts through effects only"
FREE_STEMS = ("drive_zero_", "arm_length_", "rod_length_", "platform_attachment_")


class ManipulatorPose(MeasurableModel):
    """Pose errors of the parallel manipulator with full-circle rotation (document M).

    The exact pose, by Newton's method, of a machine with the elementary errors of
    `[parameters.elementary_errors]`, less the nominal pose, in the axes (e_r, e_t, z) at its
    azimuth. Payload and temperature act through effects only.
    """

    columns = (
        Column("r_mm", "mm", "radius of the pose", role=Role.POSITION),
        Column("z_mm", "mm", "height of the pose", role=Role.POSITION),
        Column("phi_deg", "deg", "azimuth of the pose", role=Role.ANGLE),
        Column("payload_kg", "kg", f"payload; {ACTED_ON}", False, role=Role.PAYLOAD),
        Column("temperature_C", "C", f"temperature; {ACTED_ON}", False, role=Role.TEMPERATURE),
    )
    outputs = (
        Output("dr_mm", "mm", "position error along e_r"),
        Output("dt_mm", "mm", "position error along e_t"),
        Output("dz_mm", "mm", "position error along z"),
        Output("tilt_r_mrad", "mrad", "rotation about e_r"),
        Output("tilt_t_mrad", "mrad", "rotation about e_t"),
        Output("yaw_mrad", "mrad", "rotation about z"),
    )
    parameters = (*declared.PARAMETERS, declared.ERRORS, declared.COMPENSATION)
    free: ClassVar[Mapping[str, float]] = {
        f"{declared.DOTTED}{source.name}": 0.5 if source.unit == "mrad" else 100.0
        for source in SOURCES
        if source.name.startswith(FREE_STEMS)
    }

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        given = parameters or {}
        self.machine = declared.manipulator(given)
        self.errors = declared.elementary_errors(given)
        self.correct = given.get(declared.COMPENSATION.name) == "position"
        raise_all(faults(self.machine, declared.task_ring(given)))

    def predict(
        self,
        table: Mapping[str, NDArray[Any]],
        rng: np.random.Generator,
        changes: Mapping[str, Array] = NO_CHANGES,
    ) -> dict[str, Array]:
        r, z = np.asarray(table["r_mm"]) * MM, np.asarray(table["z_mm"]) * MM
        pose = (self.machine, r, z, np.radians(table["phi_deg"]), self.errors)
        if self.correct:
            position, turn = np.zeros((len(r), 3)), compensated(*pose)
        else:
            found = exact_pose(*pose)
            position, turn = found.position, found.orientation
        readings = np.concatenate([position / MM, turn / MRAD], axis=-1)
        return {output.name: readings[:, i] for i, output in enumerate(self.outputs)}
