"""Orders of gears against turns that are counted wheel by wheel (Willis)."""

from fractions import Fraction

import pytest

from tolevo.models import gear
from tolevo.models.gear import CRANK, PINS, RV_40E, SUN, SUN_OVER_CARRIER
from tolevo.models.rv_reducer.lost_motion import RvLostMotion
from tolevo.models.rv_reducer.transmission import RvTransmission


def turns_of_rv(pins: int, discs: int, sun: int, planet: int) -> dict[str, Fraction]:
    """Turns in the housing per turn of the carrier, from rolling without slip alone.

    A disc rolls in the pins: (disc - crank)/(0 - crank) = pins/discs, and turns with the carrier.
    A planet is on its crank and meshes with the sun, both seen from the carrier.
    """
    crank = Fraction(1) / (1 - Fraction(pins, discs))
    sun_turns = 1 - (crank - 1) * Fraction(planet, sun)
    return {"crank": crank, "sun": sun_turns}


@pytest.mark.parametrize(("pins", "discs", "sun", "planet"), [(40, 39, 12, 36), (46, 45, 15, 39), (30, 28, 11, 41)])
def test_an_rv_reducer_turns_as_its_wheels_roll(pins: int, discs: int, sun: int, planet: int
                                                ) -> None:  # fmt: skip
    teeth = {"pins": pins, "cycloid_teeth": discs, "sun_teeth": sun, "planet_teeth": planet}
    expected, found = turns_of_rv(pins, discs, sun, planet), gear.rv(teeth).orders
    assert found[PINS] == pytest.approx(float(abs(expected["crank"])))
    assert found[CRANK] == pytest.approx(float(abs(expected["crank"] - 1)))
    assert found[SUN] == pytest.approx(float(abs(expected["sun"])))
    assert found[SUN_OVER_CARRIER] == pytest.approx(float(abs(expected["sun"] - 1)))


def test_the_rv_40e_has_the_orders_of_the_notes() -> None:
    assert RV_40E.waves == (39.0, 40.0, 78.0, 80.0, 120.0, 121.0)
    assert RV_40E.unnamed == ()


def test_a_planetary_gear_by_willis() -> None:
    """(sun - carrier)/(ring - carrier) = -z_r/z_s, ring at rest, per turn of the carrier."""
    found = gear.planetary({"sun_teeth": 20, "planet_teeth": 31, "ring_teeth": 82, "planets": 3})
    sun = 1.0 + 82.0 / 20.0
    assert found.orders[SUN] == pytest.approx(sun)
    assert found.orders[SUN_OVER_CARRIER] == pytest.approx(sun - 1.0)
    assert found.orders["tooth mesh"] == pytest.approx(20.0 * (sun - 1.0))
    assert 82.0 in found.unnamed and sun not in found.unnamed


def test_a_harmonic_drive_waves_twice_per_turn_of_its_generator() -> None:
    """200 and 202 teeth: ratio 100, and the known error at twice the turn of the input."""
    found = gear.harmonic({"flex_teeth": 200, "circular_teeth": 202})
    assert found.name_of(200.0) == "wave generator, twice a turn"
    assert found.name_of(101.0) == "wave generator on the flexspline"
    assert found.name_of(39.0) == ""


def test_models_of_rv_reducers_have_the_orders_of_their_parameters() -> None:
    for model in (RvTransmission, RvLostMotion):
        assert model.gear_of({}) == RV_40E
        other = model.gear_of({"pins": 46, "cycloid_teeth": 45, "reduction_ratio": 105.0})
        assert other is not None
        assert other.orders == {PINS: 45.0, CRANK: 46.0, SUN_OVER_CARRIER: 104.0, SUN: 105.0}
        without = model.gear_of({"pins": 46, "cycloid_teeth": 45, "reduction_ratio": 45.0})
        assert without is not None and not without.has(SUN)
