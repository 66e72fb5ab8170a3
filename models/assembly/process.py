"""The assembly process x(k+1) = A x(k) + B u(k) + F w(k), y = C x + v, as checked arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...errors import Fault, raise_all
from .chain import DatumFlowChain

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


def plane_process(chain: DatumFlowChain | None = None, weights: Array | None = None, absent: float = 1000.0) -> Process:
    """Document A's process about one axis: one angle per key characteristic.

    `weights` (N, N) replaces those that follow from the chain; `absent` is the least weight of a
    part that cannot be adjusted. Raises InputError.
    """
    chain = chain or DatumFlowChain()
    count, flow = chain.steps, chain.error_matrix()
    base = Process(
        transition=np.broadcast_to(np.eye(count), (count, count, count)),
        control=np.broadcast_to(flow, (count, count, count)),
        error=np.broadcast_to(flow, (count, count, count)),
        arriving=np.eye(count, dtype=bool),
        weight=chain.weights()[:, :, None] * np.eye(count),
        observation=chain.observation(),
        coupling=chain.coupling(),
    )
    return base if weights is None else base.weighted(weights, absent)


def space_process(
    chain: DatumFlowChain | None = None,
    weights: Array | None = None,
    absent: float = 1000.0,
    frames: Array | None = None,
) -> Process:
    """The process in space: the angles about x, y and z of every key characteristic.

    `frames` (N, 3, 3) turn the part's own axes into those of the housing (default: parallel); a
    small rotation is a vector, so that a part moves all parts that hang on it by the same vector.
    `weights` (N, N) are those of the parts, equal about all three axes.
    """
    plane = plane_process(chain, weights, absent)
    count = plane.steps
    axes = np.broadcast_to(np.eye(TURN), (count, TURN, TURN)) if frames is None else frames
    raise_all(_rotations(axes, count))
    turned = np.einsum("ksp,pab->ksapb", plane.error, axes)
    flow = turned.reshape(count, TURN * count, TURN * count)

    def thrice(matrix: Array) -> Array:
        return np.asarray(np.kron(matrix, np.eye(TURN)), dtype=float)

    return Process(
        transition=thrice(plane.transition),
        control=flow,
        error=flow,
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
