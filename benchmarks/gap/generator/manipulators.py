"""Pose errors of the parallel manipulator, and what hides in them [mm, mrad]."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.gap.generator import robot
from benchmarks.gap.generator.mechanisms import Injected
from benchmarks.gap.generator.robot import ARMS, RODS, Robot
from benchmarks.gap.generator.tables import Array

GRAVITY = 9.80665
OUTPUTS = ("dr_mm", "dt_mm", "dz_mm", "tilt_r_mrad", "tilt_t_mrad", "yaw_mrad")
SCALES = np.array([0.010, 0.010, 0.015, 0.050, 0.050, 0.040])
"""Noise of a tracker along and across [mm], and of rotations from three targets 0.2 m apart
[mrad]: in these units all outputs are equally noisy.
"""


@dataclass(frozen=True, eq=False)
class Poses:
    """Rows (n,) in the order of measuring: radius and height [m], azimuth [rad], payload [kg],
    temperature above 20 degC [K], time [s].
    """

    r: Array
    z: Array
    phi: Array
    payload: Array
    tau: Array
    time: Array

    def __len__(self) -> int:
        return len(self.r)

    @property
    def scatter_follows(self) -> tuple[Array, ...]:
        return self.payload, self.time, self.r


def poses(rng: np.random.Generator, n: int, poor: str | None) -> Poses:
    """Points of the ring; poor: heavy parts are put far out, or the hall warms up meanwhile."""
    r, z = rng.uniform(0.302, 0.648, n), rng.uniform(0.102, 0.298, n)
    most = rng.uniform(5.0, 15.0)
    payload = rng.uniform(0.0, most, n)
    tau = rng.uniform(-5.0, rng.uniform(10.0, 25.0), n)
    time = np.arange(n, dtype=np.float64) * rng.uniform(5.0, 30.0)
    if poor == "payload follows reach":
        far = (r - r.min()) / np.ptp(r) + 0.1 * rng.normal(size=n)
        payload = most * np.clip(far, 0.0, None)
    if poor == "temperature follows time":
        warm = 1.0 - np.exp(-time / time[-1] * rng.uniform(1.0, 3.0))
        tau = tau.max() * (warm + 0.05 * rng.normal(size=n))
    return Poses(r, z, rng.uniform(0.0, 2.0 * np.pi, n), payload, tau, time)


POOR_POSES = ("payload follows reach", "temperature follows time")


def of_poses(at: Poses) -> dict[str, NDArray[np.float64]]:
    """The columns of a measurement table, in the units of its file."""
    return {
        "r_mm": 1e3 * at.r,
        "z_mm": 1e3 * at.z,
        "phi_deg": np.degrees(at.phi),
        "payload_kg": at.payload,
        "temperature_C": at.tau + 20.0,
        "time_s": at.time,
    }


def stacked(place: Array, turn: Array) -> Array:
    """Errors (n, 3) [m] and [rad] as the outputs, one after the other (6 n,), in noise units."""
    return np.asarray((1e3 * np.hstack([place, turn]) / SCALES).T.ravel())


def errors(at: Poses, built: Robot, off: Array | float = 0.0) -> Array:
    """Pose errors (6 n,) of a robot as built, its drives off by `off` (n, 3) [rad]."""
    return stacked(*robot.departure(robot.at(built, at.r, at.z, off), at.r, at.z))


def shifted(at: Poses, place: Array) -> Array:
    """Pose errors (6 n,) of platforms that stand off by `place` (n, 3) [m], unturned."""
    return stacked(place, np.zeros((len(at), 3)))


def upright(at: Poses, _: int) -> Array:
    """What the nominal robot is off."""
    return np.zeros(len(OUTPUTS) * len(at))


def spun(rng: np.random.Generator, low: float, high: float, count: int = 3) -> Array:
    """Numbers of either sign, none larger than one drawn between low and high."""
    return np.asarray(rng.uniform(low, high) * rng.uniform(-1.0, 1.0, count))


def joint_zero_offset(rng: np.random.Generator, at: Poses) -> Injected:
    """The drives were taught with a gauge that does not fit."""
    return Injected(errors(at, Robot(), spun(rng, 0.2e-3, 3e-3)))


def arm_length_error(rng: np.random.Generator, at: Poses) -> Injected:
    return Injected(errors(at, Robot(arms=ARMS + spun(rng, 50e-6, 500e-6))))


def leaning(at: Poses, x: Array | float, y: Array | float) -> Array:
    """Pose errors (6 n,) of a robot that leans by x about the base's x, then by y about its y."""
    axes = Rotation.from_rotvec(np.outer(at.phi, [0.0, 0.0, 1.0]))
    lean = Rotation.from_euler("xy", np.column_stack(np.broadcast_arrays(x, y, at.phi)[:2]))
    leant = axes.inv() * lean * axes
    stood = np.column_stack([at.r, np.zeros(len(at)), at.z])
    return stacked(leant.apply(stood) - stood, leant.as_rotvec())


def base_tilt(rng: np.random.Generator, at: Poses) -> Injected:
    """The feet of the base are unevenly shimmed."""
    x, y = spun(rng, 0.2e-3, 3e-3, 2).tolist()
    return Injected(leaning(at, x, y))


def sagging(at: Poses, compliance: Array, mass: float) -> Array:
    """Pose errors (6 n,) of drives with `compliance` (3,) [rad/Nm] that carry payload and `mass`.

    The torque is that at the pose into which they give way.
    """
    weight = (at.payload + mass)[:, None] * GRAVITY
    off = np.zeros((len(at), 3))
    for _ in range(6):
        moments, _ = robot.lifts(robot.at(Robot(), at.r, at.z, off))
        off = -compliance * weight * moments
    return errors(at, Robot(), off)


