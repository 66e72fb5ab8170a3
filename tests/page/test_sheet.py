"""The spreadsheet of allocations."""

import io
import re
import zipfile

import pandas as pd
import pytest
from openpyxl import load_workbook

from tolevo.page.sheet import allocation_sheet
from tolevo.records import RunResult


@pytest.fixture
def result() -> RunResult:
    allocation = pd.DataFrame({
        "choice": ["knee", "knee"],
        "variable": ["=1+1", "+cmd\x07"],
        "rounded": [0.5, float("nan")],
        "grade": ["IT7", None],
    })  # fmt: skip
    choices = pd.DataFrame({"choice": ["knee"], "rounded_feasible": [True], "point": [3]})
    empty = pd.DataFrame()
    summary = {"rounding": [{"variable": "=1+1", "rule": "R20", "set_by": "default"}]}
    return RunResult("t", empty, empty, empty, summary, (), allocation=allocation, choices=choices)


def sheet(result: RunResult) -> bytes:
    content = allocation_sheet(result)
    assert content is not None
    return content


def test_text_that_looks_like_a_formula_is_text(result: RunResult) -> None:
    content = sheet(result)
    book = load_workbook(io.BytesIO(content))
    assert book["Allocation"]["B2"].value == "=1+1"
    assert book["Allocation"]["B2"].data_type == "s"
    assert book["Allocation"]["B3"].value == "+cmd"
    assert book["Rounding"]["A2"].data_type == "s"
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert all(b"<f>" not in archive.read(n) for n in archive.namelist() if "worksheets" in n)


def test_numbers_are_numbers_and_gaps_are_empty(result: RunResult) -> None:
    book = load_workbook(io.BytesIO(sheet(result)))
    assert book["Allocation"]["C2"].value == 0.5
    assert book["Allocation"]["C3"].value is None
    assert book["Choices"]["B2"].value is True
    assert book["Choices"]["C2"].value == 3


def test_no_time_in_the_file(result: RunResult) -> None:
    with zipfile.ZipFile(io.BytesIO(sheet(result))) as archive:
        assert {info.date_time for info in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert set(re.findall(rb"<dcterms:.*?>(.*?)<", archive.read("docProps/core.xml"))) == {b"1980-01-01T00:00:00Z"}
    assert sheet(result) == sheet(result)
