"""The file from which an interrupted search continues: arrays in one .npz file, never a pickle.

The digest of the whole file follows the arrays. It is checked before anything else, so that every
damaged file is refused.
"""

from __future__ import annotations

import io
import math
import time
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import refuse
from ..files import seal_content, unseal_content, write_bytes
from ..journal import Section
from .archive import SavedState, State, merge_states, part

FORMAT = 4
EVERY = 2.0
"""Least time between two saved states [s]."""
SPARE = 50.0
"""Time between two saved states, as a multiple of the time that saving takes, where that is more."""


class Checkpoint:
    """State of one search, and finished tables of its run, in the file `path`.

    `identity` is a text that identifies the run, `model` are values of its model by which a changed
    one is detected. A checkpoint is a `Keeper` for `search`.
    """

    def __init__(self, path: Path, identity: str, every: float = EVERY) -> None:
        self.path = path
        self.identity = identity
        self.every = every
        self.model: NDArray[np.float64] = np.zeros(0)
        self.unsavable = False
        self.open = True
        """Whether finished steps may be written, False until its directory holds this run."""
        self.tables: dict[str, pd.DataFrame] = {}
        self._sections: dict[str, Section] = {}
        self._state: State = {}
        self._last = -math.inf

    @classmethod
    def read(cls, path: Path, every: float = EVERY) -> Checkpoint:
        """The checkpoint in a file of `write`. Raises InputError where the file has none."""
        try:
            with np.load(io.BytesIO(unseal_content(path.read_bytes())), allow_pickle=False) as file:
                content = {key: file[key] for key in file.files}
            if int(content["format"]) != FORMAT:
                raise ValueError(f"format {content['format']}, expected {FORMAT}")
            checkpoint = cls(path, str(content["identity"]), every)
            checkpoint.unsavable = bool(content["unsavable"])
            for at, name in enumerate(content["tables"].tolist()):
                checkpoint.tables[name] = _table(part(content, f"table.{at}."))
            checkpoint.model = content["model"]
            for at, name in enumerate(content["sections"].tolist()):
                checkpoint.section(name).restore(part(content, f"section.{at}."))
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            raise refuse(str(path), f"cannot be read: {error}; start again with --overwrite") from error
        checkpoint._state = part(content, "state.")
        return checkpoint

    def due(self) -> bool:
        """Whether the last state was saved long enough ago."""
        return time.monotonic() - self._last >= self.every

    def save(self, state: State) -> None:
        """Keep the state of the search."""
        self._state, self.unsavable = state, False
        self._last = time.monotonic()
        self.write()

    def saved(self) -> SavedState | None:
        """The saved state, None where there is none."""
        return self._state or None

    def cannot_save(self) -> None:
        """The state of the search does not consist of arrays: a later search starts from the beginning."""
        self._state, self.unsavable = {}, True
        self._last = time.monotonic()
        self.write()

    def keep(self, name: str, table: pd.DataFrame) -> None:
        """Keep a table that is finished."""
        self.tables[name] = table
        self.write()

    def keep_only(self, names: Iterable[str]) -> None:
        """Remove all other tables, those of a smaller budget; the next `write` updates the file."""
        wanted = set(names)
        self.tables = {name: table for name, table in self.tables.items() if name in wanted}

    def section(self, name: str) -> Section:
        """The steps of a part of the run that can be recalled; they are saved like a state."""
        return self._sections.setdefault(name, Section(self._step))

    def _step(self) -> None:
        if self.open and self.due():
            start = time.monotonic()
            self.write()
            self._last = time.monotonic()
            self.every = max(self.every, SPARE * (self._last - start))

    def write(self) -> None:
        """Write state and tables in one step."""
        content: State = {
            "format": np.array(FORMAT),
            "identity": np.array(self.identity),
            "model": self.model,
            "unsavable": np.array(self.unsavable),
            "tables": np.array(list(self.tables), dtype=str),
            "sections": np.array(list(self._sections), dtype=str),
        }
        sections = {f"section.{at}": section.state() for at, section in enumerate(self._sections.values())}
        tables = {f"table.{at}": _arrays(table) for at, table in enumerate(self.tables.values())}
        content |= merge_states(state=self._state, **tables, **sections)
        file = io.BytesIO()
        np.savez(file, allow_pickle=False, **content)
        write_bytes(self.path, seal_content(file.getvalue()))


def _arrays(table: pd.DataFrame) -> State:
    columns = {str(at): _column(table.iloc[:, at]) for at in range(table.shape[1])}
    return columns | {"names": np.array(table.columns.tolist(), dtype=str)}


def _column(column: pd.Series[Any]) -> NDArray[Any]:
    """The values of a column; objects are stored as text."""
    values = column.to_numpy()
    return values.astype(str) if values.dtype == object else values


def _table(arrays: SavedState) -> pd.DataFrame:
    return pd.DataFrame({name: arrays[str(at)] for at, name in enumerate(arrays["names"].tolist())})
