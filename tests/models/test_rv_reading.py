"""The two readings of document B's formula, each against its source and the exact contact."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo.models.inputs import Normal, Uniform
from tolevo.models.rv_reducer import declared
from tolevo.models.rv_reducer.backlash import BacklashModel, stage_means
from tolevo.models.rv_reducer.contact.contact import LoadedContact, backlash
from tolevo.models.rv_reducer.contact.geometry import PartErrors
from tolevo.models.rv_reducer.geometry import InvoluteStage
from tolevo.models.rv_reducer.tighter_planet import TighterOf, TighterPlanet, tighter_planet_law
from tolevo.section import Value
from tolevo.units import ARCMIN, MM, UM

Array = NDArray[np.float64]
PITCH = np.linspace(0.0, 2.0 * np.pi / 40.0, 40, endpoint=False)
CONTACT = LoadedContact(exact=True)
NO_ERRORS = dict.fromkeys(declared.ERRORS, 0.0)


def model(**parameters: Value) -> BacklashModel:
    return declared.backlash_model(parameters, None, {})


def means(found: BacklashModel, **design: float) -> tuple[float, float, float]:
    """Means of phi_1, phi_2 and phi_3 [arcmin] of document B's zones."""
    at = {v.name: float(v.document or 0.0) for v in declared.VARIABLES} | design
    one = {name: np.array([value]) for name, value in at.items()}
    phi = stage_means(found.total(declared.allocation(one)))
    return tuple(float(one[0]) / ARCMIN for one in phi)  # type: ignore[return-value]


def cycloid(**design: float) -> float:
    """phi_2 and the largest phi_3 [arcmin] of a unit: `<error>` [um] is common to all its parts."""
    errors = {name: design.pop(name) for name in list(design) if name in NO_ERRORS}
    own = declared.backlash_model({}, NO_ERRORS | errors, {})
    half = dict.fromkeys((f"{name}_um" for name in NO_ERRORS), 0.0)
    _, phi_2, phi_3 = means(own, **({"crank_bearing_um": 0.0} | half | design))
    return phi_2 + 2.0 * phi_3


def by_contact(errors: PartErrors) -> float:
    """Backlash of the discs [arcmin] at the carrier, mean over a pin pitch."""
    return float(backlash(CONTACT, errors, PITCH).mean()) / ARCMIN


def full(value: float, *shape: int) -> Array:
    return np.full(shape, value)


UNIT_ERRORS = {
    "pin circle": (PartErrors(circle_radius=full(UM, 1)), {"pin_circle_radius": 1.0}),
    "pins": (PartErrors(pin_radius=full(UM, 1, 1, 1)), {"pin_radius": 1.0}),
    "holes": (PartErrors(hole_radius=full(UM, 1, 1, 1)), {"pin_hole_radius": 1.0}),
    "equidistance": (PartErrors(equidistance=full(UM, 1, 1)), {"equidistance": 1.0}),
    "shift": (PartErrors(shift=full(UM, 1, 1)), {"shift": 1.0}),
    "position of all pins": (PartErrors(tangential_position=full(5.0 * UM, 1, 1, 1)), {"pin_position": 5.0}),
    "bearings": (PartErrors(bearing_clearance=full(2.0 * UM, 1, 1, 1)), {"crank_bearing_um": 2.0}),
    "stagger": (PartErrors(angle=0.2 * ARCMIN * np.array([[1.0, -1.0]])), {"stagger_arcmin": 0.2}),
    "eccentricity": (PartErrors(eccentricity=full(5.0 * UM, 1, 1, 1)), {"eccentricity": 5.0}),
    "eccentricity, smaller": (PartErrors(eccentricity=full(-5.0 * UM, 1, 1, 1)), {"eccentricity": -5.0}),
}


@pytest.mark.parametrize("case", UNIT_ERRORS)
def test_consistent_reading_is_the_exact_contact_of_a_common_error(case: str) -> None:
    """Errors that all parts of a unit share, to 0.7 % (the formula is first order) or 0.0005'."""
    errors, design = UNIT_ERRORS[case]
    exact = by_contact(errors) - by_contact(PartErrors())
    assert cycloid(**design) - cycloid() == pytest.approx(exact, rel=7e-3, abs=5e-4)


@pytest.mark.parametrize(
    ("design", "change"),
    [
        ({"pin_circle_radius": 1.0}, 0.0767),
        ({"pin_radius": 1.0}, -0.1313),
        ({"pin_hole_radius": 1.0}, 0.1313),
        ({"equidistance": 1.0}, 0.1313),
        ({"shift": 1.0}, -0.0767),
        ({"pin_position": 5.0}, 0.0),
        ({"pitch": 10.0}, -0.007),
        ({"eccentricity": 5.0}, -0.0388),
        ({"eccentricity": -5.0}, -0.0024),
        ({"crank_bearing_um": 2.0}, 0.1847),
        ({"stagger_arcmin": 0.2}, -0.3868),
    ],
)
def test_figures_of_section_7_of_the_note_on_exact_allocation(design: dict[str, float], change: float) -> None:
    """Changes of the turn mean; the note's stagger of 0.1' is delta', half the turn of a disc."""
    found = cycloid(**design) - cycloid()
    assert found == pytest.approx(change, rel=7e-3, abs=8e-3 if "pitch" in design else 5e-4)


