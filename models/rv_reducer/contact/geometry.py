"""Nominal geometry of the loaded contact: the modified profile around one pin, exactly.

Everything around a pin is expressed in axes that point from the housing's centre to the pin (real
part) and counter-clockwise (imaginary part). With phi the angle from the pin to the eccentric, the
pin's centre relative to that of the disc is r_p - e exp(i phi), and the curve that it must follow
is C(v) = (r_p + dr_p) exp(i v) - e exp(i (phi + z_p v)); the tooth is its inner parallel curve at
r_rp + dr_rp. The gap is the distance of the pin's centre from C plus dr_rp.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Self

import numpy as np

from ....section import Array, Complex
from ..geometry import RvGeometry

_SPACING = 1e-3
"""Spacing [rad] of the points of C from which its nearest point is sought."""
_BOTTOM = 0.9
"""Cosine of the phase above which C may have two nearest points."""


@dataclass(frozen=True, slots=True)
class ContactGeometry:
    """Nominal parts: lengths in metres; the modification of document B by default.

    Two cranks and two discs are assumptions, as in document A. A bearing's play turns its disc by
    `play_factor` times the turn about the disc's centre. Lever arms are those of the modified
    profile's own normals; without `true_levers` e z_c sin(phi)/sqrt(S), those of the unmodified
    profile, 1 % different where pins are loaded (7 % near the bottom of a tooth space), which puts
    0.7 % on peak force and wind-up. Without an `involute_stage` the cranks are the input.
    """

    nominal: RvGeometry = RvGeometry()
    dr_rp: float = -40e-6
    dr_p: float = -70e-6
    discs: int = 2
    cranks: int = 2
    true_levers: bool = True
    involute_stage: bool = True
    play_factor: float = 1.0

    @property
    def pins(self) -> int:
        """Number of pins."""
        return self.nominal.pins

    @property
    def output_ratio(self) -> float:
        """b'/b: turn of a disc against its mesh per turn of the carrier with the input held.

        With the sun held it is that of the nominal geometry, 121/117 for the RV-40E. With the
        cranks held they are at rest in the housing, as is the mesh, and it is 1.
        """
        return self.nominal.output_ratio if self.involute_stage else 1.0

    @property
    def pin_angles(self) -> Array:
        """Angles [rad] of the pins in the housing, (pins,)."""
        return 2.0 * np.pi * np.arange(self.pins) / self.pins

    @property
    def disc_angles(self) -> Array:
        """Angles [rad] of the discs' eccentrics, and of the discs, against the first, (discs,)."""
        return 2.0 * np.pi * np.arange(self.discs) / self.discs

    def phase(self, angles: Array) -> Array:
        """Angle phi [rad] from each pin to the eccentric, (angles, discs, pins)."""
        eccentric = angles[:, None] + self.disc_angles
        return np.asarray(eccentric[:, :, None] - self.pin_angles)


def unit(angle: Array) -> Complex:
    """exp(i angle)."""
    return np.asarray(np.exp(1j * angle), dtype=np.complex128)


@dataclass(frozen=True, slots=True)
class Curve:
    """C and its first three derivatives by v, and exp(i v)."""

    point: Complex
    first: Complex
    second: Complex
    third: Complex
    radial: Complex


def curve(geometry: ContactGeometry, phi: Array, v: Array, shift: Array | float = 0.0) -> Curve:
    """The curve C at v around a pin at phase phi, with a deviation of the shift modification."""
    nominal = geometry.nominal
    radial = unit(v)
    big = (nominal.pin_circle_radius + geometry.dr_p + shift) * radial
    small = nominal.eccentricity * unit(phi + nominal.pins * v)
    first = np.multiply(1j, big - nominal.pins * small, dtype=np.complex128)
    second = nominal.pins**2 * small - big
    third = np.multiply(1j, nominal.pins**3 * small - big, dtype=np.complex128)
    return Curve(big - small, first, second, third, radial)


