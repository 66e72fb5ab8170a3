"""Least costs in conditions against a model of the reducer that shares no code with the package (`contact_apart`).

The note on conditions has +122 % of cost where interference is kept 5 K warm. By the model here a design of +104 %
keeps both limits and the conditions of an optimum. There 0.01' of backlash cost 1.6, 12 % of the cost at 20 degC: a
sample of 1,024 units, as the note's, knows backlash to 0.007', and the note's 0.75 um/K (64 mm and 11.5e-6/K make
0.736) are worth 0.005'.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.optimize import nnls

from tests.models.contact_apart import COSTS, ERRORS, GROWTH_PER_K, Array, Reducer
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read
from tolevo.problems.tolerance_problem import ToleranceProblem

COLD = np.array([1.277, 2.4615, 2.0418, 0.8476, 5.1085, 2.7523, 2.5183, 0.6928, 0.9364, 2.0951, -36.7, -66.7])
WARM = np.array([0.4919, 0.8589, 0.703, 0.3167, 1.9766, 1.2346, 1.3281, 0.2746, 0.3788, 0.7012, -40.6, -75.1])
"""Half-widths of `ERRORS`, dr_rp and dr_p [um] of the least costs at 1 arcmin and 5 % at 20 degC, and with interference
5 K warm, as searched on 8,192 units in ranges from 0.05 to 40 um, phi_1 = j_n/(i r_1).
"""
ROWS = {0.0: COLD, 5.0: WARM}


def problem_of(warmer: float, **parameters: object) -> ToleranceProblem:
    """The product's problem at grade 4; interference is kept by discs that are warmer by so many kelvin."""
    ranges = {"involute_grade": {"value": 4}, "stagger_arcmin": {"value": 0.0}, "dr_rp_mm": {"low": -0.09, "high": 0.0},
              "dr_p_mm": {"low": -0.14, "high": 0.0}}  # fmt: skip
    wide = {f"{name}_um": {"low": 0.05, "high": 10.0 if name == "eccentricity" else 40.0} for name in ERRORS}
    given = {"elastic_units": 16, "te_positions": 31, "involute_cosine": False, **parameters}
    backlash, interference = {"backlash_max_arcmin": 1.0}, {"interference_probability": 0.05}
    both = [{"name": "cold", "limits": backlash}, {"name": "warm", "temperature_difference_K": warmer,
                                                   "limits": interference}]  # fmt: skip
    table = {"problem": "rv_reducer", "seed": 1, "objectives": {"minimise": ["cost"]}, "variables": ranges | wide,
             "parameters": given}  # fmt: skip
    table |= {"condition": both} if warmer else {"limits": backlash | interference}
    problem = read(table).problem
    assert problem is not None
    return problem


def cost(design: Array) -> float:
    b, k = np.array(list(COSTS.values())).T
    return float(3.2 + 0.1 * len(b) + np.sum(b * design[: len(b)] ** -k))


def of_sample(reducer: Reducer, design: Array, warmer: float) -> tuple[Array, Array]:
    """Backlash at 20 degC and interference `warmer`, and their derivatives by ln t and 10 um of modification."""
    cold = reducer.turn(design)
    hot = reducer.turn(design, -GROWTH_PER_K * warmer) if warmer else cold
    values = reducer.quantile(cold), reducer.interfering(hot, float(design[0]))
    scale = np.append(design[: len(ERRORS)], [10.0, 10.0])
    return np.array([value for value, _ in values]), np.stack([slope for _, slope in values]) * scale


@pytest.mark.parametrize(
    ("errors", "change"),
    [({"pin_circle_radius": 1.0}, 0.0767), ({"pin_radius": 1.0}, -0.1313), ({"equidistance": 1.0}, 0.1313),
     ({"shift": 1.0}, -0.0767), ({"pin_position": 5.0}, 0.0), ({"eccentricity": 5.0}, -0.0388),
     ({"crank_bearing": 3.0}, 0.1847)],
)  # fmt: skip
def test_the_model_has_the_figures_of_the_note(errors: Mapping[str, float], change: float) -> None:
    """Section 7 of the note on allocation: changes of the mean over the turn, 1021 positions."""
    reducer, nominal = Reducer(units=2, positions=1021), np.append(np.ones(len(ERRORS)), [-40.0, -70.0])
    still = {"crank_bearing": -1.0}
    reducer.z = {name: np.zeros_like(z) + still.get(name, 0.0) for name, z in reducer.z.items()}
    for name, amount in errors.items():
        reducer.z[name][..., 1] = amount
    reducer.mids = {}
    means = reducer.turn(nominal).y.mean(axis=0)
    assert means[0] == pytest.approx(0.1118, abs=5e-5)
    assert means[1] - means[0] == pytest.approx(change, abs=5e-5)


