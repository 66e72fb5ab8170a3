"""`tolevo simulate`: a model's predictions at given operating points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .. import tables
from ..errors import Fault, raise_all
from ..models.effects.compose import Active, predicted
from ..models.effects.readings import target_of
from ..models.measurable import NO_CHANGES, MeasurableModel
from ..models.table import MeasuredTable

ALWAYS_ALLOWED = ("time_s", "repeat", "session")
LABELS = ("session",)
"""Those that are no numbers."""


def simulated(
    model: MeasurableModel,
    table_read: tables.Table,
    place: str,
    seed: int = 0,
    name: str = "",
    effects: tuple[Active, ...] = (),
    zero: Mapping[str, float] = NO_CHANGES,
    uses: Mapping[str, tables.ColumnUse] | None = None,
    understood: tables.Tell = tables.silent,
    notes: tables.Tell = tables.silent,
) -> pd.DataFrame:
    """The inputs in a table, which faults call `place`, with the predicted outputs beside them.

    `effects` are active in the model `name`, `zero` is added to its outputs. Measured outputs in
    the table are left out. `uses` says what the columns of the file are.

    `understood` is told how the table was read, `notes` what the user should know: optional columns
    that are missing, and columns that were left out. Raises InputError with every fault.
    """
    fitted = tables.fitted(table_read, place, _units(model), uses)
    given = fitted.cells
    frame, faults, unused = _inputs(model, given, place)
    raise_all([*faults, *fitted.faults])
    understood([*table_read.lines(place), *fitted.notes, *unused])
    table = {str(name): frame[name].to_numpy() for name in frame}
    raise_all(_without_columns(model, name, table, effects, place))
    rng = np.random.default_rng(seed)
    found = frame.assign(**predicted(model, name, table, effects, rng, zero))
    notes(
        f"{place}: no column {c.name} (optional: {c.meaning}); the model's nominal value is taken"
        for c in model.columns
        if c.name not in frame
    )
    measured = ", ".join(o.name for o in model.outputs if o.name in given)
    if measured or isinstance(model, MeasuredTable):
        named = measured or ", ".join(o.name for o in model.outputs)
        notes([f"{place}: {named} as written are predictions with the effects in them, not the "
               "measurements"])  # fmt: skip
    return found


def _without_columns(
    model: MeasurableModel,
    name: str,
    table: dict[str, NDArray[Any]],
    effects: tuple[Active, ...],
    place: str,
) -> list[Fault]:
    """Effects that need a column which the table has not."""
    target = target_of(model, name, table)
    found = []
    for one in effects:
        if not one.effect.applies(target):
            missing = [role for role in one.effect.needs if role not in target.roles()]
            text = f"the effect {one.effect.name} needs a column of {' and '.join(missing)}"
            if not missing:
                text = f"the effect {one.effect.name} is not for it: {one.effect.left_out(target)}"
            found.append(Fault(place, text))
    return found


def _units(model: MeasurableModel) -> dict[str, str]:
    """The unit of every column that a table of the model can have, by name."""
    columns = {one.name: one.unit for one in model.columns}
    outputs = {one.name: one.unit for one in model.outputs}
    stds = {f"{name}_std": unit for name, unit in outputs.items()}
    return {"time_s": "s"} | stds | columns | outputs


def _inputs(
    model: MeasurableModel, given: pd.DataFrame, place: str
) -> tuple[pd.DataFrame, list[Fault], list[str]]:
    """The typed inputs, every fault of the table, and what to say of columns that are not used."""
    outputs = [output.name for output in model.outputs]
    ignored = model.ignored if isinstance(model, MeasuredTable) else ()
    known = [*(c.name for c in model.columns), *_extras(outputs)]
    cells = given.drop(columns=[*outputs, *ignored], errors="ignore")
    cells, unused = tables.without_unused(cells, known)
    frame, faults = tables.parsed(
        cells,
        place,
        needed=[c.name for c in model.columns if c.needed],
        optional=known,
        text=[*(c.name for c in model.columns if c.text), *LABELS],
    )
    return frame, faults, unused


def _extras(outputs: list[str]) -> list[str]:
    return [*ALWAYS_ALLOWED, *(f"{name}_std" for name in outputs)]
