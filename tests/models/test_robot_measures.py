"""Accuracy measures and the drives of the manipulator: the table of ISO 9283, per-arcmin maps.

Figures are those of the note on the whole machine, section 3; its own code is apart from ours.
"""

from __future__ import annotations

import numpy as np
import pytest

from tolevo.models.manipulator.forward import exact_pose
from tolevo.models.manipulator.geometry import Manipulator, TaskRing
from tolevo.models.manipulator.maps import NAMES
from tolevo.models.manipulator.ring import grid, quadrature
from tolevo.models.robot import GRAVITY, AccuracySample, Drives, bidirectional, drives, gravity_torque, links, ratio

ARCMIN = np.pi / 10800.0
RING = TaskRing()
M2 = Manipulator(follow_up="rod")


@pytest.fixture(scope="module")
def machine() -> Drives:
    return drives(M2, *quadrature(RING, "rms_plane"))


@pytest.fixture(scope="module")
def over() -> Drives:
    r, z = grid(RING)
    return drives(M2, r, z, np.full(len(r), 1.0 / len(r)))


def rms(machine: Drives, squares: np.ndarray) -> float:
    return float(1e3 * ARCMIN * np.sqrt(machine.mean(squares)))


class TestPerArcminMaps:
    def test_each_drive(self, machine: Drives, over: Drives) -> None:
        found = 1e3 * ARCMIN * np.sqrt(machine.mean(machine.squares))
        np.testing.assert_allclose(found, [0.1009, 0.1009, 0.0806], atol=5e-5)
        most = 1e3 * ARCMIN * np.sqrt(over.squares.max(axis=0))
        np.testing.assert_allclose(most, [0.1406, 0.1406, 0.0999], atol=1e-4)

    def test_two_drives(self, machine: Drives) -> None:
        one, other = machine.move[:, :, 0], machine.move[:, :, 1]
        assert rms(machine, np.sum((one + other) ** 2, axis=1)) == pytest.approx(0.1413, abs=5e-5)
        assert rms(machine, np.sum((one - other) ** 2, axis=1)) == pytest.approx(0.1442, abs=5e-5)

    def test_same_sense_is_a_rigid_turn(self, machine: Drives) -> None:
        """r x 1' about z: the follow-up rod (M2) makes it so, and M1 does not."""
        same = machine.move[:, :, 0] + machine.move[:, :, 1]
        assert np.abs(same[:, [0, 2]]).max() < 1e-12
        np.testing.assert_allclose(machine.turn[:, 2, :2].sum(axis=1), 1.0, rtol=1e-9)
        plain = drives(Manipulator(follow_up="fixed"), *quadrature(RING, "rms_plane"))
        both = plain.move[:, :, 0] + plain.move[:, :, 1]
        assert rms(plain, np.sum(both**2, axis=1)) == pytest.approx(0.1606, abs=6e-5)
        assert np.abs(plain.turn).max() < 1e-12

    def test_yaw(self, machine: Drives) -> None:
        yaw = 1e3 * ARCMIN * np.sqrt(machine.mean(machine.turn[:, 2] ** 2))
        np.testing.assert_allclose(yaw, [0.1454, 0.1454, 0.0], atol=6e-5)
        assert rms(machine, machine.turn[:, 2, :2].sum(axis=1) ** 2) == pytest.approx(0.2909, abs=5e-5)
        assert np.abs(machine.turn[:, :2]).max() < 1e-12

    def test_iso_variation(self, machine: Drives, over: Drives) -> None:
        reversing = np.array([1.0, 1.0, 0.0])
        assert rms(machine, machine.variation(reversing)) == pytest.approx(0.1009, abs=5e-5)
        most = 1e3 * ARCMIN * np.sqrt(over.variation(reversing).max())
        assert most == pytest.approx(0.1404, rel=3e-3)

    def test_against_the_exact_pose(self) -> None:
        """A turn of 1' by Newton's method: the nonlinearity is 2e-4."""
        r, z = grid(RING, 5)
        own = drives(M2, r, z, np.full(len(r), 1.0 / len(r)))
        for joint in range(3):
            errors = np.zeros(len(NAMES))
            errors[NAMES.index(f"drive_zero_{joint + 1}_mrad")] = ARCMIN
            moved = exact_pose(M2, r, z, 0.0, errors).position
            linear = own.move[:, :, joint] * ARCMIN
            assert np.abs(moved - linear).max() < 5e-4 * np.abs(linear).max()


