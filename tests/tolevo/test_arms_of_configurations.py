"""`serial_arm` as configurations write it: rows, cells, files of poses; faults at their place."""

from __future__ import annotations

import tomllib
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.configuration.reader import build_model, read_table
from tolevo.errors import InputError
from tolevo.models.costs import Reciprocal
from tolevo.models.serial_arm.arm import SerialArm
from tolevo.problems.serial_arm import SerialArmAllocation

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
pytestmark = pytest.mark.source_tree


@lru_cache(maxsize=4)
def table(name: str = "robot_arm.toml") -> dict[str, Any]:
    return tomllib.loads((CONFIGS / name).read_text())


def changed(**tables: Any) -> dict[str, Any]:
    """The configuration of the KR 5 arc with other tables; None takes one away."""
    found = deepcopy(table()) | tables
    return {name: one for name, one in found.items() if one is not None}


def rows(**of_joint: dict[str, Any]) -> list[dict[str, Any]]:
    """Its joints with keys of some changed, `joint_2 = {...}`; None takes one away."""
    found: list[dict[str, Any]] = deepcopy(table()["joint"])
    for name, more in of_joint.items():
        own = found[int(name.removeprefix("joint_")) - 1]
        own |= more
        for key in [key for key, value in own.items() if value is None]:
            del own[key]
    return found


def problem_of(given: dict[str, Any], folder: Path = CONFIGS) -> SerialArmAllocation:
    found = read_table(given, [], (), folder).problem
    assert isinstance(found, SerialArmAllocation)
    return found


def faults(given: dict[str, Any], folder: Path = CONFIGS) -> dict[str, str]:
    with pytest.raises(InputError) as caught:
        read_table(given, [], (), folder)
    return {one.place: one.message for one in caught.value.faults}


@pytest.mark.parametrize("name", ["robot_arm", "robot_arm_puma560", "robot_arm_ur5"])
def test_shipped_arms_are_read_and_resolved(name: str) -> None:
    found = read_table(table(f"{name}.toml"), [], (), CONFIGS)
    again = read_table(tomllib.loads(found.toml()), [])
    assert again.toml() == found.toml()
    assert "nominal_d_1_mm" not in found.toml()
    first, second = (one.problem for one in (found, again))
    assert isinstance(first, SerialArmAllocation) and isinstance(second, SerialArmAllocation)
    for place, other in zip(first.machine.columns, second.machine.columns, strict=True):
        assert place == other
    for key, square in first.machine.squares.items():
        np.testing.assert_array_equal(square, second.machine.squares[key])
    reducers = {id(one.reducer) for one in first.definition.drives}
    assert len(reducers) == 1  # alike: its front is worked out once


def test_model_of_the_problem_shares_the_chain() -> None:
    """`simulate` takes the same configuration: where the problem's arm is, its model is."""
    found = read_table(table(), [], (), CONFIGS)
    arm, problem = build_model(found), found.problem
    assert isinstance(arm, SerialArm) and isinstance(problem, SerialArmAllocation)
    angles = problem.machine.reached.angles
    columns = {f"joint_{at}_deg": np.degrees(angles[:, at - 1]) for at in range(1, 7)}
    at = arm.predict(columns, np.random.default_rng(0))
    places = problem.definition.cell.poses()[0]
    np.testing.assert_allclose([at["x_mm"], at["z_mm"]], 1e3 * places[:, [0, 2]].T, atol=1e-5)


def test_rows_of_a_model_may_hold_what_the_problem_reads() -> None:
    found = build_model(read_table({"model": "serial_arm", "joint": rows()}, []))
    assert isinstance(found, SerialArm)


def test_recalibrated_errors_are_those_of_the_nominal_chain() -> None:
    plain = problem_of(changed())
    moved = problem_of(changed(parameters={**table()["parameters"], "a_2_um": 5000.0}))
    assert moved.machine.chain.a[1] - plain.machine.chain.a[1] == pytest.approx(5e-3)