def foot(geometry: ContactGeometry, phi: Array, pin: Complex, shift: Array | float = 0.0) -> Array:
    """Parameter v of the point of C nearest to `pin`.

    Newton's method from the nearest of a few points: close to the bottom of a tooth space C is bent
    inwards with a radius below a tenth of a millimetre, and a pin's centre may have two feet.
    Raises ArithmeticError where it does not settle: errors far beyond a tooth's radius.
    """
    nearest = _nearest_start(geometry, phi, pin, shift)
    v, phi, pin, shift = (np.broadcast_to(array, nearest.shape).ravel() for array in (nearest, phi, pin, shift))
    unsettled, nearest_flat = np.arange(v.size), nearest.reshape(-1)
    for _ in range(100):
        at = curve(geometry, phi, v, shift)
        away = pin - at.point
        speed = np.abs(at.first) ** 2
        slope = speed - np.real(away * at.second.conj())
        # downhill also where the distance is not convex
        step = np.real(away * at.first.conj()) / np.maximum(np.abs(slope), 2e-3 * speed)
        v = v + np.clip(step, -_SPACING, _SPACING)
        nearest_flat[unsettled] = v
        moving = np.abs(step) >= 1e-11
        if not np.any(moving):
            return nearest
        unsettled, v, phi, pin, shift = unsettled[moving], v[moving], phi[moving], pin[moving], shift[moving]
    raise ArithmeticError("Newton's method reaches no nearest point of the profile; the errors are too large")


def _nearest_start(geometry: ContactGeometry, phi: Array, pin: Complex, shift: Array | float) -> Array:
    """Parameter of the nearest of a few points of C; more than one only at bottoms of spaces."""
    nearest = np.zeros(np.broadcast_shapes(phi.shape, pin.shape, np.shape(shift)))
    bottom = np.broadcast_to(np.cos(phi) > _BOTTOM, nearest.shape)
    phi, pin, shift = (np.broadcast_to(array, nearest.shape)[bottom] for array in (phi, pin, shift))
    v = nearest[bottom]
    least = np.abs(pin - curve(geometry, phi, v, shift).point)
    for start in _SPACING * np.array([-4, -3, -2, -1, 1, 2, 3, 4]):
        distance = np.abs(pin - curve(geometry, phi, np.full_like(v, start), shift).point)
        v, least = np.where(distance < least, start, v), np.minimum(distance, least)
    nearest[bottom] = v
    return nearest


def nominal_pin(geometry: ContactGeometry, phi: Array) -> Complex:
    """Centre of a pin relative to the disc's centre, in the pin's axes [m]."""
    nominal = geometry.nominal
    return nominal.pin_circle_radius - nominal.eccentricity * unit(phi)


def lever(geometry: ContactGeometry, phi: Array) -> Array:
    """Lever arm e z_c sin(phi)/sqrt(S) [m] of the unmodified profile."""
    k1 = geometry.nominal.k1
    root = np.sqrt(1.0 + k1**2 - 2.0 * k1 * np.cos(phi))
    return np.asarray(geometry.nominal.lever * np.sin(phi) / root)


# Errors of the parts of an RV reducer, for batches of units.


