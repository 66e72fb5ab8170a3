"""Backlash of the cycloid stage: contributions of the errors of its parts."""

from __future__ import annotations

from dataclasses import dataclass

from ...arrays import Array
from .geometry import RvGeometry

LINEAR_ERRORS = (
    "pin_circle_radius",
    "pin_position",
    "pin_hole_radius",
    "pin_radius",
    "pitch",
    "runout",
    "equidistance",
    "shift",
)
"""The errors that act at first order, in the order of document B's table."""
ROTATIONS = ("pin_position", "pitch")
"""Errors whose mean turns all pins, or all teeth, by the same angle: it causes no backlash."""


def coefficients(geometry: RvGeometry) -> dict[str, float]:
    """A of phi_2 = A . delta / (e z_c), by name of the error.

    Twice the relative sensitivities that document B prints: with the factor two the printed
    e z_c/(2 a_0) of the crank bearing agrees with the printed phi_3, the printed optimum with the
    printed 0.11', and exact geometry with the formula (docs/decisions/0003).
    """
    k1, flank = geometry.k1, geometry.flank
    return {
        "pin_circle_radius": 2.0 * flank,
        "pin_position": 2.0 * k1,
        "pin_hole_radius": 2.0,
        "pin_radius": -2.0,
        "pitch": k1,
        "runout": 0.5,
        "equidistance": 2.0,
        "shift": -2.0 * flank,
    }


def pin_circle_growth(geometry: RvGeometry, disc: Array, housing: Array) -> Array:
    """Growth [m] of the pin circle against the disc, (n,), by temperature rises [K] of both.

    alpha r_p (housing - disc): a uniformly warmed unit stays geometrically similar, so that its
    backlash, an angle, does not change.
    """
    return geometry.expansion * geometry.pin_circle_radius * (housing - disc)


@dataclass(frozen=True, slots=True)
class EccentricityLaw:
    """phi_2 changes by factor/(e z_c) (linear d + quadratic d^2) with an eccentricity error d [m].

    Document B has 0 at first order. With a factor of 1 the coefficients are fitted to exact 40-pin
    geometry of the RV-40E-121 (67.8 arcmin/mm times the polynomial) and hold for |d| <= 10 um; a
    factor of 2 counts the error once for each flank, which is twice the correct value.
    """

    linear: float = -0.055
    quadratic: float = -12.6e3
    factor: float = 1.0

    def expanded(self, mid: float) -> tuple[float, float, float]:
        """Constant, linear and quadratic coefficient about d = mid + x."""
        constant = self.linear * mid + self.quadratic * mid**2
        return constant, self.linear + 2.0 * self.quadratic * mid, self.quadratic
