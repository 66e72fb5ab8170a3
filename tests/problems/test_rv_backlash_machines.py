"""Tolerances of an RV reducer that machines make: propagation, derivatives, proofs, faults."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read_table
from tolevo.errors import InputError
from tolevo.problems.rv_backlash.problem import RvBacklash

PINS = [
    {"name": "grinder", "sigma": 0.8, "price": 0.3, "inspection": {"price": 0.05, "u": 0.05}},
    {"name": "fine", "sigma": 0.35, "mean": 0.1, "price": 0.8, "inspection": {"price": 0.05}},
]
CRANKS = [{"name": "cranks", "sigma": 0.6, "price": 0.7, "inspection": {"price": 0.1}}]

OFF_CENTRE = [CRANKS[0] | {"mean": 0.8}, CRANKS[0] | {"name": "others", "mean": -0.4}]


def table(backlash: str = "backlash_geometric_arcmin", **variables: Any) -> dict[str, Any]:
    """The reducer with machines for its pins."""
    return {
        "problem": "rv_backlash",
        "objectives": {"minimise": ["cost", backlash]},
        "variables": {"pin_radius_um": {"machine": PINS}} | variables,
    }


def reducer(given: dict[str, Any]) -> RvBacklash:
    problem = read_table(given, []).problem
    assert isinstance(problem, RvBacklash)
    return problem


def designs_of(problem: RvBacklash, count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return problem.complete(rng.uniform(problem.xl, problem.xu, (count, problem.n_var)))


def test_good_parts_enter_as_normal_ones_with_their_own_mean_and_scatter() -> None:
    """The same reducer with the half-width, law and mid-limit stated by hand."""
    problem = reducer(table())
    designs = designs_of(problem, 3)
    at = problem.names.index("pin_radius_um")
    for row, (way, t) in enumerate(((0, 2.4), (1, 1.5), (3, 0.6))):
        designs[row, at], designs[row, problem.names.index("pin_radius_process")] = t, way
    found = problem.outputs_of(designs)
    mid = problem.settings.variables["pin_radius_um"].mid or 0.0
    for row, way in enumerate((0, 1, 3)):
        good = problem.machined_tolerances["pin_radius_um"].ways[way].machine.good_parts(designs[row : row + 1, at])
        own = {"value": float(3.0 * good.std[0]), "mid": mid + float(good.mean[0]),
               "distribution": "normal"}  # fmt: skip
        plain = reducer(table() | {"variables": {"pin_radius_um": own}})
        same = designs[row : row + 1, : len(plain.names)].copy()
        same[:, at] = own["value"]
        expected = plain.outputs_of(same)
        for name in ("backlash_arcmin", "backlash_std_arcmin", "phi_2_arcmin", "yield_percent",
                     "interference_probability", "backlash_geometric_arcmin"):  # fmt: skip
            np.testing.assert_allclose(found[name][row], expected[name][0], rtol=1e-6, atol=1e-9)
        curve = plain.settings.costs["pin_radius_um"].cost(same[:, at])[0]
        cost = expected["cost"][0] - curve + good.cost[0]
        np.testing.assert_allclose(found["cost"][row], cost, rtol=1e-12)


@pytest.mark.parametrize("name", ["eccentricity_um", "pitch_um"])
def test_means_enter_as_mid_limits_do(name: str) -> None:
    """The mean of the pitch turns all teeth alike: no unit's backlash moves."""
    machines: dict[str, Any] = {name: {"machine": OFF_CENTRE}}
    problem = reducer(table(**machines))
    design = designs_of(problem, 1)
    at, way = (problem.names.index(name), problem.names.index(problem.machined_tolerances[name].choice))
    design[:, [at, way]] = 1.1, 1.0
    good = problem.machined_tolerances[name].ways[1].machine.good_parts(np.array([1.1]))
    assert good.mean[0] > 0.1
    mid = (problem.settings.variables[name].mid or 0.0) + float(good.mean[0])
    own = {"value": float(3.0 * good.std[0]), "mid": mid, "distribution": "normal"}
    stated: dict[str, Any] = {name: own}
    plain = reducer(table(**stated))
    same = np.delete(design, way, axis=1)
    same[:, at] = own["value"]
    found, expected = problem.outputs_of(design), plain.outputs_of(same)
    for output in ("backlash_arcmin", "backlash_geometric_arcmin", "phi_2_arcmin"):
        np.testing.assert_allclose(found[output], expected[output], rtol=1e-9)


