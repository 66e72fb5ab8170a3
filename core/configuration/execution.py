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
    section = Section(parsed_tables(source, overrides), "", faults).section(EXECUTION)
    dask = section.text("dask") or ""
    workers = section.integer("workers", Range(low=1), None)
    block_rows = section.integer("block_rows", Range(low=1), BLOCK_ROWS)
    store = section.text("store") or ""
    section.finish()
    if dask and workers is not None:
        section.fault("dask", "is a scheduler with its own workers; leave out workers")
    workers_faults = choice_faults(workers, False, False, section.place("workers"))
    faults += [fault for fault in workers_faults if fault not in faults] + _option_faults(options)
    execution = options
    if not options.dask and (options.workers is None or isinstance(options.workers, Usual)):
        if dask:
            execution = replace(execution, workers=None, dask=dask, dask_place=section.place("dask"))
        elif workers is not None:
            execution = replace(execution, workers=workers)
    if options.dask and isinstance(options.workers, Usual):
        execution = replace(execution, workers=None)
    if execution.block_rows is None and block_rows is not None:
        execution = replace(execution, block_rows=block_rows)
    if not execution.store and store:
        execution = replace(execution, store=store, store_place=section.place("store"))
    faults += unreachable(execution)
    if execution.store and (keeps or execution.store == store):
        faults += store_faults(execution.store, execution.store_place, look=keeps)
    return execution, faults


def _option_faults(options: Execution) -> list[Fault]:
    """What is wrong with options."""
    faults = []
    if options.block_rows is not None and options.block_rows < 1:
        faults.append(Fault("--block-rows", f"must be at least 1, got {options.block_rows}"))
    if options.dask and options.workers is not None and not isinstance(options.workers, Usual):
        faults.append(Fault("--dask", "is a scheduler with its own workers; leave out --workers"))
    return faults
