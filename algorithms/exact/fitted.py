"""Convex rows fitted to the values of a problem, and least values that they prove.

A row is an objective or a constraint as a function of the design. Its form is fitted at some
designs and compared at others, which the fit has not seen: what agrees there is verified at these
designs, and not between them. A least value follows from tangents of the rows alone: a convex
function lies nowhere below its tangents, so that any multipliers of these give a bound (weak
duality). It hangs neither on how well a solver has converged nor on its last digits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

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
HELD_OUT = 200
"""Designs at which a form is compared that it has not been fitted to."""
ROUNDS, CLOSED = 30, 1e-9
"""Cuts at most, and the relative gap at which no more are added."""
ROUNDING = 1e-11
"""Part of a bound by which it is lowered, more than the rounding of its sums."""
PLAIN, LOG = "x", "log x"
"""Coordinates in which rows are convex."""


@dataclass(frozen=True, eq=False)
class Row:
    """One row as `constant` + sum of `weight` (k,) times products of powers (k, variables), or a quadratic.

    `kind` says which form it is, `coordinates` where it is convex; `error` is the largest deviation
    at the designs held out. Of a `root` these are the values squared.
    """

    kind: str
    coordinates: str
    constant: float
    weight: Array
    power: Array
    quadratic: Array | None = None
    root: bool = False
    error: float = 0.0

    def value(self, x: Array) -> Array:
        """Values (n,) at designs (n, variables)."""
        curved = 0.0 if self.quadratic is None else np.einsum("ni,ij,nj->n", x, self.quadratic, x)
        return np.asarray(self.constant + self._terms(x) @ self.weight + curved)

    def _terms(self, x: Array) -> Array:
        """The products of powers (n, k)."""
        return np.asarray(np.prod(np.where(self.power[None] == 0.0, 1.0, x[:, None, :] ** self.power[None]), axis=2))

    def slope(self, x: Array) -> Array:
        """Derivatives (n, variables) in the design."""
        terms = self._terms(x)
        rates = np.where(self.power[None] == 0.0, 0.0, self.power[None] / np.where(x == 0.0, np.inf, x)[:, None, :])
        linear = self.power.sum(axis=1) == 1.0  # x^1 has its derivative at 0 as well
        lines = linear & (np.count_nonzero(self.power, axis=1) == 1)
        rates[:, lines] = 0.0
        slope = np.einsum("nk,nkj,k->nj", terms, rates, self.weight) + (self.weight[lines] @ self.power[lines])
        return np.asarray(slope if self.quadratic is None else slope + 2.0 * x @ self.quadratic)


def designs_needed(variables: int) -> int:
    """Designs at which values are needed to fit and to compare the rows of a problem."""
    return 2 * _most_terms(variables) + HELD_OUT


def _most_terms(variables: int) -> int:
    quadratic = variables * (variables + 3) // 2 + 1
    posynomial = 1 + variables * len(MONOMIALS) + variables * (variables - 1) // 2 * len(PAIRS)
    return min(MOST_TERMS, max(quadratic, posynomial, variables * (len(POWERS) + 2) + 2))


def fitted(x: Array, y: Array) -> list[Row]:
    """The forms of a row that agree with its values y (n,) at designs x (n, variables), one at most for
    each kind of coordinates; none where no form agrees. The last `HELD_OUT` designs are not fitted.
    """
    known, rest = slice(0, len(x) - HELD_OUT), slice(len(x) - HELD_OUT, None)
    found: list[Row] = []
    positive = bool(np.all(x > 0.0))
    tries: list[Callable[[], Row | None]] = [
        lambda: _quadratic(x[known], y[known], "linear"),
        lambda: _quadratic(x[known], y[known], "convex quadratic"),
    ]
    if positive:
        tries.append(lambda: _separable(x[known], y[known]))
    if np.all(y >= 0.0):
        tries.append(lambda: _quadratic(x[known], y[known] ** 2, "root of a convex quadratic"))
    if positive:
        tries.append(lambda: _posynomial(x[known], y[known]))
    for attempt in tries:
        row = attempt()
        if row is None or row.coordinates in [other.coordinates for other in found]:
            continue
        values = y[rest] ** 2 if row.root else y[rest]
        error = float(np.max(np.abs(row.value(x[rest]) - values)))
        if error <= AGREES * max(float(np.ptp(values)), 1e-9 * float(np.max(np.abs(values)))):
            found.append(replace(row, error=error))
    return found


def _quadratic(x: Array, y: Array, kind: str) -> Row | None:
    """A linear or convex quadratic row by least squares; None where it is not convex, or has too many terms."""
    n, variables = x.shape
    pairs = [] if kind == "linear" else [(i, j) for i in range(variables) for j in range(i, variables)]
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
    if pairs:
        values, vectors = np.linalg.eigh(curved)
        if values[0] < -AGREES * max(float(np.max(np.abs(values))), 1e-300):
            return None
        curved = (vectors * np.maximum(values, 0.0)) @ vectors.T
    curved = curved / np.outer(width, width)
    linear = coefficients[1 : 1 + variables] / width - 2.0 * curved @ centre
    constant = coefficients[0] - (coefficients[1 : 1 + variables] / width) @ centre + centre @ curved @ centre
    return Row(
        kind, PLAIN, float(constant), linear, np.eye(variables), curved if pairs else None, kind.startswith("root")
    )


def _separable(x: Array, y: Array) -> Row | None:
    """A sum of convex powers of single variables, linear terms of either sign."""
    variables = x.shape[1]
    power = np.vstack([np.eye(variables), *(p * np.eye(variables) for p in POWERS)])
    return _nonnegative(x, y, power, "separable", PLAIN, free=variables)


def _posynomial(x: Array, y: Array) -> Row | None:
    """A posynomial and a constant of either sign: convex in the logarithms of the variables."""
    variables = x.shape[1]
    if np.all(y > 0.0):  # a single monomial may have any exponents
        columns = np.column_stack([np.ones(len(x)), np.log(x)])
        exponents = np.linalg.lstsq(columns, np.log(y), rcond=None)[0]
        row = Row("monomial", LOG, 0.0, np.array([np.exp(exponents[0])]), exponents[None, 1:])
        if np.max(np.abs(row.value(x) - y)) <= AGREES * np.ptp(y):
            return row
    units = np.eye(variables)
    single = [p * unit for p in MONOMIALS for unit in units]
    double = [p * units[i] + q * units[j] for i, j in combinations(range(variables), 2) for p, q in PAIRS]
    power = np.array([*single, *double])
    return _nonnegative(x, y, power, "posynomial", LOG, free=0) if len(power) < MOST_TERMS else None


def _nonnegative(x: Array, y: Array, power: Array, kind: str, coordinates: str, free: int) -> Row | None:
    """Weights that are not negative, but for the constant and the first `free` terms."""
    if len(x) < len(power) + free + 2:
        return None
    terms = np.prod(x[:, None, :] ** power[None], axis=2)
    unit = np.max(np.abs(terms), axis=0)
    scaled = terms / unit
    ones = np.ones((len(x), 1))
    columns = np.hstack([ones, -ones, -scaled[:, :free], scaled])
    try:
        weights = nnls(columns, y / max(float(np.max(np.abs(y))), 1e-300), maxiter=50 * columns.shape[1])[0]
    except RuntimeError:  # it has not converged: no form is found
        return None
    weights = weights * max(float(np.max(np.abs(y))), 1e-300)
    weight = weights[2 + free :].copy()
    weight[:free] -= weights[2 : 2 + free]
    used = weight != 0.0
    return Row(kind, coordinates, float(weights[0] - weights[1]), (weight / unit)[used], power[used])


def least_value(rows: Sequence[Row], limits: Array, box: tuple[Array, Array], start: Array) -> float:
    """A proven lower bound of the first row in the `box` where the others are at most `limits` (rows - 1,).

    All rows are convex in the same coordinates. Rows are as fitted: their deviation at designs held
    out widens the limits and lowers the bound. `start` is a design from which to search; inf where the
    tangents alone exclude every design.
    """
    logs = rows[0].coordinates == LOG
    low, high = (np.log(end) if logs else end for end in box)
    roots = np.array([row.root for row in rows[1:]], dtype=bool)
    if np.any(roots & (limits < 0.0)):
        return np.inf
    most = np.where(roots, limits**2, limits) + np.array([row.error for row in rows[1:]])

    known: dict[bytes, tuple[Array, Array]] = {}

    def values(z: Array) -> tuple[Array, Array]:
        """Values (rows,) and slopes (rows, variables) at a point, which the solver asks for four times."""
        if (key := z.tobytes()) not in known:
            known[key] = computed(z)
        return known[key]

    def computed(z: Array) -> tuple[Array, Array]:
        x = np.exp(z) if logs else z
        value = np.array([row.value(x[None])[0] for row in rows])
        slope = np.array([row.slope(x[None])[0] for row in rows]) * (x if logs else 1.0)
        return value, slope

    first = np.clip(np.log(start) if logs else start, low, high)
    unit = max(1.0, abs(float(values(first)[0][0])))
    found = slsqp(
        lambda z: float(values(z)[0][0] / unit),
        lambda z: values(z)[1][0] / unit,
        lambda z: most - values(z)[0][1:],
        lambda z: -values(z)[1][1:],
        first,
        (low, high),
        1e-14,
        300,
    )
    points = [first, found.x]
    best = -np.inf
    for _ in range(ROUNDS):
        bound, at = _by_tangents([values(z) for z in points], np.array(points), most, low, high)
        best = max(best, bound)
        if at is None or float(values(at)[0][0]) - best <= CLOSED * max(1.0, abs(best)):
            break
        points.append(at)
    best -= rows[0].error + ROUNDING * abs(best) if np.isfinite(best) else 0.0
    return float(np.sqrt(max(best, 0.0))) if rows[0].root and np.isfinite(best) else best


def _by_tangents(
    known: Sequence[tuple[Array, Array]], points: Array, most: Array, low: Array, high: Array
) -> tuple[float, Array | None]:
    """The bound by tangents at points (n, variables), and where these are least; None where nothing keeps them."""
    value, slope = np.array([v for v, _ in known]), np.array([s for _, s in known])
    height = value - np.einsum("nrj,nj->nr", slope, points)  # at the origin
    n, rows, variables = slope.shape
    count = rows - 1
    a = np.zeros((n * rows, variables + 1))
    a[:n, :variables], a[:n, variables] = slope[:, 0], -1.0
    b = np.concatenate([-height[:, 0], *(most[r] - height[:, 1 + r] for r in range(count))])
    for r in range(count):
        a[n * (1 + r) : n * (2 + r), :variables] = slope[:, 1 + r]
    scale = np.maximum(np.max(np.abs(a), axis=1), 1e-12)
    bounds = [*zip(low, high, strict=True), (None, None)]
    found = linprog(np.eye(variables + 1)[-1], a / scale[:, None], b / scale, bounds=bounds, method="highs")
    if found.status == 2:
        return np.inf, None
    if found.status != 0 or found.x is None:
        return -np.inf, None
    multipliers = np.maximum(-np.asarray(found.ineqlin.marginals) / scale, 0.0)
    total = float(np.sum(multipliers[:n]))
    if total <= 0.0:
        return -np.inf, None
    multipliers = multipliers / total
    rate = multipliers @ a[:, :variables]
    bound = float(-multipliers @ b + np.sum(np.minimum(rate * low, rate * high)))
    return bound, np.clip(found.x[:variables], low, high)
