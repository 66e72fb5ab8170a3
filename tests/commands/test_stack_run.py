"""`stack` from its configuration to the files of a run."""

from __future__ import annotations

import json
import tomllib
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq

from tests.small_jobs import output_of, tolevo, written
from tolevo.configuration.reader import read

pytestmark = pytest.mark.usefixtures("unrendered")

CLUTCH = Path(str(files("tolevo.configs") / "stack_clutch.toml"))
EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "clutch.toml"
SMALL = ["--set", "algorithm.population=20", "--set", "algorithm.generations=5"]


@pytest.mark.source_tree
def test_the_example_of_the_documentation_runs(tmp_path: Path) -> None:
    output_of("run", EXAMPLE, "--out", tmp_path / "o", "--quiet", *SMALL)
    front = pd.read_csv(tmp_path / "o" / "front.csv")
    assert {"hub_t", "roller_t", "cage_t", "cage_process", "yield_percent"} <= set(front)
    assert set(front["cage_process"]) == {"turned"}


@pytest.mark.slow
def test_files_of_a_run_repeat_byte_for_byte(tmp_path: Path) -> None:
    first = tolevo(
        "run", CLUTCH, "--out", tmp_path / "a", *SMALL, "--set", "limits.variation=0.03", "--set", "references=ga"
    )
    assert first.exit_code == 0, first.stderr
    output_of("run", tmp_path / "a" / "config.toml", "--out", tmp_path / "b", "--workers", 1)
    for name in ("config.toml", "front.csv", "front.json", "references.csv"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name
    references = pd.read_csv(tmp_path / "a" / "references.csv")
    ways = ("exact", "GA")
    assert references["label"].tolist() == [f"{way}, least cost within the limits" for way in ways]
    assert references["cage_process"].isin(["turned", "ground"]).all()
    notes = json.loads((tmp_path / "a" / "summary.json").read_text(encoding="utf-8"))["notes"]
    assert any("the linear model misleads" in note for note in notes)
    front = pd.read_parquet(tmp_path / "a" / "front.parquet")
    assert front["cage_process"].isin(["turned", "ground"]).all()


def test_least_cost_of_the_clutch_by_ga(tmp_path: Path) -> None:
    """Against the Lagrange optimum of each process, with the rollers' share taken off the limit."""
    settings = ["--set", 'objectives.minimise=["cost"]', "--set", "limits.variation=0.025",
                "--set", "algorithm.name=ga", "--set", "algorithm.generations=60"]  # fmt: skip
    output_of("run", CLUTCH, "--out", tmp_path / "o", "--quiet", *settings)
    found = pd.read_csv(tmp_path / "o" / "front.csv").iloc[0]
    angle, reach = np.arccos(78.15 / 78.74), 78.74
    hub, cage = 1.0 / (reach * np.sin(angle)), 1.0 / (reach * np.tan(angle))
    room = 0.025**2 - 2.0 * (0.5 * (hub + cage) * 0.0127) ** 2

    def cost(a: float, b: float, low: float, high: float) -> float:
        def share(t_hub: float) -> float:
            return float(np.sqrt(room - (hub * t_hub) ** 2) / cage)

        def slope(t: float) -> float:
            return float(0.75 / (hub**2 * t**3) - b / (cage**2 * share(t) ** 3))

        t = float(brentq(slope, 0.05, 0.999 * np.sqrt(room) / hub))
        t_cage = float(np.clip(share(t), low, high))
        t = min(0.25, float(np.sqrt(room - (cage * t_cage) ** 2) / hub))
        return float(3.5 + 0.75 / t + a + b / t_cage)

    best = min(cost(6.0, 0.16, 0.15, 0.25), cost(6.5, 0.2, 0.01, 0.15))
    assert found["cost"] == pytest.approx(best, rel=2e-3)
    assert found["cost"] >= best * (1.0 - 1e-9)


def test_resolved_configuration_reads_back(tmp_path: Path) -> None:
    text = """
    problem = "stack"
    [requirement]
    unit = "mm"
    nominal = "0.5 mm"
    lower = "200 um"
    method = "shifted_rss"
    [[part]]
    name = "a"
    nominal = 25.0
    unit = "mm"
    fit = "25 H7"
    sensitivity = 1.0
    cpk = 0.9
    cp = 1.2
    [[part]]
    name = "b"
    unit = "mm"
    limits = "+0.02/-0.01"
    sensitivity = -1.0
    distribution = "uniform"
    cost = { model = "combined", a = 1.0, b = 0.1, k = 1.0, c = 0.1, m = 2.0 }
    [[part]]
    name = "c"
    unit = "um"
    count = 3
    sensitivity = 0.001
    [[part.process]]
    name = "milled"
    t_min = "0.01 mm"
    t_max = 100
    cost = { model = "table", t = [10.0, 100.0], cost_at = [4.0, 1.0] }
    [[correlation]]
    parts = ["c_1", "c_2"]
    coefficient = 0.25
    """
    (tmp_path / "c.toml").write_text(text, encoding="utf-8")
    first = read(tmp_path / "c.toml")
    (tmp_path / "d.toml").write_text(first.toml(), encoding="utf-8")
    again = read(tmp_path / "d.toml")
    assert again.toml() == first.toml()
    assert first.problem is not None and again.problem is not None
    design = first.problem.complete(np.array([[50.0]]))
    for name, value in first.problem.outputs_of(design).items():
        np.testing.assert_array_equal(again.problem.outputs_of(design)[name], value)


def test_evaluate_takes_names_of_processes(tmp_path: Path) -> None:
    table = tmp_path / "d.csv"
    table.write_text("hub_t,cage_t,cage_process\n0.1,0.2,turned\n0.1,0.1,ground\n", "utf-8")
    output_of("evaluate", CLUTCH, table, "--out", tmp_path / "e.csv")
    found = pd.read_csv(tmp_path / "e.csv")
    assert found["cage_process"].tolist() == ["turned", "ground"]
    assert found["roller_t"].tolist() == [0.0127, 0.0127]
    costs = [3.5 + 0.75 / 0.1 + 6.0 + 0.16 / 0.2, 3.5 + 0.75 / 0.1 + 6.5 + 0.2 / 0.1]
    np.testing.assert_allclose(found["cost"], costs)


def test_evaluate_places_bad_processes_and_tolerances(tmp_path: Path) -> None:
    table = tmp_path / "d.csv"
    rows = ["0.1,0.2,grund", "0.1,0.1,turned", "-0.1,0.2,", "0.1,0.2,0"]
    table.write_text("hub_t,cage_t,cage_process\n" + "\n".join(rows[:1] + rows[2:]) + "\n", "utf-8")
    result = tolevo("evaluate", CLUTCH, table, "--out", tmp_path / "e.csv")
    assert result.exit_code == 2
    assert 'row 2, column cage_process: must be one of turned, ground, got "grund"' in result.stderr
    assert "row 3, column hub_t: must be at least 0 mm" in result.stderr
    assert "row 3, column cage_process: is empty" in result.stderr
    assert "row 4, column cage_process: must be one of turned, ground" in result.stderr
    table.write_text("hub_t,cage_t,cage_process\n" + rows[1] + "\n", encoding="utf-8")
    result = tolevo("evaluate", CLUTCH, table, "--out", tmp_path / "e.csv")
    assert result.exit_code == 2
    assert "row 2, column cage_t: process turned holds 0.15 to 0.25 mm, got 0.1" in result.stderr
    assert not (tmp_path / "e.csv").exists()


def test_check_shows_choices_assumptions_and_warnings() -> None:
    result = tolevo("check", CLUTCH)
    assert result.exit_code == 0
    assert "#   cage_process: turned or ground; choice" in result.stdout
    assert "part.hub.distribution = Normal" in result.stdout
    assert "the linear model misleads" in result.stdout
    assert tomllib.loads(result.stdout)["part"][1]["count"] == 2


def test_nothing_is_written_where_the_stack_is_wrong(tmp_path: Path) -> None:
    config = tmp_path / "c.toml"
    text = CLUTCH.read_text(encoding="utf-8")
    config.write_text(text.replace("acos(", "__import__("), encoding="utf-8")
    result = tolevo("run", config, "--out", tmp_path / "o")
    assert result.exit_code == 2
    assert "requirement.formula: column 1: `__import__` is not a function" in result.stderr
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "o").exists()


def test_a_stack_without_anything_to_choose_cannot_be_run(tmp_path: Path) -> None:
    text = """
    problem = "stack"
    [requirement]
    unit = "mm"
    [[part]]
    name = "a"
    sensitivity = 1.0
    tolerance = 0.1
    """
    config = written(tmp_path / "c.toml", text)
    result = tolevo("run", config, "--out", tmp_path / "o")
    assert result.exit_code == 2
    assert "every variable is fixed" in result.stderr
    assert not (tmp_path / "o").exists()
    table = written(tmp_path / "d.csv", "a_t\n0.1\n0.2\n")
    assert tolevo("evaluate", config, table, "--out", tmp_path / "e.csv").exit_code == 0
    np.testing.assert_allclose(pd.read_csv(tmp_path / "e.csv")["rss"], [0.1, 0.2])
