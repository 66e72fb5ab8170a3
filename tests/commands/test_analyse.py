"""`tolevo analyse`: figures of published stacks, closed forms, counts of units, files and faults."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm
from typer.testing import CliRunner

import tolevo
from tolevo.cli import app
from tolevo.problems.stack.analysis import CONTRIBUTION_COLUMNS, REQUIREMENT_COLUMNS

CLIP: dict[str, Any] = {
    "problem": "stack",
    "requirement": {
        "name": "clip gap",
        "unit": "mm",
        "formula": "housing - plate - spacer - cap",
        "lower": 0.10,
        "upper": 0.50,
    },
    "part": [
        {"name": "housing", "nominal": 20.2, "tolerance": 0.05},
        {"name": "plate", "nominal": 6.0, "tolerance": 0.10},
        {"name": "spacer", "nominal": 9.0, "tolerance": 0.12},
        {"name": "cap", "nominal": 5.0, "tolerance": 0.08},
    ],
}


def only(source: Any) -> dict[str, Any]:
    """The one row of the requirements."""
    rows = tolevo.analyse(source).requirements.to_dict("records")
    assert len(rows) == 1
    return {str(name): value for name, value in rows[0].items()}


def test_the_clip_has_the_ends_and_the_yield_of_its_closed_forms() -> None:
    row = only(CLIP)
    t = np.array([0.05, 0.10, 0.12, 0.08])
    sigma = np.sqrt(np.sum(t**2)) / 3.0
    assert row["nominal"] == pytest.approx(0.2, abs=1e-12)
    assert (row["worst_case_least"], row["worst_case_greatest"]) == pytest.approx((-0.15, 0.55), abs=1e-12)
    assert row["worst_case_kind"] == "corners"
    assert (row["rss_least"], row["rss_greatest"]) == pytest.approx((0.2 - 3.0 * sigma, 0.2 + 3.0 * sigma))
    assert row["std"] == pytest.approx(sigma)
    assert row["cp"] == pytest.approx(0.4 / (6.0 * sigma))
    assert row["cpk"] == pytest.approx(0.1 / (3.0 * sigma))
    expected = 100.0 * (norm.cdf(0.3 / sigma) - norm.cdf(-0.1 / sigma))
    assert row["yield_percent"] == pytest.approx(expected, abs=1e-8)
    assert row["ppm"] == pytest.approx(1e4 * (100.0 - expected), rel=1e-8)
    assert row["kept_worst_case"] is False or row["kept_worst_case"] == np.False_
    assert not row["kept_statistical"]


def test_contributions_of_a_linear_stack_are_the_shares_of_variance_and_of_the_worst_case() -> None:
    table = tolevo.analyse(CLIP).contributions.set_index("part")
    t = pd.Series({"housing": 0.05, "plate": 0.10, "spacer": 0.12, "cap": 0.08})
    assert table["sensitivity"].to_dict() == {"housing": 1.0, "plate": -1.0, "spacer": -1.0, "cap": -1.0}
    np.testing.assert_allclose(table["variance_percent"], 100.0 * t**2 / np.sum(t**2))
    np.testing.assert_allclose(table["worst_case_percent"], 100.0 * t / np.sum(t))


def gum(distribution: str, lower: float, upper: float) -> dict[str, Any]:
    """The additive model of JCGM 101:2008, 9.2: four quantities of standard uncertainty 1."""
    t = 3.0 if distribution == "normal" else float(np.sqrt(3.0))
    return {
        "problem": "stack",
        "requirement": {"unit": "mm", "formula": "x1 + x2 + x3 + x4", "lower": lower, "upper": upper},
        "part": [
            {"name": f"x{at}", "nominal": 0.0, "tolerance": t, "distribution": distribution} for at in range(1, 5)
        ],
    }


@pytest.mark.parametrize(("distribution", "end"), [("normal", 3.92), ("uniform", 3.88)])
def test_additive_model_of_gum_supplement_1(distribution: str, end: float) -> None:
    """JCGM 101:2008, tables 2 and 3: u(y) = 2.00 and 95 % between -3.92 and 3.92 of normal quantities,
    between -3.88 and 3.88 of rectangular ones (exact)."""
    row = only(gum(distribution, -end, end))
    assert row["std"] == pytest.approx(2.0, abs=1e-9)
    assert row["yield_percent"] == pytest.approx(95.0, abs=0.05)


def test_mass_calibration_of_gum_supplement_1() -> None:
    """JCGM 101:2008, table 8: 1.2340 mg, u = 0.0754 mg by Monte Carlo (0.0539 mg to first order), and 95 %
    between 1.0834 and 1.3825 mg."""
    row = only(
        {
            "problem": "stack",
            "propagation": {"samples": 262144},
            "requirement": {
                "unit": "",
                "formula": "(m + d) * (1 + (a - 1.2) * (1/w - 1/r)) - 100000",
                "lower": 1.0834,
                "upper": 1.3825,
                "method": "monte_carlo",
            },
            "part": [
                {"name": "m", "unit": "", "nominal": 100000.0, "tolerance": 0.15, "distribution": "normal"},
                {"name": "d", "unit": "", "nominal": 1.234, "tolerance": 0.06, "distribution": "normal"},
                {"name": "a", "unit": "", "nominal": 1.2, "tolerance": 0.1, "distribution": "uniform"},
                {"name": "w", "unit": "", "nominal": 8000.0, "tolerance": 1000.0, "distribution": "uniform"},
                {"name": "r", "unit": "", "nominal": 8000.0, "tolerance": 50.0, "distribution": "uniform"},
            ],
        }
    )
    assert row["mean"] == pytest.approx(1.2340, abs=5e-4)
    assert row["std"] == pytest.approx(0.0754, abs=2e-4)
    assert row["yield_percent"] == pytest.approx(95.0, abs=0.15)
    assert row["kept_worst_case"] == np.False_


def test_several_requirements_agree_with_a_count_of_units() -> None:
    parts = [
        {"name": "a", "nominal": 30.0, "tolerance": 0.2},
        {"name": "b", "nominal": 10.0, "tolerance": 0.1, "distribution": "uniform"},
        {"name": "c", "nominal": 5.0, "tolerance": 0.05, "shift": 0.3},
    ]
    source = {
        "problem": "stack",
        "requirement": [
            {"name": "product", "unit": "mm", "formula": "a * b / 100 + c", "lower": 7.95, "upper": 8.05},
            {"name": "sum", "unit": "mm", "formula": "a - b - 3*c", "lower": 4.8},
        ],
        "part": parts,
    }
    analysed = tolevo.analyse(source)
    table = analysed.requirements.set_index("requirement")
    rng, n = np.random.default_rng(3), 1_000_000
    a = 30.0 + 0.2 / 3.0 * rng.standard_normal(n)
    b = 10.0 + 0.1 * rng.uniform(-1.0, 1.0, n)
    c = 5.0 + 0.05 * (0.3 + rng.standard_normal(n) / 3.0)
    values = {"product": a * b / 100.0 + c, "sum": a - b - 3.0 * c}
    kept = {"product": np.abs(values["product"] - 8.0) <= 0.05, "sum": values["sum"] >= 4.8}
    for name, y in values.items():
        assert table.loc[name, "mean"] == pytest.approx(y.mean(), abs=5.0 * y.std() / np.sqrt(n))
        assert table.loc[name, "std"] == pytest.approx(y.std(), rel=4e-3)
        share = float(kept[name].mean())
        error = 100.0 * np.sqrt(share * (1.0 - share) / n)
        assert table.loc[name, "yield_percent"] == pytest.approx(100.0 * share, abs=5.0 * error + 0.02)
    together = float(np.mean(kept["product"] & kept["sum"]))
    assert analysed.summary["joint_yield_percent"] == pytest.approx(100.0 * together, abs=0.2)
    corners = [np.array([30.0, 10.0, 5.0]) + np.array(s) * [0.2, 0.1, 0.05] for s in product((-1, 1), repeat=3)]
    ends = [x[0] * x[1] / 100.0 + x[2] for x in corners]
    assert table.loc["product", "worst_case_least"] == pytest.approx(min(ends), abs=1e-12)
    assert table.loc["product", "worst_case_greatest"] == pytest.approx(max(ends), abs=1e-12)
    assert table["cp"].isna()["sum"]
    assert table.loc["sum", "cpk"] == pytest.approx(
        (values["sum"].mean() - 4.8) / (3.0 * values["sum"].std()), abs=5e-3
    )


def test_a_measured_mean_moves_the_units_and_not_the_limits_of_the_drawing() -> None:
    values = [0.02 + 0.01 * z for z in norm.ppf((np.arange(1, 31) - 0.5) / 30)]
    parts = [dict(part) for part in CLIP["part"]]
    parts[0] |= {"measured": {"values": [20.2 + value for value in values], "made_to": 0.05, "mean": "as_found"}}
    row = only(CLIP | {"part": parts})
    assert (row["worst_case_least"], row["worst_case_greatest"]) == pytest.approx((-0.15, 0.55), abs=1e-12)
    assert row["mean"] == pytest.approx(0.2 + np.mean(values), abs=1e-9)
    assert row["nominal"] == pytest.approx(0.2, abs=1e-12)


def test_parts_to_be_searched_are_analysed_at_their_loosest_and_it_is_said() -> None:
    cost = {"model": "reciprocal", "a": 1.0, "b": 0.1}
    parts = [{"name": "shaft", "nominal": 3.0, "t_min": 0.01, "t_max": 0.2, "cost": cost}]
    parts += [{"name": "ring", "nominal": 1.0, "tolerance": 0.05}]
    requirement = {"unit": "mm", "formula": "shaft - ring", "lower": 1.99, "upper": 2.01}
    limits = {"yield_percent": 99.9}  # not attainable: no reason to refuse an analysis
    found = tolevo.analyse({"problem": "stack", "requirement": requirement, "part": parts, "limits": limits})
    row = found.requirements.iloc[0]
    assert (row["worst_case_least"], row["worst_case_greatest"]) == pytest.approx((1.75, 2.25))
    assert any("loosest" in one["reason"] and "shaft" in one["name"] for one in found.summary["assumptions"])
    assert "loosest" in str(found)


def test_curvature_of_the_quick_model_is_that_of_the_formula() -> None:
    source = {
        "problem": "stack",
        "requirement": {"unit": "mm", "formula": "a * b + c**2", "lower": 0.0, "method": "monte_carlo"},
        "part": [{"name": name, "nominal": 2.0, "tolerance": 0.1} for name in "abc"],
    }
    curvature = np.array(tolevo.analyse(source).record.quick["requirements"][0]["curvature"])
    np.testing.assert_allclose(curvature, [[0, 1, 0], [1, 0, 0], [0, 0, 2]], atol=1e-6)


def write(folder: Path, source: dict[str, Any]) -> Path:
    import tomli_w

    path = folder / "clip.toml"
    path.write_text(tomli_w.dumps(source), encoding="utf-8")
    return path


def test_the_command_writes_the_files_and_a_report_builds_the_page_again(tmp_path: Path) -> None:
    path, out = write(tmp_path, CLIP), tmp_path / "o"
    done = CliRunner().invoke(app, ["analyse", str(path), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "clip gap, 0.1 to 0.5 mm: kept neither in the worst case nor by mean +- 3 sigma" in done.stdout
    assert tuple(pd.read_csv(out / "requirements.csv").columns) == REQUIREMENT_COLUMNS
    assert tuple(pd.read_csv(out / "contributions.csv").columns) == CONTRIBUTION_COLUMNS
    bars = pd.read_csv(out / "histograms.csv")
    assert bars["units_percent"].sum() == pytest.approx(100.0)
    assert json.loads((out / "summary.json").read_text())["command"] == "analyse"
    page = (out / "report.html").read_text(encoding="utf-8")
    again = CliRunner().invoke(app, ["report", str(out)])
    assert again.exit_code == 0, again.output
    assert (out / "report.html").read_text(encoding="utf-8") == page
    twice = CliRunner().invoke(app, ["analyse", str(path), "--out", str(out)])
    assert twice.exit_code == 2
    assert CliRunner().invoke(app, ["analyse", str(path), "--out", str(out), "--overwrite"]).exit_code == 0


def test_another_problem_is_refused_in_words_and_nothing_is_written(tmp_path: Path) -> None:
    out = tmp_path / "o"
    done = CliRunner().invoke(app, ["analyse", "configs/pose_accuracy.toml", "--out", str(out)])
    assert done.exit_code == 2
    assert 'takes problem = "stack"' in done.stderr
    assert not out.exists()


def test_every_fault_of_the_configuration_is_named(tmp_path: Path) -> None:
    wrong = {**CLIP, "part": [{"name": "housing", "nominal": 20.2, "tolerance": -0.05}, {"name": "plate"}]}
    done = CliRunner().invoke(app, ["analyse", str(write(tmp_path, wrong))])
    assert done.exit_code == 2
    for place in ("part[0].tolerance", "part[1]"):
        assert place in done.stderr


def test_a_run_shows_the_requirements_before_and_after(tmp_path: Path) -> None:
    cost = {"model": "reciprocal", "a": 1.0, "b": 0.1}
    parts = [
        {"name": "shaft", "nominal": 3.0, "t_min": 0.01, "t_max": 0.2, "tolerance": 0.3, "cost": cost},
        {"name": "ring", "nominal": 1.0, "t_min": 0.01, "t_max": 0.2, "cost": cost},
    ]
    requirement = {"unit": "mm", "formula": "shaft - ring", "lower": 1.9, "upper": 2.1}
    source = {"problem": "stack", "requirement": requirement, "part": parts, "objectives": {"minimise": ["cost"]}}
    run = tolevo.run(source | {"limits": {"yield_percent": 99.73}})
    table = run.record.analysis
    assert table is not None and run.allocation is not None
    assert table["tolerances"].tolist() == ["before: as drawn, else loosest", "chosen, rounded"]
    assert table["worst_case_greatest"].iloc[0] == pytest.approx(2.5)
    allocated = run.allocation.drop_duplicates("variable").set_index("variable")["rounded"].astype(float)
    assert table["worst_case_greatest"].iloc[1] == pytest.approx(2.0 + allocated.sum())
    assert bool(table["kept_statistical"].iloc[1])
    run.write(tmp_path / "o")
    assert "chosen, rounded" in (tmp_path / "o" / "report.html").read_text(encoding="utf-8")
