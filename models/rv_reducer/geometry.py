"""Nominal geometry of an RV reducer."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import cos, radians, sin, sqrt

import numpy as np
from scipy.special import ndtr

from ...section import Array


@dataclass(frozen=True, slots=True)
class RvGeometry:
    """Nominal geometry; the defaults are the RV-40E-121 of document B.

    Lengths in metres. The document prints no sun pitch radius and no centre distance: 9 mm and
    36 mm are assumptions (z1 = 12, z2 = 36, m = 1.5 mm; z2/z1 = 3 is exact), as is the thermal
    expansion [1/K] of disc and housing: 11.5e-6, of bearing steel.
    """

    pin_circle_radius: float = 0.064
    pin_radius: float = 0.003
    eccentricity: float = 0.0013
    cycloid_teeth: int = 39
    pins: int = 40
    reduction_ratio: float = 121.0
    sun_pitch_radius: float = 0.009
    centre_distance: float = 0.036
    expansion: float = 11.5e-6

    @property
    def k1(self) -> float:
        """Shortening coefficient e z_p / r_p, in (0, 1)."""
        return self.eccentricity * self.pins / self.pin_circle_radius

    @property
    def flank(self) -> float:
        """sqrt(1 - k1^2): part of a radial displacement that closes the flank at first contact."""
        return sqrt(1.0 - self.k1**2)

    @property
    def lever(self) -> float:
        """e z_c, the largest lever arm of the cycloid mesh [m]."""
        return self.eccentricity * self.cycloid_teeth

    @property
    def output_ratio(self) -> float:
        """Turn of a disc against its mesh per turn of the carrier, with the sun held.

        The cranks turn by 1 + z1/z2 with the carrier: 1 + (1 + z1/z2)/z_c, 121/117 by default.
        """
        gears = (self.reduction_ratio - 1.0) / self.pins  # z2/z1
        return 1.0 + (1.0 + 1.0 / gears) / self.cycloid_teeth


# Equidistance and shift modification of the cycloid tooth profile (document B, section 3).
#
# dr_rp is the equidistance and dr_p the shift modification [m], both negative for the combined
# modification; phi in [0, pi] is the profile angle. The printed clearance is garbled (read literally
# it interferes at its own optimum); the forms here are the corrected ones (docs/decisions/0004).


def _profile(geometry: RvGeometry, phi: Array) -> tuple[Array, Array]:
    """(1 - k1 cos phi)/sqrt(S) and sin(phi)/sqrt(S), S = 1 + k1^2 - 2 k1 cos(phi)."""
    root = np.sqrt(1.0 + geometry.k1**2 - 2.0 * geometry.k1 * np.cos(phi))
    return (1.0 - geometry.k1 * np.cos(phi)) / root, np.sin(phi) / root


def raw_clearance(geometry: RvGeometry, dr_rp: Array, dr_p: Array, phi: Array) -> Array:
    """D_raw(phi) [m] of the modified profile in its nominal position, first order."""
    normal, _ = _profile(geometry, phi)
    return dr_rp - dr_p * normal


def clearance(geometry: RvGeometry, dr_rp: Array, dr_p: Array, phi: Array, rotation: Array | float = 0.0) -> Array:
    """D(phi) [m] after the disc has turned to first contact, and by `rotation` [rad] beyond.

    First order: it overstates the exact gap by 0.8 um at 25 deg and 5 um at 5 to 10 deg.
    """
    normal, lever = _profile(geometry, phi)
    conjugate = dr_rp * (1.0 - lever) - dr_p * (normal - geometry.flank * lever)
    return conjugate - rotation * geometry.lever * lever


def contact_angle(geometry: RvGeometry) -> float:
    """phi_0 = arccos(k1) [rad], where contact starts."""
    return float(np.arccos(geometry.k1))


def modification_backlash(geometry: RvGeometry, dr_rp: Array, dr_p: Array, rotation: Array | float = 0.0) -> Array:
    """Backlash [rad] that the modification itself leaves: 2 (dr_rp - dr_p sqrt(1-k1^2))/(e z_c) - 2 d_delta.

    `rotation` is the rotation-angle modification d_delta [rad]: below 0 both flanks are turned away from the pins.
    """
    return 2.0 * (dr_rp - dr_p * geometry.flank) / geometry.lever - 2.0 * rotation


def zero_backlash_pair(geometry: RvGeometry, radial_gap: float) -> tuple[float, float]:
    """(dr_rp, dr_p) [m] that leaves no backlash with the given gap at tip and root [m]."""
    dr_p = -radial_gap / (1.0 - geometry.flank)
    return radial_gap + dr_p, dr_p


def least_raw_clearance(geometry: RvGeometry, dr_rp: Array, dr_p: Array, rotation: Array | float = 0.0) -> Array:
    """Minimum of D_raw - d_delta e z_c sin(phi)/sqrt(S) over phi [m]: it lies at tip and root or at first contact.

    With a `rotation` d_delta [rad] for dr_p <= 0 alone, where it is concave in sin(phi)/sqrt(S).
    """
    return np.minimum(dr_rp - dr_p, dr_rp - dr_p * geometry.flank - rotation * geometry.lever)


def least_clearance(geometry: RvGeometry, dr_rp: Array, dr_p: Array) -> Array:
    """Minimum of D over phi [m] (constraint g5).

    With s = sin(phi)/sqrt(S) in [0, 1], D = dr_rp (1-s) - dr_p (sqrt(1-k1^2 s^2) - sqrt(1-k1^2) s):
    concave for dr_p <= 0, so the minimum lies at an end (0 at first contact); for dr_p > 0 it is
    where the slope vanishes.
    """
    k1, flank = geometry.k1, geometry.flank
    ends = np.minimum(dr_rp - dr_p, 0.0)
    ratio = np.where(dr_p > 0.0, dr_rp / np.where(dr_p > 0.0, dr_p, 1.0), 0.0) - flank
    s = np.clip(ratio / (k1 * np.sqrt(k1**2 + ratio**2)), 0.0, 1.0)
    inner = dr_rp * (1.0 - s) - dr_p * (np.sqrt(1.0 - (k1 * s) ** 2) - flank * s)
    return np.where(dr_p > 0.0, np.minimum(ends, inner), ends)


# Backlash of the involute stage, from the deviations of its gears.


REFERENCE_GRADE = 7
"""ISO grade of the default deviations; they grow by sqrt(2) per grade."""


@dataclass(frozen=True, slots=True)
class InvoluteStage:
    """Deviations of sun and planet at grade 7 [m]; all defaults are assumptions.

    `thickness_upper` and `thickness_lower` are the magnitudes of the deviations E_ss and E_si of
    the base tangent length, the same for both gears.
    """

    pressure_angle: float = radians(20.0)
    runout: float = 36e-6
    base_pitch: float = 13e-6
    helix: float = 11e-6
    parallelism_x: float = 11e-6
    parallelism_y: float = 5.5e-6
    centre_distance: float = 19.5e-6
    thickness_upper: float = 56e-6
    thickness_lower: float = 112e-6
    cosine: bool = True
    """Whether j_n, which is normal to the flanks, is divided by cos(alpha)."""

    @property
    def compensation(self) -> float:
        """Delta: reduction of the smallest clearance by gear errors [m]."""
        s, c = sin(self.pressure_angle), cos(self.pressure_angle)
        return sqrt(
            (2.0 * self.centre_distance * s) ** 2
            + 2.0 * self.helix**2
            + 2.0 * self.base_pitch**2
            + (self.parallelism_x * s) ** 2
            + (self.parallelism_y * c) ** 2
        )

    def flank_clearance(self) -> tuple[float, float]:
        """j_nmin and j_nmax [m] at grade 7, as document B prints them."""
        s, c = sin(self.pressure_angle), cos(self.pressure_angle)
        runout = 0.72 * 2.0 * self.runout
        least = 2.0 * self.thickness_upper * c - self.compensation
        least += 1.44 * (self.centre_distance - runout) * s
        most = 2.0 * self.thickness_lower * c + 1.44 * (self.centre_distance + runout) * s
        return least, most


def grade_factor(grade: Array) -> Array:
    """sqrt(2)^(grade - 7), the growth of gear deviations with the ISO grade (ISO 1328-1)."""
    return np.asarray(np.sqrt(2.0) ** (grade - REFERENCE_GRADE))


def lever(stage: InvoluteStage, geometry: RvGeometry) -> float:
    """j_n/phi_1 [m]: i r_1 cos(alpha), as document B prints it i r_1."""
    pitch = geometry.reduction_ratio * geometry.sun_pitch_radius
    return pitch * cos(stage.pressure_angle) if stage.cosine else pitch


def backlash_zone(stage: InvoluteStage, geometry: RvGeometry, grade: Array) -> tuple[Array, Array]:
    """Mid value and half-width [rad] of phi_1 of one planet, each of the shape of `grade`."""
    least, most = stage.flank_clearance()
    unit = grade_factor(grade) / lever(stage, geometry)
    return 0.5 * (most + least) * unit, 0.5 * (most - least) * unit


def clearance_limits(
    stage: InvoluteStage, grade: Array, thickness: Iterable[tuple[Array | float, Array | float] | None]
) -> tuple[Array, Array]:
    """j_nmin and j_nmax [m], each of the shape of `grade`, with tooth thickness apart from the grade.

    `thickness` has, for sun and planet, the magnitudes |Es_s| and |Es_i| [m] of the deviations of the base tangent
    length; None: those of `stage`, which grow with the grade. Errors of the gears grow with it in either case.
    """
    c, factor = cos(stage.pressure_angle), grade_factor(grade)
    with_teeth = stage.thickness_upper, stage.thickness_lower
    errors = [end - 2.0 * teeth * c for end, teeth in zip(stage.flank_clearance(), with_teeth, strict=True)]
    limits = [np.asarray(end * factor) for end in errors]
    for gear in thickness:
        ends = gear or tuple(teeth * factor for teeth in with_teeth)
        limits = [limit + end * c for limit, end in zip(limits, ends, strict=True)]
    return limits[0], limits[1]


# Staggered assembly: discs turned against each other, and the parts that do it.
#
# The stagger is the angle by which one disc is turned ahead and the other back. Rigid discs on one
# carrier touch forward by the disc that is turned ahead and backward by the other, so that they
# reduce the backlash of the cycloid stage by exactly the angle between them: twice the stagger.
# Document B writes phi_2' = phi_2 - 4 delta': its delta' is then half of the stagger.


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """Alternative part dimensions, each of which turns a disc by the same angle; all (n,).

    `hole_offset` [m]: all bearing holes of the disc displaced along their circle's tangents.
    `blank_angle` [rad]: the profile machined at this angle to the holes; `at_rim` [m] is the same
    on the radius of the pin circle. `journal_phase` [rad]: the disc's journals of all cranks
    ahead of nominal; `at_journal` [m] is how far that moves the journal's centre.
    """

    hole_offset: Array
    blank_angle: Array
    at_rim: Array
    journal_phase: Array
    at_journal: Array


def parts(geometry: RvGeometry, stagger: Array) -> Parts:
    """The part dimensions that turn one disc by `stagger` [rad], exact.

    A disc is placed on its cranks by the holes: holes displaced by s along the tangents of a circle
    of radius a_0 are turned by arctan(s/a_0). A disc whose eccentrics are ahead by epsilon has the
    position that it would have epsilon later, without the turn by epsilon/z_c.
    """
    phase = geometry.cycloid_teeth * stagger
    return Parts(
        hole_offset=geometry.centre_distance * np.tan(stagger),
        blank_angle=np.asarray(stagger),
        at_rim=geometry.pin_circle_radius * stagger,
        journal_phase=phase,
        at_journal=2.0 * geometry.eccentricity * np.sin(0.5 * phase),
    )


# Mean square backlash over units in closed form, and how it changes with the tolerances.
#
#     b = phi_1 + phi_3 + max(0, phi_2),   E b^2 = a^2 + w + 2 a E1 + E2
#
# with a and w the mean and the variance of phi_1 + phi_3, and, phi_2 taken as normal with mean m and
# variance v, x = m/sqrt(v),
#
#     E1 = E max(0, phi_2)   = m Phi(x) + sqrt(v) phi(x)
#     E2 = E max(0, phi_2)^2 = (m^2 + v) Phi(x) + m sqrt(v) phi(x).
#
# phi_2 sums nine errors, and is normal within what the rms of b shows: against the convolution of
# uniform errors the rms is off by 0.3 % in the median, 1.3 % at most. As a square of a convex and
# non-negative function E b^2 is convex in the tolerances and grows with each, but for the small bend
# of the eccentricity's mean.


@dataclass(frozen=True, slots=True, eq=False)
class MeanSquare:
    """E b^2 (n,) [arcmin^2] and its derivatives by mean and variance of the parts, each (n,)."""

    value: Array
    by_mean: Array
    """By m, the mean of phi_2."""
    by_variance: Array
    """By v, the variance of phi_2."""
    by_free: Array
    """By a, the mean of phi_1 + phi_3; that by its variance is 1."""


def mean_square(a: Array, w: Array, m: Array, v: Array) -> MeanSquare:
    """E b^2 of mean a and variance w of phi_1 + phi_3, mean m and variance v > 0 of phi_2.

    Shapes broadcast; the unit is that of the arguments, squared.
    """
    deviation = np.sqrt(v)
    x = m / deviation
    density = np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi)
    above = ndtr(x)
    first = m * above + deviation * density
    second = (m * m + v) * above + m * deviation * density
    return MeanSquare(
        value=a * a + w + 2.0 * a * first + second,
        by_mean=2.0 * (a * above + first),
        by_variance=a * density / deviation + above,
        by_free=2.0 * (a + first),
    )
