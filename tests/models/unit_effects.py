"""Pose errors of the manipulator per unit of each of the document's nine kinds of errors, by first order."""

from __future__ import annotations

from typing import NamedTuple

from tolevo.models.manipulator.effects import KINDS
from tolevo.models.manipulator.geometry import Manipulator
from tolevo.models.manipulator.maps import first_order, matrix, orientation_combinations
from tolevo.section import Array


class UnitEffects(NamedTuple):
    """By name of `KINDS`, (n, 3, components): dth_r, dth_t, dth_z [rad]; dr, dt, dz [m] that come with them."""

    orientation: dict[str, Array]
    position: dict[str, Array]


def unit_effects(manipulator: Manipulator, r: Array, z: Array) -> UnitEffects:
    """The effects at poses r, z (n,) [m], at every azimuth."""
    maps, combinations = first_order(manipulator, r, z), orientation_combinations()
    groups = {}
    for kind in KINDS:
        stem, _, chain = kind.rpartition("_")
        begins = (f"{stem}_arm_{chain}_", f"{stem}_platform_{chain}_")
        groups[kind] = matrix(
            {name: one for name, one in combinations.items() if name == kind or name.startswith(begins)}
        )
    return UnitEffects(
        {kind: maps.orientation @ group for kind, group in groups.items()},
        {kind: maps.position @ group for kind, group in groups.items()},
    )
