"""`model = "table"`: a configuration whose predictions are columns of the table itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..declarations import Output
from ..errors import Fault, InputError, raise_all
from ..models.gear import Gear
from ..models.measurable import Column, Role
from ..models.table import MeasuredTable
from ..problems.settings import Settings
from ..section import Section
from ..workflows.gap.plan import ColumnRole, output_of
from .configuration import Configuration
from .effects import read_effects
from .gap_columns import read_columns
from .gear import GEAR, read_gear, resolved_gear
from .labels import read_labels
from .resolved import resolved_measurement
from .senses import SENSE, ZERO, read_sense, read_zero
from .unresolved import UNRESOLVED, read_unresolved

TABLE = "table"
LABELS = ("unit", "lot")


def read_table_model(top: Section, seed: int, faults: list[Fault]) -> Configuration:
    """The configuration of a table, as `simulate` takes it. Raises InputError with every fault."""
    top.accept(("model", "effect", UNRESOLVED, ZERO, GEAR, SENSE))
    for key in ("parameters", "variables"):
        if top.take(key) is not None:
            top.fault(key, 'belongs to a model; model = "table" has none')
    labels, before = read_labels(top), len(faults)
    columns = read_columns(top)
    gear = read_gear(top)
    unknown = [Output(name, "", "") for name in top.section("columns").all_keys() if name not in columns]
    columns = _turned(columns, read_sense(top, (*outputs_of(columns), *unknown)), top)
    if len(faults) > before:  # its effects cannot be checked without its columns
        top.finish()
        raise InputError(faults)
    model = table_model(columns, gear)
    effects = read_effects(top, model, TABLE) + read_unresolved(top, model, TABLE)
    zero = read_zero(top, model.outputs)
    top.finish()
    raise_all(faults)
    settings = Settings(seed=seed, effects=effects, definition=columns, zero=zero, gear=gear, labels=labels)
    resolved = {
        "model": TABLE,
        **labels.stated(),
        "seed": seed,
        "columns": {name: _written(column) for name, column in columns.items()},
        **resolved_gear(gear),
        **resolved_measurement(settings),
    }
    return Configuration(model_name=TABLE, settings=settings, resolved=resolved)


def table_model(columns: Mapping[str, ColumnRole], gear: Gear | None = None) -> MeasuredTable:
    """The model of a table with these columns."""
    by = {
        role: [n for n, c in columns.items() if c.role == role] for role in ("measured", "predicted", "std", "ignore")
    }
    apart = {name for names in by.values() for name in names}
    inputs = tuple(
        Column(name, column.unit, column.role, True, column.role in LABELS, Role(column.role), column.sense)
        for name, column in columns.items()
        if name not in apart
    )
    predictions = {str(output_of(name, dict(columns))): (name, columns[name].unit) for name in by["predicted"]}
    turned = tuple(name for name in by["predicted"] if columns[name].sense < 0)
    ignored = (*by["std"], *by["ignore"])
    return MeasuredTable(inputs, outputs_of(columns), predictions, ignored, gear, turned)


def outputs_of(columns: Mapping[str, ColumnRole]) -> tuple[Output, ...]:
    """The measured columns as outputs."""
    return tuple(Output(n, c.unit, "measured") for n, c in columns.items() if c.role == "measured")


def _turned(columns: dict[str, ColumnRole], sense: Mapping[str, int], top: Section) -> dict[str, ColumnRole]:
    """The columns with the sense that `[sense]` gives of outputs."""
    for name in sense:
        if name in columns and columns[name].sense < 0:
            top.section(SENSE).fault(name, f"is given twice: here and in columns.{name}")
    return {n: replace(c, sense=sense.get(n, c.sense)) for n, c in columns.items()}


def _written(column: ColumnRole) -> dict[str, Any]:
    parts: dict[str, Any] = {"role": column.role, "unit": column.unit, "of": column.of}
    turned = {"sense": column.sense} if column.sense < 0 else {}
    return {key: value for key, value in parts.items() if value} | turned
