"""The joint yield of linear requirements of normal parts: what a normal law has within a polytope.

P(a_i . z <= c_i for all i) of independent standard normal z has with the flux form of Gauss's theorem in two
dimensions the closed form

    P = [0 inside] - sum_i (T(h_i, tau_i2/h_i) - T(h_i, tau_i1/h_i))

over the edges of the polygon, h_i the distance of edge i from 0, tau_i1 and tau_i2 its ends along it, and T the
function of Owen (1956), Tables for computing bivariate normal probabilities, Ann. Math. Stat. 27(4), 1075-1090. It
holds for all correlations, -1 and 1 included. Of d > 2 dimensions the first d - 2 are integrated by quadrature.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.special import ndtr, ndtri, owens_t

from ...section import Array
from ..propagation.monte_carlo import replicates
from .mechanism import ROUNDING, Law, Mechanism, Tolerances, mean_of, root_of, spread_of

RANK = 1e-10
"""Fraction of the largest singular value below which directions count as dependent."""
JUST_INSIDE = 1e-100
"""Distance that stands for an edge through the mean, at which angles at corners still count."""
PARALLEL = 1e-13
"""Sine of the angle below which two edges count as parallel."""
FRAMES = 256
"""Directions of integration that are tried in more than two dimensions."""
ORDERS = {1: (48, 72), 2: (36, 48)}
"""Orders of two Gauss-Legendre rules of one and two dimensions: the second has the value, both together the error."""
REACH, NO_WEIGHT = 7.5, 1e-12
"""Standard deviations up to which a dimension is integrated, beyond which 1e-13 lies, and a weight that is left out."""
BEYOND = 1e-10
"""What these leave out of a probability, at most."""
POINTS = 4096
"""Points of the Sobol sample of more dimensions."""
RARE = 0.02
"""Sum of probabilities below which that sample hardly has a point that breaks two limits."""
FAR = 40.0
"""Distance of a limit that is never reached, in standard deviations."""
MEMORY = 2**18
"""Values held for a block of designs."""


@dataclass(frozen=True, slots=True, eq=False)
class Probability:
    """Probabilities (n,), their errors (standard errors of a sample), and derivatives by the rooms c (n, q) and the
    rows a (n, q, k).
    """

    value: Array
    error: Array
    by_room: Array
    by_rows: Array


@lru_cache(maxsize=16)
def _rules(dimensions: int) -> list[tuple[Array, Array]]:
    """Nodes (m, dimensions) and weights (m,) of rules of the standard normal law."""
    if dimensions == 0:
        return [(np.zeros((1, 0)), np.ones(1))]
    if dimensions in ORDERS:
        return [_product_rule(order, dimensions) for order in ORDERS[dimensions]]
    samples = replicates(POINTS, dimensions, np.random.default_rng(0))
    return [(ndtri(points), np.full(len(points), 1.0 / len(points))) for points in samples]


def _product_rule(order: int, dimensions: int) -> tuple[Array, Array]:
    """The rule of Gauss and Legendre in every dimension, without nodes of hardly any weight."""
    x, weight = np.polynomial.legendre.leggauss(order)
    weight = weight * _bell(REACH * x)
    grid = np.stack(np.meshgrid(*[REACH * x] * dimensions, indexing="ij"), axis=-1).reshape(-1, dimensions)
    weights = np.prod(np.meshgrid(*[weight / weight.sum()] * dimensions, indexing="ij"), axis=0).ravel()
    kept = weights > NO_WEIGHT
    return grid[kept], weights[kept]


@lru_cache(maxsize=16)
def _frames(dimensions: int) -> Array:
    """Orthonormal frames (frames, d, d), the same each time."""
    normal = np.random.default_rng(0).standard_normal((FRAMES, dimensions, dimensions))
    return np.asarray(np.linalg.qr(normal)[0])


def within_polytopes(rows: Array, room: Array) -> Probability:
    """P(rows z <= room) of standard normal z (k,), with rows (n, q, k) of n designs.

    What breaks each limit is known: in more than two dimensions quadrature has only what breaks several.
    """
    size = np.linalg.norm(rows, axis=2)
    moving = size > 0.0
    safe = np.where(moving, size, 1.0)
    unit = rows / safe[:, :, None]
    distance = np.where(moving, room / safe, np.where(room >= 0.0, FAR, -FAR))
    if rows.shape[2] < 2:
        unit = np.concatenate([unit, np.zeros_like(unit)], axis=2)
    scale, axes = np.linalg.svd(unit)[1:]
    rank = np.maximum(np.sum(scale > RANK * np.maximum(scale[:, :1], RANK), axis=1), 2)
    value, error = np.empty(len(rows)), np.empty(len(rows))
    by_room, by_rows = np.empty_like(unit[:, :, 0]), np.empty_like(unit)
    for dimensions in np.unique(rank).tolist():
        alike = np.flatnonzero(rank == dimensions)
        block = max(1, MEMORY // (max(len(nodes) for nodes, _ in _rules(dimensions - 2)) * rows.shape[1] ** 2))
        for at in (alike[first : first + block] for first in range(0, len(alike), block)):
            spanned = _spanned(unit[at], axes[at, :dimensions])
            value[at], error[at], by_room[at], by_rows[at] = _integrated(*spanned, distance[at])
    by_room /= safe
    by_rows = by_rows[:, :, : rows.shape[2]] / safe[:, :, None]
    return Probability(np.clip(value, 0.0, 1.0), error, by_room, by_rows)


def _spanned(unit: Array, axes: Array) -> tuple[Array, Array]:
    """Orthonormal axes (n, d, k) of the span of rows (n, q, k), and the rows in them (n, q, d).

    No row is close to what the first d - 2 axes span, so that all change but slowly along these.
    """
    if axes.shape[1] > 2:  # a basis that depends on the span alone: singular vectors of equal values are any
        towards = np.random.default_rng(1).standard_normal((axes.shape[2], axes.shape[1]))
        axes = np.linalg.qr(axes.swapaxes(1, 2) @ (axes @ towards))[0].swapaxes(1, 2)
    normals = unit @ axes.swapaxes(1, 2)
    if axes.shape[1] > 2:
        frames = _frames(axes.shape[1])
        width = np.linalg.norm(normals[:, None] @ frames[None, :, :, -2:], axis=3)
        width = np.where(np.any(normals != 0.0, axis=2)[:, None], width, np.inf)
        frame = frames[np.argmax(width.min(axis=2), axis=1)]
        axes, normals = frame.swapaxes(1, 2) @ axes, normals @ frame
    return axes, normals


def _integrated(axes: Array, normals: Array, distance: Array) -> tuple[Array, Array, Array, Array]:
    """Probabilities (n,), their errors, and the derivatives by distances (n, q) and unit rows (n, q, k)."""
    outer, inner = normals[:, :, :-2], normals[:, :, -2:]
    width = np.linalg.norm(inner, axis=2)
    width = np.where(width > 0.0, width, 1.0)
    along = inner / width[:, :, None]
    alone, bell = ndtr(-distance).sum(axis=1), _bell(distance)
    rules = _rules(outer.shape[2])
    kept = rules if len(rules) > 2 else rules[-1:]
    values, by_room, by_normal = [], bell.copy(), -(distance * bell)[:, :, None] * normals
    for nodes, weights in rules:
        h = (distance[:, None] - nodes @ outer.swapaxes(1, 2)) / width[:, None]
        whole, length, moment = _polygons(along[:, None], h)
        values.append((whole + ndtr(-h).sum(axis=2)) @ weights - alone)
        if not any(nodes is own for own, _ in kept):
            continue
        weighted = weights[None, :, None] / len(kept) / width[:, None] * _bell(h)
        face, turn = weighted * (length - 1.0), np.sum(weighted * moment, axis=1)
        by_room += face.sum(axis=1)
        by_normal[:, :, :-2] -= face.swapaxes(1, 2) @ nodes
        by_normal[:, :, -2:] -= np.sum(h * face, axis=1)[:, :, None] * along + turn[:, :, None] * _across(along)
    every = np.array(values)
    if len(rules) > 2:
        unseen = np.where(alone < RARE, 0.5 * alone**2, 0.0)  # both of two rare limits broken, by independent errors
        error = every.std(axis=0, ddof=1) / np.sqrt(len(rules)) + unseen
        return every.mean(axis=0), error, by_room, by_normal @ axes
    return every[-1], np.abs(every[-1] - every[0]) + BEYOND, by_room, by_normal @ axes


def _bell(x: Array) -> Array:
    """The density of the standard normal law."""
    return np.asarray(np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi))


def _across(n: Array) -> Array:
    """Vectors (..., 2) turned by 90 degrees."""
    return np.stack([-n[..., 1], n[..., 0]], axis=-1)


def _polygons(n: Array, h: Array) -> tuple[Array, Array, Array]:
    """P(n z <= h) (...,) in the plane for unit normals n (..., q, 2) at distances h (..., q); the probability of each
    edge along its line, and the first moment of that (..., q).
    """
    h = np.where(h == 0.0, JUST_INSIDE, h)  # the limit for an edge through 0
    cosine, sine = n @ n.swapaxes(-1, -2), _across(n) @ n.swapaxes(-1, -2)  # of edge i (rows) and constraint j
    parallel = np.abs(sine) <= PARALLEL
    room = h[..., None, :] - h[..., :, None] * np.where(parallel, np.sign(cosine), cosine)
    end = room / np.where(parallel, 1.0, sine)
    last = np.where(sine > PARALLEL, end, np.inf).min(axis=-1)
    first = np.where(sine < -PARALLEL, end, -np.inf).max(axis=-1)
    again = (cosine > 0.0) & np.tri(h.shape[-1], k=-1, dtype=bool)  # the same edge, of which one counts
    outside = np.any(parallel & ((room < 0.0) | (again & (room == 0.0))), axis=-1) | ~(first < last)
    first, last = (np.where(outside, 0.0, value) for value in (first, last))
    whole = np.all(h >= 0.0, axis=-1) - np.sum(owens_t(h, last / h) - owens_t(h, first / h), axis=-1)
    return whole, ndtr(last) - ndtr(first), _bell(first) - _bell(last)


@dataclass(frozen=True, eq=False)
class JointNormal:
    """Linear requirements of the same pieces, which are all normal; designs t have shape (n, p)."""

    mechanisms: tuple[Mechanism, ...]

    def yield_percent(self, t: Tolerances) -> tuple[Array, Array]:
        """Units (n,) that keep all limits, in percent, and a bound of the error of that (n,)."""
        kept = self._within(t)
        return 100.0 * kept.value, 100.0 * kept.error + ROUNDING

    def slopes(self, t: Tolerances) -> Array:
        """Derivatives (n, p) of the yield in percent by the spread of the parts."""
        (directed, mean, deviations), kept = self._pieces, self._within(t)
        along = directed * (kept.by_rows @ deviations.T - kept.by_room[:, :, None] * mean)
        owner = self.mechanisms[0].owners[:, None] == np.arange(spread_of(t).shape[1])
        return np.asarray(100.0 * along.sum(axis=1) @ owner)

    @cached_property
    def _limits(self) -> list[tuple[Mechanism, float, float]]:
        """Requirement, sign and limit of every limit."""
        ends = [(m, side, limit) for m in self.mechanisms for side, limit in ((1.0, m.upper), (-1.0, m.lower))]
        return [(mechanism, side, limit) for mechanism, side, limit in ends if np.isfinite(limit)]

    @cached_property
    def _pieces(self) -> tuple[Array, Array, Array]:
        """Slopes (q, k) towards each limit, means (k,), and deviations (k, k) by independent ones, at t = 1."""
        first = self.mechanisms[0]
        moments = np.array([first.inputs[owner].raw_moments(2) for owner in first.owner])
        std = np.sqrt(np.maximum(moments[:, 2] - moments[:, 1] ** 2, 0.0))
        root = np.eye(len(std)) if first.correlation is None else root_of(first.correlation)
        directed = np.array([side * mechanism.sensitivities for mechanism, side, _ in self._limits])
        return directed, moments[:, 1], std[:, None] * root

    def _within(self, t: Tolerances) -> Probability:
        directed, mean, deviations = self._pieces
        owners = self.mechanisms[0].owners
        spread, shift = spread_of(t)[:, owners], mean_of(t)[:, owners]
        room = np.array([side * (limit - mechanism.centre) for mechanism, side, limit in self._limits])
        size = np.array([abs(limit) for _, _, limit in self._limits])
        room = room + ROUNDING * size - (mean * spread + shift) @ directed.T
        kept = within_polytopes((directed * spread[:, None]) @ deviations, room)
        return replace(kept, error=kept.error + np.abs(kept.by_room) @ (ROUNDING * size))


def joint_normal(mechanisms: Sequence[Mechanism], laws: Sequence[Law | str]) -> JointNormal | None:
    """The joint law of requirements with their own `laws`; None unless all are linear and of normal parts."""
    known = all(isinstance(law, Law) and law.covariance is not None for law in laws)
    return JointNormal(tuple(mechanisms)) if known else None
