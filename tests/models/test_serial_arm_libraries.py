"""Kinematics and gravity of serial arms against two libraries that know nothing of our tables.

MuJoCo builds the arm from bodies with places and quaternions; Modern Robotics from screw axes
(products of exponentials) and the links' frames at zero. Both get them from a product of 4x4
matrices written out here.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import modern_robotics
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.models.test_serial_arm import move, turn
from tolevo.models.robot import GRAVITY
from tolevo.models.serial_arm.kinematics import Chain, frames, gravity_torques, positions
from tolevo.problems.serial_arm.definition import CENTRE, MASS, ROWS

POSES = np.random.default_rng(3).uniform(-np.pi, np.pi, (20, 6))
CLOSE = 1e-12
"""m, m/rad, and N m over the largest: products of a few dozen rounded numbers near 1."""


@dataclass(frozen=True)
class Arm:
    chain: Chain
    mass: np.ndarray
    centre: np.ndarray


def chain_of(d: object, a: object, alpha: object, tool: object, scale: float = 1e-3) -> Chain:
    nothing = np.zeros(6)
    lengths = [scale * np.array(one, dtype=float) for one in (d, a)]
    twist = np.radians(np.array(alpha, dtype=float))
    end = scale * np.array(tool, dtype=float)
    return Chain(nothing, lengths[0], lengths[1], twist, nothing, nothing, end)


PUMA = Arm(
    chain_of((671.83, 0, 150.05, 431.8, 0, 0), (0, 431.8, 20.3, 0, 0, 0),
             (90, 0, -90, 90, -90, 0), (0, 0, 56.25)),
    np.array([0.0, 17.4, 4.8, 0.82, 0.34, 0.09]),
    1e-3 * np.array([[0, 0, 0], [-363.8, 6, 227.5], [-20.3, -14.1, 70], [0, 19, 0], [0, 0, 0],
                     [0, 0, 32.0]]),
)  # fmt: skip
KR5 = Arm(chain_of(ROWS["d"], ROWS["a"], ROWS["alpha"], (150, 0, 100)), np.array(MASS),
          np.array(CENTRE))  # fmt: skip
ZERO, D, A, ALPHA, BETA = np.random.default_rng(8).normal(scale=0.4, size=(5, 6))
BUILT = Arm(  # as built: every error, base and tool
    Chain(ZERO, D, A, ALPHA, BETA, np.array([0.1, 0, 0.2, 0, 0, 0]), np.array([0.02, -0.1, 0.2])),
    np.array(MASS), np.array(CENTRE),
)  # fmt: skip
ARMS = pytest.mark.parametrize("arm", [PUMA, KR5, BUILT], ids=["puma", "kr5", "built"])


def after_joint(chain: Chain, at: int) -> np.ndarray:
    """From the turned joint to the next: what a row of the table adds."""
    shift = move(chain.a[at], 0, chain.d[at])
    twist = turn("x", chain.alpha[at]) @ turn("y", chain.beta[at])
    return np.asarray(turn("z", chain.zero[at]) @ shift @ twist)


class Screws:
    """Modern Robotics: home frames of the links and screw axes in the space frame."""

    def __init__(self, arm: Arm) -> None:
        base = move(*arm.chain.base[:3])
        axes, self.links, here = [], [], base
        for at in range(6):
            z, through = here[:3, 2], here[:3, 3]
            axes.append(np.concatenate([z, np.cross(through, z)]))
            here = here @ after_joint(arm.chain, at)
            self.links.append(here @ move(*arm.centre[at]))
        self.axes = np.array(axes).T
        self.home = here @ move(*arm.chain.tool)
        self.mass = arm.mass

    def torque(self, q: np.ndarray, payload: float) -> np.ndarray:
        frames_of = [np.eye(4), *self.links, self.home]
        steps = [np.linalg.inv(one) @ two for one, two in pairwise(frames_of)]
        inertia = [np.diag([0, 0, 0, m, m, m]) for m in self.mass]
        down = np.array([0.0, 0.0, -GRAVITY])
        found = modern_robotics.GravityForces(q, down, steps, inertia, self.axes)
        wrench = np.zeros(6)  # the tool pushes up what hangs on it, at its own place
        tool = modern_robotics.FKinSpace(self.home, self.axes, q)
        wrench[3:] = tool[:3, :3].T @ np.array([0.0, 0.0, payload * GRAVITY])
        hung = modern_robotics.EndEffectorForces(q, wrench, steps, inertia, self.axes)
        return np.asarray(found + hung)


def bodies(arm: Arm, payload: float) -> mujoco.MjModel:
    """MuJoCo: a body per joint that turns about its z; the table's row is the next one's place."""

    def place(matrix: np.ndarray) -> str:
        x, y, z, w = Rotation.from_matrix(matrix[:3, :3]).as_quat().tolist()
        return f'pos="{numbers(matrix[:3, 3])}" quat="{w!r} {x!r} {y!r} {z!r}"'

    def numbers(values: np.ndarray) -> str:
        return " ".join(repr(one) for one in values.tolist())

    def inertia(mass: float, centre: np.ndarray) -> str:
        own = f'mass="{mass or 1e-14!r}" diaginertia="1e-3 1e-3 1e-3"'
        return f'<inertial pos="{numbers(centre)}" {own}/>'

    text = '<site name="tool"/></body>'
    text = f"<body {place(move(*arm.chain.tool))}>{inertia(payload, np.zeros(3))}{text}"
    text = f"<body {place(after_joint(arm.chain, 5))}>{text}</body>"
    for at in range(5, -1, -1):
        here = after_joint(arm.chain, at - 1) if at else move(*arm.chain.base[:3])
        centre = (after_joint(arm.chain, at) @ [*arm.centre[at], 1.0])[:3]
        own = '<joint type="hinge" axis="0 0 1"/>' + inertia(float(arm.mass[at]), centre)
        text = f"<body {place(here)}>{own}{text}</body>"
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option gravity="0 0 {-GRAVITY!r}"/><worldbody>{text}</worldbody></mujoco>'
    )


@ARMS
def test_against_modern_robotics(arm: Arm) -> None:
    other = Screws(arm)
    now = frames(arm.chain, POSES)
    torque = gravity_torques(now, arm.mass, arm.centre, 5.0)
    jacobian = now.joints()
    np.testing.assert_allclose(now.tool, positions(arm.chain, POSES), atol=CLOSE)
    for at, q in enumerate(POSES):
        tool = modern_robotics.FKinSpace(other.home, other.axes, q)
        np.testing.assert_allclose(now.tool[at], tool[:3, 3], atol=CLOSE)
        np.testing.assert_allclose(now.turn[at, -1], tool[:3, :3], atol=CLOSE)
        twist = modern_robotics.JacobianSpace(other.axes, q)
        at_tool = twist[3:] + np.cross(twist[:3].T, tool[:3, 3]).T
        np.testing.assert_allclose(jacobian[1][at], twist[:3], atol=CLOSE)
        np.testing.assert_allclose(jacobian[0][at], at_tool, atol=CLOSE)
        scale = np.abs(torque).max()
        np.testing.assert_allclose(torque[at], other.torque(q, 5.0), atol=CLOSE * scale)


@ARMS
def test_against_mujoco(arm: Arm) -> None:
    model = bodies(arm, 5.0)
    data = mujoco.MjData(model)
    now = frames(arm.chain, POSES)
    torque = gravity_torques(now, arm.mass, arm.centre, 5.0)
    move_by, turn_by = now.joints()
    found = np.zeros((3, 6)), np.zeros((3, 6))
    for at, q in enumerate(POSES):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(now.tool[at], data.site("tool").xpos, atol=CLOSE)
        mujoco.mj_jacSite(model, data, *found, 0)
        np.testing.assert_allclose(move_by[at], found[0], atol=CLOSE)
        np.testing.assert_allclose(turn_by[at], found[1], atol=CLOSE)
        scale = np.abs(torque).max()
        np.testing.assert_allclose(torque[at], data.qfrc_bias, atol=CLOSE * scale)


def test_errors_of_the_table_against_central_differences() -> None:
    """The five errors of every joint: 2e-10 of the difference itself, its step 1e-5."""
    names = ("zero", "d", "a", "alpha", "beta")
    move_by, _ = frames(BUILT.chain, POSES).errors()
    for joint in range(6):
        for at, name in enumerate(names):
            ends = []
            for sign in (1.0, -1.0):
                parts = {key: getattr(BUILT.chain, key).copy() for key in (*names, "base", "tool")}
                parts[name][joint] += sign * 1e-5
                ends.append(positions(Chain(**parts), POSES))
            slope = (ends[0] - ends[1]) / 2e-5
            np.testing.assert_allclose(move_by[:, :, 5 * joint + at], slope, atol=2e-9)


def test_five_errors_a_joint_have_25_independent_ones() -> None:
    """Rank 25 of 30 in position and orientation at random poses."""
    move_by, turn_by = frames(KR5.chain, POSES).errors()
    assert np.linalg.matrix_rank(np.concatenate([move_by, turn_by], axis=1).reshape(-1, 30)) == 25
