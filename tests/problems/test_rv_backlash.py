"""`rv_backlash` against document B, finite differences and its own contract."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tolevo.errors import ModelError
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, Settings, VariableSetting
from tolevo.testing import ProblemContract


class TestContract(ProblemContract):
    problem_type = RvBacklash


@pytest.fixture(scope="module")
def printed() -> Any:
    problem = RvBacklash(Settings(parameters={"reading": "printed"}))
    return problem.frame(np.stack(list(problem.references().values())))


def test_document_b_allocation(printed: Any) -> None:
    """Physics notes, section 2; 0.0006' are the assumed eccentricity zone of +-1 um."""
    row = printed.iloc[0]
    assert row["phi_2_arcmin"] == pytest.approx(0.015, abs=1.1e-3)
    assert row["modification_backlash_arcmin"] == pytest.approx(0.1095, abs=5e-5)
    assert row["backlash_geometric_mean_arcmin"] == pytest.approx(0.595, abs=1.5e-3)
    assert row["backlash_geometric_std_arcmin"] == pytest.approx(0.333, abs=5e-4)
    assert row["backlash_mean_arcmin"] == pytest.approx(0.701, abs=1e-3)
    assert row["backlash_std_arcmin"] == pytest.approx(0.245, abs=5e-4)
    assert 100.0 - row["yield_percent"] == pytest.approx(11.5, abs=0.06)
    assert row["interference_probability"] == pytest.approx(0.48, abs=5e-3)
    assert row["backlash_arcmin"] == pytest.approx(1.485, abs=3e-3)
    assert row["radial_gap_mm"] == pytest.approx(0.03)


def test_stagger_of_document_b(printed: Any) -> None:
    assert 100.0 - printed["yield_percent"].iloc[1] == pytest.approx(0.64, abs=6e-3)
    np.testing.assert_allclose(printed["phi_2_arcmin"].diff()[1], -0.4, rtol=1e-12)


def test_stage_means_add_up(printed: Any) -> None:
    total = printed[["phi_1_arcmin", "phi_2_arcmin", "phi_3_arcmin"]].sum(axis=1)
    np.testing.assert_allclose(total, printed["backlash_geometric_mean_arcmin"], rtol=1e-12)


def test_gradients_against_finite_differences() -> None:
    problem = RvBacklash()
    rng = np.random.default_rng(5)
    design = problem.complete(rng.uniform(problem.xl, problem.xu, size=(1, problem.n_var)))
    design[0, problem.names.index("involute_grade")] = 6.4
    slopes = problem.gradient(design)
    for at in range(design.shape[1]):
        step = 1e-6 * max(abs(design[0, at]), 1e-3)
        pair = np.repeat(design, 2, axis=0)
        pair[:, at] += [-step, step]
        found = problem.outputs_of(pair, searching=True)
        for name, slope in slopes.items():
            numeric = (found[name][1] - found[name][0]) / (2.0 * step)
            np.testing.assert_allclose(slope[0, at], numeric, rtol=2e-5, atol=1e-7)


def test_costs_fall_with_every_tolerance() -> None:
    problem = RvBacklash()
    low, high = problem._cost_interval
    x = np.random.default_rng(2).uniform(problem.xl, problem.xu, size=(200, problem.n_var))
    cost = problem.outputs_of(problem.complete(x), searching=True)["cost"]
    assert low < cost.min() and cost.max() < high


@pytest.mark.parametrize(
    "output", ["cost", "backlash_arcmin", "backlash_mean_arcmin", "phi_1_arcmin", "yield_percent",
               "radial_gap_mm", "modification_backlash_arcmin", "clearance_min_mm"]
)  # fmt: skip
def test_proven_intervals_hold(output: str) -> None:
    problem = RvBacklash()
    low, high = problem.interval(output)
    x = np.random.default_rng(3).uniform(problem.xl, problem.xu, size=(300, problem.n_var))
    values = problem.outputs_of(problem.complete(x))[output]
    assert np.all(values >= low - 1e-9) and np.all(values <= high + 1e-9)


def test_impossible_limit_is_named_with_the_nearest_miss() -> None:
    problem = RvBacklash(Settings(limits={"backlash_arcmin": Bound(high=0.05)}))
    (fault,) = problem.faults()
    assert fault.place == "limits.backlash_arcmin"
    assert "0.05" in fault.message and "tightest corner" in fault.message


def test_any_variable_can_be_fixed() -> None:
    for name in RvBacklash().names:
        fixed = RvBacklash(Settings(variables={name: VariableSetting(value=5.0)}))
        assert fixed.n_var == len(RvBacklash.declaration.variables) - 1
        designs = fixed.complete(np.atleast_2d(fixed.xl))
        assert fixed.column(designs, name)[0] == 5.0


def test_reversed_bounds_are_refused() -> None:
    with pytest.raises(ModelError, match="below"):
        RvBacklash(Settings(variables={"pitch_um": VariableSetting(low=3.0, high=2.0)}))


def test_missing_interference_limit_is_warned_of() -> None:
    assert "interference" in RvBacklash().warnings()[0]
    limited = Settings(limits={"interference_probability": Bound(high=0.05)})
    assert RvBacklash(limited).warnings() == ()


def test_assumptions_name_what_no_document_prints() -> None:
    names = {a.name for a in RvBacklash().assumptions()}
    assert {"references.eccentricity_um", "parameters.sun_pitch_radius_mm"} <= names
    assert "costs.pin_hole_radius_um" in names
