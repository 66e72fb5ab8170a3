"""The file from which a broken search goes on: arrays in one .npz, whole, never a pickle.

The digest of the whole file follows them. It is checked before anything else, so that a damaged
file is refused whatever the damage would have led to.
"""

from __future__ import annotations

import io
import math
import time
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import refuse
from ..files import write_bytes
from ..sealed import sealed, unsealed

State = dict[str, NDArray[Any]]
FORMAT = 3
EVERY = 2.0
"""Least time between two saved states [s]."""


class Checkpoint:
    """State of one search, and tables that need not be made again, kept in the file `path`.

    `identity` is the text that says what run it belongs to. It is a `Keeper` for `search`.
    """

    def __init__(self, path: Path, identity: str, every: float = EVERY) -> None:
        self.path = path
        self.identity = identity
        self.every = every
        self.unsavable = False
        self.tables: dict[str, pd.DataFrame] = {}
        self._state: State = {}
        self._last = -math.inf

    @classmethod
    def read(cls, path: Path, every: float = EVERY) -> Checkpoint:
        """What `write` wrote. Raises InputError where the file is no checkpoint."""
        try:
            with np.load(io.BytesIO(unsealed(path.read_bytes())), allow_pickle=False) as file:
                content = {key: file[key] for key in file.files}
            if int(content["format"]) != FORMAT:
                raise ValueError(f"format {content['format']}, expected {FORMAT}")
            checkpoint = cls(path, str(content["identity"]), every)
            checkpoint.unsavable = bool(content["unsavable"])
            for at, name in enumerate(content["tables"].tolist()):
                checkpoint.tables[name] = _table(content, f"table.{at}.")
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            raise refuse(str(path), f"cannot be read: {error}; start again with --overwrite") from error
        prefix = "state."
        checkpoint._state = {k[len(prefix) :]: v for k, v in content.items() if k.startswith(prefix)}
        return checkpoint

    def due(self) -> bool:
        """Whether the last state was saved long enough ago."""
        return time.monotonic() - self._last >= self.every

    def save(self, state: State) -> None:
        """Keep the state of the search."""
        self._state, self.unsavable = state, False
        self._last = time.monotonic()
        self.write()

    def saved(self) -> Mapping[str, NDArray[Any]] | None:
        """The state that was kept, None where there is none."""
        return self._state or None

    def cannot_save(self) -> None:
        """The search has a state that is not made of arrays: it will start anew."""
        self._state, self.unsavable = {}, True
        self._last = time.monotonic()
        self.write()

    def keep(self, name: str, table: pd.DataFrame) -> None:
        """Keep a table that is finished."""
        self.tables[name] = table
        self.write()

    def keep_only(self, names: Iterable[str]) -> None:
        """Forget all other tables, those of a smaller budget; the file follows when it is due."""
        wanted = set(names)
        self.tables = {name: table for name, table in self.tables.items() if name in wanted}

    def write(self) -> None:
        """Write all of it, in one step."""
        content: State = {
            "format": np.array(FORMAT),
            "identity": np.array(self.identity),
            "unsavable": np.array(self.unsavable),
            "tables": np.array(list(self.tables), dtype=str),
        }
        content |= {f"state.{key}": value for key, value in self._state.items()}
        for at, table in enumerate(self.tables.values()):
            content |= _arrays(table, f"table.{at}.")
        file = io.BytesIO()
        np.savez(file, allow_pickle=False, **content)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(self.path, sealed(file.getvalue()))


def _arrays(table: pd.DataFrame, prefix: str) -> State:
    columns = {f"{prefix}{at}": _column(table.iloc[:, at]) for at in range(table.shape[1])}
    return columns | {f"{prefix}names": np.array(table.columns.tolist(), dtype=str)}


def _column(column: pd.Series[Any]) -> NDArray[Any]:
    """Numbers as they are, text as text; an empty column without a type has no values to lose."""
    values = column.to_numpy()
    return values.astype(str) if values.dtype == object else values


def _table(content: Mapping[str, NDArray[Any]], prefix: str) -> pd.DataFrame:
    names = content[f"{prefix}names"].tolist()
    return pd.DataFrame({name: content[f"{prefix}{at}"] for at, name in enumerate(names)})
