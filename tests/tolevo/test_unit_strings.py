"""Unit strings against numbers worked out by hand, and what is no unit."""

import re
import tomllib
from collections.abc import Iterator
from math import pi
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from typer.testing import CliRunner

from tolevo import registry
from tolevo.cli import app
from tolevo.commands.gap.configuration import read_gap
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.effects.measurements import target_of
from tolevo.section import Section
from tolevo.units import converted, dimension, family, fits, to_unit

DEG, ARCMIN, ARCSEC = pi / 180.0, pi / 10800.0, pi / 648000.0
INCH, POUND, GRAVITY = 0.0254, 0.45359237, 9.80665
"""International inch and pound (1959), standard gravity (CGPM 1901)."""
ROUNDING = 4e-16
"""A factor by hand is a product of a few rounded numbers."""

STRINGS: list[tuple[str, str, float]] = [
    # lengths
    ("0.002 mm", "um", 2.0),
    ("2um", "um", 2.0),
    ("2 µm", "um", 2.0),  # U+00B5, the micro sign
    ("2 μm", "um", 2.0),  # U+03BC, the Greek letter
    ("2 micrometer", "um", 2.0),
    ("250 nm", "um", 0.25),
    ("1.3 cm", "mm", 13.0),
    ("1 m", "mm", 1000.0),
    ("3 thou", "um", 76.2),
    ("3 mil", "um", 76.2),  # a length, not the angle of gunners
    ("3 mils", "um", 76.2),
    ("1.5 in", "mm", 38.1),
    ("2 inch", "mm", 50.8),
    ("2 ft", "mm", 609.6),
    ("-4e-3 mm", "um", -4.0),
    (" +.5 mm ", "um", 500.0),
    # angles
    ("1 deg", "arcmin", 60.0),
    ("1°", "arcmin", 60.0),
    ("60 arcsec", "arcmin", 1.0),
    ("1'", "arcsec", 60.0),
    ("1′", "arcsec", 60.0),
    ("30 '", "deg", 0.5),
    ('90"', "arcmin", 1.5),
    ("90″", "arcmin", 1.5),
    ("1 rad", "mrad", 1000.0),
    ("180 deg", "rad", pi),
    ("2 turn", "deg", 720.0),
    ("100 gon", "deg", 90.0),
    # rotational speeds: turns
    ("15 1/min", "rpm", 15.0),
    ("15 min^-1", "rpm", 15.0),
    ("15 min**-1", "rpm", 15.0),
    ("15 min-1", "rpm", 15.0),
    ("15 min⁻¹", "rpm", 15.0),
    ("15 rpm", "rpm", 15.0),
    ("15 r/min", "rpm", 15.0),
    ("15 rev/min", "rpm", 15.0),
    ("0.25 1/s", "rpm", 15.0),
    ("0.25 s^-1", "rpm", 15.0),
    ("0.25 Hz", "rpm", 15.0),
    ("0.25 Hz", "rad/s", pi / 2.0),
    ("0.25 Hz", "deg/s", 90.0),
    ("90 deg/s", "rpm", 15.0),
    ("1 rad/s", "rpm", 30.0 / pi),
    # frequencies stay
    ("55 Hz", "Hz", 55.0),
    ("55 1/s", "Hz", 55.0),
    ("1.2 kHz", "Hz", 1200.0),
    ("300 1/min", "Hz", 5.0),
    # torques
    ("412 Nm", "Nm", 412.0),
    ("412 N m", "Nm", 412.0),
    ("412 N*m", "Nm", 412.0),
    ("412 N·m", "Nm", 412.0),
    ("0.412 kNm", "Nm", 412.0),
    ("0.412 kN m", "Nm", 412.0),
    ("5 mNm", "Nm", 0.005),
    ("2500 Nmm", "Nm", 2.5),
    ("250 Ncm", "Nm", 2.5),
    ("3 kgf cm", "Nm", 3.0 * GRAVITY / 100.0),
    ("3 kgf m", "Nm", 3.0 * GRAVITY),
    ("8 lbf in", "Nm", 8.0 * POUND * GRAVITY * INCH),
    ("8 lbf ft", "Nm", 8.0 * POUND * GRAVITY * 12.0 * INCH),
    ("16 ozf in", "Nm", POUND * GRAVITY * INCH),
    # stiffness, inertia, pressure, force, mass, time, shares
    ("200 kN/mm", "N_per_mm", 2e5),
    ("3510 N m/deg", "Nm_per_arcmin", 58.5),
    ("58.5 Nm/'", "Nm_per_arcmin", 58.5),
    ("0.6 arcmin/Nm", "arcsec/Nm", 36.0),
    ("2 kg cm^2", "kg m^2", 2e-4),
    ("2 kg cm²", "kg m²", 2e-4),
    ("2 kg cm2", "kg m2", 2e-4),
    ("210 GPa", "N/mm^2", 210e3),
    ("1 bar", "Pa", 1e5),
    ("2 lbf", "N", 2.0 * POUND * GRAVITY),
    ("2 kgf", "N", 2.0 * GRAVITY),
    ("500 g", "kg", 0.5),
    ("2 lb", "kg", 2.0 * POUND),
    ("1.5 h", "s", 5400.0),
    ("250 ms", "s", 0.25),
    ("90 km/h", "m/s", 25.0),
    ("99.73 %", "percent", 99.73),
    ("99.73%", "percent", 99.73),
    ("2700 ppm", "percent", 0.27),
    # temperatures, and differences of them
    ("20 C", "K", 293.15),
    ("20 °C", "degC", 20.0),
    ("68 degF", "C", 20.0),
    ("11.5 um/(m K)", "1/K", 11.5e-6),
    ("2 um/degC", "um/K", 2.0),
    ("9 um/degF", "um/K", 16.2),
]


