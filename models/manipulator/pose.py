"""Pose errors of one manipulator, as measured by a measuring machine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...declarations import Output, Value
from ...errors import raise_all
from ...units import MM, MRAD
from ..inputs.distribution import Distribution
from ..measurable import NO_CHANGES, Column, MeasurableModel, Outside, Role
from . import declared
from .changes import CHANGEABLE, base_tilt, changed_errors
from .compensation import compensated
from .faults import faults
from .forward import exact_pose
from .inverse import reach
from .machine import about_up
from .sources import SOURCES
from .vectors import rotation_vector, turned, vector

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
    changeable = CHANGEABLE
    corrects = ("pose_accuracy",)
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
        values = parameters or {}
        self.machine = declared.manipulator(values)
        self.errors = declared.elementary_errors(values)
        self.correct = values.get(declared.COMPENSATION.name) == "position"
        raise_all(faults(self.machine, declared.task_ring(values)))

    def outside(self, table: Mapping[str, NDArray[Any]]) -> Outside:
        r, z = (np.asarray(table[name], dtype=float) * MM for name in ("r_mm", "z_mm"))
        cosine = reach(self.machine, r, z)
        wrong = np.isfinite(r + z) & ~(np.abs(cosine) <= 1.0).all(axis=-1)
        return {"r_mm": (wrong, "is out of reach at this z_mm")}

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        r, z = np.asarray(table["r_mm"]) * MM, np.asarray(table["z_mm"]) * MM
        phi = np.radians(table["phi_deg"])
        tilt = base_tilt(changes, phi)
        if self.correct:
            position, turn = np.zeros((len(r), 3)), self._residual(r, z, phi, changes, tilt)
        else:
            errors = changed_errors(self.machine, r, z, phi, self.errors, changes)
            pose = exact_pose(self.machine, r, z, phi, errors)
            start = vector(r, 0.0, z)
            position = turned(start + pose.position, tilt) - start
            frame = turned(np.eye(3), pose.orientation[:, None, :])
            turn = rotation_vector(turned(frame, tilt[:, None, :]))
        measurements = np.concatenate([position / MM, turn / MRAD], axis=-1)
        return {output.name: measurements[:, i] for i, output in enumerate(self.outputs)}

    def _residual(self, r: Array, z: Array, phi: Array, changes: Mapping[str, Array], tilt: Array) -> Array:
        """Residual rotation vectors (n, 3) [rad] when the position is made exact.

        On a tilted base that is the pose where the base is upright; the axes are those at phi.
        """
        where = turned(vector(r, 0.0, z), -tilt)
        ahead = np.arctan2(where[:, 1], where[:, 0])
        r, z = np.hypot(where[:, 0], where[:, 1]), where[:, 2]
        errors = changed_errors(self.machine, r, z, phi + ahead, self.errors, changes)
        residual = compensated(self.machine, r, z, phi + ahead, errors)
        axes = about_up(turned(np.eye(3), residual[:, None, :]), ahead[:, None])
        # the frame at phi + ahead, turned back to axes that begin at phi
        return rotation_vector(turned(axes, tilt[:, None, :]))
