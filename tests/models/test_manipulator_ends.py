"""Manipulator: every fault of a ring is named, every coordinate of a pose has its own number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tolevo.models.manipulator.effects import changed_errors
from tolevo.models.manipulator.geometry import Manipulator, TaskRing
from tolevo.models.manipulator.pose import ManipulatorPose, _ring_faults, _rows


def test_both_ends_of_a_ring_are_named_where_both_are_wrong() -> None:
    ring = TaskRing()
    wrong = replace(ring, r=ring.r[:1], z=ring.z[:1])  # type: ignore[arg-type]
    places = [one.place for one in _ring_faults(wrong, "parameters")]
    assert places == ["parameters.ring_r_mm", "parameters.ring_z_mm"]


def test_the_follow_up_rod_is_the_fourth_equation_of_the_position() -> None:
    """dP_t - r dpsi: 1 for a move along e_t, -1 for r dpsi, 0 where the plane follows it."""
    manipulator = replace(Manipulator(), follow_up="rod")
    rows = _rows(manipulator, np.array([0.4, 0.5]), np.array([0.2, 0.25]))
    fourth = rows["position with the follow-up rod"][:, 3]
    np.testing.assert_array_equal(fourth @ [0.0, 1.0, 0.0, 0.0], 1.0)
    np.testing.assert_array_equal(fourth @ [0.0, 0.0, 0.0, 1.0], -1.0)
    np.testing.assert_array_equal(fourth @ [1.0, 0.0, 1.0, 0.0], 0.0)


@pytest.mark.parametrize("drive", [1, 2, 3])
def test_a_drive_gives_way_also_where_it_is_the_only_one(drive: int) -> None:
    """Its zero alone is changed."""
    poses = (np.array([0.45]), np.array([0.2]), np.array([0.7]))
    errors = np.zeros(63)
    moved = changed_errors(Manipulator(), *poses, errors, {f"drive_sag_{drive}": np.array([0.1])})
    assert np.flatnonzero(moved[0]).tolist() == [21 * (drive - 1) + 7]


def test_free_errors_of_a_pose_are_within_half_a_milliradian_or_a_tenth_of_a_millimetre() -> None:
    bounds = set(ManipulatorPose.free.values())
    assert bounds == {0.5, 100.0}
    for name, bound in ManipulatorPose.free.items():
        assert (bound == 0.5) == name.endswith("_mrad"), name
