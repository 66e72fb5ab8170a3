"""The poses of a cell: a grid or the test poses of ISO 9283 in a cube, or a list."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .chain import rotation

KINDS = ("grid", "iso_cube")
ISO = 0.8
"""Fraction of a diagonal of the cube that the test poses span (ISO 9283:1998, 6.2)."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Where the arm works: lengths [m], angles [rad], in the measuring frame.

    `kind` is one of `KINDS` about `centre` in a cube of edges `side`, a grid with `per_edge` poses
    along each, or empty where `listed` holds the poses: rows of a position, of a position and a
    rotation vector, or (`in_joints`) of joint angles. `turn` (3,) is the rotation vector of the
    last frame where a row has none; the default points its z axis down. Positions are those of the
    last frame's origin, of the tool with `of_tool`. `near` (k,) are joint angles that select the
    posture of the arm; empty: all 0.
    """

    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    side: float = 0.0
    kind: str = "grid"
    per_edge: int = 5
    listed: tuple[tuple[float, ...], ...] = ()
    in_joints: bool = False
    turn: tuple[float, float, float] = (np.pi, 0.0, 0.0)
    near: tuple[float, ...] = ()
    of_tool: bool = False

    def poses(self) -> tuple[Array, Array]:
        """Positions (n, 3) [m] and rotations (n, 3, 3), of equal weight."""
        if self.listed:
            rows = np.array(self.listed)
            vectors = rows[:, 3:] if rows.shape[1] == 6 else np.tile(self.turn, (len(rows), 1))
            return rows[:, :3], np.array([rotation(vector) for vector in vectors])
        unit = _grid(self.per_edge) if self.kind == "grid" else _iso_cube()
        turn = np.repeat(rotation(np.array(self.turn))[None], len(unit), axis=0)
        return np.array(self.centre) + self.side * unit, turn


def _grid(count: int) -> Array:
    """Points of a cube of edge 1 about the origin, its faces included."""
    edge = np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)
    return np.stack(np.meshgrid(edge, edge, edge, indexing="ij"), axis=-1).reshape(-1, 3)


def _iso_cube() -> Array:
    """P1 to P5: the centre, and four in the plane C1 C2 C7 C8 on the cube's diagonals."""
    corners = [(1, 1, 1), (-1, 1, 1), (-1, -1, -1), (1, -1, -1)]
    return np.array([(0, 0, 0), *corners]) * 0.5 * ISO
