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
from typer.testing import CliRunner

from tests.gap_trial.kinds import KINDS, Simulator
from tests.gap_trial.records import Record
from tests.gap_trial.tables import Array
from tolevo import registry
from tolevo.cli import app
from tolevo.models.measurable import MeasurableModel

OWN_MODELS = ("rv_batch", "rv_transmission", "rv_lost_motion")


@lru_cache
def model_of(name: str) -> MeasurableModel:
    """The model with its defaults."""
    kind: Callable[[], MeasurableModel] = registry.load("models", name)
    return kind()


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
    """What `tolevo gap` writes to `gap.json`. Raises RuntimeError where it ends in a fault."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        configuration, table = place / f"{found.name}.toml", place / f"{found.name}.csv"
        configuration.write_text(found.configuration, encoding="utf-8")
        found.table.to_csv(table, index=False)
        out = place / "found"
        words = ["gap", str(configuration), str(table), "--out", str(out), "--quiet"]
        ended = CliRunner().invoke(app, words)
        if ended.exit_code != 0:
            raise RuntimeError(f"{found.name}: status {ended.exit_code}\n{ended.output}")
        said: dict[str, Any] = json.loads((out / "gap.json").read_text(encoding="utf-8"))
        return said
