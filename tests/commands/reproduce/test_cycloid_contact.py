"""Sensitivities by exact contact, against document B's formulas and physics section 2."""

import numpy as np
import pytest

from tolevo import registry
from tolevo.commands.reproduce.recipes import Computed

K1 = 1.3 * 40 / 64
RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def found() -> Computed:
    given = {"true_levers": False}  # as in the note
    computed = registry.load("calculations", "cycloid_contact")().compute(given, RNG)
    assert isinstance(computed, Computed)
    return computed


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("pin_circle_radius", 1.169),
        ("pin_hole_radius", 2.00),
        ("pin_radius", -2.002),
        ("equidistance", 2.002),
        ("shift", -1.169),
        ("eccentricity", -0.055),
        ("pin_position_adverse", 2.0 * K1),
        ("crank_bearing", 1.3 * 39 / 36.0),
    ],
)
def test_figures_of_section_2(found: Computed, name: str, wanted: float) -> None:
    assert found.quantities[name].unit == "1"
    np.testing.assert_allclose(found.quantities[name].value, wanted, rtol=2e-3, atol=2e-4)


def test_cumulative_pitch_acts_by_the_sine_of_the_contact_angle(found: Computed) -> None:
    """F_p/2 (cos(u - phi_0) - cos(u + phi_0)) k1 is at most F_p k1 sin(phi_0).

    Contact leaves phi_0 by up to half a pin pitch each way, 2 x 4.5 deg in all.
    """
    value = found.quantities["pitch_worst_phase"].value
    bent = K1 * np.sin(np.arccos(K1) + np.array([-1.0, 1.0]) * np.pi / 80)
    assert bent[0] <= value <= bent[1]
