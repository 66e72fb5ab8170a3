"""`rv_reducer` on other geometries than the RV-40E's: refused, warned of, and what is left over."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.configuration.configuration import Configuration
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.problems.rv_reducer import RvReducer

BASE = """problem = "rv_reducer"
[limits]
interference_probability = 0.05
[algorithm]
name = "exact"
"""
SHIPPED = ("rv20e_like", "rv80e_like", "cycloidal_stage")
PLAIN = ["parameters.involute_stage=false"]


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "c.toml"
    path.write_text(BASE, encoding="utf-8")
    return path


def problem_of(path: Path, overrides: Sequence[str] = ()) -> RvReducer:
    found: Configuration = read(path, overrides)
    assert isinstance(found.problem, RvReducer)
    return found.problem


def faults_of(path: Path, overrides: Sequence[str]) -> list[str]:
    with pytest.raises(InputError) as raised:
        read(path, overrides)
    return [str(fault) for fault in raised.value.faults]


# ---------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["parameters.pins=42"], "parameters.pins: must be 40, one more than the 39 teeth"),
        (["parameters.discs=3"], "parameters.discs: must divide the 40 pins, got 3"),
        (["parameters.pin_radius_mm=5.1"], "parameters.pin_radius_mm: neighbouring pins overlap"),
        (["parameters.eccentricity_mm=1.7"], "parameters.eccentricity_mm: e z_p/r_p = 1.062"),
        (["parameters.pin_radius_mm=4.8"], "undercut at a profile angle of 64.6 deg"),
        (["parameters.centre_distance_mm=60"], "parameters.centre_distance_mm: the cranks stand"),
        (["parameters.reduction_ratio=1"], "parameters.reduction_ratio: must be above 1"),
        ([*PLAIN, "parameters.reduction_ratio=121"], "it is the number of teeth of a disc, 39"),
        ([*PLAIN, "variables.involute_grade.low=4"], "variables.involute_grade: there is no"),
        (
            ["variables.dr_rp_mm.value=-0.05", "variables.dr_p_mm.value=-0.07"],
            "variables.dr_p_mm: the modified profile interferes with the pins",
        ),
        (["parameters.positions=0"], "parameters.positions: must lie in [1, 100003], got 0"),
        (["parameters.share_pins=1.5"], "parameters.share_pins: must lie in [0, 1], got 1.5"),
    ],
)
def test_faults_are_placed(config: Path, overrides: list[str], expected: str) -> None:
    assert any(expected in line for line in faults_of(config, overrides))


def test_faults_come_all_at_once(config: Path) -> None:
    """Teeth, discs, pins, k1 and an impossible limit; status 2 and no output."""
    overrides = ["pins=41", "pin_radius_mm=5.5", "eccentricity_mm=1.7", "reduction_ratio=0.5"]
    words = [word for one in overrides for word in ("--set", f"parameters.{one}")]
    out = config.parent / "out"
    words += ["--set", "limits.backlash_max_arcmin=0.01", "--out", str(out)]
    result = CliRunner().invoke(app, ["run", str(config), *words])
    places = [line.split(":")[0] for line in result.stderr.splitlines()]
    names = ["pins", "discs", "pin_radius_mm", "eccentricity_mm", "reduction_ratio"]
    assert result.exit_code == 2
    assert places == [*(f"parameters.{n}" for n in names), "limits.backlash_max_arcmin"]
    assert not out.exists()


def test_undercut_at_the_open_end_of_a_range(config: Path) -> None:
    """4.62 mm is cut only where dr_rp is above -0.03 mm: radius of curvature 4.59 mm."""
    pins = ["parameters.pin_radius_mm=4.62"]
    assert "undercut" in faults_of(config, pins)[0]
    assert problem_of(config, [*pins, "variables.dr_rp_mm.high=-0.04"]).faults() == []


# ---------------------------------------------------------------- warnings


@pytest.mark.parametrize(("positions", "better"), [(60, 61), (156, 151), (312, 317), (157, 163)])
def test_positions_that_do_not_spread(config: Path, positions: int, better: int) -> None:
    (line,) = problem_of(config, [f"parameters.positions={positions}"]).warnings()
    assert line.startswith(f"positions: {positions} positions ")
    assert f"use {better}" in line


@pytest.mark.parametrize("positions", [1, 61, 1021])
def test_positions_that_spread(config: Path, positions: int) -> None:
    assert problem_of(config, [f"parameters.positions={positions}"]).warnings() == ()


def test_radial_gap_without_a_limit(config: Path) -> None:
    (line,) = problem_of(config, ["limits.radial_gap_mm.min=0.005"]).warnings()
    assert line.startswith("no limit keeps radial_gap_mm at 0.007 mm or above")


def test_gears_that_do_not_fit(config: Path) -> None:
    """z2/z1 = 119/40 has no gears of whole teeth; 9 (1 + 2) = 27 mm is not 36 mm."""
    found = problem_of(config, ["parameters.reduction_ratio=118.3"]).warnings()
    assert any("no pair of gears has the ratio" in line for line in found)
    found = problem_of(config, ["parameters.reduction_ratio=81"]).warnings()
    assert any("stand at 27 mm" in line for line in found)


# ---------------------------------------------------------------- what is left over


def test_values_still_of_the_rv_40e(config: Path) -> None:
    """A value that is given counts as the user's own, also where it is the same."""
    given = ["parameters.eccentricity_mm=1.2", "parameters.centre_distance_mm=36"]
    given += ["parameters.shift_mid_um=1", "variables.bore_um.value=2"]
    (line,) = problem_of(config, given).warnings()
    head, _, left = line.partition("; still the RV-40E-121's: ")
    assert head == "eccentricity_mm changed"
    assert "centre_distance_mm" not in left
    for name in ("sun_pitch_radius_mm", "rated_torque_Nm", "runout_mid_um", "circle_offset_um"):
        assert name in left
    for group in ("all 8 gear deviations", "all 14 search ranges", "all 11 costs"):
        assert group in left
    assert "shift_mid_um" not in left
    assert "bore_um" not in left


