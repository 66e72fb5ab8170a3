"""Cells that a spreadsheet would compute are text in every CSV file, and come back as they were."""

from __future__ import annotations

import io
import random
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.files import csv_text, neutralise_cell, read_own_csv, restore_cell
from tolevo.tables import read_table, write

FORMULAS = [
    "=1+1",
    "=HYPERLINK(A1)",
    "+cmd|' /C calc'!A0",
    "-2+3",
    "@SUM(A1:A9)",
    "\t=1",
    "\r=1",
    "+0.02/-0.01",  # limits of a part: a spreadsheet would show -2
    "-A",
    "'=1+1",  # had an apostrophe already: the file must tell it from the first
    "''@x",
]
KEPT = ["-0.5", "+1e-3", "-.5", "-0.5; 0.25", "-inf", "", "housing", "25 H7", "a=b", "'quoted'", "'"]


@pytest.mark.parametrize("text", FORMULAS)
def test_what_begins_like_a_formula_becomes_text_and_comes_back(text: str) -> None:
    assert neutralise_cell(text) == f"'{text}"
    assert restore_cell(neutralise_cell(text)) == text


@pytest.mark.parametrize("text", KEPT)
def test_numbers_and_other_texts_stay(text: str) -> None:
    assert neutralise_cell(text) == text
    assert restore_cell(text) == text


def test_marks_are_undone_for_any_text() -> None:
    """Ten thousand texts of the signs that matter."""
    draw = random.Random(1)
    for _ in range(10_000):
        text = "".join(draw.choices("'=+-@\t\r1.5e;a ", k=draw.randint(0, 6)))
        written = neutralise_cell(text)
        assert restore_cell(written) == text
        assert written[:1] not in ("=", "@")


def test_a_table_keeps_its_numbers_and_its_columns(tmp_path: Path) -> None:
    frame = pd.DataFrame({
        "label": ["=1+1", "plain", float("nan")],
        "shift": [-0.5, 1.0, float("nan")],
        "count": [-1, 0, 1],
        "@name": ["-a", "-0.5", "b"],
    })  # fmt: skip
    text = csv_text(frame)
    assert text == "label,shift,count,'@name\n'=1+1,-0.5,-1,'-a\nplain,1.0,0,-0.5\n,,1,b\n"
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    pd.testing.assert_frame_equal(read_own_csv(tmp_path / "t.csv"), frame, check_dtype=False)


def test_every_number_is_read_as_it_was_written(tmp_path: Path) -> None:
    """Before 3.1 pandas lost the last digit of 30 % of them."""
    rng = np.random.default_rng(0)
    numbers = rng.random(10_000) * 10.0 ** rng.integers(-12, 12, 10_000)
    (tmp_path / "t.csv").write_text(csv_text(pd.DataFrame({"x": numbers})), encoding="utf-8")
    np.testing.assert_array_equal(read_own_csv(tmp_path / "t.csv")["x"], numbers)


def test_a_table_without_such_cells_is_that_of_pandas() -> None:
    frame = pd.DataFrame({"a": [1.5, -2.0], "b": ["x", "y"], "c": [True, None]})
    assert csv_text(frame) == frame.to_csv(index=False, lineterminator="\n")
    assert pd.read_csv(io.StringIO(csv_text(frame)))["a"].tolist() == [1.5, -2.0]


@pytest.mark.parametrize("rows", [2, 40_000])
def test_the_tables_of_commands_read_what_they_wrote(tmp_path: Path, rows: int) -> None:
    """Few rows are read cell by cell, many at once."""
    frame = pd.DataFrame({
        "lot": ["=A", "-B"] * (rows // 2),
        "backlash_arcmin": [0.5, -0.25] * (rows // 2),
    })  # fmt: skip
    write(frame, tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_text("utf-8").splitlines()[1:3] == ["'=A,0.5", "'-B,-0.25"]
    found = read_table(tmp_path / "t.csv")
    assert found.cells["lot"].tolist() == found.frame["lot"].tolist() == frame["lot"].tolist()
    assert found.frame["backlash_arcmin"].tolist() == frame["backlash_arcmin"].tolist()


def test_parquet_needs_no_marks(tmp_path: Path) -> None:
    frame = pd.DataFrame({"lot": ["=A", "'=B"], "backlash_arcmin": [0.5, -0.25]})
    write(frame, tmp_path / "t.parquet")
    assert pd.read_parquet(tmp_path / "t.parquet")["lot"].tolist() == ["=A", "'=B"]
    assert read_table(tmp_path / "t.parquet").frame["lot"].tolist() == ["=A", "'=B"]
