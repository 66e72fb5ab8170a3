"""What the user states about a file, and what is read of it: cells, units, limits, notes."""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.compute as pc
from numpy.typing import NDArray

from ..errors import Fault
from ..files import restore_cell, restore_cells
from .signs import integers_if_whole, numbers_in, typed_column

DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "\\t": "\t", "pipe": "|", "bar": "|", "space": " "}
"""Words for a delimiter, as a command line is typed."""
NAMES = {",": "comma", ";": "semicolon", "\t": "tab", "|": "pipe", " ": "space", "": "none"}


SHAPES = LONG, WIDE, TRANSPOSED = ("long", "wide", "transposed")
"""A row per characteristic and part, a column per characteristic, a column per part."""
OF_COMMANDS, KEYS, NONE = "options", "keys", "none"
"""Where the user states encoding, delimiter and decimal sign: options of a command, keys of the table
of a configuration that names the file, or nowhere, so that the file has to be written otherwise.
"""
_OPTION = re.compile(r"--(encoding|delimiter|decimal|shape)(?: ([.,]))?")
_REMEDY = re.compile(r"[:;,]? state (?:another )?--.*")


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """Encoding, delimiter, decimal sign and shape of a file; None where it is to be detected.

    `sizes` are nominal sizes and their units by the name of a column, that of "" counts for every
    column: where "68,001" can be 68.001 or 68001, the value near the nominal is meant.
    """

    encoding: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    shape: str | None = None
    where: str = OF_COMMANDS
    sizes: Mapping[str, tuple[float, str]] = field(default_factory=dict)

    def worded(self, fault: Fault) -> Fault:
        """A fault with the options named as the user states them."""
        if self.where == OF_COMMANDS:
            return fault
        message = fault.message
        if self.where == NONE:
            message = _REMEDY.sub("; save it in UTF-8 with semicolons between columns and decimal points", message)
        message = _OPTION.sub(lambda match: match[1] + (f' = "{match[2]}"' if match[2] else ""), message)
        return replace(fault, place=fault.place.removeprefix("--"), message=message)

    @property
    def separator(self) -> str | None:
        """The delimiter as a character."""
        return None if self.delimiter is None else DELIMITERS.get(self.delimiter, self.delimiter)

    def faults(self) -> list[Fault]:
        """A fault for every option that is not valid."""
        wrong = []
        if self.encoding is not None and not _is_codec(self.encoding):
            text = f'must be an encoding such as utf-8, cp1252, gbk or big5, got "{self.encoding}"'
            wrong.append(Fault("--encoding", text))
        if self.delimiter is not None and self.separator not in DELIMITERS.values():
            text = f'must be one of comma, semicolon, tab, pipe, space, got "{self.delimiter}"'
            wrong.append(Fault("--delimiter", text))
        if self.decimal is not None and self.decimal not in (".", ","):
            wrong.append(Fault("--decimal", f'must be "." or ",", got "{self.decimal}"'))
        if self.shape is not None and self.shape not in SHAPES:
            wrong.append(Fault("--shape", f'must be one of {", ".join(SHAPES)}, got "{self.shape}"'))
        return wrong


AQDEF_SUFFIXES = (".dfq", ".dfd", ".dfx")
"""Ends of the names of files in the format of Q-DAS."""
AS_DETECTED = ReadOptions()
NO_OPTIONS = ReadOptions(where=NONE)
"""For a file of which nothing can be stated."""


def _is_codec(name: str) -> bool:
    """Whether a name is that of an encoding of text."""
    try:
        "".encode(codecs.lookup(name).name)
    except (LookupError, ValueError):
        return False
    return True


# The cells of a table by column, and the frames that are made of them when they are asked for.


@dataclass(frozen=True)
class Columns:
    """Cells by name: a list of texts, or an Arrow array of a long file; `lines` number the rows."""

    cells: Mapping[str, Any]
    lines: Sequence[int]

    @property
    def names(self) -> list[str]:
        """The names of the columns."""
        return list(self.cells)

    def __len__(self) -> int:
        return len(self.lines)

    def factorised(self, name: str) -> tuple[NDArray[np.int64], list[str]]:
        """The text of each row by its place among the different ones, in the order in which they come."""
        cells = self.cells[name]
        codes: NDArray[np.int64]
        if isinstance(cells, list | np.ndarray):
            places, different = pd.factorize(objects_of(cells).astype(str))
            codes, texts = places.astype(np.int64), different.tolist()
        else:
            encoded = cells.dictionary_encode()
            codes, texts = encoded.indices.to_numpy().astype(np.int64), encoded.dictionary.to_pylist()
        marked = any(text.startswith("'") for text in texts)
        plain = [(str(restore_cell(text)) if marked else text).strip() for text in texts]
        at = {text: place for place, text in enumerate(dict.fromkeys(plain))}
        return codes if len(at) == len(plain) else np.array([at[text] for text in plain])[codes], list(at)

    def numbers(self, name: str, values: Mapping[str, NDArray[Any]]) -> NDArray[np.float64]:
        """The numbers of a column, NaN where a cell is none."""
        return values[name] if name in values else numbers_in(objects_of(self.cells[name]))

    def frame(self, values: Mapping[str, NDArray[Any]]) -> pd.DataFrame:
        """Cells with numbers in plain notation; `values` are the numbers of columns that have
        decimals, so that labels stay as they are written.
        """
        columns = {name: self._canonical_cells(name, values.get(name)) for name in self.cells}
        return pd.DataFrame(columns, index=self._index())

    def typed(self, numeric: Sequence[str], values: Mapping[str, NDArray[Any]]) -> pd.DataFrame:
        """The columns in `numeric` as numbers, None where a cell is none."""
        columns = {
            name: integers_if_whole(values[name]) if name in values else self._typed(cells, name in numeric)
            for name, cells in self.cells.items()
        }
        return pd.DataFrame(columns, index=self._index())

    def _canonical_cells(self, name: str, values: NDArray[Any] | None) -> Any:
        cells = self.cells[name]
        if isinstance(cells, np.ndarray) and cells.dtype != object:
            return cells
        if values is not None and not (values == np.floor(values)).all():
            bad = np.isnan(values)
            return np.where(bad, objects_of(cells), values.astype(object)) if bad.any() else values
        return pd.Series(_texts(cells), index=self._index(), dtype=object)

    def _typed(self, cells: Any, numeric: bool) -> Any:
        if not isinstance(cells, list | np.ndarray) and not pc.any(pc.equal(cells, "")).as_py():
            return pd.array(_texts(cells) if _is_marked(cells) else cells, dtype="str")
        values = objects_of(cells) if numeric else _texts(cells)
        return pd.Series(typed_column(values, numeric), index=self._index())

    def _index(self) -> pd.Index[Any]:
        lines = self.lines
        if len(lines) and lines[-1] - lines[0] == len(lines) - 1:
            return pd.RangeIndex(lines[0], lines[-1] + 1)
        return pd.Index(lines)