def test_nothing_is_left_over_of_the_rv_40e_itself(config: Path) -> None:
    problem = problem_of(config, ["parameters.share_pins=0.5", "parameters.positions=31"])
    assert problem.warnings() == ()
    assert "document B" in problem.references()


# ---------------------------------------------------------------- without an involute stage


def test_plain_stage(config: Path) -> None:
    """No phi_1, the ratio of a disc's teeth, no grade to pay for; so it is read again."""
    problem = problem_of(config, PLAIN)
    assert problem.settings.parameters["reduction_ratio"] == 39.0
    assert problem.model.geometry.output_ratio == 1.0
    assert problem.model.involute(7.0).mean == 0.0
    assert problem.fixed["involute_grade"] == 7.0
    assert "involute_grade" not in problem.settings.costs
    assert problem.interval("backlash_max_arcmin")[0] == 0.0
    again = config.parent / "again.toml"
    again.write_text(read(config, PLAIN).toml(), encoding="utf-8")
    assert problem_of(again).settings.parameters == problem.settings.parameters


# ---------------------------------------------------------------- shipped configurations


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_configurations_find_units_that_conform(name: str) -> None:
    """Valid, one warning alone, and a start within the limits at 64 units and 31 positions."""
    path = Path(str(files("tolevo.configs") / f"{name}.toml"))
    quick = ["parameters.search_units=64", "parameters.search_positions=31"]
    problem = problem_of(path, quick)
    (line,) = problem_of(path).warnings()
    assert "still the RV-40E-121's" in line
    assert problem.references() == {}
    starts = problem.starts()
    found = problem.outputs_of(starts, searching=True)
    assert np.all(np.isfinite(found["backlash_max_arcmin"]))
    assert np.all(found["interference_probability"] <= 0.05)
    assert np.all(np.diff(found["backlash_max_arcmin"]) > 0.0)
    assert np.any(np.all(problem.violations(starts, found) <= 1e-9, axis=1))


# ---------------------------------------------------------------- what is said without an involute stage


def assumed(path: Path, overrides: Sequence[str] = ()) -> dict[str, str]:
    return {one.name: one.reason for one in problem_of(path, overrides).assumptions()}


