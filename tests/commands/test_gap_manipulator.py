"""A hidden effect in the record of a manipulator, by formulas of its own, is named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo import registry
from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.fit import Fit, Member
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.separations import separating
from tolevo.commands.gap.setup import Setup, prepare_setup
from tolevo.models.effects.effect import InsideSeveral

pytestmark = pytest.mark.usefixtures("unrendered")

Array = np.ndarray
Table = Mapping[str, Array]
OUTPUTS = ("dr_mm", "dt_mm", "dz_mm", "tilt_r_mrad", "tilt_t_mrad", "yaw_mrad")
ROWS = 300
GRAVITY = 9.80665


def poses(rng: np.random.Generator) -> Table:
    return {
        "r_mm": rng.uniform(480.0, 620.0, ROWS),
        "z_mm": rng.uniform(-120.0, 20.0, ROWS),
        "phi_deg": rng.uniform(0.0, 360.0, ROWS),
        "payload_kg": rng.uniform(0.0, 10.0, ROWS),
        "temperature_C": rng.uniform(18.0, 40.0, ROWS),
    }


def with_errors(table: Table, errors: Mapping[str, float]) -> Array:
    """Pose errors (6, n) of a machine that was built with elementary errors."""
    model = registry.load("models", "manipulator_pose")(parameters={"elementary_errors": errors})
    found = model.predict(table, np.random.default_rng(0))
    return np.stack([found[name] for name in OUTPUTS])


def per_mrad(table: Table, drive: int) -> Array:
    """Pose errors (6, n) per mrad of a drive."""
    return with_errors(table, {f"drive_zero_{drive}_mrad": 1.0})


def longer_arm(table: Table) -> Array:
    return with_errors(table, {"arm_length_1_um": 60.0, "arm_length_2_um": -40.0})


def tilted(table: Table) -> Array:
    """A rotation of the frame moves p by w x p."""
    phi = np.radians(table["phi_deg"])
    x, y = 0.4, -0.3
    along, across = x * np.cos(phi) + y * np.sin(phi), y * np.cos(phi) - x * np.sin(phi)
    r, z = table["r_mm"] * 1e-3, table["z_mm"] * 1e-3
    none = np.zeros(ROWS)
    return np.stack([across * z, -along * z, -across * r, along, across, none])


def grown(table: Table) -> Array:
    """Everything grows alike: the pose moves away from the origin, and turns by nothing."""
    share = 11.5e-6 * (table["temperature_C"] - 20.0)
    none = np.zeros(ROWS)
    return np.stack([share * table["r_mm"], none, share * table["z_mm"], none, none, none])


def sagging(table: Table) -> Array:
    """Each drive gives way by its compliance times the torque, -m g dz/dtheta."""
    weight = (table["payload_kg"] + 4.0) * GRAVITY
    found = np.zeros((6, ROWS))
    for drive, compliance in ((1, 0.01), (2, 0.013), (3, 0.02)):
        move = per_mrad(table, drive)
        found -= compliance * weight * move[2] * move
    return found


def eccentric(table: Table) -> Array:
    """Drive 3 is off once per turn of its arm, whose angle is that of a triangle of two bars."""
    machine = registry.load("models", "manipulator_pose")().machine
    x = table["r_mm"] * 1e-3 - machine.half_width
    y = table["z_mm"] * 1e-3 - machine.hinge_offset
    arm, rod = machine.arm_length[2], machine.rod_length[2]
    far = np.hypot(x, y)
    corner = np.arccos((far**2 + arm**2 - rod**2) / (2.0 * far * arm))
    angle = np.arctan2(y, x) + corner
    return np.asarray(0.8 * np.sin(angle - 0.5) * per_mrad(table, 3))


def readings(table: Table, hidden: Array, rng: np.random.Generator) -> Array:
    """Measurements (6, n) with noise as large as what is hidden, positions and rotations apart."""
    found = with_errors(table, {}) + hidden
    for part in (slice(0, 3), slice(3, 6)):
        size = np.sqrt(np.mean(hidden[part] ** 2))
        noise = size if size > 1e-6 else 0.05
        found[part] += noise * rng.normal(size=hidden[part].shape)
    return np.asarray(found)


CASES: dict[str, Callable[[Table], Array]] = {
    "arm_length_error": longer_arm,
    "base_tilt": tilted,
    "thermal_growth": grown,
    "gravity_sag": sagging,
    "drive_eccentricity": eccentric,
}


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    """A record whose poses reach to the edge of the workspace."""
    place, rng = tmp_path_factory.mktemp("edge"), np.random.default_rng(8)
    table = {**poses(rng), "r_mm": rng.uniform(310.0, 650.0, ROWS),
             "z_mm": rng.uniform(105.0, 295.0, ROWS)}  # fmt: skip
    measured = dict(zip(OUTPUTS, rng.normal(0.0, 0.02, (6, ROWS)), strict=True))
    pd.DataFrame({**table, **measured}).to_csv(place / "poses.csv", index=False)
    (place / "gap.toml").write_text('model = "manipulator_pose"\n[free]\n', encoding="utf-8")
    plan = read_gap(place / "gap.toml")
    return prepare_setup(plan, read_data(plan, place / "poses.csv"))


def test_columns_are_what_a_little_of_each_effect_does(setup: Setup) -> None:
    """Slopes times a factor per row, against the model with the effect in it."""
    seen = [one for one in setup.library if isinstance(one.effect, InsideSeveral)]
    assert len(seen) == 6
    for one in seen:
        shape = {"moving_mass_kg": 3.0} if one.shape else {}
        columns = setup.columns.of(one, shape)
        for at, parameter in enumerate(one.linear):
            done = setup.columns.total(one, {**shape, parameter.name: 1e-3}) / 1e-3
            size = np.abs(done).max()
            np.testing.assert_allclose(columns[:, at], done, atol=2e-4 * size, err_msg=one.name)


def test_the_measurement_that_separates_stays_in_reach(setup: Setup) -> None:
    """Poses further out than those of the record would be out of reach."""
    by_name = {one.name: one for one in setup.library}
    sized = {"arm_length_error": [50.0, -30.0, 20.0], "joint_zero_offset": [0.1, 0.1, 0.1]}
    mine, other = (
        Fit((Member(by_name[name]),), 0.0, 0.0, (np.array(sizes),), np.zeros(0), np.zeros(0))
        for name, sizes in sized.items()
    )
    found = separating(setup, np.full(6, 0.02), mine, other)
    assert found.readings >= 1
    for low, high in (found.inputs[name] for name in ("r_mm", "z_mm") if name in found.inputs):
        assert 100.0 < low < high < 650.0


@pytest.mark.long
@pytest.mark.parametrize("name", ["arm_length_error", "drive_eccentricity"])
def test_it_is_named(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(3)
    table = poses(rng)
    hidden = CASES[name](table)
    measured = readings(table, hidden, rng)
    frame = pd.DataFrame({**table, **dict(zip(OUTPUTS, measured, strict=True))})
    frame.to_csv(tmp_path / "poses.csv", index=False)
    (tmp_path / "gap.toml").write_text('model = "manipulator_pose"\n[free]\n', encoding="utf-8")
    plan = read_gap(tmp_path / "gap.toml")
    result = gap.analysis_result(plan, read_data(plan, tmp_path / "poses.csv"))
    rivals = {other for one in result.rivals for other in one.names}
    assert name in {*result.names, *rivals}
    assert len(result.names) == 1
