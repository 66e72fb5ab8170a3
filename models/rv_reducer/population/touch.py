"""First contact of rigid units at every position of a turn."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from ....arrays import Single
from ..contact.contact import Engine, uses_numba
from .lattice import Lattice
from .scaled import Scaled
from .table import Table

Contacts = NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """Where units touch: turns of the disc against the mesh [arcmin], (positions, units).

    `high` is first contact forward, `low` backward; `ahead` and `behind` are the contacts of the
    lattice that make it.
    """

    high: Single
    low: Single
    ahead: Contacts
    behind: Contacts

    def cycloid(self, output_ratio: float) -> Single:
        """Backlash y of the cycloid stage at the carrier [arcmin]; below zero: interference."""
        return np.asarray((self.high - self.low) * np.float32(1.0 / output_ratio))


def touch(lattice: Lattice, table: Table, units: Scaled, engine: Engine = "auto") -> Touch:
    """First contact of all units at all positions."""
    shape = (lattice.shape[0], units.units)
    contact = Touch(
        np.empty(shape, np.float32), np.empty(shape, np.float32), np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    )
    name = ".compiled" if uses_numba(engine) else ".arrays"
    import_module(name, __package__).touch(
        (table.values, lattice.pin, lattice.start, lattice.stop, lattice.directions),
        packed(units),
        (contact.high, contact.low, contact.ahead, contact.behind),
    )
    return contact


def packed(units: Scaled) -> tuple[Single, ...]:
    """Errors across and along pins (pins, n), of discs (discs, 12, n) and of the circle (2, n)."""
    columns = [units.normal, units.radial, units.play, units.ahead]
    for errors in (units.turning, units.offset, units.around, units.pitch):
        columns += [errors.real, errors.imag]
    wide = np.broadcast_shapes(*(column.shape for column in columns))
    discs = np.stack([np.broadcast_to(column, wide) for column in columns], axis=1)
    circle = np.stack([units.circle.real, units.circle.imag])
    arrays = (units.across, units.along, discs, circle)
    return tuple(np.ascontiguousarray(values, dtype=np.float32) for values in arrays)
