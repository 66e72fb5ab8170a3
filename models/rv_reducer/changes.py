"""Quantities of a loaded unit that effects may change, and the first-order change of the twist."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...arrays import Array
from ...errors import Fault, raise_all
from ...units import ARCMIN, MRAD, UM
from ..measurable import Changeable
from .loaded_unit import LoadedUnit
from .order_table import LEFT_OUT, OrderTable


def _part_error(name: str, pattern: object) -> Callable[[LoadedUnit, float], LoadedUnit]:
    """The change that adds `pattern` times an amount to a part error of the unit."""

    def apply(unit: LoadedUnit, amount: float) -> LoadedUnit:
        added = amount * np.asarray(pattern, dtype=float)
        errors = np.asarray(getattr(unit.errors, name), dtype=float)
        errors = errors.reshape((1,) * (added.ndim - errors.ndim) + errors.shape)
        return replace(unit, errors=replace(unit.errors, **{name: errors + added}))

    return apply


def _sharing(unit: LoadedUnit, amount: float) -> LoadedUnit:
    return replace(unit, sharing=unit.sharing + amount)


def _series(unit: LoadedUnit, amount: float) -> LoadedUnit:
    stiffness = np.asarray(unit.contact.series_stiffness) * (1.0 + amount)
    return replace(unit, contact=replace(unit.contact, series_stiffness=stiffness))


_pin_circle = _part_error("circle_radius", [1.0])
_equidistance = _part_error("equidistance", [[1.0]])
_bearing = _part_error("bearing_clearance", [[[1.0]]])
_phase_1 = _part_error("crank_phase", [[[1.0, 0.0], [0.0, 0.0]]])
_phase_2 = _part_error("crank_phase", [[[0.0, 1.0], [0.0, 0.0]]])
_stagger = _part_error("angle", [[-1.0, 1.0]])


@dataclass(frozen=True, slots=True)
class Change:
    """A changeable quantity: its unit in SI, and the steps of its finite difference, in `unit`."""

    name: str
    unit: str
    meaning: str
    si: float
    low: float
    high: float
    apply: Callable[[LoadedUnit, float], LoadedUnit]

    def applied(self, unit: LoadedUnit, amount: float) -> LoadedUnit:
        """The unit with the quantity changed by `amount`, in the quantity's unit."""
        return self.apply(unit, amount * self.si)


CHANGES = (
    Change("pin_circle_radius_um", "um", "radius of the pin circle", UM, -1.0, 1.0, _pin_circle),
    Change("equidistance_um", "um", "equidistance modification of both discs", UM, -1.0, 1.0, _equidistance),
    Change("crank_bearing_um", "um", "radial clearance of the crank bearings", UM, 0.0, 1.0, _bearing),
    Change(
        "sharing_percent",
        "percent",
        "series stiffness of disc 1 above the mean, disc 2 below",
        0.01,
        -2.0,
        2.0,
        _sharing,
    ),
    Change("series_stiffness_percent", "percent", "series stiffness of both discs", 0.01, -2.0, 2.0, _series),
    Change("eccentric_phase_1_mrad", "mrad", "phase of crank 1's eccentric for disc 1", MRAD, -0.1, 0.1, _phase_1),
    Change("eccentric_phase_2_mrad", "mrad", "phase of crank 1's eccentric for disc 2", MRAD, -0.1, 0.1, _phase_2),
    Change(
        "stagger_arcmin",
        "arcmin",
        "angle by which disc 2 is turned ahead and disc 1 back",
        ARCMIN,
        -0.01,
        0.01,
        _stagger,
    ),
)
"""First-order responses are within a few percent of the exact change for changes of the size of a
tolerance under load (docs/transmission_error.md)."""

CHANGEABLE = tuple(Changeable(change.name, change.unit, change.meaning) for change in CHANGES)


class Responses:
    """First-order responses of the twist to changes, computed at their first use."""

    def __init__(self, unit: LoadedUnit, samples: int, most: float) -> None:
        self.unit, self.samples, self.most = unit, samples, most
        self._cached: dict[str, OrderTable] = {}

    def table(self, name: str) -> OrderTable:
        """d twist/d quantity [rad per unit], by order and torque."""
        if name not in self._cached:
            change = next(candidate for candidate in CHANGES if candidate.name == name)
            low, high = (
                OrderTable.of(change.applied(self.unit, amount).mesh(self.samples), self.most, left_out=0.0)
                for amount in (change.low, change.high)
            )
            self._cached[name] = high.difference(low, change.high - change.low, LEFT_OUT)
        return self._cached[name]

    def of(self, changes: Mapping[str, Any], rows: int) -> list[tuple[OrderTable, Array]]:
        """Table and amount (n,) of every change that is not zero.

        Raises InputError for names that are not changeable and amounts that are not finite.
        """
        amounts = {name: np.broadcast_to(np.asarray(amount, dtype=float), rows) for name, amount in changes.items()}
        known = {change.name for change in CHANGES}
        raise_all(
            [
                *(
                    Fault(name, f"cannot be changed; the changeable quantities are {', '.join(sorted(known))}")
                    for name in amounts
                    if name not in known
                ),
                *(Fault(name, "must be finite") for name, amount in amounts.items() if not np.all(np.isfinite(amount))),
            ]
        )
        return [(self.table(name), amount) for name, amount in amounts.items() if amount.any()]
