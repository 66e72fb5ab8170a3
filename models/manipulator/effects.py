"""First-order effects of the kinds of errors whose tolerances are allocated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...section import Array
from ...units import MRAD, UM
from ..measurable import Changeable
from . import maps as sources
from .geometry import CHAINS, Manipulator, angles, cross, dot, posture
from .maps import NAMES, PER_CHAIN, SCALES, SOURCES, Combination, first_order, matrix, solve_separated_maps

KINDS = tuple(
    f"{kind}_{chain}" for kind in ("rod_length", "joint_distance", "joint_line") for chain in range(1, CHAINS + 1)
)
"""The document's nine kinds of errors."""


def conditions(manipulator: Manipulator, r: Array, z: Array) -> tuple[Array, Array]:
    """Condition numbers (n,) of the position and of the orientation equations (rows w, n x w)."""
    chains = posture(manipulator, np.ravel(r), np.ravel(z))
    across = np.cross(chains.n, chains.w)
    return np.linalg.cond(chains.w), np.linalg.cond(across)


# Which combinations of the sources measured poses identify, and which they do not.


TOLERANCE = 1e-9
"""Singular value, relative to the largest, below which a direction is not identifiable."""


@dataclass(frozen=True, slots=True)
class Identifiable:
    """Directions in the space of the sources `names` (m,), from a singular value decomposition.

    `combinations` (rank, m) change the measured errors, `hidden` (m - rank, m) do not; both are
    orthonormal in the sources' units (um, mrad). `singular` (m,) in mm or mrad per unit.
    """

    names: tuple[str, ...]
    singular: Array
    combinations: Array
    hidden: Array

    @property
    def rank(self) -> int:
        """Number of identifiable combinations."""
        return len(self.combinations)


def identifiable(
    manipulator: Manipulator,
    r: Array,
    z: Array,
    phi: Array | float = 0.0,
    measured: Literal["orientation", "position", "pose"] = "pose",
    combinations: Mapping[str, Combination] | None = None,
) -> Identifiable:
    """Identifiability, to first order, of the 63 sources or of `combinations` of them from pose
    errors measured at r, z [m], phi [rad], each (n,). Raises OutOfReach.
    """
    maps = first_order(manipulator, r, z, phi)
    parts = {"orientation": [maps.orientation], "position": [maps.position]}
    stacked = np.concatenate(parts.get(measured, [maps.orientation, maps.position]), axis=1)
    rows = 1e3 * stacked.reshape(-1, len(NAMES))
    names, columns = NAMES, np.diag(SCALES)
    if combinations is not None:
        names, columns = tuple(combinations), SCALES[:, None] * matrix(combinations)
    triangle = np.linalg.qr(rows @ columns, mode="r")  # same null space, far fewer rows
    _, size, directions = np.linalg.svd(triangle)
    singular = np.zeros(len(names))
    singular[: len(size)] = size
    rank = int(np.sum(singular > TOLERANCE * singular[0]))
    return Identifiable(names, singular, directions[:rank], directions[rank:])


# Changes of the manipulator by effects, as elementary errors of each pose.


GRAVITY = 9.80665
"""[m/s^2]"""
PPM = 1e-6
TILTS = ("tilt_x_mrad", "tilt_y_mrad")
BLOCK = 4096
"""Poses whose first-order maps are held in memory at once."""


def _of_drives() -> Iterator[Changeable]:
    for i in range(1, CHAINS + 1):
        for part in ("cos", "sin"):
            meaning = f"{'cosine' if part == 'cos' else 'sine'} component, over a turn of the arm"
            yield Changeable(f"drive_{part}_{i}_mrad", "mrad", f"{meaning}, of drive {i}")
        meaning = f"compliance of drive {i} times the mass that the drive carries"
        yield Changeable(f"drive_sag_{i}", "mrad kg/Nm", meaning)


CHANGEABLE = (
    *(Changeable(source.name, source.unit, source.meaning) for source in SOURCES),
    *(Changeable(name, "mrad", f"rotation of the base about its {name[5]}") for name in TILTS),
    Changeable("growth_ppm", "ppm", "growth of all lengths, base included"),
    *_of_drives(),
    Changeable("joint_clearance_um", "um", "play of a rod's joints, on the side to which the rod is pulled"),
)


def changed_errors(
    manipulator: Manipulator, r: Array, z: Array, phi: Array, errors: Array, changes: Mapping[str, Array]
) -> Array:
    """Elementary errors [m, rad] with the changes, (63,) where there are none, else (n, 63).

    Poses r, z [m], phi [rad], (n,); changes in their units, numbers or (n,). Raises OutOfReach.
    """
    if not changes:
        return errors
    shape = (len(r),)
    by_name = {name: np.broadcast_to(change, shape) for name, change in changes.items()}
    changed = np.broadcast_to(errors, (*shape, len(NAMES))).copy()
    for source in SOURCES:
        if source.name in by_name:
            changed[:, source.at] += by_name[source.name] * source.scale
    if "growth_ppm" in by_name:
        changed += by_name["growth_ppm"][:, None] * PPM * lengths(manipulator)
    changed[:, _places(sources.DRIVE_ZERO)] += _waves(manipulator, r, z, phi, by_name)
    if "joint_clearance_um" in by_name or any(f"drive_sag_{i}" in by_name for i in (1, 2, 3)):
        for first in range(0, len(r), BLOCK):
            at = slice(first, first + BLOCK)
            part = {name: change[at] for name, change in by_name.items()}
            changed[at] += _errors_under_weight(manipulator, r[at], z[at], phi[at], part)
    return changed


