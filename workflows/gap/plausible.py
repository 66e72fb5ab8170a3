"""Units that are wrong by far: readings that nothing on a bench has."""

from __future__ import annotations

from collections.abc import Iterator
from math import radians, tau

import numpy as np

from ...models.inputs.distribution import Array
from ...models.measurable import Role
from .data import GapData

MOST = {
    Role.ANGLE: (1000.0 * tau, "1000 turns"),
    Role.TORQUE: (1e6, "1e6 N m"),
    Role.FORCE: (1e7, "1e7 N"),
    Role.SPEED: (1e5, "1e5 rpm"),
    Role.TEMPERATURE: (400.0, "400 degC"),
    Role.PAYLOAD: (1e5, "1e5 kg"),
    Role.POSITION: (1e3, "1 km"),
    Role.TIME: (3e8, "ten years"),
}
"""Span or magnitude, in the units of `Readings`, that is beyond a test bench."""
LITTLE = radians(0.5)
"""[rad] An angle that turns goes further; that of a unit whose input is locked does not."""
FACTOR = 20.0
"""How many times its prediction a measurement is not, in one unit."""
ALIKE = 0.9
"""Correlation from which a measurement and its prediction are of one thing."""


def implausible(data: GapData) -> list[str]:
    """Sentences about columns whose unit is hardly the one that was given."""
    return [*_beyond(data), *_still(data), *_scaled(data)]


def _beyond(data: GapData) -> Iterator[str]:
    for role, (most, text) in MOST.items():
        if role not in data.readings or data.target.units.get(role) in ("m", "m/s"):
            continue
        x = np.asarray(data.readings[role], dtype=float)
        size = np.ptp(x) if role in (Role.ANGLE, Role.TIME) else np.abs(x).max(initial=0.0)
        if size > most:
            yield f"{_said(data, role)} It reaches beyond {text}"


def _still(data: GapData) -> Iterator[str]:
    """An angle that hardly turns, on a unit that is not locked."""
    turning = data.target.units.get(Role.ANGLE) == "rad" and Role.POSITION not in data.readings
    span = float(np.ptp(data.readings[Role.ANGLE])) if turning else 0.0
    if 0.0 < span < LITTLE and not data.target.locked:
        yield f"{_said(data, Role.ANGLE)} It spans {np.degrees(span):.2g} deg in all"


def _scaled(data: GapData) -> Iterator[str]:
    """A measurement that is many times its prediction, or a small part of it."""
    for output in data.outputs:
        if output.name not in data.predicted:
            continue
        factor = _factor(data.measured[output.name], data.predicted[output.name])
        if factor > FACTOR or 0.0 < factor < 1.0 / FACTOR:
            yield (f"is the unit of {output.name} or that of its prediction wrong? They go "
                   f"together, but it is {factor:.4g} times as large")  # fmt: skip


def _factor(measured: Array, predicted: Array) -> float:
    """How many times the prediction varies with it the measurement does, 0 where they do not."""
    spread = float(np.std(measured) * np.std(predicted))
    covariance = float(np.mean((measured - measured.mean()) * (predicted - predicted.mean())))
    if spread == 0.0 or covariance < ALIKE * spread:
        return 0.0
    return covariance / float(np.var(predicted))


def _said(data: GapData, role: Role) -> str:
    column = next(one for one in data.target.columns if one.role is role)
    return f'is "{column.unit}" the unit of {column.name}?'
