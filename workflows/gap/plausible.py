"""Implausible units: measurements far outside the range of any test bench."""

from __future__ import annotations

from collections.abc import Iterator
from math import radians, tau

import numpy as np

from ...arrays import Array
from ...models.effects.effect import kind_of
from ...models.measurable import Role
from ...units import converted
from .data import GapData
from .fit import Fit

MOST = {
    Role.ANGLE: (1000.0 * tau, "1000 turns"),
    Role.TORQUE: (1e6, "1e6 N m"),
    Role.FORCE: (1e7, "1e7 N"),
    Role.SPEED: (1e5, "1e5 rpm"),
    Role.TEMPERATURE: (200.0, "200 degC, above which greases and oils decompose"),
    Role.PAYLOAD: (1e5, "1e5 kg"),
    Role.POSITION: (1e3, "1 km"),
    Role.TIME: (3e8, "ten years"),
}
"""Span or magnitude, in the units of `Measurements`, that is beyond a test bench."""
LITTLE = radians(0.5)
"""[rad] Span that a turning angle exceeds; that of a unit with locked input does not."""
FACTOR = 20.0
"""Ratio of a measurement to its prediction that is implausible in the same unit."""
STIFFER = 100.0
"""Factor by which a part of a drive's compliance may be stiffer than the drive."""
FOLLOWS = 0.7
"""Correlation from which a measurement follows the load."""
STIFFNESS = {("angle", "Nm"): ("arcmin", 1e-3, 2e4), ("length", "N"): ("um", 1e-3, 1e5)}
"""By kind of output and load: a unit, and the range of the stiffness of drives in load per unit.
Reducers have 0.1 to 5000 N m/arcmin, from small harmonic drives to large cycloidal ones; screws 1
to 5000 N/um.
"""
ALIKE = 0.9
"""Correlation from which a measurement and its prediction are of the same quantity."""


def implausible(data: GapData) -> list[str]:
    """Sentences about columns whose unit is probably not the stated one."""
    return [*_beyond(data), *_still(data), *_scaled(data), *_stiff(data)]


def _beyond(data: GapData) -> Iterator[str]:
    for role, (most, text) in MOST.items():
        if role not in data.measurements or data.target.units.get(role) in ("m", "m/s"):
            continue
        x = np.asarray(data.measurements[role], dtype=float)
        size = np.ptp(x) if role in (Role.ANGLE, Role.TIME) else np.abs(x).max(initial=0.0)
        if size > most:
            yield f"{_doubt(data, role)} It reaches beyond {text}"


def _still(data: GapData) -> Iterator[str]:
    """An angle that hardly turns, on a unit that is not locked."""
    turning = data.target.units.get(Role.ANGLE) == "rad" and Role.POSITION not in data.measurements
    span = float(np.ptp(data.measurements[Role.ANGLE])) if turning else 0.0
    if 0.0 < span < LITTLE and not data.target.locked:
        yield f"{_doubt(data, Role.ANGLE)} It spans {np.degrees(span):.2g} deg in all"


def _scaled(data: GapData) -> Iterator[str]:
    """A measurement that is many times its prediction, or a small part of it."""
    for output in data.outputs:
        if output.name not in data.predicted:
            continue
        factor = _factor(data.measured[output.name], data.predicted[output.name])
        if factor > FACTOR or 0.0 < factor < 1.0 / FACTOR:
            yield (
                f"is the unit of {output.name} or that of its prediction wrong? They are correlated, "
                f"but it is {factor:.4g} times as large"
            )


def _stiff(data: GapData) -> Iterator[str]:
    """A measurement that follows the load as that of no gear or axis does."""
    role = next((r for r in (Role.TORQUE, Role.FORCE) if r in data.measurements), None)
    if role is None or data.target.population:
        return
    load = np.asarray(data.measurements[role], dtype=float)
    for output in data.outputs:
        y = data.measured[output.name]
        spread = float(np.std(load) * np.std(y))
        slope = _covariance(load, y) / max(float(np.var(load)), 1e-300)
        if spread > 0.0 and abs(slope) * np.std(load) > FOLLOWS * np.std(y):
            description = unlikely(1.0 / slope, output.unit, "N" if role is Role.FORCE else "Nm")
            if description:
                doubt = f"{_doubt(data, role)} Or that of {output.name}?"
                yield f"{doubt} It follows the load with a stiffness of {description}"


def unlikely(stiffness: float, unit: str, load: str, more: float = 1.0) -> str:
    """The description of a stiffness [load per unit] that no drive has, else empty.

    A compliance in addition to a simulation may be stiffer than a drive by the factor `more`.
    """
    kind = kind_of(unit)
    if (kind, load) not in STIFFNESS:
        return ""
    shown, low, high = STIFFNESS[kind, load]
    magnitude = abs(stiffness) / float(converted(1.0, unit, shown))
    if low <= magnitude <= high * more:
        return ""
    return f"{magnitude:.3g} {load}/{shown}; drives have {low:g} to {high:g}"


def unlikely_numbers(fit: Fit, data: GapData) -> list[str]:
    """Sentences about fitted compliances that no drive has."""
    load = "Nm" if Role.TORQUE in data.measurements else "N"
    return [
        f"the stiffness of torsional_compliance in {output.name} is {description}: are the units right?"
        for member, sizes in zip(fit.members, fit.coefficients, strict=True)
        if member.name == "torsional_compliance"
        for output, size in zip(member.candidate.effect.reached(data.target), sizes, strict=False)
        if size > 0.0 and (description := unlikely(1.0 / float(size), output.unit, load, STIFFER))
    ]


def _factor(measured: Array, predicted: Array) -> float:
    """The ratio of the measurement to the prediction; 0 where they are not correlated."""
    spread = float(np.std(measured) * np.std(predicted))
    covariance = _covariance(measured, predicted)
    if spread == 0.0 or covariance < ALIKE * spread:
        return 0.0
    return covariance / float(np.var(predicted))


def _covariance(x: Array, y: Array) -> float:
    return float(np.mean((x - x.mean()) * (y - y.mean())))


def _doubt(data: GapData, role: Role) -> str:
    column = next(c for c in data.target.columns if c.role is role)
    return f'is "{column.unit}" the unit of {column.name}?'
