"""What each name looks like in pose errors: small amplitudes, by finite differences of poses."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from benchmarks.gap.generator import robot
from benchmarks.gap.generator.manipulators import GRAVITY, OUTPUTS, SCALES, Poses, errors, leaning, loose, stacked
from benchmarks.gap.generator.robot import ARMS, Robot
from benchmarks.gap.generator.tables import Array
from benchmarks.gap.scoring.rival import Rival, fixed

STEP = 1e-5
"""[m] and [rad]: what is left of the second order is cancelled, rounding is 1e-10 of it."""


@lru_cache(maxsize=4)
def of_drives(at: Poses) -> Array:
    """Pose errors (6 n, 3) per radian of each drive."""
    steps = STEP * np.eye(3)
    return np.column_stack([(errors(at, Robot(), one) - errors(at, Robot(), -one)) / (2.0 * STEP) for one in steps])


@lru_cache(maxsize=4)
def of_arms(at: Poses) -> Array:
    """Pose errors (6 n, 3) per metre of each arm."""
    ends = [[errors(at, Robot(arms=ARMS + sign * one)) for sign in (1.0, -1.0)]
            for one in STEP * np.eye(3)]  # fmt: skip
    return np.column_stack([(up - down) / (2.0 * STEP) for up, down in ends])


@lru_cache(maxsize=4)
def of_torques(at: Poses) -> Array:
    """Pose errors (6 n, 3) per compliance [rad/Nm] of each drive under one kilogram."""
    moments, _ = robot.lifts(robot.at(Robot(), at.r, at.z))
    return -GRAVITY * of_drives(at) * np.tile(moments, (len(OUTPUTS), 1))


@lru_cache(maxsize=4)
def of_play(at: Poses) -> Array:
    """Pose errors (6 n, 1) per metre of play of the rods."""
    return loose(at, STEP, 1e-9)[:, None] / STEP


def zeros(at: Poses, _: Array) -> Array:
    return 1e-3 * of_drives(at)


def arms(at: Poses, _: Array) -> Array:
    return 1e-6 * of_arms(at)


def tilts(at: Poses, _: Array) -> Array:
    """A rotation w of the base moves p by w x p and turns by w."""
    found = [leaning(at, x, y) - leaning(at, -x, -y) for x, y in ((STEP, 0.0), (0.0, STEP))]
    return np.asarray(np.column_stack(found) * 1e-3 / (2.0 * STEP))


def torques(at: Poses, p: Array) -> Array:
    """Compliance times static torque of the payload and p[0] kg beside it."""
    mass = np.tile(at.payload + p[0], len(OUTPUTS))
    return np.asarray(1e-3 * of_torques(at) * mass[:, None])


def growth(at: Poses, _: Array) -> Array:
    """A robot that stays similar to itself grows its pose alike."""
    grown = 1e-6 * at.tau[:, None] * np.column_stack([at.r, np.zeros(len(at)), at.z])
    return stacked(grown, np.zeros((len(at), 3)))[:, None]


def turns(at: Poses, _: Array) -> Array:
    """A cosine and a sine over the turn of each arm."""
    theta = robot.angles(at.r, at.z) + np.outer(at.phi, [1.0, 1.0, 0.0])
    waves = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    found = 1e-3 * of_drives(at)[:, :, None] * np.tile(waves, (len(OUTPUTS), 1, 1))
    return np.asarray(found.reshape(len(found), 6))


def play(at: Poses, _: Array) -> Array:
    return 1e-6 * of_play(at)


def each(at: Poses, what: Array, count: int = len(OUTPUTS)) -> Array:
    """`what` (n,) in each of the first outputs (6 n, count), in its unit."""
    return np.asarray(np.kron(np.diag(1.0 / SCALES)[:, :count], what[:, None]), dtype=np.float64)


def walked(at: Poses, p: Array) -> Array:
    return each(at, np.log1p(at.time / (p[0] * at.time[-1])))


MANIPULATOR_RIVALS = (
    Rival("joint_zero_offset", zeros, linear=3),
    Rival("arm_length_error", arms, linear=3),
    Rival("base_tilt", tilts, linear=2),
    Rival("gravity_sag", torques, fixed((0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 100.0)),
          linear=3, positive=True),
    Rival("thermal_growth", growth),
    Rival("drive_eccentricity", turns, linear=6),
    Rival("joint_clearance", play),
    Rival("gauge_bias", lambda at, _: each(at, np.ones(len(at)), 3), linear=3),
    Rival("drift", lambda at, _: each(at, at.time), linear=6, positive=True),
    Rival("creep", walked, fixed(tuple(np.geomspace(1e-4, 1.0, 12).tolist())), linear=6,
          positive=True),
)  # fmt: skip
"""Amplitudes in the units of the notes: mrad, um, mrad/Nm, ppm, mm."""
