"""Least backlash of the cycloid errors within bounds, against the model and all corners."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from tolevo.models.propagation.sums import total_cumulants
from tolevo.models.rv_reducer import declared
from tolevo.models.rv_reducer.cycloid import LINEAR_ERRORS, EccentricityLaw, coefficients
from tolevo.models.rv_reducer.tighter_planet import ERRORS, Stage, equal_shares, least_clipped_rotation, least_rotation
from tolevo.units import ARCMIN

UNIT = 2.0 / 0.0507
BOUNDS: dict[str, tuple[float, float]] = {
    error: (-(1.0 + at) * 1e-6, (2.0 + 0.5 * at) * 1e-6) for at, error in enumerate(ERRORS)
}


def by_the_model(errors: dict[str, float]) -> float:
    """phi_2 [rad] of a unit with given errors: zones of no width about them."""
    mids = {name: one * 1e6 for name, one in errors.items()}
    model = declared.backlash_model({"reading": "printed"}, mids, {})
    design = {v.name: np.zeros(1) for v in declared.VARIABLES}
    design |= {"dr_rp_mm": np.array([-0.040]), "dr_p_mm": np.array([-0.070])}
    total = model.total(declared.allocation(design | {"involute_grade": np.array([7.0])}))
    return float(total_cumulants(total.clipped)[0][0])


def stage(offset_arcmin: float = 0.0, quadratic: float = -12.6e3) -> Stage:
    return Stage(law=EccentricityLaw(quadratic=quadratic, factor=2.0), offset=offset_arcmin * ARCMIN)


@pytest.mark.parametrize("seed", range(3))
def test_backlash_is_that_of_the_model(seed: int) -> None:
    rng = np.random.default_rng(seed)
    errors = {name: float(one) for name, one in zip(ERRORS, rng.uniform(-5e-6, 5e-6, 9), strict=True)}
    own = stage(by_the_model(dict.fromkeys(ERRORS, 0.0)) / ARCMIN)
    assert own.backlash(errors) == pytest.approx(by_the_model(errors), rel=1e-9)
    assert own.offset / ARCMIN == pytest.approx(0.1095, abs=1e-4)


@pytest.mark.parametrize("quadratic", [-12.6e3, 12.6e3, 0.0])
def test_least_is_that_of_all_corners_and_a_grid_of_the_parabola(quadratic: float) -> None:
    own = stage(0.1, quadratic)
    found = least_rotation(own, BOUNDS)
    low, high = BOUNDS["eccentricity"]
    d = np.linspace(low, high, 100_001)
    parabola = UNIT * (-0.055 * d + quadratic * d**2)
    gains = coefficients(own.geometry)
    corners = [
        sum(gains[name] * end / 0.0507 for name, end in zip(LINEAR_ERRORS, ends, strict=True))
        for ends in product(*(BOUNDS[name] for name in LINEAR_ERRORS))
    ]
    wanted = 0.1 * ARCMIN + min(corners) + parabola.min()
    assert len(corners) == 256
    assert found.backlash == pytest.approx(wanted, rel=1e-9)
    assert found.bound == pytest.approx(found.backlash, rel=1e-12)
    assert found.errors["eccentricity"] == pytest.approx(d[parabola.argmin()], abs=1e-10)


@pytest.mark.parametrize("quadratic", [-12.6e3, 12.6e3, 3e6])
def test_no_point_of_the_box_is_below_the_bound(quadratic: float) -> None:
    own = stage(0.0, quadratic)
    rng = np.random.default_rng(0)
    ends = np.array([BOUNDS[error] for error in ERRORS])
    points = rng.uniform(ends[:, 0], ends[:, 1], size=(500, 9))
    values = [own.backlash(dict(zip(ERRORS, map(float, one), strict=True))) for one in points]
    assert min(values) > own.lower_bound(BOUNDS)


def test_the_eccentricity_law_is_not_even() -> None:
    """-0.055 d falls with d: of equal ends the upper one adds less; -9 um adds -0.53 um."""
    even: dict[str, tuple[float, float]] = dict.fromkeys(ERRORS, (-4e-6, 4e-6))
    assert least_rotation(stage(), even).errors["eccentricity"] == 4e-6
    assert least_rotation(stage(), even | {"eccentricity": (-9e-6, 4e-6)}).errors["eccentricity"] == -9e-6


def test_clipped_optimum_has_no_backlash_and_no_interference() -> None:
    own = stage(0.3)
    found = least_clipped_rotation(own, BOUNDS)
    assert own.backlash(found.errors) == pytest.approx(0.0, abs=1e-15)
    assert found.bound == 0.0
    for error, (low, high) in BOUNDS.items():
        assert low <= found.errors[error] <= high


def test_clipping_changes_nothing_where_nothing_interferes() -> None:
    own = stage(10.0)
    assert least_clipped_rotation(own, BOUNDS) == least_rotation(own, BOUNDS)
    assert least_rotation(own, BOUNDS).backlash > 0.0


def test_middle_of_the_bounds_where_it_already_interferes() -> None:
    found = least_clipped_rotation(stage(-10.0), BOUNDS)
    assert found.backlash < 0.0
    assert found.errors == {error: sum(ends) / 2.0 for error, ends in BOUNDS.items()}


def test_equal_shares_move_phi_2_alike() -> None:
    own = stage()
    widths = equal_shares(own, 2.0 * ARCMIN)
    moved = [abs(own.contribution(error, width)) for error, width in widths.items()]
    np.testing.assert_allclose(moved, 0.25 * ARCMIN, rtol=1e-12)
