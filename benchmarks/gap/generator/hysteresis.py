"""What hides in the torque cycles of a locked unit; added to the twist [arcmin]."""

from __future__ import annotations

import numpy as np

from benchmarks.gap.generator import mechanisms
from benchmarks.gap.generator.mechanisms import Injected, Mechanism
from benchmarks.gap.generator.tables import Array, Points


def maxwell_slip(path: Array, limits: Array) -> Array:
    """Mean force (n,) of elements of stiffness 1 that slip at `limits`, along a path (n,)."""
    force, before, found = np.zeros(len(limits)), 0.0, np.empty(len(path))
    for at, here in enumerate(path.tolist()):
        force = np.clip(force + (here - before), -limits, limits)
        before = here
        found[at] = force.mean()
    return found


def friction_hysteresis(rng: np.random.Generator, at: Points) -> Injected:
    """Friction elements along the path of the torque keep the twist behind."""
    half = rng.uniform(0.03, 0.2) * at.largest_torque
    limits = half * rng.uniform(0.92, 1.08, 4)
    c = rng.uniform(0.0005, 0.003)
    return Injected(-c * maxwell_slip(at.torque, limits))


def in_arcmin(mechanism: Mechanism) -> Mechanism:
    """The same mechanism, its reading in arcmin."""

    def scaled(rng: np.random.Generator, at: Points) -> Injected:
        found = mechanism(rng, at)
        return Injected(found.added / 60.0, found.beside)

    return scaled


LOCKED: dict[str, Mechanism] = {"friction_hysteresis": friction_hysteresis} | {
    name: in_arcmin(mechanisms.ROTATING[name])
    for name in ("torsional_compliance", "hertz_stiffening", "lost_motion", "bearing_clearance",
                 "drift", "creep")
}  # fmt: skip
