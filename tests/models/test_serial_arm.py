"""The chain of a serial arm: against products of 4x4 matrices, scipy's rotations, and faults."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tolevo.configuration.reader import build_model, read_table
from tolevo.errors import InputError
from tolevo.models.serial_arm import arm as declared
from tolevo.models.serial_arm.arm import SerialArm
from tolevo.models.serial_arm.kinematics import Chain, positions, rotation

RNG = np.random.default_rng(5)
ROW = {"d_mm": 100.0, "a_mm": 200.0, "alpha_deg": 90.0}


def turn(axis: str, angle: float) -> np.ndarray:
    found = np.eye(4)
    found[:3, :3] = Rotation.from_euler(axis, angle).as_matrix()
    return found


def move(x: float, y: float, z: float) -> np.ndarray:
    found = np.eye(4)
    found[:3, 3] = x, y, z
    return found


def test_chain_is_the_product_of_its_matrices() -> None:
    """Denavit and Hartenberg's four, then Hayati's rotation about y, joint after joint."""
    zero, d, a, alpha, beta = RNG.normal(size=(5, 4))
    base, tool = RNG.normal(size=6), RNG.normal(size=3)
    chain = Chain(zero, d, a, alpha, beta, base, tool)
    angles = RNG.uniform(-3.0, 3.0, (3, 4))
    for row, found in zip(angles, positions(chain, angles), strict=True):
        whole = move(*base[:3])
        whole[:3, :3] = Rotation.from_rotvec(base[3:]).as_matrix()
        for at, theta in enumerate(row):
            whole = whole @ turn("z", theta + chain.zero[at]) @ move(0.0, 0.0, chain.d[at])
            whole = whole @ move(chain.a[at], 0.0, 0.0) @ turn("x", chain.alpha[at])
            whole = whole @ turn("y", chain.beta[at])
        np.testing.assert_allclose(found, (whole @ [*tool, 1.0])[:3], atol=1e-12)


def test_rotation_vector() -> None:
    vector = np.array([0.3, -1.1, 0.4])
    np.testing.assert_allclose(rotation(vector), Rotation.from_rotvec(vector).as_matrix(), atol=1e-14)
    np.testing.assert_array_equal(rotation(np.zeros(3)), np.eye(3))


def test_ur5_stretched_out() -> None:
    """All joints at 0: x = a2 + a3, y = -(d4 + d6), z = d1 - d5 (Universal Robots)."""
    table = {f"joint_{j}_deg": np.zeros(1) for j in range(1, 7)}
    found = SerialArm().predict(table, RNG)
    assert [float(found[n][0]) for n in ("x_mm", "y_mm", "z_mm")] == pytest.approx(
        [-425.0 - 392.25, -109.15 - 82.3, 89.159 - 94.65], abs=1e-9
    )


def test_every_free_parameter_moves_the_point_as_its_unit_says() -> None:
    """A zero of the base joint by its lever arm, a length by itself."""
    angles = RNG.uniform(-180.0, 180.0, (5, 6))
    table = {f"joint_{j}_deg": angles[:, j - 1] for j in range(1, 7)}

    def at(**parameters: float) -> np.ndarray:
        found = SerialArm(parameters).predict(table, RNG)
        return np.column_stack([found["x_mm"], found["y_mm"], found["z_mm"]])

    plain = at()
    for name, tolerance in declared.free_of({}).items():
        moved = np.linalg.norm(at(**{name: 1e-3 * tolerance}) - plain, axis=1)
        if name.endswith("_um"):
            np.testing.assert_allclose(moved, 1e-6 * tolerance, rtol=1e-6)
    lever = np.hypot(plain[:, 0], plain[:, 1])
    moved = np.linalg.norm(at(zero_1_mrad=0.01) - plain, axis=1)
    np.testing.assert_allclose(moved, 1e-5 * lever, rtol=1e-4)


def test_parallel_joints_are_freed_by_their_tilt() -> None:
    free = declared.free_of({})
    assert "beta_2_mrad" in free and "d_2_um" not in free
    assert "d_4_um" in free and "beta_4_mrad" not in free
    assert not [name for name in free if "_7_" in name]


def configured(*rows: Mapping[str, object], **more: object) -> SerialArm:
    table = {"model": "serial_arm", "joint": [dict(row) for row in rows], **more}
    found = build_model(read_table(table, []))
    assert isinstance(found, SerialArm)
    return found


def test_table_of_a_configuration() -> None:
    arm = configured(ROW, {**ROW, "a_mm": "0.1 m", "offset_deg": 90.0}, tool={"z_mm": 30.0})
    assert [one.name for one in arm.columns] == ["joint_1_deg", "joint_2_deg"]
    np.testing.assert_allclose(arm.chain.a, [0.2, 0.1])
    np.testing.assert_allclose(arm.chain.zero, [0.0, np.pi / 2.0])
    np.testing.assert_allclose(arm.chain.tool, [0.0, 0.0, 0.03])


def faults(*rows: Mapping[str, object], **more: object) -> dict[str, str]:
    with pytest.raises(InputError) as caught:
        read_table({"model": "serial_arm", "joint": [dict(row) for row in rows], **more}, [])
    return {one.place: one.message for one in caught.value.faults}


def test_a_table_that_is_no_chain_is_refused_with_every_fault() -> None:
    found = faults(
        {"d_mm": 1.0, "alpha_deg": 90.0}, {"d_mm": 5.0, "a_mm": 0.0, "alpha_deg": 180.0},
        {**ROW, "aplha_deg": 3.0, "d_mm": "3 kg"}, tool={"rx_deg": 1.0},
    )  # fmt: skip
    assert set(found) == {"joint[0].a_mm", "joint[1]", "joint[2].aplha_deg", "joint[2].d_mm",
                          "tool.rx_deg"}  # fmt: skip
    assert "joints 2 and 3 turn about one axis" in found["joint[1]"]
    nothing = {"d_mm": 0.0, "a_mm": 0.0, "alpha_deg": 90.0}
    assert faults(nothing, nothing) == {"joint": "is no chain: every a and d is 0"}
    assert "it has 0 rows" in faults()["joint"]
    assert "it has 10 rows" in faults(*[ROW] * 10)["joint"]


def test_the_shipped_configuration_is_the_default() -> None:
    path = Path(__file__).resolve().parents[1] / "data" / "ur5" / "ur5.toml"
    arm = build_model(read_table(tomllib.loads(path.read_text()), []))
    np.testing.assert_array_equal(arm.chain.d, SerialArm().chain.d)
    np.testing.assert_array_equal(arm.chain.alpha, SerialArm().chain.alpha)
