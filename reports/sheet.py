"""The chosen allocations as a spreadsheet, the same bytes every time; text is never a formula."""

from __future__ import annotations

import re
import zipfile
from io import BytesIO
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..records import RunResult, mechanism_lines
from .orders import comparison, orders

if TYPE_CHECKING:
    from openpyxl.worksheet.worksheet import Worksheet

ILLEGAL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
"""Characters that XML cannot hold."""
FORBIDDEN = re.compile(r"[\\/*?:\[\]]")
"""Characters that the name of a sheet cannot have."""
MODIFIED = re.compile(rb"(<dcterms:(created|modified)[^>]*>)[^<]*(<)")
EPOCH = (1980, 1, 1, 0, 0, 0)
"""The first moment that a ZIP file can name."""
WIDEST = 44
"""Widest column [characters]."""


def allocation_sheet(result: RunResult) -> bytes | None:
    """`allocation.xlsx`: a summary that compares the allocations, a sheet for each (those that
    round to the same are one) with deviations as numbers, all of them in one table, choices with
    their losses, the mechanism where the configuration describes it, how each variable is rounded.

    None where nothing was chosen, or openpyxl (the extra `report`) is not installed.
    """
    if result.allocation is None or result.choices is None:
        return None
    try:
        from openpyxl import Workbook
    except ModuleNotFoundError:
        return None
    book = Workbook()
    first = book.active
    assert first is not None
    found = orders(result)
    first.title = "Summary"
    together = comparison(result, found)
    _fill(first, together)
    for name, order in zip(_titles(together), found, strict=True):
        _fill(book.create_sheet(name), order.table)
    _fill(book.create_sheet("Allocation"), result.allocation)
    _fill(book.create_sheet("Choices"), result.choices)
    for title, frame in (("Promise", result.promise), ("Next parts", result.next_parts),
                         ("Capability", result.capability)):  # fmt: skip
        if frame is not None:
            _fill(book.create_sheet(title), frame)
    if lines := mechanism_lines(result.summary):
        _fill(book.create_sheet("Mechanism"), pd.DataFrame({"mechanism": lines}))
    _fill(book.create_sheet("Rounding"), pd.DataFrame(list(result.summary.get("rounding") or ())))
    buffer = BytesIO()
    book.save(buffer)
    return _timeless(buffer.getvalue())


def _titles(together: pd.DataFrame) -> list[str]:
    """Names of sheets: without the letters that a spreadsheet refuses in them."""
    if together.empty:
        return []
    return [FORBIDDEN.sub(" ", str(name)) for name in together["sheet"]]


def _fill(sheet: Worksheet, frame: pd.DataFrame) -> None:
    from openpyxl.styles import Font
    from openpyxl.utils import get_column_letter

    columns = [frame[name].tolist() for name in frame.columns]
    table = [list(map(str, frame.columns)), *map(list, zip(*columns, strict=True))]
    for at, row in enumerate(table, start=1):
        for place, value in enumerate(row, start=1):
            known = _cell(value)
            cell = sheet.cell(at, place, known)
            if isinstance(known, str):
                cell.data_type = "s"  # a text that begins with = is no formula
            if at == 1:
                cell.font = Font(bold=True)
    for place, cells in enumerate(zip(*table, strict=True), start=1):
        width = min(WIDEST, max(len(str(cell)) for cell in cells) + 2)
        sheet.column_dimensions[get_column_letter(place)].width = width
    sheet.freeze_panes = "A2"


def _cell(value: Any) -> str | float | int | bool | None:
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, Real):
        number = float(value)
        whole = isinstance(value, int | np.integer)
        return None if not np.isfinite(number) else int(number) if whole else number
    return None if value is None or value is pd.NA else ILLEGAL.sub("", str(value))


def _timeless(content: bytes) -> bytes:
    """The same archive with every time set to `EPOCH`."""
    buffer = BytesIO()
    with (
        zipfile.ZipFile(BytesIO(content)) as old,
        zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for name in old.namelist():
            data = old.read(name)
            if name == "docProps/core.xml":
                data = MODIFIED.sub(rb"\g<1>1980-01-01T00:00:00Z\g<3>", data)
            new.writestr(zipfile.ZipInfo(name, EPOCH), data, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
