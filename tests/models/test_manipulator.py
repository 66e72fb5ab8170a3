"""Section 5 of manipulator.md, row by row, and the same on other geometries.

The notes' figures were found there numerically; here the maps stand against central differences of
the exact pose, and the exact pose against closures written out once more below.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.optimize import root
from scipy.spatial.transform import Rotation
from scipy.stats import norm, qmc

from tests.models.unit_effects import unit_effects
from tolevo.models.manipulator.effects import KINDS, conditions, identifiable
from tolevo.models.manipulator.forward import NoPose, compensated, exact_pose, solve, split
from tolevo.models.manipulator.geometry import Manipulator, OutOfReach, TaskRing, angles, posture, reach
from tolevo.models.manipulator.maps import (
    NAMES,
    PER_CHAIN,
    SOURCES,
    error_vector,
    first_order,
    orientation_combinations,
    position_sources,
)
from tolevo.models.manipulator.pose import faults
from tolevo.models.manipulator.ring import grid, quadrature, sensitivity
from tolevo.section import Array
from tolevo.units import MM

RING = TaskRing()
M1 = Manipulator()
M2 = replace(M1, follow_up="rod")
MODELS = pytest.mark.parametrize("machine", [M1, M2], ids=["M1", "M2"])
OTHERS = [
    Manipulator(0.050, 0.060, 0.100, (0.38, 0.38, 0.30), (0.50, 0.50, 0.45), (0.06, 0.06, 0.12)),
    Manipulator(0.080, 0.020, 0.220, (0.45, 0.42, 0.31), (0.46, 0.50, 0.43), (0.09, 0.07, 0.05)),
    Manipulator(0.035, 0.090, -0.02, (0.42, 0.42, 0.28), (0.47, 0.47, 0.50), (0.15, 0.15, 0.04)),
]
SPREAD = np.array([5e-5 if source.unit == "um" else 1e-4 for source in SOURCES])
"""0.05 mm and 0.1 mrad, as the notes' linearisation error has them."""


def poses(count: int, seed: int = 0) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(seed)
    return rng.uniform(*RING.r, count), rng.uniform(*RING.z, count), rng.uniform(-3.0, 3.0, count)


def residuals(m: Manipulator, pose: tuple[float, float, float], e: Array, x: Array) -> Array:
    """Closures of one machine in base axes, with scipy's rotations: nothing of ours but angles.

    x: position (3), rotation vector (3), and the follow-up angle in model M2.
    """
    r, z, phi = pose
    theta = angles(m, np.array([r]), np.array([z]))[0] + [phi, phi, 0.0]
    psi = phi + (x[6] if len(x) > 6 else 0.0)
    p = [[0, m.half_length, 0], [0, -m.half_length, 0], [-m.half_width, 0, 0]]
    n_platform = [[0, 0, 1], [0, 0, 1], [0, 1, 0]]
    turn = Rotation.from_rotvec(x[3:6]) * Rotation.from_euler("z", phi)
    found, middle = [], np.zeros((2, 3))
    for i in range(3):
        d = e[21 * i : 21 * (i + 1)]
        zero = theta[i] + d[7]
        if i < 2:
            frame, line = Rotation.from_euler("z", zero), [0, 0, 1]
        else:  # the drive axis is -e_t
            across = Rotation.from_euler("x", np.pi / 2)
            frame = Rotation.from_euler("z", psi) * across * Rotation.from_euler("z", zero)
            line = [0, 0, -1]
        origin = np.array([0, 0, m.hinge_offset if i == 2 else 0.0]) + d[:3]
        for j, s in enumerate((0.5, -0.5)):
            on_arm = Rotation.from_rotvec(d[8:11]).apply(line) * s * (m.joint_distance[i] + d[11])
            lengthwise = np.array([m.arm_length[i] + d[3], 0.0, 0.0])
            arm = Rotation.from_rotvec(d[4:7]).apply(on_arm + lengthwise)
            a = origin + frame.apply(arm)
            on_b = Rotation.from_rotvec(d[17:20]).apply(n_platform[i]) * s
            b = x[:3] + turn.apply(p[i] + d[14:17] + on_b * (m.joint_distance[i] + d[20]))
            found.append(np.linalg.norm(b - a) - m.rod_length[i] - d[12 + j])
            middle += [a / 2, b / 2] if i == 2 else 0.0
    if len(x) > 6:
        found.append((middle[1] - middle[0]) @ [-np.sin(psi), np.cos(psi), 0])
    return np.array(found)


