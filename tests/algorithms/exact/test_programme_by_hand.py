"""Programmes whose answer follows by hand: limits that cannot be kept, trades, and starts.

Every part costs b/t; values are linear parts and roots of squares. What SLSQP is not needed for is
asked without it, and what it may not decide is asked with one that goes nowhere.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.exact.combination import Combination
from tolevo.algorithms.exact.programme import Programme
from tolevo.algorithms.exact.slsqp import LocalOptimum
from tolevo.models.costs import Reciprocal
from tolevo.problems.forms import Feature, Form, Way

SLSQP = "tolevo.algorithms.exact.programme.slsqp"
ASCEND = "tolevo.algorithms.exact.programme.ascend"
INF = np.inf
Part = tuple[float, float, tuple[float, ...], tuple[float, ...], float]


@pytest.fixture(autouse=True)
def without_prices(monkeypatch: pytest.MonkeyPatch) -> None:
    """What SLSQP does is the subject here: no programme is solved by prices before it."""
    monkeypatch.setattr(Programme, "_solved_by_prices", lambda self, limits: None)


def programme(*parts: Part, correlation: float | None = None) -> Programme:
    """Of parts (low, high, linear, spread, b); a correlation is that of the first two."""
    features = tuple(Feature(f"t{at}", (Way(Reciprocal(0.0, b), low, high, linear, spread),))
                     for at, (low, high, linear, spread, b) in enumerate(parts))  # fmt: skip
    rows, matrix = len(parts[0][2]), None
    if correlation is not None:
        matrix = np.eye(len(parts))
        matrix[0, 1] = matrix[1, 0] = correlation
    names = tuple(f"v{row}" for row in range(rows))
    form = Form(names, features, np.zeros(rows), np.zeros(rows), "", correlation=matrix)
    return Programme(Combination(form, (0,) * len(parts)))


def unused(*_: object, **__: object) -> Any:
    pytest.fail("not needed here")


def ends_at(t: float, multiplier: float = 0.0) -> Callable[..., LocalOptimum]:
    """SLSQP that ends at one part's t whatever is asked: with one part the unit of ln t is 1."""

    def found(*given: Any) -> LocalOptimum:
        margins, start = given[2], given[4]
        return LocalOptimum(np.full(len(start), np.log(t)), np.full(len(margins(start)), multiplier))

    return found


OPPOSED = (0.1, 2.0, (0.0,), (1.0,), 0.1), (0.3, 2.0, (0.0,), (1.0,), 0.1)
"""S^2 = t1^2 + t2^2 - 1.8 t1 t2: 0.214 at the tightest, at least 0.3 sqrt(0.19) = 0.1308, at
t1 = 0.27."""


@pytest.mark.parametrize("loose", [2.0, INF])
def test_limits_that_the_loosest_keep_need_no_search(monkeypatch: pytest.MonkeyPatch, loose: float) -> None:
    monkeypatch.setattr(SLSQP, unused)
    own = programme((0.5, 2.0, (1.0,), (0.0,), 3.0))
    limit = np.array([loose])
    found = own.least_cost(limit[None, :])
    assert found.cost[0] == found.bound[0] == 1.5
    assert own.allocation(limit) == [2.0]
    assert own.kept_allocation(limit, np.array([0.7])) == [2.0]


@pytest.mark.parametrize("correlation", [None, 0.5])
def test_what_the_tightest_break_is_impossible_where_nothing_compensates(
    monkeypatch: pytest.MonkeyPatch, correlation: float | None
) -> None:
    monkeypatch.setattr(SLSQP, unused)
    own = programme(*OPPOSED, correlation=correlation)
    limit = np.array([0.3])
    found = own.least_cost(limit[None, :])
    assert np.isinf(found.cost[0]) and np.isinf(found.bound[0])
    assert own.kept_allocation(limit, np.array([0.1, 0.3])) is None


@pytest.mark.parametrize(("limit", "possible"), [(0.15, True), (0.1309, True), (0.13, False)])
def test_deviations_that_compensate_each_other(limit: float, possible: bool) -> None:
    own = programme(*OPPOSED, correlation=-0.9)
    found = own.least_cost(np.array([[limit]]))
    kept = own.kept_allocation(np.array([limit]), np.array([1.0, 1.0]))
    near = own.allocation(np.array([limit]))
    if not possible:
        assert np.isinf(found.cost[0]) and np.isinf(found.bound[0])
        assert kept is None and near is None
        return
    assert kept is not None and near is not None
    for t in (found.t[0], kept):
        assert t[0] ** 2 + t[1] ** 2 - 1.8 * t[0] * t[1] <= limit**2 * (1.0 + 1e-12)
    first, second = np.meshgrid(np.linspace(0.1, 2.0, 1500), np.linspace(0.3, 0.7, 1500))
    fits = first**2 + second**2 - 1.8 * first * second <= limit**2
    if np.any(fits):
        least = np.min((0.1 / first + 0.1 / second)[fits])
        assert found.bound[0] <= least
        assert found.cost[0] == pytest.approx(least, rel=5e-3)
    assert found.bound[0] == pytest.approx(found.cost[0], rel=1e-6)


