"""`[execution]`: where a command computes; the results do not depend on it.

The table is taken out before anything else is read, so that neither the resolved configuration nor
its hash contains it.
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
    """A command's default number of processes, which a configuration may override."""


def read_execution(
    source: Source, overrides: Sequence[str], options: Execution, keeps: bool = False
) -> tuple[Execution, list[Fault]]:
    """Where to compute: by the `options` or, where they state nothing, by the configuration.

    Returns every fault, including those of a Dask scheduler that does not answer and, for a command
    that `keeps` blocks or runs, of a store that does not. A configuration that cannot be read at
    all is reported by its own reader.
    """
    faults: list[Fault] = []
    table = parsed_tables(source, overrides)
    section = Section(table, "", faults).section(EXECUTION)
    dask = section.text("dask") or ""
    workers = section.integer("workers", Range(low=1), None)
    block_rows = section.integer("block_rows", Range(low=1), BLOCK_ROWS)
    store = section.text("store") or ""
    section.finish()
    if dask and workers is not None:
        section.fault("dask", "has workers of its own; leave out workers")
    faults += [
        fault
        for fault in choice_faults(workers, False, False, section.place("workers"))
        if fault not in faults and workers is not None
    ]
    faults += _option_faults(options)
    asked = options
    if not options.dask and (options.workers is None or isinstance(options.workers, Usual)):
        if dask:
            asked = replace(asked, workers=None, dask=dask, dask_place=section.place("dask"))
        elif workers is not None:
            asked = replace(asked, workers=workers)
    if options.dask and isinstance(options.workers, Usual):
        asked = replace(asked, workers=None)
    if asked.block_rows is None and block_rows is not None:
        asked = replace(asked, block_rows=block_rows)
    if not asked.store and store:
        asked = replace(asked, store=store, store_place=section.place("store"))
    faults += unreachable(asked)
    if asked.store and (keeps or asked.store == store):
        faults += store_faults(asked.store, asked.store_place, look=keeps)
    return asked, faults


def _option_faults(options: Execution) -> list[Fault]:
    """What is wrong with options."""
    faults = []
    if options.block_rows is not None and options.block_rows < 1:
        faults.append(Fault("--block-rows", f"must be at least 1, got {options.block_rows}"))
    if options.dask and options.workers is not None and not isinstance(options.workers, Usual):
        faults.append(Fault("--dask", "has workers of its own; leave out --workers"))
    return faults