def base_to_local(v: Array, phi: float) -> Array:
    return np.asarray(Rotation.from_euler("z", -phi).apply(v))


@MODELS
@pytest.mark.parametrize("geometry", range(-1, len(OTHERS)))
def test_exact_pose_solves_the_closures_written_out(machine: Manipulator, geometry: int) -> None:
    m = machine if geometry < 0 else replace(OTHERS[geometry], follow_up=machine.follow_up)
    rng = np.random.default_rng(5)
    for r, z, phi in zip(*poses(4, seed=geometry + 2), strict=True):
        e = 10.0 * SPREAD * rng.normal(size=63)
        size = 7 if m.follow_up == "rod" else 6
        start = np.zeros(size)
        start[:3] = [r * np.cos(phi), r * np.sin(phi), z]
        other = root(partial(residuals, m, (r, z, phi), e), start, tol=1e-14).x
        ours = exact_pose(m, r, z, phi, e)
        moved = base_to_local(other[:3] - start[:3], phi)
        np.testing.assert_allclose(ours.position, moved, atol=1e-11)  # the other's finite slopes
        np.testing.assert_allclose(ours.orientation, base_to_local(other[3:6], phi), atol=1e-10)
        if size == 7:
            assert ours.follow_up == pytest.approx(other[6], abs=1e-10)


def test_closure_of_the_inverse() -> None:
    r, z, _ = poses(1000)
    chains = posture(M1, r, z)
    b = np.stack([r, 0.0 * r, z], axis=-1)[:, None] + chains.p
    lengths = np.linalg.norm(b - M1.origins - M1.arms[:, None] * chains.u, axis=-1)
    assert np.abs(lengths - M1.rods).max() < 1e-12 * MM


def test_elbows_of_the_nominal_machine() -> None:
    """Chains 1 and 2 mirror each other, elbows out; chain 3 bends up."""
    r, z, _ = poses(100)
    theta = angles(M1, r, z)
    np.testing.assert_array_equal(theta[:, 0], -theta[:, 1])
    assert (theta[:, 0] > np.arctan2(M1.half_length, r)).all()
    line = np.arctan2(z - M1.hinge_offset, r - M1.half_width)
    assert (theta[:, 2] > line).all()


@MODELS
def test_forward_then_inverse(machine: Manipulator) -> None:
    """From a start 5 mm off, Newton's method comes back to the pose whose angles were given."""
    r, z, _ = poses(200)
    theta = angles(machine, r, z)
    start = np.stack([r + 0.005, 0.0 * r + 0.004, z - 0.003], axis=-1)
    found = solve(machine, theta, start)
    x, y, up = (start + found.position).T
    again = angles(machine, np.hypot(x, y), up)
    assert np.abs(again - theta).max() < 1e-14
    assert np.abs(np.arctan2(y, x)).max() < 1e-14
    assert np.abs(found.orientation).max() < 1e-14


