"""Formulas and declarations of the RV reducer by hand: differences, one part at a time, ranges."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from tolevo.models.rv_reducer import batch as batch_declared
from tolevo.models.rv_reducer import cycloid as clearance_targets
from tolevo.models.rv_reducer import declared
from tolevo.models.rv_reducer.batch import CENTRED, ContactSources, RvBatch, opening
from tolevo.models.rv_reducer.contact.geometry import ContactGeometry
from tolevo.models.rv_reducer.cycloid import LINEAR_ERRORS, EccentricityLaw, coefficients, fit
from tolevo.models.rv_reducer.declared import READINGS
from tolevo.models.rv_reducer.geometry import RvGeometry, mean_square
from tolevo.models.rv_reducer.lost_motion import PARAMETERS, _part_errors
from tolevo.models.rv_reducer.tighter_planet import Stage, TighterPlanet

BY_NAME = {parameter.name: parameter for parameter in declared.PARAMETERS}
DEFAULTS = {parameter.name: float(parameter.default) for parameter in PARAMETERS
            if isinstance(parameter.default, int | float)}  # fmt: skip


def test_mean_square_is_that_of_drawn_units_and_its_slopes_are_differences() -> None:
    """E (F + max(0, phi_2))^2 with F and phi_2 independent; steps of 1e-6 either way."""
    a, w, m, v = (np.array([value]) for value in (0.6, 0.04, -0.2, 0.09))
    rng = np.random.default_rng(0)
    free = 0.6 + 0.2 * rng.normal(size=2_000_000)
    backlash = free + np.maximum(0.0, -0.2 + 0.3 * rng.normal(size=2_000_000))
    exact = mean_square(a, w, m, v)
    error = np.std(backlash**2) / np.sqrt(2_000_000)
    assert abs(exact.value[0] - np.mean(backlash**2)) < 5.0 * error
    h = 1e-6
    for slope, low, high in (
        (exact.by_free, (a - h, w, m, v), (a + h, w, m, v)),
        (exact.by_mean, (a, w, m - h, v), (a, w, m + h, v)),
        (exact.by_variance, (a, w, m, v - h), (a, w, m, v + h)),
    ):
        difference = (mean_square(*high).value - mean_square(*low).value) / (2.0 * h)
        np.testing.assert_allclose(slope, difference, rtol=1e-8)


def test_lower_bound_without_an_eccentricity_is_that_of_the_linear_errors() -> None:
    """The worse end of each zone, over the lever; no parabola is added."""
    stage = Stage(offset=1e-4)
    bounds = dict.fromkeys(LINEAR_ERRORS, (-1e-06, 3e-06))
    factors = coefficients(stage.geometry)
    worst = sum(min(-1e-6 * factors[name], 3e-6 * factors[name]) for name in LINEAR_ERRORS)
    expected = 1e-4 + worst / stage.geometry.lever
    assert stage.lower_bound(bounds) == pytest.approx(expected, rel=1e-12)


def test_lower_bound_of_a_flat_parabola_is_at_its_vertex() -> None:
    """A law of 0.5 x^2 - x on [0, 3] is least at x = 1, where it is -0.5."""
    stage = Stage(law=EccentricityLaw(linear=-1.0, quadratic=0.5, factor=1.0))
    bound = stage.lower_bound({"eccentricity": (0.0, 3.0)})
    assert bound == pytest.approx(-0.5 / stage.geometry.lever, rel=1e-12)


def test_an_error_of_one_eccentric_is_that_of_the_first_crank() -> None:
    geometry = ContactGeometry()
    parameters = DEFAULTS | {"eccentric_phase_1_mrad": 2.0, "eccentricity_2_um": 3.0}
    errors = _part_errors(parameters, geometry)
    phase, eccentricity = np.zeros((2, 1, geometry.cranks, 2))
    phase[0, 0, 0], eccentricity[0, 0, 1] = 2e-3, 3e-6
    np.testing.assert_allclose(errors.crank_phase, phase, rtol=1e-12)
    np.testing.assert_allclose(errors.eccentricity, eccentricity, rtol=1e-12)


def test_the_offset_of_a_disc_is_half_its_runout() -> None:
    errors = _part_errors(DEFAULTS | {"disc_runout_um": 8.0}, ContactGeometry())
    np.testing.assert_allclose(errors.disc_offset, 4e-6, rtol=1e-12)


def test_angles_of_no_weight_do_not_count_in_a_fit() -> None:
    """A clearance of a metre that is wanted where nothing is weighed changes no fit."""
    geometry = RvGeometry()
    phi = clearance_targets.angles(60)
    weight = np.where(phi < 2.0, 1.0, 0.0)
    wanted = np.full(len(phi), 20e-6)
    plain = clearance_targets.Target(phi, wanted, weight)
    absurd = clearance_targets.Target(phi, np.where(weight > 0.0, wanted, 1.0), weight)
    first, second = fit(geometry, plain, None), fit(geometry, absurd, None)
    assert (first.dr_rp, first.dr_p) == (second.dr_rp, second.dr_p)
    assert first.deviation == second.deviation


def test_slopes_of_symmetric_errors_are_nothing() -> None:
    """Errors with equal chances in all directions move no mean, whatever a sample says of them."""
    model = RvBatch()
    assert model.contact is not None
    sources = ContactSources(model.contact).sources().inputs
    for source in sources:
        error = source.name.removesuffix("_um").removesuffix("_mrad")
        assert (source.per_unit == 0.0) == (error in CENTRED or error == "pin_position"), error


def test_a_reducer_without_an_involute_stage_has_no_clearance_of_it() -> None:
    """phi_1 is 0: its clearance has no zone, and no effect."""
    model = RvBatch({"involute_stage": False})
    assert model.contact is not None
    flank = ContactSources(model.contact).sources().inputs[-1]
    assert (flank.name, flank.tolerance, flank.per_unit) == ("flank_clearance_um", 0.0, 0.0)


def test_what_does_not_change_opens_nothing() -> None:
    """No change of an error or a temperature is a change of zero."""
    model = RvBatch({"model": "document"})
    assert opening(model.model, {}) == 0.0
    disc_alone = opening(model.model, {"disc_temperature_K": np.array([1.0])})
    both = opening(model.model, {"disc_temperature_K": np.array([1.0]), "housing_temperature_K": np.zeros(1)})
    np.testing.assert_array_equal(disc_alone, both)


def test_repeats_of_a_unit_share_its_errors() -> None:
    """Rows are independent of each other only where none repeats a unit."""
    model = RvBatch({"model": "document"})
    assert model.row_by_row(["unit"])
    assert not model.row_by_row(["unit", "repeat"])


def test_the_zone_of_the_eccentricity_alone_is_assumed() -> None:
    """The document prints the zones of all other errors; its own law holds within a range."""
    mids = [p for name, p in BY_NAME.items() if name.endswith("_mid_um")]
    assert [p.name for p in mids if p.assumed] == ["eccentricity_mid_um"]
    assert {p.source for p in mids if not p.assumed} == {"document B"}
    eccentricity = BY_NAME["eccentricity_mid_um"]
    assert eccentricity.source == "the document prints no zone for the eccentricity"
    variable = next(v for v in declared.VARIABLES if v.name == "eccentricity_um")
    assert eccentricity.high == -eccentricity.low == variable.valid_high
    assert variable.document == 1.0  # document B's allocations


def test_pins_are_one_more_than_the_teeth_at_both_ends_of_their_ranges() -> None:
    teeth, pins = BY_NAME["cycloid_teeth"], BY_NAME["pins"]
    assert (pins.low - teeth.low, pins.high - teeth.high) == (1, 1)


def test_fractions_of_a_variance_are_assumed_and_from_nothing_to_all() -> None:
    fractions = [p for p in batch_declared._OF_BATCHES if "fraction of the variance" in p.meaning]
    fractions += [p for p in READINGS if p.name == "planet_share"]
    assert len(fractions) >= 2
    assert all((p.low, p.high, p.assumed) == (0.0, 1.0, True) for p in fractions)


def test_planets_are_as_many_as_their_distribution_is_accurate_for() -> None:
    """Its docstring promises 3e-10 for twelve."""
    range_ = next(f.metadata for f in fields(TighterPlanet) if f.name == "planets")
    planets = next(p for p in READINGS if p.name == "planets")
    assert (range_["low"], range_["high"]) == (planets.low, planets.high) == (1, 12)
