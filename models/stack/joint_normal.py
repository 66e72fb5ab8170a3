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
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.special import ndtr, ndtri, owens_t

from ...section import Array, Integers
from ..inputs import Normal
from ..propagation.monte_carlo import replicates
from .mechanism import ROUNDING, Law, Mechanism, Tolerances, mean_of, root_of, spread_of

RANK = 1e-10
"""Fraction of the largest singular value below which directions count as dependent."""
PARALLEL = 1e-13
"""Sine of the angle below which two edges count as parallel."""
FRAMES = 256
"""Directions of integration that are tried in more than two dimensions."""
ORDERS = {1: (96, 128), 2: (32, 48)}
"""Orders of the Gauss-Legendre rules of one and two dimensions; of more dimensions a Sobol sample is taken."""
REACH, NO_WEIGHT = 7.5, 1e-12
"""Standard deviations up to which a dimension is integrated, beyond which 1e-13 lies, and a weight that is left out."""
POINTS = 4096
"""Points of a Sobol sample."""


@dataclass(frozen=True, slots=True, eq=False)
class Probability:
    """A probability, a bound of its error, and its derivatives by the rooms c (q,) and rows a (q, k)."""

    value: float
    error: float
    by_room: Array
    by_rows: Array


@lru_cache(maxsize=16)
def _rule(dimensions: int) -> tuple[Integers, Array, Array]:
    """Rules of the standard normal law: the number of the rule (m,), nodes (m, dimensions) and weights (m,)."""
    if dimensions == 0:
        rules = [(np.zeros((1, 0)), np.ones(1))]
    elif dimensions in ORDERS:
        rules = [_product_rule(order, dimensions) for order in ORDERS[dimensions]]
    else:
        samples = replicates(POINTS, dimensions, np.random.default_rng(0))
        rules = [(ndtri(points), np.full(len(points), 1.0 / len(points))) for points in samples]
    numbers = np.repeat(np.arange(len(rules)), [len(weights) for _, weights in rules])
    return numbers, np.vstack([nodes for nodes, _ in rules]), np.concatenate([weights for _, weights in rules])


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


def within_polytope(rows: Array, room: Array) -> Probability:
    """P(rows z <= room) of standard normal z (k,), with rows (q, k) none of which is 0.

    What breaks each limit is known: in more than two dimensions quadrature has only what breaks several.
    """
    size = np.linalg.norm(rows, axis=1)
    unit, distance = rows / size[:, None], room / size
    kept = _tightest_of_parallel(unit, distance)
    axes, normals = _spanned(unit[kept])
    alone, bell = ndtr(-distance[kept]), _bell(distance[kept])
    rule, nodes, weights = _rule(normals.shape[1] - 2)
    outer, inner = normals[:, :-2], normals[:, -2:]
    width = np.linalg.norm(inner, axis=1)
    along = inner / width[:, None]
    h = (distance[kept] - nodes @ outer.T) / width
    whole, length, moment = _polygons(along, h)
    rules = int(rule[-1]) + 1
    by_rule = np.bincount(rule, weights * (whole + ndtr(-h).sum(axis=1))) - alone.sum()
    weighted = weights[:, None] / rules / width * _bell(h)
    face, moment = weighted * (length - 1.0), weighted * moment
    by_normal = np.hstack(
        [
            face.T @ nodes,
            np.sum(h * face, axis=0)[:, None] * along + moment.sum(axis=0)[:, None] * _across(along),
        ]
    )
    by_room, by_rows = np.zeros(len(rows)), np.zeros_like(rows)
    by_room[kept] = (face.sum(axis=0) + bell) / size[kept]
    by_rows[kept] = -((by_normal + (distance[kept] * bell)[:, None] * normals) @ axes)[:, : rows.shape[1]]
    by_rows[kept] /= size[kept, None]
    error = np.ptp(by_rule) if rules <= 2 else by_rule.std(ddof=1) / np.sqrt(rules)
    return Probability(float(np.clip(by_rule.mean(), 0.0, 1.0)), float(error), by_room, by_rows)


def _bell(x: Array) -> Array:
    """The density of the standard normal law."""
    return np.asarray(np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi))


def _across(n: Array) -> Array:
    """Vectors (q, 2) turned by 90 degrees."""
    return np.stack([-n[:, 1], n[:, 0]], axis=1)


def _tightest_of_parallel(unit: Array, distance: Array) -> Array:
    """Indices of the rows but those of the same direction as one that is at least as tight."""
    same = np.linalg.norm(unit[:, None] - unit[None, :], axis=2) <= PARALLEL
    order = np.arange(len(unit))
    tighter = (distance[None, :] < distance[:, None]) | (
        (distance[None, :] == distance[:, None]) & (order[None, :] < order[:, None])
    )
    return np.flatnonzero(~np.any(same & tighter, axis=1))


