"""Dynamics of the RV drive on its loaded contact: steady orders, the full model, sweeps and tables of orders."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from math import ceil
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import Fault, raise_all
from ...section import Array
from ...units import ARCMIN
from .contact.geometry import Mesh

# The inertias that turn on both sides of the mesh.


@dataclass(frozen=True, slots=True)
class Train:
    """Two inertias about the mesh, under constant torques; floats, or one value per point (b,).

    The defaults are assumptions: with 108 N m/arcmin the reduced inertia of 3.1 kg m^2 has its
    first mode at 55 Hz, where reducers of this class have it.
    """

    input_inertia: Array | float = 8e-4
    """[kg m^2] at the input shaft: motor and sun."""
    load_inertia: Array | float = 4.216
    """[kg m^2] at the output."""
    damping_ratio: Array | float = 0.04
    """Damping of the first mode at the operating torque, in (0, 1); 0.02 to 0.06 is usual."""
    reduction_ratio: float = 121.0

    @property
    def reduced_inertia(self) -> Array:
        """J = J_1 J_2/(J_1 + J_2) [kg m^2], the input reflected to the output: J_1 = i^2 J_in."""
        reflected = self.reduction_ratio**2 * np.asarray(self.input_inertia, dtype=float)
        return np.asarray(reflected * self.load_inertia / (reflected + self.load_inertia))

    def mode(self, stiffness: Array) -> Array:
        """Angular frequency [rad/s] of the first mode over a stiffness [N m/rad]."""
        return np.asarray(np.sqrt(stiffness / self.reduced_inertia))

    def damping(self, stiffness: Array) -> Array:
        """c = 2 zeta sqrt(K J) [N m s/rad] over a stiffness [N m/rad]."""
        return np.asarray(2.0 * self.damping_ratio * np.sqrt(stiffness * self.reduced_inertia))

    def faults(self, place: str) -> list[Fault]:
        """Inputs for which no steady state exists."""
        problems = [
            Fault(f"{place}.{name}", f"must be finite and above 0 kg m^2, got {_text(value)}")
            for name, value in (("input_inertia", self.input_inertia), ("load_inertia", self.load_inertia))
            if not np.all(np.isfinite(value) & (np.asarray(value) > 0.0))
        ]
        ratio = np.asarray(self.damping_ratio)
        if not np.all((ratio > 0.0) & (ratio < 1.0)):
            text = f"must lie between 0 and 1 (0.02 to 0.06 is usual), got {_text(ratio)}"
            problems.append(Fault(f"{place}.damping_ratio", text))
        return problems


def _text(value: Array | float) -> str:
    """The value or values, for a message."""
    return f"{float(np.min(value)):g}" if np.ndim(value) == 0 else f"{np.asarray(value).tolist()}"


# Linear equations of a periodic oscillator: a u'' + d u' + k u = r over one turn, in batches.
#
# u'' and u' by five-point differences of fourth order on n equal steps. The samples are folded (0,
# n-1, 1, n-2, ...), which makes the cyclic matrix a banded one, and the points of a batch follow
# each other in one banded matrix. Cutting the cycle instead (and correcting it by a low-rank
# update) fails: an oscillator over a cut turn grows by exp(zeta omega_n t).


SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
BAND = 4
"""Half-width of the folded band."""


def second_symbol(angle: Array) -> Array:
    """-u''/u of the differences for waves of `angle` [rad] per step; exact: angle^2."""
    return np.asarray((30.0 - 32.0 * np.cos(angle) + 2.0 * np.cos(2.0 * angle)) / 12.0)


def solve(inertia: Array, damping: Array, stiffness: Array, right: Array) -> Array:
    """u (b, n) for a (b,), d (b,), k (b, n) and r (b, n); n even."""
    count, n = right.shape
    step = 2.0 * np.pi / n
    stencil = SECOND * inertia[:, None] / step**2 + FIRST * damping[:, None] / step
    folded, place = _folding(n)
    band = np.zeros((2 * BAND + 1, count, n))
    for offset in range(-2, 3):
        column = place[(np.arange(n) + offset) % n]
        band[BAND + place - column, :, column] = stencil[:, offset + 2]
    band[BAND] += stiffness[:, folded]
    flat = scipy.linalg.solve_banded(
        (BAND, BAND),
        band.reshape(2 * BAND + 1, count * n),
        right[:, folded].reshape(count * n),
        overwrite_ab=True,
        overwrite_b=True,
        check_finite=False,
    )
    return np.asarray(flat.reshape(count, n)[:, place])


def _folding(n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The samples in folded order, and the place of every sample in it."""
    folded = np.empty(n, dtype=np.int64)
    folded[0::2] = np.arange(n // 2)
    folded[1::2] = np.arange(n - 1, n // 2 - 1, -1)
    place = np.empty(n, dtype=np.int64)
    place[folded] = np.arange(n)
    return folded, place


# The interface of a mesh for torsional dynamics.


class AnyMesh(Protocol):
    """Torque of a mesh against its twist, at n equal steps of the output angle over one turn.

    The twist theta_in/i - theta_out [rad] winds up under a torque [N m] that resists + motion; the
    torque does not fall with it.
    """

    @property
    def samples(self) -> int:
        """Number n of output angles; even."""
        ...

    def torque(self, twist: Array) -> tuple[Array, Array]:
        """Torque [N m] and tangent stiffness [N m/rad] at twists (..., n) [rad]."""
        ...

    def equilibrium(self, torque: Array) -> Array:
        """Quasi-static twist (..., n) [rad] under torques (...) [N m]."""
        ...

    def peak_force(self, twist: Array) -> Array:
        """Largest contact force (...) [N] over the turn at twists (..., n) [rad]."""
        ...

    def resampled(self, samples: int) -> AnyMesh:
        """The same mesh at a multiple of its output angles."""
        ...


def operating_stiffness(mesh: AnyMesh, torque: Array) -> Array:
    """Mean tangent stiffness (...) [N m/rad] over a turn, under torques (...) [N m]."""
    return np.asarray(mesh.torque(mesh.equilibrium(torque))[1].mean(axis=-1))


# A mesh tabulated over twist and output angle, so that its torque costs one look-up.


Loads = Callable[[Array], tuple[Array, Array]]
"""Torque and tangent stiffness (m, n) at twists (m, 1)."""
Peak = Callable[[Array], Array]
"""Largest contact force (...) over the turn at twists (..., n)."""
ROOT_STEPS = 60
"""Bisections of a cell: the twist in it is then exact to the last digit."""


@dataclass(frozen=True, slots=True)
class TabulatedMesh:
    """Torque and its slope per node (m, n) at twists `scale` sinh(`nodes`), `nodes` even steps.

    Cubic between the nodes, by values and slopes; the slopes are limited as by Fritsch and Carlson
    (1980), so that the torque rises as the mesh's does. Beyond the nodes it is linear. `peak` is
    evaluated at the output angles of the mesh that was tabulated: every `stride`-th of those here.
    """

    scale: float
    nodes: Array
    torques: Array
    slopes: Array
    peak: Peak
    stride: int = 1

    @classmethod
    def of(cls, loads: Loads, peak: Peak, scale: float, reach: float, count: int) -> TabulatedMesh:
        """The table of `loads` at `count` twists up to +-`reach` [rad], densest within `scale`."""
        nodes = np.linspace(-1.0, 1.0, count) * np.arcsinh(reach / scale)
        torque, stiffness = loads(scale * np.sinh(nodes)[:, None])
        slope = stiffness * scale * np.cosh(nodes)[:, None]
        return cls(scale, nodes, torque, _limit_slopes(torque, slope, nodes[1] - nodes[0]), peak)

    @property
    def samples(self) -> int:
        """Number n of output angles."""
        return int(self.torques.shape[-1])

    def _cell(self, twist: Array) -> tuple[NDArray[np.intp], Array]:
        """Cell below each twist, and the position (0 to 1) of the twist in it."""
        node = np.clip(np.arcsinh(twist / self.scale), self.nodes[0], self.nodes[-1])
        position = (node - self.nodes[0]) / (self.nodes[1] - self.nodes[0])
        cell = np.minimum(position.astype(np.intp), len(self.nodes) - 2)
        return cell, position - cell

    def _corners(self, cell: NDArray[np.intp]) -> tuple[Array, Array, Array, Array]:
        """Torque and slope per cell at both ends of cells (..., n)."""
        at = np.arange(self.samples)
        step = self.nodes[1] - self.nodes[0]
        below, above = self.torques[cell, at], self.torques[cell + 1, at]
        return below, above, step * self.slopes[cell, at], step * self.slopes[cell + 1, at]

    def torque(self, twist: Array) -> tuple[Array, Array]:
        """Torque [N m] and tangent stiffness [N m/rad] at twists (..., n) [rad]."""
        cell, t = self._cell(twist)
        corners = self._corners(cell)
        step = self.nodes[1] - self.nodes[0]
        inside = np.clip(twist, *(self.scale * np.sinh(self.nodes[[0, -1]])))
        stiffness = _rise(corners, t) / (step * np.hypot(self.scale, inside))
        return _cubic(corners, t) + stiffness * (twist - inside), stiffness

    def equilibrium(self, torque: Array) -> Array:
        """Quasi-static twist (..., n) [rad] under torques (...) [N m] within the table's."""
        torques = np.asarray(torque, dtype=float)[..., None]
        below = np.zeros((*torques.shape[:-1], self.samples), dtype=np.intp)
        for row in self.torques[1:-1]:
            below += row <= torques
        corners = self._corners(below)
        low, high = np.zeros(below.shape), np.ones(below.shape)
        for _ in range(ROOT_STEPS):
            middle = 0.5 * (low + high)
            short = _cubic(corners, middle) < torques
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        node = self.nodes[0] + (below + high) * (self.nodes[1] - self.nodes[0])
        return np.asarray(self.scale * np.sinh(node))

    def peak_force(self, twist: Array) -> Array:
        """Largest contact force (...) [N] over the turn at twists (..., n) [rad]."""
        return self.peak(np.ascontiguousarray(twist[..., :: self.stride]))

    def resampled(self, samples: int) -> TabulatedMesh:
        """The same mesh at a multiple of its output angles, by trigonometric interpolation."""
        if samples == self.samples:
            return self
        if samples % self.samples != 0:
            raise ValueError(f"{samples} samples are no multiple of {self.samples}")
        tables = (self.torques, self.slopes)
        torque, slope = (np.asarray(scipy.signal.resample(table, samples, axis=-1)) for table in tables)
        torque = np.maximum.accumulate(torque, axis=0)
        limited = _limit_slopes(torque, slope, self.nodes[1] - self.nodes[0])
        stride = self.stride * samples // self.samples
        return TabulatedMesh(self.scale, self.nodes, torque, limited, self.peak, stride)


def _cubic(corners: tuple[Array, Array, Array, Array], t: Array) -> Array:
    """Hermite's cubic by values and slopes at the ends of a cell of length 1."""
    below, above, rise_below, rise_above = corners
    chord = above - below
    bend = (rise_below - chord) * (1.0 - t) - (rise_above - chord) * t
    return np.asarray(below + t * (chord + (1.0 - t) * bend))


def _rise(corners: tuple[Array, Array, Array, Array], t: Array) -> Array:
    """Slope of the cubic."""
    below, above, rise_below, rise_above = corners
    chord = above - below
    ends = rise_below * (1.0 - t) * (1.0 - 3.0 * t) - rise_above * t * (2.0 - 3.0 * t)
    return np.asarray(ends + 6.0 * chord * t * (1.0 - t))


def _limit_slopes(torque: Array, slope: Array, step: float) -> Array:
    """Slopes (m, n) limited to three times the adjacent chords."""
    chord = np.diff(torque, axis=0) / step
    ends = np.full((1, torque.shape[1]), np.inf)
    adjacent = np.minimum(np.concatenate([ends, chord]), np.concatenate([chord, ends]))
    return np.asarray(np.clip(slope, 0.0, 3.0 * adjacent))


# The loaded contact as a mesh for torsional dynamics.


SCALE, NODES = 0.05 * ARCMIN, 161
"""Twist [rad] within which the table is densest, and the number of its twists."""
TWISTS_AT_ONCE = 16
"""Twists whose pin forces are computed in one block, to bound the memory."""


def tabulate_mesh(mesh: Mesh, torque: float, nodes: int = NODES) -> TabulatedMesh:
    """One unit's mesh over a turn, tabulated up to torques of +-`torque` [N m] and beyond."""
    ends = [float(np.abs(mesh.rotation(side * torque)).max()) for side in (1.0, -1.0)]

    def loads(twist: Array) -> tuple[Array, Array]:
        # a torque that resists + motion turns the carrier backward: twist = -rotation
        mesh_torque, stiffness = mesh.torque(-np.broadcast_to(twist, (len(twist), mesh.shape[1])))
        return -mesh_torque, stiffness

    def peak(twist: Array) -> Array:
        flat = twist.reshape(-1, mesh.shape[1])
        parts = np.array_split(flat, max(1, len(flat) // TWISTS_AT_ONCE))
        peaks = [mesh.pin_forces(-part).max(axis=(1, 2, 3)) for part in parts]
        return np.concatenate(peaks).reshape(twist.shape[:-1])

    return TabulatedMesh.of(loads, peak, SCALE, 1.1 * max(ends), nodes)


# A mesh whose input is displaced over the turn: sun runout, an eccentric input shaft.


@dataclass(frozen=True, slots=True)
class DisplacedMesh:
    """`mesh` with a displacement excitation (n,) [rad] that the twist has before any torque."""

    mesh: AnyMesh
    displacement: Array

    @property
    def samples(self) -> int:
        """Number n of output angles."""
        return self.mesh.samples

    def torque(self, twist: Array) -> tuple[Array, Array]:
        """Torque [N m] and tangent stiffness [N m/rad] at twists (..., n) [rad]."""
        return self.mesh.torque(twist - self.displacement)

    def equilibrium(self, torque: Array) -> Array:
        """Quasi-static twist (..., n) [rad] under torques (...) [N m]."""
        return self.mesh.equilibrium(torque) + self.displacement

    def peak_force(self, twist: Array) -> Array:
        """Largest contact force (...) [N] over the turn at twists (..., n) [rad]."""
        return self.mesh.peak_force(twist - self.displacement)

    def resampled(self, samples: int) -> DisplacedMesh:
        """The same mesh at a multiple of its output angles."""
        finer = np.asarray(scipy.signal.resample(self.displacement, samples))
        return DisplacedMesh(self.mesh.resampled(samples), finer)


# Spectrum by order of a signal over whole output turns.


ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Orders (m,) per output turn and complex amplitudes (..., m), in the unit of the signal.

    A component of order k is Re(amplitude exp(i k angle)); order 0 is the mean.
    """

    order: Array
    amplitude: ComplexArray

    def at(self, order: float) -> ComplexArray:
        """Amplitudes (...) of an order on the grid. Raises ValueError where it is not on it."""
        places = np.flatnonzero(np.isclose(self.order, order, rtol=0.0, atol=1e-9))
        if len(places) == 0:
            raise ValueError(f"order {order:g} is not on the grid of {self.order[1]:g}")
        return np.asarray(self.amplitude[..., places[0]])


def spectrum(signal: Array, turns: int = 1, grid: float | None = None) -> Spectrum:
    """Spectrum of signals (..., n) at n equal steps of the output angle over whole `turns`.

    Without a window, so every order k/turns is exact. A `grid` finer than 1/turns (0.25 shows
    non-integer orders) continues the signal by zeros: exact at k/turns, leaking in between.
    Raises ValueError where no whole multiple of `turns` has this grid.
    """
    n = signal.shape[-1]
    repeats = 1 if grid is None else ceil(1.0 / (grid * turns) - 1e-9)
    if grid is not None and abs(repeats * turns * grid - round(repeats * turns * grid)) > 1e-9:
        raise ValueError(f"a grid of {grid:g} orders does not fit {turns} turns")
    bins = np.fft.rfft(signal, n * repeats) / n
    weight = np.full(bins.shape[-1], 2.0)
    weight[0] = 1.0
    if n * repeats % 2 == 0:
        weight[-1] = 1.0
    return Spectrum(np.arange(bins.shape[-1]) / (turns * repeats), weight * bins)


def mean_square(lines: Spectrum) -> Array:
    """Mean square (...) of the signal, an even number of samples without a finer grid (Parseval).

    The last order is that of alternating samples: it counts fully, as the mean does.
    """
    power = np.abs(lines.amplitude) ** 2
    return np.asarray(power[..., 0] + 0.5 * power[..., 1:-1].sum(axis=-1) + power[..., -1])


# Steady state of torsional vibration over one output turn, by harmonic balance.
#
# J theta'' + c theta' + tau(theta, angle) = T with angle = speed * time. Derivatives are exact for
# trigonometric polynomials (FFT), the torque is sampled; so the error falls faster than any power of
# the number of samples n while the torque is smooth, and as 1/n^2 where contacts make and break.
# Newton's method, with the derivatives of the slope matrix by differences (`cyclic`): they are
# accurate where the oscillator is soft, and the waves far above its resonance are corrected
# separately.


INERTIA_DOMINANCE_RATIO = 4.0
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
    def of(cls, mesh: AnyMesh, train: Train, torque: Array, speed: Array) -> Oscillator:
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


def steady_state(mesh: AnyMesh, points: Oscillator, tolerance: float = 1e-9, iterations: int = 40) -> Steady:
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


def _newton(mesh: AnyMesh, points: Oscillator, twist: Array, tolerance: float, iterations: int) -> Steady:
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

    def __init__(self, mesh: AnyMesh, points: Oscillator) -> None:
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
        high = np.abs(self.symbol) > INERTIA_DOMINANCE_RATIO * stiffness
        waves = np.where(high, np.fft.rfft(residual) / (self.symbol + stiffness), 0.0)
        return np.fft.irfft(waves, residual.shape[-1])


# Dynamic transmission error and peak mesh force against speed, torque and load inertia.


POINTS_PER_WAVE = 16
"""Samples over a wave at the resonance that the differences in Newton's step need."""
ELEMENTS = 2_000_000
"""Samples of all points together in one block, to bound the memory."""


@dataclass(frozen=True, slots=True)
class Response:
    """Dynamic TE amplitude (half peak to peak) [rad], peak mesh force [N], residual, each (b,).

    `residual` is that of the torque, relative; points above the tolerance are no steady states, and
    their amplitude and force are NaN.
    """

    amplitude: Array
    peak_force: Array
    residual: Array


def sweep(
    mesh: AnyMesh, train: Train, torque: Array | float, speed: Array | float, tolerance: float = 1e-8
) -> Response:
    """Steady states at torques [N m] and output speeds [rad/s] that broadcast with the train's.

    Raises InputError for speeds and torques that are not finite or a speed that is not positive.
    """
    raise_all(faults(train, torque, speed))
    points = Oscillator.of(mesh, train, np.asarray(torque), np.asarray(speed))
    response = Response(*(np.full(len(points.speed), np.nan) for _ in range(3)))
    for fine, chosen in blocks_with_resolved_mesh(mesh, points):
        state = steady_state(fine, points.part(chosen), tolerance)
        reached, force = state.converged(tolerance), fine.peak_force(state.twist)
        response.residual[chosen] = state.residual
        response.amplitude[chosen] = np.where(reached, 0.5 * np.ptp(state.twist, axis=-1), np.nan)
        response.peak_force[chosen] = np.where(reached, force, np.nan)
    return response


def blocks_with_resolved_mesh(mesh: AnyMesh, points: Oscillator) -> Iterator[tuple[AnyMesh, NDArray[np.intp]]]:
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


# Dynamic twist at any measurements: a steady state for each of their operating points.


class NoSteadyState(UserWarning):
    """Operating points at which Newton's method reaches no periodic vibration."""


class FullDynamics:
    """Steady states of a train over a mesh, at the operating points of measurements."""

    def __init__(self, mesh: AnyMesh, train: Train, tolerance: float = 1e-7) -> None:
        self.mesh, self.train, self.tolerance = mesh, train, tolerance

    def twist(self, angle: Array, torque: Array, speed: Array) -> Array:
        """Twist (n,) [rad] at output angles [rad], torques [N m] and signed speeds [rad/s].

        NaN, and a `NoSteadyState` warning, where Newton's method reaches no steady state.
        """
        twists = np.empty(len(angle))
        pairs, row = np.unique(np.stack([torque, speed]), axis=1, return_inverse=True)
        points = Oscillator.of(self.mesh, self.train, pairs[0], pairs[1])
        for fine, chosen in blocks_with_resolved_mesh(self.mesh, points):
            lines = self._orders(fine, points.part(chosen))
            rows = np.flatnonzero(np.isin(row, chosen))
            twists[rows] = _sum_spectra(lines, np.searchsorted(chosen, row[rows]), angle[rows])
        self._warn(twists, pairs[:, row])
        return twists

    def _orders(self, mesh: AnyMesh, points: Oscillator) -> NDArray[np.complex128]:
        """Complex amplitudes (b, m) of the twist by whole orders; NaN without a steady state."""
        state = steady_state(mesh, points, self.tolerance)
        lines = np.fft.rfft(state.twist)[:, : self.mesh.samples // 2] * (2.0 / mesh.samples)
        lines[:, 0] *= 0.5
        lines[~state.converged(self.tolerance)] = np.nan
        return np.asarray(lines)

    def _warn(self, twist: Array, pairs: Array) -> None:
        if (missing := np.isnan(twist)).any():
            worst = pairs[:, np.argmax(missing)]
            rpm = worst[1] * 60.0 / (2.0 * np.pi)
            point = f"at {worst[0]:g} N m and {rpm:g} rpm"
            text = f"no steady vibration was computed {point}; measurements without a value: {missing.sum()}"
            warnings.warn(text, NoSteadyState, stacklevel=3)


def _sum_spectra(lines: NDArray[np.complex128], place: NDArray[np.intp], angle: Array) -> Array:
    """Twist (n,) of spectra (b, m), at the spectrum and the angle of each row."""
    order = np.arange(lines.shape[1])
    twist = np.empty(len(angle))
    for rows in np.array_split(np.arange(len(angle)), -(-len(angle) * len(order) // ELEMENTS)):
        waves = np.exp(1j * order * angle[rows, None])
        twist[rows] = np.einsum("nm,nm->n", lines[place[rows]], waves).real
    return twist


# Quasi-static twist of a unit, by order of the output angle, tabulated over torque.


SOFT = 2.0
"""[N m] Nodes are even in asinh(T/SOFT): dense where the mesh is soft."""
ORDER_NODES = 24
TOUCH = 1e-6
"""[N m] in place of no torque, where the stiffness is that of the first pins that bear."""
NEGLIGIBLE_AMPLITUDE = 0.1 * ARCMIN / 60.0
"""[rad] The smallest orders are omitted, to this rms of their sum at any torque: 0.1 arcsec."""
ORDER_ELEMENTS = 1_000_000
"""Rows times orders in one block."""


@dataclass(frozen=True, slots=True)
class OrderTable:
    """Complex amplitudes (2, g, m) [rad] of orders (m,) at g torques of either sign.

    Index 0 holds torques that resist + motion (twist > 0), index 1 the others; `nodes` (g,) are
    asinh(|T|/SOFT), `slopes` the derivatives by them, `stiffness` (2, g) [N m/rad] its mean.
    Cubic between the nodes, straight in the torque beyond the last.
    """

    order: Array
    nodes: Array
    values: ComplexArray
    slopes: ComplexArray
    stiffness: Array

    @classmethod
    def of(cls, mesh: Mesh, most: float, left_out: float = NEGLIGIBLE_AMPLITUDE) -> OrderTable:
        """The table of a mesh over one turn, up to torques of +-`most` [N m]."""
        nodes = np.linspace(0.0, np.arcsinh(most / SOFT), ORDER_NODES)
        torques = np.maximum(SOFT * np.sinh(nodes), TOUCH)
        twist, stiffness = np.empty((2, 2, ORDER_NODES, mesh.shape[1]))
        for side, sign in enumerate((1.0, -1.0)):
            for at, torque in enumerate(torques):
                rotation = mesh.rotation(-sign * torque)
                twist[side, at] = -rotation[0]
                stiffness[side, at] = mesh.torque(rotation)[1][0]
        stretch = np.array([1.0, -1.0])[:, None, None] * SOFT * np.cosh(nodes)[:, None]
        lines = spectrum(twist)
        slopes = spectrum(stretch / stiffness).amplitude
        return cls(lines.order, nodes, lines.amplitude, slopes, stiffness.mean(-1)).largest_orders(left_out)

    def largest_orders(self, left_out: float) -> OrderTable:
        """The mean and the largest orders; the rms of the others is `left_out` at most."""
        power = 0.5 * np.abs(self.values) ** 2
        power[..., 0] = np.inf
        upward = np.argsort(power.max(axis=(0, 1)))
        total = np.cumsum(power[..., upward], axis=-1).max(axis=(0, 1))
        large = np.sort(upward[np.sqrt(total) > left_out])
        return replace(self, order=self.order[large], values=self.values[..., large], slopes=self.slopes[..., large])

    def mean_only(self) -> OrderTable:
        """Order 0 alone."""
        return replace(self, order=self.order[:1], values=self.values[..., :1], slopes=self.slopes[..., :1])

    def difference(self, other: OrderTable, step: float, left_out: float) -> OrderTable:
        """(self - other)/step of tables of all orders; `left_out` as in `largest_orders`."""
        table = replace(self, values=self.values - other.values, slopes=self.slopes - other.slopes)
        table = table.largest_orders(left_out)
        return replace(table, values=table.values / step, slopes=table.slopes / step)

    def plus(self, excitation: dict[float, complex]) -> OrderTable:
        """With displacements [rad] by order that do not depend on the torque."""
        order = np.concatenate([self.order, np.array(list(excitation), dtype=float)])
        extra = np.array(list(excitation.values()), dtype=complex)
        more = np.broadcast_to(extra, (*self.values.shape[:2], len(extra)))
        values = np.concatenate([self.values, more], axis=-1)
        slopes = np.concatenate([self.slopes, np.zeros_like(more)], axis=-1)
        return replace(self, order=order, values=values, slopes=slopes)

    def mean_stiffness(self, torque: Array, side: NDArray[np.intp]) -> Array:
        """Mean tangent stiffness (n,) [N m/rad] at torques (n,)."""
        node = np.arcsinh(np.abs(torque) / SOFT)
        both = [np.interp(node, self.nodes, values) for values in self.stiffness]
        return np.asarray(np.where(side == 0, both[0], both[1]))

    def amplitudes(self, torque: Array, side: NDArray[np.intp]) -> ComplexArray:
        """Amplitudes (n, m) [rad] at torques (n,) [N m] on the side (n,) 0 or 1."""
        step = self.nodes[1] - self.nodes[0]
        node = np.minimum(np.arcsinh(np.abs(torque) / SOFT), self.nodes[-1])
        cell = np.minimum((node / step).astype(np.intp), len(self.nodes) - 2)
        t = (node / step - cell)[:, None]
        below, above = self.values[side, cell], self.values[side, cell + 1]
        rise, fall = step * self.slopes[side, cell], step * self.slopes[side, cell + 1]
        chord = above - below
        inside = below + t * (chord + (1 - t) * ((rise - chord) * (1 - t) - (fall - chord) * t))
        beyond = np.abs(torque) - SOFT * np.sinh(node)
        last = self.slopes[side, -1] / (SOFT * np.cosh(self.nodes[-1]))
        return np.asarray(inside + np.maximum(beyond, 0.0)[:, None] * last)

    def twist(self, angle: Array, torque: Array, side: NDArray[np.intp], factor: ComplexArray | None) -> Array:
        """Twist (n,) [rad] at output angles (n,) [rad]; `factor` (n, m) multiplies the orders."""
        twists = np.empty(len(angle))
        blocks = max(1, -(-len(angle) * len(self.order) // ORDER_ELEMENTS))
        for rows in np.array_split(np.arange(len(angle)), blocks):
            lines = self.amplitudes(torque[rows], side[rows])
            if factor is not None:
                lines = lines * factor[rows]
            waves = np.exp(1j * self.order * angle[rows, None])
            twists[rows] = np.einsum("nm,nm->n", lines, waves).real
        return twists