def test_errors_with_ranges_and_costs_of_their_own() -> None:
    own = {"low": 0.01, "high": 0.1, "cost": {"model": "reciprocal", "a": 1.0, "b": 0.03}}
    problem = problem_of(changed(joint=rows(joint_1={"zero_mrad": own})))
    assert problem.settings.variables["zero_1_mrad"].low == 0.01
    assert problem.settings.costs["zero_1_mrad"] == Reciprocal(1.0, 0.03)
    assert "beta_1_mrad" not in problem.names and "beta_2_mrad" in problem.names


@pytest.mark.parametrize("poses", ["iso_cube", "joints", "places", "turned"])
def test_poses(poses: str, tmp_path: Path) -> None:
    """The five of ISO 9283, and tables of angles or places: the same machine at the same poses."""
    cell = {**table()["cell"], "poses": "iso_cube"}
    iso = problem_of(changed(cell=cell)).machine
    assert len(iso.reached.angles) == 5
    tool = 1e3 * iso.frames.tool
    assert tool[1] == pytest.approx([1010.0, 160.0, 860.0], abs=1e-5)
    if poses == "iso_cube":
        return
    turn = np.tile([180.0, 0.0, 0.0], (5, 1))
    columns = {
        "joints": {f"joint_{at + 1}_deg": one for at, one in
                   enumerate(np.degrees(iso.reached.angles).T)},
        "places": dict(zip(("x [m]", "y [m]", "z [m]"), 1e-3 * tool.T, strict=True)),
        "turned": dict(zip(("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"),
                           np.hstack([tool, turn]).T, strict=True)),
    }[poses]  # fmt: skip
    pd.DataFrame(columns).to_csv(tmp_path / "cell.csv", index=False)
    joints = [row | {"reducer": {"run": table("robot_reducer.toml")}} for row in rows()]
    own = problem_of(changed(cell={"poses": "cell.csv"}, joint=joints), tmp_path).machine
    np.testing.assert_allclose(own.places.drives.move, iso.places.drives.move, atol=1e-9)


