"""Coefficients of every contact of a lattice from the nominal profile, at a modification."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Single
from ....units import ARCMIN, MM, UM
from .lattice import Lattice

COLUMNS = ("gap", "lever", "radial", "tangential", "x", "y", "cos", "sin", "by_shift")


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Coefficients (contacts, columns) of the turn at which a contact is made.

    `gap` [arcmin] of perfect parts; `lever` kappa [arcmin/um], the turn of the disc that closes a
    gap; kappa times the normal's `radial` and `tangential` part in the pin's axes and its `x` and
    `y` in the housing's; `cos` and `sin` of the pin's angle; `by_shift` [arcmin/mm], the derivative
    of `gap` by the shift modification. `arm` [m] (contacts,) is the signed lever arm and
    `arm_by_shift` [m/mm] its derivative.
    """

    values: Single
    arm: Array
    arm_by_shift: Array

    @classmethod
    def of(cls, lattice: Lattice, dr_rp: float, dr_p: float) -> Table:
        """The table at modifications [m]."""
        (distance, along, across, arm), slope = lattice.profile.at(dr_p)
        across, arm = across * lattice.side, arm * lattice.side
        kappa = UM / ARCMIN / arm
        gap = (distance + dr_rp) / arm / ARCMIN
        longer = slope[3] * lattice.side
        by_shift = slope[0] / arm / ARCMIN - gap * longer / arm
        housing = kappa * (along + 1j * across) * lattice.direction
        columns = [
            gap,
            kappa,
            kappa * along,
            kappa * across,
            housing.real,
            housing.imag,
            lattice.direction.real,
            lattice.direction.imag,
            by_shift * MM,
        ]
        return cls(np.stack(columns, axis=1).astype(np.float32), arm, longer * MM)
