"""The rotation under torque of many units by the compiled kernel: its inputs and its output.

Its formulas are those of `Nominal.displaced` and `Mesh.rotation`. Importing this needs numba.
"""

from __future__ import annotations

import numpy as np

from ....section import Array, Complex
from .geometry import Axes, ContactGeometry, Displacements, Nominal, PartErrors, displacements, nominal_pin, teeth, unit
from .kernel import rotations


def rotation(
    geometry: ContactGeometry,
    errors: PartErrors,
    angles: Array,
    normal: Array,
    series: Array,
    torque: Array,
    direction: int,
) -> Array:
    """Rotation of the carrier [rad], (units, angles), as `Mesh.rotation` computes it.

    `normal` [N/m] and `series` [N m/rad] stiffness fit (units, angles, discs), `torque` [N m] fits
    (units, angles).
    """
    displacement, axes = displacements(geometry, errors), Axes.at(geometry, angles)
    shape = (errors.units, angles.size, geometry.discs)
    turns = np.empty((angles.size, errors.units))
    rotations(
        _table(geometry, angles, axes),
        _parts(axes.eccentric, axes.disc, axes.crank),
        _pins(displacement),
        _discs(displacement),
        np.broadcast_to(normal, shape),
        np.broadcast_to(1.0 / series, shape),
        np.broadcast_to(torque / geometry.output_ratio, shape[:2]),
        direction,
        turns,
    )
    return turns.T / geometry.output_ratio


def _parts(*values: Complex) -> Array:
    """Real and imaginary parts, one after the other."""
    return np.stack([part for vector in values for part in (vector.real, vector.imag)])


def _pins(displacement: Displacements) -> Array:
    """Displacements (x, y) of pins and change of the gap, (3, discs, pins, units)."""
    of_pins = (displacement.pins.real, displacement.pins.imag, displacement.across)
    return np.stack([np.moveaxis(column, 0, -1) for column in of_pins])


def _discs(displacement: Displacements) -> Array:
    """Displacements, turns, play, shift and pitch of discs, (11, discs, units)."""
    directions = _parts(displacement.turning.T, displacement.offset.T, displacement.around.T)
    by_disc = (
        displacement.angle,
        displacement.play,
        displacement.shift,
        displacement.pitch.real,
        displacement.pitch.imag,
    )
    return np.concatenate([directions, np.stack([column.T for column in by_disc])])


def _table(geometry: ContactGeometry, angles: Array, axes: Axes) -> Array:
    """The nominal profile at each pin, (angles, discs, pins, 13), in the housing's axes."""
    phi = geometry.phase(angles)
    nominal = Nominal.at(geometry, phi)
    normal = nominal.normal * unit(geometry.pin_angles)
    turned, tooth = np.multiply(-1j, nominal_pin(geometry, phi)), teeth(geometry, axes)
    along, across = (np.real(turned * direction.conj()) for direction in (nominal.normal, nominal.tangent))
    columns = [
        nominal.lever,
        nominal.gap,
        normal.real,
        normal.imag,
        nominal.bend,
        nominal.cubic,
        nominal.mixed,
        np.real(nominal.radial * nominal.normal.conj()),
        np.real(nominal.radial * nominal.tangent.conj()),
        along * tooth.real,
        along * tooth.imag,
        across * tooth.real,
        across * tooth.imag,
    ]
    return np.stack(columns, axis=-1)
