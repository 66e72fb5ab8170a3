"""Manipulator: every fault of a ring is named, every coordinate of a pose has its own number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tolevo.models.manipulator.faults import _of_ring
from tolevo.models.manipulator.geometry import TaskRing
from tolevo.models.manipulator.nonlinear import _poses


def test_both_ends_of_a_ring_are_named_where_both_are_wrong() -> None:
    ring = TaskRing()
    wrong = replace(ring, r=ring.r[:1], z=ring.z[:1])  # type: ignore[arg-type]
    places = [one.place for one in _of_ring(wrong, "parameters")]
    assert places == ["parameters.ring_r_mm", "parameters.ring_z_mm"]


def test_poses_of_a_ring_fill_its_volume_evenly() -> None:
    """Mean r^2, z, phi and their covariances of a grid of 30^3 points, by the integrals."""
    ring = TaskRing()
    one = (np.arange(30) + 0.5) / 30
    points = np.stack(np.meshgrid(one, one, one), axis=-1).reshape(-1, 3)
    r, z, phi = _poses(ring, points, "rms_volume")
    (low, high), (bottom, top) = ring.r, ring.z
    assert np.mean(r**2) == pytest.approx(0.5 * (low**2 + high**2), rel=1e-12)
    assert np.mean(z) == pytest.approx(0.5 * (bottom + top), rel=1e-12)
    assert np.mean(phi) == pytest.approx(np.pi, rel=1e-12)
    assert np.abs(np.corrcoef([r**2, z, phi]) - np.eye(3)).max() < 1e-12
