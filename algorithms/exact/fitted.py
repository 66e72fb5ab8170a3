"""Convex rows fitted to the values of a problem, and least values that they prove.

A row is an objective or a constraint as a function of the design. Its form is fitted at some
designs and compared at others, within the box and on its faces: what agrees there is verified at
these designs, and not between them. A least value follows from tangents of the rows alone: a convex
function lies nowhere below its tangents, so that any multipliers of these give a bound (weak
duality). It hangs neither on how well a solver has converged nor on its last digits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, combinations_with_replacement

import numpy as np
from scipy.optimize import linprog, nnls

from ...section import Array
from .slsqp import slsqp

AGREES = 1e-8
"""Part of the range of a row's values up to which a form agrees with them."""
POWERS = (-3.0, -2.0, -1.0, -0.5, 1.5, 2.0, 3.0)
"""Exponents that are convex for positive variables; positive variables alone have other than 2."""
MONOMIALS = (-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0)
PAIRS = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0), (2.0, 1.0), (1.0, 2.0))
"""Exponents of posynomials: of one variable, and of two."""
MOST_TERMS = 400
"""Terms of a form at most: each takes about two evaluations."""
HELD_OUT = 400
"""Designs at which a form is compared that it has not been fitted to: half of them on faces of the box."""
SAFETY, DIGITS = 4.0, 1e-13
"""Deviation that is allowed for between the designs, as a multiple of that at them, and as a part of the values."""
ROUNDS, CLOSED = 30, 1e-9
"""Cuts at most, and the relative gap at which no more are added."""
ROUNDING = 1e-11
"""Part of a bound by which it is lowered, more than the rounding of its sums."""
PLAIN, LOG = "x", "log x"
"""Coordinates in which rows are convex."""


@dataclass(frozen=True, eq=False)
class Row:
    """One row: `constant` + `linear` (variables,) . x + sum of `weight` (k,) times products of powers (k, variables)
    + x' `quadratic` x.

    `kind` says which form it is, `coordinates` where it is convex; `error` is the deviation that is allowed
    for. Of a `root` these are the values squared, with their sign.
    """

    kind: str
    coordinates: str
    constant: float
    linear: Array
    weight: Array
    power: Array
    quadratic: Array
    root: bool = False
    error: float = 0.0

    def value(self, x: Array) -> Array:
        """Values (n,) at designs (n, variables)."""
        curved = np.einsum("ni,ij,nj->n", x, self.quadratic, x)
        return np.asarray(self.constant + x @ self.linear + products(x, self.power) @ self.weight + curved)

    def slope(self, x: Array) -> Array:
        """Derivatives (n, variables) in the design."""
        powers = (products(x, self.power) * self.weight) @ self.power
        return np.asarray(self.linear + (powers / x if len(self.power) else 0.0) + 2.0 * x @ self.quadratic)

    def deviations(self, x: Array, y: Array) -> Array:
        """Distances (n,) from values y (n,) at designs x (n, variables); inf where a value is not finite."""
        away = np.abs(self.value(x) - (y * np.abs(y) if self.root else y))
        return np.where(np.isfinite(away), away, np.inf)


def products(x: Array, power: Array) -> Array:
    """Products of powers (n, k) at designs (n, variables)."""
    return np.asarray(np.prod(np.where(power[None] == 0.0, 1.0, x[:, None, :] ** power[None]), axis=2))