@MODELS
@pytest.mark.parametrize("geometry", range(-1, len(OTHERS)))
def test_all_63_columns_against_central_differences(machine: Manipulator, geometry: int) -> None:
    m = machine if geometry < 0 else replace(OTHERS[geometry], follow_up=machine.follow_up)
    r, z, phi = poses(20)
    h = 1e-6
    at = (r[:, None], z[:, None], phi[:, None])
    high, low = exact_pose(m, *at, h * np.eye(63)), exact_pose(m, *at, -h * np.eye(63))
    maps = first_order(m, r, z, phi)
    for ours, field in ((maps.orientation, "orientation"), (maps.position, "position")):
        slope = (getattr(high, field) - getattr(low, field)).swapaxes(1, 2) / (2.0 * h)
        size = np.linalg.norm(slope, axis=(0, 1))
        scale = np.where(size > 1e-6, size, 1.0)  # columns without effect: absolutely
        off = np.linalg.norm(ours - slope, axis=(0, 1)) / scale
        assert off.max() < 2e-6, NAMES[int(off.argmax())]
    slope = (high.follow_up - low.follow_up) / (2.0 * h)
    np.testing.assert_allclose(maps.follow_up, slope, atol=1e-7)


@MODELS
def test_newton_converges_quadratically(machine: Manipulator) -> None:
    """Errors of 0.1 mm and 0.1 mrad: steps of 1e-3, 1e-5, 1e-9 and one more at most."""
    errors = np.random.default_rng(0).normal(size=(500, 63)) * 1e-4
    found = exact_pose(machine, 0.5, 0.2, 0.0, errors)
    assert found.steps <= 4
    assert found.position.shape == (500, 3)


@MODELS
def test_batch_of_poses_and_machines_equals_one_by_one(machine: Manipulator) -> None:
    r, z, phi = poses(3)
    errors = np.random.default_rng(1).normal(size=(4, 63)) * SPREAD
    batch = exact_pose(machine, r[:, None], z[:, None], phi[:, None], errors)
    assert batch.position.shape == (3, 4, 3)
    for i, j in np.ndindex(3, 4):
        one = exact_pose(machine, r[i], z[i], phi[i], errors[j])
        np.testing.assert_allclose(batch.position[i, j], one.position, atol=1e-15)
        np.testing.assert_allclose(batch.orientation[i, j], one.orientation, atol=2e-14)


@MODELS
def test_linearisation_error(machine: Manipulator) -> None:
    """0.14 % of position, 0.18 % of orientation in the notes; both models lie about them."""
    points = qmc.Sobol(3 + len(NAMES), scramble=True, rng=np.random.default_rng(0)).random_base2(12)
    r, z = (low + (high - low) * points[:, at] for at, (low, high) in enumerate((RING.r, RING.z)))
    phi, errors = 2.0 * np.pi * points[:, 2], SPREAD * norm.ppf(np.clip(points[:, 3:], 1e-16, 1.0 - 1e-16))
    exact, maps = exact_pose(machine, r, z, phi, errors), first_order(machine, r, z, phi)
    for pose, by_maps, share in (
        (exact.position, maps.position, 0.0014),
        (exact.orientation, maps.orientation, 0.0018),
    ):
        off = pose - (by_maps @ errors[:, :, None])[..., 0]
        assert np.sqrt(np.sum(off**2) / np.sum(pose**2)) == pytest.approx(share, rel=0.12)