class TestGravity:
    def test_torque_per_kilogram(self, over: Drives) -> None:
        torque = gravity_torque(over, 1.0)[:, :2]
        assert np.all(torque > 0.0) or np.all(np.sign(torque) == np.sign(torque[0]))
        size = np.abs(torque)
        assert [size.min(), size.max()] == pytest.approx([1.32, 3.17], abs=6e-3)

    def test_torque_is_the_slope_of_the_height(self) -> None:
        """m g dz/dtheta by central differences of the exact pose."""
        r, z = np.array([0.35, 0.6]), np.array([0.12, 0.28])
        own = drives(M2, r, z, np.full(2, 0.5))
        step, found = 1e-5, []
        for joint in range(3):
            heights = []
            for sign in (1.0, -1.0):
                errors = np.zeros(len(NAMES))
                errors[NAMES.index(f"drive_zero_{joint + 1}_mrad")] = sign * step
                heights.append(exact_pose(M2, r, z, 0.0, errors).position[:, 2])
            found.append(2.0 * GRAVITY * (heights[0] - heights[1]) / (2.0 * step))
        np.testing.assert_allclose(gravity_torque(own, 2.0), np.array(found).T, rtol=1e-6)

    def test_payload_that_holds_the_flanks(self, over: Drives) -> None:
        """tau_f = 3 % of 412 N m: from 9.4 kg at every pose, 6.0 kg at the median."""
        needed = 12.4 / np.abs(gravity_torque(over, 1.0)[:, :2]).min(axis=1)
        assert [needed.max(), np.median(needed)] == pytest.approx([9.4, 6.0], abs=0.05)

    def test_wind_up(self, machine: Drives, over: Drives) -> None:
        """10 kg on 108 N m/': 0.12..0.29' a joint, 0.0298 mm rms, 0.0612 mm at most."""
        angle = gravity_torque(over, 10.0)[:, :2] / 108.0
        assert [np.abs(angle).min(), np.abs(angle).max()] == pytest.approx([0.12, 0.29], abs=5e-3)
        for own, wanted in ((machine, 0.0298), (over, 0.0612)):
            joint = gravity_torque(own, 10.0)[:, :2] / 108.0 * ARCMIN
            size = 1e3 * np.linalg.norm(np.einsum("nij,nj->ni", own.move[:, :, :2], joint), axis=1)
            found = np.sqrt(own.mean(size**2)) if own is machine else size.max()
            assert found == pytest.approx(wanted, abs=6e-5)


class TestWhatCalibrationRemoves:
    def test_position_of_the_links_is_gone_and_squareness_is_not(self) -> None:
        r, z = grid(RING, 5)
        as_built, left = links(M2, r, z), links(M2, r, z, "position")
        assert not left.move.any()
        np.testing.assert_array_equal(left.turn[:, :2], as_built.turn[:, :2])
        assert np.abs(left.turn[:, 2] - as_built.turn[:, 2]).max() > 0.1


class TestBidirectional:
    def test_bidirectional_of_isotropic_errors_is_maxwell(self) -> None:
        """99.73 % quantile 3.7625 sigma, rms sqrt(3) sigma."""
        quantile, size = bidirectional(np.random.default_rng(3).normal(size=(400_000, 3)))
        assert [quantile, size] == pytest.approx([3.7625, np.sqrt(3.0)], rel=1e-2)


def test_sample_has_the_covariance_that_it_is_given() -> None:
    own = AccuracySample.draw(65_536, 4, 2, 3, np.random.default_rng(1))
    root = np.array([[[2.0, 0.0], [0.0, 2.0]], [[1.0, 0.0], [0.0, 0.0]]])
    free = np.ones((len(own.pose), 2))
    found = own.joint_errors(0.0 * free, root, free)
    np.testing.assert_allclose(np.mean(found**2, axis=0), [4.0, 0.5], rtol=2e-2)
    play = own.joint_errors(2.0 * free, 0.0 * root, free)
    np.testing.assert_allclose(np.mean(play**2, axis=0), 1.0, rtol=1e-12)
    assert abs(np.mean(play[:, 0] * play[:, 1])) < 1e-2
    assert ratio(np.zeros((5, 3))) == 1.0
