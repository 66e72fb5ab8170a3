"""Workbooks and Parquet files, and columns by the names of what reads them."""

from __future__ import annotations

from pathlib import Path

import openpyxl
import pandas as pd
import pytest

import tolevo
from tolevo import tables
from tolevo.tables import ColumnUse

Rows = list[list[object]]


def workbook(folder: Path, rows: Rows, more: Rows | None = None) -> Path:
    book = openpyxl.Workbook()
    assert book.active is not None
    for row in rows:
        book.active.append(row)
    for row in more or []:
        (book["Zwei"] if "Zwei" in book.sheetnames else book.create_sheet("Zwei")).append(row)
    book.save(folder / "t.xlsx")
    return folder / "t.xlsx"


ROWS: Rows = [["Protokoll"], [], ["Teil", "Spiel [arcmin]"], ["A1", 1.234], ["A2", None], ["A3", 1.5]]


def test_a_workbook_holds_numbers_as_such(tmp_path: Path) -> None:
    found = tolevo.read_table(workbook(tmp_path, ROWS))
    assert found.frame["Spiel"].tolist() == [1.234, None, 1.5]  # 1.234 is a number, not a text
    assert found.units == {"Spiel": "arcmin"}
    assert found.frame.index.tolist() == [4, 5, 6]


def test_text_of_a_workbook_is_not_guessed(tmp_path: Path) -> None:
    rows: Rows = [["Teil", "Spiel"], ["A1", "1,234"], ["A2", "1,235"]]
    with pytest.raises(tolevo.ConfigurationError, match="--decimal"):
        tolevo.read_table(workbook(tmp_path, rows))


def test_two_sheets_are_asked_for(tmp_path: Path) -> None:
    with pytest.raises(tolevo.ConfigurationError, match=r"several sheets .*Zwei"):
        tolevo.read_table(workbook(tmp_path, ROWS, ROWS))


def test_a_formula_without_a_value_is_refused(tmp_path: Path) -> None:
    rows: Rows = [["Teil", "Spiel"], ["A1", "=1+1"]]
    with pytest.raises(tolevo.ConfigurationError, match="cell B2: 1 formulas have no stored value"):
        tolevo.read_table(workbook(tmp_path, rows))


def test_parquet(tmp_path: Path) -> None:
    frame = pd.DataFrame({"x": [1.5, 2.0], "s": ["a", "b"]})
    frame.to_parquet(tmp_path / "t.parquet")
    found = tolevo.read_table(tmp_path / "t.parquet").frame
    assert found["x"].tolist() == [1.5, 2.0]
    assert found["s"].tolist() == ["a", "b"]


def table(folder: Path, text: str) -> tables.Table:
    (folder / "t.csv").write_text(text)
    found: tables.Table = tolevo.read_table(folder / "t.csv")
    return found


def test_a_column_is_known_by_name_and_unit(tmp_path: Path) -> None:
    found = table(tmp_path, "Torque [N mm];x\n100000;0,5\n-200000;0,6\n")
    fitted = tables.fitted(found, "t.csv", {"torque_Nm": "N m"})
    assert fitted.cells["torque_Nm"].tolist() == [100.0, -200.0]
    assert fitted.notes == ('"Torque [N mm]" is read as torque_Nm',)


def test_mapped_columns_are_converted_and_turned(tmp_path: Path) -> None:
    found = table(tmp_path, "间隙 [arcsec];x\n24,6;0,5\n30;n.i.O.\n")
    uses = {"间隙": ColumnUse("backlash_arcmin", sense=-1), "x": ColumnUse("t_mm", "um")}
    fitted = tables.fitted(found, "t.csv", {"backlash_arcmin": "arcmin", "t_mm": "mm"}, uses)
    assert fitted.cells["backlash_arcmin"].tolist() == pytest.approx([-0.41, -0.5], rel=1e-12)
    assert fitted.cells["t_mm"].tolist() == [pytest.approx(0.0005), "n.i.O."]
    assert not fitted.faults


@pytest.mark.parametrize(
    ("uses", "said"),
    [
        ({"Spiel": ColumnUse("b_arcmin", "deg")}, 'the file says "arcmin", the configuration'),
        ({"Spiel": ColumnUse("t_mm")}, '"arcmin" cannot be stated in mm'),
        ({"Spil": ColumnUse("b_arcmin")}, "has no such column (did you mean `Spiel`?)"),
        ({"Spiel": ColumnUse("b_arcmin"), "x": ColumnUse("b_arcmin")}, "only one column can be"),
    ],
)
def test_faults_of_mapped_columns(tmp_path: Path, uses: dict[str, ColumnUse], said: str) -> None:
    found = table(tmp_path, "Spiel [arcmin];x\n0,5;0,6\n")
    fitted = tables.fitted(found, "t.csv", {"b_arcmin": "arcmin", "t_mm": "mm"}, uses)
    assert said in "\n".join(map(str, fitted.faults))


def test_a_name_and_a_unit_that_contradict(tmp_path: Path) -> None:
    found = table(tmp_path, "te_arcsec [deg];x\n0,5;0,6\n")
    fitted = tables.fitted(found, "t.csv", {"te_arcsec": "arcsec"})
    assert 'is stated in "deg", but te_arcsec is in "arcsec"' in str(fitted.faults[0])


def test_what_nothing_needs_is_a_note_but_a_slip_is_none(tmp_path: Path) -> None:
    found = table(tmp_path, "Seriennr.;temperatur_C;x\n4711;20,5;1,5\n")
    kept, notes = tables.without_unused(found.cells, ["x", "temperature_C"])
    assert list(kept) == ["temperatur_C", "x"]
    assert notes == ["not used: Seriennr."]