def test_63_sources_18_of_orientation_36_of_position() -> None:
    combinations, positions = orientation_combinations(), position_sources()
    assert len(set(NAMES)) == 63
    assert {"arm_length_1_um", "rod_length_1a_um", "rod_length_1b_um"} < set(NAMES)
    assert len(combinations) == 18
    assert len(positions) == 36
    r, z = grid(RING, 5)
    maps, through = first_order(M1, r, z), split(M1, r, z).through_orientation
    column = {name: maps.orientation[..., i] for i, name in enumerate(NAMES)}
    turning = {name for name, effect in column.items() if np.abs(effect).max() > 1e-12}
    span = {name for weights in combinations.values() for name in weights}
    alike = {f"arm_orientation_{i}_{axis}_mrad" for i in (1, 2, 3) for axis in "uv"}
    alike |= {f"joint_distance_arm_{i}_um" for i in (1, 2)}
    assert turning == (span | alike) - {"joint_distance_platform_3_um"}
    for name in alike:  # these act as one of the 18
        other = name.replace("distance_arm", "distance_platform")
        other = other.replace("arm_orientation", "joint_line_arm")
        sign = -1.0 if "distance" in name else 1.0
        np.testing.assert_allclose(column[name], sign * column[other], rtol=1e-14)
    moving = np.abs(maps.position - through).max(axis=(0, 1)) > 1e-12
    same = {f"drive_zero_{i}_mrad" for i in (1, 2, 3)}
    idle = {f"arm_orientation_{i}_u_mrad" for i in (1, 2, 3)}  # about the arm itself
    # chain 3 lies in the plane: nothing tangential (at phi = 0) lengthens its rods
    idle |= {"origin_3_y_um", "arm_orientation_3_v_mrad", "platform_attachment_3_t_um"}
    found = {name for name, moves in zip(NAMES, moving, strict=True) if moves}
    assert found == (set(positions) | same) - idle


def test_rank_17_of_18() -> None:
    r, z = grid(RING, 6)
    found = identifiable(M1, r, z, 0.0, "orientation", orientation_combinations())
    assert found.rank == 17
    assert found.singular[16] > 1e6 * found.singular[17]
    hidden = dict(zip(found.names, np.abs(found.hidden[0]), strict=True))
    assert hidden["joint_distance_3"] == pytest.approx(1.0, rel=1e-12)
    assert identifiable(M1, r, z, 0.0, "orientation").rank == 17  # of all 63


@MODELS
def test_hidden_combinations_do_not_move_the_machine(machine: Manipulator) -> None:
    """40 (M1) and 41 (M2) of 63; along the others the exact pose stays to second order."""
    rng = np.random.default_rng(3)
    r, z = grid(RING, 6)
    found = identifiable(machine, r, z, rng.uniform(-3.0, 3.0, len(r)))
    assert found.rank == (41 if machine is M2 else 40)
    units = np.array([source.scale for source in SOURCES])
    for weights in (found.hidden, found.combinations[:1]):
        direction = 0.03 * rng.normal(size=len(weights)) @ weights * units
        off = exact_pose(machine, *poses(10), direction)
        size = max(np.abs(off.position).max(), np.abs(off.orientation).max())
        assert (size < 1e-8) == (weights is found.hidden), size


def test_chain_3_leaves_the_squareness() -> None:
    r, z, phi = poses(50)
    column = first_order(M1, r, z, phi).orientation[:, :2, 2 * PER_CHAIN :]
    assert np.abs(column).max() < 1e-15


@MODELS
def test_relative_joint_distance_of_chain_3_has_no_effect(machine: Manipulator) -> None:
    """None at first order, and none at all on the exact orientation: the rods stay equal."""
    r, z, phi = poses(10)
    effects = unit_effects(machine, r, z)
    assert np.abs(effects.orientation["joint_distance_3"]).max() < 1e-15
    assert np.abs(effects.position["joint_distance_3"]).max() < 1e-15
    errors = error_vector({"joint_distance_platform_3_um": 500.0, "joint_distance_arm_3_um": -300})
    assert np.abs(exact_pose(machine, r, z, phi, errors).orientation).max() < 1e-14


def test_closed_forms_of_the_relative_rod_length() -> None:
    r, z, _ = poses(50)
    chains = posture(M1, r, z)
    effects = unit_effects(M1, r, z).orientation
    lean = np.arcsin(chains.w[:, 0, 2])
    plan = np.arctan2(chains.w[:, :2, 1], chains.w[:, :2, 0])
    expected = 1.0 / (M1.joint_distance[0] * np.cos(lean) * np.sin(plan[:, 1] - plan[:, 0]))
    squareness = np.hypot(effects["rod_length_1"][:, 0, 0], effects["rod_length_1"][:, 1, 0])
    np.testing.assert_allclose(squareness, np.abs(expected), rtol=1e-12)
    yaw = 1.0 / (M1.joint_distance[2] * np.cos(np.arcsin(chains.w[:, 2, 2])))
    np.testing.assert_allclose(np.abs(effects["rod_length_3"][:, 2, 0]), yaw, rtol=1e-12)


