"""`tolevo simulate`: a model's predictions at given operating points."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
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


def simulate(
    model: MeasurableModel,
    path: Path,
    out: Path,
    seed: int = 0,
    name: str = "",
    effects: tuple[Active, ...] = (),
    zero: Mapping[str, float] = NO_CHANGES,
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """The inputs in `path` with the predicted outputs beside them, written to `out`.

    `effects` are active in the model `name`, `zero` is added to its outputs. Measured outputs in
    the table are left out.

    Also returns what the user should know: optional columns that are missing, and columns that were
    left out. Raises InputError with every fault of the table; nothing is written then.
    """
    place = path.name
    given = tables.read(path, place)
    frame, faults = _inputs(model, given, place)
    raise_all(faults)
    table = {str(name): frame[name].to_numpy() for name in frame}
    raise_all(_without_columns(model, name, table, effects, place))
    rng = np.random.default_rng(seed)
    found = frame.assign(**predicted(model, name, table, effects, rng, zero))
    tables.write(found, out)
    notes = tuple(
        f"{place}: no column {c.name} (optional: {c.meaning}); the model's nominal value is taken"
        for c in model.columns
        if c.name not in frame
    )
    measured = ", ".join(o.name for o in model.outputs if o.name in given)
    if measured or isinstance(model, MeasuredTable):
        named = measured or ", ".join(o.name for o in model.outputs)
        notes += (f"{place}: {named} as written are predictions with the effects in them, not the "
                  "measurements",)  # fmt: skip
    return found, notes


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
            found.append(Fault(place, text))
    return found


def _inputs(
    model: MeasurableModel, given: pd.DataFrame, place: str
) -> tuple[pd.DataFrame, list[Fault]]:
    """The typed inputs and every fault of the table."""
    outputs = [output.name for output in model.outputs]
    ignored: tuple[str, ...] = ()
    if isinstance(model, MeasuredTable):  # what has no role is of no use
        known = {*(c.name for c in model.columns), *_extras(outputs)}
        ignored = (*model.ignored, *(str(name) for name in given.columns if name not in known))
    return tables.parsed(
        given.drop(columns=[*outputs, *ignored], errors="ignore"),
        place,
        needed=[c.name for c in model.columns if c.needed],
        optional=[c.name for c in model.columns] + _extras(outputs),
        text=[*(c.name for c in model.columns if c.text), *LABELS],
    )


def _extras(outputs: list[str]) -> list[str]:
    return [*ALWAYS_ALLOWED, *(f"{name}_std" for name in outputs)]
