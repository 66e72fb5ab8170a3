"""Stiffness and torques of a population under load."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ....arrays import Single
from ....units import ARCMIN
from ..contact.performance import LOST_MOTION_SHARE
from .table import Table

LEAST_SHARE = 1e-4
"""Fraction of rated torque that replaces zero in the transmission error: one flank bears."""


@dataclass(frozen=True, slots=True)
class Loading:
    """Stiffness, both assumptions, and torques.

    `normal_stiffness` [N/m] of a pin contact along its normal, `series_stiffness` [N m/rad] between
    one disc and the carrier (`inf` without); `rated_torque` and `te_torque`, at which the
    transmission error is taken, [N m] at the carrier. Raises ValueError where one is not above 0
    (`te_torque`: below 0).
    """

    normal_stiffness: float = 2e8
    series_stiffness: float = 58.5 / ARCMIN
    rated_torque: float = 412.0
    te_torque: float = 412.0

    def __post_init__(self) -> None:
        wrong = [
            f"{field.name} must be above 0, got {getattr(self, field.name)}"
            for field in fields(self)
            if field.name != "te_torque" and not getattr(self, field.name) > 0.0
        ]
        if not self.te_torque >= 0.0:
            wrong.append(f"te_torque must not be below 0, got {self.te_torque}")
        if wrong:
            raise ValueError("; ".join(wrong))

    def torque(self, case: str) -> float:
        """Torque at the carrier [N m] in a load case.

        "forward" and "backward" are those of lost motion; "none" is no torque, "rated" and
        "te" are `rated_torque` and `te_torque`.
        """
        small = LOST_MOTION_SHARE * self.rated_torque
        return {
            "forward": small,
            "backward": -small,
            "none": 0.0,
            "rated": self.rated_torque,
            "te": max(self.te_torque, LEAST_SHARE * self.rated_torque),
        }[case]


@dataclass(frozen=True, slots=True, eq=False)
class Springs:
    """Stiffness by contact of a lattice, as the kernels take it.

    `stiff` [N m/arcmin] of a disc's turn against its mesh, `force` [N/arcmin] the growth of the
    pin's force, signed as its lever arm; `lean` [1/mm] is how the arm grows with the shift
    modification. `behind` [arcmin/(N m)] is the compliance between a disc and the carrier.
    """

    stiff: Single
    force: Single
    lean: Single
    behind: np.float32

    @classmethod
    def of(cls, table: Table, loading: Loading) -> Springs:
        """The springs of a loading at a table's modification."""
        force = loading.normal_stiffness * table.arm * ARCMIN
        behind = np.float32(1.0 / (loading.series_stiffness * ARCMIN))
        columns = (force * table.arm, force, table.arm_by_shift / table.arm)
        stiff, of_force, lean = (column.astype(np.float32) for column in columns)
        return cls(stiff, of_force, lean, behind)

    @property
    def arrays(self) -> tuple[Single, Single, Single, np.float32]:
        """The fields, as the kernels take them."""
        return self.stiff, self.force, self.lean, self.behind
