"""The project under trial, as a user has it: `tolevo gap` on a record, and its own models as the
simulation that tables are made with.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.gap.generator.kinds import KINDS, Simulator
from benchmarks.gap.generator.records import Record
from benchmarks.gap.generator.tables import Array
from tolevo import registry
from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.data import GapData
from tolevo.commands.gap.gap import record
from tolevo.commands.gap.plan import GapPlan
from tolevo.commands.gap.read import read_data
from tolevo.models.measurable import MeasurableModel
from tolevo.page_data import as_json

OWN_MODELS = ("rv_batch", "rv_transmission", "rv_lost_motion")


@lru_cache
def model_of(name: str) -> MeasurableModel:
    """The model with its defaults, but for what its kind of record declares."""
    kind: Callable[[Any], MeasurableModel] = registry.load("models", name)
    return kind(KINDS[name].parameters)


def simulated(name: str) -> Simulator:
    """Predictions of a model of the project."""

    def predict(at: Any, seed: int) -> Array:
        kind = KINDS[name]
        table = {column: np.asarray(values) for column, values in kind.columns(at).items()}
        found = model_of(name).predict(table, np.random.default_rng(seed))
        return np.concatenate([found[output] for output in kind.outputs])

    return predict


SIMULATORS: Mapping[str, Simulator] = {name: simulated(name) for name in OWN_MODELS}


def analysed(found: Record) -> dict[str, Any]:
    """What `gap.json` holds of a record, from its files as a user has them.

    Raises InputError where the project refuses them.
    """
    with TemporaryDirectory() as folder:
        result = gap.analysis_result(*read_as_files(found, Path(folder)))
    said: dict[str, Any] = json.loads(as_json(record(result)))
    return said


def read_as_files(found: Record, folder: Path) -> tuple[GapPlan, GapData]:
    """A record as a user has it: its two files, written into a folder and read.

    Raises InputError where the project refuses them.
    """
    configuration, table = folder / "gap.toml", folder / f"{found.name}.csv"
    configuration.write_text(found.configuration, encoding="utf-8")
    found.table.to_csv(table, index=False)
    plan = read_gap(configuration)
    return plan, read_data(plan, table)
