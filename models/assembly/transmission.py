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

from dataclasses import dataclass, field, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from ...section import Array
from ...units import ARCSEC, MRAD
from ..rv_reducer.contact.contact import LoadedContact
from ..rv_reducer.contact.geometry import Mesh, PartErrors
from ..rv_reducer.dynamics import Oscillator, Train, transfer
from .assemble import assemble
from .process import Process, gains, plane_process, terminal_weight

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


# Influence coefficients of the final angles on transmission error amplitude and peak mesh force.
#
# Computed once from the full model, by central differences over the period of order 40:
#
#     TE amplitude = A_0 + |c . x + m|,  c complex (order 40; no other order appears to first order)
#     peak force   = max over discs of phi_d(d_d . x) + |h_d . x|
#
# x are the twelve final angles, m is a wave of order 40 that all units have. d_d . x is the
# difference of the discs' rotations that loads disc d as much as x does on average; phi_d is the peak
# force of disc d, tabulated over that difference (it is nonlinear, because an unloaded disc no longer
# takes part); h_d is the component of order 40.


STEP = 1e-3
"""[rad] Half-step of the differences: the size of the document's tolerances."""
WIDEST = 40e-3
"""[rad] Ends of the tabulated difference of rotations."""
KNOTS = 81
SIZE = 12


@dataclass(frozen=True, slots=True, eq=False)
class Influence:
    """Influence coefficients of the final angles; see the module."""

    base_amplitude: float
    """A_0 [rad], without angular errors."""
    order_40: Array
    """Real and imaginary part of c, shape (2, 12)."""
    differences: Array
    """Knots of phi [rad], shape (k,)."""
    peak: Array
    """phi_d [N], shape (discs, k)."""
    force: Array
    """d_d, real and imaginary part of h_d per disc, shape (3 discs, 12) [-, N/rad, N/rad]."""
    wave: Array
    """Real and imaginary part of m [rad], shape (2,)."""

    def amplitude(self, states: Array) -> Array:
        """TE amplitude (...) [rad] of final angles (..., 12) [rad]."""
        return self.amplitude_of(states @ self.order_40.T)

    def amplitude_of(self, waves: Array) -> Array:
        """TE amplitude (...) [rad] of c . x, real and imaginary part (..., 2) [rad]."""
        whole = np.moveaxis(waves + self.wave, -1, 0)
        return np.asarray(self.base_amplitude + np.hypot(*whole))

    def peak_force(self, states: Array) -> Array:
        """Peak mesh force (...) [N] of final angles (..., 12) [rad]."""
        return self.peak_of(states @ self.force.T)

    def peak_of(self, loads: Array) -> Array:
        """Peak mesh force (...) [N] of the combinations `force` x, shape (..., 3 discs)."""
        by_disc = [
            np.interp(loads[..., 3 * disc], self.differences, curve)
            + np.hypot(loads[..., 3 * disc + 1], loads[..., 3 * disc + 2])
            for disc, curve in enumerate(self.peak)
        ]
        return np.asarray(np.max(by_disc, axis=0))


def influence(full: Transmission) -> Influence:
    """The influence coefficients of a full model."""
    wave, full = full.wave, replace(full, wave=0j)
    units = np.eye(SIZE).reshape(SIZE, 4, 3) * STEP
    up, down = full.turn(units), full.turn(-units)
    nominal = full.turn(np.zeros((1, 4, 3)))
    error = _harmonics((up.error - down.error) / (2.0 * STEP))[1]
    mean, first = _harmonics((up.force - down.force) / (2.0 * STEP))
    differences = np.linspace(-WIDEST, WIDEST, KNOTS)
    spread = np.zeros((KNOTS, 4, 3))
    for gear, sign in zip(GEARS, (0.5, -0.5), strict=True):
        spread[:, gear, 2] = sign * differences / full.mapping.absorption
    loaded = full.turn(spread).force
    slope = np.real(mean[3 * GEARS[0] + 2] - mean[3 * GEARS[1] + 2]) / 2.0
    slope = slope / full.mapping.absorption
    rows = np.stack([np.real(mean) / slope, np.real(first), np.imag(first)], axis=1)
    return Influence(
        base_amplitude=float(full.amplitude(nominal)[0]),
        order_40=np.stack([np.real(error), np.imag(error)]),
        differences=differences,
        peak=loaded.max(axis=1).T,
        force=np.moveaxis(rows, 0, -1).transpose(1, 0, 2).reshape(-1, SIZE),
        wave=np.array([wave.real, wave.imag]),
    )


def _harmonics(values: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Mean and complex amplitude of the first harmonic over axis 1."""
    spectrum = np.fft.fft(values, axis=1) / values.shape[1]
    return spectrum[:, 0], 2.0 * spectrum[:, 1]


# Document A's case: its parts, its table of precision weights, recomputed by the full model.


PART_ERRORS_MRAD = (-1.6, 5.3, 5.8, 3.2)
"""Printed angular errors of the four parts."""
PRECISION_WEIGHTS = (0.0, 5.0, 10.0, np.inf)
"""Printed rows; the last is the document's "ideal, error-free"."""
_MAX_PRECISION_WEIGHT = 1e9
"""Stands for the infinite weight."""


@dataclass(frozen=True, slots=True)
class Row:
    """One row of the document's table. Falls are relative to the first row, Q = 0."""

    precision_weight: float
    state_mrad: tuple[float, ...]
    norm_mrad: float
    """Norm of the final state."""
    combined_mrad: float
    """Norm of y = C x."""
    effort_mrad2: float
    """Sum of u'Ru."""
    te_amplitude_arcsec: float
    peak_mesh_force_N: float
    norm_fall_percent: float
    combined_fall_percent: float
    te_fall_percent: float
    force_fall_percent: float


def rows(
    transmission: Transmission | None = None,
    reading: str = "printed",
    insertion: str = "before",
    process: Process | None = None,
) -> tuple[Row, ...]:
    """The document's table by the full model, with the same physical parameters in every row."""
    process, full = process or plane_process(), transmission or Transmission()
    weights = np.minimum(PRECISION_WEIGHTS, _MAX_PRECISION_WEIGHT)
    outcome = assemble(
        process,
        gains(process, terminal_weight(process, weights, reading)),
        np.array(PART_ERRORS_MRAD) * MRAD,
        insertion,
    )
    turned = full.turn(about_z(outcome.state))
    sizes = np.stack(
        [
            np.linalg.norm(outcome.state, axis=1) / MRAD,
            np.linalg.norm(outcome.state @ process.observation.T, axis=1) / MRAD,
            full.amplitude(turned) / ARCSEC,
            full.peak(turned),
        ]
    )
    falls = 100.0 * (1.0 - sizes / sizes[:, :1])
    effort = outcome.effort(process) / MRAD**2
    columns = (outcome.state / MRAD, effort, sizes.T, falls.T)
    return tuple(
        Row(weight, tuple(state), norm, combined, adjusting, te, force, *fallen)
        for weight, state, adjusting, (norm, combined, te, force), fallen in zip(
            PRECISION_WEIGHTS, *(column.tolist() for column in columns), strict=True
        )
    )
