"""The chosen allocations as a spreadsheet."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Mapping
from html import escape
from io import BytesIO
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd

from ..records import RunResult, mechanism_lines, unit_of_cost
from .document import document, shown, table
from .figures import Order, comparison, orders

# Tables as an XLSX workbook (ECMA-376), the same bytes every time; text is never a formula.
#
# It has what these tables need: numbers, truth values and text, a bold first row that stays in sight,
# and widths of columns.


ILLEGAL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that XML cannot hold."""
FORBIDDEN = re.compile(r"[\\/*?:\[\]]")
"""Characters that the name of a sheet cannot have."""
EPOCH = (1980, 1, 1, 0, 0, 0)
"""The first time that a ZIP file can state, so that the file does not depend on the clock."""
LONGEST_NAME, LONGEST_TEXT = 31, 32_767
"""Characters of the name of a sheet, and of a cell, at most."""
WIDEST = 44
"""Widest column [characters]."""

_HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_KIND = "application/vnd.openxmlformats-officedocument.spreadsheetml"
_STYLES = (
    f'{_HEAD}<styleSheet xmlns="{_MAIN}">'
    '<fonts count="2"><font><sz val="11"/><name val="Calibri"/></font>'
    '<font><b/><sz val="11"/><name val="Calibri"/></font></fonts>'
    '<fills count="2"><fill><patternFill patternType="none"/></fill>'
    '<fill><patternFill patternType="gray125"/></fill></fills>'
    '<borders count="1"><border><left/><right/><top/><bottom/><diagonal/></border></borders>'
    '<cellStyleXfs count="1"><xf numFmtId="0" fontId="0" fillId="0" borderId="0"/></cellStyleXfs>'
    '<cellXfs count="2"><xf numFmtId="0" fontId="0" fillId="0" borderId="0" xfId="0"/>'
    '<xf numFmtId="0" fontId="1" fillId="0" borderId="0" xfId="0" applyFont="1"/></cellXfs>'
    '<cellStyles count="1"><cellStyle name="Normal" xfId="0" builtinId="0"/></cellStyles>'
    "</styleSheet>"
)


