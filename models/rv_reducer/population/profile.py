"""The nominal profile at many contacts, as a polynomial in the shift modification.

Distance, normal and lever arm are smooth in the phase of a pin and in the modification: they are
computed at Chebyshev nodes of both, and a table at any modification is a short sum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from ..contact.geometry import ContactGeometry, lever
from ..contact.nominal import Nominal

Array = NDArray[np.float64]
LEAST_LEVER = 0.3
"""Share of the largest lever arm below which pins are left out: they close no backlash."""
PHASES, SHIFTS = 96, 9
"""Chebyshev nodes over the phase, and over the shift modification: errors of 1e-13."""
RANGE = (-150e-6, 30e-6)
"""Shift modifications [m] that one polynomial covers; others take a polynomial of their own."""


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Distance from the curve [m], normal's radial and tangential part, and lever arm [m].

    `phase` [rad] (contacts,) are magnitudes of phases, `coefficients` (SHIFTS, 4, contacts) those
    of Chebyshev polynomials over the `shifts` [m], for the equidistance modification 0.
    """

    geometry: ContactGeometry
    phase: Array
    shifts: tuple[float, float]
    coefficients: Array

    @classmethod
    def of(
        cls, geometry: ContactGeometry, phase: Array, shifts: tuple[float, float] = RANGE
    ) -> Profile:
        """The profile at phases within those of pins whose lever arms count."""
        low, high = _phases(geometry)
        nodes = 0.5 * (low + high) - 0.5 * (high - low) * _nodes(PHASES)
        modified = 0.5 * (shifts[0] + shifts[1]) + 0.5 * (shifts[1] - shifts[0]) * _nodes(SHIFTS)
        found = [_at(geometry, nodes, float(one)) for one in modified]
        table = np.concatenate(found, axis=1)  # (phases, 4 SHIFTS)
        values = (_interpolation(nodes, phase) @ table).T.reshape(SHIFTS, 4 * len(phase))
        basis = chebyshev.chebvander(_nodes(SHIFTS), SHIFTS - 1)
        coefficients = np.linalg.solve(basis, values)
        return cls(geometry, phase, shifts, coefficients.reshape(SHIFTS, 4, len(phase)))

    def at(self, shift: float) -> tuple[Array, Array]:
        """Values and derivatives by the shift [1/m], each (4, contacts)."""
        low, high = self.shifts
        if not low <= shift <= high:
            half = 0.5 * (high - low)
            return Profile.of(self.geometry, self.phase, (shift - half, shift + half)).at(shift)
        x = (2.0 * shift - low - high) / (high - low)
        one = np.eye(SHIFTS)
        basis = np.array([chebyshev.chebval(x, row) for row in one])
        slope = np.array([chebyshev.chebval(x, chebyshev.chebder(row)) for row in one])
        slope *= 2.0 / (high - low)
        return np.einsum("k,kic->ic", basis, self.coefficients), np.einsum(
            "k,kic->ic", slope, self.coefficients
        )


def _at(geometry: ContactGeometry, phase: Array, shift: float) -> Array:
    nominal = Nominal.at(replace(geometry, dr_rp=0.0, dr_p=shift), phase)
    columns = [nominal.gap, nominal.normal.real, nominal.normal.imag, nominal.lever]
    return np.stack(columns, axis=1)


def _nodes(count: int) -> Array:
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def _phases(geometry: ContactGeometry) -> tuple[float, float]:
    """Phases [rad] between which lever arms count."""
    phase = np.linspace(0.0, np.pi, 20_001)
    counted = phase[lever(geometry, phase) / geometry.nominal.lever >= LEAST_LEVER]
    step = phase[1]
    return max(float(counted[0]) - step, 0.5 * step), float(counted[-1]) + step


def _interpolation(nodes: Array, at: Array) -> Array:
    """Barycentric weights (points, nodes) of Chebyshev interpolation."""
    count = len(nodes)
    own = np.sin(np.pi * (np.arange(count) + 0.5) / count) * (-1.0) ** np.arange(count)
    away = at[:, None] - nodes
    on = np.abs(away) < 1e-14
    found = own / np.where(on, 1.0, away)
    found /= found.sum(axis=1, keepdims=True)
    rows = on.any(axis=1)
    found[rows] = on[rows]
    return np.asarray(found)
