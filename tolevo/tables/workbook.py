"""Rows of a workbook (XLSX)."""

from __future__ import annotations

import datetime
import io
import zipfile
from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

from ..errors import raise_all, refuse
from ..registry import needed
from .header import Row
from .record import Dialect
from .signs import Exact

MAX_WORKBOOK_BYTES = 32 * 1024 * 1024
"""Bytes of a workbook without its compression: some 700,000 cells."""


def rows_of_workbook(content: bytes, place: str) -> tuple[list[Row], Dialect]:
    """The rows of the only sheet that has rows. Raises InputError where several sheets have, and
    where the workbook is too large.
    """
    raise_all(needed("report"))
    from openpyxl.utils.exceptions import InvalidFileException

    try:
        formulas = has_formulas(content, place)
        return _rows_of_only_sheet(content, place, formulas)
    except (InvalidFileException, zipfile.BadZipFile, ElementTree.ParseError, KeyError, ValueError, OSError) as error:
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