def designs_to_fit(low: Array, high: Array, rng: np.random.Generator) -> Array:
    """Designs (n, variables) in a box at which rows are fitted and, the last `HELD_OUT` of them, compared."""
    x = rng.uniform(low, high, (2 * _most_terms(len(low)) + HELD_OUT, len(low)))
    side = rng.integers(0, 4, (HELD_OUT // 2, len(low)))
    side[:2] = [[0], [1]]  # the two corners to which costs and variations fall
    x[-len(side) :] = np.select([side == 0, side == 1], [low, high], x[-len(side) :])
    return x


def _most_terms(variables: int) -> int:
    quadratic = variables * (variables + 3) // 2 + 1
    posynomial = 1 + variables * len(MONOMIALS) + variables * (variables - 1) // 2 * len(PAIRS)
    return min(MOST_TERMS, max(quadratic, posynomial, variables * (len(POWERS) + 2) + 2))


def fitted(x: Array, y: Array) -> list[Row]:
    """The forms of a row that agree with its values y (n,) at designs x (n, variables), one at most for
    each kind of coordinates; none where no form agrees. The last `HELD_OUT` designs are not fitted.
    """
    if not np.all(np.isfinite(y)):
        return []
    count, positive = len(x) - HELD_OUT, bool(np.all(x > 0.0))
    tries = [(PLAIN, _linear, True), (PLAIN, _convex_quadratic, True), (PLAIN, _separable, positive)]
    tries += [(PLAIN, _root, bool(np.all(y >= 0.0))), (LOG, _posynomial, positive)]
    found: list[Row] = []
    for coordinates, attempt, applies in tries:
        if not applies or coordinates in [other.coordinates for other in found]:
            continue
        row = attempt(x[:count], y[:count])
        if row is None:
            continue
        values, error = y**2 if row.root else y, float(np.max(row.deviations(x, y)))
        most = float(np.max(np.abs(values)))
        if error <= AGREES * max(float(np.ptp(values)), 1e-9 * most):
            found.append(replace(row, error=SAFETY * error + DIGITS * most))
    return found


def _linear(x: Array, y: Array) -> Row | None:
    return _quadratic(x, y, "linear", [])


def _convex_quadratic(x: Array, y: Array) -> Row | None:
    return _quadratic(x, y, "convex quadratic", list(combinations_with_replacement(range(x.shape[1]), 2)))


def _root(x: Array, y: Array) -> Row | None:
    row = _convex_quadratic(x, y**2)
    return None if row is None else replace(row, kind="root of a convex quadratic", root=True)


def _quadratic(x: Array, y: Array, kind: str, pairs: list[tuple[int, int]]) -> Row | None:
    """A row with products of so many pairs by least squares; None where it is not convex, or has too many terms."""
    n, variables = x.shape
    if n < 1 + variables + len(pairs):
        return None
    low, high = x.min(axis=0), x.max(axis=0)
    centre, width = 0.5 * (low + high), np.where(high > low, 0.5 * (high - low), 1.0)
    z = (x - centre) / width
    columns = np.column_stack([np.ones(n), z, *(z[:, i] * z[:, j] for i, j in pairs)])
    coefficients = np.linalg.lstsq(columns, y, rcond=None)[0]
    curved = np.zeros((variables, variables))
    for (i, j), c in zip(pairs, coefficients[1 + variables :], strict=True):
        curved[i, j] += 0.5 * c
        curved[j, i] += 0.5 * c
    values, vectors = np.linalg.eigh(curved)
    if values[0] < -AGREES * max(float(np.max(np.abs(values))), 1e-300):
        return None
    curved = (vectors * np.maximum(values, 0.0)) @ vectors.T / np.outer(width, width)
    tilt = coefficients[1 : 1 + variables] / width
    constant = float(coefficients[0] - tilt @ centre + centre @ curved @ centre)
    linear = tilt - 2.0 * curved @ centre
    return Row(kind, PLAIN, constant, linear, np.empty(0), np.empty((0, variables)), curved)


def _separable(x: Array, y: Array) -> Row | None:
    """A sum of convex powers of single variables, linear terms of either sign."""
    return _nonnegative(x, y, np.vstack([p * np.eye(x.shape[1]) for p in POWERS]), "separable", PLAIN)


def _posynomial(x: Array, y: Array) -> Row | None:
    """A posynomial and a constant of either sign: convex in the logarithms of the variables."""
    variables = x.shape[1]
    if np.all(y > 0.0):  # a single monomial may have any exponents
        columns = np.column_stack([np.ones(len(x)), np.log(x)])
        factor, *exponents = np.linalg.lstsq(columns, np.log(y), rcond=None)[0]
        none = np.zeros((variables, variables))
        row = Row("monomial", LOG, 0.0, none[0], np.exp([factor]), np.array([exponents]), none)
        if np.max(row.deviations(x, y)) <= AGREES * np.ptp(y):
            return row
    units = np.eye(variables)
    single = [p * unit for p in MONOMIALS for unit in units]
    double = [p * units[i] + q * units[j] for i, j in combinations(range(variables), 2) for p, q in PAIRS]
    power = np.array([*single, *double])
    return _nonnegative(x, y, power, "posynomial", LOG) if len(power) < MOST_TERMS else None


def _nonnegative(x: Array, y: Array, power: Array, kind: str, coordinates: str) -> Row | None:
    """Weights that are not negative, and a constant, in plain coordinates linear terms as well, of either sign."""
    variables = x.shape[1]
    free = np.hstack([np.ones((len(x), 1)), x if coordinates == PLAIN else np.empty((len(x), 0))])
    count = free.shape[1]
    if len(x) < len(power) + 2 * count:
        return None
    columns = np.hstack([free, -free, products(x, power)])
    unit, most = np.max(np.abs(columns), axis=0), max(float(np.max(np.abs(y))), 1e-300)
    try:
        weights = nnls(columns / unit, y / most, maxiter=50 * columns.shape[1])[0] * most / unit
    except RuntimeError:  # it has not converged: no form is found
        return None
    either, weight = weights[:count] - weights[count : 2 * count], weights[2 * count :]
    linear = np.zeros(variables)
    linear[: count - 1] = either[1:]
    used, none = weight != 0.0, np.zeros((variables, variables))
    return Row(kind, coordinates, float(either[0]), linear, weight[used], power[used], none)


def least_value(rows: Sequence[Row], limits: Array, box: tuple[Array, Array], start: Array) -> tuple[float, Array]:
    """A proven lower bound of the first row in the `box` where the others are at most `limits` (rows - 1,), and a
    design (variables,) near which it is least.

    All rows are convex in the same coordinates. Rows are as fitted: their `error` widens the limits and lowers
    the bound. `start` is a design from which to search; the bound is inf where the tangents alone exclude every design.
    """
    logs = rows[0].coordinates == LOG
    low, high = (np.log(end) if logs else end for end in box)
    roots = np.array([row.root for row in rows[1:]], dtype=bool)
    if np.any(roots & (limits < 0.0)):
        return np.inf, start
    most = np.where(roots, limits**2, limits) + np.array([row.error for row in rows[1:]])

    def values(z: Array) -> Array:
        x = np.exp(z) if logs else z
        return np.array([row.value(x[None])[0] for row in rows])

    def slopes(z: Array) -> Array:
        x = np.exp(z) if logs else z
        return np.array([row.slope(x[None])[0] for row in rows]) * (x if logs else 1.0)

    first = np.clip(np.log(start) if logs else start, low, high)
    unit = max(1.0, abs(float(values(first)[0])))
    found = slsqp(
        lambda z: float(values(z)[0] / unit),
        lambda z: slopes(z)[0] / unit,
        lambda z: most - values(z)[1:],
        lambda z: -slopes(z)[1:],
        first,
        (low, high),
        1e-14,
        300,
    )
    points, best = [first, found.x], -np.inf
    for _ in range(ROUNDS):
        bound, at = _by_tangents([values(z) for z in points], [slopes(z) for z in points], points, most, low, high)
        best = max(best, bound)
        if at is None or float(values(at)[0]) - best <= CLOSED * max(1.0, abs(best)):
            break
        points.append(at)
    least = np.exp(found.x) if logs else found.x
    best -= rows[0].error + ROUNDING * abs(best) if np.isfinite(best) else 0.0
    return float(np.sqrt(max(best, 0.0))) if rows[0].root and np.isfinite(best) else best, least


def _by_tangents(
    values: Sequence[Array], slopes: Sequence[Array], points: Sequence[Array], most: Array, low: Array, high: Array
) -> tuple[float, Array | None]:
    """The bound by tangents of rows at n points, and where these are least; None where nothing keeps them."""
    slope = np.array(slopes)
    a = np.concatenate([slope, np.zeros((*slope.shape[:2], 1))], axis=2)
    a[:, 0, -1] = -1.0
    b = (np.einsum("nrj,nj->nr", slope, np.array(points)) - values + np.array([0.0, *most])).ravel()
    rate, a = slope.reshape(len(b), -1), a.reshape(len(b), -1)
    scale = np.maximum(np.max(np.abs(a), axis=1), 1e-12)
    bounds = [*zip(low, high, strict=True), (None, None)]
    found = linprog(np.eye(a.shape[1])[-1], a / scale[:, None], b / scale, bounds=bounds, method="highs")
    if found.status == 2:
        return np.inf, None
    if found.status != 0 or found.x is None:
        return -np.inf, None
    multipliers = np.maximum(-np.asarray(found.ineqlin.marginals) / scale, 0.0)
    total = float(-multipliers @ a[:, -1])
    if total <= 0.0:
        return -np.inf, None
    multipliers = multipliers / total
    rate = multipliers @ rate
    bound = float(-multipliers @ b + np.sum(np.minimum(rate * low, rate * high)))
    return bound, np.clip(found.x[:-1], low, high)
