"""The loaded contact of pins and discs: balance of torque under part errors."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from ....units import ARCMIN
from .errors import PartErrors
from .gaps import gaps
from .geometry import ContactGeometry
from .mesh import Mesh

Array = NDArray[np.float64]
BLOCK = 4096
"""Meshes (a unit at a crank angle) solved at once: 25 MiB or so of each array."""


class OverloadWarning(UserWarning):
    """A torque beyond the momentary torque of the reducer."""


@dataclass(frozen=True, slots=True, eq=False)
class Equilibrium:
    """Balance of units x crank angles under a torque on the carrier.

    `rotation` (units, angles) [rad] is that of the carrier, forward from nominal; `pin_forces`
    (units, angles, discs, pins) [N] are normal; `loaded` (units, angles, discs) counts the pins
    that bear; `residual` (units, angles) [N m] is what the forces on the pins leave of the torque.
    """

    rotation: Array
    pin_forces: Array
    loaded: NDArray[np.int64]
    residual: Array


@dataclass(frozen=True, slots=True, eq=False)
class LoadedContact:
    """Pins and discs of one design, with its stiffness.

    `normal_stiffness` [N/m] of a pin contact along its normal and `series_stiffness` [N m/rad]
    between one disc and the carrier (bearings, cranks, carrier; `inf` without) are assumptions;
    both may be arrays that fit (units, angles, discs), so that discs share unequally or stiffness
    depends on the angle. Torques [N m] of the catalogue. `exact`: see `gaps`.
    """

    geometry: ContactGeometry = ContactGeometry()
    normal_stiffness: Array | float = 2e8
    series_stiffness: Array | float = 58.5 / ARCMIN
    rated_torque: float = 412.0
    momentary_torque: float = 2058.0
    exact: bool = False

    def mesh(self, errors: PartErrors, angles: Array) -> Mesh:
        """The meshes of all units at the crank angles (angles,) [rad], gaps computed once."""
        shape = (errors.units, angles.size, self.geometry.discs)
        stiffness, series = (
            _spread(value, shape) for value in (self.normal_stiffness, self.series_stiffness)
        )
        found = gaps(self.geometry, errors, angles, self.exact)
        return Mesh.of(found, self.geometry.output_ratio, stiffness[..., None], 1.0 / series)

    def equilibrium(
        self, errors: PartErrors, angles: Array, torque: Array | float, direction: int = 1
    ) -> Equilibrium:
        """Balance under a torque on the carrier, forward positive, that fits (units, angles).

        Without torque the carrier stands at first contact in `direction` (+1, -1). Warns
        (`OverloadWarning`) of a torque beyond the momentary one, and computes it.
        """
        self._warn(torque)
        mesh = self.mesh(errors, angles)
        rotation = mesh.rotation(torque, direction)
        forces = mesh.pin_forces(rotation)
        held = np.einsum("uadp,adp->ua", forces, mesh.gaps.lever) * mesh.ratio
        return Equilibrium(rotation, forces, np.sum(forces > 0.0, axis=-1), held - torque)

    def rotation(
        self, errors: PartErrors, angles: Array, torque: Array | float, direction: int = 1
    ) -> Array:
        """The rotation of `equilibrium` alone, in blocks: memory does not grow with the units."""
        self._warn(torque)
        wanted = np.broadcast_to(torque, (errors.units, angles.size))
        found = np.empty(wanted.shape)
        for units, part in self.blocks(errors.units, angles.size):
            mesh = self._part(units, part, errors.units, angles.size).mesh(
                errors.of_units(units), angles[part]
            )
            found[units, part] = mesh.rotation(wanted[units, part], direction)
        return found

    def reaction(self, errors: PartErrors, angles: Array, rotation: Array) -> tuple[Array, Array]:
        """Torque [N m] on the carrier and tangent stiffness [N m/rad] at its rotation [rad].

        All (units, angles). To ask again at other rotations keep `mesh` and use `Mesh.torque`.
        """
        return self.mesh(errors, angles).torque(rotation)

    def blocks(self, units: int, angles: int) -> Iterator[tuple[slice, slice]]:
        """Slices of units and of angles that hold about `BLOCK` meshes each."""
        wide = min(angles, BLOCK)
        tall = max(1, BLOCK // wide)
        for unit in range(0, units, tall):
            for angle in range(0, angles, wide):
                yield slice(unit, unit + tall), slice(angle, angle + wide)

    def _part(self, units: slice, part: slice, all_units: int, all_angles: int) -> LoadedContact:
        """The contact with the stiffness of some units and angles."""
        shape = (all_units, all_angles, self.geometry.discs)
        normal, series = (
            np.broadcast_to(_spread(value, ()), shape)[units, part]
            for value in (self.normal_stiffness, self.series_stiffness)
        )
        return LoadedContact(self.geometry, normal, series, exact=self.exact)

    def _warn(self, torque: Array | float) -> None:
        most = float(np.max(np.abs(torque), initial=0.0))
        if most > self.momentary_torque:
            warnings.warn(
                f"torque {most:g} N m is beyond the momentary torque {self.momentary_torque:g} N m",
                OverloadWarning,
                stacklevel=3,
            )


def _spread(value: Array | float, shape: tuple[int, ...]) -> Array:
    """The value with three axes, checked against (units, angles, discs)."""
    array = np.asarray(value, dtype=np.float64)
    array = array.reshape((1,) * (3 - array.ndim) + array.shape)
    if shape:
        np.broadcast_shapes(array.shape, shape)
    if not np.all(array > 0.0):
        raise ValueError("a stiffness must be above 0")
    return array


def turn_angles(count: int, teeth: int = 39) -> Array:
    """Crank angles [rad] evenly over one turn of the output, (count,)."""
    return 2.0 * pi * teeth * np.arange(count) / count