def _texts(cells: Any) -> NDArray[Any]:
    """Cells as Python objects, those of a text file without their marks of text."""
    if isinstance(cells, np.ndarray):
        return cells
    return restore_cells(objects_of(cells)) if _is_marked(cells) else objects_of(cells)


def _is_marked(cells: Any) -> bool:
    """Whether cells of a text file may have marks of text."""
    return isinstance(cells, list) or bool(pc.any(pc.starts_with(cells, "'")).as_py())


def objects_of(cells: Any) -> NDArray[Any]:
    """Cells as Python objects."""
    if isinstance(cells, np.ndarray):
        return cells
    if isinstance(cells, list):
        objects = np.empty(len(cells), dtype=object)
        objects[:] = cells
        return objects
    return np.asarray(cells.to_numpy(zero_copy_only=False), dtype=object)


def empty_cells(cells: Any) -> list[int]:
    """The places of empty cells in a list of texts or an Arrow array."""
    if isinstance(cells, list):
        return [at for at, cell in enumerate(cells) if cell == ""]
    return np.flatnonzero(pc.equal(cells, "").to_numpy(zero_copy_only=False)).tolist()


# A table as it was read: cells, units, limits, dialect, and notes on them.


@dataclass(frozen=True, slots=True)
class Specification:
    """Nominal size and limits of a characteristic as its file states them, None where it does not;
    `natural` is "lower" where the lower limit is one of nature.
    """

    nominal: float | None = None
    lower: float | None = None
    upper: float | None = None
    natural: str = ""


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a file is written. `header` is the line of the column names, `unit_row` that of the
    units, 0 where there is none; `decimal` is empty where no number has a decimal sign.
    """

    kind: str = "csv"
    encoding: str = ""
    delimiter: str = ""
    decimal: str = ""
    thousands: str = ""
    quote: str = '"'
    header: int = 1
    unit_row: int = 0
    sheet: str = ""

    def __str__(self) -> str:
        if self.kind != "csv":
            return self.kind + (f", sheet {self.sheet}" if self.sheet else "")
        words = [self.encoding, f"delimiter {NAMES.get(self.delimiter, self.delimiter)}"]
        if self.decimal:
            words.append(f"decimal {'comma' if self.decimal == ',' else 'point'}")
        if self.thousands:
            words.append(f'thousands "{self.thousands}"')
        words.append(f"names in line {self.header}")
        return ", ".join(words + ([f"units in line {self.unit_row}"] if self.unit_row else []))


@dataclass(frozen=True)
class Table:
    """A table that was read.

    `cells` are as in the file, with numbers in plain notation (decimal point, no thousands), by the
    line numbers of the file, and `frame` holds numbers; `units` are those that names or a row of
    units state; `numeric` names the columns of numbers, `headers` maps a name to how the file
    spells it, unit included; `values` are the numbers of columns that were read at once;
    `specifications` are nominal sizes and limits by column.
    """

    columns: Columns
    dialect: Dialect
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    numeric: tuple[str, ...] = ()
    headers: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    specifications: Mapping[str, Specification] = field(default_factory=dict)

    @cached_property
    def cells(self) -> pd.DataFrame:
        """The table as it is written, its numbers in plain notation."""
        return self.columns.frame(self.values)

    @cached_property
    def frame(self) -> pd.DataFrame:
        """The table with its numbers as such; invalid or missing values are None."""
        return self.columns.typed(self.numeric, self.values)

    def lines(self, place: str) -> tuple[str, ...]:
        """How the table was read, to be shown before it is used."""
        columns = ", ".join(self._described(str(name)) for name in self.columns.names)
        first = f"{place}: {len(self.columns)} rows; {self.dialect}"
        return (first, f"{place}: columns {columns}", *(f"{place}: {note}" for note in self.notes))

    def record(self) -> dict[str, Any]:
        """How the table was read, to be stored with a result."""
        return {
            "dialect": asdict(self.dialect),
            "columns": self.columns.names,
            "units": dict(self.units),
            "rows": len(self.columns),
            "notes": list(self.notes),
        }

    def _described(self, name: str) -> str:
        unit = self.units.get(name, "")
        kind = "" if name in self.numeric else " (text)"
        return f"{name}{f' [{unit}]' if unit else ''}{kind}"
