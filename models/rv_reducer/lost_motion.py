"""Twist of an RV reducer whose input is locked while its output is loaded and unloaded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...declarations import Output, Value
from ...errors import raise_all
from ...units import ARCMIN
from ..gear import RV_40E, Gear
from ..inputs.distribution import Distribution
from ..measurable import NO_CHANGES, Column, MeasurableModel, Outside, Role
from . import loaded_unit
from .changes import CHANGEABLE, Responses
from .contact.contact import warn_of_overload
from .order_table import LEFT_OUT, OrderTable
from .rows import Rows, outside

SAMPLES_PER_PIN = 50
"""Enough for 0.01 arcmin: the order of the mesh of one tooth (1560, 0.006') is not resolved."""
REACH = 1.25
"""The tables reach this multiple of the momentary torque; beyond it they are linear."""


class RvLostMotion(MeasurableModel):
    """Twist of the output against a torque, input locked: loaded contact, without hysteresis.

    Tabulated by order of the output angle over torque, for any angle and torque. With
    clearance, a measurement without torque stays on the flank that was loaded last (`direction` -1:
    torque was positive), or is the middle of the clearance where no direction is given.
    """

    columns = (
        Column("torque_Nm", "Nm", "torque on the output", role=Role.TORQUE),
        Column(
            "direction",
            "",
            "sign of dT/dt; acts through effects, and where the torque is 0",
            False,
            role=Role.DIRECTION,
        ),
        Column("output_angle_deg", "deg", "angle of the output; omitted: the mean over a turn", False, role=Role.ANGLE),
        Column("temperature_C", "C", "temperature; acts through effects only", False, role=Role.TEMPERATURE),
    )
    outputs = (Output("twist_arcmin", "arcmin", "twist of the output, with the torque's sign"),)
    parameters = loaded_unit.PARAMETERS
    free: ClassVar[Mapping[str, float]] = {}
    changeable = CHANGEABLE
    gear = RV_40E
    corrects: ClassVar[tuple[str, ...]] = ("rv_backlash", "rv_reducer")

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        values = parameters or {}
        raise_all(loaded_unit.faults(values))
        self.unit = loaded_unit.loaded_unit(values)
        self.gear = loaded_unit.gear_of(values)
        samples = SAMPLES_PER_PIN * self.unit.contact.geometry.pins
        self.momentary = self.unit.contact.momentary_torque
        most = REACH * self.momentary
        self.static = OrderTable.of(self.unit.mesh(samples), most, LEFT_OUT)
        self.responses = Responses(self.unit, samples, most)

    @classmethod
    def gear_of(cls, parameters: Mapping[str, Any]) -> Gear | None:
        return loaded_unit.gear_of(parameters)

    def outside(self, table: Mapping[str, NDArray[Any]]) -> Outside:
        return outside(table, self.momentary)

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        rows = Rows.of(table)
        warn_of_overload(rows.torque, self.momentary)
        twist = _twist(self.static, rows)
        for response, amount in self.responses.of(changes, len(rows)):
            twist = twist + amount * _twist(response, rows)
        return {"twist_arcmin": twist / ARCMIN}


def _twist(orders: OrderTable, rows: Rows) -> Array:
    """Twist (n,) [rad] on the flank of the torque or of the direction, or the mean of both."""
    if not rows.angled:
        orders = orders.mean_only()
    last = np.zeros(len(rows)) if rows.direction is None else -rows.direction
    sign = np.where(rows.torque == 0.0, last, np.sign(rows.torque))
    twist = orders.twist(rows.angle, rows.torque, np.where(sign >= 0.0, 0, 1), None)
    if np.all(sign != 0.0):
        return twist
    opposite = orders.twist(rows.angle, rows.torque, np.where(sign > 0.0, 0, 1), None)
    return np.asarray(0.5 * (twist + opposite))
