"""Blocks of rows as tasks: computed anywhere, stored as they end, the same bytes each time."""

from __future__ import annotations

import hashlib
import pickle
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd

from ...errors import RunError
from ..execution import Executor, InProcess, Lost, built, check_version, pinned
from .folder import BlockFolder
from .rows import Rows
from .store import About, BlockStore, InMemory
from .target import Target, joined

BLOCKS = 250
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
        from .table import block_table  # with it comes SQLAlchemy, slow to load

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
