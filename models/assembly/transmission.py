"""From the final angles of an assembly to transmission error and mesh forces.

The mapping is an assumption: document A prints none. With the residual angles delta
(x, y, z) of key characteristic n, an absorption a, the distance L of the disc mid-planes, the face
width b and the eccentricity e:

    crankshaft about z       phase error a delta_z of an eccentric
    crankshaft about x, y    a tilt: the eccentric is displaced by +-a (L/2) delta, about x along
                             its path (phase error a (L/2) delta_x / e), about y outwards
    gear about z             rotation a delta_z of the disc
    gear about x, y          a tilt: at the loaded edge the profile is displaced in the disc by
                             a (b/2) (delta_x, delta_y)

Crankshaft 1 acts on disc 1, crankshaft 2 on disc 2: on the eccentrics of the same crank
(`one_crank`), or on the eccentrics of two different cranks (`own_cranks`). On both eccentrics of
a crank order 40 cancels, and no figure of the document is reproduced.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi

import numpy as np

from ...arrays import Array
from ..rv_reducer.contact.contact import LoadedContact
from ..rv_reducer.contact.errors import PartErrors
from ..rv_reducer.contact.mesh import Mesh
from ..rv_reducer.dynamics.steady import Oscillator, transfer
from ..rv_reducer.dynamics.train import Train

ECCENTRICS = ("one_crank", "own_cranks")
CRANKSHAFTS, GEARS = (0, 2), (1, 3)
BLOCK = 128
"""Units computed at once."""


@dataclass(frozen=True, slots=True)
class AngleMapping:
    """The stated mapping; see the module."""

    eccentrics: str = "one_crank"
    absorption: float = 1.0
    """a: fraction of an angular error that reaches the contact; the rest is absorbed by bearing
    clearance and tilting compliance."""
    floor: float = 0.0
    """[rad] Amplitude of the transmission error that is not due to these angles."""
    disc_distance: float = 13e-3
    """L [m]."""
    face_width: float = 12e-3
    """b [m]."""

    def part_errors(self, states: Array, eccentricity: float) -> PartErrors:
        """Part errors of units with the final angles `states` (n, 4, 3) [rad]."""
        angles = self.absorption * states
        phase, radial = (np.zeros((len(angles), 2, 2)) for _ in range(2))
        for disc, (part, side) in enumerate(zip(CRANKSHAFTS, (1.0, -1.0), strict=True)):
            crank = disc if self.eccentrics == "own_cranks" else 0
            arm = side * 0.5 * self.disc_distance
            phase[:, crank, disc] = angles[:, part, 2] + arm * angles[:, part, 0] / eccentricity
            radial[:, crank, disc] = arm * angles[:, part, 1]
        gears = angles[:, GEARS]
        edge = 0.5 * self.face_width * (gears[..., 0] + 1j * gears[..., 1])
        return PartErrors(
            crank_phase=phase,
            eccentricity=radial,
            angle=gears[..., 2],
            disc_offset=np.abs(edge),
            disc_offset_phase=np.angle(edge),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Turned:
    """Units over the period of order 40: results of the contact model at each crank angle."""

    error: Array
    """Transmission error (n, angles) [rad]."""
    force: Array
    """Largest force on a pin of each disc, (n, angles, discs) [N]."""


@dataclass(frozen=True, slots=True)
class Transmission:
    """The full model: loaded contact of units with given final angles, and its vibration.

    Quasi-static contact; above speed 0 each order of its transmission error is amplified by the
    transfer function of the train over the mean mesh stiffness, and the pin forces are those at the
    rotation that results. Far below resonance this is the steady state (tested).
    """

    contact: LoadedContact = field(default_factory=LoadedContact)
    mapping: AngleMapping = AngleMapping()
    torque: float = 412.0
    """[N m] on the output, resisting its motion."""
    speed: float = 0.5 * pi
    """[rad/s] of the output (15 rpm, rated); 0 is quasi-static."""
    train: Train = Train()
    wave: complex = 0j
    """[rad] A wave of order 40 that is added to every unit: its transmission error is the real
    part of wave exp(40 j theta), theta the angle of the output."""
    angles: int = 96
    """Crank angles over one period. With perfect pins it repeats after 1/40 of an output turn;
    more than two fall on each of its 39 pin pitches."""

    def turn(self, states: Array) -> Turned:
        """Units with final angles `states` (n, 4, 3) [rad] over the period."""
        return Turned(*(np.concatenate(parts) for parts in zip(*self._blocks(states), strict=True)))

    def _blocks(self, states: Array) -> list[tuple[Array, Array]]:
        geometry = self.contact.geometry
        period = 2.0 * pi * geometry.nominal.cycloid_teeth / geometry.pins
        psi = period * np.arange(self.angles) / self.angles
        blocks = []
        for start in range(0, max(len(states), 1), BLOCK):
            part = states[start : start + BLOCK]
            errors = self.mapping.part_errors(part, geometry.nominal.eccentricity)
            mesh = self.contact.mesh(errors, psi)
            # a torque that resists the motion turns the carrier backward: twist = -rotation
            twist = self._vibrating(mesh, -mesh.rotation(-self.torque))
            shape = (len(part), self.angles)
            forces = mesh.pin_forces(-twist).max(axis=-1)
            blocks.append((np.broadcast_to(twist, shape), np.broadcast_to(forces, (*shape, forces.shape[-1]))))
        return blocks

    def _vibrating(self, mesh: Mesh, twist: Array) -> Array:
        """The twist (n, angles) [rad] at speed, from the quasi-static one."""
        if self.speed == 0.0:
            return twist
        stiffness = mesh.torque(-twist)[1].mean(axis=1)
        speed = self.contact.geometry.pins * self.speed  # the period is turned in 1/pins of a turn
        points = Oscillator(
            *np.broadcast_arrays(
                self.train.reduced_inertia, self.train.damping(stiffness), self.torque, stiffness, speed
            )
        )
        waves = np.fft.rfft(twist, axis=1)
        order = np.arange(waves.shape[1], dtype=float)
        return np.asarray(np.fft.irfft(waves * transfer(points, order), self.angles, axis=1))

    def amplitude(self, turned: Turned) -> Array:
        """Half peak to peak (n,) [rad] of the transmission error, wave and floor included."""
        count = turned.error.shape[1]
        common_wave = np.real(self.wave * np.exp(2j * pi * np.arange(count) / count))
        return np.asarray(0.5 * np.ptp(turned.error + common_wave, axis=1) + self.mapping.floor)

    def peak(self, turned: Turned) -> Array:
        """Largest force (n,) [N] on any pin."""
        return np.asarray(turned.force.max(axis=(1, 2)))


def about_z(states: Array) -> Array:
    """States (n, 4, 3) in space from plane states (n, 4)."""
    rotations = np.zeros((*states.shape, 3))
    rotations[..., 2] = states
    return rotations
