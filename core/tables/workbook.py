"""Rows of a workbook (XLSX)."""

from __future__ import annotations

import datetime
import io
import zipfile
from typing import Any

from ..errors import raise_all, refuse
from ..registry import needed
from .header import Row
from .record import Dialect
from .signs import Exact


def rows_of_workbook(content: bytes, place: str) -> tuple[list[Row], Dialect]:
    """The rows of the only sheet that has rows. Raises InputError where several sheets have."""
    raise_all(needed("report"))
    from openpyxl import load_workbook
    from openpyxl.utils.exceptions import InvalidFileException

    try:
        workbook = load_workbook(io.BytesIO(content), data_only=True)
        formulas = load_workbook(io.BytesIO(content), data_only=False)
    except (InvalidFileException, zipfile.BadZipFile, KeyError, ValueError, OSError) as error:
        raise refuse(place, f"is not a workbook ({error})") from error
    sheets = {sheet.title: _rows(sheet) for sheet in workbook.worksheets}
    filled = {title: rows for title, rows in sheets.items() if rows}
    tables = {title: rows for title, rows in filled.items() if len(rows) > 1} or filled
    if len(tables) > 1:
        raise refuse(place, f"has several sheets ({', '.join(tables)}); save a workbook with only one of them")
    if not tables:
        return [], Dialect("xlsx")
    title, rows = next(iter(tables.items()))
    _computed(workbook[title], formulas[title], place)
    return rows, Dialect("xlsx", sheet=title)


def _rows(sheet: Any) -> list[Row]:
    rows = [(at, [_cell(value) for value in row]) for at, row in enumerate(sheet.iter_rows(values_only=True), 1)]
    return [row for row in rows if any(row[1])]


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


def _computed(sheet: Any, formulas: Any, place: str) -> None:
    """Refuse formulas without a stored value: what they come to is not known."""
    blank = [
        cell.coordinate
        for row in formulas.iter_rows()
        for cell in row
        if cell.data_type == "f" and sheet[cell.coordinate].value is None
    ]
    if blank:
        raise refuse(
            f"{place}: cell {blank[0]}",
            f"{len(blank)} formulas have no stored value; open the workbook, let it calculate, and save it",
        )