def lengths(manipulator: Manipulator) -> Array:
    """The length (63,) [m] that each source is an error of; 0 for rotations.

    An error in proportion to all of them makes a machine that is similar to itself.
    """
    sizes = np.zeros((CHAINS, PER_CHAIN))
    sizes[:, sources.ORIGIN] = manipulator.origins
    sizes[:, sources.ARM_LENGTH] = manipulator.arms
    sizes[:, sources.ROD_LENGTH] = manipulator.rods[:, None]
    sizes[:, sources.JOINT_DISTANCE_ARM] = manipulator.distances
    sizes[:, sources.JOINT_DISTANCE_PLATFORM] = manipulator.distances
    sizes[:, sources.PLATFORM_ATTACHMENT] = manipulator.attachments
    return sizes.ravel()


def base_tilt(changes: Mapping[str, Array], phi: Array) -> Array:
    """Rotation vectors (n, 3) [rad] of the base in the axes (e_r, e_t, z) at phi (n,)."""
    x, y = (np.broadcast_to(changes.get(name, 0.0), phi.shape) * MRAD for name in TILTS)
    c, s = np.cos(phi), np.sin(phi)
    return np.stack([c * x + s * y, c * y - s * x, np.zeros_like(phi)], axis=-1)


def _places(within: int) -> list[int]:
    """Places in a vector of all errors of the error `within` each chain."""
    return [chain * PER_CHAIN + within for chain in range(CHAINS)]


def _waves(manipulator: Manipulator, r: Array, z: Array, phi: Array, changes: Mapping[str, Array]) -> Array:
    """Errors of the drives (n, 3) [rad] once per turn of their arms."""
    waves = np.zeros((len(r), CHAINS))
    if not any(name.startswith(("drive_cos", "drive_sin")) for name in changes):
        return waves
    arm = angles(manipulator, r, z)
    arm[:, :2] += phi[:, None]  # chain 3 moves in the plane that is turned
    for i in range(CHAINS):
        for wave in (np.cos, np.sin):
            change = changes.get(f"drive_{wave.__name__}_{i + 1}_mrad", 0.0)
            waves[:, i] += change * MRAD * wave(arm[:, i])
    return waves


def _errors_under_weight(
    manipulator: Manipulator, r: Array, z: Array, phi: Array, changes: Mapping[str, Array]
) -> Array:
    """Errors (n, 63) of drives and rods that yield to the weight.

    By virtual work the torque of a weight m g on a drive is -m g dz/dtheta, and the pull of a rod
    -m g dz/dl: both from the first-order maps of the height.
    """
    by_drive, by_rod = lifts(manipulator, r, z, phi)
    yielding = np.zeros((len(r), CHAINS, PER_CHAIN))
    play = np.broadcast_to(np.asarray(changes.get("joint_clearance_um", 0.0)) * UM, r.shape)
    yielding[..., sources.ROD_LENGTH] = -np.sign(by_rod) * play[:, None, None]
    for i in range(CHAINS):
        carried = np.asarray(changes.get(f"drive_sag_{i + 1}", 0.0)) * MRAD
        yielding[:, i, sources.DRIVE_ZERO] = -carried * GRAVITY * by_drive[:, i]
    return yielding.reshape(len(r), -1)


def lifts(manipulator: Manipulator, r: Array, z: Array, phi: Array) -> tuple[Array, Array]:
    """How far the platform rises per radian of each drive (n, 3) and per metre of each rod
    (n, 3, 2); the height's row of the first-order maps.
    """
    if manipulator.follow_up == "rod":
        lift = first_order(manipulator, r, z, phi).position[:, 2]
        lift = lift.reshape(len(r), CHAINS, PER_CHAIN)
        return lift[..., sources.DRIVE_ZERO], lift[..., sources.ROD_LENGTH]
    chains = posture(manipulator, r, z)
    turn, place, shift = solve_separated_maps(chains)
    move = place[:, 2]
    tilt = np.einsum("ni,nic->nc", shift[:, 2], turn)
    drive = move * manipulator.arms * dot(chains.w, chains.v)
    drive += tilt * dot(cross(chains.n, chains.w), chains.k)
    relative = (tilt / manipulator.distances)[..., None] * np.array([1.0, -1.0])
    return drive, 0.5 * move[..., None] + relative
