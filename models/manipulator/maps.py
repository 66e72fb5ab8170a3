"""The 63 elementary errors by name, 21 per chain, and the combinations that separate them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ...errors import Fault, nearest, raise_all
from ...section import Array
from ...units import MRAD, UM
from .geometry import CHAINS, Manipulator, Posture, cross, dot, posture

PER_CHAIN = 21


@dataclass(frozen=True, slots=True)
class Source:
    """An elementary error: `at` is its place in a vector of all 63, `chain` is 1, 2 or 3."""

    name: str
    unit: str
    meaning: str
    chain: int
    at: int

    @property
    def scale(self) -> float:
        """Metres or radians in one `unit`."""
        return UM if self.unit == "um" else MRAD


ROWS: tuple[tuple[str, str, str], ...] = (
    ("origin_{i}_x", "um", "origin of the arm along the base's x"),
    ("origin_{i}_y", "um", "origin of the arm along the base's y"),
    ("origin_{i}_z", "um", "origin of the arm along the base's z"),
    ("arm_length_{i}", "um", "length of the arm"),
    ("arm_orientation_{i}_u", "mrad", "rotation of the arm frame about the arm"),
    ("arm_orientation_{i}_v", "mrad", "rotation of the arm frame about v = k x u"),
    ("arm_orientation_{i}_k", "mrad", "rotation of the arm frame about its drive axis"),
    ("drive_zero_{i}", "mrad", "zero of the drive"),
    ("joint_line_arm_{i}_u", "mrad", "rotation about the arm of the joint line on it"),
    ("joint_line_arm_{i}_v", "mrad", "rotation about v of the joint line on the arm"),
    ("joint_line_arm_{i}_k", "mrad", "rotation about the drive axis of the joint line on the arm"),
    ("joint_distance_arm_{i}", "um", "distance of the two joints on the arm"),
    ("rod_length_{i}a", "um", "length of the rod on the positive side of the joint line"),
    ("rod_length_{i}b", "um", "length of the rod on the negative side of the joint line"),
    ("platform_attachment_{i}_r", "um", "attachment to the platform, radially (width)"),
    ("platform_attachment_{i}_t", "um", "attachment to the platform, tangentially (length)"),
    ("platform_attachment_{i}_z", "um", "attachment to the platform, upwards (height)"),
    ("joint_line_platform_{i}_r", "mrad", "rotation about e_r of the joint line on the platform"),
    ("joint_line_platform_{i}_t", "mrad", "rotation about e_t of the joint line on the platform"),
    ("joint_line_platform_{i}_z", "mrad", "rotation about z of the joint line on the platform"),
    ("joint_distance_platform_{i}", "um", "distance of the two joints on the platform"),
)
"""Name, unit and meaning of the 21 errors of chain i, in the order of a vector of them."""

ORIGIN, ARM_LENGTH = slice(0, 3), 3
ARM_ORIENTATION, DRIVE_ZERO = slice(4, 7), 7
JOINT_LINE_ARM, JOINT_DISTANCE_ARM = slice(8, 11), 11
ROD_LENGTH, PLATFORM_ATTACHMENT = slice(12, 14), slice(14, 17)
JOINT_LINE_PLATFORM, JOINT_DISTANCE_PLATFORM = slice(17, 20), 20


def _sources() -> Iterator[Source]:
    for chain in (1, 2, 3):
        for at, (name, unit, meaning) in enumerate(ROWS):
            place = (chain - 1) * PER_CHAIN + at
            yield Source(f"{name.format(i=chain)}_{unit}", unit, meaning, chain, place)


SOURCES = tuple(_sources())
NAMES = tuple(source.name for source in SOURCES)
SCALES: Array = np.array([source.scale for source in SOURCES])
"""Metres or radians in one unit of each source, (63,)."""


def error_vector(errors: Mapping[str, float], place: str = "elementary_errors") -> Array:
    """All 63 errors (63,) [m, rad] from those by name in their units; the others are 0.

    Raises InputError with the nearest name where one is unknown, or a value is not finite.
    """
    by_name = {source.name: source for source in SOURCES}
    faults = [
        Fault(f"{place}.{name}", f"is not an elementary error{nearest(name, NAMES)}")
        for name in errors
        if name not in by_name
    ] + [
        Fault(f"{place}.{name}", f"must be finite, got {value}")
        for name, value in errors.items()
        if not np.isfinite(value)
    ]
    raise_all(faults)
    vector = np.zeros(len(SOURCES))
    for name, value in errors.items():
        vector[by_name[name].at] = value * by_name[name].scale
    return vector


Combination = Mapping[str, float]
"""A direction in the space of the sources: the value of each, per unit of the combination."""


def orientation_combinations() -> dict[str, Combination]:
    """The 18 that turn the platform, 6 per chain, each per unit of itself.

    The relative rod length dl2_a - dl2_b (half on each rod, their mean stays), the relative joint
    distance ddB - ddA (put on the platform), and the joint line's rotations across itself: u and v
    on the arm (those of the arm frame act alike), two of r, t, z on the platform.
    """
    combinations: dict[str, Combination] = {}
    for i, across in ((1, "rt"), (2, "rt"), (3, "rz")):
        combinations[f"rod_length_{i}"] = {f"rod_length_{i}a_um": 0.5, f"rod_length_{i}b_um": -0.5}
        combinations[f"joint_distance_{i}"] = {f"joint_distance_platform_{i}_um": 1.0}
        for axis in "uv":
            combinations[f"joint_line_arm_{i}_{axis}"] = {f"joint_line_arm_{i}_{axis}_mrad": 1.0}
        for axis in across:
            combinations[f"joint_line_platform_{i}_{axis}"] = {f"joint_line_platform_{i}_{axis}_mrad": 1.0}
    return combinations


def position_sources() -> tuple[str, ...]:
    """The 36 that move the platform, 12 per chain.

    Origin 3, arm length 1, arm orientation 3 (the drive's zero acts as its third), rod lengths 2,
    platform attachment 3. Of these the arm's rotation about itself has no effect at nominal
    dimensions; sources that move chain 3 out of its plane act in model M2 alone, by the follow-up
    rod.
    """
    stems = ("origin_", "arm_length_", "arm_orientation_", "rod_length_", "platform_attachment_")
    return tuple(name for name in NAMES if name.startswith(stems))


def matrix(combinations: Mapping[str, Combination]) -> Array:
    """Columns (63, m) of combinations, per SI unit of the combination."""
    at = {name: place for place, name in enumerate(NAMES)}
    columns = np.zeros((len(NAMES), len(combinations)))
    for column, weights in enumerate(combinations.values()):
        for name, weight in weights.items():
            columns[at[name], column] = weight
    return columns


# First-order maps of the elementary errors to the pose, orientation and position apart.
#
# With w along a rod, n along a joint line, d the joint distance and p the attachment, the difference
# of the two closures of a parallelogram gives the orientation,
#
#     (n x w).dth = (dl2_a - dl2_b)/d - (ddB - ddA)/d (w.n) + (n x w).(dT + dA - dB),
#
# and half their sum the position,
#
#     w.dP + (p x w).dth = (dl2_a + dl2_b)/2 - w.dp + w.dO
#                          + (l1 u x w).dT + (w.u) dl1 + l1 (w.v) dth0.
#
# In model M2 the follow-up plane also turns by dpsi: dth_z grows by it, and it solves
# (B3 - A3).e_t = 0.


@dataclass(frozen=True, slots=True)
class Maps:
    """Pose errors per metre or radian of each source, at poses (n,).

    `orientation` (n, 3, 63): dth_r, dth_t, dth_z; `position` (n, 3, 63): dr, dt, dz; `follow_up`
    (n, 63): dpsi, zero in model M1. Axes (e_r, e_t, z) of each pose, sources as in `SOURCES`.
    """

    orientation: Array
    position: Array
    follow_up: Array


def first_order(manipulator: Manipulator, r: Array, z: Array, phi: Array | float = 0.0) -> Maps:
    """The maps of all 63 sources at poses r, z [m], phi [rad], each (n,) or a number.

    The azimuth matters only to the sources fixed in the base (origins). Raises OutOfReach.
    """
    r, z, phi = (np.asarray(coordinate, dtype=float).ravel() for coordinate in (r, z, phi))
    r, z = np.broadcast_arrays(r, z)
    chains = posture(manipulator, r, z)
    turn, place, shift = solve_separated_maps(chains)
    by_turn = turn[..., None] * differences(manipulator, chains)[:, None]  # (n, 3, chain, 21)
    by_place = place[..., None] * half_sums(manipulator, chains, phi)[:, None]
    orientation = by_turn.reshape(len(r), 3, -1)
    position = by_place.reshape(len(r), 3, -1)
    position += shift @ orientation
    if manipulator.follow_up == "fixed":
        return Maps(orientation, position, np.zeros((len(r), orientation.shape[-1])))
    gap = _gap_along_e_t(manipulator, chains, phi)
    plane = position[:, 1] - manipulator.half_width * orientation[:, 2] - gap
    plane /= (r - shift[:, 1, 2])[:, None]
    orientation[:, 2] += plane
    position += shift[:, :, 2, None] * plane[:, None]
    return Maps(orientation, position, plane)


def solve_separated_maps(chains: Posture) -> tuple[Array, Array, Array]:
    """Matrices (n, 3, 3) of the separated equations, solved.

    They map the differences of the closures to the orientation, their half sums to the position,
    and the orientation to the position.
    """
    across, lever = cross(chains.n, chains.w), cross(chains.p, chains.w)
    turn = np.linalg.inv(across).astype(np.float64, copy=False)
    place = np.linalg.inv(chains.w).astype(np.float64, copy=False)
    return turn, place, -place @ lever


def differences(manipulator: Manipulator, chains: Posture) -> Array:
    """Right-hand sides (n, 3 chains, 21) of the orientation equations."""
    n, w, d = chains.n, chains.w, manipulator.distances
    across = cross(n, w)
    on_arm = np.stack([dot(across, axis) for axis in (chains.u, chains.v, chains.k)], axis=-1)
    slant = dot(w, n) / d
    columns = np.zeros((*slant.shape, PER_CHAIN))
    columns[..., ARM_ORIENTATION] = on_arm
    columns[..., DRIVE_ZERO] = on_arm[..., 2]
    columns[..., JOINT_LINE_ARM] = on_arm
    columns[..., JOINT_DISTANCE_ARM] = slant
    columns[..., ROD_LENGTH] = np.array([1.0, -1.0]) / d[:, None]
    columns[..., JOINT_LINE_PLATFORM] = -across
    columns[..., JOINT_DISTANCE_PLATFORM] = -slant
    return columns


def half_sums(manipulator: Manipulator, chains: Posture, phi: Array) -> Array:
    """Right-hand sides (n, 3 chains, 21) of the position equations."""
    w, arm = chains.w, manipulator.arms
    c, s = np.cos(phi)[:, None], np.sin(phi)[:, None]
    along_v = arm * dot(w, chains.v)
    columns = np.zeros((*along_v.shape, PER_CHAIN))
    x, y = c * w[..., 0] - s * w[..., 1], s * w[..., 0] + c * w[..., 1]
    columns[..., ORIGIN] = np.stack([x, y, w[..., 2]], axis=-1)
    columns[..., ARM_LENGTH] = dot(w, chains.u)
    lever = [np.zeros_like(along_v), -arm * dot(w, chains.k), along_v]  # l1 u x w on u, v, k
    columns[..., ARM_ORIENTATION] = np.stack(lever, axis=-1)
    columns[..., DRIVE_ZERO] = along_v
    columns[..., ROD_LENGTH] = 0.5
    columns[..., PLATFORM_ATTACHMENT] = -w
    return columns


def _gap_along_e_t(manipulator: Manipulator, chains: Posture, phi: Array) -> Array:
    """Displacement (n, 63) of A3 - B3 along e_t by the sources themselves."""
    columns = np.zeros((len(chains.w), CHAINS, PER_CHAIN))
    last = columns[:, 2]
    last[:, ORIGIN.start] = -np.sin(phi)
    last[:, ORIGIN.start + 1] = np.cos(phi)
    e_t = -chains.k[:, 2]
    arm = manipulator.arm_length[2]
    turned = np.stack([cross(axis[:, 2], chains.u[:, 2]) for axis in (chains.u, chains.v, chains.k)], axis=1)
    last[:, ARM_ORIENTATION] = arm * np.einsum("nia,na->ni", turned, e_t)
    last[:, PLATFORM_ATTACHMENT.start + 1] = -1.0
    return columns.reshape(len(columns), -1)
