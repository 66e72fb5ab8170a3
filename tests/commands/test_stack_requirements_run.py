"""A run with several requirements: its tables, its page, and faults that write nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.small_jobs import output_of, tolevo
from tolevo.algorithms.exact.choices import least_cost
from tolevo.algorithms.exact.solver import closed_form
from tolevo.api import run
from tolevo.configuration.reader import read

pytestmark = pytest.mark.usefixtures("unrendered")

CONFIGURATION = """
problem = "stack"
[objectives]
minimise = ["cost"]
[limits]
gap.variation = 0.2
tilt.variation = 0.12
[algorithm]
name = "exact"
[[requirement]]
name = "gap"
unit = "mm"
[[requirement]]
name = "tilt"
unit = "mrad"
method = "worst_case"
[[part]]
name = "a"
unit = "mm"
sensitivity = { gap = 1.0, tilt = "0.2 mrad/mm" }
[[part.process]]
name = "fine"
t_min = 0.02
t_max = 0.15
cost = { model = "reciprocal", a = 2.0, b = 0.04 }
[[part.process]]
name = "coarse"
t_min = 0.1
t_max = 0.4
cost = { model = "reciprocal", a = 1.0, b = 0.06 }
[[part]]
name = "b"
unit = "mm"
sensitivity = { gap = -1.0 }
t_min = 0.02
t_max = 0.4
cost = { model = "reciprocal", a = 2.0, b = 0.09 }
[[part]]
name = "c"
unit = "mm"
sensitivity = { tilt = 1.0 }
t_min = 0.02
t_max = 0.4
cost = { model = "reciprocal", a = 0.5, b = 0.01 }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("bill")
    (place / "c.toml").write_text(CONFIGURATION, encoding="utf-8")
    output_of("run", place / "c.toml", "--out", place / "o", "--quiet")
    return place


def test_what_relaxing_saves_lies_between_what_is_stated(folder: Path) -> None:
    table = pd.read_csv(folder / "o" / "requirements.csv").set_index("requirement")
    problem = read(folder / "c.toml").problem
    assert problem is not None
    form = closed_form(problem)
    assert form is not None
    limits = np.array([table.loc[name, "limit"] for name in form.outputs], dtype=float)
    least = float(least_cost(form, limits[None, :]).cost[0])
    assert pd.read_csv(folder / "o" / "front.csv")["cost"][0] == pytest.approx(least, rel=1e-9)
    for at, name in enumerate(form.outputs):
        moved = limits.copy()
        moved[at] *= 1.1
        saved = least - float(least_cost(form, moved[None, :]).cost[0])
        row = {key: table[key].to_dict()[name] for key in
               ("saves_at_least", "saves_at_most", "multiplier_cost_per_unit")}  # fmt: skip
        assert row["saves_at_least"] <= saved + 1e-9
        assert saved <= row["saves_at_most"] + 1e-9
        assert saved > 0.0
        step = limits.copy()
        step[at] *= 1.0 + 1e-6
        slope = (least - float(least_cost(form, step[None, :]).cost[0])) / (1e-6 * limits[at])
        assert row["multiplier_cost_per_unit"] == pytest.approx(slope, rel=1e-3)


def test_rows_that_only_bound_a_yield_say_nothing_of_savings(tmp_path: Path) -> None:
    """Twelve rows stood for one yield about a mean that moves: each by itself "saved" 0.004 of 0.4 at 10 % more."""
    part = {"unit": "mm", "nominal": 20.0, "t_min": 0.01, "t_max": 0.2}
    parts = [part | {"name": name, "sensitivity": s, "cost": {"model": "reciprocal", "a": 1.0, "b": b}, "shift": 0.3}
             for name, s, b in (("a", 1.0, 0.1), ("b", -1.0, 0.1), ("c", 1.0, 0.02))]  # fmt: skip
    stack: dict[str, Any] = {"problem": "stack", "objectives": {"minimise": ["cost"]},
             "limits": {"yield_percent": 99.0, "rss": 0.2}, "part": parts, "algorithm": {"name": "exact"},
             "requirement": {"unit": "mm", "lower": -0.1, "upper": 0.1, "nominal": 0.0}}  # fmt: skip
    result = run(stack).record
    assert len(result.front) == 1 and result.requirements is None
    del stack["requirement"]["lower"]  # one limit has one row
    table = run(stack).record.requirements
    assert table is not None and table["requirement"].is_unique


