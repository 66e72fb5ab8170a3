"""The measurable model `manipulator_pose`, from configurations to tables."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import tolevo
from tolevo.cli import app
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.manipulator import pose as declared
from tolevo.models.manipulator.geometry import Manipulator, TaskRing
from tolevo.models.manipulator.maps import NAMES, first_order
from tolevo.models.manipulator.pose import ManipulatorPose
from tolevo.section import Array
from tolevo.units import MM

POSES = "r_mm,z_mm,phi_deg\n400,200,0\n500,150,30\n350,280,-170\n"
TABLE = {"r_mm": np.array([400.0, 500.0]), "z_mm": np.array([200.0, 150.0]), "phi_deg": np.array([0.0, 30.0])}


def configured(folder: Path, text: str) -> Path:
    path = folder / "pose.toml"
    path.write_text(f'model = "manipulator_pose"\n{text}')
    return path


def predicted(model: ManipulatorPose) -> dict[str, Array]:
    return model.predict(TABLE, np.random.default_rng(0))


def test_declared_defaults_are_those_of_the_records() -> None:
    assert declared.manipulator({}) == Manipulator()
    assert declared.task_ring({}) == TaskRing()


def test_a_machine_without_errors_reads_zero() -> None:
    for name, value in predicted(ManipulatorPose()).items():
        assert np.abs(value).max() < 1e-11, name


@pytest.mark.parametrize("follow_up", ["fixed", "rod"])
def test_small_errors_read_as_the_maps_say(follow_up: str) -> None:
    errors = {"arm_length_1_um": 0.5, "rod_length_3b_um": -0.2, "origin_2_x_um": 0.3}
    found = predicted(ManipulatorPose({"elementary_errors": errors, "follow_up": follow_up}))
    maps = first_order(
        declared.manipulator({"follow_up": follow_up}),
        TABLE["r_mm"] * MM,
        TABLE["z_mm"] * MM,
        np.radians(TABLE["phi_deg"]),
    )
    at = [NAMES.index(name) for name in errors]
    sizes = np.array(list(errors.values())) * 1e-6
    place, turn = maps.position[..., at] @ sizes, maps.orientation[..., at] @ sizes
    for i, axis in enumerate("rtz"):
        np.testing.assert_allclose(found[f"d{axis}_mm"] * MM, place[:, i], rtol=1e-3, atol=1e-13)
    for i, name in enumerate(("tilt_r_mrad", "tilt_t_mrad", "yaw_mrad")):
        np.testing.assert_allclose(found[name] * 1e-3, turn[:, i], rtol=1e-3, atol=1e-11)


def test_compensation_leaves_the_orientation() -> None:
    errors = {"rod_length_1a_um": 20.0, "arm_length_3_um": 50.0}
    plain = predicted(ManipulatorPose({"elementary_errors": errors}))
    left = predicted(ManipulatorPose({"elementary_errors": errors, "compensation": "position"}))
    assert np.abs(plain["dt_mm"]).min() > 1e-3
    for name in ("dr_mm", "dt_mm", "dz_mm"):
        assert not left[name].any()
    for name in ("tilt_r_mrad", "tilt_t_mrad"):
        np.testing.assert_allclose(left[name], plain[name], rtol=2e-3)
    turned = plain["yaw_mrad"] - 1e3 * plain["dt_mm"] / TABLE["r_mm"]
    np.testing.assert_allclose(left["yaw_mrad"], turned, rtol=2e-3)


def test_free_parameters_move_the_machine() -> None:
    for name, tolerance in ManipulatorPose.free.items():
        off = predicted(ManipulatorPose({name: tolerance}))
        largest = max(np.abs(value).max() for value in off.values())
        assert (largest > 1e-3) == (name != "elementary_errors.platform_attachment_3_t_um")


def test_simulate_from_a_configuration(tmp_path: Path) -> None:
    text = (
        "[parameters]\narm_length_mm = [390, 400.0, '26 cm']\nfollow_up = 'rod'\n"
        "[parameters.elementary_errors]\ndrive_zero_1_mrad = 0.2\nrod_length_2a = '0.01 mm'\n"
    )
    (tmp_path / "poses.csv").write_text(POSES)
    configuration = read(configured(tmp_path, text))
    found = tolevo.simulate(configuration, tmp_path / "poses.csv")
    notes = found.attrs["notes"]
    assert found.columns.tolist()[3:] == [output.name for output in ManipulatorPose.outputs]
    assert any("payload_kg" in note for note in notes)
    assert any("temperature_C" in note for note in notes)
    resolved = configuration.toml()
    again = tomllib.loads(resolved)["parameters"]
    assert again["arm_length_mm"] == [390.0, 400.0, 260.0]
    assert again["elementary_errors"] == {"drive_zero_1_mrad": 0.2, "rod_length_2a_um": 10.0}
    (tmp_path / "resolved.toml").write_text(resolved)
    reread = read(tmp_path / "resolved.toml")
    assert reread.toml() == resolved
    second = tolevo.simulate(reread, tmp_path / "poses.csv")
    pd.testing.assert_frame_equal(found, second)


def test_every_fault_of_lists_and_tables(tmp_path: Path) -> None:
    text = (
        "[parameters]\narm_length_mm = [400, 400]\nrod_length_mm = 480\n"
        "joint_distance_mm = [80, -1, 'x']\nring_r_mm = [300, true]\nfollow_up = 'rods'\n"
        "[parameters.elementary_errors]\narm_lenght_1_um = 3\nrod_length_1a_um = '3 kg'\n"
    )
    with pytest.raises(InputError) as caught:
        read(configured(tmp_path, text))
    said = str(caught.value)
    for part in (
        "parameters.arm_length_mm: must be a list of 3 numbers, got 2 of them",
        "parameters.rod_length_mm: must be a list of 3 numbers, got 480",
        "parameters.joint_distance_mm[1]: must lie in (0, 1000000], got -1",
        "parameters.joint_distance_mm[2]: must be a number or a string with a unit of mm",
        "parameters.ring_r_mm[1]: must be a number or a string with a unit of mm, got true",
        "parameters.elementary_errors.arm_lenght_1_um: is not a known key (did you mean `arm_length_1_um`?)",
        "parameters.elementary_errors.rod_length_1a_um: must be a number or a string",
        "parameters.follow_up: must be one of fixed, rod",
    ):
        assert part in said, part


def test_a_table_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="elementary_errors: must be a table, got 3"):
        read(configured(tmp_path, "[parameters]\nelementary_errors = 3\n"))


def test_ring_out_of_reach_is_refused() -> None:
    with pytest.raises(InputError, match=r"parameters\.ring_r_mm: the pose r = 900 mm, z = 300 mm"):
        ManipulatorPose({"ring_r_mm": (300.0, 900.0)})


def test_check_refuses_what_the_model_refuses(tmp_path: Path) -> None:
    path = configured(tmp_path, "[parameters]\nring_r_mm = [300, 900]\n")
    found = CliRunner().invoke(app, ["check", str(path)])
    assert found.exit_code == 2
    assert "parameters.ring_r_mm: the pose r = 900 mm" in found.output


def test_row_out_of_reach_is_named() -> None:
    far = TABLE | {"r_mm": np.array([400.0, 950.0])}
    with pytest.raises(InputError, match=r"pose 2 \(r = 950 mm, z = 150 mm\): is out of reach"):
        ManipulatorPose().predict(far, np.random.default_rng(0))