@MODELS
def test_same_in_all_directions_but_for_base_fixed_sources(machine: Manipulator) -> None:
    phi = np.linspace(0.0, 6.0, 13)
    maps = first_order(machine, np.full(13, 0.42), np.full(13, 0.17), phi)
    fixed = np.array([name.startswith("origin_") for name in NAMES])
    spread = np.ptp(np.concatenate([maps.orientation, maps.position], axis=1), axis=0).max(axis=0)
    assert spread[~fixed].max() == 0.0
    sideways = np.array([name.startswith("origin_") and "z" not in name for name in NAMES])
    assert (spread[sideways & (np.arange(63) < 42)] > 0.1).all()


def test_yaw_of_m1_is_that_of_m2_in_the_follow_up_plane() -> None:
    r, z, phi = poses(50)
    one, two = first_order(M1, r, z, phi), first_order(M2, r, z, phi)
    np.testing.assert_allclose(two.orientation[:, 2] - two.follow_up, one.orientation[:, 2], rtol=1e-14, atol=1e-14)
    np.testing.assert_array_equal(two.orientation[:, :2], one.orientation[:, :2])


def test_six_rods_with_a_free_follow_up_plane_leave_one_motion() -> None:
    """Rank 6 of 7; the follow-up rod takes the motion away."""
    r, z, phi = 0.5, 0.2, 0.4
    x = np.array([r * np.cos(phi), r * np.sin(phi), z, 0.0, 0.0, 0.0, 0.0])
    h = 1e-6 * np.eye(7)
    slopes = np.stack(
        [
            (residuals(M2, (r, z, phi), np.zeros(63), x + step)
             - residuals(M2, (r, z, phi), np.zeros(63), x - step)) / 2e-6
            for step in h
        ],
        axis=1,
    )  # fmt: skip
    assert np.linalg.matrix_rank(slopes[:6], tol=1e-6) == 6
    assert np.linalg.svd(slopes)[1].min() > 1e-3
    assert slopes[:6].shape == (6, 7)


def test_condition_numbers_of_the_ring() -> None:
    """The notes' 2.85 and 2.57 are of a grid that leaves out the worst corner: 2.896, 2.576."""
    position, orientation = conditions(M1, *grid(RING))
    assert position.max() == pytest.approx(2.85, rel=0.02)
    assert orientation.max() == pytest.approx(2.57, rel=0.005)


@pytest.mark.parametrize(
    ("index", "squareness", "yaw"), [("plane", 1.4345e-2, 5.095e-3), ("volume", 1.4389e-2, 5.037e-3)]
)
def test_indices_of_the_notes(index: str, squareness: float, yaw: float) -> None:
    found = sensitivity(M1, RING, index, orientation_combinations())  # type: ignore[arg-type]
    at = {name: i for i, name in enumerate(found.names)}
    half = 0.6e-4  # of the last digit printed, relative
    assert found.squareness[at["rod_length_1"]] * MM == pytest.approx(squareness, rel=half)
    assert found.yaw[at["rod_length_1"]] * MM == pytest.approx(yaw, rel=1e-4)
    if index == "plane":
        assert found.yaw[at["rod_length_3"]] * MM == pytest.approx(1.1383e-2, rel=half)
    assert found.squareness[at["rod_length_2"]] == pytest.approx(found.squareness[at["rod_length_1"]], rel=1e-12)


