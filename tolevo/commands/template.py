"""`tolevo template`: examples of the tables and configurations that commands read."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..configuration.reader import read
from ..errors import Fault, nearest, raise_all, refuse
from ..files import csv_text
from ..models.measurable import Column, MeasurableModel, Role
from ..problems.tolerance_problem import ToleranceProblem
from ..registry import load

KINDS = ("designs", "units", "stack", "gap", "costs", "qdas")
UNITS = 20
"""Units of a batch in the template."""
COSTS = 3
"""Prices of each tolerance in the template."""
STACK = "stack_clutch.toml"
"""The configuration that is the template of a stack."""

_GAP = """\
# Where do model and measurement disagree? Reads units.csv (`tolevo template units`):
#
#   tolevo gap gap.toml units.csv --out runs/gap

model = "rv_batch"
seed = 0

[columns]                 # name of a column in the file = name in the model, or role and unit
"unit" = "unit"
"backlash_arcmin" = { role = "measured", unit = "arcmin" }
# "Seriennr." = { role = "ignore" }

[effects]
consider = "all"          # or names, families; never = [...]

[validation]
blocks = "auto"           # or a column: lot, session
"""

_MEASURED = """
# Where parts of a process were measured, the table of the part takes them instead of a distribution
# (of other problems [variables.NAME.measured]; docs/stack.md):
#
#   [part.measured]
#   file = "hubs.csv"              # or .dfq, .xlsx, .parquet
#   characteristic = "diameter"
#   made_to = "0.05 mm"            # half-width that these parts were made to
#   mean = "as_found"              # or "corrected"
"""


def _designs(problem: ToleranceProblem) -> pd.DataFrame:
    """The document's allocation, and the middle of the search ranges."""
    middle = {variable.name: float(f"{0.5 * (variable.low + variable.high):.4g}") for variable in problem.variables}
    document = middle | {v.name: v.document for v in problem.variables if v.document is not None}
    frame = pd.DataFrame([document, middle | dict(problem.fixed)])
    for variable in problem.variables:
        if variable.labels:
            frame[variable.name] = [variable.labels[int(at)] for at in frame[variable.name]]
        elif variable.integer:
            frame[variable.name] = frame[variable.name].round().astype(int)
    return frame


def _units(model: MeasurableModel) -> pd.DataFrame:
    """Units of a batch, drawn by the model with a fixed seed."""
    table = {column.name: _inputs(column) for column in model.columns if column.text or column.role is Role.TEMPERATURE}
    outputs = model.predict(table, np.random.default_rng(0))
    return pd.DataFrame(table | {name: values.round(4) for name, values in outputs.items()})


def _inputs(column: Column) -> np.ndarray[Any, np.dtype[Any]]:
    """Cells of an input column: labels of units and lots, the reference temperature."""
    if column.text:
        per_label = 1 if column.role is Role.UNIT else UNITS // 2
        labels = [f"{column.name}-{1 + at // per_label:03d}" for at in range(UNITS)]
        return np.array(labels, dtype=object)
    return np.full(UNITS, 20.0)


def _costs(problem: ToleranceProblem) -> pd.DataFrame:
    """Prices of each tolerance at some values of it, by the curves that the problem has."""
    rows = []
    for variable in problem.variables:
        curve = problem.settings.costs.get(variable.name, problem.declaration.costs.get(variable.name))
        if curve is None or variable.integer:
            continue
        ts = np.geomspace(variable.low, variable.high, COSTS)
        for t, price in zip(ts, curve.cost(ts), strict=True):
            rows.append([variable.name, "", float(f"{t:.4g}"), float(f"{price:.4g}")])
    return pd.DataFrame(rows, columns=["variable", "process", "t", "cost"])


# What a template is filled with: the problem and the model of a configuration.


DEFAULT = "rv40e_backlash.toml"
"""The configuration whose variables fill a template where none is named."""


def stack_workbook(config: Path | None = None) -> bytes:
    """The workbook of a stack: of the configuration in a file, else of the template. Raises InputError."""
    from ..configuration.source import override_source
    from ..configuration.workbook import write_sheets

    faults: list[Fault] = []
    example = Path(str(files("tolevo.configs"))) / STACK
    tables = override_source(config or example, (), faults)
    raise_all(faults)
    return write_sheets(tables)


def written(kind: str, config: Path | None = None, run: Path | None = None) -> str:
    """The text of a template, "qdas" of the allocation of a run. Raises InputError where the kind is
    not known.
    """
    if kind not in KINDS:
        raise refuse("KIND", f'must be one of {", ".join(KINDS)}, got "{kind}"{nearest(kind, KINDS)}')
    if (kind == "qdas") != (run is not None):
        text = (
            "is missing: the directory of the run whose limits are written" if run is None else "belongs to qdas alone"
        )
        raise refuse("--run", text)
    if run is not None:
        from .review.configuration import drawing_text

        return drawing_text(run)
    configuration = read(config or Path(str(files("tolevo.configs"))) / DEFAULT)
    if configuration.problem is None:
        raise refuse("--config", "needs a problem: a model alone has no variables")
    problem = configuration.problem
    texts: dict[str, Callable[[], str]] = {
        "designs": lambda: csv_text(_designs(problem)),
        "units": lambda: csv_text(_units(load("models", "rv_batch")())),
        "stack": lambda: files("tolevo.configs").joinpath(STACK).read_text("utf-8") + _MEASURED,
        "gap": lambda: _GAP,
        "costs": lambda: csv_text(_costs(problem)),
    }
    return texts[kind]()
