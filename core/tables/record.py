"""A table as it was read: cells, units, dialect, and notes on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import pandas as pd
from numpy.typing import NDArray

from .columns import Columns
from .options import NAMES


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
    spells it, unit included; `values` are the numbers of columns that were read at once.
    """

    columns: Columns
    dialect: Dialect
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    numeric: tuple[str, ...] = ()
    headers: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, NDArray[Any]] = field(default_factory=dict)

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
