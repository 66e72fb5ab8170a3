"""`[execution]`: where a command computes; it is no part of what is computed.

The table is taken out before anything else is read, so that neither the resolved configuration nor
its hash knows of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..arguments import choice_faults
from ..counts import BLOCK_ROWS
from ..errors import Fault
from ..section import Range, Section
from ..workflows.execution import Execution, unreachable
from ..workflows.store.faults import store_faults
from .source import EXECUTION, Source, parsed_tables


class Usual(int):
    """A number of processes that a command has by itself: a configuration may say another."""


def read_execution(
    source: Source, overrides: Sequence[str], given: Execution, keeps: bool = False
) -> tuple[Execution, list[Fault]]:
    """Where to compute: what is `given` as options or, where nothing is, the configuration's table.

    With every fault, those of a Dask scheduler or, of a command that `keeps` blocks or runs, of a
    store which does not answer included. What cannot be read at all is reported by who reads the
    configuration.
    """
    faults: list[Fault] = []
    table = parsed_tables(source, overrides)
    own = Section(table, "", faults).section(EXECUTION)
    dask = own.text("dask") or ""
    workers = own.integer("workers", Range(low=1), None)
    block_rows = own.integer("block_rows", Range(low=1), BLOCK_ROWS)
    store = own.text("store") or ""
    own.finish()
    if dask and workers is not None:
        own.fault("dask", "has workers of its own; leave out workers")
    faults += [
        fault
        for fault in choice_faults(workers, False, False, own.place("workers"))
        if fault not in faults and workers is not None
    ]
    faults += _option_faults(given)
    asked = given
    if not given.dask and (given.workers is None or isinstance(given.workers, Usual)):
        if dask:
            asked = replace(asked, workers=None, dask=dask, dask_place=own.place("dask"))
        elif workers is not None:
            asked = replace(asked, workers=workers)
    if given.dask and isinstance(given.workers, Usual):
        asked = replace(asked, workers=None)
    if asked.block_rows is None and block_rows is not None:
        asked = replace(asked, block_rows=block_rows)
    if not asked.store and store:
        asked = replace(asked, store=store, store_place=own.place("store"))
    faults += unreachable(asked)
    if asked.store and (keeps or asked.store == store):
        faults += store_faults(asked.store, asked.store_place, look=keeps)
    return asked, faults


def _option_faults(given: Execution) -> list[Fault]:
    """What is wrong with options."""
    faults = []
    if given.block_rows is not None and given.block_rows < 1:
        faults.append(Fault("--block-rows", f"must be at least 1, got {given.block_rows}"))
    if given.dask and given.workers is not None and not isinstance(given.workers, Usual):
        faults.append(Fault("--dask", "has workers of its own; leave out --workers"))
    return faults
