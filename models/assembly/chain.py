"""Datum flow chain: the part that each part hangs on, and the matrices that follow from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...errors import Fault, raise_all


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