@pytest.mark.parametrize("share", [0.5, 0.0])
def test_a_search_that_ends_nowhere_proves_nothing(monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    """0.15 can be kept: tangents at any point, with any price, must not say that it cannot."""
    own = programme(*OPPOSED, correlation=-0.9)

    def nowhere(*_: object) -> LocalOptimum:
        return LocalOptimum(np.array([share, 1.0 - share, 0.0]), np.ones(1))

    monkeypatch.setattr(SLSQP, nowhere)
    found = own.least_cost(np.array([[0.15]]))
    assert np.isinf(found.cost[0])
    assert found.bound[0] == pytest.approx(0.05 + 0.05)  # of both at their loosest


def test_a_trade_beside_deviations_that_compensate_each_other() -> None:
    """A shift of 1 raises one value and lowers the other; 0.27 and 0.3 leave S = 0.1308."""
    first, second = ((low, high, (0.0, 0.0), (1.0, 1.0), b) for low, high, _, _, b in OPPOSED)
    own = programme(first, second, (0.1, 2.0, (1.0, -1.0), (0.0, 0.0), 1e-9), correlation=-0.9)
    found = own.least_cost(np.array([[1.15, -0.85]]))
    assert found.cost[0] <= 0.1 / 0.27 + 0.1 / 0.3
    t = found.t[0]
    spread = np.sqrt(t[0] ** 2 + t[1] ** 2 - 1.8 * t[0] * t[1])
    assert spread + t[2] <= 1.15 + 1e-12 and spread - t[2] <= -0.85 + 1e-12


UP_DOWN: Part = (0.1, 2.0, (1.0, -1.0), (0.0, 0.0), 1e-9)
ROUGH: Part = (0.1, 2.0, (0.0, 0.0), (1.0, 1.0), 0.1)


def test_what_one_feature_trades_is_found_without_a_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Between 0.99 and 1.01, where 33 places of the range are 0.06 apart."""
    monkeypatch.setattr(Programme, "least_excess", unused)
    own = programme(UP_DOWN, ROUGH)
    limit = np.array([1.03 + 0.12, -1.03 + 0.12])
    kept = own.kept_allocation(limit, np.array([1.0, 0.1]))
    assert kept is not None
    assert kept[0] + kept[1] <= limit[0] and kept[1] - kept[0] <= limit[1]
    assert kept[1] == pytest.approx(0.12, rel=1e-4)


@pytest.mark.parametrize("limit", [[2.5, -2.0], [1.09, -0.91], [0.5, -0.5]])
def test_a_trade_beyond_the_range_is_none(monkeypatch: pytest.MonkeyPatch, limit: list[float]) -> None:
    """The value that falls is -2 + 0.1 at least, and both add up to 0.2 at least."""
    monkeypatch.setattr(SLSQP, unused)
    found = programme(UP_DOWN, ROUGH).least_cost(np.array([limit]))
    assert np.isinf(found.cost[0]) and np.isinf(found.bound[0])


def test_one_trade_beside_a_part_that_only_rises(monkeypatch: pytest.MonkeyPatch) -> None:
    """A part without spread that lowers nothing is no second trade."""
    monkeypatch.setattr(SLSQP, unused)
    rises: Part = (0.1, 2.0, (1.0, 1.0), (0.0, 0.0), 0.1)
    own = programme(UP_DOWN, rises, ROUGH)
    assert own.allocation(np.array([1.2 + 0.09, -0.8 + 0.09 - 0.2])) is None


def test_a_requirement_that_the_trade_does_not_move(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SLSQP, unused)
    own = programme((0.1, 2.0, (1.0, -1.0, 0.0), (0.0, 0.0, 0.0), 1e-9),
                    (0.1, 2.0, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.1))  # fmt: skip
    assert own.allocation(np.array([1.2, -0.8, 0.09])) is None


def test_a_trade_with_spread_beside_one_without() -> None:
    """B = -0.9 f <= -0.45 asks for f = 0.5 at least, A = 1.1 f - s <= -1.4 then for s = 1.95."""
    trades: Part = (0.1, 2.0, (-1.0, 0.0), (0.0, 0.0), 0.1)
    both: Part = (0.1, 1.1, (1.0, -1.0), (0.1, 0.1), 0.1)
    found = programme(trades, both).least_cost(np.array([[-1.4, -0.45]]))
    f = 0.6 / 1.1  # the loosest, with s = 2
    assert found.cost[0] == pytest.approx(0.1 / 2.0 + 0.1 / f, rel=1e-8)
    assert found.bound[0] == pytest.approx(found.cost[0], rel=1e-8)


def test_a_trade_with_spread_is_given_its_whole_range(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SLSQP, unused)
    trades: Part = (0.1, 2.0, (-1.0, 0.0), (0.0, 0.0), 0.1)
    both: Part = (0.1, 1.1, (1.0, -1.0), (0.1, 0.1), 0.1)
    assert programme(trades, both).allocation(np.array([-1.4, -1.2])) is None  # -1.1 + ... at best


def test_two_trades_are_taken_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each lowers one value, to -1.5: both beyond three quarters of their ranges, and the spread
    of the third at its tightest."""
    monkeypatch.setattr(Programme, "least_excess", unused)
    own = programme((0.1, 2.1, (-1.0, 0.0), (0.0, 0.0), 0.1),
                    (0.1, 2.1, (0.0, -1.0), (0.0, 0.0), 0.1),
                    (0.1, 90.0, (0.0, 0.0), (1.0, 1.0), 0.1))  # fmt: skip
    limit = np.array([-1.5, -1.5])
    kept = own.kept_allocation(limit, np.array([2.0, 2.0, 0.1]))
    assert kept is not None
    assert kept[2] - kept[0] <= -1.5 and kept[2] - kept[1] <= -1.5
    found = own.least_cost(limit[None, :])
    assert found.cost[0] == pytest.approx(0.2 / 2.1 + 0.1 / 0.6, rel=1e-8)  # t1 = t2 = 2.1


def test_a_limit_of_zero_is_a_limit() -> None:
    """-t1 + t2 <= 0 with t1 in [0.1, 2], its spread 0.5 t1: t2 = 0.5 t1 at most."""
    own = programme((0.1, 2.0, (-1.0,), (0.5,), 0.1), (0.3, 3.0, (1.0,), (0.0,), 0.1))
    found = own.least_cost(np.zeros((1, 1)))
    np.testing.assert_allclose(found.t[0], [2.0, 1.0], rtol=1e-7)
    t, _ = own.least_excess(np.zeros(1))
    np.testing.assert_allclose(t, [2.0, 0.3], rtol=1e-6)


# -------------------------------------------------------------------- starts


def test_a_known_start_is_begun_from(monkeypatch: pytest.MonkeyPatch) -> None:
    """V = t <= 1: one part, b/t = 3."""
    own = programme((0.5, 2.0, (1.0,), (0.0,), 3.0))
    limit = np.ones((1, 1))
    assert own.least_cost(limit, np.full((1, 1), np.nan)).cost[0] == pytest.approx(3.0, rel=1e-9)
    monkeypatch.setattr(Programme, "_between", unused)
    for start in (0.7, 0.0):  # what is outside of the range is moved into it
        begun = np.full(1, start)
        assert own.least_cost(limit, begun[None, :]).cost[0] == pytest.approx(3.0, rel=1e-9)
        near, kept = own.allocation(limit[0], begun), own.kept_allocation(limit[0], begun)
        assert near is not None and kept is not None
        assert near[0] == pytest.approx(1.0, rel=2e-5)
        assert kept[0] == pytest.approx(1.0, rel=1e-4)


@pytest.mark.parametrize(("limit", "first"), [(48.0, 32.0), (1.5, 1.0), (0.5, 1.0), (7e4, 0.0)])
def test_a_search_begins_at_the_loosest_of_17_places_that_keep(
    monkeypatch: pytest.MonkeyPatch, limit: float, first: float
) -> None:
    """Powers of two from 1 to 2^16 keep t <= limit."""
    begun: list[float] = []

    def noted(*given: Any) -> LocalOptimum:
        begun.append(float(np.exp(given[4][0])))
        return LocalOptimum(given[4], np.zeros(1))

    monkeypatch.setattr(SLSQP, noted)
    own = programme((1.0, 2.0**16, (1.0,), (0.0,), 1.0))
    own.allocation(np.array([limit]))
    assert begun == ([pytest.approx(first)] if first else [])


@pytest.mark.parametrize(
    ("limit", "t", "taken"),
    [(100.0, 100.0005, True), (100.0, 100.01, False), (0.01, 0.01000005, True), (0.01, 0.010001, False)],
)
def test_what_is_near_a_limit(monkeypatch: pytest.MonkeyPatch, limit: float, t: float, taken: bool) -> None:
    """1e-5 of it, in any unit."""
    monkeypatch.setattr(SLSQP, ends_at(t))
    found = programme((1e-3, 200.0, (1.0,), (0.0,), 1.0)).allocation(np.array([limit]))
    assert (found is not None) == taken


def test_nothing_to_move() -> None:
    fixed = programme((1.0, 1.0, (1.0,), (0.0,), 1.0))
    assert fixed.allocation(np.array([0.9])) is None
    assert fixed.allocation(np.array([1.0 - 1e-6])) == [1.0]


# -------------------------------------------------------------------- bounds and what keeps limits


def test_a_bound_is_no_more_than_its_prices_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """V = t <= 1 with 3/t: a price l proves 2 sqrt(3 l) - l for t = sqrt(3 / l) in the range.

    SLSQP states prices in units of twice the fall of the cost, 6. 60 and 0 ask for the ends: what
    they prove is below the cost without limits, 1.5.
    """
    own, limit = programme((0.5, 2.0, (1.0,), (0.0,), 3.0)), np.ones((1, 1))
    for price, bound in ((3.0, 3.0), (2.0, 2.0 * np.sqrt(6.0) - 2.0), (60.0, 1.5), (0.0, 1.5)):
        with monkeypatch.context() as patched:
            patched.setattr(SLSQP, ends_at(1.0, price / 6.0))
            patched.setattr(ASCEND, lambda dual, start: start)
            found = own.least_cost(limit, limit)
        assert found.cost[0] == 3.0
        assert found.bound[0] == pytest.approx(bound, rel=1e-9)
        assert found.bound[0] <= 3.0
        if price:
            with monkeypatch.context() as patched:
                patched.setattr(SLSQP, ends_at(1.0, price / 6.0))
                improved = own.least_cost(limit, limit).bound[0]
            assert improved == pytest.approx(3.0, rel=1e-6)


def test_what_breaks_a_limit_is_drawn_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside a limit of 0 on what is 0 anyway."""
    monkeypatch.setattr(SLSQP, ends_at(1.4))
    own = programme((0.5, 2.0, (1.0, 0.0), (0.0, 0.0), 3.0))
    found = own.least_cost(np.array([[1.1, 0.0]]))
    assert found.t[0, 0] == pytest.approx(1.1, rel=1e-12)
    assert found.t[0, 0] <= 1.1


def test_what_is_drawn_back_stays_in_its_range(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rounding leaves some of 400 points on their chords just beyond a limit."""
    monkeypatch.setattr(SLSQP, ends_at(2.0))
    own, start = programme((0.5, 3.0, (1.0,), (0.0,), 3.0)), np.ones(1)
    for limit in np.linspace(0.55, 1.1, 400):
        t = own.kept_allocation(np.array([limit]), start)
        assert t is not None
        assert 0.5 <= t[0] <= limit


def test_costs_that_do_not_fall() -> None:
    """The first is free, the second is 0.2/t: 0.5 t1 + t2 <= 1 leaves it 0.95."""
    free: Part = (0.1, 2.0, (0.5,), (0.0,), 0.0)
    own = programme(free, (0.1, 2.0, (1.0,), (0.0,), 0.2))
    assert own.least_cost(np.ones((1, 1))).cost[0] == pytest.approx(0.2 / 0.95, rel=1e-8)
    found = programme(free).least_cost(np.full((1, 1), 0.5))
    assert found.cost[0] == 0.0
    assert found.t[0, 0] <= 1.0


def test_what_costs_nothing_is_bounded_by_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SLSQP, ends_at(0.5, 1.0))
    found = programme((0.1, 2.0, (1.0,), (0.0,), 0.0)).least_cost(np.ones((1, 1)))
    assert found.cost[0] == found.bound[0] == 0.0


def test_limits_are_kept_to_the_last_digit() -> None:
    """And so are ranges: parts that no limit asks for are at their loosest."""
    rng = np.random.default_rng(5)
    for _ in range(6):
        high = rng.uniform(1.0, 3.0, 12)
        asked = rng.uniform(0.3, 2.0, 12) * (np.arange(12) < 6)
        own = programme(*((0.01, float(h), (0.0, 0.1 * float(a)), (float(a), float(a)), 0.1)
                          for h, a in zip(high, asked, strict=True)))  # fmt: skip
        limits = rng.uniform(0.3, 0.6, (20, 2))
        tolerances = own.least_cost(limits).t
        values = own.combination.values(tolerances)
        for t, limit, value in zip(tolerances, limits, values, strict=True):
            alone = own.combination.values(t[None, :])[0]
            np.testing.assert_array_equal(alone, value)  # whatever batch it is in
            assert np.all(alone <= limit)
            assert np.all(t <= high) and np.all(t >= 0.01)
            np.testing.assert_allclose(t[6:], high[6:], rtol=1e-9)
