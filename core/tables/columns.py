"""The cells of a table by column, and the frames that are made of them when they are asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.compute as pc
from numpy.typing import NDArray

from ..csv_text import originals
from .typed import typed_column, whole_if_so


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

    def frame(self, values: Mapping[str, NDArray[Any]]) -> pd.DataFrame:
        """Cells with numbers in plain notation; `values` are the numbers of columns that have
        decimals, so that labels stay as they are written.
        """
        columns = {name: self._canonical_cells(name, values.get(name)) for name in self.cells}
        return pd.DataFrame(columns, index=self._index())

    def typed(self, numeric: Sequence[str], values: Mapping[str, NDArray[Any]]) -> pd.DataFrame:
        """The columns in `numeric` as numbers, None where a cell is none."""
        columns = {
            name: whole_if_so(values[name]) if name in values else self._typed(cells, name in numeric)
            for name, cells in self.cells.items()
        }
        return pd.DataFrame(columns, index=self._index())

    def _canonical_cells(self, name: str, values: NDArray[Any] | None) -> Any:
        cells = self.cells[name]
        if isinstance(cells, np.ndarray) and cells.dtype != object:
            return cells
        if values is not None and not (values == np.floor(values)).all():
            bad = np.isnan(values)
            return np.where(bad, _objects(cells), values.astype(object)) if bad.any() else values
        return pd.Series(_texts(cells), index=self._index(), dtype=object)

    def _typed(self, cells: Any, numeric: bool) -> Any:
        if not isinstance(cells, list | np.ndarray) and not pc.any(pc.equal(cells, "")).as_py():
            marked = pc.any(pc.starts_with(cells, "'")).as_py()
            return pd.array(_texts(cells) if marked else cells, dtype="str")
        values = _objects(cells) if numeric else _texts(cells)
        return pd.Series(typed_column(values, numeric), index=self._index())

    def _index(self) -> pd.Index[Any]:
        lines = self.lines
        if len(lines) and lines[-1] - lines[0] == len(lines) - 1:
            return pd.RangeIndex(lines[0], lines[-1] + 1)
        return pd.Index(lines)


def _texts(cells: Any) -> NDArray[Any]:
    """Cells as Python objects, those of a text file without their marks of text."""
    return cells if isinstance(cells, np.ndarray) else originals(_objects(cells))


def _objects(cells: Any) -> NDArray[Any]:
    """Cells as Python objects."""
    if isinstance(cells, np.ndarray):
        return cells
    if isinstance(cells, list):
        objects = np.empty(len(cells), dtype=object)
        objects[:] = cells
        return objects
    return np.asarray(cells.to_numpy(zero_copy_only=False), dtype=object)