@pytest.mark.parametrize("geometry", range(-1, len(OTHERS)))
def test_indices_against_a_ten_times_finer_sum(geometry: int) -> None:
    """Midpoint sums, not Gauss-Legendre, over 480 x 480 poses; 0.5 % promised, for every index."""
    m = M1 if geometry < 0 else OTHERS[geometry]
    indices = ("plane", "volume", "rms_plane", "rms_volume")
    count, sums = 480, {index: np.zeros((3, 63)) for index in indices}
    weights = dict.fromkeys(indices, 0.0)
    x = (np.arange(count) + 0.5) / count
    for r in RING.r[0] + (RING.r[1] - RING.r[0]) * x.reshape(8, -1):
        at = [one.ravel() for one in np.meshgrid(r, RING.z[0] + (RING.z[1] - RING.z[0]) * x)]
        maps = first_order(m, *at)
        tilt = np.hypot(maps.orientation[:, 0], maps.orientation[:, 1])
        yaw, place = np.abs(maps.orientation[:, 2]), np.linalg.norm(maps.position, axis=1)
        size = np.stack([tilt, yaw, place])
        for index in indices:
            weight = at[0] if index.endswith("volume") else np.ones_like(at[0])
            power = size**2 if index.startswith("rms") else size
            sums[index] += np.einsum("n,kns->ks", weight, power)
            weights[index] += weight.sum()
    for index in indices:
        found = sensitivity(m, RING, index)  # type: ignore[arg-type]
        assert found.error <= 1e-3 or found.order > 96
        expected = (sums[index] / weights[index]) ** (0.5 if index.startswith("rms") else 1.0)
        ours = np.stack([found.squareness, found.yaw, found.position])
        np.testing.assert_allclose(ours, expected, rtol=0.005, atol=1e-12, err_msg=index)


def test_contributions_add_up() -> None:
    found = sensitivity(M1, RING, "rms_plane", orientation_combinations())
    shares = found.contributions("yaw", np.where(np.arange(18) == 12, 2e-5, 1e-5))
    assert shares.sum() == pytest.approx(100.0)
    names = dict(zip(found.names, shares, strict=True))
    assert names["joint_distance_3"] == 0.0
    ratio = (2.0 * found.yaw[12] / found.yaw[0]) ** 2
    assert names["rod_length_3"] / names["rod_length_1"] == pytest.approx(ratio)


def test_unit_effects_are_the_maps_of_the_kinds() -> None:
    r, z, _ = poses(5)
    effects, maps = unit_effects(M1, r, z), first_order(M1, r, z)
    assert set(effects.orientation) == set(KINDS) == set(effects.position)
    assert [effects.orientation[k].shape[2] for k in KINDS] == [1] * 6 + [4] * 3
    at = {name: i for i, name in enumerate(NAMES)}
    a, b = maps.orientation[..., at["rod_length_2a_um"]], at["rod_length_2b_um"]
    difference = 0.5 * (a - maps.orientation[..., b])
    np.testing.assert_allclose(effects.orientation["rod_length_2"][..., 0], difference, rtol=1e-15)
    line = effects.orientation["joint_line_3"]
    for i, name in enumerate(("arm_3_u", "arm_3_v", "platform_3_r", "platform_3_z")):
        own = maps.orientation[..., at[f"joint_line_{name}_mrad"]]
        np.testing.assert_array_equal(line[..., i], own)
    third = maps.orientation[..., at["joint_line_platform_3_t_mrad"]]
    assert np.abs(third).max() < 1e-15  # about itself a joint line does nothing
    through = split(M1, r, z).through_orientation
    np.testing.assert_allclose(
        effects.position["joint_distance_1"][..., 0], through[..., at["joint_distance_platform_1_um"]], atol=1e-12
    )


