"""A mesh tabulated over twist and output angle, so that its torque costs one look-up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ....arrays import Array

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
        return cls(scale, nodes, torque, _limited(torque, slope, nodes[1] - nodes[0]), peak)

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
        limited = _limited(torque, slope, self.nodes[1] - self.nodes[0])
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


def _limited(torque: Array, slope: Array, step: float) -> Array:
    """Slopes (m, n) limited to three times the adjacent chords."""
    chord = np.diff(torque, axis=0) / step
    ends = np.full((1, torque.shape[1]), np.inf)
    adjacent = np.minimum(np.concatenate([ends, chord]), np.concatenate([chord, ends]))
    return np.asarray(np.clip(slope, 0.0, 3.0 * adjacent))
