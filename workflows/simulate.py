"""`tolevo simulate`: the model's predictions at given operating points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from ..errors import Fault, refuse
from ..files import write_text, write_with
from ..models.measurable import MeasurableModel
from ..tables import Table, column_faults, numbers, read_table, refuse_all

EXTRA = ("time_s", "repeat")
"""Columns that any measurement table may add."""


def simulate(
    model: MeasurableModel, path: Path, out: Path, seed: int
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Predicted outputs beside the inputs of a CSV or Parquet table, written to `out`.

    Also returns what the user should know: optional columns that are missing. Raises InputError
    with every fault of the table.
    """
    if out.suffix not in (".csv", ".parquet"):
        raise refuse("--out", f"must end in .csv or .parquet, got {out.name}")
    frame, notes = _inputs(model, read_table(path))
    rng = np.random.default_rng(seed)
    columns = {str(name): frame[name].to_numpy() for name in frame}
    for name, values in model.predict(columns, rng).items():
        frame[name] = values
    if out.suffix == ".parquet":
        write_with(out, lambda part: frame.to_parquet(part, index=False))
    else:
        write_text(out, frame.to_csv(index=False))
    return frame, notes


def _inputs(model: MeasurableModel, table: Table) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """The table with numbers where numbers belong, in the order of the file."""
    noise = [f"{output.name}_std" for output in model.outputs]
    needed = [c.name for c in model.columns if c.needed]
    optional = [c.name for c in model.columns if not c.needed]
    outputs = [o.name for o in model.outputs]
    faults = column_faults(table, needed, [*optional, *EXTRA, *noise, *outputs])
    faults += [
        Fault(f"{table.place}: header", f"`{name}` is what the model predicts; remove or rename it")
        for name in outputs
        if name in table.header
    ]
    labels = {c.name for c in model.columns if c.label}
    known = {*needed, *optional, *EXTRA, *noise}
    numeric = [name for name in table.header if name in known - labels]
    values, wrong = numbers(table, numeric)
    faults += wrong
    for name in labels.intersection(table.header):
        cells = enumerate(table.column(name))
        faults += [Fault(table.where(row, name), "is empty") for row, cell in cells if not cell]
    refuse_all(faults)
    columns = {
        name: values[:, numeric.index(name)] if name in numeric else table.column(name)
        for name in table.header
    }
    missing = [name for name in optional if name not in table.header]
    notes = (f"optional columns not given: {', '.join(missing)}",) if missing else ()
    return pd.DataFrame(columns), notes