@pytest.mark.parametrize(("text", "unit", "value"), STRINGS)
def test_a_unit_string_is_read_as_by_hand(text: str, unit: str, value: float) -> None:
    np.testing.assert_allclose(to_unit(text, unit), value, rtol=ROUNDING * 4)


FACTORS: dict[str, float] = {
    "": 1.0, "1": 1.0, "%": 1e-2, "percent": 1e-2, "ppm": 1e-6,
    "um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "km": 1e3, "1/mm": 1e3, "mm/s": 1e-3,
    "Nm/arcmin": 1.0 / ARCMIN,
    "arcsec": ARCSEC, "arcmin": ARCMIN, "deg": DEG, "mrad": 1e-3, "rad": 1.0, "mrad**2": 1e-6,
    "mrad/mm": 1.0, "mrad/mrad": 1.0, "arcmin/s": ARCMIN, "arcsec/s": ARCSEC, "mrad/s": 1e-3,
    "rpm": 2.0 * pi / 60.0, "Hz": 1.0, "s": 1.0, "h": 3600.0, "mm/deg": 1e-3 * 180.0 / pi, "kg": 1.0,
    "N": 1.0, "N m": 1.0, "Nm": 1.0, "kN m": 1e3, "N/mm": 1e3, "N_per_mm": 1e3, "Nm_per_arcmin": 1.0 / ARCMIN,
    "1/K": 1.0, "K": 1.0, "C": 1.0, "degC": 1.0, "arcsec/K": ARCSEC, "arcmin/K": ARCMIN,
    "arcsec/Nm": ARCSEC, "arcmin/Nm": ARCMIN, "mrad/Nm": 1e-3, "mrad kg/Nm": 1e-3,
    "arcsec/rpm": ARCSEC * 60.0 / (2.0 * pi), "arcsec/rpm^2": ARCSEC * (60.0 / (2.0 * pi)) ** 2,
    "arcsec/(rpm s)": ARCSEC * 60.0 / (2.0 * pi),
    "arcsec/(Nm rpm)": ARCSEC * 60.0 / (2.0 * pi), "mm/K": 1e-3, "mrad/K": 1e-3,
    "kN": 1e3, "kN/mm": 1e6, "Nm/deg": 1.0 / DEG, "N m/deg": 1.0 / DEG,
}  # fmt: skip
"""How many SI units each is that models, documents, configurations and tests name."""


