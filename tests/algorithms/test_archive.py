"""The bounded archive."""

from __future__ import annotations

import numpy as np

from tolevo.algorithms.archive import GROWTH, Archive, lowest_ranks, nondominated


def filled(archive: Archive, batches: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random batches, one fifth of the designs infeasible; all designs and objectives."""
    rng = np.random.default_rng(seed)
    x, f = rng.random((batches, 20, 3)), rng.random((batches, 20, 2))
    v = np.maximum(rng.random((batches, 20)) - 0.8, 0.0)
    for batch in zip(x, f, v, strict=True):
        archive.add(*batch)
    feasible = v.ravel() <= 0.0
    return x.reshape(-1, 3)[feasible], f.reshape(-1, 2)[feasible]


def test_memory_is_bounded_and_every_front_point_is_kept() -> None:
    archive = Archive(3, 2, room=50)
    _, f = filled(archive, 200)
    _, kept = archive.arrays()
    assert 50 <= len(kept) <= GROWTH * 50 + 20
    best = {tuple(row) for row in f[nondominated(f)].tolist()}
    assert best <= {tuple(row) for row in kept.tolist()}


def test_more_front_points_than_room_are_all_kept() -> None:
    archive = Archive(1, 2, room=10)
    t = np.random.default_rng(0).random(500)
    for part in np.split(t, 50):
        archive.add(part[:, None], np.column_stack([part, 1.0 - part]), np.zeros(10))
    assert len(archive.arrays()[0]) == 500


def test_miss_is_the_least_violating_until_something_is_feasible() -> None:
    archive = Archive(1, 2)
    f = np.zeros((2, 2))
    archive.add(np.array([[1.0], [2.0]]), f, np.array([0.5, 0.2]))
    archive.add(np.array([[3.0], [4.0]]), f, np.array([0.2, 0.3]))
    assert archive.miss.tolist() == [[2.0]]
    assert not len(archive.arrays()[0])
    archive.add(np.array([[5.0], [6.0]]), f, np.array([0.1, 0.0]))
    assert archive.miss.tolist() == [[6.0]]


def test_lowest_ranks_are_distinct_and_in_order() -> None:
    x = np.array([[1.0], [2.0], [1.0], [3.0], [4.0], [-0.0], [0.0]])
    f = np.array([[1.0, 1.0], [0.0, 2.0], [1.0, 1.0], [3.0, 3.0], [4.0, 4.0], [9.0, 9], [9, 9]])
    assert lowest_ranks(x, f, 10).tolist() == [0, 1, 3, 4, 5]
    assert lowest_ranks(x, f, 3).tolist() == [0, 1, 3]
    assert lowest_ranks(x, f, 1).tolist() == [0, 1]
    assert lowest_ranks(x[:0], f[:0], 3).tolist() == []


def test_restored_archive_goes_on_equally() -> None:
    archive, other = Archive(3, 2, room=50), Archive(3, 2, room=50)
    filled(archive, 30)
    other.restore(archive.state())
    for one in (archive, other):
        filled(one, 30, seed=5)
    for left, right in zip(archive.arrays(), other.arrays(), strict=True):
        np.testing.assert_array_equal(left, right)
