"""The rotation under torque of many units by the compiled kernel: what it is given, and back.

Its formulas are those of `Nominal.displaced` and `Mesh.rotation`. Importing this needs numba.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .gaps import Displacements, teeth
from .geometry import ContactGeometry, lever, nominal_pin, unit
from .kernel import rotations
from .nominal import Nominal

Array = NDArray[np.float64]


def rotation(
    geometry: ContactGeometry,
    moved: Displacements,
    angles: Array,
    normal: Array,
    series: Array,
    torque: Array,
    direction: int,
) -> Array:
    """Rotation of the carrier [rad], (units, angles), as `Mesh.rotation` has it.

    `normal` [N/m] and `series` [N m/rad] stiffness fit (units, angles, discs), `torque` [N m] is
    (units, angles).
    """
    units, count = torque.shape
    shape = (units, count, geometry.discs)
    found = np.empty((units, count))
    rotations(
        _table(geometry, angles),
        _last(np.stack([moved.pins.real, moved.pins.imag, moved.across])),
        _last(np.stack([moved.centre.real, moved.centre.imag, moved.turn])),
        _last(np.stack([moved.shift, moved.pitch.real, moved.pitch.imag, moved.play[:, 0]])),
        np.broadcast_to(normal, shape),
        np.broadcast_to(1.0 / series, shape),
        torque / geometry.output_ratio,
        direction,
        found,
    )
    return found / geometry.output_ratio


def _last(stacked: Array) -> Array:
    """(kinds, units, ...) as (kinds, ..., units): units side by side in memory."""
    return np.ascontiguousarray(np.moveaxis(stacked, 1, -1))


def _table(geometry: ContactGeometry, angles: Array) -> Array:
    """What the nominal profile says of each pin, (angles, discs, pins, 13), in housing's axes."""
    phi = geometry.phase(angles)
    nominal = Nominal.at(geometry, phi)
    normal = nominal.normal * unit(geometry.pin_angles)
    turned, tooth = np.multiply(-1j, nominal_pin(geometry, phi)), teeth(geometry, angles)
    along, across = (np.real(turned * one.conj()) for one in (nominal.normal, nominal.tangent))
    columns = [
        lever(geometry, phi),
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
