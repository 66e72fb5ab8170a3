"""Where the work of a command is done, as it was asked for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Execution:
    """`[execution]` of a configuration, or the options of a command: no result depends on it.

    `workers` are processes of this machine, `dask` the address of a scheduler instead of them,
    `block_rows` the rows of a block of a table; None where nothing is stated.
    """

    workers: int | None = None
    dask: str = ""
    block_rows: int | None = None
    dask_place: str = "--dask"
    """Where the address stands, as faults name it."""
    store: str = ""
    """Address of the database in which several machines keep what has ended; empty for files."""
    store_place: str = "--store"
