"""The convex form of the geometric backlash, against designs that keep all limits."""

from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from scipy import optimize

from tolevo.algorithms.exact.bounds import proof
from tolevo.models.inputs import Normal
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, PropagationSetting, Settings, VariableSetting

OBJECTIVES = ("cost", "backlash_geometric_arcmin")
MOMENTS = PropagationSetting(method="moments")

minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only


def problem_of(**kwargs: object) -> RvBacklash:
    return RvBacklash(Settings(objectives=OBJECTIVES, propagation=MOMENTS, **kwargs))  # type: ignore[arg-type]


def feasible(problem: RvBacklash, count: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Designs near the zero-backlash pair of modifications that keep all limits."""
    rng = np.random.default_rng(0)
    x = rng.uniform(problem.xl, problem.xu, (count, problem.n_var))
    for name, low, high in (("dr_rp_mm", -0.041, -0.039), ("dr_p_mm", -0.073, -0.0705)):
        x[:, [v.name for v in problem.free].index(name)] = rng.uniform(low, high, count)
    designs = problem.complete(x)
    found = problem.outputs_of(designs)
    kept = np.all(problem.violations(designs, found) <= 0.0, axis=1)
    return designs[kept], {name: value[kept] for name, value in found.items()}


NORMAL = {"pin_radius_um": VariableSetting(distribution=Normal(cp=1.0, shift=0.4))}
FIXED = {"involute_grade": VariableSetting(value=6.0), "eccentricity_um": VariableSetting(value=1.0)}


@pytest.mark.parametrize("variables", [{}, NORMAL, FIXED], ids=["uniform", "shifted", "fixed"])
def test_no_admissible_design_costs_less_than_its_bound(variables: dict[str, VariableSetting]) -> None:
    problem = problem_of(variables=variables)
    designs, values = feasible(problem, 400)
    assert len(designs) > 50
    found = proof(problem, values, len(designs))
    assert np.all(np.isfinite(found.bound))
    assert np.all(found.bound <= values["cost"])


def local_optimum(problem: RvBacklash, grade: int, limit: float) -> float:
    """Least cost by SLSQP on the model's own values and gradients, in the log of tolerances."""
    names = [v.name for v in problem.free]
    start = problem.complete(np.atleast_2d(problem.xl))[0]
    settled = {"dr_rp_mm": -0.041935, "dr_p_mm": -0.07194, "stagger_arcmin": 0.4}
    for name, fixed in (settled | {"involute_grade": float(grade)}).items():
        start[names.index(name)] = fixed
    moving = [names.index(v.name) for v in problem.free if v.tolerance and not v.integer]

    def whole(y: np.ndarray) -> np.ndarray:
        design = start.copy()
        design[moving] = np.exp(y)
        return np.asarray(design[None, :])

    def value(y: np.ndarray, name: str) -> float:
        return float(problem.outputs_of(whole(y))[name][0])

    def slope(y: np.ndarray, name: str) -> np.ndarray:
        design = whole(y)
        return np.asarray((problem.gradient(design)[name] * design)[0, moving])

    found = minimize(
        value,
        np.log(start[moving] * 1.5),
        args=("cost",),
        jac=slope,
        bounds=np.log(np.stack([problem.xl[moving], problem.xu[moving]], axis=1)),
        constraints=[{
            "type": "ineq",
            "fun": lambda y: limit - value(y, OBJECTIVES[1]),
            "jac": lambda y: -slope(y, OBJECTIVES[1]),
        }],
        method="SLSQP",
        options={"maxiter": 300, "ftol": 1e-9},
    )  # fmt: skip
    return float(found.fun) if found.success else np.inf


def test_bound_is_nearly_met_by_local_searches_of_every_grade() -> None:
    problem, limit = problem_of(), 0.8
    best = min(local_optimum(problem, grade, limit) for grade in range(4, 9))
    values = {"cost": np.array([best]), OBJECTIVES[1]: np.array([limit])}
    bound = proof(problem, values, 1).bound[0]
    assert bound <= best
    np.testing.assert_allclose(bound, best, rtol=5e-3)


def test_what_is_left_out_is_named() -> None:
    limited = problem_of(limits={"interference_probability": Bound(high=0.05)})
    form = limited.form()
    assert form is not None
    assert form.relaxed == ("interference_probability",)
    assert "interference_probability" in form.statement


def test_nothing_is_proven_of_the_mean_of_the_effective_backlash() -> None:
    objectives = ("cost", "backlash_mean_arcmin")
    problem = RvBacklash(Settings(objectives=objectives, propagation=MOMENTS))
    values = {"cost": np.array([9.0]), "backlash_mean_arcmin": np.array([1.0])}
    found = proof(problem, values, 1)
    assert np.isnan(found.bound[0])
    assert "backlash_mean_arcmin" in found.statement


def test_below_half_coverage_the_form_is_not_convex() -> None:
    assert RvBacklash(Settings(propagation=PropagationSetting(coverage=0.4))).form() is None


def test_geometric_backlash_is_mean_and_normal_quantile() -> None:
    problem = problem_of()
    _, values = feasible(problem, 20)
    k = NormalDist().inv_cdf(0.9973)
    expected = values["backlash_geometric_mean_arcmin"] + k * values["backlash_geometric_std_arcmin"]
    np.testing.assert_allclose(values["backlash_geometric_arcmin"], expected, rtol=1e-9)
