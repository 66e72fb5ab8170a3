"""Zones by standards in a stack: fits of two parts, searched grades, general tolerances, labels."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from openpyxl import load_workbook
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.iso286 import grade_um

HEAD = """
problem = "stack"
name = "bearing seat"
description = "Axial play of the output bearing"
drawing = "4711-00"
[requirement]
name = "end play"
unit = "mm"
lower = 0.0
drawing = "4711-00, B4"
"""
SEAT = """
[[part]]
name = "bore"
unit = "mm"
nominal = 25.0
sensitivity = 1.0
drawing = 4711
characteristic = "12"
[[part]]
name = "pin"
unit = "mm"
nominal = 25.0
sensitivity = -1.0
[[fit]]
parts = ["bore", "pin"]
size = "25 H7/g6"
"""
SEARCHED = """
[[part]]
name = "cover"
unit = "mm"
nominal = 40.0
sensitivity = 1.0
grade = ["IT5", "IT8"]
price = { IT5 = 31.0, IT6 = 18.0, IT7 = 11.0, IT8 = 7.5 }
geometry = "position"
[[part]]
name = "spacer"
unit = "mm"
nominal = 8.0
sensitivity = -1.0
grade = ["IT6", "IT9"]
cost = { model = "reciprocal", a = 1.0, b = 0.05 }
"""
GENERAL = """
[[part]]
name = "plate"
unit = "mm"
nominal = 80.0
sensitivity = 0.1
general = "m"
"""


def written(text: str, folder: Path) -> Path:
    path = folder / "seat.toml"
    path.write_text(text, encoding="utf-8")
    return path


def built(config: Path) -> Any:
    """The problem that a configuration states."""
    return read(config).problem


def run(config: Path, out: Path) -> pd.DataFrame:
    """The front of `tolevo run`."""
    done = CliRunner().invoke(app, ["run", str(config), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "mechanism bearing seat (drawing 4711-00)" in done.stdout
    return pd.read_csv(out / "front.csv")


def test_a_fit_states_the_zones_of_two_parts(tmp_path: Path) -> None:
    """25 H7/g6: 0/+21 um and -20/-7 um."""
    free = HEAD + SEAT + SEARCHED + GENERAL
    problem = built(written(free, tmp_path))
    bore, pin, *_, plate = problem.definition.parts
    assert (bore.mid, bore.low) == pytest.approx((0.0105, 0.0105))
    assert (pin.mid, pin.low) == pytest.approx((-0.0135, 0.0065))
    assert (plate.low, plate.fixed) == (0.3, True)
    assert (bore.drawing, bore.characteristic) == ("4711", "12")


def test_searched_grades_are_those_of_an_enumeration(tmp_path: Path) -> None:
    """The least cost of each of 16 pairs of grades at a root sum of squares that is not above."""
    text = HEAD + SEARCHED + '[objectives]\nminimise = ["cost"]\n[limits]\nrss = 0.026\n'
    text += '[algorithm]\nname = "exact"\n'
    front = run(written(text, tmp_path), tmp_path / "out")
    prices = {"IT5": 31.0, "IT6": 18.0, "IT7": 11.0, "IT8": 7.5}
    costs = {}
    for cover, spacer in itertools.product(prices, ("IT6", "IT7", "IT8", "IT9")):
        t = grade_um(cover, 40.0) / 2000.0, grade_um(spacer, 8.0) / 2000.0
        if math.hypot(*t) <= 0.026:
            costs[cover, spacer] = prices[cover] + 1.0 + 0.05 / t[1]
    best = min(costs, key=costs.__getitem__)
    row = front.iloc[0]
    assert row["cost"] == pytest.approx(costs[best])
    assert row["bound"] == pytest.approx(costs[best], rel=1e-6)
    assert (row["cover_process"], row["spacer_process"]) == best


def test_labels_go_through_to_page_and_sheet(tmp_path: Path) -> None:
    text = HEAD + SEAT + SEARCHED + GENERAL + '[algorithm]\nname = "exact"\npoints = 5\n'
    out = tmp_path / "out"
    run(written(text, tmp_path), out)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<title>bearing seat" in page and "Axial play of the output bearing" in page
    book = load_workbook(out / "allocation.xlsx")
    mechanism = [row[0] for row in book["Mechanism"].iter_rows(values_only=True)]
    assert "mechanism bearing seat (drawing 4711-00): Axial play of the output bearing" in mechanism
    assert "requirement end play, at least 0 mm (drawing 4711-00, B4)" in mechanism
    heads, *rows = book["Allocation"].iter_rows(values_only=True)
    of = {row[heads.index("variable")]: dict(zip(heads, row, strict=True)) for row in rows}
    bore, pin = of["bore_t"], of["pin_t"]
    assert (bore["lower_deviation"], bore["upper_deviation"], bore["grade"]) == (0.0, 0.021, "H7")
    assert (pin["lower_deviation"], pin["upper_deviation"], pin["grade"]) == (-0.02, -0.007, "g6")
    assert (bore["drawing"], bore["characteristic"]) == ("4711", "12")
    assert of["cover_t"]["symbol"] == "\u2316 position"
    stated = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert "bearing seat" in json.dumps(stated)


def test_a_dearer_coarser_grade_is_said(tmp_path: Path) -> None:
    text = HEAD + SEARCHED.replace("IT8 = 7.5", "IT8 = 12.5")
    (told,) = built(written(text, tmp_path)).warnings()
    assert "IT8 costs 12.5, IT7 11" in told and "never chosen" in told


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [('"25 H7/g6"', '"25 g6/H7"', "fit[0].size", "hole first, in capitals"),
     ('"25 H7/g6"', '"30 H7/g6"', "part[0].fit", "size of 30 mm, but the nominal is 25 mm"),
     ('"25 H7/g6"', '"25 H7/cd6"', "part[1].fit", "no fundamental deviation cd"),
     ('["bore", "pin"]', '["bore", "pn"]', "fit[0].parts", 'did you mean `pin`'),
     ('["bore", "pin"]', '["bore", "bore"]', "fit[0].parts", "two different parts"),
     ('name = "pin"', 'name = "pin"\ntolerance = 0.1', "part[1].tolerance", "second statement"),
     ("[[fit]]", '[[fit]]\nparts = ["bore", "pin"]\nsize = "25 H7/h6"\n[[fit]]', "fit[1].parts",
      "in another [[fit]]")],
)  # fmt: skip
def test_faults_of_fits(old: str, new: str, place: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read(written((HEAD + SEAT).replace(old, new, 1), tmp_path))
    found = [str(fault) for fault in caught.value.faults]
    assert any(one.startswith(f"{place}: ") and words in one for one in found), found


COLUMNS = """
[columns]
"Deckel [µm]" = "cover_t"
"Fertigung Deckel" = "cover_process"
"Distanz" = { of = "spacer_t", unit = "um" }
"Distanz Klasse" = "spacer_process"
"Bemerkung" = "ignore"
"""
TABLE = """Bemerkung;Deckel [µm];Fertigung Deckel;Distanz;Distanz Klasse
erste;12,5;IT7;7,5;IT7
"""


def test_designs_in_columns_of_a_works(tmp_path: Path) -> None:
    """`[columns]` says what the columns of a table of designs are, in any language and unit."""
    config = written(HEAD + SEARCHED + COLUMNS, tmp_path)
    table, out = tmp_path / "d.csv", tmp_path / "o.csv"
    table.write_text(TABLE, encoding="cp1252")
    done = CliRunner().invoke(app, ["evaluate", str(config), str(table), "--out", str(out)])
    assert done.exit_code == 0, done.output
    row = pd.read_csv(out).iloc[0]
    assert row["rss"] == pytest.approx(math.hypot(0.0125, 0.0075))
    assert row["cost"] == pytest.approx(11.0 + 1.0 + 0.05 / 0.0075)
    resolved = tmp_path / "resolved.toml"
    resolved.write_text(CliRunner().invoke(app, ["check", str(config)]).stdout, encoding="utf-8")
    assert built(resolved).settings.columns == built(config).settings.columns
    wrong = (HEAD + SEARCHED + COLUMNS).replace('"cover_t"', '"cover"').replace('"um"', '"deg"')
    with pytest.raises(InputError) as caught:
        read(written(wrong, tmp_path))
    said = str(caught.value)
    assert '"cover" is not a column of the problem (did you mean `cover_t`?)' in said
    assert '"deg" cannot be stated in mm' in said
