"""A table computed block by block; the blocks are computed anywhere, and stored as they end."""

from __future__ import annotations

import fcntl
import hashlib
import io
import json
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
from sqlalchemy import Connection, delete, select

from .errors import Fault, RunError, raise_all, refuse
from .execution import Executor, InProcess, Lost, built, check_version, pinned
from .files import PART as LEFTOVER
from .files import (
    clear_parts,
    csv_text,
    loads,
    read_record,
    sealed_record,
    unsealed_record,
    write_bytes,
    write_record,
    write_with,
)
from .store.address import read_address
from .store.backend import DAMAGE, Backend, reason
from .store.postgresql import PostgreSQL
from .store.store import Store
from .store.tables import BLOCKS, STUDY, TABLE

__all__ = [
    "PART",
    "ArrayRows",
    "BlockFolder",
    "BlockProgress",
    "Computed",
    "FrameRows",
    "ParquetRows",
    "Rows",
    "Target",
    "computed",
    "folder_faults",
]

# Where the blocks of a table are stored until all have ended.


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

    def with_blocks_of(self, stored: Mapping[str, Any]) -> About:
        """The identity of this table in blocks of the stored length."""
        return replace(self, block_rows=int(stored["block_rows"]))


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

    def claim(self, number: int) -> bool:
        """Whether a block is ours to be computed; others may be at work on the same table."""
        return True

    def refresh(self) -> None:  # noqa: B027 - nobody else is at work
        """Read which blocks others have computed."""

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


# The directory of a table's blocks: the table's identity, and the blocks that are computed.


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
        self.about = _agreed(path, about, resume, overwrite)
        if overwrite and path.exists():
            shutil.rmtree(path)
        path.mkdir(parents=True, exist_ok=True)
        self._lock = _locked(path)
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


def _agreed(path: Path, about: About, resume: bool, overwrite: bool) -> About:
    """The identity of the blocks: those that are there decide how many rows a block has."""
    raise_all(folder_faults(path, resume, overwrite))
    if overwrite or not path.exists() or _blank(path):
        return about
    try:
        stored: dict[str, Any] = read_record(path / ABOUT) or {}
    except ValueError as error:
        raise refuse("--resume", f"{path / ABOUT} cannot be read: {error}; give --overwrite") from error
    if others := " and of ".join(about.differences(stored)):
        raise refuse("--resume", f"{path} holds blocks of {others}; name another file, or give --overwrite")
    return about.with_blocks_of(stored)


def _blank(path: Path) -> bool:
    """Whether a directory holds nothing but the files of a process killed as it began."""
    return all(entry.name == LOCK or LEFTOVER.fullmatch(entry.name) for entry in path.iterdir())


def _locked(path: Path) -> int:
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
    if not path.exists() or (path.is_dir() and _blank(path)):
        return []
    if not path.is_dir():
        return [Fault("--out", f"{path} is a file; name a directory for --partitioned")]
    if not (path / ABOUT).exists():
        return [Fault("--out", f"{path} holds something other than a table in blocks; name another")]
    if resume or overwrite:
        return []
    return [Fault("--out", f"{path} holds blocks of an earlier command; continue with --resume, or --overwrite")]


# The rows that a table is computed from, handed out by their numbers.


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


# The file, or the directory, that a table computed in blocks ends in.


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


# Blocks of rows as tasks: computed anywhere, stored as they end, the same bytes each time.


BLOCKS_AT_ONCE = 250
"""Blocks at most, where nothing else is asked for."""
POLL_S = 0.5
"""Seconds between two queries of what other machines have done."""
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
        grains_per_block = -(-grains // BLOCKS_AT_ONCE) if block_rows is None else -(-block_rows // self.grain)
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
    shared: tuple[str, str] | None = None,
) -> pd.DataFrame:
    """Compute every block that is missing, and write the table; its frame where it is wanted.

    A table of one block is stored only when it is written, and no other table is stored without a
    `target`. Where blocks are `shared` with other machines (the address of the store, and the place
    where that was stated) they stay there, and each machine writes the table. Raises InputError
    where blocks of another table are in its place, RunError where blocks are lost; what has ended
    is kept.
    """
    if target is None and isinstance(executor, InProcess) and shared is None:
        return _frame(table.compute, table.grains(0, table.rows.count))
    with closing(_store_of_blocks(table.about(block_rows), target, shared)) as store:
        _finish(table, store, executor, progress)
        total = store.about.total
        wanted = range(total if frame else 1)
        whole = pd.concat([pd.read_parquet(store.block(number)) for number in wanted], ignore_index=True)
        if target is not None and not target.partitioned:
            joined(map(store.block, range(total)), target.path)
            store.remove()
        elif target is not None and not isinstance(store, BlockFolder):
            _copied(store, target)
    return whole if frame else whole.iloc[:0]


def _store_of_blocks(about: About, target: Target | None, shared: tuple[str, str] | None) -> BlockStore:
    if shared is not None:
        return block_table(shared[0], about, shared[1])
    small = target is not None and about.total == 1 and not target.occupied
    if target is None or (small and not target.partitioned):
        return InMemory(about)
    return BlockFolder(target.blocks, about, target.resume, target.overwrite)


