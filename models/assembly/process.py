"""The assembly process x(k+1) = A x(k) + B u(k) + F w(k), y = C x + v, as checked arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import Fault, raise_all
from ...section import Array

# Datum flow chain: the part that each part hangs on, and the matrices that follow from it.


@dataclass(frozen=True, slots=True)
class AdjustmentWeights:
    """The rule behind the printed table: the weight of a part depends on what it carries."""

    free: float = 5.0
    """Weight of a part that carries nothing yet."""
    loaded: float = 10.0
    """Weight of a part that already carries another part."""
    absent: float = 1000.0
    """Weight of a part that is not installed yet: it cannot be adjusted."""


@dataclass(frozen=True, slots=True)
class DatumFlowChain:
    """Parts in their order of assembly; each hangs on an earlier part or on the housing.

    `hangs_on[j]` is the number (from 1) of the part that part j + 1 hangs on, 0 for the housing
    (KC0). The defaults are document A's two chains: crankshaft and cycloidal gear, twice.
    """

    hangs_on: tuple[int, ...] = (0, 1, 0, 3)
    parts: tuple[str, ...] = ("crankshaft_1", "gear_1", "crankshaft_2", "gear_2")

    def __post_init__(self) -> None:
        raise_all(self._faults())

    def _faults(self) -> list[Fault]:
        if len(self.parts) != len(self.hangs_on) or not self.parts:
            text = f"must have an entry for each of the {len(self.parts)} parts, got {len(self.hangs_on)}"
            return [Fault("chain.hangs_on", text)]
        return [
            Fault(
                f"chain.hangs_on[{at}]",
                f"{self.parts[at]} must hang on the housing (0) or on "
                f"a part installed before it (1 .. {at}), got {parent}",
            )
            for at, parent in enumerate(self.hangs_on)
            if not 0 <= parent <= at
        ]

    @property
    def steps(self) -> int:
        """Number of steps N; every step installs one part."""
        return len(self.parts)

    def error_matrix(self) -> Array:
        """F = B, shape (N, N): a part moves itself and all parts that hang on it."""
        errors = np.eye(self.steps)
        for at, parent in enumerate(self.hangs_on):
            if parent:
                errors[at] += errors[parent - 1]
        return errors

    def depth(self) -> NDArray[np.int64]:
        """Place (N,) of each part in its chain, from 0 at the housing."""
        return np.asarray(self.error_matrix().sum(axis=1).round() - 1, dtype=np.int64)

    def root(self) -> NDArray[np.int64]:
        """Index (N,) of the first part of the chain that each part belongs to."""
        return np.asarray(np.argmax(self.error_matrix() > 0.0, axis=1), dtype=np.int64)

    def observation(self) -> Array:
        """C, shape (q, N): the combined error of the parts at equal place in their chains."""
        depth = self.depth()
        return np.asarray(depth == np.arange(depth.max() + 1)[:, None], dtype=float)

    def adjustable(self) -> NDArray[np.bool_]:
        """T, shape (N, N): the parts that are installed up to step k."""
        return np.tri(self.steps, dtype=bool)

    def weights(self, rule: AdjustmentWeights | None = None) -> Array:
        """R, shape (N, N): weight of adjusting each part at each step."""
        rule = rule or AdjustmentWeights()
        matrix = np.full((self.steps, self.steps), rule.absent)
        for step in range(self.steps):
            carrying = {parent - 1 for parent in self.hangs_on[: step + 1]}
            matrix[step, : step + 1] = [rule.loaded if part in carrying else rule.free for part in range(step + 1)]
        return matrix

    def coupling(self) -> Array:
        """Shape (N, N): 1 where a part of a later chain has its counterpart in an earlier chain.

        Row: the part that is moved; column: the part whose installation moves it.
        """
        depth, root = self.depth(), self.root()
        like = depth[:, None] == depth[None, :]
        return np.asarray(like & (root[:, None] < root[None, :]), dtype=float)


TURN = 3
"""Components of a small rotation: about x, y and z."""


@dataclass(frozen=True, slots=True, eq=False)
class Process:
    """N steps of an assembly with n states, m adjustments and p part errors.

    Reference: document A, state-space model. Every array is per step (first axis) but C.
    """

    transition: Array
    """A, shape (N, n, n)."""
    control: Array
    """B, shape (N, n, m)."""
    error: Array
    """F, shape (N, n, p)."""
    arriving: NDArray[np.bool_]
    """Shape (N, p): the part errors that are added at each step."""
    weight: Array
    """R, shape (N, m, m), symmetric and positive definite."""
    observation: Array
    """C, shape (q, n)."""
    coupling: Array
    """Shape (n, n): the other state that an installation moves, per unit of coupling."""

    def __post_init__(self) -> None:
        raise_all(_shapes(self) or _definite(self.weight))

    @property
    def steps(self) -> int:
        """N."""
        return len(self.transition)

    @property
    def present(self) -> NDArray[np.bool_]:
        """Shape (N, p): the part errors that are present after each step."""
        return np.logical_or.accumulate(self.arriving, axis=0)

    def weighted(self, weights: Array, absent: float = 1000.0) -> Process:
        """The same process with other weights of adjustment (N, m) on the diagonal of R.

        A weight below `absent` makes an adjustment possible. Raises InputError where a weight
        is not above zero, or adjusts a part that is not installed yet.
        """
        if weights.shape != self.arriving.shape:
            text = f"must have shape {self.arriving.shape}, got {weights.shape}"
            raise_all([Fault("adjustment_weights", text)])
        raise_all(_weights(self, weights, absent))
        return replace(self, weight=weights[:, :, None] * np.eye(weights.shape[1]))


def _weights(process: Process, weights: Array, absent: float) -> list[Fault]:
    """Each weight (N, m) that is not positive, or that lets an absent part be adjusted."""
    positive = np.isfinite(weights) & (weights > 0.0)
    faults = [
        Fault(
            f"adjustment_weights_{step + 1}[{part}]",
            f"must be above 0 (R must be positive definite), got {weights[step, part]:g}",
        )
        for step, part in np.argwhere(~positive).tolist()
    ]
    early = positive & (weights < absent) & ~process.present
    arrival = process.arriving.argmax(axis=0) + 1
    return faults + [
        Fault(
            f"adjustment_weights_{step + 1}[{part}]",
            f"step {step + 1} adjusts part {part + 1}, "
            f"which is installed at step {arrival[part]}; until then give it the weight "
            f"{absent:g} of an absent part",
        )
        for step, part in np.argwhere(early).tolist()
    ]


def plane_process(
    chain: DatumFlowChain | None = None,
    weights: Array | None = None,
    absent: float = 1000.0,
    transition: Array | None = None,
    error: Array | None = None,
) -> Process:
    """Document A's process about one axis: one angle per key characteristic.

    `weights` (N, N) replaces those that follow from the chain; `absent` is the least weight of a
    part that cannot be adjusted. `transition` (N, N, N) is A(k) (default: the identity at every
    step), `error` (N, N) is F (default: B, from the chain). Raises InputError.
    """
    chain = chain or DatumFlowChain()
    count, flow = chain.steps, chain.error_matrix()
    base = Process(
        transition=np.broadcast_to(np.eye(count), (count, count, count)) if transition is None else transition,
        control=np.broadcast_to(flow, (count, count, count)),
        error=np.broadcast_to(flow if error is None else error, (count, count, count)),
        arriving=np.eye(count, dtype=bool),
        weight=chain.weights()[:, :, None] * np.eye(count),
        observation=chain.observation(),
        coupling=chain.coupling(),
    )
    return base if weights is None else base.weighted(weights, absent)


def space_process(plane: Process | None = None, frames: Array | None = None) -> Process:
    """The process in space: the angles about x, y and z of every key characteristic.

    `frames` (N, 3, 3) turn the part's own axes into those of the housing (default: parallel); a
    small rotation is a vector, so that a part moves all parts that hang on it by the same vector.
    `plane` (default: document A's) is the process about each of the three axes.
    """
    plane = plane or plane_process()
    count = plane.steps
    axes = np.broadcast_to(np.eye(TURN), (count, TURN, TURN)) if frames is None else frames
    raise_all(_rotations(axes, count))

    def turned(matrix: Array) -> Array:
        return np.asarray(np.einsum("ksp,pab->ksapb", matrix, axes).reshape(count, TURN * count, TURN * count))

    def thrice(matrix: Array) -> Array:
        return np.asarray(np.kron(matrix, np.eye(TURN)), dtype=float)

    return Process(
        transition=thrice(plane.transition),
        control=turned(plane.control),
        error=turned(plane.error),
        arriving=np.repeat(plane.arriving, TURN, axis=1),
        weight=thrice(plane.weight),
        observation=thrice(plane.observation),
        coupling=thrice(plane.coupling),
    )


def _rotations(frames: Array, count: int) -> list[Fault]:
    if np.shape(frames) != (count, TURN, TURN):
        text = f"must have shape {(count, TURN, TURN)}, got {np.shape(frames)}"
        return [Fault("frames", text)]
    product = frames @ np.swapaxes(frames, 1, 2)
    sound = np.all(np.abs(product - np.eye(TURN)) < 1e-9, axis=(1, 2)) & (np.linalg.det(frames) > 0)
    return [
        Fault(f"frames[{at}]", "must be a rotation (orthogonal, determinant 1)")
        for at in np.flatnonzero(~sound).tolist()
    ]


def _shapes(process: Process) -> list[Fault]:
    """Every array whose shape does not fit the others, or that is not finite."""
    steps, states = process.transition.shape[0], process.transition.shape[-1]
    moves, parts = process.control.shape[-1], process.error.shape[-1]
    expected = {
        "transition (A)": (process.transition, (steps, states, states)),
        "control (B)": (process.control, (steps, states, moves)),
        "error (F)": (process.error, (steps, states, parts)),
        "arriving": (process.arriving, (steps, parts)),
        "weight (R)": (process.weight, (steps, moves, moves)),
        "observation (C)": (process.observation, (process.observation.shape[0], states)),
        "coupling": (process.coupling, (states, states)),
    }
    faults = [
        Fault(f"process.{name}", f"must have shape {shape}, got {array.shape}")
        for name, (array, shape) in expected.items()
        if array.shape != shape
    ]
    return faults + [
        Fault(f"process.{name}", "must be finite")
        for name, (array, _) in expected.items()
        if not np.all(np.isfinite(array))
    ]


def _definite(weight: Array) -> list[Fault]:
    """Each step at which R is not symmetric or not positive definite."""
    mirrored = np.swapaxes(weight, 1, 2)
    skew = ~np.all(np.isclose(weight, mirrored, rtol=1e-12, atol=0.0), axis=(1, 2))
    least = np.linalg.eigvalsh(0.5 * (weight + mirrored))[:, 0]
    return [
        Fault(
            f"process.weight (R)[{step}]",
            "must be symmetric and positive definite, got "
            + ("an asymmetric matrix" if skew[step] else f"least eigenvalue {least[step]:.4g}"),
        )
        for step in np.flatnonzero(skew | ~(least > 0.0)).tolist()
    ]


# Optimal adjustment: the gains of the linear-quadratic regulator (document A).


READINGS = ("printed", "consistent")
INSERTIONS = ("before", "after")


def terminal_weight(
    process: Process, precision: float | Array, reading: str = "printed", diagonal: Array | None = None
) -> Array:
    """P(N), shape (..., n, n), of precision weights Q.

    `printed`: P(N) = Q I weights the state. `consistent`: P(N) = C'QC weights y = C x, as the
    document's cost does. A number or an array (...) of numbers stands for Q I, or for Q times a
    `diagonal`, a weight of at least 0 for every error; a square matrix is Q itself. Raises
    InputError where Q is below zero or does not fit.
    """
    observation = process.observation if reading == "consistent" else np.eye(process.transition.shape[-1])
    weight = np.asarray(precision, dtype=float)
    if weight.ndim == 2:
        raise_all(_matrix_faults(weight, len(observation)))
        return np.asarray(observation.T @ weight @ observation)
    wrong = weight[~(np.isfinite(weight) & (weight >= 0.0))]
    faults = [Fault("precision_weight", f"must be finite and at least 0, got {value:g}") for value in wrong[:1]]
    if reading not in READINGS:
        faults.append(Fault("reading", f"must be one of {', '.join(READINGS)}, got {reading}"))
    raise_all(faults)
    weighed = observation if diagonal is None else diagonal[:, None] * observation
    return np.asarray(weight[..., None, None] * (observation.T @ weighed))


def _matrix_faults(weight: Array, size: int) -> list[Fault]:
    if weight.shape != (size, size):
        return [Fault("precision_weight (Q)", f"must have shape {(size, size)}, got {weight.shape}")]
    symmetric = np.allclose(weight, weight.T, rtol=1e-12, atol=0.0)
    if not symmetric or np.linalg.eigvalsh(weight)[0] < -1e-12 * np.abs(weight).max():
        return [Fault("precision_weight (Q)", "must be symmetric without negative eigenvalues")]
    return []


def gains(process: Process, terminal: Array, running: Array | None = None) -> Array:
    """K(k), shape (..., N, m, n), of u(k) = -K(k) x(k); `terminal` is P(N), shape (..., n, n).

    K(k) = (R + B'PB)^-1 B'PA with P = P(k+1), backwards from P(N). P(k) is that printed, in the
    form Q(k) + (A - BK)'P(A - BK) + K'RK, which stays symmetric and positive for any weight.
    `running` is Q(k), shape (n, n), of a cost on the state at every step; the document has none.
    """
    every_step = np.zeros(terminal.shape[-2:]) if running is None else running
    gains_by_step, ahead = [], terminal
    for step in reversed(range(process.steps)):
        a, b, r = process.transition[step], process.control[step], process.weight[step]
        through_input = b.T @ ahead
        gain = np.linalg.solve(r + through_input @ b, through_input @ a)
        closed = a - b @ gain
        turned = np.swapaxes(gain, -1, -2)
        ahead = every_step + np.swapaxes(closed, -1, -2) @ ahead @ closed + turned @ r @ gain
        gains_by_step.append(gain)
    return np.stack(gains_by_step[::-1], axis=-3)


# Kalman estimate of the state under measurement noise.


@dataclass(frozen=True, slots=True, eq=False)
class Estimator:
    """Measurements at each step, and how far the estimate follows them.

    A measurement is y(k) = `measured`(k) x(k) + v(k); the estimate moves by `gain`(k) times the
    difference between measured and expected y.
    """

    measured: Array
    """Shape (N, q, n)."""
    gain: Array
    """Shape (N, n, q)."""


def kalman(
    process: Process,
    part_std: Array,
    noise_std: float | Array,
    insertion: str = "before",
    measured: Array | None = None,
) -> Estimator:
    """The estimator of least variance, from x(0) = 0 known.

    Part errors have mean 0 and standard deviations `part_std` (p,), measurements `noise_std` (a
    number or (q,)). `measured` (q, n) is the observation matrix (default: every state; C for the
    document's combined errors); parts not installed yet are not measured. Raises InputError.
    """
    observation = np.eye(process.transition.shape[-1]) if measured is None else measured
    noise = np.broadcast_to(np.asarray(noise_std, dtype=float) ** 2, len(observation))
    raise_all(_faults(process, part_std, noise, observation))
    observed = observation * _installed_states(process, insertion)[:, None, :]
    covariance = np.zeros((observation.shape[1], observation.shape[1]))
    gains = []
    for step in range(process.steps):
        f, a = process.error[step], process.transition[step]
        added = (f * np.where(process.arriving[step], part_std, 0.0) ** 2) @ f.T
        if insertion == "after":
            covariance = covariance + added
        h = observed[step]
        spread = covariance @ h.T
        gain = spread @ np.linalg.pinv(h @ spread + np.diag(noise), hermitian=True)
        residual = np.eye(len(covariance)) - gain @ h
        covariance = residual @ covariance @ residual.T + (gain * noise) @ gain.T
        covariance = a @ covariance @ a.T + (added if insertion == "before" else 0.0)
        gains.append(gain)
    return Estimator(observed, np.stack(gains))


def _installed_states(process: Process, insertion: str) -> NDArray[np.bool_]:
    """Shape (N, n): the states whose part is installed at the measurement of step k."""
    present = process.present
    if insertion == "before":
        present = np.vstack([np.zeros_like(present[:1]), present[:-1]])
    return present


def _faults(process: Process, part_std: Array, noise: Array, observation: Array) -> list[Fault]:
    faults = []
    parts, states = process.error.shape[-1], process.transition.shape[-1]
    if np.shape(part_std) != (parts,) or not np.all(np.asarray(part_std) >= 0.0):
        faults.append(Fault("part_std", f"must be {parts} numbers of at least 0, got {part_std}"))
    if not np.all(np.isfinite(noise)):
        faults.append(Fault("noise_std", "must be finite"))
    if observation.ndim != 2 or observation.shape[1] != states:
        faults.append(Fault("measured", f"must have {states} columns, got shape {observation.shape}"))
    return faults