def test_quadrature_of_means() -> None:
    """Means of z and of r by the plane and by the ring's volume, by hand."""
    (low, high), (bottom, top) = RING.r, RING.z
    for index, mean in (
        ("rms_plane", (low + high) / 2.0),
        ("volume", 2.0 / 3.0 * (high**3 - low**3) / (high**2 - low**2)),
    ):
        r, z, weight = quadrature(RING, index, 6)  # type: ignore[arg-type]
        assert weight.sum() == pytest.approx(1.0, rel=1e-14)
        assert weight @ r == pytest.approx(mean, rel=1e-14)
        assert weight @ z == pytest.approx((bottom + top) / 2.0, rel=1e-14)


@pytest.mark.parametrize(("weight", "cost", "limit"), [("rms_plane", 12.590, 2.0e-4), ("rms_volume", 12.599, 2.0e-4)])
def test_notes_allocation_meets_its_limits(weight: str, cost: float, limit: float) -> None:
    """Section 6: squareness and yaw of the optimum printed there are 0.2 mrad, to its digits."""
    ref = [1e-5] * 3 + [2e-5] * 3 + [1e-4] * 3
    sigma = np.array([5.73, 5.73, 10.87, 12.3, 12.3, 80, 57, 57, 86]) * 1e-6
    r, z, w = quadrature(RING, weight, 16)  # type: ignore[arg-type]
    effects = unit_effects(M1, r, z).orientation
    terms = zip(KINDS, sigma, strict=True)
    variance = np.sum([(effects[name] ** 2).sum(axis=-1) * s**2 for name, s in terms], axis=0)
    assert sum(np.array(ref) / sigma) == pytest.approx(cost, rel=2e-3)
    squareness, yaw = np.sqrt(w @ (variance[:, 0] + variance[:, 1])), np.sqrt(w @ variance[:, 2])
    assert squareness == pytest.approx(limit, rel=0.01)
    assert yaw == pytest.approx(limit, rel=0.01)


@MODELS
def test_compensation_makes_the_position_exact(machine: Manipulator) -> None:
    """What is left is the first-order prediction, to the second order of the errors."""
    r, z, phi = poses(20)
    errors = 0.1 * SPREAD * np.random.default_rng(8).normal(size=63)
    left = compensated(machine, r, z, phi, errors)
    predicted = split(machine, r, z, phi).residual @ errors
    assert np.abs(left - predicted).max() < 3e-3 * np.abs(left).max()


def test_compensation_of_a_drive_zero_common_to_all() -> None:
    """The whole machine is turned about z: corrected, nothing is left (model M2)."""
    zeros = error_vector({"drive_zero_1_mrad": 2.0, "drive_zero_2_mrad": 2.0})
    off = exact_pose(M2, 0.5, 0.2, 0.3, zeros)
    assert off.orientation[2] == pytest.approx(2e-3, rel=1e-9)
    assert np.abs(compensated(M2, 0.5, 0.2, 0.3, zeros)).max() < 1e-12


def test_out_of_reach_names_pose_and_chains() -> None:
    with pytest.raises(OutOfReach, match=r"pose 2 \(r = 900 mm.*chain 1") as caught:
        posture(M1, np.array([0.5, 0.9]), np.array([0.2, 0.2]))
    assert "chain 3" in str(caught.value)
    with pytest.raises(OutOfReach, match=r"r = 1e\+06 mm"):
        exact_pose(M1, 1000.0, 0.2)
    assert not (np.abs(reach(M1, np.array([0.045]), np.array([0.150]))[0, 2]) <= 1.0)


def test_errors_beyond_any_pose_are_named() -> None:
    with pytest.raises(NoPose, match="pose 1: Newton's method does not converge"):
        exact_pose(M1, 0.5, 0.2, 0.0, error_vector({"rod_length_1a_um": -4e5}))


def test_unknown_sources_with_the_nearest_name() -> None:
    with pytest.raises(Exception, match="did you mean `arm_length_1_um`") as caught:
        error_vector({"arm_lenght_1_um": 1.0, "rod_length_1a_um": float("nan")})
    assert "rod_length_1a_um: must be finite" in str(caught.value)


