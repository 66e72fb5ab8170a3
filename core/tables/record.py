"""A table as it was understood: cells, units, dialect, and what should be known of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from .options import NAMES
from .typed import typed


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
    line numbers of the file; `units` are those that names or a row of units state; `numeric` names
    the columns of numbers, `headers` maps a name to how the file spells it, unit included.
    """

    cells: pd.DataFrame
    dialect: Dialect
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    numeric: tuple[str, ...] = ()
    headers: Mapping[str, str] = field(default_factory=dict)

    @property
    def frame(self) -> pd.DataFrame:
        """The table with its numbers as such; invalid or missing values are None."""
        return typed(self.cells, self.numeric)

    def lines(self, place: str) -> tuple[str, ...]:
        """What was understood, to be shown before anything is made of it."""
        columns = ", ".join(self._described(str(name)) for name in self.cells)
        first = f"{place}: {len(self.cells)} rows; {self.dialect}"
        return (first, f"{place}: columns {columns}", *(f"{place}: {one}" for one in self.notes))

    def record(self) -> dict[str, Any]:
        """What was understood, to be stored with a result."""
        dialect = {name: getattr(self.dialect, name) for name in Dialect.__slots__}
        return {
            "dialect": dialect,
            "columns": [str(name) for name in self.cells],
            "units": dict(self.units),
            "rows": len(self.cells),
            "notes": list(self.notes),
        }

    def _described(self, name: str) -> str:
        unit = self.units.get(name, "")
        kind = "" if name in self.numeric else " (text)"
        return f"{name}{f' [{unit}]' if unit else ''}{kind}"
