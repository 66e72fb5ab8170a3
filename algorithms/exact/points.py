"""Forms of points alone: all choices of ways are computed, and the cheapest feasible choice counts.

Grades, and machines without inspection, have no tolerance to search. Forms of such parts alone have
few choices. Prices of the squares cannot separate them under doubt of their scatter, and limits of a
form that is a bound exclude choices that the full model allows: there that model decides.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Integers
from ...problems.forms import Feature, Form
from ...problems.limits import loosened
from ...problems.tolerance_problem import ToleranceProblem
from .combination import Optimum
from .designs import search_vectors

MOST = 300_000
"""Choices of ways that are computed at most."""
FIRST, BATCH, TESTED = 8, 256, 16_384
"""Choices that the full model computes first, at once, and at most."""
SAME = 1e-12
"""Relative difference of costs that is rounding."""


def points_alone(form: Form) -> bool:
    """Whether all ways of a form are points, and few enough to compute all choices."""
    points = all(way.low == way.high for feature in form.features for way in feature.ways)
    return points and form.combinations <= MOST


def only_points(form: Form) -> bool:
    """Whether a form is of `points_alone`, and of roots: the values of all choices follow from sums."""
    return points_alone(form) and form.joint is None and form.correlation is None


def cheapest_choice(problem: ToleranceProblem, form: Form, upper: Array, floor: float) -> Array | None:
    """The search vector (at most one) of the cheapest choice that keeps the limits by the full model.

    Choices beyond upper limits (r,) of the form, or cheaper than a proven `floor`, are none. Of those
    of one cost the one with most room counts. None where too many would have to be computed.
    """
    cost, values = _every(form)
    by_sums = np.array([quantile is None and form.correlation is None for quantile in form.rows])
    fits = np.all(values[by_sums] <= loosened(upper, 2.0)[by_sums, None], axis=0)
    fits &= cost >= floor - SAME * abs(floor)
    order = np.flatnonzero(fits)
    order = order[np.argsort(cost[order], kind="stable")]
    done, x = 0, np.empty((0, problem.n_var))
    while done < min(len(order), TESTED):
        rows = order[done : done + (BATCH if done else FIRST)]
        last = cost[rows[-1]] * (1.0 + SAME * np.sign(cost[rows[-1]]))
        rows = order[done : max(done + len(rows), int(np.searchsorted(cost[order], last, side="right")))]
        x = search_vectors(problem, form, _chosen(form, rows, cost))
        violations = problem.tested(x)[1].max(axis=1, initial=-np.inf)
        if np.any(kept := violations <= 0.0):
            first = cost[rows[int(np.argmax(kept))]]
            same = kept & (cost[rows] - first <= SAME * abs(first))
            at = int(np.argmin(np.where(same, violations, np.inf)))
            return x[at : at + 1]
        done += len(rows)
    return x[:0] if done >= len(order) else None


def _chosen(form: Form, rows: Integers, cost: Array) -> Optimum:
    """Choices by number as optima; their costs are their own bounds."""
    shape = tuple(len(feature.ways) for feature in form.features)
    ways = np.stack(np.unravel_index(rows, shape), axis=1).astype(np.int64)
    low = [np.array([way.low for way in feature.ways])[ways[:, at]] for at, feature in enumerate(form.features)]
    return Optimum(ways, np.stack(low, axis=1), cost[rows], cost[rows], np.zeros((len(rows), len(form.outputs))))


def least_of_points(form: Form, limits: Array) -> Optimum:
    """The cheapest choice that keeps each set of upper limits (n, r); its cost is its own bound.

    Cost and bound are inf where none keeps them.
    """
    cost, values = _every(form)
    order = np.argsort(cost, kind="stable")
    optimum = Optimum.unknown(form, limits)
    for row, limit in enumerate(limits):
        fits = np.all(values[:, order] <= limit[:, None], axis=0)
        if not np.any(fits):
            continue
        best = _chosen(form, order[[int(np.argmax(fits))]], cost)
        optimum.chosen[row], optimum.t[row] = best.chosen[0], best.t[0]
        optimum.cost[row] = optimum.bound[row] = best.cost[0]
    return optimum


def _every(form: Form) -> tuple[Array, Array]:
    """Cost (m,) and requirements (r, m) of every choice, the last feature changing fastest.

    Those that are no roots of sums mean nothing.
    """
    cost, linear = np.full(1, form.base), form.offset[:, None].copy()
    square = form.constant[:, None].copy()
    for feature in form.features:
        costs, ends, squares = _points(feature, len(form.outputs))
        cost = np.add.outer(cost, costs).ravel()
        linear, square = _outer(linear, ends), _outer(square, squares)
    shape = tuple(len(feature.ways) for feature in form.features)
    ways = np.unravel_index(np.arange(len(cost)), shape)
    for row, surplus in enumerate(form.surpluses):
        if surplus is not None:
            way_squares = [
                _points(feature, len(form.outputs))[2][row, way]
                for feature, way in zip(form.features, ways, strict=True)
            ]
            square[row] += surplus.value(np.stack(way_squares, axis=1))[0]
    return cost, linear + np.sqrt(square)


def _outer(sums: Array, more: Array) -> Array:
    """All sums (r, m w) of the sums (r, m) and the contributions (r, w) of a further feature's ways."""
    return np.asarray((sums[:, :, None] + more[:, None, :]).reshape(len(sums), -1))


def _points(feature: Feature, rows: int) -> tuple[Array, Array, Array]:
    """Cost (w,), linear terms and squares (r, w) of the ways of a feature."""
    t = np.array([way.low for way in feature.ways])
    cost = np.array([float(way.curve.cost(t[at : at + 1])[0]) for at, way in enumerate(feature.ways)])
    linear = np.array([way.linear for way in feature.ways]).T * t
    offset = np.array([way.offset or (0.0,) * rows for way in feature.ways]).T
    square = (np.array([way.spread for way in feature.ways]).T * t) ** 2
    return feature.count * cost, linear + offset, square