def test_printed_reading_is_that_of_version_0_1() -> None:
    """Means of document B's zones as version 0.1 gave them; 4 delta' = 0.4' of stagger."""
    found = model(reading="printed")
    assert means(found) == pytest.approx((0.484065, 0.014363, 0.095493), abs=5e-7)
    assert means(found, stagger_arcmin=0.2)[1] == pytest.approx(0.014363 - 0.4, abs=5e-7)


def test_each_correction_alone_moves_what_it_says() -> None:
    """From the printed means, by hand; the tighter planet loses E[z] of its half-width."""
    least, most = InvoluteStage().flank_clearance()
    half = 0.5 * (most - least) / (121.0 * 0.009) / ARCMIN
    phi_1, phi_2, phi_3 = means(model(reading="printed"))
    corrected = {
        "eccentricity_factor": (1.0, (phi_1, phi_2 + 67.8 * 12.6e-6 / 3.0, phi_3)),
        "position_mids_count": (False, (phi_1, phi_2 + 0.2755, phi_3)),
        "sun_held": (True, (phi_1, phi_2 * 117 / 121, phi_3 * 117 / 121)),
        "involute_cosine": (True, (phi_1 / np.cos(np.radians(20.0)), phi_2, phi_3)),
        "planets": (2, (phi_1 - 0.23005 * half, phi_2, phi_3)),
    }
    for name, (value, wanted) in corrected.items():
        found = means(model(reading="printed", **{name: value}))
        assert found == pytest.approx(wanted, abs=5e-5), name


def test_given_parameters_override_their_reading() -> None:
    own = model(reading="printed", planets=3, eccentricity_factor=0.5)
    assert own.tighter == TighterPlanet(3, 0.5)
    assert own.eccentricity.factor == 0.5
    assert not own.sun_held and own.position_mids_count and not own.stage.cosine


def test_carrier_turns_117_of_121() -> None:
    """Of the teeth: 1/(1 + (1 + z1/z2)/z_c), z2/z1 = (i - 1)/z_p."""
    assert model().output_factor == pytest.approx(117.0 / 121.0, rel=1e-15)
    other = model(cycloid_teeth=29, pins=30, reduction_ratio=91.0)
    assert other.output_factor == pytest.approx(1.0 / (1.0 + (4.0 / 3.0) / 29.0), rel=1e-15)
    assert model(sun_held=False).output_factor == 1.0


def test_modification_is_what_it_leaves_at_the_carrier() -> None:
    pair = np.array([-0.040 * MM]), np.array([-0.070 * MM])
    zero = np.zeros(1)
    assert model().nominal(*pair, zero)[0] / ARCMIN == pytest.approx(0.10948 * 117 / 121, abs=5e-6)
    printed = model(reading="printed").nominal(*pair, zero)[0]
    assert printed / ARCMIN == pytest.approx(0.10948, abs=5e-6)


def test_tighter_planet_of_another_distribution_is_drawn_alike() -> None:
    """Normal clearances: moments and shares of 200,000 units, within four standard errors."""
    rng, units = np.random.default_rng(1), 200_000
    law = TighterOf(Normal(), TighterPlanet())
    g = rng.standard_normal((3, units))
    z = ((g[0] + g[1:]) / np.sqrt(2.0)).min(axis=0) / 3.0  # Cp 1: three sigma on the half-width
    moments = law.raw_moments(2)
    std = np.sqrt(moments[2] - moments[1] ** 2)
    assert abs(z.mean() - moments[1]) < 4.0 * std / np.sqrt(units)
    assert moments[1] == pytest.approx(-np.sqrt(0.5 / np.pi) / 3.0, rel=1e-9)  # E min of normals
    at = np.linspace(-0.8, 0.8, 17)
    mass, first, _ = law.partial_moments(at)
    assert np.max(np.abs((z[:, None] <= at).mean(axis=0) - mass)) < 2.0 / np.sqrt(units)
    below = (z[:, None] * (z[:, None] <= at)).mean(axis=0)
    assert np.max(np.abs(below - first)) < 4.0 * std / np.sqrt(units)
    median = law.quantile(np.array([0.5]))
    assert law.partial_moments(median)[0] == pytest.approx(0.5, abs=1e-9)


def test_one_planet_keeps_its_distribution() -> None:
    assert tighter_planet_law(Normal(), TighterPlanet(1)) == Normal()
    assert tighter_planet_law(Normal(), TighterPlanet(2, 1.0)) == Normal()
    assert tighter_planet_law(Uniform(), TighterPlanet()) == TighterPlanet()