def test_nothing_of_an_involute_stage_is_assumed_where_there_is_none(config: Path) -> None:
    of_the_stage = {"parameters.gear_runout_um", "parameters.planet_share", "parameters.involute_cosine",
                    "parameters.pressure_angle_deg", "variables.involute_grade.distribution"}  # fmt: skip
    overrides = ["parameters.discs=1", "parameters.eccentricity_mm=1.2"]
    with_stage, without = assumed(config, overrides), assumed(config, [*overrides, *PLAIN])
    assert of_the_stage <= with_stage.keys()
    left = of_the_stage | {name for name in with_stage if name.endswith("deviation_um")}
    assert not left & without.keys()
    assert {"parameters.centre_distance_mm", "parameters.discs"} <= without.keys()  # the circle of the cranks


def test_the_bound_names_the_grade_only_where_it_is_searched(config: Path) -> None:
    searched = ["variables.involute_grade.low=4", "variables.involute_grade.high=6"]
    for overrides, named in ((searched, True), (["variables.involute_grade.value=5"], False), (PLAIN, False)):
        assert ("the grade" in problem_of(config, overrides).cost_bound().statement) is named


def test_who_set_an_assumption_stands_under_a_heading_that_holds_for_both(config: Path) -> None:
    result = CliRunner().invoke(app, ["check", str(config), "--set", "parameters.discs=1"])
    assert result.exit_code == 0, result.output
    assert "parameters.discs = 1 (configuration)" in result.stdout
    assert "parameters.cranks = 2 (default)" in result.stdout
    assert "not stated" not in result.stdout


# ---------------------------------------------------------------- a modification that is fixed


def test_interval_of_a_modification_holds_every_design_of_its_ranges(config: Path) -> None:
    problem = problem_of(config, ["variables.dr_p_mm.low=-0.09", "variables.dr_p_mm.high=-0.01"])
    rng = np.random.default_rng(4)
    low, high = np.array([problem.interval(variable.name) for variable in problem.free]).T
    designs = problem.complete(rng.uniform(low, high, (500, len(problem.free))))
    values = problem.profile(designs)
    for name in ("radial_gap_mm", "modification_backlash_arcmin"):
        least, most = problem.interval(name)
        assert least <= values[name].min() < values[name].max() <= most
    assert problem.interval("radial_gap_mm") == pytest.approx((-0.07, 0.09))  # dr_rp - dr_p


def test_a_fixed_modification_is_judged_at_once(config: Path) -> None:
    fixed = ["variables.dr_rp_mm.value=-0.01"]
    (fault,) = faults_of(config, [*fixed, "variables.dr_p_mm.value=-0.035"])
    assert fault.startswith("limits.radial_gap_mm: at least 0.03 mm cannot be met")
    met = problem_of(config, [*fixed, "variables.dr_p_mm.value=-0.04"])
    assert met.interval("radial_gap_mm") == pytest.approx((0.03, 0.03))


@pytest.mark.slow
def test_a_limit_that_nothing_searched_moves_is_not_said_to_cost_an_unknown_amount(
    config: Path, tmp_path: Path
) -> None:
    """All but the clearance of the crank bearings is fixed, the radial gap at its limit of 0.03 mm."""
    values = {"pin_circle_radius_um": 2, "pin_position_um": 2, "pin_hole_radius_um": 2, "pin_radius_um": 1,
              "pitch_um": 5, "runout_um": 2, "eccentricity_um": 2, "equidistance_um": 1, "shift_um": 1,
              "involute_grade": 4, "stagger_arcmin": 0.0, "dr_rp_mm": -0.04, "dr_p_mm": -0.07}  # fmt: skip
    small = ["parameters.search_units=64", "parameters.report_units=64", "parameters.positions=31"]
    given = [*small, "objectives.minimise=['cost']", "limits.backlash_max_arcmin=1.3",
             *(f"variables.{name}.value={value}" for name, value in values.items())]  # fmt: skip
    overrides = [word for one in given for word in ("--set", one)]
    told = CliRunner().invoke(app, ["run", str(config), "--out", str(tmp_path / "r"), "--quiet", *overrides])
    assert told.exit_code == 0, told.output
    assert "1 tolerance searched" in told.stdout
    assert (
        "What is fixed meets the limit of radial gap at least 0.03 mm exactly: no allocation moves it." in told.stdout
    )
    assert "the limit of backlash max at most 1.3 arcmin binds" in told.stdout
    assert "is not known" not in told.stdout