def test_derivatives_are_those_of_differences() -> None:
    problem = reducer(table(eccentricity_um={"machine": OFF_CENTRE}, pitch_um={"machine": PINS}))
    designs = designs_of(problem, 6)
    slopes = problem.gradient(designs)
    for name in problem.machined_tolerances:
        at, step = problem.names.index(name), 1e-5
        up, down = designs.copy(), designs.copy()
        up[:, at] += step
        down[:, at] -= step
        ends = problem.outputs_of(up, errors=False), problem.outputs_of(down, errors=False)
        for output, slope in slopes.items():
            difference = (ends[0][output] - ends[1][output]) / (2.0 * step)
            np.testing.assert_allclose(slope[:, at], difference, atol=1e-7)


def test_front_of_the_geometric_backlash_is_proven() -> None:
    problem = reducer(table(eccentricity_um={"machine": OFF_CENTRE}))
    found = search(problem, Exact(points=3), Budget(), 1)
    designs = problem.complete(found.x)
    values = problem.outputs_of(designs, errors=False)
    kept = np.all(problem.violations(designs, values) <= 0.0, axis=1)
    own = {name: values[name][kept] for name in problem.objectives}
    assert np.sum(kept) >= 2
    assert np.max(proof(problem, own, int(np.sum(kept))).gap_percent(own["cost"])) < 0.2


@pytest.mark.parametrize("output", ["backlash_geometric_arcmin", "backlash_arcmin"])
def test_no_design_costs_less_than_its_bound(output: str) -> None:
    cranks: dict[str, Any] = {"eccentricity_um": {"machine": OFF_CENTRE}} if "geometric" in output else {}
    problem = reducer(table(output, **cranks))
    designs = designs_of(problem, 60)
    values = problem.outputs_of(designs, searching=True)
    kept = np.all(problem.violations(designs, values) <= 0.0, axis=1)
    own = {name: values[name][kept][:3] for name in problem.objectives}
    bound = proof(problem, own, len(own["cost"])).bound
    assert np.all(np.isfinite(bound)) and np.all(bound <= own["cost"])


def test_backlash_with_machines_for_the_eccentricity_is_not_proven_and_said_so() -> None:
    problem = reducer(table("backlash_arcmin", eccentricity_um={"machine": OFF_CENTRE}))
    designs = designs_of(problem, 3)
    values = problem.outputs_of(designs, searching=True)
    own = {name: values[name] for name in problem.objectives}
    assert np.all(np.isnan(proof(problem, own, 3).bound))
    assert "machines" in problem.unproven()


def test_configuration_is_written_as_it_is_read() -> None:
    first = read_table(table(), [])
    again = read_table(dict(first.resolved), [])
    assert again.problem is not None and first.problem is not None
    assert again.resolved == first.resolved
    assert again.problem.settings.machines == first.problem.settings.machines


def test_every_fault_is_named_with_its_place() -> None:
    given = table(
        crank_bearing_um={"machine": PINS},
        runout_um={"machine": [{"name": "a", "sigma": -1.0}], "distribution": "uniform"},
        pitch_um={"machine": CRANKS, "value": 4.0},
    )
    given["costs"] = {"pin_radius_um": {"model": "reciprocal", "a": 1.0, "b": 1.0}}
    with pytest.raises(InputError) as caught:
        reducer(given)
    places = {fault.place for fault in caught.value.faults}
    for place in ("variables.crank_bearing_um.machine", "variables.runout_um.machine[0].sigma",
                  "variables.runout_um.machine[0].price",
                  "variables.runout_um.distribution", "variables.pitch_um.value",
                  "costs.pin_radius_um"):  # fmt: skip
        assert place in places, (place, places)
