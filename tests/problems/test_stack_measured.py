"""`[part.measured]`: scatter and mean of a part from parts that were measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.configuration.reader import read
from tolevo.errors import InputError

VALUES = np.random.default_rng(12).normal(2.0, 3.0, 25).round(2)
STACK = """
problem = "stack"
[objectives]
minimise = ["cost"]
[limits]
yield_percent = 99.0
[requirement]
unit = "um"
nominal = 0.0
lower = -40.0
upper = 40.0
[[part]]
name = "ring"
unit = "um"
sensitivity = 1.0
t_min = 2.0
t_max = 40.0
cost = {{ model = "reciprocal", a = 1.0, b = 30.0 }}
[part.measured]
{measured}
[[part]]
name = "pin"
unit = "um"
sensitivity = -1.0
t_min = 2.0
t_max = 40.0
cost = {{ model = "reciprocal", a = 1.0, b = 20.0 }}
"""
WHOLE = f"values = {VALUES.tolist()}\nmade_to = 12.0\n"


def built(folder: Path, measured: str) -> Any:
    (folder / "c.toml").write_text(STACK.format(measured=measured), encoding="utf-8")
    return read(folder / "c.toml").problem


def faults(folder: Path, measured: str) -> str:
    with pytest.raises(InputError) as caught:
        built(folder, measured)
    return "\n".join(str(fault) for fault in caught.value.faults)


@pytest.mark.parametrize("mean", ["as_found", "corrected"])
def test_yield_follows_from_the_sample(mean: str, tmp_path: Path) -> None:
    """sigma = s t/12 and the mean of the sample, in the closed form of two normal parts."""
    problem = built(tmp_path, f'{WHOLE}mean = "{mean}"')
    found = problem.frame(np.array([[20.0, 9.0]]))
    sigma = np.hypot(VALUES.std(ddof=1) * 20.0 / 12.0, 9.0 / 3.0)
    offset = VALUES.mean() if mean == "as_found" else 0.0
    expected = norm.cdf(40.0, offset, sigma) - norm.cdf(-40.0, offset, sigma)
    assert found["yield_percent"].iloc[0] == pytest.approx(100.0 * expected, abs=1e-9)


def test_what_is_known_is_said(tmp_path: Path) -> None:
    problem = built(tmp_path, WHOLE)
    told = {one.name: one for one in problem.assumptions()}
    known = str(told["part.ring.measured"].value)
    assert known.startswith(f"25 parts: mean {VALUES.mean():+.4g} um from the mid-limit, s = ")
    assert "Cpk " in known
    assert "distribution A1 (ISO 22514-2)" in known
    assert "does not state that it is corrected" in told["part.ring.measured.mean"].reason


def test_the_optimum_is_proven_with_a_measured_part(tmp_path: Path) -> None:
    built(tmp_path, f'{WHOLE}mean = "corrected"')
    done = CliRunner().invoke(
        app, ["run", str(tmp_path / "c.toml"), "--out", str(tmp_path / "o"),
              "--set", 'algorithm.name="exact"'],
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    front = pd.read_csv(tmp_path / "o" / "front.csv")
    assert front["gap_percent"].iloc[0] < 1e-4
    # the same by hand: least a/t within sigma^2 = (40/z)^2, t in its range
    z, r = norm.ppf(0.995), np.array([VALUES.std(ddof=1) / 12.0, 1.0 / 3.0])
    t = np.linspace(2.0, 40.0, 40_001)
    rest = (40.0 / z) ** 2 - (r[0] * t) ** 2
    other = np.minimum(np.sqrt(np.maximum(rest, 0.0)) / r[1], 40.0)
    with np.errstate(divide="ignore"):
        least = np.min(np.where(other >= 2.0, 2.0 + 30.0 / t + 20.0 / other, np.inf))
    assert front["cost"].iloc[0] == pytest.approx(least, rel=1e-5)


def test_the_resolved_configuration_is_the_same_stack(tmp_path: Path) -> None:
    (tmp_path / "ring.csv").write_text("Teil;Abweichung [mm]\n" + "".join(
        f"{at};{value / 1000.0:.5f}\n".replace(".", ",") for at, value in enumerate(VALUES)
    ), encoding="cp1252")  # fmt: skip
    first = built(tmp_path, 'file = "ring.csv"\ncharacteristic = "Abweichung"\nmade_to = 0.012')
    text = CliRunner().invoke(app, ["check", str(tmp_path / "c.toml")]).stdout
    (tmp_path / "again").mkdir()
    (tmp_path / "again" / "c.toml").write_text(text, encoding="utf-8")
    again: Any = read(tmp_path / "again" / "c.toml").problem
    designs = np.array([[20.0, 9.0], [5.0, 30.0]])
    np.testing.assert_array_equal(first.frame(designs), again.frame(designs))
    direct = built(tmp_path, WHOLE)
    numbers = [one.frame(designs).select_dtypes("number") for one in (first, direct)]
    np.testing.assert_allclose(numbers[0], numbers[1], rtol=1e-9)


DFQ = """K0100 2
K1001/1 4711
K2001/1 10
K2002/1 Bohrung
K2101/1 25,000
K2110/1 25,000
K2111/1 25,021
K2142/1 mm
K2001/2 20
K2002/2 Rundlauf
K2142/2 mm
"""


def test_a_q_das_file_brings_its_limits_and_nominal(tmp_path: Path) -> None:
    """25.000 to 25.021 mm: made to 10.5 um about a mid-limit of 25.0105 mm; 255 is not valid."""
    sizes = [25.004, 25.0065, 25.011, 25.009, 25.0135, 25.0122]
    rows = [f"K0001/1 {size}\nK0001/2 0.001" for size in sizes]
    rows += ["K0001/1 30.0\nK0002/1 255\nK0001/2 0.001"]
    (tmp_path / "a.dfq").write_text(DFQ + "\n".join(rows).replace(".", ","), encoding="cp1252")
    ring = 'unit = "um"\nsensitivity = 1.0\nt_min = 2.0\nt_max = 40.0'
    bore = 'unit = "mm"\nnominal = {}\nsensitivity = 1000.0\nlimits = "+0.021/0"'
    text = STACK.format(measured='file = "a.dfq"\ncharacteristic = "Bohrung"')
    text = text.replace("cost = {", "# cost = {", 1)
    path = tmp_path / "c.toml"
    path.write_text(text.replace(ring, bore.format(25.0)), encoding="utf-8")
    problem: Any = read(path).problem
    sample = problem.definition.parts[0].sample
    assert sample.made_to == pytest.approx(0.0105)
    assert sample.knowledge.mean == pytest.approx(np.mean(sizes) - 25.0105)
    assert sample.knowledge.std == pytest.approx(np.std(sizes, ddof=1))
    path.write_text(text.replace(ring, bore.format(26.0)), encoding="utf-8")
    with pytest.raises(InputError, match="another revision of the drawing"):
        read(path)
    path.write_text(text.replace(ring, bore.format(25.0)).replace("Bohrung", "Bohrng"), "utf-8")
    with pytest.raises(InputError, match="did you mean `Bohrung`"):
        read(path)


def test_files_of_one_characteristic_are_put_together(tmp_path: Path) -> None:
    for name, first in (("a", 0.0), ("b", 5.0)):
        rows = "\n".join(str(first + at) for at in range(6))
        (tmp_path / f"{name}.csv").write_text(f"ring [um]\n{rows}\n", encoding="utf-8")
    problem = built(tmp_path, 'file = ["a.csv", "b.csv"]\nmade_to = 12.0')
    sample = problem.definition.parts[0].sample
    assert sample.deviations.tolist() == [0, 1, 2, 3, 4, 5, 5, 6, 7, 8, 9, 10]
    assert [one.kind for one in sample.findings] == ["drift", "lots"]


def test_files_of_two_revisions_are_not_mixed(tmp_path: Path) -> None:
    sizes = (25.004, 25.0065, 25.011, 25.009, 25.0135, 25.0122)
    rows = "\n".join(f"K0001/1 {size}\nK0001/2 0.001" for size in sizes)
    for name, upper in (("a", "25,021"), ("b", "25,033")):
        text = (DFQ.replace("25,021", upper) + rows).replace(".", ",")
        (tmp_path / f"{name}.dfq").write_text(text, encoding="cp1252")
    found = faults(tmp_path, 'file = ["a.dfq", "b.dfq"]\ncharacteristic = "Bohrung"')
    assert "part[0].measured.file: mixes files of different limits" in found
    assert "give files of one revision of the drawing" in found


@pytest.mark.parametrize(
    ("measured", "words"),
    [
        ("made_to = 12.0", "part[0].measured.file: is missing"),
        (f"values = {VALUES.tolist()}", "part[0].measured.made_to: is missing"),
        ("values = [1.0, 2.0]\nmade_to = 12.0", "has 2 values; at least 5"),
        ("values = [1.0, 1.0, 1.0, 1.0, 1.0]\nmade_to = 12.0", "equal values"),
        (WHOLE.replace("12.0", '"12 um"') + 'unit = "mm"', "check their unit and made_to"),
        (WHOLE + 'unit = "deg"', "cannot be stated in um"),
        (WHOLE + "gauge = { sigma = 9.0 }", "the gauge is unfit"),
        (WHOLE + "prior = { cp = 1.33 }", "measured.prior.parts: is missing"),
        (WHOLE + "prior = { cp = 9.0, parts = 40 }", "the prior one of"),
        (WHOLE + 'mean = "mended"', "must be one of as_found, corrected"),
        (WHOLE + "colour = 1", "part[0].measured.colour: is not a known key"),
        (WHOLE.replace("12.0\n", '"fixed"\n'), "cannot be fixed where the tolerance is searched"),
        (WHOLE + "nominal = 3.0", ""),
        ('file = "none.csv"\nmade_to = 12.0', "part[0].measured.file: none.csv does not exist"),
        (WHOLE + "[part.processes]", "part[0].processes"),
    ],
)
def test_faults(measured: str, words: str, tmp_path: Path) -> None:
    if not words:
        assert built(tmp_path, measured) is not None  # without a nominal of its own nothing differs
        return
    assert words in faults(tmp_path, measured)


def test_measured_parts_are_known_where_the_zone_is_missing(tmp_path: Path) -> None:
    text = STACK.format(measured=WHOLE).replace("t_min = 2.0\nt_max = 40.0\n", "", 1)
    (tmp_path / "c.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read(tmp_path / "c.toml")
    assert [fault.place for fault in caught.value.faults] == ["part[0]"]


def test_departures_of_the_sample_are_warned_of(tmp_path: Path) -> None:
    drifting = (VALUES + np.linspace(0.0, 20.0, 25)).round(3).tolist()
    problem = built(tmp_path, f"values = {drifting}\nmade_to = 25.0")
    assert any("part ring, measured: drifts by" in text for text in problem.warnings())


CASE = Path(__file__).parents[1] / "cases" / "natural_limit"
LINES = (CASE / "coax.dfq").read_text(encoding="utf-8").splitlines()
COAXIALITY = [float(line.split("\x14")[0]) for line in LINES if line[0] != "K"]


@pytest.mark.parametrize(
    "way", ["natural", "absent", "none", "geometry", "upper", "mirrored"])  # fmt: skip
def test_a_characteristic_with_one_limit_has_no_cp(way: str, tmp_path: Path) -> None:
    """Cpk is (0.02 - mean)/(3 s) = 2.37; the yield is that of the sample's mean, which no Cp moves."""
    toml = (CASE / "one_sided.toml").read_text(encoding="utf-8")
    dfq, side = (CASE / "coax.dfq").read_text(encoding="utf-8"), 1.0
    if way == "absent":
        dfq = dfq.replace("K2110/1 0\n", "").replace("K2120/1 2\n", "")
    if way == "none":
        dfq = dfq.replace("K2120/1 2", "K2120/1 0")
    if way == "mirrored":
        side, values = -1.0, "\n".join(f"{-value:.6f}" for value in COAXIALITY)
        dfq = "\n".join([*(line for line in LINES if line[0] == "K"), values])
        dfq = dfq.replace("K2110/1 0\nK2111/1 0.02\nK2120/1 2\nK2121/1 1", "K2110 -0.02\nK2111 0\nK2120 1\nK2121 2")
        toml = toml.replace("+0.02/0", "0/-0.02").replace("sensitivity = -1.0", "sensitivity = 1.0")
    if way in ("geometry", "upper"):
        toml = toml.replace('file = "coax.dfq"\ncharacteristic = "Coaxiality"', f"values = {COAXIALITY}")
    if way == "upper":
        toml = toml.replace('geometry = "concentricity"\n', "").replace("values", "upper = 0.02\nvalues")
    else:
        toml = toml if way == "geometry" else toml.replace('geometry = "concentricity"\n', "")
    (tmp_path / "coax.dfq").write_text(dfq, encoding="utf-8")
    (tmp_path / "one.toml").write_text(toml, encoding="utf-8")
    done = CliRunner().invoke(app, ["run", str(tmp_path / "one.toml"), "--out", str(tmp_path / "o"), "--quiet"])
    assert done.exit_code == 0, done.output
    mean, std = np.mean(COAXIALITY), np.std(COAXIALITY, ddof=1)
    table = pd.read_csv(tmp_path / "o" / "capability.csv")
    assert table["index"].tolist() == ["Cpk"]
    assert table["value"][0] == pytest.approx((0.02 - mean) / (3.0 * std), rel=1e-9)
    assert table["mean"][0] == pytest.approx(side * mean, rel=1e-9)
    sigma = np.hypot(0.08 / 3.0, std)
    expected = norm.cdf(0.2, 0.12 - mean, sigma) - norm.cdf(0.0, 0.12 - mean, sigma)
    front = pd.read_csv(tmp_path / "o" / "front.csv")
    assert front["yield_percent"][0] == pytest.approx(100.0 * expected, abs=1e-6)
    drawing = pd.read_csv(tmp_path / "o" / "allocation.csv").set_index("variable").loc["concentricity_t"]
    assert drawing["cpk_wanted"] == pytest.approx((0.02 - mean) / (3.0 * std), rel=1e-4)
    assert "mid-limit" not in drawing["inspection"]
    again = tmp_path / "o" / "config.toml"
    problem: Any = read(again).problem
    assert problem.definition.parts[1].sample.one_sided
    again.write_text(again.read_text(encoding="utf-8").replace('"as_found"', '"corrected"'), encoding="utf-8")
    with pytest.raises(InputError, match="a characteristic with one limit has no mid-limit"):
        read(again)


