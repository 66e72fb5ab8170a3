"""The worked example of docs/gap.md: its data are the generator's, its commands run."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from benchmarks.gap.generator.records import record
from benchmarks.gap.namers.workflow import SIMULATORS
from tolevo.cli import app

ROOT = Path(__file__).resolve().parents[2]
pytestmark = [pytest.mark.source_tree, pytest.mark.usefixtures("unrendered")]
FEW = ("algorithm.generations=5", "algorithm.population=20", "references=none")
"""A search short enough for a test."""


def commands() -> list[list[str]]:
    text = (ROOT / "docs" / "gap.md").read_text(encoding="utf-8")
    example = text[text.index("## A worked example") :]
    return [shlex.split(one) for one in example.splitlines() if one.startswith("tolevo ")]


def test_data_are_those_of_the_trial() -> None:
    found, truth = record("batch good", 7, SIMULATORS)
    table = pd.read_csv(ROOT / "docs" / "rv40e_batch" / "units.csv")
    assert truth.names == ("spread_inflation",)
    measured = found.table["backlash_arcmin"].to_numpy()
    np.testing.assert_allclose(table["backlash_arcmin"], measured, atol=5.1e-6)


@pytest.fixture(scope="module")
def ended(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the commands of the example ended, their results below runs/."""
    place = tmp_path_factory.mktemp("example")
    for words in commands():
        moved = [str(ROOT / one) if one.startswith("docs/") else one for one in words[1:]]
        moved = [str(place / one) if one.startswith("runs/") else one for one in moved]
        few = [part for one in FEW for part in ("--set", one)] if moved[0] == "run" else []
        done = CliRunner().invoke(app, [*moved, "--quiet", *few])
        assert done.exit_code == 0, done.output
    return place / "runs"


def test_the_hidden_effect_is_named(ended: Path) -> None:
    _, truth = record("batch good", 7, SIMULATORS)
    said = json.loads((ended / "rv40e_gap" / "gap.json").read_text(encoding="utf-8"))
    assert said["verdict"] == "named"
    assert [one["name"] for one in said["effects"]] == ["spread_inflation"]
    drawn = truth.points.drawn - truth.points.drawn.mean()
    stretched = truth.hidden[0].added @ drawn / (drawn @ drawn)
    low, high = said["effects"][0]["parameters"]["growth"]["interval"]
    assert low < stretched < high


def test_the_allocation_is_repeated_with_it(ended: Path) -> None:
    moved = pd.read_csv(ended / "rv40e_corrected" / "allocation_moved.csv")
    by = {name: rows.set_index("level") for name, rows in moved.groupby("allocation")}
    assert len(by["before"]) > 0
    assert (by["kept"]["backlash_arcmin"] > by["before"]["backlash_arcmin"]).all()
    np.testing.assert_allclose(by["kept"]["cost"], by["before"]["cost"])
    level = by["after"].index.to_numpy()
    assert (by["after"]["backlash_arcmin"].to_numpy() <= level + 1e-9).all()
    assert "report.html" in {one.name for one in (ended / "rv40e_gap").iterdir()}
