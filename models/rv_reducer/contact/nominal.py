"""The exact nominal profile around each pin, and the gap of a displaced pin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from ....arrays import Array, Complex
from .geometry import ContactGeometry, curve, foot, lever, nominal_pin

STEEP = 1500.0
"""Bend [1/m] from which the series of the osculating circle is not used: radii below 0.7 mm."""


@dataclass(frozen=True, slots=True, eq=False)
class Nominal:
    """The nominal profile at given phases; all arrays have the same shape.

    `gap` [m]; `lever` [m], how much of it a forward turn of the disc closes per radian; in the
    pin's axes `normal` (outward) and `tangent` of the profile and `radial`, the direction in which
    a shift modification moves it; `bend` [1/m], kappa/(1 + kappa d) with the curvature kappa of the
    curve C and the distance d from it; `cubic` [1/m^2], (d kappa/ds)/6/(1 + kappa d)^3; `mixed`
    [1/m], how the effect of a shift changes along C.
    """

    gap: Array
    lever: Array
    normal: Complex
    tangent: Complex
    radial: Complex
    bend: Array
    cubic: Array
    mixed: Array

    @classmethod
    def at(cls, geometry: ContactGeometry, phi: Array) -> Self:
        """The nominal profile at phases phi [rad] from pin to eccentric."""
        pin = nominal_pin(geometry, phi)
        c = curve(geometry, phi, foot(geometry, phi, pin))
        speed = np.abs(c.first)
        tangent = c.first / speed
        normal = -1j * tangent
        distance = np.real((pin - c.point) * normal.conj())
        kappa = -np.real(c.second * normal.conj()) / speed**2
        change = np.imag(c.first.conj() * c.third) / speed**4
        change -= 3.0 * kappa * np.real(c.first.conj() * c.second) / speed**3
        spread = 1.0 + kappa * distance
        return cls(
            gap=distance + geometry.dr_rp,
            lever=np.imag(pin * normal.conj()) if geometry.true_levers else lever(geometry, phi),
            normal=normal,
            tangent=tangent,
            radial=c.radial,
            bend=kappa / spread,
            cubic=change / (6.0 * spread**3),
            mixed=np.real(1j * c.radial * normal.conj()) / (speed * spread),
        )

    def displaced(self, moved: Complex, shift: Array | float = 0.0) -> Array:
        """Gap [m] with the pin displaced by `moved` [m] and the shift modification by `shift` [m].

        With x_n and x_t along and across the normal, shift included, and c = `bend`:
        x_n + c x_t^2 (1 - c x_n)/2 + `cubic` x_t^3 - `mixed` shift x_t. The omitted terms are of
        fourth order. Where the curve is `STEEP`, the osculating circle's distance is taken instead
        of its series: with h = sqrt((1 + c x_n)^2 + (c x_t)^2) it is
        (2 x_n + c (x_n^2 + x_t^2))/(1 + h), and x_t/h the arc for the cubic term.
        """
        moved = moved - shift * self.radial
        along, across = np.real(moved * self.normal.conj()), np.real(moved * self.tangent.conj())
        bent = self.bend * across
        gap = along + 0.5 * bent * across * (1.0 - self.bend * along) + self.cubic * across**3
        steep = np.abs(self.bend) > STEEP
        x_n, x_t, c = along[:, steep], across[:, steep], self.bend[steep]
        length = np.hypot(1.0 + c * x_n, c * x_t)
        circle = (2.0 * x_n + c * (x_n**2 + x_t**2)) / (1.0 + length)
        gap[:, steep] = circle + self.cubic[steep] * (x_t / length) ** 3
        return np.asarray(self.gap + gap - self.mixed * shift * across)