def _spanned(unit: Array) -> tuple[Array, Array]:
    """Orthonormal axes (d, k or more) of the span of rows, at least two, and the rows in them (q, d).

    No row is close to what the first d - 2 axes span, so that all change but slowly along these.
    """
    if unit.shape[1] < 2:
        unit = np.hstack([unit, np.zeros((len(unit), 1))])
    _, size, axes = np.linalg.svd(unit)
    axes = axes[: max(int(np.sum(size > RANK * size[0])), 2)]
    normals = unit @ axes.T
    if len(axes) > 2:
        frames = _frames(len(axes))
        width = np.linalg.norm(normals @ frames[:, :, -2:], axis=2)
        frame = frames[int(np.argmax(width.min(axis=1)))]
        axes, normals = frame.T @ axes, normals @ frame
    return axes, normals


def _polygons(n: Array, h: Array) -> tuple[Array, Array, Array]:
    """P(n z <= h) (m,) in the plane for unit normals n (q, 2) at distances h (m, q); the probability of each edge along
    its line, and the first moment of that (m, q).
    """
    cosine, sine = n @ n.T, _across(n) @ n.T  # of edge i (rows) and constraint j (columns)
    parallel = np.abs(sine) <= PARALLEL
    room = h[:, None, :] - h[:, :, None] * cosine
    end = room / np.where(parallel, 1.0, sine)
    last = np.where(~parallel & (sine > 0.0), end, np.inf).min(axis=2)
    first = np.where(~parallel & (sine < 0.0), end, -np.inf).max(axis=2)
    others = parallel & ~np.eye(len(n), dtype=bool)
    outside = np.any(others & (room < 0.0), axis=2) | ~(first < last)
    first, last = (np.where(outside, 0.0, value) for value in (first, last))
    safe = np.where(h == 0.0, np.finfo(float).tiny, h)
    whole = np.all(h >= 0.0, axis=1) - np.sum(owens_t(safe, last / safe) - owens_t(safe, first / safe), axis=1)
    return whole, ndtr(last) - ndtr(first), _bell(first) - _bell(last)


@dataclass(frozen=True, eq=False)
class JointNormal:
    """Linear requirements of the same pieces, which are all normal; designs t have shape (n, p)."""

    mechanisms: tuple[Mechanism, ...]

    def yield_percent(self, t: Tolerances) -> tuple[Array, Array]:
        """Units (n,) that keep all limits, in percent, and a bound of the error of that (n,)."""
        values = np.array([self._at(t, row)[:2] for row in range(len(t))]).reshape(-1, 2)
        return 100.0 * values[:, 0], 100.0 * values[:, 1] + ROUNDING

    def slopes(self, t: Tolerances) -> Array:
        """Derivatives (n, p) of the yield in percent by the spread of the parts."""
        return 100.0 * np.array([self._at(t, row)[2] for row in range(len(t))]).reshape(spread_of(t).shape)

    @cached_property
    def _limits(self) -> tuple[Array, Array, Array]:
        """Requirement, sign and limit (q,) of every limit."""
        every = [
            (at, sign, limit)
            for at, mechanism in enumerate(self.mechanisms)
            for sign, limit in ((1.0, mechanism.upper), (-1.0, mechanism.lower))
            if np.isfinite(limit)
        ]
        requirement, sign, limit = np.array(every).T
        return requirement.astype(np.int64), sign, limit

    @cached_property
    def _pieces(self) -> tuple[Array, Array, Array]:
        """Slopes (r, k), means (k,) at t = 1, and deviations (k, k) at t = 1 by independent ones."""
        first = self.mechanisms[0]
        laws = [first.inputs[owner] for owner in first.owner]
        moments = np.array([law.raw_moments(2) for law in laws])
        std = np.sqrt(np.maximum(moments[:, 2] - moments[:, 1] ** 2, 0.0))
        root = np.eye(len(std)) if first.correlation is None else root_of(first.correlation)
        return np.array([mechanism.sensitivities for mechanism in self.mechanisms]), moments[:, 1], std[:, None] * root

    def _at(self, t: Tolerances, row: int) -> tuple[float, float, Array]:
        """Probability, its error and its derivatives (p,) of one design."""
        slopes, mean, deviations = self._pieces
        requirement, sign, limit = self._limits
        owners, parts = self.mechanisms[0].owners, spread_of(t).shape[1]
        spread, shift = spread_of(t)[row][owners], mean_of(t)[row][owners]
        directed = sign[:, None] * slopes[requirement]
        centre = np.array([mechanism.centre for mechanism in self.mechanisms])[requirement]
        room = sign * (limit - centre) - directed @ (mean * spread + shift)
        rows = (directed * spread) @ deviations
        moving = np.any(rows != 0.0, axis=1)
        if np.any(room[~moving] < -ROUNDING * np.abs(limit[~moving])):
            return 0.0, 0.0, np.zeros(parts)
        if not np.any(moving):
            return 1.0, 0.0, np.zeros(parts)
        kept = within_polytope(rows[moving], room[moving])
        along = directed[moving] * (kept.by_rows @ deviations.T - kept.by_room[:, None] * mean)
        return kept.value, kept.error, np.bincount(owners, along.sum(axis=0), parts)


def joint_normal(mechanisms: Sequence[Mechanism], laws: Sequence[Law | str]) -> JointNormal | None:
    """The joint law of requirements with their own `laws`; None unless all are linear and of normal parts."""
    known = all(isinstance(law, Law) and law.covariance is not None for law in laws)
    return JointNormal(tuple(mechanisms)) if known and len(laws) > 0 else None
