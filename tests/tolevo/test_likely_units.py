"""Numbers in the wrong unit: the likely one is named, by a factor of 25.4, 60 or 1000."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from tolevo.cli import app
from tolevo.units import likely_unit


@pytest.mark.parametrize(
    ("value", "unit", "low", "high", "wanted"),
    [(0.064, "mm", 20.0, 200.0, "m"), (2.5, "mm", 20.0, 200.0, "in"), (8000.0, "um", 1.0, 10.0, ""),
     (0.008, "um", 1.0, 10.0, "mm"), (60.0, "arcmin", 0.5, 3.0, "arcsec"),
     (0.02, "arcmin", 0.5, 3.0, "deg"), (5.0, "um", 1.0, 10.0, ""), (5.0, "", 10.0, 20.0, ""),
     (412000.0, "N m", 10.0, 2000.0, "N mm")],
)  # fmt: skip
def test_likely_unit(value: float, unit: str, low: float, high: float, wanted: str) -> None:
    assert likely_unit(value, unit, low, high) == wanted


def checked(folder: Path, text: str) -> Result:
    config = folder / "c.toml"
    config.write_text(text, encoding="utf-8")
    return CliRunner().invoke(app, ["check", str(config)])


REDUCER = """
problem = "rv_backlash"
[parameters]
reading = "printed"
{parameter}
[variables.pitch_um]
{variable}
"""


def test_parameters_and_ranges_in_another_unit_are_warned_of(tmp_path: Path) -> None:
    text = REDUCER.format(parameter="pin_circle_radius_mm = 2.5197", variable="high = 0.01\nlow = 0.001")
    done = checked(tmp_path, text.replace("[parameters]", "[parameters]\neccentricity_mm = 0.05"))
    assert done.exit_code == 0, done.output
    said = "2.5197 mm is far from what is usual (64 mm) (was in meant? "
    assert f'parameters.pin_circle_radius_mm: {said}"2.5197 in" is 64.0004 mm)' in done.stdout
    said = "0.01 um is far from what is usual (1 to 15 um) (was mm meant?"
    assert f"variables.pitch_um.high: {said}" in done.stdout


def test_impossible_geometry_names_the_likely_unit_among_its_faults(tmp_path: Path) -> None:
    done = checked(tmp_path, 'problem = "rv_reducer"\n[parameters]\npin_circle_radius_mm = 0.064\n')
    assert done.exit_code == 2
    assert "neighbouring pins overlap" in done.output
    assert 'was m meant? "0.064 m" is 64 mm' in done.output


STACK = """
problem = "stack"
[requirement]
unit = "mm"
[[part]]
name = "a"
nominal = 25.0
sensitivity = 1.0
t_min = {low}
t_max = {high}
cost = {{ model = "reciprocal", a = 1.0, b = 0.1 }}
"""


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [(10.0, 100.0, "a tolerance of 10 mm is large for a size of 25 mm (was um meant?"),
     (0.00001, 0.0001, 'a tolerance of 1e-05 mm is small for a size of 25 mm (was m meant?'),
     (0.01, 0.1, "")],
)  # fmt: skip
def test_tolerances_of_parts_that_are_no_tolerances_of_their_size(
    low: float, high: float, words: str, tmp_path: Path
) -> None:
    done = checked(tmp_path, STACK.format(low=low, high=high))
    assert done.exit_code == 0, done.output
    assert words in done.stdout and ("was" in done.stdout) == bool(words)


def test_designs_in_another_unit(tmp_path: Path) -> None:
    """Values below the searched range by a thousand: asked about first, unless 0 (a limit)."""
    config, table, out = tmp_path / "c.toml", tmp_path / "d.csv", tmp_path / "o.csv"
    config.write_text(STACK.format(low=0.01, high=0.1), encoding="utf-8")
    for values, words in (("20\n50", "is column a_t in another unit? 20 mm"), ("0\n0.05", "")):
        table.write_text(f"a_t\n{values}\n", encoding="utf-8")
        done = CliRunner().invoke(app, ["evaluate", str(config), str(table), "--out", str(out)])
        assert done.exit_code == 0, done.output
        assert words in done.output and ("another unit" in done.output) == bool(words)


@pytest.mark.parametrize(("text", "decimal"), [("a_t;b\n0.05;1\n0.06;2\n", ","), ("a_t;b\n0,05;1\n0,06;2\n", ".")])
def test_a_table_in_the_wrong_language_of_decimals(text: str, decimal: str, tmp_path: Path) -> None:
    config, table, out = tmp_path / "c.toml", tmp_path / "d.csv", tmp_path / "o.csv"
    config.write_text(STACK.format(low=0.01, high=0.1), encoding="utf-8")
    table.write_text(text, encoding="utf-8")
    arguments = ["evaluate", str(config), str(table), "--out", str(out), "--decimal", decimal]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 2 and not out.exists()
    assert f'd.csv: column a_t: its numbers have decimal signs that are not "{decimal}"' in done.output