_ERRORS = {
    ("units", "discs", "pins"): ("pin_radius", "hole_radius", "radial_position", "tangential_position"),
    ("units", "discs"): ("equidistance", "shift", "pitch", "pitch_phase", "disc_offset", "disc_offset_phase", "angle"),
    ("units", "cranks", "discs"): (
        "crank_phase",
        "eccentricity",
        "bearing_clearance",
        "bore_radial",
        "bore_tangential",
    ),
    ("units",): ("circle_radius", "circle_offset", "circle_phase"),
}
AXES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {name: axes for axes, names in _ERRORS.items() for name in names}
)
"""The axes of each error; any of them may have length 1 or, from the left, be omitted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartErrors:
    """Deviations from nominal: lengths in metres, angles in radians, zero where not given.

    Shapes broadcast from the right to those of `AXES`: a full-length pin is (units, 1, pins), one
    value per unit of a pin error is (units, 1, 1), a whole crank is (units, cranks, 1).

    `tangential_position` is counter-clockwise. `pitch` is the cumulative pitch error F_p: the tooth
    at angle u of its disc is displaced by F_p/2 cos(u - pitch_phase). `disc_offset` is the distance
    of the profile's centre from the bearings' (half the runout F_r), at `disc_offset_phase` in the
    disc; `circle_offset` that of the pin circle from the main bearing, at `circle_phase` in the
    housing. `angle` turns a disc forward (its angular error, or stagger). `crank_phase`,
    `eccentricity` and `bearing_clearance` (full radial play [0, c]) are of each eccentric.
    `bore_radial` (outwards) and `bore_tangential` (counter-clockwise) are the position errors of
    each bearing bore in its disc, along and across the line from the disc's centre to the bore.
    """

    pin_radius: Array | float = 0.0
    hole_radius: Array | float = 0.0
    radial_position: Array | float = 0.0
    tangential_position: Array | float = 0.0
    equidistance: Array | float = 0.0
    shift: Array | float = 0.0
    pitch: Array | float = 0.0
    pitch_phase: Array | float = 0.0
    disc_offset: Array | float = 0.0
    disc_offset_phase: Array | float = 0.0
    angle: Array | float = 0.0
    crank_phase: Array | float = 0.0
    eccentricity: Array | float = 0.0
    bearing_clearance: Array | float = 0.0
    bore_radial: Array | float = 0.0
    bore_tangential: Array | float = 0.0
    circle_radius: Array | float = 0.0
    circle_offset: Array | float = 0.0
    circle_phase: Array | float = 0.0

    def __post_init__(self) -> None:
        wrong = [
            f"{name} must be finite numbers with the axes {axes} at most, got {value.shape}"
            for name, axes in AXES.items()
            if (value := np.asarray(getattr(self, name), dtype=np.float64)).ndim > len(axes)
            or not np.all(np.isfinite(value))
        ]
        if np.any(np.asarray(self.bearing_clearance) < 0.0):
            wrong.append("bearing_clearance must not be negative")
        if wrong:
            raise ValueError("; ".join(wrong))

    @property
    def units(self) -> int:
        """Number of units; 1 where no error differs between units."""
        lengths = {
            np.shape(getattr(self, name))[0] for name, axes in AXES.items() if np.ndim(getattr(self, name)) == len(axes)
        } - {1}
        if len(lengths) > 1:
            raise ValueError(f"errors have different numbers of units: {sorted(lengths)}")
        return lengths.pop() if lengths else 1

    def full(self, name: str, sizes: Mapping[str, int]) -> Array:
        """The error `name`, broadcast to the axes' lengths in `sizes`."""
        expected = tuple(sizes[axis] for axis in AXES[name])
        try:
            return np.broadcast_to(np.asarray(getattr(self, name), dtype=np.float64), expected)
        except ValueError as error:
            shape = np.shape(getattr(self, name))
            raise ValueError(f"{name} must fit {AXES[name]} = {expected}, got {shape}") from error

    def of_units(self, part: slice) -> Self:
        """The same errors of some units only."""
        chosen = {
            field.name: np.asarray(value)[part]
            for field in fields(self)
            if np.ndim(value := getattr(self, field.name)) == len(AXES[field.name]) and np.shape(value)[0] > 1
        }
        common = {field.name: getattr(self, field.name) for field in fields(self) if field.name not in chosen}
        return type(self)(**chosen, **common)


# The exact nominal profile around each pin, and the gap of a displaced pin.


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


# Gaps between pins and discs with every part error, at any crank angles.


@dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """The gaps between pins and discs of units x crank angles.

    `gap` (units, angles, discs, pins) [m] is in the normal direction with the carrier in its
    nominal position, negative where they overlap; `lever` (angles, discs, pins) [m] is how much
    of it a forward turn of the disc closes, per radian; `turn` (units, angles, discs) [rad] is how
    far each disc is turned forward by its cranks and its angular error; `play` (units, 1, discs)
    [rad] is its free turn in either sense in the crank bearings.
    """

    gap: Array
    lever: Array
    turn: Array
    play: Array


