"""Units of one allocation: the base sample scaled to its zones, as the kernels take it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Complex, Single
from ....units import ARCMIN, UM
from ..contact.geometry import ContactGeometry, unit
from .design import UnitDesign
from .sample import BaseSample


@dataclass(frozen=True, slots=True, eq=False)
class Scaled:
    """Errors of n units, units last.

    By pin (pins, n) [um]: `across` adds to the gap, `along` displaces the pin counter-clockwise. By
    disc (discs, n): `normal` [um] adds to the gap, `radial` [um] is the growth of the pin circle
    against the profile, `play` [arcmin] the free turn in either sense, `ahead` [arcmin] the forward
    turn.
    Complex (discs, n): `turning` and `offset` [um] displace the disc's centre in axes of its
    eccentric and of the disc, `around` [arcmin] turns it by its part across the line of cranks,
    `pitch` [arcmin] turns the tooth at angle u by its part along exp(iu). `circle` (n,) [um]
    displaces the pin circle.
    """

    across: Single
    along: Single
    normal: Array
    radial: Array
    play: Array
    ahead: Array
    turning: Complex
    offset: Complex
    around: Complex
    pitch: Complex
    circle: Complex

    @classmethod
    def of(cls, geometry: ContactGeometry, sample: BaseSample, design: UnitDesign) -> Scaled:
        """The units of a design."""
        z, width, mid = sample.z, design.width, design.middle
        arm = UM / geometry.nominal.centre_distance / ARCMIN  # arcmin per um at the cranks
        across = width("pin_hole_radius") * z["pin_hole_radius"]
        across -= width("pin_radius") * z["pin_radius"]
        across += mid("pin_hole_radius") - mid("pin_radius")
        journals = eccentrics(geometry, sample, design)
        tangential = width("bore") * z["bore_tangential"].mean(axis=0)
        growth = mid("pin_circle_radius") + width("pin_circle_radius") * z["pin_circle_radius"]
        return cls(
            across=across.astype(np.float32),
            along=(width("pin_position") * z["pin_position"]).astype(np.float32),
            normal=mid("equidistance") + width("equidistance") * z["equidistance"],
            radial=growth - mid("shift") - width("shift") * z["shift"],
            play=0.5 * arm * bearing_clearance(sample, design).mean(axis=0),
            ahead=arm * tangential + design.stagger * sides(geometry)[:, None],
            turning=journals.mean(axis=0),
            offset=0.5 * _waves(sample, design, "runout") - bores(geometry, sample, design),
            around=arm * (journals * crank_lines(geometry)).mean(axis=0),
            pitch=_waves(sample, design, "pitch") * pitch_turn(geometry),
            circle=width("circle_offset") * z["circle_offset"] * unit(sample.phase["circle_offset"]),
        )

    @property
    def units(self) -> int:
        """Number of units."""
        return int(self.across.shape[1])


def sides(geometry: ContactGeometry) -> Array:
    """Direction in which the stagger turns each disc, (discs,): alternately ahead and back."""
    return np.where(np.arange(geometry.discs) % 2 == 0, 1.0, -1.0)


def crank_lines(geometry: ContactGeometry) -> Complex:
    """exp(-i angle) of the cranks on their circle, (cranks, 1, 1)."""
    turn = -2.0 * np.pi * np.arange(geometry.cranks) / geometry.cranks
    return unit(turn)[:, None, None]


def bore_axes(geometry: ContactGeometry) -> Complex:
    """Direction of each bore in its disc, (cranks, discs, 1)."""
    return np.asarray(crank_lines(geometry).conj() * unit(-geometry.disc_angles)[None, :, None])


def pitch_turn(geometry: ContactGeometry) -> float:
    """Turn [arcmin] of a tooth per um of cumulative pitch error: F_p/(2 r_p)."""
    return 0.5 * UM / geometry.nominal.pin_circle_radius / ARCMIN


def eccentrics(geometry: ContactGeometry, sample: BaseSample, design: UnitDesign) -> Complex:
    """Displacement d_e + i e eps [um] of each eccentric in its axes, (cranks, discs, n)."""
    ahead = 1e-3 * geometry.nominal.eccentricity / UM  # um per mrad
    radial = design.middle("eccentricity") + design.width("eccentricity") * sample.z["eccentricity"]
    return np.asarray(radial + 1j * ahead * design.width("crank_phase") * sample.z["crank_phase"])


def bores(geometry: ContactGeometry, sample: BaseSample, design: UnitDesign) -> Complex:
    """Mean displacement [um] of the bores in axes of the disc, (discs, n)."""
    position = sample.z["bore_radial"] + 1j * sample.z["bore_tangential"]
    return np.asarray(design.width("bore") * (position * bore_axes(geometry)).mean(axis=0))


def bearing_clearance(sample: BaseSample, design: UnitDesign) -> Array:
    """Radial clearance [um] of each bearing in its zone [0, c], (cranks, discs, n).

    A mid-limit, which no document has, is added to every clearance.
    """
    fraction = 0.5 * (1.0 + sample.z["crank_bearing"])
    return np.asarray(design.middle("crank_bearing") + design.width("crank_bearing") * fraction)


def _waves(sample: BaseSample, design: UnitDesign, error: str) -> Complex:
    """A once-per-turn error [um] of each disc at its phase, (discs, n)."""
    size = design.middle(error) + design.width(error) * sample.z[error]
    return np.asarray(size * unit(sample.phase[error]))