def declared() -> Iterator[str]:
    """Units that models, problems, calculations and effects declare."""
    for group in ("models", "problems", "calculations"):
        for name in registry.names(group):
            kind = registry.load(group, name)
            kind = kind.declaration if group == "problems" else kind
            for what in ("parameters", "outputs", "columns", "variables", "changeable"):
                yield from (one.unit for one in getattr(kind, what, ()))
    for name in registry.names("models"):
        target = target_of(registry.load("models", name), name)
        for effect in (registry.load("effects", one)() for one in registry.names("effects")):
            if effect.applies(target):
                yield from (one.unit for one in effect.parameters(target))


QUANTITY = re.compile(r"[-+0-9.e]+ ([A-Za-z%µ]{1,6}(?:/[A-Za-z]+)?)")


def stated(value: object) -> Iterator[str]:
    """Units in the tables of a TOML file: `unit` keys, and strings that begin with a number; costs are in any."""
    if isinstance(value, dict):
        value = {key: inner for key, inner in value.items() if key != "cost" or not isinstance(inner, list)}
        if isinstance(value.get("unit"), str):
            yield value["unit"]
        for inner in value.values():
            yield from stated(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from stated(inner)
    elif isinstance(value, str) and (found := QUANTITY.fullmatch(value)):
        yield found[1]


def tables(folder: Path) -> Iterator[object]:
    """The configurations, the examples, and the TOML blocks of the documents."""
    yield from (tomllib.loads(one.read_text("utf-8")) for kind in ("configs/*.toml", "docs/examples/*.toml")
                for one in folder.glob(kind))  # fmt: skip
    for page in [folder / "README.md", *folder.glob("docs/*.md")]:
        for block in re.findall(r"```toml[^\n]*\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
            try:
                yield tomllib.loads(block)
            except tomllib.TOMLDecodeError:
                continue  # a sketch with dots


def test_every_declared_unit_has_the_factor_worked_out_by_hand() -> None:
    for unit in sorted(set(declared())):
        np.testing.assert_allclose(_factor(unit), FACTORS[unit], rtol=4 * ROUNDING, err_msg=unit)


@pytest.mark.source_tree
def test_every_unit_of_the_documents_has_the_factor_worked_out_by_hand() -> None:
    folder = Path(__file__).parents[2]
    found = {unit for table in tables(folder) for unit in stated(table)}
    assert len(found) > 8
    for unit in sorted(found):
        np.testing.assert_allclose(_factor(unit), FACTORS[unit], rtol=4 * ROUNDING, err_msg=unit)


def _factor(unit: str) -> float:
    """How many SI units one is; of a temperature with a zero, one step."""
    try:
        return family(unit)[1]
    except ValueError:
        return float(converted(1.0, unit, "K") - converted(0.0, unit, "K"))


@pytest.mark.parametrize(("unit", "factor"), FACTORS.items())
def test_units_of_the_table_are_known(unit: str, factor: float) -> None:
    # K and C by the difference of two temperatures near 273 K: 2^-44 of rounding
    np.testing.assert_allclose(_factor(unit), factor, rtol=1e-13)


@pytest.mark.parametrize(
    ("text", "unit", "why"),
    [
        ("2 um**9**9**9", "um", "is not expected there"),
        ("2 mm**", "um", "an exponent is a whole number"),
        ("2 um/0", "um", "where a unit is expected"),
        ("2 um/", "um", "nothing stands where a unit is expected"),
        ("1'", "um", "arc minutes and seconds: write ft and in"),
        ('1"', "mm", "arc minutes and seconds: write ft and in"),
        ("5 %um", "um", 'a space, "\\*" or "/" is missing before "um"'),
        ("5 % um", "um", "a percentage of a unit is not a unit"),
        ("5 um!", "um", '"!" has no place in a unit'),
        ("5 um # so", "um", '"#" has no place in a unit'),
        ("5 um;", "um", '";" has no place in a unit'),
        ("0,5 mm", "um", "decimals follow a point"),
        ("5 um^0", "um", "exponent of 0"),
        ("5 um^10", "um", "an exponent is a whole number"),
        ("5 um^0.5", "um", '"." has no place in a unit'),
        ("5 ((um^9)^9)^9", "um", "no exponent is beyond 9"),
        ("5 (um", "um", '"\\)" is missing'),
        ("5 um)", "um", "is not expected there"),
        ("5 J/kg K", "J/(kg K)", "ambiguous"),
        ("5 N/m*m", "N", "ambiguous"),
        ("5 2 um", "um", '"2" stands where'),
        ("5 um um", "um", 'unit of um, got "5 um um"$'),
        ("5 kg", "um", 'unit of um, got "5 kg"$'),
        ("5 pi um", "um", '"pi" is not a unit'),
        ("5 mms", "mm", '"mms" is not a unit'),
        ("5 kmm", "mm", '"kmm" is not a unit'),
        ("5 mdegC", "C", "takes no prefix"),
        ("5 Em^9", "m", "is beyond all that is measured"),
        ("5 am^9", "m", "is beyond all that is measured"),
        ("5 rpm", "Hz", "is an angular speed, and Hz a frequency"),
        ("5 rad/s", "Hz", "is an angular speed, and Hz a frequency"),
        ("5 Hz", "arcsec/s", "does not say of what angle"),
        ("5 1/min", "mrad/s", "does not say of what angle"),
        ("5 1/s^2", "rad/s^2", "does not say of what angle"),
        ("5 Nm", "Nm_per_arcmin", "does not say of what angle"),
        ("5 %", "rad", "does not say of what angle"),
        ("5 mrad", "percent", 'got "5 mrad"$'),
    ],
)
def test_what_is_no_unit_is_refused_with_its_reason(text: str, unit: str, why: str) -> None:
    with pytest.raises(ValueError, match=why) as raised:
        to_unit(text, unit)
    assert len(str(raised.value)) < 300


@pytest.mark.parametrize(
    "text",
    ["5 " + "(" * 250, "5" + " " * 100_000 + "x", "um" * 1_000_000, "5 um" + "^9" * 1_000_000],
    ids=["brackets", "spaces", "names", "powers"],
)
def test_a_long_text_is_refused_at_once_and_not_repeated(text: str) -> None:
    with pytest.raises(ValueError, match="must be a number or") as raised:
        to_unit(text, "um")
    assert len(str(raised.value)) < 300


@pytest.mark.parametrize("text", ["1e99999999999 m", "-1e400 mm", "1e308 Gm"])
def test_a_number_beyond_all_is_a_fault_of_its_place(text: str) -> None:
    faults: list[object] = []
    section = Section({"a_um": text}, "", faults)  # type: ignore[arg-type]
    assert section.number("a_um", "um") is None
    assert [str(one) for one in faults] == [f'a_um: must be finite, got "{text}"']


def test_a_drift_per_time_is_no_rotational_speed() -> None:
    with pytest.raises(ValueError, match="does not say of what angle"):
        to_unit("0.1 1/s", "deg/s", scale_only=True)
    np.testing.assert_allclose(to_unit("6 deg/min", "deg/s", scale_only=True), 0.1, rtol=ROUNDING)


def test_a_difference_of_temperature_is_no_temperature() -> None:
    with pytest.raises(ValueError, match='it is a difference, "degC" a temperature: write K'):
        to_unit("5 degC", "K", scale_only=True)
    np.testing.assert_allclose(to_unit("9 delta_degF", "K", scale_only=True), 5.0, rtol=ROUNDING)


UNIT_FAULTS = {
    "2 um**9**9**9": '"**" is not expected there',
    "2 mm**": "an exponent is a whole number from -9 to 9",
    "2 um/0": '"0" stands where a unit is expected',
    "1'": "' and \" are arc minutes and seconds: write ft and in for feet and inches",
    "5 %um": 'a space, "*" or "/" is missing before "um"',
    "5 um!": '"!" has no place in a unit',
}


@pytest.mark.parametrize("text", UNIT_FAULTS)
def test_check_places_a_fault_of_a_unit(tmp_path: Path, text: str) -> None:
    path = tmp_path / "c.toml"
    path.write_text(tomli_w.dumps({
        "problem": "rv_backlash",
        "limits": {"interference_probability": 0.05},
        "variables": {"pitch_um": {"value": text}},
    }), encoding="utf-8")  # fmt: skip
    result = CliRunner().invoke(app, ["check", str(path)])
    assert result.exit_code == 2
    assert result.stderr == (
        f'variables.pitch_um.value: must be a number or a string with a unit of um, got "{text}": {UNIT_FAULTS[text]}\n'
    )


@pytest.mark.parametrize("text", ["15 1/min", "15 min^-1", "15 rpm", "0.25 1/s", "0.25 Hz"])
def test_a_rotational_speed_of_a_configuration_counts_turns(tmp_path: Path, text: str) -> None:
    """15 turns a minute; read as radians it was 2.39 rpm."""
    path = tmp_path / "gap.toml"
    table = {"model": "table", "columns": {
        "n": {"role": "speed", "unit": "rpm"},
        "te": {"role": "measured", "unit": "arcsec"},
        "te_model": {"role": "predicted", "unit": "arcsec"},
    }, "next_measurement": {"range": {"n": text}}}  # fmt: skip
    path.write_text(tomli_w.dumps(table), encoding="utf-8")
    plan = read_gap(path).next_measurement
    assert plan is not None
    np.testing.assert_allclose(plan.ranges["n"].low, 15.0, rtol=ROUNDING)


def test_an_effect_takes_frequencies_and_differences_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    text = """
model = "table"
gear.orders = {{ "pin passing" = 40 }}
[columns]
angle = {{ role = "angle", unit = "deg" }}
n = {{ role = "speed", unit = "1/min" }}
t = {{ role = "time", unit = "s" }}
te = {{ role = "measured", unit = "arcsec" }}
te_model = {{ role = "predicted", unit = "arcsec" }}
[[effect]]
name = "structural_resonance"
parameters = {{ cos = "20 arcsec", frequency = "{frequency}", damping = 0.1, order = 40.0 }}
[[effect]]
name = "drift"
parameters = {{ rate = "{rate}" }}
"""
    path.write_text(text.format(frequency="3000 1/min", rate="6 arcsec/min"), encoding="utf-8")
    resonance, drift = read(path).settings.effects
    np.testing.assert_allclose(resonance.values["frequency_Hz"], 50.0, rtol=ROUNDING)
    np.testing.assert_allclose(drift.values["rate_arcsec_per_s"], 0.1, rtol=ROUNDING)
    path.write_text(text.format(frequency="3000 rpm", rate="1 Hz"), encoding="utf-8")
    with pytest.raises(InputError) as raised:
        read(path)
    frequency, rate = (str(fault) for fault in raised.value.faults)
    assert frequency.endswith('"rpm" is an angular speed, and Hz a frequency: write Hz or 1/s')
    assert rate.endswith('"Hz" does not say of what angle: write it with one, as arcsec/s has')


def test_columns_of_a_speed_may_count_turns() -> None:
    assert fits("1/min", "rpm")
    assert fits("Hz", "rpm")
    assert not fits("rpm", "Hz")
    assert not fits("1/min", "mrad/s")
    np.testing.assert_allclose(converted(np.array([0.25, 1.0]), "Hz", "rpm"), [15.0, 60.0])


def test_an_angle_is_a_quantity_of_its_own() -> None:
    assert dimension("N m") == "kilogram meter^2 second^-2"
    assert dimension("N m/rad") == "kilogram meter^2 radian^-1 second^-2"
    assert dimension("percent") == dimension("1") == dimension("") == ""


def test_units_of_parameters_and_outputs_are_written_as_on_drawings() -> None:
    """`check` printed 200000 N_per_mm: a name has _per_ where a unit has a slash."""
    declared = [registry.load("problems", name).declaration for name in registry.names("problems")]
    units = {each.unit for one in declared for each in (*one.parameters, *one.variables, *one.outputs)}
    assert {"N/mm", "Nm/arcmin"} <= units
    assert not [unit for unit in units if "_" in unit]
