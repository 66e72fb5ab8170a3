"""The rows that a table is computed from, handed out by their numbers."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

Columns = Mapping[str, NDArray[Any]]


class Rows(ABC):
    """Rows 0 to `count`; `digest` is the same for the same rows alone."""

    count: int
    digest: str

    @abstractmethod
    def part(self, start: int, stop: int) -> Any:
        """Rows `start` to `stop` in the form that the computation takes."""


class ArrayRows(Rows):
    """The rows of an array (n, k)."""

    def __init__(self, values: NDArray[np.float64]) -> None:
        self.values = np.ascontiguousarray(values)
        self.count = len(values)
        self.digest = hashlib.sha256(self.values.tobytes()).hexdigest()

    def part(self, start: int, stop: int) -> NDArray[np.float64]:
        return self.values[start:stop]


class FrameRows(Rows):
    """The rows of columns (n,) by name."""

    def __init__(self, columns: Columns, count: int) -> None:
        self.columns = columns
        self.count = count
        self.digest = digest_of(columns)

    def part(self, start: int, stop: int) -> Columns:
        return {name: values[start:stop] for name, values in self.columns.items()}


class ParquetRows(Rows):
    """The rows of Parquet files, one after the other, of which a few blocks are in memory.

    `names` maps a column of the files to its name here; numbers become float64.
    """

    def __init__(self, paths: Sequence[Path], names: Mapping[str, str], count: int, digest: str) -> None:
        self.paths = tuple(paths)
        self.names = dict(names)
        self.count = count
        self.digest = digest
        self._at = 0
        self._batches: Iterator[Columns] = iter(())
        self._held: Columns = {}

    def part(self, start: int, stop: int) -> Columns:
        if start < self._at:  # an earlier block: from the beginning
            self._at, self._batches, self._held = 0, iter(()), {}
        if self._at == 0 and not self._held:
            self._batches = batches(self.paths, self.names)
        parts = []
        while start < stop:
            if not _length(self._held):
                self._held = next(self._batches)
            length = _length(self._held)
            if self._at + length <= start:  # not wanted
                self._at, self._held = self._at + length, {}
                continue
            low, high = start - self._at, min(stop - self._at, length)
            parts.append({name: values[low:high] for name, values in self._held.items()})
            start = self._at + high
            if high == length:
                self._at, self._held = self._at + length, {}
        return {name: np.concatenate([part[name] for part in parts]) for name in self.names.values()}


BATCH = 65_536
"""Rows that are read at once."""


def batches(paths: Sequence[Path], names: Mapping[str, str]) -> Iterator[Columns]:
    """The columns of Parquet files, `BATCH` rows at a time."""
    for path in paths:
        with pq.ParquetFile(path) as file:
            for batch in file.iter_batches(BATCH, columns=list(names)):
                yield {
                    names[name]: _as_floats(batch.column(at).to_numpy(zero_copy_only=False))
                    for at, name in enumerate(batch.schema.names)
                }


def _as_floats(values: NDArray[Any]) -> NDArray[Any]:
    return values.astype(float) if values.dtype.kind in "iufb" else values


def digest_of(columns: Columns) -> str:
    """SHA-256 of columns (n,) by name."""
    digest = hashlib.sha256()
    for name, values in columns.items():
        digest.update(f"{name}\0{len(values)}\0".encode())
        plain = values if values.dtype.kind in "iufb" else np.asarray(values).astype(str)
        digest.update(np.ascontiguousarray(plain).tobytes())
    return digest.hexdigest()


def _length(columns: Columns) -> int:
    return len(next(iter(columns.values()))) if columns else 0
