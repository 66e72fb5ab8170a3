"""`model = "table"`: a configuration whose predictions stand in the table itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..declarations import Output
from ..errors import Fault, InputError, raise_all
from ..models.measurable import Column, Role
from ..models.table import MeasuredTable
from ..problems.settings import Settings
from ..section import Section
from ..workflows.gap.plan import ColumnRole, output_of
from .configuration import Configuration
from .effects import read_effects, resolved_effects
from .gap_columns import read_columns
from .unresolved import UNRESOLVED, read_unresolved
from .zero import ZERO, read_zero, resolved_zero

TABLE = "table"
LABELS = ("unit", "lot")


def read_table_model(top: Section, seed: int, faults: list[Fault]) -> Configuration:
    """The configuration of a table, as `simulate` takes it. Raises InputError with every fault."""
    top.known(("model", "effect", UNRESOLVED, ZERO))
    for key in ("parameters", "variables"):
        if top.take(key) is not None:
            top.fault(key, 'belongs to a model; model = "table" has none')
    before = len(faults)
    columns = read_columns(top, table=True)
    if len(faults) > before:  # without its columns nothing can be said of its effects
        top.finish()
        raise InputError(faults)
    model = table_model(columns)
    effects = read_effects(top, model, TABLE) + read_unresolved(top, model, TABLE)
    zero = read_zero(top, model.outputs)
    top.finish()
    raise_all(faults)
    resolved = {
        "model": TABLE,
        "seed": seed,
        "columns": {name: _written(one) for name, one in columns.items()},
        **resolved_zero(zero),
        **resolved_effects(effects),
    }
    settings = Settings(seed=seed, effects=effects, definition=columns, zero=zero)
    return Configuration(model_name=TABLE, settings=settings, resolved=resolved)


def table_model(columns: Mapping[str, ColumnRole]) -> MeasuredTable:
    """The model of a table with these columns."""
    by = {role: [n for n, c in columns.items() if c.role == role] for role in
          ("measured", "predicted", "std", "ignore")}  # fmt: skip
    outputs = tuple(Output(name, columns[name].unit, "measured") for name in by["measured"])
    apart = {name for names in by.values() for name in names}
    inputs = tuple(
        Column(name, one.unit, one.role, True, one.role in LABELS, Role(one.role))
        for name, one in columns.items()
        if name not in apart
    )
    predictions = {
        str(output_of(name, dict(columns))): (name, columns[name].unit) for name in by["predicted"]
    }
    return MeasuredTable(inputs, outputs, predictions, (*by["std"], *by["ignore"]))


def _written(one: ColumnRole) -> dict[str, Any]:
    parts = {"role": one.role, "unit": one.unit, "of": one.of}
    return {key: value for key, value in parts.items() if value}
