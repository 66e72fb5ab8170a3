"""Dynamic transmission error and peak mesh force against speed, torque and load inertia."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....arrays import Array
from ....errors import Fault, raise_all
from .mesh import Mesh
from .spectrum import spectrum
from .steady import Oscillator, steady_state
from .train import Train

POINTS_PER_WAVE = 16
"""Samples over a wave at the resonance that the differences in Newton's step need."""
ELEMENTS = 2_000_000
"""Samples of all points together in one block, to bound the memory."""
EXCITED = 0.02
"""An order is excited where its static amplitude is this fraction of the largest (without 0)."""


@dataclass(frozen=True, slots=True)
class Response:
    """Dynamic TE amplitude (half peak to peak) [rad], peak mesh force [N], residual, each (b,).

    `residual` is that of the torque, relative; points above the tolerance are no steady states, and
    their amplitude and force are NaN.
    """

    amplitude: Array
    peak_force: Array
    residual: Array


def sweep(mesh: Mesh, train: Train, torque: Array | float, speed: Array | float, tolerance: float = 1e-8) -> Response:
    """Steady states at torques [N m] and output speeds [rad/s] that broadcast with the train's.

    Raises InputError for speeds and torques that are not finite or a speed that is not positive.
    """
    raise_all(faults(train, torque, speed))
    points = Oscillator.of(mesh, train, np.asarray(torque), np.asarray(speed))
    response = Response(*(np.full(len(points.speed), np.nan) for _ in range(3)))
    for fine, chosen in resolved(mesh, points):
        state = steady_state(fine, points.part(chosen), tolerance)
        reached, force = state.converged(tolerance), fine.peak_force(state.twist)
        response.residual[chosen] = state.residual
        response.amplitude[chosen] = np.where(reached, 0.5 * np.ptp(state.twist, axis=-1), np.nan)
        response.peak_force[chosen] = np.where(reached, force, np.nan)
    return response


def resolved(mesh: Mesh, points: Oscillator) -> Iterator[tuple[Mesh, NDArray[np.intp]]]:
    """Blocks of points, by their numbers, with the mesh at samples that resolve their resonance."""
    needed = samples_needed(mesh.samples, points)
    for n in np.unique(needed):
        fine = mesh.resampled(int(n))
        at = np.flatnonzero(needed == n)
        for part in np.array_split(at, -(-len(at) * int(n) // ELEMENTS)):
            yield fine, part


def faults(train: Train, torque: Array | float, speed: Array | float) -> list[Fault]:
    """Inputs for which no sweep exists."""
    problems = train.faults("train")
    if not np.all(np.isfinite(torque)):
        problems.append(Fault("torque", "must be finite, in N m"))
    if not np.all(np.isfinite(speed) & (np.asarray(speed) > 0.0)):
        problems.append(Fault("speed", "must be finite and above 0 rad/s; it has no sense of turning"))
    return problems


def samples_needed(samples: int, points: Oscillator) -> NDArray[np.int64]:
    """Samples (b,) that resolve the resonance, where it is among the orders of the mesh."""
    needed = POINTS_PER_WAVE * points.resonance
    doublings = np.ceil(np.log2(np.maximum(needed / samples, 1.0))).astype(np.int64)
    return np.asarray(np.where(points.resonance > 0.51 * samples, samples, samples << doublings))


def warnings(mesh: Mesh, train: Train, torque: float, speed: Array, momentary: float = 2058.0) -> tuple[str, ...]:
    """Warnings for a sweep over `speed` [rad/s] at one torque [N m]."""
    messages = []
    if abs(torque) > momentary:
        messages.append(f"torque {torque:g} N m is beyond the momentary {momentary:g} N m")
    speeds = np.unique(speed)
    points = Oscillator.of(mesh, train, np.asarray(torque), speeds)
    line = spectrum(mesh.equilibrium(np.asarray(torque))).amplitude[1:]
    excited = 1 + np.flatnonzero(np.abs(line) >= EXCITED * np.abs(line).max(initial=0.0))
    unresolved = sorted({int(k) for k in excited if np.abs(line[k - 1]) > 0.0 and _skipped(points, train, float(k))})
    if unresolved:
        orders = ", ".join(str(k) for k in unresolved[:5]) + (", ..." if len(unresolved) > 5 else "")
        width = float(np.max(2.0 * np.asarray(train.damping_ratio)))
        messages.append(
            f"the speeds do not resolve the resonance with order {orders}: near it their"
            f" steps must be below {100.0 * width:g} % (half-power width)"
        )
    return tuple(messages)


def _skipped(points: Oscillator, train: Train, order: float) -> bool:
    """Whether the step over the resonance with `order` is wider than its half-power width."""
    resonant_speed = points.speed * points.resonance / order
    beyond = np.searchsorted(points.speed, resonant_speed.mean())
    if beyond in (0, len(points.speed)):
        return False
    width = float(np.max(2.0 * np.asarray(train.damping_ratio)) * resonant_speed.mean())
    return bool(points.speed[beyond] - points.speed[beyond - 1] > width)