@dataclass(frozen=True, slots=True, eq=False)
class Displacements:
    """Displacements by part errors; complex numbers are points of the plane [m], or directions.

    `pins` (units, discs, pins) displaces pins in axes of the housing, `across` the same shape [m]
    is the change of the gap by radii. The rest is (units, discs): `turning` displaces the disc's
    centre in axes that turn with its eccentric, `offset` in those of the disc; `around` [rad] turns
    it by its part across the line of the cranks, `angle` [rad] forward; `play` as in `Gaps`;
    `shift` [m]; `pitch` [rad] is the turn F_p/(2 r_p) exp(i phase) of a tooth at angle u, to be
    taken at exp(i u) as a scalar product.
    """

    pins: Complex
    across: Array
    turning: Complex
    offset: Complex
    around: Complex
    angle: Array
    play: Array
    shift: Array
    pitch: Complex

    def centre(self, axes: Axes) -> Complex:
        """Displacement of the profiles' centres in axes of the housing, (units, angles, discs)."""
        return self.turning[:, None] * axes.eccentric + self.offset[:, None] * axes.disc

    def turn(self, axes: Axes) -> Array:
        """Forward turn of the discs [rad], (units, angles, discs)."""
        return np.asarray(self.angle[:, None] - np.imag(self.around[:, None] * axes.crank))


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """Directions exp(i angle), each (angles, discs).

    Of the eccentric and of the disc in the housing, and of the eccentric against the line of the
    cranks.
    """

    eccentric: Complex
    disc: Complex
    crank: Complex

    @classmethod
    def at(cls, geometry: ContactGeometry, angles: Array) -> Self:
        """The directions at crank angles [rad], (angles,)."""
        at, carrier = angles[:, None], -angles[:, None] / geometry.nominal.cycloid_teeth
        of_disc = geometry.disc_angles
        return cls(unit(at + of_disc), unit(carrier + of_disc), unit(at + of_disc - carrier))


def displacements(geometry: ContactGeometry, errors: PartErrors) -> Displacements:
    """The displacements of all units."""
    sizes = {"units": errors.units, "discs": geometry.discs, "pins": geometry.pins, "cranks": geometry.cranks}
    full = {name: errors.full(name, sizes) for name in errors.__slots__}
    circle = full["circle_offset"] * unit(full["circle_phase"])
    e, a_0 = geometry.nominal.eccentricity, geometry.nominal.centre_distance
    eccentrics = (e + full["eccentricity"]) * unit(full["crank_phase"]) - e
    cranks = unit(-2.0 * np.pi * np.arange(geometry.cranks) / geometry.cranks)
    position = full["bore_radial"] + 1j * full["bore_tangential"]
    bores = position * cranks.conj()[:, None] * unit(-geometry.disc_angles)
    return Displacements(
        pins=_pins(geometry, full) * unit(geometry.pin_angles) + circle[:, None, None],
        across=full["hole_radius"] - full["pin_radius"] + full["equidistance"][:, :, None],
        turning=eccentrics.mean(axis=1),
        offset=full["disc_offset"] * unit(full["disc_offset_phase"]) - bores.mean(axis=1),
        around=(eccentrics * cranks[:, None]).mean(axis=1) / a_0,
        angle=full["angle"] + full["bore_tangential"].mean(axis=1) / a_0,
        play=0.5 * geometry.play_factor * full["bearing_clearance"].mean(axis=1) / a_0,
        shift=full["shift"],
        pitch=0.5 * full["pitch"] / geometry.nominal.pin_circle_radius * unit(full["pitch_phase"]),
    )


