"""Steady state of torsional vibration over one output turn, by harmonic balance.

J theta'' + c theta' + tau(theta, angle) = T with angle = speed * time. Derivatives are exact for
trigonometric polynomials (FFT), the torque is sampled; so the error falls faster than any power of
the number of samples n while the torque is smooth, and as 1/n^2 where contacts make and break.
Newton's method, with the derivatives of the slope matrix by differences (`cyclic`): they are
accurate where the oscillator is soft, and the waves far above its resonance are corrected
separately.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from ....arrays import Array
from .cyclic import second_symbol, solve
from .mesh import Mesh, operating_stiffness
from .train import Train

HIGH = 4.0
"""Waves whose inertia exceeds this many stiffnesses are corrected separately."""
OVERSHOOT, HALVINGS = 1.5, 6
"""Growth of the residual at which a step is halved, and the largest number of halvings."""
SOFTENED = (16.0, 4.0, 2.0, 1.0)
"""Damping, relative, of the detour for points that Newton's method does not reach directly."""


@dataclass(frozen=True, slots=True)
class Oscillator:
    """b operating points over a mesh: inertia, damping, torque, stiffness (b,), speed (b,).

    `speed` [rad/s] is that of the output, negative for turning backwards; `stiffness` [N m/rad] the
    mean stiffness about the operating torque.
    """

    inertia: Array
    damping: Array
    torque: Array
    stiffness: Array
    speed: Array

    @classmethod
    def of(cls, mesh: Mesh, train: Train, torque: Array, speed: Array) -> Oscillator:
        """The points of a train at torques [N m] and speeds [rad/s] that broadcast to (b,)."""
        stiffness = operating_stiffness(mesh, np.atleast_1d(np.asarray(torque, dtype=float)))
        parts = (train.reduced_inertia, train.damping(stiffness), torque, stiffness, speed)
        return cls(*(np.array(p, dtype=float) for p in np.broadcast_arrays(*parts)))

    @property
    def resonance(self) -> Array:
        """Order (b,) per output turn that meets the first mode."""
        return np.asarray(np.sqrt(self.stiffness / self.inertia) / np.abs(self.speed))

    def part(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> Oscillator:
        """The chosen points."""
        return Oscillator(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def symbol(self, n: int) -> NDArray[np.complex128]:
        """-J w^2 + i c w (b, n/2 + 1) of the orders that n samples carry."""
        order = np.arange(n // 2 + 1)
        wave = self.speed[:, None] * order
        by_order = -self.inertia[:, None] * wave**2 + 1j * self.damping[:, None] * wave
        by_order[:, -1] = by_order[:, -1].real  # the alternating wave has no slope at its samples
        return np.asarray(by_order)


@dataclass(frozen=True, slots=True)
class Steady:
    """Twist (b, n) [rad], and the relative residual (b,) of the torque."""

    twist: Array
    residual: Array

    def converged(self, tolerance: float) -> NDArray[np.bool_]:
        """Points (b,) whose residual is within `tolerance`."""
        return np.asarray(self.residual <= tolerance)


def transfer(points: Oscillator, order: Array) -> NDArray[np.complex128]:
    """K/(K - J w^2 + i c w) (b, m) of orders (m,): twist over quasi-static twist, linearised."""
    wave = points.speed[:, None] * order
    inner = points.stiffness[:, None] - points.inertia[:, None] * wave**2
    return np.asarray(points.stiffness[:, None] / (inner + 1j * points.damping[:, None] * wave))


def steady_state(mesh: Mesh, points: Oscillator, tolerance: float = 1e-9, iterations: int = 40) -> Steady:
    """Steady states of all points; those not solved within `tolerance` have a larger residual."""
    static = mesh.equilibrium(points.torque)
    order = np.arange(mesh.samples // 2 + 1, dtype=float)
    linear = np.asarray(np.fft.rfft(static)) * transfer(points, order)
    state = _newton(mesh, points, np.fft.irfft(linear, mesh.samples), tolerance, iterations)
    missed = ~state.converged(tolerance)
    if not missed.any():
        return state
    twist, residual = state.twist.copy(), state.residual.copy()
    unsolved, retried = points.part(missed), Steady(static[missed], residual[missed])
    for factor in SOFTENED:
        softer = replace(unsolved, damping=factor * unsolved.damping)
        retried = _newton(mesh, softer, retried.twist, tolerance, iterations)
    twist[missed], residual[missed] = retried.twist, retried.residual
    return Steady(twist, residual)


def _newton(mesh: Mesh, points: Oscillator, twist: Array, tolerance: float, iterations: int) -> Steady:
    """Newton's method from `twist`; points that have converged stay."""
    twist = twist.copy()
    balance = _Balance(mesh, points)
    residual, slope = balance(twist)
    for _ in range(iterations):
        unsolved = balance.relative(residual) > tolerance
        if not unsolved.any():
            break
        active = balance.part(unsolved)
        stepped = active.step(twist[unsolved], residual[unsolved], slope[unsolved])
        twist[unsolved], residual[unsolved], slope[unsolved] = stepped
    return Steady(twist, balance.relative(residual))


class _Balance:
    """Residual of the equation of motion at all samples, and the steps that reduce it."""

    def __init__(self, mesh: Mesh, points: Oscillator) -> None:
        self.mesh, self.points = mesh, points
        self.symbol = points.symbol(mesh.samples)
        self.scale = np.maximum(np.abs(points.torque), 1.0)

    def __call__(self, twist: Array) -> tuple[Array, Array]:
        """Residual torque and tangent stiffness (b, n)."""
        torque, slope = self.mesh.torque(twist)
        motion = np.fft.irfft(self.symbol * np.fft.rfft(twist), twist.shape[-1])
        return motion + torque - self.points.torque[:, None], slope

    def relative(self, residual: Array) -> Array:
        """Largest residual over a turn (b,), relative to the torque (or 1 N m)."""
        return np.asarray(np.abs(residual).max(axis=-1) / self.scale)

    def part(self, chosen: NDArray[np.bool_]) -> _Balance:
        return _Balance(self.mesh, self.points.part(chosen))

    def step(self, twist: Array, residual: Array, slope: Array) -> tuple[Array, Array, Array]:
        """Twist after a step, its residual and stiffness; steps that overshoot are halved."""
        change = -self._soft(residual, slope)
        before = OVERSHOOT * self.relative(residual)
        for _ in range(HALVINGS):
            at, after, stiffness = self._iterated(twist + change)
            worse = ~(self.relative(after) <= before)
            if not worse.any():
                return at, after, stiffness
            change[worse] *= 0.5
        return self._iterated(twist + change)

    def _iterated(self, twist: Array) -> tuple[Array, Array, Array]:
        """The twist after its stiff waves are corrected, its residual and stiffness."""
        at = twist - self._stiff(self(twist)[0])
        return at, *self(at)

    def _soft(self, residual: Array, slope: Array) -> Array:
        """Newton's step, its derivatives by differences that fit at the resonance."""
        points, step = self.points, 2.0 * np.pi / residual.shape[-1]
        angle = np.minimum(points.resonance * step, np.pi)
        fitted = points.inertia * points.speed**2 * angle**2 / second_symbol(angle)
        return solve(fitted, points.damping * points.speed, slope, residual)

    def _stiff(self, residual: Array) -> Array:
        """The step of the waves that inertia carries."""
        stiffness = self.points.stiffness[:, None]
        high = np.abs(self.symbol) > HIGH * stiffness
        waves = np.where(high, np.fft.rfft(residual) / (self.symbol + stiffness), 0.0)
        return np.fft.irfft(waves, residual.shape[-1])
