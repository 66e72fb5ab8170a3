"""`tolevo analyse`: figures of published stacks, closed forms, counts of units, files and faults."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize
from scipy.stats import norm
from typer.testing import CliRunner

import tolevo
from tests.small_jobs import output_of, written
from tolevo.cli import app
from tolevo.configuration.reader import read

_minimize: Any = minimize  # its stubs know arrays of one fixed dimension only

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

    path = written(folder / "clip.toml", tomli_w.dumps(source))
    return path


def test_the_command_writes_the_files_and_a_report_builds_the_page_again(tmp_path: Path) -> None:
    path, out = write(tmp_path, CLIP), tmp_path / "o"
    done = CliRunner().invoke(app, ["analyse", str(path), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "clip gap, 0.1 to 0.5 mm: kept neither in the worst case nor by mean +- 3 sigma" in done.stdout
    columns = (
        "requirement unit nominal mean std worst_case_least worst_case_greatest worst_case_kind rss_least rss_greatest"
    )
    columns += " lower upper cp cpk yield_percent ppm ppm_error kept_worst_case kept_statistical"
    assert list(pd.read_csv(out / "requirements.csv").columns) == columns.split()
    columns = "requirement part sensitivity variance_percent worst_case_percent"
    assert list(pd.read_csv(out / "contributions.csv").columns) == columns.split()
    bars = pd.read_csv(out / "histograms.csv")
    assert bars["units_percent"].sum() == pytest.approx(100.0)
    assert json.loads((out / "summary.json").read_text())["command"] == "analyse"
    page = (out / "report.html").read_text(encoding="utf-8")
    output_of("report", out)
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


def test_the_bearing_assembly_of_chase_and_greenwood() -> None:
    """Chase & Greenwood (1988), Manufacturing Review 1(1): shaft, bearings and retaining ring, in inches. Their
    clearance of 0.020 has a worst case of 0.0245 and a root sum square of 0.0111: sums of the tolerances by hand.
    """
    sizes = {"ring": (0.0505, 0.0015), "shaft": (8.0, 0.008), "inner": (0.5093, 0.0025), "spacer": (0.4, 0.002)}
    sizes |= {"housing": (7.711, 0.006), "cover": (0.4, 0.002), "outer": (0.5093, 0.0025)}
    row = only(
        {
            "problem": "stack",
            "requirement": {
                "unit": "in",
                "formula": "-ring + shaft - inner + spacer - housing + cover - outer",
                "lower": 0.005,
                "upper": 0.035,
            },
            "part": [{"name": name, "nominal": size, "tolerance": t} for name, (size, t) in sizes.items()],
        }
    )
    assert row["nominal"] == pytest.approx(0.0199, abs=1e-12)  # printed as 0.020
    assert 0.5 * (row["worst_case_greatest"] - row["worst_case_least"]) == pytest.approx(0.0245, abs=1e-12)
    assert 0.5 * (row["rss_greatest"] - row["rss_least"]) == pytest.approx(0.0111, abs=5e-5)


def test_the_bearing_seat_of_mitcalc() -> None:
    """The example of MITCalc's tolerance chains, as dimstack's tests print it: 0.4 mm, 0.017 to 0.783 mm in the worst
    case, a root sum square of 0.17825 mm; with the shaft's Cpk of 1.5 and limits of 0.05 and 0.8 mm a standard
    deviation of 0.05874 mm, Cp 2.12804 and Cpk 1.98617."""
    sizes = {
        "shaft": (208.0, "+0.036/-0.036"),
        "ring": (1.75, "0/-0.06"),
        "bearing": (23.0, "0/-0.12"),
        "sleeve": (20.0, "+0.026/-0.026"),
        "case": (200.0, "+0.145/-0.145"),
    }
    parts: list[dict[str, Any]] = [{"name": name, "nominal": x, "limits": zone} for name, (x, zone) in sizes.items()]
    for part in parts:
        part |= {"count": 2} if part["name"] in ("bearing", "sleeve") else {}
    formula = "shaft - ring - bearing_1 + sleeve_1 - case + sleeve_2 - bearing_2"
    chain = {"unit": "mm", "formula": formula, "lower": 0.05, "upper": 0.8}
    row = only({"problem": "stack", "requirement": chain, "part": parts})
    assert (row["nominal"], row["mean"]) == pytest.approx((0.25, 0.4), abs=1e-12)
    assert (row["worst_case_least"], row["worst_case_greatest"]) == pytest.approx((0.017, 0.783), abs=1e-12)
    assert 3.0 * row["std"] == pytest.approx(0.17825, abs=5e-6)
    parts[0]["cp"] = 1.5
    row = only({"problem": "stack", "requirement": chain, "part": parts})
    assert row["std"] == pytest.approx(0.05874, abs=5e-6)
    assert (row["cp"], row["cpk"]) == pytest.approx((2.12804, 1.98617), abs=5e-6)


def test_the_first_stackup_of_new_concept_z_designs() -> None:
    """ "My first stackup": 9.8480 inch, +-0.0200 in the worst case, 9.8358 to 9.8602 statistically."""
    parts = [("left", 0.3190, 0.005), ("width", 10.4860, 0.010), ("right", 0.3190, 0.005)]
    row = only(
        {
            "problem": "stack",
            "requirement": {"unit": "in", "formula": "width - left - right"},
            "part": [{"name": name, "nominal": size, "tolerance": t} for name, size, t in parts],
        }
    )
    assert row["nominal"] == pytest.approx(9.8480, abs=1e-12)
    assert (row["worst_case_least"], row["worst_case_greatest"]) == pytest.approx((9.8280, 9.8680), abs=1e-12)
    assert (row["rss_least"], row["rss_greatest"]) == pytest.approx((9.8358, 9.8602), abs=5e-5)


def test_the_three_part_assembly_of_cox() -> None:
    """Cox (1979), Tolerance Analysis by Computer, as soerp prints it: x y^2/(15 (1.5 + z)) at 24, 37 and 0.5 has the
    slopes 45.6333, 59.2 and -547.6, these second derivatives, and to second order the mean 1176.45."""
    parts = [("x", 24.0, 1.0), ("y", 37.0, 4.0), ("z", 0.5, 0.5)]  # with standard deviations
    source = {
        "problem": "stack",
        "requirement": {"unit": "", "formula": "x*y**2/(15*(1.5 + z))"},
        "part": [{"name": name, "unit": "", "nominal": size, "tolerance": s} for name, size, s in parts],
    }
    result = tolevo.analyse(source)
    slopes = result.contributions.set_index("part")["sensitivity"]
    assert slopes.to_dict() == pytest.approx({"x": 45.63333333333333, "y": 59.2, "z": -547.6}, rel=1e-9)
    (model,) = result.record.quick["requirements"]
    curvature = np.array(model["curvature"])
    printed = [[0.0, 2.466667, -22.816667], [2.466667, 1.6, -29.6], [-22.816667, -29.6, 547.6]]
    np.testing.assert_allclose(curvature, printed, atol=1e-4)
    variances = np.array([s**2 for *_, s in parts])
    mean = result.requirements["nominal"].iloc[0] + 0.5 * np.sum(np.diag(curvature) * variances)
    assert mean == pytest.approx(1176.45, abs=5e-3)


def test_the_orifice_meter_of_cox() -> None:
    """Cox (1979), as soerp prints it: 38.4 sqrt(520 h p/(m (t + 460))) has mean 1330.9997 and variance 58.2108."""
    quantities = [("h", 64.0, 0.5), ("p", 361.0, 2.0), ("m", 16.0, 0.1), ("t", 165.0, 0.5)]
    row = only(
        {
            "problem": "stack",
            "requirement": {"unit": "", "formula": "38.4*sqrt(520*h*p/(m*(t + 460)))"},
            "part": [{"name": name, "unit": "", "nominal": x, "tolerance": 3.0 * s} for name, x, s in quantities],
        }
    )
    assert row["mean"] == pytest.approx(1330.9997, abs=4.0 * np.sqrt(58.2108 / 65536))
    assert row["std"] == pytest.approx(np.sqrt(58.2108), rel=4.0 / np.sqrt(2.0 * 65536))


def test_preload_of_a_bearing_pair() -> None:
    """A spacer difference d presses two angular contact bearings together with F = k max(d, 0)^(3/2) (Hertz):
    the yield of a normal d is that of the differences at the limits, the worst case that of the corners.
    """
    k, t = 1.2, np.array([2.0, 2.0, 3.0])  # N/um^1.5, um
    row = only(
        {
            "problem": "stack",
            "propagation": {"samples": 2**20},
            "requirement": {
                "name": "preload",
                "unit": "N",
                "formula": "k * max(offset + outer - inner, 0)**1.5",
                "lower": 3.0,
                "upper": 20.0,
            },
            "part": [
                {"name": "k", "unit": "", "nominal": k, "tolerance": 0.0},
                {"name": "offset", "unit": "um", "nominal": 4.0, "tolerance": 2.0},
                {"name": "outer", "unit": "um", "nominal": 0.0, "tolerance": 2.0},
                {"name": "inner", "unit": "um", "nominal": 0.0, "tolerance": 3.0},
            ],
        }
    )
    sigma = np.linalg.norm(t) / 3.0
    at = [(limit / k) ** (2.0 / 3.0) for limit in (row["lower"], row["upper"])]
    expected = 100.0 * float(np.diff(norm.cdf((np.array(at) - 4.0) / sigma))[0])
    assert row["yield_percent"] == pytest.approx(expected, abs=4.0 * row["ppm_error"] / 1e4 + 1e-9)
    assert row["worst_case_least"] == 0.0
    assert row["worst_case_greatest"] == pytest.approx(k * 11.0**1.5, rel=1e-9)


def priced(**more: Any) -> dict[str, Any]:
    """Two requirements on three parts, one of which is made in two ways: the cheap one is stated first."""
    ways = [
        {"name": "turned", "t_min": 0.03, "t_max": 0.2, "cost": {"model": "reciprocal", "a": 0.5, "b": 0.06}},
        {"name": "ground", "t_min": 0.005, "t_max": 0.06, "cost": {"model": "reciprocal", "a": 2.0, "b": 0.02}},
    ]
    free = {"t_min": 0.005, "t_max": 0.2, "tolerance": 0.05}
    return {
        "problem": "stack",
        "requirement": [
            {"name": "gap", "unit": "mm", "formula": "a - b - c", "lower": 0.0, "upper": 0.2},
            {"name": "reach", "unit": "mm", "formula": "a + c", "lower": 27.8, "method": "worst_case"},
        ],
        "part": [
            {"name": "a", "nominal": 20.0, "cost": {"model": "reciprocal", "a": 1.0, "b": 0.1}, "drawn_as": "diameter"}
            | free,
            {"name": "b", "nominal": 12.0, "cost": {"model": "reciprocal", "a": 1.0, "b": 0.3}, "source": "guess"}
            | free,
            {"name": "c", "nominal": 7.9, "process": ways},
        ],
    } | more


def least(gap: float, reach: float) -> float:
    """Least cost at a root sum square of the gap and a worst case of the reach, by both ways, from three starts."""
    costs = []
    for a, b, low, high in ((0.5, 0.06, 0.03, 0.2), (2.0, 0.02, 0.005, 0.06)):
        rates, bounds = np.array([0.1, 0.3, b]), np.log([(0.005, 0.2), (0.005, 0.2), (low, high)])
        ends = [
            _minimize(
                lambda x, a=a, rates=rates: 2.0 + a + np.sum(rates / np.exp(x)),
                start,
                bounds=bounds,
                constraints=[
                    {"type": "ineq", "fun": lambda x: 1.0 - np.sum(np.exp(2.0 * x)) / gap**2},
                    {"type": "ineq", "fun": lambda x: 1.0 - (np.exp(x[0]) + np.exp(x[2])) / reach},
                ],
                method="SLSQP",
                options={"ftol": 1e-13, "maxiter": 500},
            )
            for start in (bounds.mean(axis=1), bounds @ [0.8, 0.2], bounds @ [0.65, 0.35])
        ]
        costs += [found.fun for found in ends if found.success]
    return float(min(costs))


def test_prices_and_budgets_of_a_sheet_are_least_costs() -> None:
    """By SLSQP for each way of making a part: 0.01 mm more of room and less, and every budget."""
    result = tolevo.analyse(priced())
    prices, budgets = result.record.prices, result.record.budgets
    assert prices is not None and budgets is not None
    whole = least(0.1, 0.1)
    moved = {"gap": (least(0.11, 0.1), least(0.09, 0.1)), "reach": (least(0.1, 0.11), least(0.1, 0.09))}
    for row in prices.to_dict("records"):
        wider, narrower = moved[row["requirement"]]
        assert row["step"] == 0.01
        assert row["wider_saves"] == pytest.approx(whole - wider, abs=1e-4)
        assert row["narrower_costs"] == pytest.approx(narrower - whole, abs=1e-4)
    for row in budgets.to_dict("records"):
        ratio = row["room_over_variation"]
        assert row["cost"] == pytest.approx(least(0.1 / ratio, 0.1 / ratio), rel=1e-5)
    assert np.all(np.diff(budgets["cost"].to_numpy()) > 0.0)


def test_single_steps_are_tried_against_every_requirement() -> None:
    """Both neighbours of each tolerance and the other process, whichever is stated first; what each breaks."""
    changes = tolevo.analyse(priced()).record.changes
    assert changes is not None
    assert set(changes["variable"]) == {"a_t", "b_t", "c_t", "c_process"}
    process = changes[changes["variable"] == "c_process"].iloc[0]
    assert process["to"] == "ground"  # as it stands, c is turned to 0.2 mm, which the other process holds to 0.06
    assert process["cost_change"] == pytest.approx(2.0 + 0.02 / 0.06 - 0.5 - 0.06 / 0.2)
    gap, reach = 0.1 / np.sqrt(2 * 0.05**2 + 0.06**2), 0.1 / (0.05 + 0.06)
    assert process["room_over_variation"] == pytest.approx(min(gap, reach))
    assert process["weakest"] == "reach"
    looser = changes[(changes["variable"] == "b_t") & (changes["value"] > 0.05)].iloc[0]
    assert "gap variation" in looser["breaks"]
    assert "reach" not in looser["breaks"]


def test_the_files_carry_the_source_and_what_to_write_on_the_drawing(tmp_path: Path) -> None:
    output_of("analyse", str(write(tmp_path, priced())), "--out", tmp_path / "o")
    table = pd.read_csv(tmp_path / "o" / "tolerances.csv").set_index("part")
    assert table["on_the_drawing"].to_dict() == {"a": "⌀20 ±0.05 mm", "b": "12 ±0.05 mm", "c": "7.9 ±0.2 mm"}
    assert table["source"]["b"] == "guess"
    assert {"prices.csv", "budgets.csv", "changes.csv"} <= {path.name for path in (tmp_path / "o").iterdir()}


def test_a_sheet_without_a_closed_form_says_where_prices_are() -> None:
    skewed = priced()
    skewed["requirement"] = skewed["requirement"][0] | {"method": "monte_carlo"}
    for part in skewed["part"]:
        part |= {"distribution": "skew_normal", "skew": 4}
    result = tolevo.analyse(skewed)
    assert result.record.prices is None
    assert any("see `tolevo run`" in note for note in result.summary["notes"])


@pytest.mark.parametrize("limits", [{}, {"lower": 9.0, "upper": 10.0}])
def test_a_sheet_without_limits_or_with_its_middle_beyond_them_has_no_costs(limits: dict[str, float]) -> None:
    requirement = {"unit": "mm", "formula": "a - b - c"} | limits
    result = tolevo.analyse(priced(requirement=requirement))
    assert result.record.prices is result.record.changes is None
    assert 'id="first"' not in result.page


def test_prices_of_a_condition_are_those_of_its_own_limits() -> None:
    """A gap of 8 mm between steel and aluminium, both +- 0.1 mm at 20 deg C: at 60 its room is less by what the
    lengths grow apart, 40 (20 a_steel - 12 a_aluminium), and 0.01 mm is worth the slope of b/t."""
    steel, aluminium = 11.5e-6, 23e-6
    cost = {"model": "reciprocal", "a": 1.0, "b": 0.1}
    source = {
        "problem": "stack",
        "requirement": {"name": "gap", "unit": "mm", "formula": "a - b", "lower": 7.9, "upper": 8.1},
        "part": [
            {"name": "a", "nominal": 20.0, "t_min": 0.01, "t_max": 0.2, "cost": cost, "expansion": steel},
            {"name": "b", "nominal": 12.0, "tolerance": 0.02, "expansion": aluminium},
        ],
        "condition": [{"name": "cold", "temperature_C": 20.0}, {"name": "warm", "temperature_C": 60.0}],
    }
    prices = tolevo.analyse(source).record.prices
    assert prices is not None
    room = 0.1 - abs(40.0 * (20.0 * steel - 12.0 * aluminium))
    t = np.sqrt(np.array([room, room - 0.01]) ** 2 - 0.02**2)
    (own,) = (row for row in prices.to_dict("records") if row["requirement"] == "warm")
    assert own["narrower_costs"] == pytest.approx(0.1 / t[1] - 0.1 / t[0], rel=1e-3)


def gap(formula: str, t: float, **limits: float) -> dict[str, Any]:
    """Parts a and b of 10 and 9 mm, both with the tolerance t."""
    parts = [{"name": name, "nominal": x, "tolerance": t} for name, x in (("a", 10.0), ("b", 9.0))]
    return {"problem": "stack", "requirement": {"unit": "mm", "formula": formula} | limits, "part": parts}


@pytest.mark.parametrize(
    ("formula", "limits", "percent"),
    [
        ("a - b", {"lower": 0.9, "upper": 1.2}, 100.0),
        ("a - b", {"lower": 1.0, "upper": 1.2}, 100.0),
        ("a - b", {"lower": 1.1, "upper": 1.2}, 0.0),
        ("0.11*a*(b - 7.9)", {"lower": 0.0, "upper": 1.21}, 100.0),  # rounded: 1.2100000000000002
        ("0.11*a*(b - 7.9)", {"lower": 0.0, "upper": 1.2}, 0.0),
    ],
)
def test_a_stack_without_tolerances_is_within_its_limits_or_beyond(
    formula: str, limits: dict[str, float], percent: float
) -> None:
    """Every unit has the nominal value, which may just be the limit; without scatter there is no Cp."""
    row = only(gap(formula, 0.0, **limits))
    assert row["yield_percent"] == percent and np.isnan([row["cp"], row["cpk"]]).all()
    assert row["kept_worst_case"] == row["kept_statistical"] == (percent == 100.0)
    source = gap(formula, 0.0, **limits)
    easy = {"name": "easy", "unit": "mm", "formula": "a + b", "upper": 30.0}
    source["requirement"] = [source["requirement"] | {"name": "hard"}, easy]
    both = tolevo.analyse(source)
    assert both.summary["joint_yield_percent"] == percent
    assert ("at the nominal values" in str(tolevo.check(source))) == (percent == 0.0)


def test_scatter_that_cancels_is_none(tmp_path: Path) -> None:
    """3 a - b where b follows a three times as far: what is left of the variance is its rounding."""
    source = gap("3*a - b", 0.1, lower=20.0)
    source["part"][1]["tolerance"] = 0.3
    source["correlation"] = [{"parts": ["a", "b"], "coefficient": 1.0}]
    row = only(source)
    assert row["std"] == 0.0 and np.isnan(row["cpk"]) and row["kept_statistical"]


def test_the_smaller_of_two_like_sizes_has_equal_shares_in_the_worst_case() -> None:
    """min(a, b + 1): tightening one part alone gains nothing, and each alone reaches the same end."""
    source = gap("min(a, b + 1)", 0.1, lower=9.9)
    result = tolevo.analyse(source)
    row = result.requirements.iloc[0]
    assert (row["worst_case_least"], row["worst_case_greatest"]) == pytest.approx((9.9, 10.1), abs=1e-12)
    assert row["mean"] == pytest.approx(10.0 - 0.1 / 3.0 / np.sqrt(np.pi), abs=2e-4)  # of two normal sizes
    assert result.contributions["worst_case_percent"].tolist() == pytest.approx([50.0, 50.0])


@pytest.mark.parametrize("nominal", [0.0, 10.0, 25_000.0])
def test_a_uniform_part_never_exceeds_limits_at_its_own_ends(nominal: float) -> None:
    """10.1 - 10 is not the 0.1 of the tolerance in its last digits; limits 1 % nearer are exceeded by 1 %."""
    part = {"name": "a", "nominal": nominal, "tolerance": 0.1, "distribution": "uniform"}
    requirement = {"unit": "mm", "formula": "a", "lower": nominal - 0.1, "upper": nominal + 0.1}
    row = only({"problem": "stack", "requirement": requirement, "part": [part]})
    assert row["ppm"] == 0.0
    assert row["ppm_error"] <= 1e-3
    nearer = requirement | {"lower": nominal - 0.099, "upper": nominal + 0.099}
    row = only({"problem": "stack", "requirement": nearer, "part": [part]})
    assert row["ppm"] == pytest.approx(10_000.0, abs=row["ppm_error"])


def test_worst_case_shares_of_a_design_do_not_depend_on_the_others() -> None:
    """min(a, b + 1) at (0.1, 0.1) alone and beside (0.1, 0.2), where the least of b alone decides."""
    source = gap("min(a, b + 1)", 0.1, lower=9.9)
    source["requirement"]["method"] = "worst_case"
    (measured,) = read(source).problem.measured  # type: ignore[union-attr]
    both = measured.shares(np.array([[0.1, 0.1], [0.1, 0.2]]))
    assert [shares.tolist() for shares in both.values()] == [pytest.approx(x) for x in ([50.0, 0.0], [50.0, 100.0])]


def test_the_terminal_has_at_most_ten_lines_before_the_table(tmp_path: Path) -> None:
    """Of thirteen requirements, twelve of which are not kept, how many are and the first that are not."""
    source = gap("a - b", 0.1)
    kept = {"name": "g0", "unit": "mm", "formula": "a - b", "lower": 0.5}
    source["requirement"] = [kept, *(kept | {"name": f"g{at}", "lower": 0.9 + 0.001 * at} for at in range(1, 13))]
    lines = output_of("analyse", str(write(tmp_path, source)), "--out", tmp_path / "o").splitlines()
    before = lines[: next(at for at, line in enumerate(lines) if "ppm outside" in line)]
    assert len(before) <= 10
    assert "1 of 13 requirements: kept in the worst case and by mean +- 3 sigma" in before
    assert before[-1] == "and 6 more that are not kept in at least one way"
    assert sum(line.startswith("g") for line in before) == 6
    for one in source["requirement"][5:]:
        del one["lower"]
    lines = output_of("analyse", str(write(tmp_path, source)), "--out", tmp_path / "p").splitlines()
    assert "1 of 5 requirements with limits: kept in the worst case and by mean +- 3 sigma; 8 have no limits" in lines


def test_a_worst_case_that_no_unit_reaches_is_called_a_bound() -> None:
    """A radius k of 0 to 0.05 mm: a - b + k lies between 0.05 and 0.3, and the worst case counts -0.05 as well."""
    sizes = {"a": 20.0, "b": 19.85, "k": 0.0}
    parts: list[dict[str, Any]] = [{"name": name, "nominal": at, "tolerance": 0.05} for name, at in sizes.items()]
    parts[2] |= {"geometry": "coaxiality", "distribution": "rayleigh"}
    for formula in ("a - b + k", "a*a/20 - b + k"):
        stack = {"problem": "stack", "requirement": {"name": "gap", "unit": "mm", "formula": formula}, "part": parts}
        found = tolevo.analyse(stack)
        row = found.requirements.iloc[0]
        assert row["worst_case_kind"] == "bound"
        assert row["worst_case_least"] < 0.05
        assert row["worst_case_greatest"] > 0.3 - 1e-12
        assert any("counts both sides of the zone of k" in note for note in found.summary["notes"])
        assert any("(bound)" in line for line in found.lines)


def test_a_feature_that_is_searched_is_assumed_at_its_loosest_zone() -> None:
    source = gap("a - b + square", 0.1, lower=0.5)
    cost = {"model": "reciprocal", "a": 1.0, "b": 0.05}
    feature = {
        "name": "square",
        "kind": "perpendicularity",
        "unit": "mm",
        "height": 10.0,
        "arm": 10.0,
        "t_min": 0.02,
        "t_max": 0.1,
        "cost": cost,
    }
    assumed = {
        one["name"]: one["value"] for one in tolevo.analyse(source | {"feature": [feature]}).summary["assumptions"]
    }
    assert "part.square.tolerance" not in assumed
    (drawn,) = (one for name, one in assumed.items() if name == "feature.square.zone")
    assert drawn == 0.2