def gaps(
    geometry: ContactGeometry, errors: PartErrors, angles: Array, exact: bool = False, nominal: Nominal | None = None
) -> Gaps:
    """Gaps of all units at the crank angles [rad], (angles,).

    Errors act to third order about the exact nominal profile (`Nominal.displaced`): within 1 nm of
    exact geometry where a pin's displacements add up to 20 um and its phase is 25 degrees or more;
    nearer to the bottom of a tooth space, where no torque is carried, they are coarser. With
    `exact` the nearest point of the profile is computed for every pin instead. `nominal` at these
    angles may be passed where it is already computed.
    """
    displacement, axes = displacements(geometry, errors), Axes.at(geometry, angles)
    phi, shift = geometry.phase(angles), displacement.shift[:, None, :, None]
    pins = _relative_displacement(geometry, displacement, axes, phi)
    nominal = Nominal.at(geometry, phi) if nominal is None else nominal
    gap = _exact_gap(geometry, phi, pins, shift) if exact else nominal.displaced(pins, shift)
    turn, play = displacement.turn(axes), displacement.play[:, None]
    return Gaps(gap + displacement.across[:, None], nominal.lever, turn, play)


def teeth(geometry: ContactGeometry, axes: Axes) -> Complex:
    """exp(i u) of the angle u of each pin in its disc, (angles, discs, pins)."""
    return unit(geometry.pin_angles) * axes.disc.conj()[:, :, None]


def _relative_displacement(geometry: ContactGeometry, displacement: Displacements, axes: Axes, phi: Array) -> Complex:
    """Displacement of each pin's centre against its tooth, in the pin's axes."""
    relative = displacement.pins[:, None] - displacement.centre(axes)[..., None]
    relative *= unit(-geometry.pin_angles)
    if np.any(displacement.pitch):
        turned = np.real(displacement.pitch.conj()[:, None, :, None] * teeth(geometry, axes))
        relative -= turned * (1j * nominal_pin(geometry, phi))
    return relative


def _pins(geometry: ContactGeometry, full: Mapping[str, Array]) -> Complex:
    """Displacement of the pins, each in the axes of the pin, (units, discs, pins)."""
    radius = geometry.nominal.pin_circle_radius
    placed = radius + full["circle_radius"][:, None, None] + full["radial_position"]
    return placed * unit(full["tangential_position"] / radius) - radius


def _exact_gap(geometry: ContactGeometry, phi: Array, displacement: Complex, shift: Array) -> Array:
    pin = nominal_pin(geometry, phi) + displacement
    at = curve(geometry, phi, foot(geometry, phi, pin, shift), shift)
    normal = -1j * at.first / np.abs(at.first)
    return np.asarray(np.real((pin - at.point) * normal.conj()) + geometry.dr_rp)


# Torque and rotation of meshes whose gaps are known: piecewise linear, hence solved exactly.


_ARMLESS = 1e-9
"""Lever arms [m] below this do not count: such a pin pushes through the disc's centre."""
_UNREACHABLE_ROTATION = 1e3
"""A rotation [rad] at which such a pin would come to bear."""
_NUDGE = 1e-6
"""Step [rad] out of a rotation at which nothing bears."""


@dataclass(frozen=True, slots=True, eq=False)
class Discs:
    """Torque of every disc as a piecewise linear function of its rotation against the mesh.

    `knots`, `torque` and `slope` have shape (units, angles, discs, pins): where a pin comes to bear
    or lets go, the torque there and the stiffness after it; `first` is the stiffness before all
    knots. `low` and `high` (units, angles, discs) bound the rotations without torque.
    """

    knots: Array
    torque: Array
    slope: Array
    first: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, gaps: Gaps, stiffness: Array, compliance: Array) -> Self:
        """Discs with the normal stiffness [N/m] of pins and the compliance [rad/(N m)] behind."""
        arm = np.where(np.abs(gaps.lever) > _ARMLESS, gaps.lever, 0.0)
        bare = np.where(arm == 0.0, _UNREACHABLE_ROTATION, gaps.gap / np.where(arm == 0.0, 1.0, arm))
        order = np.argsort(bare, axis=-1)
        bare = np.take_along_axis(bare, order, -1)
        arm, gap, stiff = (
            np.take_along_axis(np.broadcast_to(values, bare.shape), order, -1) for values in (arm, gaps.gap, stiffness)
        )
        slope, moment = _sums(stiff * arm**2, arm), _sums(stiff * arm * gap, arm)
        torque = slope[..., 1:] * bare - moment[..., 1:]
        behind = compliance[..., None]
        slope = slope / (1.0 + slope * behind)
        knots = bare + torque * behind
        low, high = _torque_free_bounds(knots, torque, slope, arm)
        return cls(knots, torque, slope[..., 1:], slope[..., 0], low, high)

    def at(self, rotation: Array) -> tuple[Array, Array]:
        """Torque [N m] and stiffness [N m/rad] at rotations (units, angles, discs) [rad]."""
        passed = np.sum(self.knots <= rotation[..., None], axis=-1, keepdims=True)
        knot = np.maximum(passed - 1, 0)
        start, torque, slope = (
            np.take_along_axis(values, knot, -1)[..., 0] for values in (self.knots, self.torque, self.slope)
        )
        slope = np.where(passed[..., 0] == 0, self.first, slope)
        return torque + slope * (rotation - start), slope


