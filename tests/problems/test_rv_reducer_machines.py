"""Tolerances of an RV reducer that machines make, by its exact contact."""

from __future__ import annotations

from typing import Any

import numpy as np

from tolevo.configuration.reader import read_table
from tolevo.problems.rv_reducer import RvReducer

PINS = [{"name": "grinder", "sigma": 0.8, "price": 0.3, "inspection": {"price": 0.05}}]


def table(**variables: Any) -> dict[str, Any]:
    return {
        "problem": "rv_reducer",
        "objectives": {"minimise": ["cost", "backlash_max_arcmin"]},
        "limits": {"interference_probability": 0.2},
        "parameters": {"search_units": 64, "report_units": 64, "positions": 11,
                       "search_positions": 11, "elastic_units": 16},
        "variables": variables,
    }  # fmt: skip


def reducer(given: dict[str, Any]) -> RvReducer:
    problem = read_table(given, []).problem
    assert isinstance(problem, RvReducer)
    return problem


OFF = {
    "pin_radius_um": 0.2, "eccentricity_um": -0.3, "pitch_um": 0.5, "runout_um": 0.4,
    "pin_position_um": 0.6, "shift_um": -0.2,
}  # fmt: skip
"""Means of machines off the mid-limits."""


def off_centre(name: str) -> dict[str, Any]:
    return {"machine": [PINS[0] | {"mean": OFF[name]}]}


def test_good_parts_are_units_with_their_scatter_and_mean() -> None:
    """The same reducer with the half-width, law and mid-limit stated by hand."""
    problem = reducer(table(**{name: off_centre(name) for name in OFF}))
    design = problem.starts()[2:3]
    plain: dict[str, Any] = {}
    same, expected_cost = design[:, : len(type(problem).declaration.variables)].copy(), 0.0
    for name, mean in OFF.items():
        at, way = (problem.names.index(name), problem.names.index(problem.machined_tolerances[name].choice))
        design[:, [at, way]] = 1.2, 1.0
        good = problem.machined_tolerances[name].ways[1].machine.good_parts(np.array([1.2]))
        assert abs(good.mean[0]) > 0.2 * abs(mean)
        mid = next(v.mid for v in RvReducer.declaration.variables if v.name == name) or 0.0
        moved = 0.0 if name == "pin_position_um" else float(good.mean[0])
        width = float(3.0 * good.std[0])
        plain[name] = {"value": width, "distribution": "normal", "mid": mid + moved}
        same[:, at] = width
        expected_cost += float(good.cost[0])
    found = problem.needed(design)
    other = reducer(table(**plain))
    expected = other.needed(same)
    for name in ("backlash_max_arcmin", "interference_probability"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-12)
    curves = sum(other.settings.costs[name].cost(same[:, other.names.index(name)]) for name in OFF)
    np.testing.assert_allclose(found["cost"], expected["cost"] - curves + expected_cost)


def test_derivatives_by_limits_are_those_of_differences() -> None:
    """By rises of the limit of 1e-3: kinks of the touching pins leave 1 % of the scatter's part."""
    problem = reducer(table(**{name: off_centre(name) for name in OFF}))
    design = problem.starts()[2:3]
    for name in OFF:
        at, way = (problem.names.index(name), problem.names.index(problem.machined_tolerances[name].choice))
        design[:, [at, way]] = 1.2, 1.0
    slopes = problem.gradient(design)["backlash_max_arcmin"][0]
    for name in OFF:
        at, step = problem.names.index(name), 1e-3
        ends = []
        for side in (step, -step):
            moved = design.copy()
            moved[:, at] += side
            ends.append(problem.outputs_of(moved, searching=True)["backlash_max_arcmin"][0])
        difference = (ends[0] - ends[1]) / (2.0 * step)
        np.testing.assert_allclose(slopes[at], difference, rtol=0.02, atol=2e-4)
