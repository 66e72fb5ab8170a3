"""Pose errors of the trial: its own closures, limits, and the frames and signs of the contract."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks.gap.generator import manipulators, robot
from benchmarks.gap.generator.kinds import KINDS
from benchmarks.gap.generator.manipulators import MANIPULATOR, OUTPUTS, OUTSIDE_POSES, SCALES, Poses, errors, poses
from benchmarks.gap.generator.records import LEAST_LAMBDA, orthogonal, record
from benchmarks.gap.generator.robot import ARMS, JOINTS, LINES, ORIGINS, RODS, SEATS, Robot
from benchmarks.gap.generator.tables import Array
from benchmarks.gap.scoring.manipulator_rivals import MANIPULATOR_RIVALS
from benchmarks.gap.scoring.rivals import coefficients, least_left
from benchmarks.gap.scoring.told import told
from tolevo import registry
from tolevo.models.effects.measurements import Active, predicted
from tolevo.models.manipulator.pose import ManipulatorPose

KIND = KINDS["manipulator_pose"]


@pytest.fixture(scope="module")
def at() -> Poses:
    return poses(np.random.default_rng(11), 60, None)


def in_units(added: Array) -> Array:
    """Outputs (6, n) in mm and mrad."""
    return np.asarray(added.reshape(len(OUTPUTS), -1) * SCALES[:, None])


def through_library(at: Poses, name: str, values: dict[str, float]) -> Array:
    """Outputs (6, n) of the project's model with one of its effects."""
    table: dict[str, Any] = {one: np.asarray(x) for one, x in KIND.columns(at).items()}
    active = Active(registry.load("effects", name)(), values)
    rng = np.random.default_rng(0)
    found = predicted(ManipulatorPose(), "manipulator_pose", table, [active], rng)
    return np.stack([found[output] for output in OUTPUTS])


def test_closures_hold_with_every_length_off(at: Poses) -> None:
    """Joints written out again, chain by chain: rods have their lengths to 1e-9 mm."""
    rng = np.random.default_rng(2)
    off, longer = rng.normal(0.0, 3e-3, (len(at), 3)), rng.normal(0.0, 5e-4, (3, 2))
    built = Robot(arms=ARMS + 4e-4, rods=RODS[:, None] + longer)
    found = robot.at(built, at.r, at.z, off)
    theta = robot.angles(at.r, at.z) + off
    for chain in range(3):
        arm = np.zeros((len(at), 3))
        arm[:, 0], arm[:, 2 if chain == 2 else 1] = np.cos(theta[:, chain]), np.sin(theta[:, chain])
        elbow = ORIGINS[chain] + (ARMS[chain] + 4e-4) * arm
        for j, side in enumerate((0.5, -0.5)):
            half = side * JOINTS[chain] * LINES[chain]
            seat = np.einsum("nab,b->na", found.turn, SEATS[chain] + half)
            length = np.linalg.norm(found.place + seat - elbow - half, axis=1)
            np.testing.assert_allclose(length, RODS[chain] + longer[chain, j], rtol=0, atol=1e-12)


def test_nominal_robot_stands_where_it_is_told(at: Poses) -> None:
    np.testing.assert_allclose(in_units(errors(at, Robot())), 0.0, atol=1e-9)


def test_height_follows_drives_and_rods_as_differences_say(at: Poses) -> None:
    """Virtual work against the poses themselves."""
    drives, rods = robot.lifts(robot.at(Robot(), at.r, at.z))
    h = 1e-6
    for chain in range(3):
        step = h * np.eye(3)[chain]
        up, down = (robot.at(Robot(), at.r, at.z, s * step).place[:, 2] for s in (1.0, -1.0))
        np.testing.assert_allclose(drives[:, chain], (up - down) / (2.0 * h), atol=1e-7)
        for side in range(2):
            longer = np.zeros((3, 2))
            longer[chain, side] = h
            one, other = (robot.at(Robot(rods=RODS[:, None] + s * longer), at.r, at.z).place[:, 2] for s in (1.0, -1.0))
            np.testing.assert_allclose(rods[:, chain, side], (one - other) / (2.0 * h), atol=1e-7)