# ---------------------------------------------------------------- what is stated and acts on nothing


def test_gear_deviations_without_an_involute_stage_are_faults(config: Path) -> None:
    stated = ["parameters.gear_runout_um=40", "parameters.planet_share=0.2", "parameters.helix_deviation_um=11"]
    assert faults_of(config, [*PLAIN, *stated]) == [  # the last is the default, as in a resolved configuration
        f"parameters.{name}: there is no involute stage (parameters.involute_stage = false): leave it out"
        for name in ("planet_share", "gear_runout_um")
    ]


def test_wear_without_hours_is_warned_of(config: Path) -> None:
    (warning,) = [text for text in problem_of(config, ["parameters.running_in_um=0.5"]).cautions() if "wears" in text]
    assert warning.startswith("running_in_um: nothing wears in 0 hours; state parameters.hours")
    worn = problem_of(config, ["parameters.running_in_um=0.5", "parameters.hours=100"])
    assert not any("wears" in text for text in worn.cautions())


def test_a_profile_that_interferes_is_one_fault(config: Path) -> None:
    """Its limits are broken for the same reason: raising them would not help."""
    (fault,) = faults_of(config, ["variables.dr_rp_mm.value=0.0", "variables.dr_p_mm.value=0.02"])
    assert fault.startswith("variables.dr_p_mm: the modified profile interferes with the pins by 20 um")


def test_a_reducer_of_which_nothing_is_searched_is_told_so(config: Path, tmp_path: Path) -> None:
    """The search for what limits can be kept ended in a traceback."""
    free = [v.name for v in problem_of(config).free]
    values = {name: 5 if name == "involute_grade" else 1.0 for name in free}
    values |= {"stagger_arcmin": 0.0, "dr_rp_mm": -0.04, "dr_p_mm": -0.07}
    given = ["objectives.minimise=['cost']", "limits.backlash_max_arcmin=3",
             *(f"variables.{name}.value={value}" for name, value in values.items())]  # fmt: skip
    overrides = [word for one in given for word in ("--set", one)]
    checked = CliRunner().invoke(app, ["check", str(config), *overrides])
    assert checked.exit_code == 0, checked.output
    ended = CliRunner().invoke(app, ["run", str(config), "--out", str(tmp_path / "r"), *overrides])
    assert ended.exit_code == 2
    assert "every variable is fixed: there is nothing to optimise; use `tolevo evaluate`" in ended.output
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize(("units", "told"), [(64, "84 %"), (500, "26 %"), (1_108, "5 %"), (1_109, "")])
def test_units_that_are_too_few_for_the_quantile_of_the_coverage_are_named(config: Path, units: int, told: str) -> None:
    cautions = problem_of(config, [f"parameters.report_units={units}"]).cautions()
    named = [text for text in cautions if text.startswith(f"parameters.report_units = {units}: ")]
    assert bool(named) == bool(told)
    if told:
        assert f"with a probability of {told} none of them lies beyond the quantile at 99.73 %" in named[0]
    # counted: samples of a uniform law, none of which lies beyond the quantile
    largest = np.random.default_rng(units).random((4_000, units)).max(axis=1)
    missed = float(np.mean(largest < 0.9973))
    assert missed == pytest.approx(float(told.rstrip(" %") or 5) / 100, abs=0.025)


def test_units_under_load_are_counted_where_a_limit_depends_on_them(config: Path) -> None:
    few = "parameters.elastic_units = 256: with a probability of 50 % none of them"
    assert not any(text.startswith(few) for text in problem_of(config).cautions())
    limited = problem_of(config, ["limits.lost_motion_arcmin=2"])
    assert any(text.startswith(few) for text in limited.cautions())
