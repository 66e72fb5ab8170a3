"""The loaded contact of pins and discs: balance of torque under part errors."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ....arrays import Array
from ....errors import raise_all
from ....units import ARCMIN
from .errors import PartErrors
from .faults import faults
from .gaps import gaps
from .geometry import ContactGeometry
from .mesh import Mesh
from .nominal import Nominal

Engine = Literal["auto", "arrays", "numba"]
BLOCK = 512
"""Meshes (a unit at a crank angle) solved at once by arrays, so that they stay in the cache."""


class OverloadWarning(UserWarning):
    """A torque beyond the momentary torque of the reducer."""


@dataclass(frozen=True, slots=True, eq=False)
class Equilibrium:
    """Balance of units x crank angles under a torque on the carrier.

    `rotation` (units, angles) [rad] is that of the carrier, forward from nominal; `pin_forces`
    (units, angles, discs, pins) [N] are normal; `loaded` (units, angles, discs) counts the pins
    that bear; `residual` (units, angles) [N m] is the pins' torque minus the applied torque.
    """

    rotation: Array
    pin_forces: Array
    loaded: NDArray[np.int64]
    residual: Array


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """The meshes of some units at some angles, and their place among all (units, angles)."""

    place: tuple[slice, slice]
    mesh: Mesh


@dataclass(frozen=True, slots=True, eq=False)
class LoadedContact:
    """Pins and discs of one design, with its stiffness.

    `normal_stiffness` [N/m] of a pin contact along its normal and `series_stiffness` [N m/rad]
    between one disc and the carrier (bearings, cranks, carrier; `inf` without) are assumptions;
    both may be arrays that fit (units, angles, discs), so that discs share unequally or stiffness
    depends on the angle. Torques [N m] of the catalogue. `exact`: see `gaps`. `engine`: numba where
    it is installed ("auto"), "arrays" or "numba"; only `rotation` uses it. Raises InputError where
    the profile interferes or is undercut (`faults`).
    """

    geometry: ContactGeometry = ContactGeometry()
    normal_stiffness: Array | float = 2e8
    series_stiffness: Array | float = 58.5 / ARCMIN
    rated_torque: float = 412.0
    momentary_torque: float = 2058.0
    exact: bool = False
    engine: Engine = "auto"

    def __post_init__(self) -> None:
        raise_all(faults(self.geometry))
        for name in ("normal_stiffness", "series_stiffness"):
            if not np.all(np.asarray(getattr(self, name)) > 0.0):
                raise ValueError(f"{name} must be above 0")

    def mesh(self, errors: PartErrors, angles: Array, nominal: Nominal | None = None) -> Mesh:
        """The meshes of all units at the crank angles (angles,) [rad], gaps computed once."""
        gaps_of_units = gaps(self.geometry, errors, angles, self.exact, nominal)
        normal, series = self._stiffness()
        return Mesh.of(gaps_of_units, self.geometry.output_ratio, normal[..., None], 1.0 / series)

    def equilibrium(self, errors: PartErrors, angles: Array, torque: Array | float, direction: int = 1) -> Equilibrium:
        """Balance under a torque on the carrier, forward positive, that fits (units, angles).

        Without torque the carrier is at first contact in `direction` (+1, -1). Warns
        (`OverloadWarning`) of a torque beyond the momentary one, and computes it.
        """
        warn_of_overload(torque, self.momentary_torque)
        mesh = self.mesh(errors, angles)
        rotation = mesh.rotation(torque, direction)
        forces = mesh.pin_forces(rotation)
        mesh_torque = np.einsum("uadp,adp->ua", forces, mesh.gaps.lever) * mesh.ratio
        return Equilibrium(rotation, forces, np.sum(forces > 0.0, axis=-1), mesh_torque - torque)

    def rotation(self, errors: PartErrors, angles: Array, torque: Array | float, direction: int = 1) -> Array:
        """The rotation of `equilibrium` alone; its memory does not grow with the contacts."""
        warn_of_overload(torque, self.momentary_torque)
        torques = np.broadcast_to(torque, (errors.units, angles.size))
        if not self.exact and uses_numba(self.engine):
            kernel = import_module(".compiled", __package__)
            turns: Array = kernel.rotation(self.geometry, errors, angles, *self._stiffness(), torques, direction)
            return turns
        rotations = np.empty(torques.shape)
        for block in self.blocks(errors, angles):
            rotations[block.place] = block.mesh.rotation(torques[block.place], direction)
        return rotations

    def reaction(self, errors: PartErrors, angles: Array, rotation: Array) -> tuple[Array, Array]:
        """Torque [N m] on the carrier and tangent stiffness [N m/rad] at its rotation [rad].

        All (units, angles). For further rotations keep `mesh` and use `Mesh.torque`.
        """
        return self.mesh(errors, angles).torque(rotation)

    def blocks(self, errors: PartErrors, angles: Array) -> Iterator[Block]:
        """The meshes in blocks of some units at some angles."""
        wide = min(angles.size, BLOCK)
        tall = max(1, BLOCK // wide)
        for start in range(0, angles.size, wide):
            part = slice(start, start + wide)
            nominal = Nominal.at(self.geometry, self.geometry.phase(angles[part]))
            for first in range(0, errors.units, tall):
                units = slice(first, first + tall)
                contact = self._of(units, part)
                yield Block((units, part), contact.mesh(errors.of_units(units), angles[part], nominal))

    def _stiffness(self) -> tuple[Array, Array]:
        """Normal and series stiffness with the axes (units, angles, discs)."""
        return _three_axes(self.normal_stiffness), _three_axes(self.series_stiffness)

    def _of(self, units: slice, angles: slice) -> LoadedContact:
        """The contact with the stiffness of some units and angles."""
        normal, series = (
            stiffness[units if len(stiffness) > 1 else slice(None), angles if stiffness.shape[1] > 1 else slice(None)]
            for stiffness in self._stiffness()
        )
        return replace(self, normal_stiffness=normal, series_stiffness=series)


def _three_axes(value: Array | float) -> Array:
    return np.asarray(value, dtype=np.float64).reshape((1,) * (3 - np.ndim(value)) + np.shape(value))


def uses_numba(engine: Engine) -> bool:
    """Whether the compiled kernels are used."""
    return engine == "numba" or (engine == "auto" and find_spec("numba") is not None)


def warn_of_overload(torque: Array | float, momentary: float) -> None:
    """Warn (`OverloadWarning`) of torques [N m] beyond the momentary one; they are computed."""
    most = float(np.max(np.abs(torque), initial=0.0))
    if most > momentary:
        text = f"torque {most:g} N m is beyond the momentary torque {momentary:g} N m"
        warnings.warn(text, OverloadWarning, stacklevel=3)


def turn_angles(count: int, teeth: int = 39) -> Array:
    """Crank angles [rad] evenly over one turn of the output, (count,)."""
    return 2.0 * np.pi * teeth * np.arange(count) / count