class TestBadInput:
    """Every fault at once, placed, with a remedy."""

    def test_tables(self) -> None:
        found = faults(changed(
            joint=rows(
                joint_1={"d_mm": "3 kg", "centre_of_mass_mm": None},
                joint_2={"mass_kg": None},
                joint_3={"mass_kg": "2 m", "zero_mrad": {"low": 0.3}},
                joint_4={"reducer": {"cost_factr": 2.0, "flank": "up"}, "a_mm": None},
                joint_5={"range_deg": [20, -20]},
            ),
            cell={"centre_mm": [850, 0], "side_mm": -1.0, "poses": "gird", "near_deg": [0]},
        ))  # fmt: skip
        assert {"joint[0].d_mm", "joint[0].centre_of_mass_mm", "joint[1].mass_kg",
                "joint[2].mass_kg", "joint[2].zero_mrad.low", "joint[3].reducer.cost_factr",
                "joint[3].reducer.flank", "joint[3].a_mm", "joint[4].range_deg", "cell.centre_mm",
                "cell.side_mm", "cell.poses", "cell.near_deg"} <= set(found)  # fmt: skip
        assert "a mass needs its centre" in found["joint[0].centre_of_mass_mm"]

    def test_table_that_is_no_chain(self) -> None:
        same = {"a_mm": 0.0, "alpha_deg": 0.0}
        assert "turn about one axis" in faults(changed(joint=rows(joint_5=same)))["joint[4]"]

    def test_reducers(self, tmp_path: Path) -> None:
        """A run of another problem, one that is not finished, a file that is not there."""
        (tmp_path / "other.toml").write_text('problem = "stack"')
        (tmp_path / "begun").mkdir()
        (tmp_path / "begun" / "config.toml").write_text('problem = "rv_backlash"')
        joints = rows(joint_1={"reducer": {"run": "other.toml"}},
                      joint_2={"reducer": {"run": "begun"}},
                      joint_3={"reducer": {"run": "gone.toml"}})  # fmt: skip
        for row in joints[3:]:
            row["reducer"] = "none"
        found = faults(changed(joint=joints), tmp_path)
        assert "which is not a reducer" in found["joint[0].reducer.run"]
        assert "joint[1].reducer.run" in found
        assert "does not exist" in found["joint[2].reducer.run"]

    def test_pose_out_of_reach_names_pose_and_joint(self) -> None:
        found = faults(changed(cell={"poses": [[850, 0, 700], [2500, 0, 700]]}))
        assert list(found) == ["cell.poses[1]"]
        message = found["cell.poses[1]"]
        assert "pose 2 (2500, 0, 700 mm) is out of reach by" in message
        assert "joint 3 is stretched" in message
        far = faults(changed(cell={**table()["cell"], "side_mm": 1600}))
        assert "more poses of 125 have such faults" in "".join(far.values())

    @pytest.mark.parametrize("joints", [1, 2, 3])
    def test_pose_off_the_plane_of_an_arm_is_no_matter_of_a_stretched_joint(self, joints: int) -> None:
        """Parallel vertical axes move the tool at a height of 0 only, 50 mm below the poses."""
        row = {"d_mm": 0, "a_mm": 300, "alpha_deg": 0, "range_deg": [-170, 170], "mass_kg": 9, "reducer": "none",
               "centre_of_mass_mm": [-80, 0, 0]}  # fmt: skip
        found = faults({"problem": "serial_arm", "joint": [dict(row) for _ in range(joints)],
                        "cell": {"poses": [[200 + 10 * joints, 100, 50]]}})  # fmt: skip
        message = found["cell.poses[0]"]
        assert "no joint moves the tool closer to it" in message
        assert "range_deg" not in message
        if joints > 1:
            assert "by 50 mm" in message

    def test_end_of_the_range_of_a_joint(self) -> None:
        found = faults(changed(joint=rows(joint_3={"range_deg": [-15, 158]})))
        assert all("joint 3 is at the end of its range (-15 deg)" in one
                   for one in found.values())  # fmt: skip

    def test_singular_pose(self) -> None:
        """The wrist stretched out: axes 4 and 6 are one line."""
        found = faults(changed(cell={"joints_deg": [[0, -84, 21, 0, 0, 0], [0, -84, 21, 0, 60, 0]]}))
        assert list(found) == ["cell.joints_deg[0]"]
        assert "joints 4 and 6 move the tool in the same direction" in found["cell.joints_deg[0]"]

    def test_no_masses(self) -> None:
        bare = rows(joint_4={"mass_kg": None, "centre_of_mass_mm": None})
        assert "gravity holds flanks by the masses" in faults(changed(joint=bare))[
            "joint[3].mass_kg"]  # fmt: skip
        problem_of(changed(joint=bare, parameters={"flanks": "free"}))

    def test_objective_that_calibration_removes(self) -> None:
        """Flanks held: what is left of reversal is nothing."""
        found = faults(changed(parameters={"flanks": "held", "calibrated": "position"},
                               objectives={"minimise": ["cost", "reversal_mm"]}))  # fmt: skip
        assert "residual" in found["objectives.minimise[1]"]

    def test_files_of_poses(self, tmp_path: Path) -> None:
        (tmp_path / "cell.csv").write_text("x_mm,y_mm\n1,2\n")
        joints = [row | {"reducer": "none"} for row in rows()]
        joints[0]["reducer"] = {"run": table("robot_reducer.toml")}
        found = faults(changed(cell={"poses": "cell.csv"}, joint=joints), tmp_path)
        assert "lacks z_mm" in found["cell.poses"]
        found = faults(changed(cell={"poses": "gone.csv"}, joint=joints), tmp_path)
        assert "cell.poses" in found

    def test_nothing_is_written(self, tmp_path: Path) -> None:
        words = ["run", CONFIGS / "robot_arm.toml", "--out", tmp_path / "run"]
        words += ["--set", "cell.side_mm=2000"]
        ended = CliRunner().invoke(app, [str(word) for word in words])
        assert ended.exit_code == 2
        assert "is out of reach" in ended.output
        assert not (tmp_path / "run").exists()
