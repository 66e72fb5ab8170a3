"""The Python interface of tables that are computed row by row: `evaluate` and `simulate`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from os.path import exists, getsize
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from . import tables
from .api_arguments import (
    NOTES,
    READ,
    AnyPath,
    Frame,
    Source,
    Tell,
    at_hand,
    collected,
    executing,
    readable,
    report_lines,
    table_faults_of,
)
from .errors import Fault, raise_all, refuse
from .problems.interfaces import WithEffects

if TYPE_CHECKING:
    from .workflows.blocks import BlockProgress, Target


def evaluate(
    source: Source,
    designs: Frame,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    quality: str = "reported",
    workers: int | None = None,
    dask: str = "",
    store: str = "",
    block_rows: int | None = None,
    partitioned: bool = False,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[BlockProgress], None] | None = None,
    frame: bool = True,
    tell: Tell | None = None,
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> pd.DataFrame:
    """Every variable, output and limit margin of a problem at designs, one per row.

    A front or an allocation can be given as it stands: columns that are no variable are left out
    and named in `.attrs["notes"]`. With `quality` "search" outputs are as coarse as a search sees
    them, and empty where it does not look. Blocks of `block_rows` rows run in `workers` processes
    or on the Dask scheduler at `dask`; no byte depends on it. `out` is a file, or a directory with
    a Parquet file per block (`partitioned`); `resume` computes what is missing of it. Machines
    that name the same `store` share the blocks, each with its own `out`. Without
    `frame` an empty frame is returned, for results too large to be held. Raises ConfigurationError
    with every fault.
    """
    from .api import read
    from .workflows.evaluate import QUALITIES, designs_in, evaluation

    faults = table_faults_of(out, designs, partitioned, resume, overwrite)
    if quality not in QUALITIES:
        faults.append(Fault("--quality", f'must be one of {", ".join(QUALITIES)}, got "{quality}"'))
    source = at_hand(source)
    where = executing(source, settings, workers, dask, faults, block_rows, store)
    configuration = collected(lambda: read(source, settings), faults)
    problem, notes = configuration.problem, list[str]()
    if problem is None:
        faults.append(Fault("problem", "is missing: a model alone can only be simulated"))
    raise_all(faults)
    assert problem is not None
    report_lines(tell, "note", WithEffects.of(problem).effect_notes())
    statement = problem.declaration.model_statement
    report_lines(tell, "model", [statement] if statement else ())
    table, place = readable(designs, tables.ReadOptions(encoding, delimiter, decimal))
    full = designs_in(problem, table, place, notes.extend)
    report_lines(tell, READ, notes)
    computing = evaluation(problem, full, configuration.toml(), quality)
    target = _target(out, partitioned, resume, overwrite, ["feasible"])
    return _computed(computing, where, target, progress, frame, notes)


def simulate(
    source: Source,
    inputs: Frame,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int | None = None,
    dask: str = "",
    store: str = "",
    block_rows: int | None = None,
    partitioned: bool = False,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[BlockProgress], None] | None = None,
    frame: bool = True,
    tell: Tell | None = None,
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> pd.DataFrame:
    """A model's inputs and predictions, one operating point per row.

    Options as those of `evaluate`. Long Parquet files, and directories of such files, are read in
    batches. Raises ConfigurationError with every fault.
    """
    from .api import read
    from .configuration.simulated import build_model
    from .workflows.simulate import Simulation, inputs_in, rows_of
    from .workflows.streamed import streamed

    faults = table_faults_of(out, inputs, partitioned, resume, overwrite)
    source = at_hand(source)
    where = executing(source, settings, workers, dask, faults, block_rows, store)
    configuration = collected(lambda: read(source, settings), faults)
    raise_all(faults)
    model_settings = configuration.settings
    simulation = Simulation(
        build_model(configuration),
        configuration.seed,
        configuration.model_name,
        model_settings.effects,
        dict(model_settings.zero),
    )
    understood, notes, index = list[str](), list[str](), None
    rows: Any = None
    if not isinstance(inputs, pd.DataFrame):
        rows = streamed(simulation, Path(inputs), model_settings.columns, understood.extend, notes.extend)
    if rows is not None:
        columns = list(rows.names.values())
    else:
        table, place = readable(inputs, tables.ReadOptions(encoding, delimiter, decimal))
        points = inputs_in(simulation, table, place, model_settings.columns, understood.extend, notes.extend)
        rows, columns, index = rows_of(points), list(map(str, points)), points.index
    report_lines(tell, READ, understood)
    report_lines(tell, "note", notes)
    computing = simulation.computed(rows, columns, configuration.toml())
    target = _target(out, partitioned, resume, overwrite, [output.name for output in simulation.model.outputs])
    predictions = _computed(computing, where, target, progress, frame, [*understood, *notes])
    return predictions.set_axis(index) if index is not None and frame else predictions


def _target(out: AnyPath | None, partitioned: bool, resume: bool, overwrite: bool, last: list[str]) -> Target | None:
    """Where the table goes. Raises InputError where that is a file whose columns do not end with
    `last`, as those of the command do, and that is not to be replaced.
    """
    from .workflows.blocks import Target

    if out is None:
        return None
    target = Target(Path(out), partitioned, resume, overwrite)
    if not partitioned and not overwrite and exists(out) and getsize(out):
        names = tables.columns_of(target.path)
        if names[-len(last) :] != last:
            raise refuse("--out", f"{out} holds something else: name another file, or add --overwrite")
    return target


def _computed(
    computing: Any,
    where: Any,
    target: Target | None,
    progress: Callable[[BlockProgress], None] | None,
    frame: bool,
    notes: Sequence[str],
) -> pd.DataFrame:
    """The table, by blocks; no other process is started for a single block."""
    from .workflows.blocks import computed
    from .workflows.execution import executor_of

    if not where.dask:
        where = replace(where, workers=min(where.workers or 1, computing.about(where.block_rows).total))
    shared = (where.store, where.store_place) if where.store else None
    done = computed(computing, executor_of(where), target, where.block_rows, progress, frame, shared)
    done.attrs[NOTES] = tuple(notes)
    return done
