"""What the nominal profile says of every contact of a lattice, at a tooth modification."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....units import ARCMIN, UM
from ..contact.nominal import Nominal
from .lattice import Lattice

Array = NDArray[np.float64]
Single = NDArray[np.float32]
STEP = 0.5e-6
"""Step [m] of the shift modification in the difference of the table."""
COLUMNS = ("gap", "lever", "radial", "tangential", "x", "y", "cos", "sin", "by_shift")


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Coefficients (contacts, columns) of the turn at which a contact is made.

    `gap` [arcmin] of perfect parts; `lever` kappa [arcmin/um], what a gap is as a turn of the disc;
    kappa times the normal's `radial` and `tangential` part in the pin's axes and its `x` and `y`
    in the housing's; `cos` and `sin` of the pin's angle; `by_shift` [arcmin/mm], the derivative of
    `gap` by the shift modification. `arm` [m] (contacts,) is the signed lever arm and
    `arm_by_shift` [m/mm] its derivative.
    """

    values: Single
    arm: Array
    arm_by_shift: Array

    @classmethod
    def of(cls, lattice: Lattice, dr_rp: float, dr_p: float) -> Table:
        """The table at modifications [m]."""
        distance, normal, arm = _profile(lattice, dr_p)
        kappa = UM / ARCMIN / arm
        gap = (distance + dr_rp) / arm / ARCMIN
        beside = [_profile(lattice, dr_p + step) for step in (STEP, -STEP)]
        ahead, before = ((found[0] + dr_rp) / found[2] / ARCMIN for found in beside)
        longer = (beside[0][2] - beside[1][2]) / (2.0 * STEP * 1e3)
        housing = normal * lattice.direction
        columns = [
            gap,
            kappa,
            kappa * normal.real,
            kappa * normal.imag,
            kappa * housing.real,
            kappa * housing.imag,
            lattice.direction.real,
            lattice.direction.imag,
            (ahead - before) / (2.0 * STEP * 1e3),
        ]
        return cls(np.stack(columns, axis=1).astype(np.float32), arm, longer)


def _profile(lattice: Lattice, dr_p: float) -> tuple[Array, NDArray[np.complex128], Array]:
    """Distance from the curve [m], normal in the pin's axes, and lever arm [m], by contact."""
    geometry = replace(lattice.geometry, dr_rp=0.0, dr_p=dr_p)
    nominal = Nominal.at(geometry, lattice.nodes)
    at_nodes = np.stack(
        [nominal.gap, nominal.normal.real, nominal.normal.imag, nominal.lever], axis=1
    )
    distance, along, across, arm = (lattice.weights @ at_nodes).T
    return distance, along + 1j * across * lattice.side, arm * lattice.side