def test_derivatives_of_the_model_are_those_of_differences() -> None:
    reducer, scale = Reducer(units=256), np.append(COLD[: len(ERRORS)], [10.0, 10.0])
    _, slopes = of_sample(reducer, COLD, 0.0)
    for at in range(len(COLD)):
        step = np.eye(len(COLD))[at] * 1e-3 * scale
        ends = [of_sample(reducer, COLD + side * step, 0.0)[0] for side in (1.0, -1.0)]
        np.testing.assert_allclose(slopes[:, at], (ends[0] - ends[1]) / 2e-3, rtol=0.01, atol=2e-3)


@pytest.mark.parametrize("warmer", [0.0, 5.0])
def test_least_costs_keep_their_limits_and_the_conditions_of_an_optimum_apart(warmer: float) -> None:
    """On 4,096 units: backlash is known to 0.003 arcmin; the slopes, from some 40 units, to a tenth.

    A design of +122 % is no least cost, as this one keeps both limits.
    """
    design = ROWS[warmer]
    values, slopes = of_sample(Reducer(units=4096, seed=12), design, warmer)
    assert values[0] == pytest.approx(1.0, abs=0.006)
    assert values[1] == pytest.approx(0.05, abs=0.002)
    b, k = np.array(list(COSTS.values())).T
    saved = np.append(k * b * design[: len(b)] ** -k, [0.0, 0.0])
    prices, off = nnls(slopes.T, saved)
    assert off < 0.15 * np.linalg.norm(saved)
    rises = 100.0 * (cost(design) / cost(COLD) - 1.0)
    assert rises == pytest.approx(104.3 if warmer else 0.0, abs=0.5)
    if warmer:
        by_rate = prices[0] * 0.0767 * (0.75 - 0.736) * warmer  # at 0.0767 arcmin/um
        by_sample = prices[0] * 0.0066  # standard deviation of 1,024 units, as the note says
        assert 100.0 * by_rate / cost(COLD) == pytest.approx(6.2, abs=0.6)
        assert 100.0 * by_sample / cost(COLD) == pytest.approx(7.7, abs=0.7)
        assert 122.0 - rises < 100.0 * (by_rate + 2.0 * by_sample) / cost(COLD)


@pytest.mark.parametrize("warmer", [0.0, 5.0])
def test_the_product_sees_the_same(warmer: float) -> None:
    problem = problem_of(warmer, search_units=4096, report_units=4096)
    row = dict(zip([*(f"{name}_um" for name in ERRORS), "dr_rp_mm", "dr_p_mm"], ROWS[warmer], strict=True))
    row |= {name: 1e-3 * row[name] for name in ("dr_rp_mm", "dr_p_mm")}
    known = {**problem.fixed, **row}
    found = problem.outputs_of(np.array([[known[name] for name in problem.names]]), searching=True)
    values, _ = of_sample(Reducer(units=4096, seed=12), ROWS[warmer], warmer)
    of = ("cold.", "warm.") if warmer else ("", "")
    assert found["cost"][0] == pytest.approx(cost(ROWS[warmer]), rel=1e-6)
    error = 0.0026 if warmer else 0.006  # that a run reports for 4,096 units
    assert found[f"{of[0]}backlash_max_arcmin"][0] == pytest.approx(values[0], abs=3.0 * np.sqrt(2.0) * error)
    assert found[f"{of[1]}interference_probability"][0] == pytest.approx(values[1], abs=0.002)


@pytest.mark.slow
@pytest.mark.parametrize("warmer", [0.0, 5.0])
def test_least_costs_searched_anew(warmer: float) -> None:
    """By the product on 8,192 units, and by SLSQP of the model here on 1,024 from the design of 20 degC.

    At 5 K these 1,024 units are worth +-4 % of the cost.
    """
    problem = problem_of(warmer, search_units=8192, report_units=8192)
    found = float(problem.cost_of(problem.complete(search(problem, Exact(), Budget(), 1).chosen))[0])
    assert found == pytest.approx(cost(ROWS[warmer]), rel=0.01)
    apart, _ = Reducer(units=1024, seed=1).least_cost(warmer, start=COLD)
    assert apart == pytest.approx(found, rel=0.02 if warmer == 0.0 else 0.06)