def test_parts_are_driven_by_their_requirements(folder: Path) -> None:
    drivers = pd.read_csv(folder / "o" / "drivers.csv").set_index("part")
    assert drivers.loc["b_t", "driven_by"] == "gap.variation"
    assert drivers.loc["c_t", "driven_by"] == "tilt.variation"
    shares = drivers[["gap.variation_percent", "tilt.variation_percent"]]
    np.testing.assert_allclose(shares.sum(axis=1), 100.0)


def test_the_page_shows_them_and_is_rebuilt_from_its_files(folder: Path) -> None:
    page = (folder / "o" / "report.html").read_text(encoding="utf-8")
    assert "<h2>Requirements</h2>" in page or ">Requirements<" in page
    assert 'title="saves_at_most"' in page
    output_of("report", folder / "o", "--out", folder / "again.html")
    assert ">Requirements<" in (folder / "again.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("algorithm", ["ga", "hybrid"])
def test_other_algorithms_take_them(algorithm: str, folder: Path, tmp_path: Path) -> None:
    settings = ["--set", f"algorithm.name={algorithm}", "--set", "algorithm.generations=60"]
    output_of("run", folder / "c.toml", "--out", tmp_path / "o", "--quiet", *settings)
    found = pd.read_csv(tmp_path / "o" / "front.csv").iloc[0]
    assert 0.0 <= found["gap_percent"] < (2.0 if algorithm == "ga" else 1e-4)


def test_limits_that_contradict_are_both_named_and_nothing_is_written(folder: Path, tmp_path: Path) -> None:
    settings = ["--set", "limits.cost=4.2"]
    result = tolevo("run", folder / "c.toml", "--out", tmp_path / "o", *settings)
    assert result.exit_code == 2
    assert "limits.cost: " in result.stderr and "limits.gap.variation: " in result.stderr
    assert "with the cost kept the least gap.variation is" in result.stderr
    assert not (tmp_path / "o").exists()


def test_a_yield_below_one_half_is_not_to_be_proven(folder: Path, tmp_path: Path) -> None:
    text = CONFIGURATION.replace('name = "gap"\n', 'name = "gap"\nnominal = 0.0\nupper = 0.1\n')
    (tmp_path / "c.toml").write_text(text, encoding="utf-8")
    settings = ["--set", "limits.gap.yield_percent=40"]
    result = tolevo("run", tmp_path / "c.toml", "--out", tmp_path / "o", *settings)
    assert result.exit_code == 2
    assert "limits.gap.yield_percent: asks for 40 % of the units" in result.stderr
    assert not (tmp_path / "o").exists()


def test_requirements_of_three_objectives_are_those_of_the_first_choice(folder: Path, tmp_path: Path) -> None:
    """A front of three objectives has no knee of two: the table is not that of its cheapest point."""
    text = CONFIGURATION.replace('["cost"]', '["cost", "gap.variation", "tilt.variation"]')
    text = text.replace('name = "exact"', 'name = "nsga3"\npopulation = 40\ngenerations = 12')
    (tmp_path / "c.toml").write_text(text, encoding="utf-8")
    output_of("run", tmp_path / "c.toml", "--out", tmp_path / "o", "--quiet")
    choice = pd.read_csv(tmp_path / "o" / "choices.csv").iloc[0]
    assert choice["point"] > 0
    table = pd.read_csv(tmp_path / "o" / "requirements.csv").set_index("requirement")
    for name in ("gap.variation", "tilt.variation"):
        assert table["limit"][name] == pytest.approx(choice[name], rel=1e-9)
