"""First-order effects of the kinds of errors whose tolerances are allocated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .geometry import Manipulator
from .inverse import CHAINS, posture
from .maps import first_order
from .sources import matrix, orientation_combinations

KINDS = tuple(
    f"{kind}_{chain}" for kind in ("rod_length", "joint_distance", "joint_line") for chain in range(1, CHAINS + 1)
)
"""The document's nine kinds of errors."""


@dataclass(frozen=True, slots=True)
class UnitEffects:
    """Pose errors per unit of each kind's components, at poses (n,).

    By name of `KINDS`: `orientation` (n, 3, components): dth_r, dth_t, dth_z [rad]; `position`
    (n, 3, components): dr, dt, dz [m] that come with them. Units: per metre of the relative rod
    length dl2_a - dl2_b and of the relative joint distance ddB - ddA (one component each), per
    radian of the joint line (four: two on the arm, two on the platform).
    """

    orientation: Mapping[str, Array]
    position: Mapping[str, Array]


def unit_effects(manipulator: Manipulator, r: Array, z: Array) -> UnitEffects:
    """The effects at poses r, z (n,) [m], at every azimuth. Raises OutOfReach."""
    maps = first_order(manipulator, r, z)
    groups = components()
    orientation = {name: maps.orientation @ group for name, group in groups.items()}
    position = {name: maps.position @ group for name, group in groups.items()}
    return UnitEffects(orientation, position)


def components() -> dict[str, Array]:
    """Directions (63, components) in the space of the sources that make up each kind."""
    combinations = orientation_combinations()
    return {
        kind: matrix({name: weights for name, weights in combinations.items() if _of(name, kind)}) for kind in KINDS
    }


def _of(name: str, kind: str) -> bool:
    stem, _, chain = kind.rpartition("_")
    return name == kind or name.startswith((f"{stem}_arm_{chain}_", f"{stem}_platform_{chain}_"))


def conditions(manipulator: Manipulator, r: Array, z: Array) -> tuple[Array, Array]:
    """Condition numbers (n,) of the position and of the orientation equations (rows w, n x w)."""
    chains = posture(manipulator, np.ravel(r), np.ravel(z))
    across = np.cross(chains.n, chains.w)
    return np.linalg.cond(chains.w), np.linalg.cond(across)
