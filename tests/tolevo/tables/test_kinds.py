"""Workbooks and Parquet files, and columns by the names of what reads them."""

from __future__ import annotations

import time
import zipfile
from pathlib import Path

import openpyxl
import pandas as pd
import pytest

import tolevo
from tolevo import tables
from tolevo.tables import ColumnUse
from tolevo.tables import fit_columns as fitted
from tolevo.units import converted

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
    fitted = tables.fit_columns(found, "t.csv", {"torque_Nm": "N m"})
    assert fitted.cells["torque_Nm"].tolist() == [100.0, -200.0]
    assert fitted.notes == ('"Torque [N mm]" is read as torque_Nm',)


def test_mapped_columns_are_converted_and_turned(tmp_path: Path) -> None:
    found = table(tmp_path, "间隙 [arcsec];x\n24,6;0,5\n30;n.i.O.\n")
    uses = {"间隙": ColumnUse("backlash_arcmin", sense=-1), "x": ColumnUse("t_mm", "um")}
    fitted = tables.fit_columns(found, "t.csv", {"backlash_arcmin": "arcmin", "t_mm": "mm"}, uses)
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
    fitted = tables.fit_columns(found, "t.csv", {"b_arcmin": "arcmin", "t_mm": "mm"}, uses)
    assert said in "\n".join(map(str, fitted.faults))


def test_a_name_and_a_unit_that_contradict(tmp_path: Path) -> None:
    found = table(tmp_path, "te_arcsec [deg];x\n0,5;0,6\n")
    fitted = tables.fit_columns(found, "t.csv", {"te_arcsec": "arcsec"})
    assert 'is stated in "deg", but te_arcsec is in "arcsec"' in str(fitted.faults[0])


def test_what_nothing_needs_is_a_note_but_a_slip_is_none(tmp_path: Path) -> None:
    found = table(tmp_path, "Seriennr.;temperatur_C;x\n4711;20,5;1,5\n")
    kept, notes = tables.drop_unused(found.cells, ["x", "temperature_C"])
    assert list(kept) == ["temperatur_C", "x"]
    assert notes == ["not used: Seriennr."]


STARTS = "2025-11-09T09:27:03.748"


@pytest.mark.parametrize(
    ("texts", "elapsed"),
    [
        ((f"{STARTS}Z", "2025-11-09T09:27:03.849Z"), 0.101),
        ((f"{STARTS}+01:00", "2025-11-09T09:27:03.849+0100"), 0.101),
        ((f"{STARTS}Z", "2025-11-09T10:27:03.849+01:00"), 0.101),
        (("2025-11-09 09:27:03.748000001", "2025-11-09 09:27:03.748000251"), 250e-9),
        (("11/30/2025 11:59:59 PM", "12/01/2025 12:00:01 AM"), 2.0),
        (("30.11.2025 11:59 am", "30.11.2025 12:01 p.m."), 120.0),
        (("09:27:03.5", "09:27:05"), 1.5),
        (("9:27:03 AM", "1:27:03 PM"), 14400.0),
    ],
)
def test_times_as_loggers_write_them(texts: tuple[str, str], elapsed: float, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("t;x\n" + "".join(f"{text};1\n" for text in texts), encoding="utf-8")
    found = fitted(tolevo.read_table(tmp_path / "t.csv"), "t.csv", {"time_s": "s"}, {"t": ColumnUse("time_s")})
    assert found.faults == ()
    assert found.cells["time_s"].tolist() == pytest.approx([0.0, elapsed], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        ((f"{STARTS}Z", STARTS), "has times in two formats"),
        (("13:00:00 PM", "2:00:00 PM"), "is not a time"),
        (("2025-11-09T25:00:00", "2025-11-09T09:00:00"), "is not a time"),
    ],
)
def test_times_that_are_none(texts: tuple[str, str], words: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("t;x\n" + "".join(f"{text};1\n" for text in texts), encoding="utf-8")
    found = fitted(tolevo.read_table(tmp_path / "t.csv"), "t.csv", {"time_s": "s"}, {"t": ColumnUse("time_s")})
    assert words in found.faults[0].message


def test_a_numbered_column_keeps_its_name_and_mm_may_be_in_capitals(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("pos (1);pos (2);count [1];d [MM]\n1.5;2;3;4\n2.5;3;4;5\n", encoding="utf-8")
    table = tolevo.read_table(tmp_path / "t.csv")
    assert list(table.frame) == ["pos (1)", "pos (2)", "count", "d"]
    assert converted(1.0, table.units["d"], "um") == 1000.0


def test_a_large_workbook_is_refused_before_it_is_opened(tmp_path: Path) -> None:
    """10 MB of 1.4 million cells took 3 GiB."""
    path = tmp_path / "t.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", b"<c r='A1'><v>0.25</v></c>" * 1_500_000)
    begin = time.process_time()
    with pytest.raises(tolevo.ConfigurationError, match=r"has 38 MB of cells, 34 MB at most: save the table as CSV"):
        tolevo.read_table(path)
    assert time.process_time() - begin < 2.0


def test_a_log_with_zones_and_numbered_columns_is_analysed() -> None:
    case = Path(__file__).parents[2] / "cases" / "times"
    found = tolevo.gap(case / "log.toml", case / "log.csv")
    assert found.record is not None
    assert found.record.verdict == "no_gap"
    assert [axis.name for axis in found.record.outputs] == ["pos (1)"]
