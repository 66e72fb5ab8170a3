"""Transmission error of an RV reducer that turns under load."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...errors import raise_all
from ...section import Array, Output, Parameter, Value, number
from ...units import ARCMIN, ARCSEC, MM, UM
from ..gear import RV_40E, Gear
from ..inputs import Distribution
from ..measurable import NO_CHANGES, Column, MeasurableModel, Outside, Role
from . import declared, lost_motion
from .contact.contact import warn_of_overload
from .declared import Rows, outside
from .dynamics import (
    NEGLIGIBLE_AMPLITUDE,
    ComplexArray,
    DisplacedMesh,
    FullDynamics,
    OrderTable,
    Oscillator,
    Train,
    tabulate_mesh,
    transfer,
)
from .lost_motion import CHANGEABLE, Responses

SAMPLES_PER_PIN = 100
REACH = 1.25
"""The tables reach this multiple of the momentary torque; beyond it they are linear."""


def _inertia(name: str, default: float, meaning: str) -> Parameter:
    source = "a first mode of 55 Hz, typical of reducers of this class"
    return Parameter(name, default, "", meaning, source, assumed=True, low=0.0, high=1e6, open_low=True)


def _unit_error(name: str, unit: str, meaning: str, high: float) -> Parameter:
    return Parameter(name, 0.0, unit, meaning, "a perfect unit", low=-high, high=high)


OF_TRANSMISSION: tuple[Parameter, ...] = (
    next(parameter for parameter in declared.PARAMETERS if parameter.name == "sun_pitch_radius_mm"),
    _unit_error("sun_runout_um", "um", "runout of the sun (twice its eccentricity) in mesh with one planet", 200.0),
    _unit_error("sun_runout_phase_deg", "deg", "angle of the sun at which the runout advances the output most", 360.0),
    _unit_error("input_error_arcmin", "arcmin", "error of the input angle, once per turn of the input", 60.0),
    _unit_error("output_eccentricity_arcsec", "arcsec", "error of the output encoder, once per turn", 3600.0),
    _unit_error(
        "output_eccentricity_phase_deg",
        "deg",
        "output angle at which the error of the output encoder is largest",
        360.0,
    ),
    _inertia("input_inertia_kgm2", 8e-4, "inertia at the input shaft [kg m^2]: motor and sun"),
    _inertia("load_inertia_kgm2", 4.216, "inertia at the output [kg m^2]"),
    Parameter(
        "damping_ratio",
        0.04,
        "",
        "damping ratio of the first mode",
        "0.02 to 0.06 is usual",
        assumed=True,
        low=0.0,
        high=0.999,
        open_low=True,
    ),
    Parameter(
        "first_mode_Hz",
        0.0,
        "Hz",
        "frequency of the first mode at rated torque, to which both inertias are scaled; 0: inertias as stated",
        "",
        low=0.0,
        high=1e4,
    ),
    Parameter(
        "dynamics",
        "table",
        "",
        "table: static orders times their transfer functions; full: steady state of every operating point",
        choices=("table", "full"),
    ),
    Parameter(
        "wind_up",
        "included",
        "",
        "mean wind-up under the torque: part of the output, or removed from it",
        choices=("included", "removed"),
    ),
)


class RvTransmission(MeasurableModel):
    """Transmission error in/i - out of a unit: loaded contact, and vibration about it.

    The wind-up T/K(T) is part of the output, as encoders at both ends measure it, unless `wind_up`
    is "removed". Without `output_speed_rpm` the output is quasi-static; without torque it is that
    of the flank that drives in `direction`.
    """

    columns = (
        Column("output_angle_deg", "deg", "angle of the output", role=Role.ANGLE),
        Column("torque_Nm", "Nm", "torque that resists + motion; omitted: 0", False, role=Role.TORQUE),
        Column("output_speed_rpm", "rpm", "speed of the output; omitted: quasi-static", False, role=Role.SPEED),
        Column("temperature_C", "C", "temperature; acts through effects only", False, role=Role.TEMPERATURE),
        Column("direction", "", "sense of turning, 1 or -1; omitted: 1", False, role=Role.DIRECTION),
    )
    outputs = (Output("te_arcsec", "arcsec", "transmission error, signed"),)
    parameters = (*lost_motion.PARAMETERS, *OF_TRANSMISSION)
    free: ClassVar[Mapping[str, float]] = {}
    changeable = CHANGEABLE
    gear = RV_40E
    corrects = ("rv_transmission_error",)

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        values = {parameter.name: parameter.default for parameter in OF_TRANSMISSION} | dict(parameters or {})
        p = {parameter.name: number(values[parameter.name]) for parameter in OF_TRANSMISSION if not parameter.choices}
        self.unit = lost_motion.unit_under_load(values)
        self.gear = lost_motion.gear_of(values)
        train = Train(
            p["input_inertia_kgm2"],
            p["load_inertia_kgm2"],
            p["damping_ratio"],
            self.unit.contact.geometry.nominal.reduction_ratio,
        )
        raise_all([*lost_motion.faults(values), *train.faults("parameters")])
        self.removed = values["wind_up"] == "removed"
        self.eccentricity = p["output_eccentricity_arcsec"] * ARCSEC
        self.largest_at = np.radians(p["output_eccentricity_phase_deg"])
        self.samples = SAMPLES_PER_PIN * self.unit.contact.geometry.pins
        self.momentary = self.unit.contact.momentary_torque
        most = REACH * self.momentary
        mesh = self.unit.mesh(self.samples)
        excitation = _excitation(p, self.unit)
        self.static = OrderTable.of(mesh, most, NEGLIGIBLE_AMPLITUDE).plus(excitation)
        self.train = self._scaled(train, p["first_mode_Hz"])
        self.responses = Responses(self.unit, self.samples, most)
        self.full: FullDynamics | None = None
        if values["dynamics"] == "full":
            angle = 2.0 * pi * np.arange(self.samples) / self.samples
            waves = sum((amplitude * np.exp(1j * k * angle) for k, amplitude in excitation.items()), 0j)
            displacement = np.real(waves) * np.ones(self.samples)
            self.full = FullDynamics(DisplacedMesh(tabulate_mesh(mesh, most), displacement), self.train)

    @classmethod
    def gear_of(cls, parameters: Mapping[str, Any]) -> Gear | None:
        return lost_motion.gear_of(parameters)

    def outside(self, table: Mapping[str, NDArray[Any]]) -> Outside:
        return outside(table, self.momentary)

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        rows = Rows.of(table)
        warn_of_overload(rows.torque, self.momentary)
        direction = np.ones(len(rows)) if rows.direction is None else rows.direction
        side = np.where(np.where(rows.torque == 0.0, direction, rows.torque) > 0.0, 0, 1)
        speed = None if rows.speed is None else rows.speed * direction
        if self.full is None or speed is None:
            te = self._twist(self.static, rows, side, speed)
        else:
            te = self.full.twist(rows.angle, rows.torque, speed)
        for response, amount in self.responses.of(changes, len(rows)):
            te = te + amount * self._twist(response, rows, side, speed)
        if self.removed:
            te = te - self.static.mean_only().twist(rows.angle, rows.torque, side, None)
        te = te + self.eccentricity * np.cos(rows.angle - self.largest_at)
        return {"te_arcsec": te / ARCSEC}

    def _twist(self, orders: OrderTable, rows: Rows, side: NDArray[np.intp], speed: Array | None) -> Array:
        """Twist (n,) [rad]: quasi-static, or with every order times its transfer function."""
        factor = None if speed is None else self._factor(orders.order, rows.torque, side, speed)
        return orders.twist(rows.angle, rows.torque, side, factor)

    def _factor(self, order: Array, torque: Array, side: NDArray[np.intp], speed: Array) -> ComplexArray:
        """Transfer function (n, m) of every order at the torques and speeds of the rows."""
        stiffness = self.static.mean_stiffness(torque, side)
        inertia = np.broadcast_to(self.train.reduced_inertia, stiffness.shape)
        damping = self.train.damping(stiffness)
        return transfer(Oscillator(inertia, damping, torque, stiffness, speed), order)

    def _scaled(self, train: Train, mode: float) -> Train:
        """The train with both inertias scaled so that its first mode is at `mode` [Hz]."""
        if mode == 0.0:
            return train
        rated = np.array([self.unit.contact.rated_torque])
        stiffness = self.static.mean_stiffness(rated, np.zeros(1, dtype=np.intp))
        factor = float((train.mode(stiffness)[0] / (2.0 * pi * mode)) ** 2)
        return Train(
            factor * np.asarray(train.input_inertia),
            factor * np.asarray(train.load_inertia),
            train.damping_ratio,
            train.reduction_ratio,
        )


def _excitation(p: Mapping[str, float], unit: lost_motion.LoadedUnit) -> dict[float, complex]:
    """Displacements [rad] of the input, reflected, by order of the output (housing fixed).

    The sun against the carrier turns i - 1 times per output turn, the input shaft i times. A runout
    F of the sun advances one planet by F/2 at the sun's pitch radius.
    """
    ratio = unit.contact.geometry.nominal.reduction_ratio
    advance = 0.5 * p["sun_runout_um"] * UM / (p["sun_pitch_radius_mm"] * MM * ratio)
    amplitudes = {
        ratio - 1.0: advance * np.exp(-1j * np.radians(p["sun_runout_phase_deg"])),
        ratio: complex(p["input_error_arcmin"] * ARCMIN / ratio),
    }
    return {order: complex(amplitude) for order, amplitude in amplitudes.items() if amplitude != 0.0}
