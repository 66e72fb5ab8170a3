"""The head of a table and its columns: names and units in them ("Spiel [arcmin]"), where they stand
below a preamble and above the measurements, and the columns by the names of what reads them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from ..errors import Fault, nearest
from ..units import converted, dimension, fits, split_unit
from .record import Table
from .signs import PLAIN, Exact, bare, is_date, is_missing, is_summary, notation, seconds

_SPELLINGS = {
    "rpm": "U/min",
    "degC": "℃",
    "degF": "℉",
    "deg": "度 ° Grad DEG Deg",
    "inch": "IN In INCH Inch Zoll zoll",
    "arcmin": "Bogenminuten Winkelminuten Bogenmin ′ ' 角分 分",
    "arcsec": "Bogensekunden Winkelsekunden Bogensek ″ '' \" 角秒",
    "mm": "毫米 ㎜ ミリ MM Millimeter",
    "um": "微米 μm µm ㎛ mym UM µM Mikrometer",
    "N m": "Nm N·m N*m 牛米",
    "s": "秒 sec sek Sek",
    "min": "minute",
    "h": "Std",
}
"""What measuring rooms write, by the name of the unit in the units module."""
ALIASES = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings.split()}
CURRENCIES = "EUR", "USD", "GBP", "CHF", "JPY", "CNY", "€", "$", "£", "¥"
"""Known to be no units without the library of units, which takes a third of a second to read."""
UNKNOWN = frozenset(["grad", "GRAD", "min.", "分", "B", "d", "a", "l", "r", "h.", *CURRENCIES])
"""Words that are ambiguous: no unit is read from them."""
UNIT_WORDS = "unit units einheit einheiten 单位 単位"
"""What a column or row of units is called."""
_BRACKETS = re.compile(r"(?P<name>.*?)\s*[\[(（［【〔](?P<unit>[^\[\]()（）［］【】]+)[\])）］】〕]\s*")
_SLASH = re.compile(r"(?P<name>.*\S)\s+(?:/|in)\s*(?P<unit>\S+)")


@lru_cache(maxsize=4096)
def known_unit(text: str) -> str | None:
    """The unit that a text states, None where it is none."""
    text = text.strip()
    text = ALIASES.get(text, text)
    if not text or text in UNKNOWN or (text.isdecimal() and text != "1"):
        return None
    try:
        dimension(text)
    except ValueError:
        return None
    return text


def split_header(header: str) -> tuple[str, str]:
    """A column name without its unit, and the unit; empty where the name states none."""
    for pattern in (_BRACKETS, _SLASH):
        match = pattern.fullmatch(header)
        if match and match["name"] and (unit := known_unit(match["unit"])):
            if unit == "1" and "[" not in header:
                break  # "pos (1)" is the first of several
            return match["name"].strip(), "" if unit == "1" else unit
    return header, ""


def names_of(header: list[str]) -> dict[str, str]:
    """Column names without their units; whole where two would then be the same."""
    short = {name: split_header(name)[0] for name in header}
    taken = list(short.values()) + list(short)
    return {
        name: short_name if short_name == name or taken.count(short_name) == 1 else name
        for name, short_name in short.items()
    }


def unit_of_cell(cell: str) -> str | None:
    """The unit that a cell of a row of units states, "1" for "-"; None where it is no unit."""
    text = cell.strip().strip("[]()（）［］【】").strip()
    return "1" if text in ("-", "--", "–", "1", "Text", "text") else known_unit(text)


# Where the column names stand: below a preamble, above a row of units, above the measurements.


Row = tuple[int, list[str]]
"""The number of a line, and its cells."""
SAMPLE = 400
"""Rows from the end that say which columns hold numbers."""


@dataclass(slots=True)
class Layout:
    """The rows of a table by kind: names, units, measurements, and those of nominal sizes, limits
    and statistics, which are no measurements; `faults` where that is ambiguous. `blocks` are the
    titles of tables with the same names, a title for each row of the body.
    """

    header: Row = (0, [])
    units: Row | None = None
    body: list[Row] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    summaries: list[Row] = field(default_factory=list)
    blocks: list[str] = field(default_factory=list)


def find_layout(rows: list[Row], place: str) -> Layout:
    """The layout of rows that are not empty."""
    lower_half = rows[len(rows) // 2 :][-SAMPLE:]
    count = Counter(len(_trim_row(row)) for _, row in lower_half).most_common(1)[0][0]
    numeric = _numeric_columns(rows, count)
    first = _first_measurement(rows, count, numeric)
    names = [at for at in range(first) if _is_header(rows[at][1], count)]
    if not names:
        return _layout_without_names(rows, count, place)
    at, units = _choose_name_rows(rows, names, first)
    layout = Layout(rows[at], rows[units] if units is not None else None, faults=_rivals(rows, names, at, place))
    layout.body = rows[(at if units is None else units) + 1 :]
    if at:
        layout.notes.append(f"{at} lines above the column names are left out: {_list_cells(rows[:at])}")
    _join_blocks(layout, rows[at - 1 : at] if at else [], numeric, place)
    _drop_summaries(layout)
    counted = sum(any(map(str.isdigit, row[0])) for _, row in layout.body)
    if 2 * counted > len(layout.body):  # parts have numbers, statistics have names
        for line, row in layout.body:
            if _names_summary(row):
                text = f'"{row[0]}" stands among the measurements; remove the row, or move it to their end'
                layout.faults.append(Fault(f"{place}: row {line}", text))
    return layout


def _trim_row(row: list[str]) -> list[str]:
    return row[: max((at for at, cell in enumerate(row, 1) if cell), default=0)]


def _numeric_columns(rows: list[Row], count: int) -> list[int]:
    """Columns that hold numbers or dates in most of the last rows."""
    lower = [row for _, row in rows[1:][-SAMPLE:] if len(row) >= count]
    lower = lower[len(lower) // 2 :]
    numeric = []
    for column in range(count):
        cells = [row[column] for row in lower if not is_missing(row[column])]
        good = sum(_is_measurement(cell) for cell in cells)
        if good and 2 * good >= len(cells):
            numeric.append(column)
    return numeric


def _is_measurement(cell: str) -> bool:
    return bool(isinstance(cell, Exact) or PLAIN(cell) or notation(cell) or is_date(cell))


def _first_measurement(rows: list[Row], count: int, numeric: list[int]) -> int:
    """The first full row with a number in a numeric column; without such columns the second one."""
    if not numeric:
        return next((at + 1 for at, (_, row) in enumerate(rows) if len(row) >= count), 0) or 1
    for at, (_, row) in enumerate(rows):
        if len(row) < count or not any(_is_measurement(row[column]) for column in numeric):
            continue
        if not _is_preamble(row, count) and not is_unit_row(row, numeric):
            return at
    return len(rows)


def _is_preamble(row: list[str], count: int) -> bool:
    """A row of a name and a value, padded with empty cells: "Datum;01.03.2026;;;"."""
    filled = [cell for cell in row if cell]
    return count > 3 and len(filled) <= 2 and bool(row[0]) and not _is_measurement(row[0])


def is_unit_row(row: list[str], numeric: list[int]) -> bool:
    """Whether a row holds units: every cell is a unit, or empty; the first can say so."""
    cells = [cell for cell in row[bare(row[0]) in UNIT_WORDS.split() :] if cell]
    stated = [cell for column, cell in enumerate(row) if cell and column in numeric]
    return (
        bool(stated)
        and all(unit_of_cell(cell) for cell in sorted(cells, key=lambda cell: cell[0].isalpha()))  # numbers are quick
        and any(not re.fullmatch(r"[-\W]*|1", cell) for cell in stated)
    )


def _is_header(row: list[str], count: int) -> bool:
    """Whether a row can be that of the names: text in every cell but empty columns at the end."""
    names = _trim_row(row)
    return len(names) >= max(count, 1) and not any(_is_measurement(cell) for cell in names)


def _choose_name_rows(rows: list[Row], names: list[int], first: int) -> tuple[int, int | None]:
    """The row of names, and that of units below it: the last ones before the measurements."""
    last = names[-1]
    cells = rows[last][1]
    if len(names) > 1 and last == first - 1 and is_unit_row(cells, list(range(len(cells)))):
        return names[-2], last
    if last + 1 < first and is_unit_row(rows[last + 1][1], list(range(len(rows[last + 1][1])))):
        return last, last + 1
    return last, None


def _rivals(rows: list[Row], names: list[int], at: int, place: str) -> list[Fault]:
    """Rows right above the names that can be the names as well."""
    (upper, above), (line, below) = rows[at - 1], rows[at]
    if at - 1 not in names or upper != line - 1:
        return []
    if any(split_header(name)[1] for name in below) and not any(split_header(name)[1] for name in above):
        return []  # "Teil;Welle" above "Nr.;Abstand [mm]": names have units
    text = (
        f"lines {upper} and {line} can both be the column names; leave an empty line above the "
        "names, or remove the other line"
    )
    return [Fault(place, text)]


def _layout_without_names(rows: list[Row], count: int, place: str) -> Layout:
    """The first full row as names, with what is wrong with them."""
    at = next((at for at, (_, row) in enumerate(rows) if len(row) >= count), 0)
    line, names = rows[at]
    above = [row for _, row in rows[:at] if len(row) > 1]
    text = f"has no column names: line {line} begins with measurements; add a line of names above it"
    if above:
        text = (
            f"line {line} has {len(names)} cells, and no line above it as many names ({len(above[-1])} cells "
            "expected by the last one); where decimal commas stand between commas, export it with another delimiter"
        )
    faults = [Fault(place, text)] if any(_is_measurement(cell) for cell in names) else []
    return Layout(rows[at], None, rows[at + 1 :], faults=faults)


def _join_blocks(layout: Layout, above: list[Row], numeric: list[int], place: str) -> None:
    """Join tables with the same names that stand one below the other, each below its title.

    Names of another table are a fault: what stands below them is something else.
    """
    head, units, body = layout.header[1], (layout.units or (0, None))[1], layout.body
    starts = [at for at, (_, row) in enumerate(body) if row == head]
    if not starts:
        for line, row in body[1:] if len(numeric) > 1 else ():
            cells = [row[at] for at in numeric if at < len(row)]
            if len(cells) == len(numeric) and not any(_is_measurement(c) or is_missing(c) for c in cells):
                text = f'line {line} holds names of other columns ("{row[0]}", ...): give a file for each table'
                text += ", or remove the lines above"
                layout.faults.append(Fault(place, text))
                break
        return
    blocks, title, joined, taken = [0, *starts, len(body)], _title(above), [], []
    for number, (first, end) in enumerate(pairwise(blocks), 1):
        rows = [row for row in body[first:end] if row[1] not in (head, units)]
        following: list[Row] = []
        while rows and end < len(body) and len([cell for cell in rows[-1][1] if cell]) < min(3, len(_trim_row(head))):
            if _is_measurement(rows[-1][1][-1]) and not _names_summary(rows[-1][1]):
                break
            following.insert(0, rows.pop())
        while rows and _names_summary(rows[-1][1]):
            layout.summaries.append(rows.pop())
        joined += rows
        taken += [title or f"block {number}"] * len(rows)
        title = _title([row for row in following if not _names_summary(row[1])])
    layout.body, layout.blocks = joined, taken
    layout.notes.append(f"{len(blocks) - 1} blocks with the same column names are read as one table")


def _title(rows: list[Row]) -> str:
    """The title of a block: the last line above its names, of PC-DMIS the name of the dimension in it."""
    title = " ".join(cell for cell in rows[-1][1] if cell) if rows else ""
    return re.sub(r"DIM (\S+?) ?= ?.*", r"\1", title)


def _drop_summaries(layout: Layout) -> None:
    """Leave out rows of limits below the names, and of means or an end mark below the data."""
    body = layout.body
    first = next((at for at, row in enumerate(body) if not _names_summary(row[1])), len(body))
    last = next((at for at in range(len(body), first, -1) if not _ends_table(body[at - 1][1])), first)
    end = next((at for at in range(last, len(body)) if _names_summary(body[at][1])), len(body))
    dropped, layout.body = body[:first] + body[end:], body[first:end]
    layout.summaries += dropped
    layout.blocks = layout.blocks[first:end]
    if dropped:
        layout.notes.append(f"{len(dropped)} rows that hold no measurement are left out: {_list_cells(dropped)}")


def _ends_table(row: list[str]) -> bool:
    """Whether a row can stand below the data: statistics, or a remark among them."""
    filled = [cell for cell in row if cell]
    return _names_summary(row) or (len(filled) == 1 < len(row) and not _is_measurement(filled[0]))


def _names_summary(row: list[str]) -> bool:
    return is_summary(next((cell for cell in row if cell), ""))


def _list_cells(rows: list[Row]) -> str:
    """The first cells of some rows."""
    shown = [f'line {line} "{next((c for c in row if c), "")}"' for line, row in rows[:5]]
    return ", ".join(shown) + (", ..." if len(rows) > 5 else "")


# Columns of a table with the names and in the units of the model that reads it.


AQDEF = "aqdef"
OF_AQDEF = {"time": "time_s", "batch": "lot"}
"""What the times and batches of a Q-DAS file are."""
Tell = Callable[[Iterable[str]], None]
"""Takes the notes on how a table was read, line by line."""


def discard_lines(lines: Iterable[str]) -> None:
    """Discard the lines."""


@dataclass(frozen=True, slots=True)
class ColumnUse:
    """What a column of a file is: the name that it has where it is read ("": it is left out), its
    unit where the file does not state it, and the sign that it counts by.
    """

    target: str
    unit: str = ""
    sense: int = 1


@dataclass(frozen=True, slots=True)
class Fitted:
    """Cells by the names of the model that reads them, notes on that, and faults."""

    cells: pd.DataFrame
    notes: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()


def fit_columns(
    table: Table, place: str, known: Mapping[str, str], uses: Mapping[str, ColumnUse] | None = None
) -> Fitted:
    """The table with its columns named and in units as `known` (unit by name) has them.

    `uses` states what columns of the file are; a column whose name and unit are those of a known
    name, "torque [N mm]" of "torque_Nm", is matched without it.
    """
    spelt = {spelling: name for name, spelling in table.headers.items()}
    spelt |= {str(name): str(name) for name in table.cells}
    notes: list[str] = []
    faults: list[Fault] = []
    names: dict[str, str] = {}
    cells = dict(table.cells.items())
    for key, use in (uses or {}).items():
        name = spelt.get(key)
        if name is None:
            if use.target and use.target not in spelt:
                faults.append(Fault(f'columns."{key}"', f"{place} has no such column{nearest(key, spelt)}"))
        else:
            names[name] = use.target
            cells[name], wrong = _mapped_cells(cells[name], table.units.get(name, ""), use, known)
            faults += [Fault(f'columns."{key}"', text) for text in wrong]
    mapped = set(names)
    free = {name: unit for name, unit in known.items() if name not in names.values()}
    for wanted, unit in free.items():
        if (name := spelt.get(wanted)) is not None and name not in names:
            names[name] = wanted
            if (stated := table.units.get(name, "")) and unit and not is_same_unit(stated, unit):
                text = f'is stated in "{stated}", but {wanted} is in "{unit}"; rename it or map it in [columns]'
                faults.append(Fault(f"{place}: column {table.headers.get(name, name)}", text))
    split = {str(name): split_unit(str(name)) for name in cells if name not in table.units}
    apart = {name: (name.casefold().replace(" ", "_"), unit) for name, unit in table.units.items()}
    apart |= {name: (stem.casefold(), unit) for name, (stem, unit) in split.items() if unit and name not in known}
    for wanted, unit in free.items():  # a column with the same name and another unit that fits
        stem = split_unit(wanted)[0].casefold()
        alike = (name for name, (own, _) in apart.items() if own == stem and name not in names)
        name = next((name for name in alike if unit and fits(apart[name][1], unit)), None)
        if wanted not in names.values() and name is not None:
            names[name] = wanted
            cells[name] = _convert_cells(cells[name], apart[name][1], unit, 1)
            notes.append(f'"{table.headers[name]}" is read as {wanted}')
    if table.dialect.kind == AQDEF:  # its times and batches, where no entry of [columns] maps them
        for name, target in OF_AQDEF.items():
            if name in table.cells and name not in names and target in free and target not in names.values():
                names[name] = target
    for name, target in names.items():
        if known.get(target) == "s":
            cells[name], interpretation, obstacle = _clock(cells[name])
            heading = table.headers.get(name, name)
            if obstacle and name not in mapped:  # nobody asked for it
                notes.append(f'"{heading}" is not used: {obstacle}')
                names[name] = ""
            elif obstacle:
                faults.append(Fault(f"{place}: column {heading}", obstacle))
            elif interpretation:
                notes.append(f'"{heading}" is read as {target}: {interpretation}')
    kept = {names.get(str(n), str(n)): c for n, c in cells.items() if names.get(str(n), "-")}
    taken = [target for target in names.values() if target]
    for target in sorted({name for name in taken if taken.count(name) > 1}):
        both = ", ".join(f'"{name}"' for name, used_as in names.items() if used_as == target)
        faults.append(Fault("columns", f"{both} are all mapped to {target}; only one column can be"))
    return Fitted(pd.DataFrame(kept, index=table.cells.index), tuple(notes), tuple(faults))


def _clock(cells: pd.Series[Any]) -> tuple[pd.Series[Any], str, str]:
    """Dates and times of day as seconds since the earliest, a note, and what is wrong; numbers stay
    as they are.
    """
    texts = ["" if cell is None or cell != cell else str(cell) for cell in cells]
    if not any(map(is_date, texts)):
        return cells, "", ""
    try:
        elapsed, start = seconds(texts)
    except ValueError as error:  # reported once, not for every row
        return pd.Series(np.arange(len(cells), dtype=float), index=cells.index), "", str(error)
    since = f"{start:%Y-%m-%d %H:%M:%S%z}" if start.year > 1900 else f"{start:%H:%M:%S%z}"
    return pd.Series(elapsed, index=cells.index), f"seconds since {since}", ""


def drop_unused(cells: pd.DataFrame, known: Sequence[str]) -> tuple[pd.DataFrame, list[str]]:
    """The columns that are known, or whose names may be slips of one that is missing; a note."""
    free = [name for name in known if name not in cells]
    unused = [str(n) for n in cells if n not in known and not nearest(str(n), free)]
    if not unused:
        return cells, []
    listed = ", ".join(unused[:10]) + (", ..." if len(unused) > 10 else "")
    return cells.drop(columns=unused), [f"not used: {listed}"]


def _mapped_cells(
    cells: pd.Series[Any], stated: str, use: ColumnUse, known: Mapping[str, str]
) -> tuple[pd.Series[Any], list[str]]:
    """The cells of a column that is mapped, in the unit of its target."""
    unit = known.get(use.target, "")
    if use.unit and stated and not is_same_unit(use.unit, stated):
        return cells, [f'the file says "{stated}", the configuration "{use.unit}"']
    source_unit = use.unit or stated
    if source_unit and unit and not fits(source_unit, unit):
        return cells, [f'"{source_unit}" cannot be stated in {unit}, the unit of {use.target}']
    return _convert_cells(cells, source_unit or unit, unit, use.sense), []


def is_same_unit(unit: str, stated: str) -> bool:
    """Whether both are one unit, in two spellings perhaps."""
    if unit == stated:
        return True
    if not fits(unit, stated):
        return False
    probes = np.array([0.0, 1.0])
    return bool(np.allclose(converted(probes, unit, stated), probes, rtol=1e-12, atol=0.0))


def _convert_cells(cells: pd.Series[Any], source_unit: str, unit: str, sense: int) -> pd.Series[Any]:
    """Cells of numbers in another unit and sense; cells that are not numbers stay as they are."""
    if sense == 1 and (source_unit == unit or not source_unit or not unit or is_same_unit(source_unit, unit)):
        return cells
    numbers = pd.to_numeric(cells.astype(object), errors="coerce").to_numpy(dtype=float)
    values = sense * np.asarray(converted(numbers, source_unit, unit) if source_unit and unit else numbers)
    good = np.isfinite(values)
    result = cells.to_numpy(dtype=object).copy()
    result[good] = values[good]
    return pd.Series(result, index=cells.index, dtype=object)