def _sums(values: Array, arm: Array) -> Array:
    """Sums over the pins that bear before the first knot and after each: (..., pins + 1).

    Pins with a positive arm bear after their knot, the others before it; they are summed
    separately, so that the sum is exactly zero where no pin bears.
    """
    after = np.zeros((*values.shape[:-1], values.shape[-1] + 1))
    before = after.copy()
    np.cumsum(np.where(arm > 0.0, values, 0.0), axis=-1, out=after[..., 1:])
    backward = np.cumsum(np.where(arm < 0.0, values, 0.0)[..., ::-1], axis=-1)
    before[..., :-1] = backward[..., ::-1]
    return after + before


def _torque_free_bounds(knots: Array, torque: Array, slope: Array, arm: Array) -> tuple[Array, Array]:
    """Bounds of the rotations without torque; both the same where pins of both flanks bear."""
    high = np.min(np.where(arm > 0.0, knots, np.inf), axis=-1)
    low = np.max(np.where(arm < 0.0, knots, -np.inf), axis=-1)
    last = np.sum(torque <= 0.0, axis=-1, keepdims=True) - 1
    start, value, rise = (
        np.take_along_axis(values, np.maximum(last, 0), -1)[..., 0] for values in (knots, torque, slope[..., 1:])
    )
    crossing = start - value / np.where(rise > 0.0, rise, 1.0)
    both = low > high
    return np.where(both, crossing, low), np.where(both, crossing, high)


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """The meshes of units x crank angles, ready for torques and rotations of the carrier.

    `ratio` is b'/b (`ContactGeometry.output_ratio`). `compliance` (units, angles, discs)
    [rad/(N m)] lies between each disc and the carrier, `stiffness` (units, angles, discs, pins)
    [N/m] is that of the pins along the normal; both may be broadcast from length 1.
    """

    gaps: Gaps
    discs: Discs
    ratio: float
    stiffness: Array
    compliance: Array

    @classmethod
    def of(cls, gaps: Gaps, ratio: float, stiffness: Array, compliance: Array) -> Self:
        """The mesh of `gaps`."""
        return cls(gaps, Discs.of(gaps, stiffness, compliance), ratio, stiffness, compliance)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of units and of crank angles."""
        units, angles = self.gaps.gap.shape[:2]
        return units, angles

    def disc_torque(self, rotation: Array, extra: Array | float = 0.0) -> tuple[Array, Array]:
        """Torque and stiffness of each disc (units, angles, discs) at rotations of the carrier.

        `rotation` is (units, angles) [rad], forward from nominal; `extra` turns single discs
        further, (units, angles, discs) [rad] against the mesh.
        """
        turned = rotation[..., None] * self.ratio + self.gaps.turn + extra
        beyond, play = self._beyond(turned)
        torque, stiffness = self.discs.at(turned - play)
        free = np.abs(beyond) <= self.gaps.play
        bears = ~(free & (self.gaps.play > 0.0))
        return torque * bears, stiffness * bears

    def _beyond(self, turned: Array) -> tuple[Array, Array]:
        """Turn of discs beyond their rotations without torque, and the part of it that is play."""
        beyond = turned - np.clip(turned, self.discs.low, self.discs.high)
        return beyond, np.clip(beyond, -self.gaps.play, self.gaps.play)

    def pressed(self, rotation: Array) -> tuple[Array, Array]:
        """Torque [N m] of each disc at rotations (units, angles) [rad] of the carrier, and its turn
        against the mesh [rad] after play and compliance, (units, angles, discs).
        """
        torque, _ = self.disc_torque(rotation)
        turned = rotation[..., None] * self.ratio + self.gaps.turn
        return torque, turned - self._beyond(turned)[1] - torque * self.compliance

    def torque(self, rotation: Array, extra: Array | float = 0.0) -> tuple[Array, Array]:
        """Torque [N m] on the carrier and tangent stiffness [N m/rad], (units, angles).

        The torque is the one that holds the carrier at `rotation`; `extra` as in `disc_torque`.
        """
        torque, stiffness = self.disc_torque(rotation, extra)
        return torque.sum(axis=-1) * self.ratio, stiffness.sum(axis=-1) * self.ratio**2

    def touch(self) -> tuple[Array, Array]:
        """Rotations of the carrier at first contact backward and forward, each (units, angles).

        Rigid parts: forward minus backward is the backlash, negative where they interfere.
        """
        gaps = self.gaps
        armed = np.abs(gaps.lever) > _ARMLESS
        bare = gaps.gap / np.where(armed, gaps.lever, 1.0)
        forward = np.min(np.where(armed & (gaps.lever > 0.0), bare, np.inf), axis=-1)
        backward = np.max(np.where(armed & (gaps.lever < 0.0), bare, -np.inf), axis=-1)
        high = np.min(forward + gaps.play - gaps.turn, axis=-1)
        low = np.max(backward - gaps.play - gaps.turn, axis=-1)
        return low / self.ratio, high / self.ratio

    def rotation(self, torque: Array | float, direction: int = 1) -> Array:
        """Rotation of the carrier [rad] under a torque on it [N m], (units, angles).

        Newton's method between bounds: it ends exactly, on the right piece. Without torque it is
        the first contact in `direction` (+1 forward, -1 backward), or the balance of preloaded
        flanks.
        """
        applied = np.broadcast_to(np.asarray(torque, dtype=np.float64), self.shape)
        play, turn = self.gaps.play, self.gaps.turn
        low = np.max(self.discs.low - play - turn, axis=-1) / self.ratio
        high = np.min(self.discs.high + play - turn, axis=-1) / self.ratio
        forward = (applied > 0.0) | ((applied == 0.0) & (direction > 0))
        start = np.where(low > high, 0.5 * (low + high), np.where(forward, high, low))
        free = (applied == 0.0) & (low <= high)
        return np.where(free, start, self._newton(applied, start))

    def _newton(self, applied: Array, start: Array) -> Array:
        at = start.copy()
        low, high = np.full_like(at, -_UNREACHABLE_ROTATION), np.full_like(at, _UNREACHABLE_ROTATION)
        for _ in range(200):
            torque, stiffness = self.torque(at)
            miss = torque - applied
            low, high = np.where(miss < 0.0, at, low), np.where(miss > 0.0, at, high)
            ahead = at - miss / np.where(stiffness > 0.0, stiffness, np.inf)
            ahead = np.where(stiffness > 0.0, ahead, at - np.sign(miss) * _NUDGE)
            inside = (ahead > low) & (ahead < high)
            ahead = np.where(inside, ahead, 0.5 * (low + high))
            done = np.abs(miss) <= 1e-13 * np.abs(applied) + 1e-12
            if np.all(done | (np.abs(ahead - at) <= 1e-18)):
                return at
            at = np.where(done, at, ahead)
        raise ArithmeticError("Newton's method reaches no balance of torque; the errors are too large")

    def pin_forces(self, rotation: Array) -> Array:
        """Normal forces [N] on the pins, (units, angles, discs, pins)."""
        closed = self.gaps.lever * self.pressed(rotation)[1][..., None] - self.gaps.gap
        return np.asarray(self.stiffness * np.maximum(closed, 0.0))