def wrong(**values: Any) -> Manipulator:
    return replace(M1, **values)


def text(machine: Manipulator, ring: TaskRing = RING) -> str:
    return "\n".join(str(fault) for fault in faults(machine, ring))


def test_sound_geometries_have_no_faults() -> None:
    assert text(M1) == ""
    assert [text(other) for other in OTHERS] == ["", "", ""]


@pytest.mark.parametrize(
    ("machine", "ring", "said"),
    [
        (wrong(arm_length=(0.4, 0.4)), RING, "arm_length_mm: must hold 3 numbers"),
        (wrong(half_width=0.0), RING, "half_width_mm: must be above 0, got 0"),
        (wrong(rod_length=(0.48, -1.0, 0.4)), RING, "rod_length_mm: must be above 0"),
        (wrong(hinge_offset=float("nan")), RING, "hinge_offset_mm: must be finite"),
        (wrong(follow_up="free"), RING, 'follow_up: must be "fixed" or "rod"'),
        (wrong(rod_length=(0.1, 0.48, 0.42)), RING, "chain 1 cannot close at any pose"),
        (M1, TaskRing(r=(0.3, 0.9)), "the pose r = 900 mm, z = 300 mm is too far away for chain 2"),
        (M1, TaskRing(r=(0.05, 0.65)), "r = 50 mm, z = 150 mm is too near for chain 3"),
        (M1, TaskRing(r=(0.65, 0.3)), r"ring_r_mm: must be [low, high]"),
        (M1, TaskRing(z=(0.3, 0.3)), r"ring_z_mm: must be [low, high]"),
        (M1, TaskRing(r=(-0.1, 0.3)), "ring_r_mm: must be above 0"),
        (M1, TaskRing(r=(0.3, 0.4, 0.5)), "ring_r_mm: must hold 2 numbers"),  # type: ignore[arg-type]
    ],
)
def test_faults_say_where_and_what(machine: Manipulator, ring: TaskRing, said: str) -> None:
    assert said in text(machine, ring)


def test_singularity_within_the_ring_is_found() -> None:
    """Attachments so wide that the rods of chains 1 and 2 become parallel within the ring."""
    machine = replace(M1, half_length=0.39)
    said = text(machine)
    assert "crosses a singularity of the orientation" in said
    assert "crosses a singularity of the position" in said
    assert "condition number" in said and "chain" in said
    r, z = (float(said.split(f"{name} = ")[1].split(" mm")[0]) * MM for name in "rz")
    at = np.array([r]), np.array([z])
    assert conditions(machine, *at)[0][0] > 1e4


def test_singularity_of_the_follow_up_rod_is_found() -> None:
    """At the pose named the slopes of the seven closures, written out above, lose their rank."""
    lengths: dict[str, Any] = {"arm_length": (0.47, 0.47, 0.49), "rod_length": (0.58, 0.58, 0.26)}
    machine = replace(M2, half_length=0.02, half_width=0.26, hinge_offset=0.29, **lengths)
    ring = TaskRing(r=(0.49, 0.59), z=(0.14, 0.24))
    said = next(one for one in text(machine, ring).splitlines() if "the follow-up rod" in one)
    assert "chain 3" in said
    r, z = (float(said.split(f"{name} = ")[1].split(" mm")[0]) * MM for name in "rz")
    x = np.array([r, 0.0, z, 0.0, 0.0, 0.0, 0.0])
    found = [
        residuals(machine, (r, z, 0.0), np.zeros(63), x + sign * step)
        for step in 1e-6 * np.eye(7)
        for sign in (1.0, -1.0)
    ]
    slopes = (np.array(found[::2]) - np.array(found[1::2])) / 2e-6
    assert np.linalg.svd(slopes)[1].min() < 1e-5  # the pose is printed to a micrometre
