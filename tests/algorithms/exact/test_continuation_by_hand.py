"""Branches and continuation along a front that is known: f_1 = c / f_2, a straight line in
logarithms.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.exact.epsilon import (
    BEATEN,
    END,
    RATIO,
    _best_branch_points,
    _improve_nonconvex_points,
    _promising_integer_sets,
    _solve_coarse_levels,
    _solve_level,
    _value,
    _widest_gap,
    nondominated_feasible_designs,
)
from tolevo.algorithms.exact.local import NEARLY, Branch

RUN: Any = SimpleNamespace(phase=lambda *_: None, problem=SimpleNamespace(finer=lambda: None))


class Hyperbola(Branch):
    """Solves c / v at levels v of a range at once; the coordinate is v itself.

    `poor` has factors of what is found at a level from a start that is further away than a share
    of 0.2 of it. `asked` holds objective, start and limit of every solution.
    """

    def __init__(self, c: float, low: float, high: float) -> None:
        self.c, self.low, self.high = c, low, high
        self.unit = np.ones(2)
        self.y, self.f, self.barren = [], [], set()
        self.poor: dict[float, float] = {}
        self.asked: list[tuple[int, float, float]] = []

    def on(self, problem: object) -> Hyperbola:
        other = Hyperbola(self.c, self.low, self.high)
        other.asked = self.asked
        return other

    def tightest(self, y: np.ndarray) -> np.ndarray:
        return np.full_like(y, self.low)

    def starts(self, run: Any) -> np.ndarray:
        return np.array([[self.high]])

    def minimise(self, objective: int, start: np.ndarray, limit: np.ndarray) -> np.ndarray | None:
        self.asked.append((objective, float(start[0]), float(limit[1 - objective])))
        v = min(limit[1], self.high) if objective == 0 else max(self.low, self.c / limit[0])
        if v < self.low:
            return None
        far = abs(start[0] - v) > 0.2 * v
        return self.put(float(v), self.poor.get(round(float(v), 9), 1.0) if far else 1.0)

    def put(self, v: float, factor: float = 1.0) -> np.ndarray:
        f = np.array([factor * self.c / v, v])
        at = int(np.searchsorted([one[1] for one in self.f], v))
        self.f.insert(at, f)
        self.y.insert(at, np.array([v]))
        return f


def filled(c: float, levels: np.ndarray) -> Hyperbola:
    """Its points at some levels."""
    found = Hyperbola(c, float(min(levels)), float(max(levels)))
    for level in levels:
        found.put(float(level))
    return found


@pytest.mark.parametrize(("low", "high", "count"), [(0.1, 2.0, 12), (1.0, 1.2, 3)])
def test_coarse_levels_go_from_the_loosest_to_the_tight_end(low: float, high: float, count: int) -> None:
    """From 1.03 times the least one, in ratios of no less than 0.75, and three at least."""
    branch = Hyperbola(5.0, low, high)
    levels = _solve_coarse_levels(RUN, [branch])
    found = np.array(sorted(levels))
    assert len(found) == count
    np.testing.assert_allclose(found[[0, -1]], [END * low, high])
    ratios = found[:-1] / found[1:]
    np.testing.assert_allclose(ratios, ratios[0])
    assert ratios[0] >= RATIO
    np.testing.assert_allclose([levels[v][0] for v in found], 5.0 / found)
    assert [one[0] for one in branch.asked].count(1) == 3  # the cheapest, and twice the end


def test_levels_step_down_from_the_tightest_point_so_far() -> None:
    """Each is 0.75 of the second objective of the one before, from where that one ended."""
    branch = Hyperbola(1.0, 0.3, 1.0)
    _solve_coarse_levels(RUN, [branch])
    down = [(start, limit) for objective, start, limit in branch.asked[2:] if objective == 0]
    steps = [one for one in down if one[1] <= RATIO * one[0] + 1e-12]
    assert steps[:4] == [pytest.approx((RATIO**k, RATIO ** (k + 1))) for k in range(4)]


def test_of_two_sets_each_level_has_the_value_of_both() -> None:
    """One is cheaper, and ends at 0.4; beyond it has no value."""
    one, other = Hyperbola(1.0, 0.4, 2.0), Hyperbola(1.5, 0.2, 2.0)
    levels = _solve_coarse_levels(RUN, [one, other])
    for level, values in levels.items():
        known = 1.0 / level if level >= 0.4 else np.inf
        assert values == pytest.approx([known, 1.5 / level])
        (best, at), *others = _best_branch_points([one, other], level)
        assert not others  # the next one is far dearer
        assert best is (one if level >= 0.4 else other)
        assert best.f[at][1] == pytest.approx(level) or best.f[at][0] == pytest.approx(min(values))


def test_a_level_that_a_set_does_not_reach_is_not_solved() -> None:
    branch = filled(1.0, np.array([0.5, 1.0, 2.0]))
    assert _solve_level(branch, 0.4) == np.inf and not branch.asked
    assert _solve_level(branch, 1.5) == pytest.approx(1.0 / 1.5)
    assert branch.asked == [(0, 1.5, 1.5)]  # begun half-way between the neighbours


def test_a_level_that_is_no_better_than_the_tighter_one_is_solved_again_from_there() -> None:
    branch = filled(1.0, np.array([1.0, 1.1, 2.0]))
    branch.poor = {1.15: 1.2}
    branch.y[2] = np.array([9.0])  # a start that is far off
    assert _solve_level(branch, 1.15) == pytest.approx(1.0 / 1.15)
    assert [start for _, start, _ in branch.asked][1] == pytest.approx(1.1)


def test_a_value_counts_at_a_level_and_nearly_there() -> None:
    branch = filled(1.0, np.array([0.5, 1.0, 2.0]))
    assert _value(branch, 1.0) == 1.0 and _value(branch, 0.4) == np.inf
    assert _value(branch, 1.0 - 0.5 * NEARLY) == 1.0 and _value(branch, 1.0 - 2 * NEARLY) == 2.0


# ------------------------------------------------------------- points above the chord


@pytest.mark.parametrize("bent", [1, 2, 3])
def test_a_point_above_the_chord_of_its_neighbours_is_solved_from_there(bent: int) -> None:
    """Five uneven levels of a straight line, one of which is 5 % too dear."""
    at = np.array([0.5, 0.6, 0.66, 0.75, 1.0])
    branch = filled(3.0, at)
    branch.f[bent] = branch.f[bent] * np.array([1.05, 1.0])
    levels = {float(v): np.array([f[0]]) for v, f in zip(at, branch.f, strict=True)}
    assert _improve_nonconvex_points([branch], levels)
    assert levels[float(at[bent])][0] == pytest.approx(3.0 / at[bent])
    own = [start for _, start, limit in branch.asked if limit == at[bent]]
    assert own == pytest.approx([at[bent - 1], at[bent + 1]])
    assert not _improve_nonconvex_points([branch], levels)


def test_nothing_is_above_a_chord_of_two_or_on_a_straight_line() -> None:
    at = np.array([0.5, 0.6, 0.9, 1.0])
    branch = filled(3.0, at)
    levels = {float(v): np.array([3.0 / v]) for v in at}
    assert not _improve_nonconvex_points([branch], levels)
    branch.f[0] = branch.f[0] * 1.5
    two = {0.5: np.array([9.0]), 1.0: np.array([3.0])}
    assert not _improve_nonconvex_points([branch], two)
    assert not branch.asked


def test_a_point_is_solved_by_the_set_of_its_neighbour_as_well() -> None:
    """At the level in the middle the other set is counted, 4 % too dear."""
    at = np.array([0.5, 0.7, 1.0])
    one, other = filled(1.0, at[[0, 2]]), filled(1.04, at[[1]])
    one.low, other.low, other.high = 0.1, 0.1, 2.0
    levels = {0.5: np.array([2.0, np.inf]), 0.7: np.array([np.inf, 1.04 / 0.7]),
              1.0: np.array([1.0, np.inf])}  # fmt: skip
    assert _improve_nonconvex_points([one, other], levels)
    assert levels[0.7] == pytest.approx([1.0 / 0.7, 1.04 / 0.7])


# ------------------------------------------------------------- where to go on


def test_the_widest_gap_is_the_largest_rectangle() -> None:
    """Of 1/v at 0.5, 1, 2, 4: (2 - 1) 0.5, (1 - 0.5) 1, (0.5 - 0.25) 2; the first steps on ties."""
    levels = {v: np.array([1.0 / v, 9.0]) for v in (0.5, 1.0, 2.0, 4.0)}
    levels[5.0] = np.array([0.1, 9.0])
    areas = {(0.5, 1.0): 0.5, (1.0, 2.0): 0.5, (2.0, 4.0): 0.5, (4.0, 5.0): 0.15}
    assert areas[_widest_gap(levels, np.ones(2))] == max(areas.values())
    levels[1.0] = np.array([1.2, 9.0])  # (2 - 1.2) 0.5 and (1.2 - 0.5) 1
    assert _widest_gap(levels, np.ones(2)) == (1.0, 2.0)


def test_a_set_is_promising_within_its_share_of_the_best() -> None:
    values = np.array([1.0, 1.0 + 0.9 * BEATEN, 1.0 + 1.1 * BEATEN, np.inf])
    assert _promising_integer_sets(values).tolist() == [True, True, False, False]


# ------------------------------------------------------------- the largest rectangle of a branch


def test_a_branch_is_halved_where_its_rectangle_is_largest_from_half_way() -> None:
    """Of 1/v at 0.5, 2 and 3 the first rectangle is 1.5 by 1.5, the other one 1/6 by 1."""
    branch = filled(1.0, np.array([0.5, 2.0, 3.0]))
    assert branch.widest() == pytest.approx((2.25, 0))
    assert branch.halve()
    assert branch.asked == [(0, 1.25, 1.25)]
    assert [f[1] for f in branch.f] == [0.5, 1.25, 2.0, 3.0]
    assert not branch.barren


def test_a_rectangle_in_which_nothing_is_found_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    branch = filled(1.0, np.array([0.5, 2.0, 3.0]))
    monkeypatch.setattr(Hyperbola, "minimise", lambda *_: None)
    assert branch.halve() and branch.barren == {(0.5, 2.0)}
    assert branch.widest() == pytest.approx((1.0 / 6.0, 1))
    monkeypatch.setattr(Hyperbola, "minimise", lambda *_: np.array([0.5, 2.0]))  # at its end
    assert branch.halve() and branch.barren == {(0.5, 2.0), (2.0, 3.0)}
    assert not branch.halve()
    assert filled(1.0, np.array([0.5])).widest() == (0.0, 0)


def test_a_rectangle_below_which_others_are_is_left_out() -> None:
    """Its best corner is (0.5, 0.5)."""
    branch = filled(1.0, np.array([0.5, 2.0, 3.0]))
    assert branch.widest(np.array([[0.4, 0.4]]))[1] == 1
    for beside in ([0.4, 0.6], [0.5, 0.5]):
        assert branch.widest(np.array([beside]))[1] == 0


def test_what_comes_out_dearer_and_looser_on_fresh_units_is_no_end_of_a_front() -> None:
    """(9, 5.9) is dominated by (4, 1); a point that breaks a limit dominates nothing, and is left out by far."""
    f = np.array([[1.0, 4.0], [2.0, 2.0], [4.0, 1.0], [9.0, 5.9], [0.5, 0.5], [0.4, 0.6]])
    g = np.array([[0.0], [-1.0], [0.0], [0.0], [5e-4], [1.0]])
    fresh: Any = SimpleNamespace(tested=lambda x: (f[: len(x)], g[: len(x)]))
    kept = nondominated_feasible_designs(fresh, np.arange(6.0)[:, None])
    assert kept[:, 0].tolist() == [0.0, 1.0, 2.0, 4.0]
    lost: Any = SimpleNamespace(tested=lambda x: (f[5:], g[5:]))
    assert len(nondominated_feasible_designs(lost, np.zeros((1, 1)))) == 1  # where none keeps the limit
    assert len(nondominated_feasible_designs(fresh, np.empty((0, 1)))) == 0
