"""A table computed block by block: the blocks are computed anywhere, and stored as they end.

The bytes of a table are the same whatever computes it, and however many rows a block has.
"""

from __future__ import annotations

import fcntl
import hashlib
import io
import os
import pickle
import re
import shutil
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from .errors import Fault, RunError, raise_all, refuse
from .execution import Executor, InProcess, Lost, built, check_version, pinned
from .files import PART as LEFTOVER
from .files import clear_parts, csv_text, read_record, write_bytes, write_record, write_with

# rows that a table is computed from

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


# blocks that have ended

IDENTITY = {
    "command": "another command",
    "configuration": "another configuration",
    "table": "another table",
    "version": "another version of tolevo",
    "quality": "another quality",
    "rows": "a table of another length",
}
"""The properties by which tables differ, and how messages call a table that differs in them."""


@dataclass(frozen=True)
class About:
    """The identity of a table: digests of the configuration and of the rows, the version of the
    package, the quality, rows in all and in a block.
    """

    command: str
    configuration: str
    table: str
    version: str
    quality: str
    rows: int
    block_rows: int

    @property
    def total(self) -> int:
        """Number of blocks."""
        return max(1, -(-self.rows // self.block_rows))

    def differences(self, stored: Mapping[str, Any]) -> list[str]:
        """What a stored identity is that of, where it is not that of this table."""
        return [text for name, text in IDENTITY.items() if stored.get(name) != getattr(self, name)]


class BlockStore(ABC):
    """The blocks of one table: `completed` are the numbers of those that have ended."""

    about: About
    completed: set[int]

    @abstractmethod
    def keep(self, number: int, content: bytes) -> None:
        """Keep a block, a Parquet file."""

    @abstractmethod
    def block(self, number: int) -> Path | io.BytesIO:
        """A block that has ended, to be read."""

    @abstractmethod
    def saved(self) -> str:
        """What is saved where a table cannot be finished, and how to continue."""

    def _count(self, place: str) -> str:
        return f"{len(self.completed)} of {self.about.total} blocks are saved in {place}"

    def close(self) -> None:  # noqa: B027 - nothing is held in memory alone
        """Release it for others."""

    def remove(self) -> None:  # noqa: B027
        """Remove all of it, once the table is written elsewhere."""


class InMemory(BlockStore):
    """Blocks that no other process needs: of a table that is returned, or of only one block."""

    def __init__(self, about: About) -> None:
        self.about = about
        self.completed = set()
        self._held: dict[int, bytes] = {}

    def keep(self, number: int, content: bytes) -> None:
        self._held[number] = content
        self.completed.add(number)

    def block(self, number: int) -> io.BytesIO:
        return io.BytesIO(self._held[number])

    def saved(self) -> str:
        return "nothing is saved"


# the file, or the directory, that the table ends in

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


def join_blocks(blocks: Iterable[Any], path: Path) -> None:
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


# blocks in a directory

PART = "part-{:06d}.parquet"
"""Name of a block: numbered by the rows in it, so that the names are in their order."""
ABOUT = "_table.json"
"""What the blocks belong to. Readers of Parquet directories leave out names with a `_`."""
LOG = "_parts.txt"
"""A line per block that is whole: its number and its digest."""
LOCK = "_lock"
LINE = re.compile(r"(\d+) ([0-9a-f]{64})\n")


class BlockFolder(BlockStore):
    """The blocks in `path`, of the table that `about` describes; one process at a time.

    With `resume` whole blocks that are there already are kept, and the rows of a block are those
    that they have. Raises InputError, which writes nothing, where the directory holds blocks of
    another table, or anything else.
    """

    def __init__(self, path: Path, about: About, resume: bool, overwrite: bool) -> None:
        self.path = path
        self.about = _agree_on_identity(path, about, resume, overwrite)
        if overwrite and path.exists():
            shutil.rmtree(path)
        path.mkdir(parents=True, exist_ok=True)
        self._lock = _lock_folder(path)
        if not (path / ABOUT).exists():
            write_record(path / ABOUT, asdict(self.about))
        self.completed = self._intact_blocks()
        self._log = (path / LOG).open("a", encoding="utf-8")

    def keep(self, number: int, content: bytes) -> None:
        """Store a block: first its content, then the line that states that it is whole."""
        write_bytes(self.path / PART.format(number), content)
        self._log.write(f"{number} {hashlib.sha256(content).hexdigest()}\n")
        self._log.flush()
        os.fsync(self._log.fileno())
        self.completed.add(number)

    def block(self, number: int) -> Path:
        """The file of a block."""
        return self.path / PART.format(number)

    def saved(self) -> str:
        return f"{self._count(str(self.path))}; run the same command with --resume to continue"

    def close(self) -> None:
        if not self._log.closed:
            self._log.close()
            os.close(self._lock)

    def remove(self) -> None:
        for path in self.path.iterdir():  # the table's identity is removed last
            if path.name not in (ABOUT, LOCK):
                path.unlink()
        shutil.rmtree(self.path)
        self._log.close()
        os.close(self._lock)

    def _intact_blocks(self) -> set[int]:
        """Numbers of the blocks that are as they were written; a torn last line is cut off."""
        path, whole = self.path / LOG, set[int]()
        with suppress(FileNotFoundError):
            text = path.read_text(encoding="utf-8", errors="replace")
            lines = [line for line in text.splitlines(keepends=True) if LINE.fullmatch(line)]
            if "".join(lines) != text:
                write_bytes(path, "".join(lines).encode())
            for line in lines:
                number, digest = line.split()
                if _digest(self.block(int(number))) == digest:
                    whole.add(int(number))
        return whole


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def _agree_on_identity(path: Path, about: About, resume: bool, overwrite: bool) -> About:
    """The identity of the blocks: those that are there decide how many rows a block has."""
    raise_all(folder_faults(path, resume, overwrite))
    if overwrite or not path.exists() or _is_blank_folder(path):
        return about
    try:
        stored: dict[str, Any] = read_record(path / ABOUT) or {}
    except ValueError as error:
        raise refuse("--resume", f"{path / ABOUT} cannot be read: {error}; give --overwrite") from error
    if others := " and of ".join(about.differences(stored)):
        raise refuse("--resume", f"{path} holds blocks of {others}; name another file, or give --overwrite")
    return replace(about, block_rows=int(stored["block_rows"]))


def _is_blank_folder(path: Path) -> bool:
    """Whether a directory holds nothing but the files of a process killed as it began."""
    return all(entry.name == LOCK or LEFTOVER.fullmatch(entry.name) for entry in path.iterdir())


def _lock_folder(path: Path) -> int:
    """The lock of the directory, or an InputError where another process has it."""
    handle = os.open(path / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise refuse("--out", f"{path} is being written by another process; wait for it") from None
    except OSError as error:
        os.close(handle)
        raise RunError(f"{path}: the file system has no locks ({error.strerror})") from error
    return handle


def folder_faults(path: Path, resume: bool, overwrite: bool) -> list[Fault]:
    """The reasons why a directory of blocks cannot be written, before anything is read."""
    if not path.exists() or (path.is_dir() and _is_blank_folder(path)):
        return []
    if not path.is_dir():
        return [Fault("--out", f"{path} is a file; name a directory for --partitioned")]
    if not (path / ABOUT).exists():
        return [Fault("--out", f"{path} holds something other than a table in blocks; name another")]
    if resume or overwrite:
        return []
    return [Fault("--out", f"{path} holds blocks of an earlier command; continue with --resume, or --overwrite")]


# blocks as tasks

BLOCKS = 250
"""Blocks at most, where nothing else is asked for."""
Compute = Callable[[Any, int], pd.DataFrame]
"""The frame of a grain of rows, by the rows and the grain's number; it is pickled."""


@dataclass(frozen=True, slots=True)
class BlockProgress:
    """State of a table: blocks done of all, and the remaining time [s] once some have ended."""

    done: int
    total: int
    seconds: float
    remaining: float | None


@dataclass(frozen=True, slots=True)
class Block:
    """A task: the rows of some grains, from grain `first` on, and what is `compute`d of them."""

    key: str
    version: str
    compute: Compute | bytes
    number: int
    first: int
    parts: tuple[Any, ...]


@dataclass(frozen=True)
class Computed:
    """A table that can be computed: `compute` makes the frame of a grain of rows.

    A value depends on its grain alone, and grains do not depend on how many of them are a block:
    that is why the bytes are the same whatever computes them. `configuration` states all that the
    values depend on, except the rows; `quality` is the part of it that users choose by itself.
    """

    command: str
    compute: Compute
    configuration: str
    rows: Rows
    grain: int
    quality: str = ""

    def about(self, block_rows: int | None) -> About:
        """The identity of this table, to which its blocks belong."""
        grains = max(1, -(-self.rows.count // self.grain))
        grains_per_block = -(-grains // BLOCKS) if block_rows is None else -(-block_rows // self.grain)
        digest = hashlib.sha256(self.configuration.encode()).hexdigest()
        count, rows = self.rows.count, grains_per_block * self.grain
        return About(self.command, digest, self.rows.digest, version("tolevo"), self.quality, count, rows)

    def grains(self, start: int, stop: int) -> Iterator[Any]:
        """Rows `start` to `stop` by grains; an empty grain where there are no rows."""
        return (self.rows.part(at, min(at + self.grain, stop)) for at in range(start, max(stop, 1), self.grain))


def computed(
    table: Computed,
    executor: Executor,
    target: Target | None = None,
    block_rows: int | None = None,
    progress: Callable[[BlockProgress], None] | None = None,
    frame: bool = True,
) -> pd.DataFrame:
    """Compute every block that is missing, and write the table; its frame where it is wanted.

    A table of one block is stored only when it is written, and no other table is stored without a
    `target`. Raises InputError where blocks of another table are in its place, RunError where blocks
    are lost; what has ended is kept.
    """
    if target is None and isinstance(executor, InProcess):
        return _frame(table.compute, table.grains(0, table.rows.count))
    with closing(_store_of_blocks(table.about(block_rows), target)) as store:
        _finish(table, store, executor, progress)
        total = store.about.total
        wanted = range(total if frame else 1)
        whole = pd.concat([pd.read_parquet(store.block(number)) for number in wanted], ignore_index=True)
        if target is not None and not target.partitioned:
            join_blocks(map(store.block, range(total)), target.path)
            store.remove()
    return whole if frame else whole.iloc[:0]


def _store_of_blocks(about: About, target: Target | None) -> BlockStore:
    small = target is not None and about.total == 1 and not target.occupied
    if target is None or (small and not target.partitioned):
        return InMemory(about)
    return BlockFolder(target.blocks, about, target.resume, target.overwrite)


def _frame(compute: Compute, grains: Iterable[Any], first: int = 0) -> pd.DataFrame:
    """The frames of grains of rows, the first of which has the number `first`, below each other."""
    with pinned():
        frames = [compute(rows, number) for number, rows in enumerate(grains, first)]
    return pd.concat(frames, ignore_index=True) if len(frames) > 1 else frames[0]


def _finish(
    table: Computed, store: BlockStore, executor: Executor, progress: Callable[[BlockProgress], None] | None
) -> None:
    total, begin, had = store.about.total, time.monotonic(), len(store.completed)

    def report() -> None:
        if progress is not None:
            done, seconds = len(store.completed), time.monotonic() - begin
            remaining = seconds * (total - done) / (done - had) if done > had else None
            progress(BlockProgress(done, total, seconds, remaining))

    apart = not isinstance(executor, InProcess)
    report()
    try:
        with executor:
            tasks = _tasks(table, store, total, apart)
            for task, outcome in executor.completed(perform, lambda: next(tasks, None)):
                if isinstance(outcome, Lost):
                    raise RunError(f"block {task.number}: {outcome.reason}")
                store.keep(task.number, outcome)
                report()
    except RunError as error:
        raise RunError(f"{error}; {store.saved()}") from error


def _tasks(table: Computed, store: BlockStore, total: int, apart: bool) -> Iterator[Block]:
    """The blocks that are missing; what goes to other processes (`apart`) is pickled once."""
    block_rows = store.about.block_rows
    content = pickle.dumps(table.compute) if apart else table.compute
    name = hashlib.sha256(repr(store.about).encode()).hexdigest()[:24]
    for number in range(total):
        if number in store.completed:
            continue
        start, stop = number * block_rows, min((number + 1) * block_rows, table.rows.count)
        rows = tuple(table.grains(start, stop))
        yield Block(f"{name}-{number}", version("tolevo"), content, number, start // table.grain, rows)


def perform(task: Block) -> bytes:
    """The rows of a block as a Parquet file."""
    check_version(task.version)
    compute: Compute = built(task.compute) if isinstance(task.compute, bytes) else task.compute
    content = _frame(compute, task.parts, task.first)
    encoded: bytes = content.reset_index(drop=True).to_parquet(index=False)
    return encoded
