"""Where a command computes: by its options and, where they state nothing, by its configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from .api_arguments import Source, raw
from .configuration import Configuration
from .errors import Fault

if TYPE_CHECKING:
    from .workflows.execution import Execution


def executing(
    source: Source | Mapping[str, object],
    settings: Sequence[str],
    workers: int | None,
    dask: str,
    faults: list[Fault],
    block_rows: int | None = None,
    store: str | None = None,
) -> Execution:
    """Where to compute; what is wrong with that is added to `faults`.

    A command that can keep finished parts in a shared `store` passes its address, "" for none.
    """
    from .configuration.execution import read_execution
    from .workflows.execution import Execution

    options = Execution(workers, dask, block_rows, store=store or "")
    tables = {} if isinstance(source, Configuration) else raw(source)
    execution, execution_faults = read_execution(tables, settings, options, store is not None)
    faults += execution_faults
    return execution if store is not None else replace(execution, store="")
