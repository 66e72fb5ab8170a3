"""Optimum and bound against an independent solver: conic programmes by cvxpy and Clarabel.

Each requirement is a second-order cone, |s_1 t_1, ...| <= (limit - m't), each cost a + b/t a
rotated one; processes are enumerated. Nothing of the closed form takes part.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.exact.choices import least_cost
from tolevo.algorithms.exact.front import tightest
from tolevo.models.costs import Reciprocal
from tolevo.problems.forms import Feature, Form, Way

cvxpy: Any = pytest.importorskip("cvxpy", reason="the oracle comes with the extra dev")
CLOSE = 2e-6
"""Relative accuracy of Clarabel's own optimum: 1e-8 in its scaled residuals, with margin."""


def generated(parts: int, requirements: int, ways: int, seed: int) -> tuple[Form, np.ndarray]:
    """A form with linear and spread parts, and limits of which several bind."""
    rng = np.random.default_rng(seed)
    slope = rng.uniform(0.2, 2.0, (requirements, parts))
    slope *= rng.random((requirements, parts)) < 0.6
    slope[rng.integers(requirements, size=parts), np.arange(parts)] += 0.5
    kind = rng.integers(0, 3, requirements)  # worst case, root sum square, both
    features = []
    for j in range(parts):
        fine, own = rng.uniform(0.01, 0.03), []
        for at in range(ways if j < 3 else 1):
            least = fine * 2.0**at
            curve = Reciprocal(a=float(2.0 / (1.0 + at) * rng.uniform(0.8, 1.2)),
                               b=float(least * rng.uniform(0.5, 2.0)))  # fmt: skip
            linear = np.where(kind == 0, 1.0, np.where(kind == 2, 0.2, 0.0)) * slope[:, j]
            spread = np.where(kind == 0, 0.0, 1.0) * slope[:, j]
            own.append(Way(curve, least, 8.0 * least, tuple(linear), tuple(spread), choice=float(at)))
        features.append(Feature(f"t{j}", tuple(own), f"c{j}" if len(own) > 1 else "", 1))
    names = tuple(f"r{i}" for i in range(requirements))
    nothing = np.zeros(requirements)
    form = Form(names, tuple(features), nothing, nothing, "generated")
    low, high = (
        np.array([
            sum(one.linear[i] * one.low * scale for one in first)
            + np.sqrt(sum((one.spread[i] * one.low * scale) ** 2 for one in first))
            for i in range(requirements)
        ])
        for first in [[feature.ways[0] for feature in features]]
        for scale in (1.0, 8.0)
    )  # fmt: skip
    return form, low + rng.uniform(0.1, 0.4, requirements) * (high - low)


def by_cones(form: Form, limit: np.ndarray) -> float:
    """Least cost over all processes."""
    return min(_one(form, ways, limit) for ways in itertools.product(*(f.ways for f in form.features)))


def _one(form: Form, ways: tuple[Way, ...], limit: np.ndarray) -> float:
    low, high = np.array([w.low for w in ways]), np.array([w.high for w in ways])
    share = cvxpy.Variable(len(ways))  # t / high, so that the cones are well scaled
    a, b = (np.array([getattr(w.curve, key) for w in ways]) for key in ("a", "b"))
    kept = [share >= low / high, share <= 1.0]
    for i in range(len(form.outputs)):
        linear = np.array([w.linear[i] for w in ways]) * high / limit[i]
        spread = np.array([w.spread[i] for w in ways]) * high / limit[i]
        kept.append(cvxpy.norm(cvxpy.multiply(spread, share), 2) + linear @ share <= 1.0)
    cost = float(a.sum()) + (b / high) @ cvxpy.inv_pos(share)
    found = cvxpy.Problem(cvxpy.Minimize(cost), kept)
    try:
        found.solve(solver=cvxpy.CLARABEL)
    except cvxpy.error.SolverError:  # at processes that barely miss the limits
        return np.inf
    return float(found.value) if found.status in ("optimal", "optimal_inaccurate") else np.inf


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("parts", "requirements", "ways"), [(8, 3, 1), (20, 8, 1), (5, 3, 2)])
def test_optimum_and_bound_are_those_of_cones(parts: int, requirements: int, ways: int, seed: int) -> None:
    form, limit = generated(parts, requirements, ways, seed)
    oracle = by_cones(form, limit)
    found = least_cost(form, limit[None, :])
    assert found.cost[0] == pytest.approx(oracle, rel=CLOSE)
    assert found.bound[0] <= oracle * (1.0 + CLOSE)
    assert found.bound[0] >= found.cost[0] * (1.0 - 1e-6)


@pytest.mark.parametrize("above", [1e-14, 1e-12, 3e-11, 3e-10, 1e-8])
@pytest.mark.parametrize("seed", range(3))
def test_least_cost_at_a_limit_that_the_tightest_tolerances_alone_keep(seed: int, above: float) -> None:
    """The cones' limit is looser by 1e-6, for Clarabel needs room: their cost falls by as much."""
    form, limit = generated(6, 3, 1, seed)
    least = tightest(form)[seed]
    limit[seed] = least * (1.0 + above)
    optimum = least_cost(form, limit[None, :])
    limit[seed] = least * (1.0 + 1e-6)
    assert optimum.cost[0] == pytest.approx(by_cones(form, limit), rel=2e-5)
    assert optimum.bound[0] <= optimum.cost[0] <= optimum.bound[0] * (1.0 + 1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_least_cost_at_a_limit_with_a_little_room(seed: int) -> None:
    """The tightest tolerances are dearer by 8e-6 or more there."""
    form, limit = generated(6, 3, 1, seed)
    limit[seed] = tightest(form)[seed] * (1.0 + 1e-5)
    optimum = least_cost(form, limit[None, :])
    assert optimum.cost[0] == pytest.approx(by_cones(form, limit), rel=CLOSE)