def _copied(store: BlockStore, target: Target) -> None:
    """Write the blocks of a store as the files of a directory."""
    with closing(BlockFolder(target.blocks, store.about, target.resume, target.overwrite)) as folder:
        for number in sorted(store.completed - folder.completed):
            block = store.block(number)
            folder.keep(number, block.read_bytes() if isinstance(block, Path) else block.getvalue())


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
            while len(store.completed) < total:
                before, tasks = len(store.completed), _tasks(table, store, total, apart)
                for task, outcome in executor.completed(perform, lambda: next(tasks, None)):  # noqa: B023
                    if isinstance(outcome, Lost):
                        raise RunError(f"block {task.number}: {outcome.reason}")
                    store.keep(task.number, outcome)
                    report()
                store.refresh()
                if len(store.completed) == before:
                    time.sleep(POLL_S)  # others are at work on the remaining blocks
                report()
    except RunError as error:
        raise RunError(f"{error}; {store.saved()}") from error


def _tasks(table: Computed, store: BlockStore, total: int, apart: bool) -> Iterator[Block]:
    """The blocks that are missing; what goes to other processes (`apart`) is pickled once."""
    block_rows = store.about.block_rows
    content = pickle.dumps(table.compute) if apart else table.compute
    name = hashlib.sha256(repr(store.about).encode()).hexdigest()[:24]
    for number in range(total):
        if number in store.completed or not store.claim(number):
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


# Blocks in a store that machines share.


class BlockTable(BlockStore):
    """The blocks of a table, of which each machine computes those that no other has begun.

    Whole blocks that are there already are kept, damaged ones are computed again. Raises
    InputError, which names `place`, where the store holds anything else.
    """

    def __init__(self, backend: Backend, about: About, place: str = "--store") -> None:
        self._store = Store(backend)
        self.completed = set()
        try:
            self._store.migrate()
            self.about = self._agreed(about, place)
            self.refresh()
            if damaged := [number for number in self.completed if not self._is_intact(number)]:
                dropped = delete(BLOCKS).where(BLOCKS.c.number.in_(damaged))
                self._store.write(lambda connection: connection.execute(dropped))
                self.completed.difference_update(damaged)
        except BaseException:
            self._store.close()
            raise

    @property
    def _database_name(self) -> str:
        return self._store.backend.display_name

    def claim(self, number: int) -> bool:
        return self._store.claim([number], BLOCKS) == [number]

    def keep(self, number: int, content: bytes) -> None:
        digest = hashlib.sha256(content).hexdigest()
        row = self._store.backend.insert(BLOCKS).on_conflict_do_nothing()

        def work(connection: Connection) -> None:
            connection.execute(row.values(number=number, content=content, digest=digest))
            self._store.finished(connection, [number])

        self._store.write(work)
        self._store.let_go([number])
        self.completed.add(number)

    def refresh(self) -> None:
        statement = select(BLOCKS.c.number).where(BLOCKS.c.number < self.about.total)
        self.completed = {number for (number,) in self._read(lambda connection: connection.execute(statement).all())}

    def block(self, number: int) -> io.BytesIO:
        statement = select(BLOCKS.c.content).where(BLOCKS.c.number == number)
        return io.BytesIO(bytes(self._read(lambda connection: connection.execute(statement).scalar_one())))

    def saved(self) -> str:
        return f"{self._count(self._database_name)}; run the same command again to continue"

    def close(self) -> None:
        self._store.close()

    def _read(self, work: Any) -> Any:
        try:
            return self._store.read(work)
        except DAMAGE as error:
            raise RunError(f"{self._database_name} cannot be read: {reason(error)}") from error

    def _is_intact(self, number: int) -> bool:
        statement = select(BLOCKS.c.digest).where(BLOCKS.c.number == number)
        digest = self._read(lambda connection: connection.execute(statement).scalar_one())
        return bool(hashlib.sha256(self.block(number).getvalue()).hexdigest() == digest)

    def _agreed(self, about: About, place: str) -> About:
        """The identity of the blocks: those that are there decide how many rows a block has."""
        identity = json.dumps(sealed_record(asdict(about)))
        while not self._store.meta(TABLE):
            if self._store.meta(STUDY):
                raise refuse(place, f"{self._database_name} holds a study; {self._store.backend.alternative}")
            self._store.set_meta({TABLE: identity}, TABLE, "")
        try:
            stored = unsealed_record(loads(self._store.meta(TABLE)))
        except ValueError as error:
            raise refuse(place, f"{self._database_name} cannot be read: {error}") from error
        raise_all(
            Fault(place, f"{self._database_name} belongs to {other}; {self._store.backend.alternative}")
            for other in about.differences(stored)
        )
        return about.with_blocks_of(stored)


def block_table(address: str, about: About, place: str) -> BlockTable:
    """The blocks at the address of a store."""
    backend = PostgreSQL(read_address(address))
    try:
        return BlockTable(backend, about, place)
    except DAMAGE as error:
        cause, remedy = backend.explained(error)
        raise refuse(place, f"{backend.display_name}: {cause}; {remedy}") from error
