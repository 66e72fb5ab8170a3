"""The positions of a turn at which units are measured, and which pins can touch there."""

from __future__ import annotations

from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import NDArray

from ....arrays import Array, Complex, Single
from ..contact.gaps import Axes
from ..contact.geometry import ContactGeometry, lever, unit
from .profile import LEAST_LEVER, Profile


def turn_lattice(positions: int, teeth: int) -> Array:
    """Crank angles [rad] (positions,) over one output turn, halfway between multiples of a part."""
    return 2.0 * np.pi * teeth * (np.arange(positions) + 0.5) / positions


def shares_a_factor(positions: int, geometry: ContactGeometry) -> bool:
    """Whether the positions share a factor with teeth or pins, so that phases of the mesh recur."""
    nominal = geometry.nominal
    return positions > 1 and (gcd(positions, nominal.cycloid_teeth) > 1 or gcd(positions, nominal.pins) > 1)


def merit(positions: int, geometry: ContactGeometry) -> int:
    """The least h |g| of waves h z_c + g per output turn, h > 0, that are equal at all positions.

    A wave of the crank's order h and the disc's order g looks constant where positions divide
    h z_c + g, so that the turn is sampled along a few lines. 0 where z_c and positions share a
    factor, z_c at most (h = 1). The largest backlash over the turn is as accurate as the
    number of positions allows where this is at least a tenth of them, or z_c.
    """
    teeth = geometry.nominal.cycloid_teeth
    rest = [(h * teeth) % positions for h in range(1, positions)]
    return min((h * min(r, positions - r) for h, r in enumerate(rest, 1)), default=0)


def spreads_evenly(positions: int, geometry: ContactGeometry) -> bool:
    """Whether the positions cover disc and crank evenly; 79, 157 and 313 of 39 teeth do not."""
    least = min(geometry.nominal.cycloid_teeth, 0.1 * positions)
    return not shares_a_factor(positions, geometry) and merit(positions, geometry) >= least


def nearest_prime(positions: int, geometry: ContactGeometry) -> int:
    """The prime nearest to `positions` without a factor of teeth and pins that spreads evenly."""
    for step in range(positions + 50):
        for candidate in (positions + step, positions - step):
            if _prime(candidate) and spreads_evenly(candidate, geometry):
                return candidate
    raise ArithmeticError(f"no prime near {positions} positions spreads evenly over the turn")


def _prime(number: int) -> bool:
    return number > 1 and all(number % k for k in range(2, int(number**0.5) + 1))


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Positions of a turn and the contacts that can bear at each, in the order of the kernels.

    A contact is a pin of a disc at a position with a lever arm of `LEAST_LEVER` or more; `start`
    (positions, discs, 2) is the first contact of the forward (0) and backward (1) flank, `stop`
    one past the last. By contact: `pin` its pin and `disc` its disc, `phase` [rad] the magnitude of
    its phase, `side` the sign of it, `direction` exp(i theta) of the pin. `profile` is the nominal
    profile there. `directions` (positions, discs, 6) are cosine and sine of the eccentric, of the
    disc, and of the eccentric against the line of the cranks.
    """

    geometry: ContactGeometry
    angles: Array
    start: NDArray[np.int64]
    stop: NDArray[np.int64]
    pin: NDArray[np.int64]
    disc: NDArray[np.int64]
    phase: Array
    side: Array
    direction: Complex
    profile: Profile
    directions: Single

    @classmethod
    def of(cls, geometry: ContactGeometry, angles: Array) -> Lattice:
        """The lattice of crank angles [rad], (positions,)."""
        phase = np.angle(unit(geometry.phase(angles)))
        arm = lever(geometry, phase) / geometry.nominal.lever
        start, stop, discs, pins, phases = _contacts(arm, phase)
        size = np.abs(phases)
        return cls(
            geometry,
            np.asarray(angles, dtype=float),
            start,
            stop,
            pins,
            discs,
            size,
            np.sign(phases),
            unit(geometry.pin_angles)[pins],
            Profile.of(geometry, size),
            _directions(geometry, angles),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of positions and of discs."""
        return len(self.angles), self.geometry.discs


def _contacts(
    arm: Array, phase: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array]:
    """Start and stop (positions, discs, 2) and, by contact, disc, pin and phase."""
    flank = np.stack([arm >= LEAST_LEVER, arm <= -LEAST_LEVER], axis=2)
    count = flank.sum(axis=-1)
    stop = np.cumsum(count).reshape(count.shape)
    _, discs, _, pins = np.nonzero(flank)
    phases = np.broadcast_to(phase[:, :, None, :], flank.shape)[flank]
    return stop - count, stop, discs.astype(np.int64), pins.astype(np.int64), phases


def _directions(geometry: ContactGeometry, angles: Array) -> Single:
    """Cosines and sines (positions, discs, 6) of eccentric, disc, and eccentric against cranks."""
    axes = Axes.at(geometry, angles)
    parts = [part for axis in (axes.eccentric, axes.disc, axes.crank) for part in (axis.real, axis.imag)]
    return np.ascontiguousarray(np.stack(parts, axis=-1), dtype=np.float32)
