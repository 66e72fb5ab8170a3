"""The file, or the directory, that a table computed in blocks ends in."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ...csv_text import csv_text
from ...files import clear_parts, write_with

PARQUET = (".parquet", ".pq")
GROUP = 131_072
"""Rows of a row group of one Parquet file, however many a block had."""


@dataclass(frozen=True, slots=True)
class Target:
    """Where the rows go: one file, or (`partitioned`) a directory of Parquet files.

    `resume` continues with the blocks of an earlier command, `overwrite` replaces them.
    """

    path: Path
    partitioned: bool = False
    resume: bool = False
    overwrite: bool = False

    @property
    def blocks(self) -> Path:
        """The directory of the blocks: the result itself, or one next to the file."""
        return self.path if self.partitioned else self.path.with_name(self.path.name + ".blocks")

    @property
    def occupied(self) -> bool:
        """Whether there are blocks already."""
        return self.blocks.exists()


def joined(blocks: Iterable[Any], path: Path) -> None:
    """Write the rows of all blocks, Parquet files, into one file, CSV or Parquet by its name.

    Few blocks are in memory at once, and the bytes do not depend on how many rows a block had.
    """
    clear_parts(path)
    parquet = path.suffix.lower() in PARQUET
    write_with(path, lambda part: _parquet(blocks, part) if parquet else _csv(blocks, part))


def _parquet(blocks: Iterable[Any], path: Path) -> None:
    tables = _tables(blocks)
    held = next(tables)
    with pq.ParquetWriter(path, held.schema) as writer:
        for table in tables:
            while held.num_rows >= GROUP:
                writer.write_table(held.slice(0, GROUP))
                held = held.slice(GROUP)
            held = pa.concat_tables([held, table])
        for at in range(0, max(held.num_rows, 1), GROUP):
            writer.write_table(held.slice(at, GROUP))


def _csv(blocks: Iterable[Any], path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        for at, table in enumerate(_tables(blocks)):
            file.write(csv_text(table.to_pandas(), header=at == 0))


def _tables(blocks: Iterable[Any]) -> Iterator[Any]:
    """The blocks as tables of the schema of the first."""
    schema = None
    for block in blocks:
        table = pq.read_table(block)
        schema = schema or table.schema
        yield table.cast(schema) if table.schema != schema else table
