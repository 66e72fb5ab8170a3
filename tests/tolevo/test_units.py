"""Units at the edge: text in, the unit of the key out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tolevo.units import (
    ARCMIN,
    COMMON,
    MM,
    RATES,
    SUFFIXES,
    UM,
    converted,
    look_up_unit,
    split_unit,
    to_unit,
    unit_key,
    unit_of,
)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.002 mm", "um", 2.0),
        ("2um", "um", 2.0),
        ("1 deg", "arcmin", 60.0),
        ("60 arcsec", "arcmin", 1.0),
        ("1 rad", "mrad", 1000.0),
        ("412 Nm", "Nm", 412.0),
        ("20 C", "K", 293.15),
        ("3600 rpm", "rpm", 3600.0),
        ("-4e-3 mm", "um", -4.0),
        ("99.73 percent", "percent", 99.73),
        ("7", "", 7.0),
        (".5", "", 0.5),
    ],
)
def test_quantity_is_converted_to_the_unit_of_its_key(text: str, unit: str, value: float) -> None:
    np.testing.assert_allclose(to_unit(text, unit), value, rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("", "um"),
        ("2", "um"),  # a string must say its unit
        ("2 um", ""),
        ("two um", "um"),
        ("2 kg", "um"),
        ("2 umm", "um"),
        ("2 um um um", "um"),
        ("2 (", "um"),
        ("2 1", "um"),
        ("nan um", "um"),
        ("1e5", "um"),
    ],
)
def test_other_text_is_refused_with_the_remedy(text: str, unit: str) -> None:
    with pytest.raises(ValueError, match="must be a number or"):
        to_unit(text, unit)


@given(st.floats(-1e6, 1e6))
def test_millimetres_and_micrometres_agree(value: float) -> None:
    np.testing.assert_allclose(to_unit(f"{value!r} mm", "um"), 1000.0 * value, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("crank_bearing_um", ("crank_bearing", "um")),
        ("backlash_limit_arcmin", ("backlash_limit", "arcmin")),
        ("involute_grade", ("involute_grade", "")),
        ("normal_stiffness_N_per_mm", ("normal_stiffness", "N_per_mm")),
        ("um", ("um", "")),
        ("_um", ("_um", "")),
        ("cost", ("cost", "")),
    ],
)
def test_name_is_split_from_its_unit(name: str, parts: tuple[str, str]) -> None:
    assert split_unit(name) == parts


@pytest.mark.parametrize("unit", sorted(SUFFIXES))
def test_every_suffix_is_a_unit(unit: str) -> None:
    np.testing.assert_allclose(to_unit(f"3 {unit}", unit), 3.0, rtol=1e-12)


def test_stiffness_in_other_units() -> None:
    np.testing.assert_allclose(to_unit("200 kN/mm", "N_per_mm"), 2e5, rtol=1e-12)
    found = to_unit("3510 N m/deg", "Nm_per_arcmin")
    np.testing.assert_allclose(found, 58.5, rtol=1e-12)


def test_constants() -> None:
    np.testing.assert_allclose(ARCMIN, np.pi / 10800.0, rtol=1e-15)
    assert (UM, MM) == (1e-6, 1e-3)


@pytest.mark.parametrize(
    ("values", "unit", "to", "expected"),
    [
        ([0.0, 180.0], "deg", "rad", [0.0, np.pi]),
        ([32.0, 212.0], "degF", "C", [0.0, 100.0]),
        ([2.0], "kN m", "Nm", [2000.0]),
        ([1.0], "arcsec/Nm", "arcmin/Nm", [1.0 / 60.0]),
        ([np.pi], "rad/s", "rpm", [30.0]),
    ],
)
def test_arrays_are_converted(values: list[float], unit: str, to: str, expected: list[float]) -> None:
    np.testing.assert_allclose(converted(np.array(values), unit, to), expected, atol=1e-12)


def test_units_of_two_kinds_are_not_converted() -> None:
    with pytest.raises(ValueError, match='"mm" is not a unit that can be stated in rad'):
        converted(np.ones(2), "mm", "rad")


@pytest.mark.parametrize(
    ("unit", "key"),
    [("arcsec/Nm", "arcsec_per_Nm"), ("1/K", "per_K"), ("arcsec/rpm^2", "arcsec_per_rpm2"),
     ("N m", "N_m"), ("arcsec/(rpm s)", "arcsec_per_rpm_s"), ("mm", "mm")],
)  # fmt: skip
def test_units_in_names(unit: str, key: str) -> None:
    assert unit_key(unit) == key


def test_common_units_are_those_of_pint() -> None:
    from pint import UnitRegistry

    assert {name: unit_of(name) for name in COMMON} == {name: look_up_unit(name) for name in COMMON}
    rates = {name for name in UnitRegistry() if "_per_" in name}
    assert rates | {"beats_per_minute"} == RATES  # pint before 0.26 does not know this one
