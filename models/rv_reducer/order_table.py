"""Quasi-static twist of a unit, by order of the output angle, tabulated over torque."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...units import ARCMIN
from .contact.mesh import Mesh
from .dynamics.spectrum import ComplexArray, spectrum

SOFT = 2.0
"""[N m] Nodes are even in asinh(T/SOFT): dense where the mesh is soft."""
NODES = 24
TOUCH = 1e-6
"""[N m] in place of no torque, where the stiffness is that of the first pins that bear."""
LEFT_OUT = 0.1 * ARCMIN / 60.0
"""[rad] The smallest orders are omitted, to this rms of their sum at any torque: 0.1 arcsec."""
ELEMENTS = 1_000_000
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
    def of(cls, mesh: Mesh, most: float, left_out: float = LEFT_OUT) -> OrderTable:
        """The table of a mesh over one turn, up to torques of +-`most` [N m]."""
        nodes = np.linspace(0.0, np.arcsinh(most / SOFT), NODES)
        torques = np.maximum(SOFT * np.sinh(nodes), TOUCH)
        twist, stiffness = np.empty((2, 2, NODES, mesh.shape[1]))
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
        blocks = max(1, -(-len(angle) * len(self.order) // ELEMENTS))
        for rows in np.array_split(np.arange(len(angle)), blocks):
            lines = self.amplitudes(torque[rows], side[rows])
            if factor is not None:
                lines = lines * factor[rows]
            waves = np.exp(1j * self.order * angle[rows, None])
            twists[rows] = np.einsum("nm,nm->n", lines, waves).real
        return twists