DAMAGED = ["12 um", "abc", "0x10", "-inf", "1e400", "1_000", "±0.1", "<0.5", "1.5*", "1.2.3", "2025-01-01", "1,5"]
MISSING = ["", "-", "n.i.O.", "#N/A", "NaN"]


@pytest.mark.parametrize("kind", ["csv", "xlsx", "parquet", "dfq"])
@pytest.mark.parametrize("cell", [*DAMAGED, *MISSING])
def test_no_value_of_a_sample_is_lost_without_a_word(kind: str, cell: str, tmp_path: Path) -> None:
    """A cell that is no number is a fault at its row, or counted as missing (1,5 alone is a number)."""
    cells: list[Any] = VALUES.tolist()
    cells[6] = cell
    path = tmp_path / f"ring.{kind}"
    if kind == "csv":
        path.write_text("id;ring [um]\n" + "".join(f"A{at};{value}\n" for at, value in enumerate(cells)), "utf-8")
    elif kind == "dfq":
        values = "".join(f"{value}\x140\n" for value in cells)
        path.write_text(f"K1001 1\nK2002 ring [um]\nK2142 um\n{values}", encoding="utf-8")
    elif kind == "xlsx":
        pd.DataFrame({"id": "A", "ring [um]": cells}).to_excel(path, index=False)
    else:
        pd.DataFrame({"ring [um]": list(map(str, cells))}).to_parquet(path)
    measured = f'file = "ring.{kind}"\ncharacteristic = "ring [um]"\nmade_to = 12.0\n'
    number = cell == "1,5" and kind in ("dfq", "xlsx")
    if not number and (cell in DAMAGED or (kind == "dfq" and cell)):
        text = faults(tmp_path, measured)
        assert any(words in text for words in (f'"{cell}"', "must be finite", "decimal commas in others"))
        return
    (tmp_path / "c.toml").write_text(STACK.format(measured=measured), encoding="utf-8")
    done = CliRunner().invoke(app, ["check", str(tmp_path / "c.toml")])
    assert f"{25 if number else 24} parts: mean" in done.output
    assert number or f"ring.{kind}: 1 of 25 values of ring" in done.output