def workbook(sheets: Mapping[str, pd.DataFrame]) -> bytes:
    """The workbook with a sheet for each table, by its name."""
    names = _names(list(sheets))
    places = range(1, len(names) + 1)
    parts = {
        "[Content_Types].xml": _types(places),
        "_rels/.rels": _relations({"rId1": ("officeDocument", "xl/workbook.xml")}),
        "xl/workbook.xml": _book(names),
        "xl/_rels/workbook.xml.rels": _relations(
            {f"rId{at}": ("worksheet", f"worksheets/sheet{at}.xml") for at in places}
            | {f"rId{len(names) + 1}": ("styles", "styles.xml")}
        ),
        "xl/styles.xml": _STYLES,
    }
    for at, content in zip(places, sheets.values(), strict=True):
        parts[f"xl/worksheets/sheet{at}.xml"] = _workbook_sheet(content)
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr(zipfile.ZipInfo(name, EPOCH), text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _names(wanted: list[str]) -> list[str]:
    """Names that a workbook accepts, which differ in more than their case."""
    names: list[str] = []
    for name in wanted:
        used = {earlier.lower() for earlier in names}
        plain = FORBIDDEN.sub(" ", ILLEGAL.sub("", name)).strip("'")[:LONGEST_NAME] or "Sheet"
        free, at = plain, 2
        while free.lower() in used:
            free, at = f"{plain[: LONGEST_NAME - 4]} {at}", at + 1
        names.append(free)
    return names


def _types(places: range) -> str:
    sheets = "".join(
        f'<Override PartName="/xl/worksheets/sheet{at}.xml" ContentType="{_KIND}.worksheet+xml"/>' for at in places
    )
    return (
        f'{_HEAD}<Types xmlns="{_PACKAGE}/content-types">'
        '<Default Extension="rels"'
        ' ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        '<Default Extension="xml" ContentType="application/xml"/>'
        f'<Override PartName="/xl/workbook.xml" ContentType="{_KIND}.sheet.main+xml"/>'
        f'<Override PartName="/xl/styles.xml" ContentType="{_KIND}.styles+xml"/>{sheets}</Types>'
    )


def _relations(targets: Mapping[str, tuple[str, str]]) -> str:
    elements = "".join(
        f'<Relationship Id="{key}" Type="{_OFFICE}/{kind}" Target="{target}"/>'
        for key, (kind, target) in targets.items()
    )
    return f'{_HEAD}<Relationships xmlns="{_PACKAGE}/relationships">{elements}</Relationships>'


def _book(names: list[str]) -> str:
    elements = "".join(
        f'<sheet name="{escape(name)}" sheetId="{at}" r:id="rId{at}"/>' for at, name in enumerate(names, start=1)
    )
    spaces = f'xmlns="{_MAIN}" xmlns:r="{_OFFICE}"'
    return f"{_HEAD}<workbook {spaces}><sheets>{elements}</sheets></workbook>"


def _workbook_sheet(table: pd.DataFrame) -> str:
    columns = [table[name].tolist() for name in table.columns]
    rows = [list(map(str, table.columns)), *map(list, zip(*columns, strict=True))]
    if not columns:
        return f'{_HEAD}<worksheet xmlns="{_MAIN}"><sheetData/></worksheet>'
    letters = [_letters(place) for place in range(1, len(columns) + 1)]
    widths = "".join(
        f'<col min="{place}" max="{place}" customWidth="1"'
        f' width="{min(WIDEST, max(len(str(cell)) for cell in cells) + 2)}"/>'
        for place, cells in enumerate(zip(*rows, strict=True), start=1)
    )
    body = "".join(
        f'<row r="{at}">'
        + "".join(_cell(f"{letter}{at}", value, at == 1) for letter, value in zip(letters, row, strict=True))
        + "</row>"
        for at, row in enumerate(rows, start=1)
    )
    return (
        f'{_HEAD}<worksheet xmlns="{_MAIN}"><sheetViews><sheetView workbookViewId="0">'
        '<pane ySplit="1" topLeftCell="A2" activePane="bottomLeft" state="frozen"/>'
        f"</sheetView></sheetViews><cols>{widths}</cols><sheetData>{body}</sheetData></worksheet>"
    )


def _letters(place: int) -> str:
    """The letters of a column: A of 1, AA of 27."""
    letters = ""
    while place:
        place, rest = divmod(place - 1, 26)
        letters = chr(ord("A") + rest) + letters
    return letters


def _cell(place: str, value: Any, bold: bool) -> str:
    """A cell; empty where there is no value or no finite number."""
    style = ' s="1"' if bold else ""
    if isinstance(value, bool | np.bool_):
        return f'<c r="{place}"{style} t="b"><v>{int(value)}</v></c>'
    if isinstance(value, Real):
        number = float(value)
        whole = isinstance(value, int | np.integer)
        if not np.isfinite(number):
            return ""
        return f'<c r="{place}"{style}><v>{int(number) if whole else repr(number)}</v></c>'
    if value is None or value is pd.NA:
        return ""
    text = escape(ILLEGAL.sub("", str(value))[:LONGEST_TEXT])
    kept = ' xml:space="preserve"' if text != text.strip() else ""
    return f'<c r="{place}"{style} t="inlineStr"><is><t{kept}>{text}</t></is></c>'


def allocation_sheet(result: RunResult) -> bytes | None:
    """`allocation.xlsx`: a summary that compares the allocations, a sheet for each (those that
    round to the same values share a sheet) with deviations as numbers, a table of all, the choices
    with their losses, the mechanism where the configuration describes it, the rules of rounding.

    None where nothing is chosen.
    """
    if result.allocation is None or result.choices is None:
        return None
    allocations = orders(result)
    together = comparison(result, allocations)
    sheets = {"Summary": together}
    for at, order in enumerate(allocations):
        sheets[str(together["sheet"].iloc[at])] = order.table
    sheets["Allocation"] = _drop_repetitions(result.allocation, allocations)
    sheets["Choices"] = result.choices
    more = {"Promise": result.promise, "Next parts": result.next_parts, "Capability": result.capability}
    sheets |= {title: frame for title, frame in more.items() if frame is not None}
    if lines := mechanism_lines(result.summary):
        sheets["Mechanism"] = pd.DataFrame({"mechanism": lines})
    sheets["Rounding"] = pd.DataFrame(list(result.summary.get("rounding") or ()))
    return workbook(sheets)


def _drop_repetitions(allocation: pd.DataFrame, allocations: list[Order]) -> pd.DataFrame:
    """The table of allocations without those that equal an earlier one, with all their rules."""
    if not allocations or "choice" not in allocation:
        return allocation
    rules = {order.points[0]: " ".join(order.rules) for order in allocations}
    kept = allocation[allocation["point"].isin(list(rules))]
    kept = kept.drop_duplicates(["point", "variable"])
    return kept.assign(choice=kept["point"].map(rules))


# `drawing.html`: a page to print for every chosen allocation, for the drawing office.


def drawing_page(result: RunResult) -> str | None:
    """The pages, None where nothing is chosen."""
    allocations = orders(result)
    if not allocations:
        return None
    lines = "".join(f"<p>{escape(line)}</p>" for line in mechanism_lines(result.summary))
    sheets = (_sheet(result, order) for order in allocations)
    return document(f"{result.title}: for the drawing", sheets, head=lines)


def _sheet(result: RunResult, order: Order) -> str:
    cost = unit_of_cost(result.summary)
    values = ", ".join(
        f"{axis.name.replace('_', ' ')} {shown(order.outcome.get(f'rounded_{axis.name}'))} "
        f"{cost if axis.name == 'cost' else ''}".strip()
        for axis in result.objectives
    )
    statement = f"Verified by the full model: {values}{order.verdict}."
    return (
        f'<section class="sheet">\n<h2>{escape(order.title)}</h2>\n<p>{escape(order.note)}</p>'
        f"\n<p>{escape(statement)}</p>\n{table(order.sheet)}\n</section>"
    )