def injected(at: Poses, name: str) -> tuple[Array, dict[str, float]]:
    """Errors of a mechanism of given dimensions, and the numbers of the effect that it is."""
    theta = robot.angles(at.r, at.z) + np.outer(at.phi, [1.0, 1.0, 0.0])
    share, phase = np.array([4e-4, 3e-4, 5e-4]), np.array([0.3, 1.9, -0.8])
    # sin(theta + phase) share = share sin(phase) cos(theta) + share cos(phase) sin(theta)
    waves = {f"drive_cos_{k + 1}_mrad": 1e3 * share[k] * np.sin(phase[k]) for k in range(3)}
    waves |= {f"drive_sin_{k + 1}_mrad": 1e3 * share[k] * np.cos(phase[k]) for k in range(3)}
    compliance = {f"compliance_{k + 1}_mrad_per_Nm": c for k, c in enumerate((2e-3, 3e-3, 5e-3))}
    off = np.array([3e-4, -2e-4, 4e-4])
    longer = np.array([2e-5, -3e-5, 4e-5])
    cases = {
        "joint_zero_offset": (
            errors(at, Robot(), off),
            {"zero_1_mrad": 0.3, "zero_2_mrad": -0.2, "zero_3_mrad": 0.4},
        ),
        "arm_length_error": (
            errors(at, Robot(arms=ARMS + longer)),
            {"length_1_um": 20.0, "length_2_um": -30.0, "length_3_um": 40.0},
        ),
        "base_tilt": (manipulators.leaning(at, 3e-4, -4e-4), {"x_mrad": 0.3, "y_mrad": -0.4}),
        "gravity_sag": (
            manipulators.sagging(at, np.array([2e-6, 3e-6, 5e-6]), 4.0),
            {**compliance, "moving_mass_kg": 4.0},
        ),
        "thermal_growth": (
            errors(at, Robot(growth=np.expm1(12e-6 * at.tau)[:, None, None])),
            {"expansion_per_K_ppm": 12.0},
        ),
        "drive_eccentricity": (
            errors(at, Robot(), manipulators.eccentric(theta, share, phase)), waves,
        ),
        "joint_clearance": (manipulators.loose(at, 8e-6, 1e-9), {"joint_clearance_um": 8.0}),
    }  # fmt: skip
    return cases[name]


OWN = sorted(set(MANIPULATOR) - {"gauge_bias", "drift"})


@pytest.mark.parametrize("name", OWN)
def test_frames_and_signs_are_those_of_the_contract(at: Poses, name: str) -> None:
    """Small errors by two codes that share nothing; what is left is of the second order."""
    added, values = injected(at, name)
    found, known = in_units(added), through_library(at, name, values)
    sizes = np.sqrt(np.mean(known**2, axis=1))
    assert (sizes > 0.0).sum() >= 2
    np.testing.assert_allclose(found, known, rtol=0.0, atol=2e-3 * sizes.max())


@pytest.mark.parametrize("name", OWN)
def test_notes_formula_of_a_name_is_the_tangent_of_its_mechanism(at: Poses, name: str) -> None:
    added, values = injected(at, name)
    rival = next(one for one in MANIPULATOR_RIVALS if one.name == name)
    p = np.array([values.pop("moving_mass_kg")] if rival.grids else [])
    order = sorted(values, key=lambda one: (one[-6], one)) if len(values) == 6 else list(values)
    made = rival.columns(at, p) @ np.array([values[one] for one in order])
    np.testing.assert_allclose(made, added, rtol=0.0, atol=5e-3 * np.abs(added).max())


def test_scorer_finds_the_dimensions_of_a_sag(at: Poses) -> None:
    """By the notes' formula: compliances, and the mass that is carried beside the payload."""
    compliance = np.array([10e-6, 20e-6, 30e-6])
    added = manipulators.sagging(at, compliance, 7.0)
    rival = next(one for one in MANIPULATOR_RIVALS if one.name == "gravity_sag")
    left, p = least_left(rival, at, KIND.free(len(at)), added)
    assert left < 1e-5 * float((added**2).sum())
    np.testing.assert_allclose(p, 7.0, rtol=0.01)
    found = coefficients(rival, p, at, KIND.free(len(at)), added)
    np.testing.assert_allclose(found, 1e3 * compliance, rtol=0.01)


