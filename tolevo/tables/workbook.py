"""Workbooks (XLSX): the rows of one that is read, and tables as the sheets of one that is written."""

from __future__ import annotations

import datetime
import io
import re
import zipfile
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd

from ..errors import refuse
from .header import Row
from .record import Dialect
from .signs import Exact

MAX_WORKBOOK_BYTES = 32 * 1024 * 1024
"""Bytes of a workbook without its compression: some 700,000 cells."""
NOT_A_WORKBOOK = (zipfile.BadZipFile, ElementTree.ParseError, KeyError, ValueError, OSError)
"""What openpyxl raises where a file is none."""


def rows_of_workbook(content: bytes, place: str) -> tuple[list[Row], Dialect]:
    """The rows of the only sheet that has rows. Raises InputError where several sheets have, and
    where the workbook is too large.
    """
    try:
        formulas = has_formulas(content, place)
        return _rows_of_only_sheet(content, place, formulas)
    except NOT_A_WORKBOOK as error:
        raise refuse(place, f"is not a workbook ({error})") from error


def has_formulas(content: bytes, place: str) -> bool:
    """Whether a sheet has formulas. Raises InputError where the workbook is too large."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        parts = [part for part in archive.infolist() if part.filename.endswith(".xml")]
        if (size := sum(part.file_size for part in parts)) > MAX_WORKBOOK_BYTES:
            most = f"{MAX_WORKBOOK_BYTES / 1e6:.0f} MB at most"
            text = f"has {size / 1e6:.0f} MB of cells, {most}: save the table as CSV or Parquet"
            raise refuse(place, text)
        sheets = [part for part in parts if part.filename.startswith("xl/worksheets/")]
        return any(b"<f" in archive.read(part) for part in sheets)


def _rows_of_only_sheet(content: bytes, place: str, formulas: bool) -> tuple[list[Row], Dialect]:
    from openpyxl import load_workbook

    workbook = load_workbook(io.BytesIO(content), read_only=True, data_only=True)
    sheets = {sheet.title: _rows(sheet) for sheet in workbook.worksheets}
    filled = {title: rows for title, rows in sheets.items() if rows}
    tables = {title: rows for title, rows in filled.items() if len(rows) > 1} or filled
    if len(tables) > 1:
        raise refuse(place, f"has several sheets ({', '.join(tables)}); save a workbook with only one of them")
    if not tables:
        return [], Dialect("xlsx")
    title, rows = next(iter(tables.items()))
    if formulas:
        stated = load_workbook(io.BytesIO(content), read_only=True, data_only=False)[title]
        _refuse_missing_values(dict(rows), stated, place)
    return rows, Dialect("xlsx", sheet=title)


def _rows(sheet: Any) -> list[Row]:
    """The rows of a sheet that are not empty, all of one length."""
    sheet.reset_dimensions()  # some programs state them wrongly
    rows = [(at, [_cell(value) for value in row]) for at, row in enumerate(sheet.iter_rows(values_only=True), 1)]
    width = max((len(row) for _, row in rows), default=0)
    return [(at, row + [""] * (width - len(row))) for at, row in rows if any(row)]


def _cell(value: Any) -> str:
    """A cell as text, a number as an exact one."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, int | float):
        return Exact(repr(value))
    if isinstance(value, datetime.datetime | datetime.date | datetime.time):
        return value.isoformat(" ") if isinstance(value, datetime.datetime) else value.isoformat()
    return str(value).strip()


def _refuse_missing_values(rows: Mapping[int, list[str]], stated: Any, place: str) -> None:
    """Refuse formulas without a stored value: what they come to is not known."""
    stated.reset_dimensions()
    blank = [
        cell.coordinate
        for at, row in enumerate(stated.iter_rows(), 1)
        for column, cell in enumerate(row)
        if cell.data_type == "f" and not (at in rows and rows[at][column])
    ]
    if blank:
        raise refuse(
            f"{place}: cell {blank[0]}",
            f"{len(blank)} formulas have no stored value; open the workbook, let it calculate, and save it",
        )


# Tables as sheets, the same bytes every time; text is never a formula.


EPOCH, DATE = (1980, 1, 1, 0, 0, 0), b"1980-01-01T00:00:00Z"
"""The times that a written workbook states, so that it does not depend on the clock."""
ILLEGAL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that a cell cannot hold."""
FORBIDDEN = re.compile(r"[\\/*?:\[\]]")
"""Characters that the name of a sheet cannot have."""
LONGEST_NAME, LONGEST_TEXT = 28, 32_767
"""Characters of the name of a sheet, without a number that tells it from others, and of a cell, at most."""
WIDEST = 44
"""Widest column [characters]."""


class Live(str):
    """A cell that a spreadsheet computes."""


def written(tables: Mapping[str, pd.DataFrame]) -> bytes:
    """The workbook with a sheet for each table, by its name."""
    from openpyxl import Workbook

    book = Workbook()
    book.remove(book.worksheets[0])
    for name, table in tables.items():
        plain = FORBIDDEN.sub(" ", ILLEGAL.sub("", name)).strip("'")[:LONGEST_NAME] or "Sheet"
        columns = [table[column].tolist() for column in table.columns]
        fill(book.create_sheet(plain), [str(column) for column in table.columns], list(zip(*columns, strict=True)))
    return saved(book)


def fill(sheet: Any, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """A bold head that stays in sight, the rows, and columns as wide as their texts; only `Live` is a formula.

    A cell is empty where there is no value, or no finite number.
    """
    from openpyxl.styles import Font

    bold = Font(bold=True)
    for at, line in enumerate([columns, *rows], start=1):
        for place, value in enumerate(line, start=1):
            if value is None or value is pd.NA or (isinstance(value, Real) and not np.isfinite(float(value))):
                continue
            cell = sheet.cell(at, place)
            if isinstance(value, Real):
                cell.value = value
                continue
            cell.value = ILLEGAL.sub("", str(value))[:LONGEST_TEXT]
            cell.data_type = "f" if isinstance(value, Live) else "s"
    for at, column in enumerate(columns, start=1):
        head = sheet.cell(1, at)
        head.font = bold
        longest = max((len(str(row[at - 1])) for row in rows if not isinstance(row[at - 1], Live | None)), default=0)
        sheet.column_dimensions[head.column_letter].width = min(WIDEST, max(longest, len(column)) + 3)
    sheet.freeze_panes = "B2"


def saved(book: Any) -> bytes:
    """The bytes of a workbook, the same every time."""
    first, buffer = io.BytesIO(), io.BytesIO()
    book.calculation.fullCalcOnLoad = True
    book.save(first)
    with zipfile.ZipFile(first) as old, zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "docProps/core.xml":
                content = re.sub(rb"(<dcterms:\w+[^>]*>)[^<]*", rb"\g<1>" + DATE, content)
            new.writestr(zipfile.ZipInfo(name, EPOCH), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