def test_the_nominal_decides_on_decimals_and_keys_exist(tmp_path: Path) -> None:
    """68,001 is 68.001 in a file with semicolons, or of a nominal of 68; else the key `decimal` decides."""
    case = CASE.parent / "decimal"
    problem: Any = read(case / "motor.toml").problem
    shaft = next(part for part in problem.definition.parts if part.name == "shaft")
    lines = (case / "welle.csv").read_text(encoding="utf-8").splitlines()[2:]
    sizes = [float(line.split(";")[1].replace(",", ".")) for line in lines]
    np.testing.assert_allclose(shaft.sample.deviations, np.array(sizes) - 68.0, atol=1e-12)
    few = [size for size in sizes if f"{size:.3f}" == str(size)]
    rows = "\n".join(f"{size:.3f}".replace(".", ",") for size in few)
    (tmp_path / "ring.csv").write_text(f"ring [mm]\n{rows}", encoding="utf-8")
    text = STACK.format(measured='file = "ring.csv"\nmade_to = "50 um"').replace("{", "{{").replace("}", "}}")
    text = text.replace("sensitivity = 1.0", "sensitivity = 1.0\nnominal = {}")
    (tmp_path / "c.toml").write_text(text.format(68000.0), encoding="utf-8")
    problem = read(tmp_path / "c.toml").problem
    np.testing.assert_allclose(problem.definition.parts[0].sample.deviations, 1e3 * np.array(few) - 68e3, atol=1e-6)
    (tmp_path / "c.toml").write_text(text.replace("nominal = {}", "").replace("{{", "{").replace("}}", "}"), "utf-8")
    with pytest.raises(InputError, match=r'state decimal = "\." or decimal = ","'):
        read(tmp_path / "c.toml")