def test_nothing_of_a_cause_adds_nothing(at: Poses) -> None:
    none, theta = np.zeros(3), robot.angles(at.r, at.z)
    still = (
        errors(at, Robot(arms=ARMS + none), manipulators.eccentric(theta, none, none)),
        errors(at, Robot(growth=np.zeros((len(at), 1, 1)))),
        manipulators.leaning(at, 0.0, 0.0),
        manipulators.sagging(at, none, 5.0),
        manipulators.loose(at, 0.0, 1e-3),
    )
    for added in still:
        np.testing.assert_allclose(in_units(added), 0.0, atol=1e-9)


def test_every_cause_adds_something_and_draws_its_own_dimensions(at: Poses) -> None:
    for name, mechanism in {**MANIPULATOR, **OUTSIDE_POSES}.items():
        one = mechanism(np.random.default_rng(1), at).added
        other = mechanism(np.random.default_rng(2), at).added
        assert one.shape == (6 * len(at),), name
        assert one.std() > 0.0, name
        assert not np.allclose(one, other), name


def test_a_heavy_platform_sinks(at: Poses) -> None:
    """A weight lowers what gives way, whatever gives way."""
    sagged = in_units(manipulators.sagging(at, np.array([1e-5, 1e-5, 1e-5]), 5.0))
    loose = in_units(manipulators.loose(at, 3e-5, 1e-9))
    assert (sagged[2] < 0.0).all()
    assert (loose[2] < 0.0).all()


@pytest.mark.parametrize("group", ["good", "poor", "clean", "outside"])
def test_a_record_follows_from_its_group_and_number(group: str) -> None:
    (one, truth), (again, _) = record(f"manipulator {group}", 1), record(f"manipulator {group}", 1)
    assert one.table.equals(again.table)
    assert np.isfinite(one.table.to_numpy()).all()
    assert tuple(one.table)[-6:] == OUTPUTS
    assert one.configuration == 'model = "manipulator_pose"\nseed = 1\n[free]\n'
    assert not any(name in one.name for name in truth.names)


def test_noise_of_each_output_has_its_size_and_rotations_alone_have_free_zeros() -> None:
    number = next(
        k for k in range(50) if record("manipulator clean", k)[1].noise == "white"
        and len(record("manipulator clean", k)[1].points) > 300
    )  # fmt: skip
    one, truth = record("manipulator clean", number)
    readings = one.table[list(OUTPUTS)].to_numpy()
    wanted = truth.sigma * SCALES
    np.testing.assert_allclose(readings.std(axis=0), wanted, rtol=0.12)
    assert (np.abs(readings.mean(axis=0)[:3]) < 5.0 * wanted[:3] / np.sqrt(len(readings))).all()
    assert truth.free.sum(axis=0).tolist() == [len(readings)] * 3
    assert not truth.free[: 3 * len(readings)].any()
    assert truth.noise_rms == pytest.approx(wanted[0], rel=0.12)


@pytest.mark.parametrize("group", ["manipulator good", "manipulator poor"])
def test_signal_to_noise_is_over_all_outputs(group: str) -> None:
    """The scorer's lambda is that of the record, and the truth is among what may be named."""
    one, truth = record(group, 2)
    hidden = truth.hidden[0]
    left = orthogonal(truth.free, hidden.added)
    strength = float((left**2).sum()) / truth.sigma**2
    assert strength >= LEAST_LAMBDA - 1e-9
    assert 0.19 < np.sqrt(strength / (6 * len(one.table))) < 3.01
    seen = told(truth, hidden)
    assert seen.strength == pytest.approx(strength)
    assert hidden.name in seen.names


def test_poor_designs_tie_their_inputs() -> None:
    rng = np.random.default_rng(4)
    reach, warm = (poses(rng, 2000, way) for way in KIND.ways)
    free = poses(rng, 2000, None)
    assert np.corrcoef(reach.payload, reach.r)[0, 1] > 0.9
    assert np.corrcoef(warm.tau, warm.time)[0, 1] > 0.8
    assert abs(np.corrcoef(free.payload, free.r)[0, 1]) < 0.1
    assert abs(np.corrcoef(free.tau, free.time)[0, 1]) < 0.1
