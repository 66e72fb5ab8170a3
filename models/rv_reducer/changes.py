"""Quantities of a loaded unit that effects may change, and the first-order change of the twist."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import Fault, raise_all
from ...units import ARCMIN, MRAD, UM
from ..inputs.distribution import Array
from ..measurable import Changeable
from .loaded_unit import LoadedUnit
from .order_table import LEFT_OUT, OrderTable


def _errors(unit: LoadedUnit, name: str, added: Array) -> LoadedUnit:
    errors = np.asarray(getattr(unit.errors, name), dtype=float)
    errors = errors.reshape((1,) * (added.ndim - errors.ndim) + errors.shape)
    return replace(unit, errors=replace(unit.errors, **{name: errors + added}))


def _pin_circle(unit: LoadedUnit, amount: float) -> LoadedUnit:
    return _errors(unit, "circle_radius", np.full(1, amount))


def _equidistance(unit: LoadedUnit, amount: float) -> LoadedUnit:
    return _errors(unit, "equidistance", np.full((1, 1), amount))


def _bearing(unit: LoadedUnit, amount: float) -> LoadedUnit:
    return _errors(unit, "bearing_clearance", np.full((1, 1, 1), amount))


def _sharing(unit: LoadedUnit, amount: float) -> LoadedUnit:
    return replace(unit, sharing=unit.sharing + amount)


def _series(unit: LoadedUnit, amount: float) -> LoadedUnit:
    stiffness = np.asarray(unit.contact.series_stiffness) * (1.0 + amount)
    return replace(unit, contact=replace(unit.contact, series_stiffness=stiffness))


def _phase_1(unit: LoadedUnit, amount: float) -> LoadedUnit:
    return _errors(unit, "crank_phase", np.array([[[amount, 0.0], [0.0, 0.0]]]))


def _phase_2(unit: LoadedUnit, amount: float) -> LoadedUnit:
    return _errors(unit, "crank_phase", np.array([[[0.0, amount], [0.0, 0.0]]]))


def _stagger(unit: LoadedUnit, amount: float) -> LoadedUnit:
    return _errors(unit, "angle", np.array([[-amount, amount]]))


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
        "stagger_arcmin", "arcmin", "turn of each disc, disc 2 ahead and disc 1 back", ARCMIN, -0.01, 0.01, _stagger
    ),
)
"""First order is exact for none of them, but within a few percent for changes of the size of a
tolerance under load (docs/transmission_error.md)."""

CHANGEABLE = tuple(Changeable(change.name, change.unit, change.meaning) for change in CHANGES)


class Answers:
    """First-order responses of the twist to changes, each computed at its first use."""

    def __init__(self, unit: LoadedUnit, samples: int, most: float) -> None:
        self.unit, self.samples, self.most = unit, samples, most
        self._cached: dict[str, OrderTable] = {}

    def table(self, name: str) -> OrderTable:
        """d twist/d quantity [rad per unit], by order and torque."""
        if name not in self._cached:
            change = next(candidate for candidate in CHANGES if candidate.name == name)
            low, high = (self._twist(change, step) for step in (change.low, change.high))
            step = change.high - change.low
            self._cached[name] = high.difference(low, step, LEFT_OUT)
        return self._cached[name]

    def _twist(self, change: Change, amount: float) -> OrderTable:
        mesh = change.applied(self.unit, amount).mesh(self.samples)
        return OrderTable.of(mesh, self.most, left_out=0.0)

    def of(self, changes: Mapping[str, Any], rows: int) -> list[tuple[OrderTable, Array]]:
        """Table and amount (n,) of every change that is not zero.

        Raises InputError for names that are not changeable and amounts that are not finite.
        """
        amounts = {name: np.broadcast_to(np.asarray(amount, dtype=float), rows) for name, amount in changes.items()}
        known = {change.name for change in CHANGES}
        raise_all(
            [
                *(
                    Fault(name, f"is not changeable; these are: {', '.join(sorted(known))}")
                    for name in amounts
                    if name not in known
                ),
                *(Fault(name, "must be finite") for name, amount in amounts.items() if not np.all(np.isfinite(amount))),
            ]
        )
        return [(self.table(name), amount) for name, amount in amounts.items() if amount.any()]
