"""Recipes against closed forms, scipy and bootstrap."""

import numpy as np
import pytest
from scipy import stats

from tolevo import registry
from tolevo.commands.reproduce.claims import generator
from tolevo.commands.reproduce.recipes import (
    ByCalculation,
    ByFormula,
    ByModel,
    ByProblem,
    Constant,
    Derivative,
    Statistic,
)
from tolevo.models.assembly.model import Assembly
from tolevo.models.expressions import Formula
from tolevo.models.rv_reducer.batch import RvBatch
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Settings
from tolevo.section import Value


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


PRINTED: dict[str, Value] = {"model": "document", "reading": "printed"}


def batch(statistic: Statistic, units: int = 4000) -> ByModel:
    return ByModel(
        "rv_batch", RvBatch, PRINTED, {}, {}, (), {}, ("backlash_arcmin",), statistic, units
    )  # fmt: skip


@pytest.mark.parametrize(
    "statistic",
    [
        Statistic("mean"),
        Statistic("std"),
        Statistic("quantile", 0.9),
        Statistic("fraction_above", 1.0),
        Statistic("fraction_below", 0.6),
    ],
    ids=lambda one: one.name,
)
def test_standard_errors_are_those_of_the_bootstrap(statistic: Statistic) -> None:
    values = rng().gamma(4.0, 0.2, 400)
    again = np.array([statistic.of(rng_.choice(values, 400)) for rng_ in rng().spawn(2000)])
    np.testing.assert_allclose(statistic.error(values), again.std(), rtol=0.2)


def test_share_of_units_is_that_of_the_problem() -> None:
    """The sample against the convolution: another code path."""
    (found,) = batch(Statistic("fraction_below", 1.0)).recomputed(rng()).quantities
    problem = RvBacklash(Settings(parameters={"reading": "printed"}))
    bands = problem.references()["document B"]
    exact = problem.outputs_of(bands[None])["yield_percent"][0] / 100.0
    assert found.unit == "1"
    assert abs(found.value - exact) < 4.0 * found.standard_error
    np.testing.assert_allclose(found.standard_error, np.sqrt(exact * (1 - exact) / 4000), rtol=0.05)


def test_operating_points_are_rows() -> None:
    """Document A's parts without adjustment: F times the errors."""
    at = {f"dtheta_{k}_mrad": (value,) for k, value in enumerate((-1.6, 5.3, 5.8, 3.2), 1)}
    recipe = ByModel("assembly", Assembly, {}, {}, {}, (), at | {"precision_weight": (0.0,)},
                     ("delta_2_mrad", "delta_4_mrad"))  # fmt: skip
    found = recipe.recomputed(rng()).quantities
    np.testing.assert_allclose([one.value for one in found], [3.7, 9.0])
    assert [one.unit for one in found] == ["mrad", "mrad"]
    slope = Derivative(recipe, "dtheta_1_mrad", 0.1).recomputed(rng()).quantities
    np.testing.assert_allclose([one.value for one in slope], [1.0, 0.0], atol=1e-9)
    assert slope[0].unit == "(mrad)/(mrad)"


def test_derivatives_of_a_problem() -> None:
    """Document B: phi_2 falls by 2 per turn of a disc; phi_3 is du/a_0/2 on average."""
    problem = RvBacklash(Settings(parameters={"reading": "printed"}))
    design = tuple(problem.references()["document B"].tolist())
    for output, by, step, wanted in (
        ("phi_2_arcmin", "stagger_arcmin", 0.05, -2.0),
        ("phi_3_arcmin", "crank_bearing_um", 0.5, 0.5e-6 / 0.036 * 60 * 180 / np.pi),
        ("phi_3_arcmin", "centre_distance_mm", 0.01, -1e-6 / 0.036**2 * 1e-3 * 60 * 180 / np.pi),
    ):
        recipe = Derivative(ByProblem("rv_backlash", problem, design, (output,)), by, step)
        (found,) = recipe.recomputed(rng()).quantities
        np.testing.assert_allclose(found.value, wanted, rtol=1e-5)


def test_derivative_of_a_calculation_by_its_parameter() -> None:
    kind = registry.load("calculations", "backlash_stages")
    recipe = Derivative(ByCalculation(kind, (), ("cycloid_mean_arcmin",)), "stagger_arcmin", 0.02)
    (found,) = recipe.recomputed(rng()).quantities
    np.testing.assert_allclose(found.value, -2.0, rtol=1e-9)


def test_both_ends_of_a_derivative_take_the_same_random_numbers() -> None:
    """d mean/d clearance is 1/2 du/a_0 for every unit draw, so that nearly no noise is left."""
    recipe = Derivative(batch(Statistic("mean")), "crank_bearing_um", 0.5)
    (found,) = recipe.recomputed(rng()).quantities
    wanted = 0.5e-6 / 0.036 * 60 * 180 / np.pi
    np.testing.assert_allclose(found.value, wanted, rtol=4.0 / np.sqrt(3 * 4000))


def test_errors_pass_through_a_formula() -> None:
    """Two independent means: the variance of the difference is the sum; gradient of 3 a - b."""
    one = batch(Statistic("mean"))
    formula = ByFormula((Formula("3 * a - b"),), {"a": (one, "arcmin"), "b": (one, "arcmin")}, "arcmin")
    (found,) = formula.recomputed(rng()).quantities
    parts = [one.recomputed(stream).quantities[0] for stream in rng().spawn(2)]
    assert parts[0].value != parts[1].value
    np.testing.assert_allclose(found.value, 3 * parts[0].value - parts[1].value)
    errors = np.array([one.standard_error for one in parts])
    np.testing.assert_allclose(found.standard_error, np.hypot(*(errors * (3.0, 1.0))))


def test_terms_enter_in_their_unit() -> None:
    recipe = ByFormula((Formula("sin(x)"),), {"x": (Constant(30.0, "deg"), "rad")}, "1")
    np.testing.assert_allclose(recipe.recomputed(rng()).quantities[0].value, 0.5)


def test_generator_depends_on_seed_and_id_alone() -> None:
    draws = {(seed, name): generator(seed, name).random() for seed in (0, 1) for name in ("a", "b")}
    assert len(set(draws.values())) == 4
    assert generator(1, "a").random() == draws[1, "a"]
    many = [generator(0, str(at)).random() for at in range(500)]
    assert stats.kstest(many, "uniform").pvalue > 1e-3
