"""Tolerances of an RV reducer that machines make, by its exact contact."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tolevo.configuration.reader import read_table
from tolevo.errors import InputError
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


def test_good_parts_are_units_with_their_scatter() -> None:
    problem = reducer(table(pin_radius_um={"machine": PINS}))
    design = problem.starts()[2:3]
    at, way = problem.names.index("pin_radius_um"), problem.names.index("pin_radius_process")
    design[:, [at, way]] = 1.2, 1.0
    found = problem.needed(design)
    good = problem.made["pin_radius_um"].ways[1].machine.good_parts(np.array([1.2]))
    width = float(3.0 * good.std[0])
    plain = reducer(table(pin_radius_um={"value": width, "distribution": "normal"}))
    same = np.delete(design, way, axis=1)
    same[:, at] = width
    expected = plain.needed(same)
    np.testing.assert_allclose(found["backlash_max_arcmin"], expected["backlash_max_arcmin"])
    curve = plain.settings.costs["pin_radius_um"].cost(same[:, at])
    np.testing.assert_allclose(found["cost"], expected["cost"] - curve + good.cost)
    slope = problem.gradient(design)["backlash_max_arcmin"][0, at]
    other = plain.gradient(same)["backlash_max_arcmin"][0, at]
    np.testing.assert_allclose(slope, other * 3.0 * good.std_slope[0], rtol=1e-9)


def test_machines_off_centre_are_refused() -> None:
    with pytest.raises(InputError, match=r"machine\[0\].mean: must be 0"):
        reducer(table(pin_radius_um={"machine": [PINS[0] | {"mean": 0.2}]}))
