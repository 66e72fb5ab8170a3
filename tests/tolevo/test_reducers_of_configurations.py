"""`[reducers]`: by configuration, by a finished run, by a table; faults at their place."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pandas as pd
import pytest
import tomli_w
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.configuration.reader import read_table
from tolevo.errors import InputError
from tolevo.problems.robot_joint import RobotJoint

REDUCER = {
    "problem": "rv_backlash",
    "parameters": {"reading": "printed"},
    "variables": {"stagger_arcmin": {"value": 0.0}, "dr_rp_mm": {"value": -0.04},
                  "dr_p_mm": {"value": -0.07}},
    "objectives": {"minimise": ["cost", "backlash_rms_arcmin"]},
}  # fmt: skip
ROBOT = {"problem": "robot_joint", "parameters": {"flanks": "free"}}


def faults(table: dict[str, object], folder: Path = Path()) -> dict[str, str]:
    with pytest.raises(InputError) as caught:
        read_table({**ROBOT, **table}, [], (), folder)
    return {one.place: one.message for one in caught.value.faults}


def problem_of(table: dict[str, object], folder: Path = Path()) -> RobotJoint:
    found = read_table({**ROBOT, **table}, [], (), folder).problem
    assert isinstance(found, RobotJoint)
    return found


def test_file_beside_the_configuration(tmp_path: Path) -> None:
    (tmp_path / "gear.toml").write_text(tomli_w.dumps(REDUCER))
    problem = problem_of({"reducers": {"1": "gear.toml", "2": "gear.toml"}}, tmp_path)
    first, second = problem.definition.reducers
    assert first is second  # alike: its front is worked out once
    assert first.source == "gear.toml"


def test_resolved_configuration_holds_the_reducer_itself(tmp_path: Path) -> None:
    (tmp_path / "gear.toml").write_text(tomli_w.dumps(REDUCER))
    table = {**ROBOT, "reducers": {"1": "gear.toml", "2": "gear.toml"}}
    found = read_table(table, [], (), tmp_path)
    again = read_table(tomllib.loads(found.toml()), [])
    assert again.toml() == found.toml()
    assert tomllib.loads(found.toml())["reducers"]["1"]["problem"] == "rv_backlash"


def test_table_of_prices(tmp_path: Path) -> None:
    prices = pd.DataFrame({"rms_arcmin": [0.4, 0.6, 1.0], "cost": [12.0, 8.0, 6.0]})
    prices.to_csv(tmp_path / "prices.csv", index=False)
    inline = {"rms_arcmin": [0.4, 0.6, 1.0], "cost": [12.0, 8.0, 6.0]}
    problem = problem_of({"reducers": {"1": "prices.csv", "2": inline}}, tmp_path)
    costs = [float(one.cost(prices["rms_arcmin"].to_numpy()[1:2])[0])
             for one in problem.gears.nested]  # fmt: skip
    assert costs == pytest.approx([8.0, 8.0])
    assert problem.form() is None


def test_every_fault_at_its_place(tmp_path: Path) -> None:
    (tmp_path / "stack.toml").write_text('problem = "stack"')
    (tmp_path / "bad.toml").write_text(tomli_w.dumps({**REDUCER, "parameters": {"readign": "x"}}))
    found = faults(
        {"reducers": {"1": "stack.toml", "2": "bad.toml", "3": "gear.toml"},
         "grouping": {"origin_um": ["origin_1_x_um"]}}, tmp_path,
    )  # fmt: skip
    assert 'has the problem "stack", which is not a reducer' in found["reducers.1"]
    assert any("readign" in place for place in found)
    assert "is not a known key" in found["reducers.3"]
    assert "leaves out" in found["grouping"]


def test_reducers_that_are_not_there(tmp_path: Path) -> None:
    found = faults({"reducers": {"1": "none.toml"}}, tmp_path)
    assert "does not exist" in found["reducers.1"]
    assert "is missing" in found["reducers.2"]


def test_directory_of_no_finished_run(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    found = faults({"reducers": {"1": "run", "2": "run"}}, tmp_path)
    assert "holds no finished run of a reducer" in found["reducers.1"]


def test_unfinished_run(tmp_path: Path) -> None:
    place = tmp_path / "run"
    place.mkdir()
    (place / "config.toml").write_text(tomli_w.dumps(REDUCER))
    (place / "front.csv").write_text("cost\n1\n")
    (place / "unfinished.json").write_text("not the mark of a run")
    assert "reducers.1" in faults({"reducers": {"1": "run", "2": "run"}}, tmp_path)


def test_front_of_the_contact_as_points(tmp_path: Path) -> None:
    """A finished run of rv_reducer: rms over units and turn from its mean and deviation."""
    place = tmp_path / "run"
    place.mkdir()
    (place / "config.toml").write_text('problem = "rv_reducer"\n')
    front = pd.DataFrame({"cost": [20.0, 12.0, 9.0], "backlash_rms_arcmin_mean": [0.3, 0.4, 0.8],
                          "backlash_rms_arcmin_std": [0.0, 0.3, 0.6]})  # fmt: skip
    front.to_csv(place / "front.csv", index=False)
    problem = problem_of({"reducers": {"1": "run", "2": "run"}}, tmp_path)
    assert problem.definition.reducers[0].points[0] == pytest.approx((0.3, 0.5, 1.0))
    assert "nothing is proven" in " ".join(problem.warnings())
    text = faults({"reducers": {"1": "run", "2": "run"}, "parameters": {"nested": False}}, tmp_path)
    assert "nested = false needs reducers whose tolerances" in text["reducers"]


def test_configuration_of_the_contact_must_be_run_first() -> None:
    table = {"problem": "rv_reducer"}
    found = faults({"reducers": {"1": table, "2": REDUCER}})
    assert "run it, and name the directory" in found["reducers.1"]


def test_prices_that_make_no_sense() -> None:
    rising = {"rms_arcmin": [0.4, 0.6, 1.0], "cost": [6.0, 8.0, 12.0]}
    few = {"rms_arcmin": [0.4, -0.6], "cost": [6.0]}
    found = faults({"reducers": {"1": rising, "2": few}})
    assert "cost must fall" in found["reducers.1"]
    assert "at least three points" in found["reducers.2"]


def test_the_yaw_needs_the_follow_up_rod() -> None:
    found = faults({"parameters": {"follow_up": "fixed"}})
    assert "must be one of rod" in found["parameters.follow_up"]


def test_units_are_checked() -> None:
    found = faults({"parameters": {"payload_kg": "3 mm", "hysteresis_arcmin": -1.0}})
    assert set(found) == {"parameters.payload_kg", "parameters.hysteresis_arcmin"}


def test_command_line_says_all_and_writes_nothing(tmp_path: Path) -> None:
    table = {**ROBOT, "reducers": {"1": "none.toml", "2": 3}, "objectives": {"minimise": ["cots"]}}
    (tmp_path / "robot.toml").write_text(tomli_w.dumps(table))
    ended = CliRunner().invoke(app, ["run", str(tmp_path / "robot.toml"), "--out",
                                     str(tmp_path / "out")])  # fmt: skip
    assert ended.exit_code == 2
    assert "Traceback" not in ended.output
    for part in ("reducers.1", "reducers.2"):
        assert part in ended.output
    assert not (tmp_path / "out").exists()
