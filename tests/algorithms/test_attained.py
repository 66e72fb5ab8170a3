"""The hypervolume after each batch."""

from __future__ import annotations

import numpy as np
import pytest

from tolevo.algorithms.archive import Attained, hypervolume, nondominated


def batches(objectives: int) -> list[np.ndarray]:
    """Batches that get better; coordinates are rounded so that some are equal, one is empty."""
    rng = np.random.default_rng(3)
    sizes = [0, 25, 1, 0, *rng.integers(1, 40, 40)]
    return [
        np.round(rng.random((int(size), objectives)) ** (0.5 + 0.02 * at) * 1.8, 2) for at, size in enumerate(sizes)
    ]


@pytest.mark.parametrize("objectives", [1, 2, 3])
def test_values_and_front_are_those_of_all_that_was_seen(objectives: int) -> None:
    """Against moocore; sums in another order differ by rounding."""
    box = np.zeros(objectives), np.linspace(1.0, 1.5, objectives)
    attained, seen = Attained(objectives, lambda: box), np.empty((0, objectives))
    expected = []
    for batch in batches(objectives):
        attained.add(batch)
        seen = np.vstack([seen, batch])
        expected.append(hypervolume(seen, *box))
    np.testing.assert_allclose(attained.values(), expected, rtol=1e-12)
    front = seen[nondominated(seen)]
    assert sorted(attained.front.tolist()) == sorted(front.tolist())


@pytest.mark.parametrize("objectives", [2, 3])
def test_when_values_are_asked_for_does_not_change_them(objectives: int) -> None:
    """To the last bit: a run that reports, one that does not, and one that is resumed."""
    box = np.zeros(objectives), np.ones(objectives)
    late, early = (Attained(objectives, lambda: box) for _ in range(2))
    for at, batch in enumerate(batches(objectives)):
        late.add(batch)
        early.add(batch)
        assert len(early.values()) == at + 1
        if at == 20:
            resumed = Attained(objectives, lambda: box)
            resumed.restore(early.state())
            early = resumed
    assert late.values() == early.values()
    np.testing.assert_array_equal(late.front, early.front)


def test_the_box_is_not_asked_for_before_a_design_is_feasible() -> None:
    def none() -> tuple[np.ndarray, np.ndarray]:
        raise AssertionError

    attained = Attained(2, none)
    attained.add(np.empty((0, 2)))
    assert attained.values() == [0.0]