def gravity_sag(rng: np.random.Generator, at: Poses) -> Injected:
    compliance = rng.uniform(2e-6, 40e-6) * rng.uniform(0.3, 1.0, 3)
    return Injected(sagging(at, compliance, rng.uniform(1.0, 20.0)))


def thermal_growth(rng: np.random.Generator, at: Poses) -> Injected:
    """Steel or aluminium, links and base alike; its expansion itself rises a little."""
    a, b = rng.uniform(9e-6, 25e-6), rng.uniform(0.0, 3e-4)
    growth = np.expm1(a * at.tau * (1.0 + b * at.tau))
    return Injected(errors(at, Robot(growth=growth[:, None, None])))


def eccentric(theta: Array, share: Array, phase: Array) -> Array:
    """By how much (n, 3) scales that sit off their axes, by a share of their radius, misread."""
    return np.asarray(np.angle(1.0 + share * np.exp(1j * (theta + phase))))


def drive_eccentricity(rng: np.random.Generator, at: Poses) -> Injected:
    """The scales of the drives sit off the axes of their arms."""
    theta = robot.angles(at.r, at.z) + np.outer(at.phi, [1.0, 1.0, 0.0])
    share = rng.uniform(0.2e-3, 3e-3) * rng.uniform(0.2, 1.0, 3)
    off = eccentric(theta, share, rng.uniform(0.0, 2.0 * np.pi, 3))
    return Injected(errors(at, Robot(), off))


def loose(at: Poses, play: float, grease: float) -> Array:
    """Pose errors (6 n,) of rods that lie to one side of their play [m], as they are pulled.

    `grease` is the pull, in weights of the platform, that it withstands.
    """
    _, held = robot.lifts(robot.at(Robot(), at.r, at.z))
    pulled = np.tanh(-held / grease)
    return errors(at, Robot(rods=RODS[:, None] + play * pulled))


def joint_clearance(rng: np.random.Generator, at: Poses) -> Injected:
    return Injected(loose(at, rng.uniform(5e-6, 100e-6), 1e-3))


def gauge_bias(rng: np.random.Generator, at: Poses) -> Injected:
    """The target's nest sits off the middle of the platform."""
    return Injected(shifted(at, np.tile(spun(rng, 0.02e-3, 0.3e-3), (len(at), 1))))


def drift(rng: np.random.Generator, at: Poses) -> Injected:
    """The zeros of all read-outs walk up, each at its own pace."""
    pace = rng.uniform(1.0, 10.0) * rng.uniform(0.2, 1.0, len(OUTPUTS))
    return Injected(np.concatenate([one * at.time / at.time[-1] for one in pace]))


MANIPULATOR = {
    one.__name__: one
    for one in (joint_zero_offset, arm_length_error, base_tilt, gravity_sag, thermal_growth,
                drive_eccentricity, joint_clearance, gauge_bias, drift)
}  # fmt: skip


def bending_platform(rng: np.random.Generator, at: Poses) -> Injected:
    """A platform that gives way with the square of its payload."""
    return Injected(shifted(at, np.outer(at.payload**2, [0.0, 0.0, -rng.uniform(2e-7, 2e-6)])))


def one_soft_rod(rng: np.random.Generator, at: Poses) -> Injected:
    """One rod of chain 1 stretches under the payload."""
    _, lift = robot.lifts(robot.at(Robot(), at.r, at.z))
    rods = np.tile(RODS[:, None], (len(at), 1, 2))
    pull = -GRAVITY * at.payload * lift[:, 0, 0]
    rods[:, 0, 0] += rng.uniform(2e-7, 2e-6) * pull
    return Injected(errors(at, Robot(rods=rods)))


def refraction(rng: np.random.Generator, at: Poses) -> Injected:
    """Layers of warm air bend the tracker's beam the more, the higher the target."""
    return Injected(shifted(at, np.outer(at.z**2, [0.0, 0.0, rng.choice([-1.0, 1.0]) * 2e-3])))


def three_feet(rng: np.random.Generator, at: Poses) -> Injected:
    """A base on three feet sinks between them."""
    wave = 50e-6 * np.cos(3.0 * at.phi + rng.uniform(0.0, 2.0 * np.pi))
    return Injected(shifted(at, np.outer(wave, [0.0, 0.0, 1.0])))


def knocked_tracker(rng: np.random.Generator, at: Poses) -> Injected:
    """Somebody walks into the tracker: its frame is elsewhere from then on."""
    after = at.time > rng.uniform(0.3, 0.7) * at.time[-1]
    axes = Rotation.from_rotvec(np.outer(at.phi, [0.0, 0.0, 1.0]))
    return Injected(shifted(at, axes.inv().apply(np.outer(after, spun(rng, 5e-5, 2e-4)))))


def sun_on_one_side(rng: np.random.Generator, at: Poses) -> Injected:
    """A column that is heated from one side leans with the temperature."""
    x, y = spun(rng, 1e-5, 1e-4, 2)
    return Injected(leaning(at, x * at.tau, y * at.tau))


OUTSIDE_POSES = {
    one.__name__: one
    for one in (bending_platform, one_soft_rod, refraction, three_feet, knocked_tracker,
                sun_on_one_side)
}  # fmt: skip
"""Causes that no effect of the library has."""
