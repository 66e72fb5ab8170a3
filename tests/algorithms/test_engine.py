"""The array engines against pymoo's parts and pymoo's results."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pymoo.algorithms.moo.gde3 import GDE3 as PymooGDE3
from pymoo.algorithms.moo.nsga2 import NSGA2 as PymooNSGA2
from pymoo.core.problem import Problem
from pymoo.operators.crossover.sbx import cross_sbx
from pymoo.operators.mutation.pm import PM, mut_pm
from pymoo.operators.sampling.rnd import FloatRandomSampling
from pymoo.operators.survival.rank_and_crowding.metrics import get_crowding_function
from pymoo.optimize import minimize
from scipy.stats import ks_2samp, mannwhitneyu

from tolevo import registry
from tolevo.algorithms.archive import hypervolume, ranks
from tolevo.algorithms.engine import (
    GDE3Engine,
    NSGA2Engine,
    Space,
    crossover,
    crowding_distances,
    differential_evolution_trials,
    draw_other_rows,
    mutate,
    survivors,
    tournament,
)
from tolevo.algorithms.engine_of_pymoo import ArrayGDE3, ArrayNSGA2
from tolevo.algorithms.settings import ENGINES

Array = NDArray[np.float64]
FACTORS = np.linspace(0.5, 2.0, 9)


class CostAndSpread(Problem):
    """Sum of a/t against the root sum of squares of s t, 9 parts; one limit on the spread."""

    def __init__(self, limit: float = 0.5, integer: bool = False) -> None:
        low, high = (1, 30) if integer else (0.01, 0.3)
        super().__init__(n_var=9, n_obj=2, n_ieq_constr=1, xl=low, xu=high,
                         vtype=int if integer else float)  # fmt: skip
        self.limit, self.unit = limit, 0.01 if integer else 1.0

    def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        t = x * self.unit
        spread = np.sqrt(((FACTORS[::-1] * t) ** 2).sum(axis=1))
        out["F"] = np.column_stack([(FACTORS / t).sum(axis=1), spread])
        out["G"] = spread[:, None] - self.limit


def space(problem: Problem) -> Space:
    return Space(problem.xl, problem.xu, np.full(9, problem.vtype is int), 2)


def dominates(a: Array, b: Array) -> bool:
    return bool(np.all(a <= b) and np.any(a < b))


def test_ranks_by_peeling() -> None:
    f = np.random.default_rng(0).integers(0, 6, size=(60, 3)).astype(float)
    left, expected, level = set(range(60)), np.full(60, -1), 0
    while left:
        best = {i for i in left if not any(dominates(f[j], f[i]) for j in left)}
        expected[list(best)] = level
        left, level = left - best, level + 1
    np.testing.assert_array_equal(ranks(f), expected)
    np.testing.assert_array_equal(ranks(np.array([[2.0], [1.0], [2.0]])), [1, 0, 1])


@pytest.mark.parametrize("objectives", [2, 3])
def test_crowding_is_that_of_pymoo(objectives: int) -> None:
    rng = np.random.default_rng(1)
    f = np.round(rng.random((120, objectives)), 2)
    if objectives == 3:
        f[100:] = f[:20]  # equal points
    f = f[np.lexsort(f.T[::-1])]
    rank = ranks(f)
    found = crowding_distances(f, rank)
    for level in np.unique(rank):
        rows = np.flatnonzero(rank == level)
        expected = get_crowding_function("cd").do(f[rows])
        np.testing.assert_allclose(found[rows], expected, rtol=1e-12)


def test_equal_points_of_two_objectives_share_the_gaps_of_one() -> None:
    """pymoo crosses the gaps before and after between two equal points; their sum is the same."""
    alone = np.column_stack([[0.0, 1.0, 3.0, 4.0], [5.0, 3.0, 2.0, 0.0]])
    twice = alone[[0, 1, 1, 2, 3]]
    level = np.zeros(5, dtype=np.int64)
    single, found = crowding_distances(alone, level[:4]), crowding_distances(twice, level)
    np.testing.assert_allclose(found[1:3].sum(), single[1])
    np.testing.assert_allclose(found[1:3], [0.5 * (1 / 4 + 2 / 5), 0.5 * (2 / 4 + 1 / 5)])
    theirs = get_crowding_function("cd").do(twice)
    np.testing.assert_allclose(found[1:3].sum(), theirs[1:3].sum())
    same = crowding_distances(np.ones((4, 2)), level[:4])
    np.testing.assert_array_equal(same, [np.inf, 0.0, 0.0, np.inf])


def test_feasible_points_survive_first_then_the_least_violating() -> None:
    f = np.array([[9.0, 9.0], [0.0, 0.0], [1.0, 2.0], [2.0, 1.0], [0.5, 0.5]])
    v = np.array([0.0, 0.3, 0.0, 0.0, 0.2])
    rng = np.random.default_rng(0)
    assert survivors(f, v, 4, rng)[0].tolist() == [2, 3, 0, 4]
    assert sorted(survivors(f, v, 2, rng)[0].tolist()) == [2, 3]
    assert survivors(f, v + 0.1, 2, rng)[0].tolist() == [0, 2]


def test_ends_of_a_front_survive() -> None:
    x = np.sort(np.random.default_rng(2).random(50))
    f = np.column_stack([x, 1.0 - x])
    rows, rank, crowding = survivors(f, np.zeros(50), 10, np.random.default_rng(0))
    assert {0, 49} <= set(rows.tolist())
    assert len(set(rows.tolist())) == 10
    assert not rank.any()
    assert np.isinf(crowding).sum() == 2


def test_crossover_is_distributed_as_pymoos() -> None:
    """Kolmogorov-Smirnov on 20,000 children of one pair, near a bound and in the middle."""
    box = Space(np.zeros(2), np.ones(2), np.zeros(2, dtype=bool), 2)
    first, second = np.tile([0.1, 0.4], (10_000, 1)), np.tile([0.3, 0.9], (10_000, 1))
    parents = np.concatenate([first, second])
    ours = crossover(parents, box, 1.0, 15.0, np.random.default_rng(0))
    eta, swap = np.full((10_000, 1), 15.0), np.full((10_000, 1), 0.5)
    theirs = cross_sbx(np.stack([first, second]), box.low, box.high, eta, 0.5, swap,
                       random_state=np.random.default_rng(1))  # fmt: skip
    for column in (0, 1):
        for half, other in zip((ours[:10_000], ours[10_000:]), theirs, strict=True):
            assert ks_2samp(half[:, column], other[:, column]).pvalue > 1e-3
    moved = ours[:10_000] + ours[10_000:]
    np.testing.assert_allclose(moved.mean(axis=0), [0.4, 1.3], atol=5e-3)


def test_no_crossover_leaves_the_parents() -> None:
    box = Space(np.zeros(3), np.ones(3), np.zeros(3, dtype=bool), 2)
    parents = np.random.default_rng(0).random((10, 3))
    found = crossover(parents, box, 0.0, 15.0, np.random.default_rng(0))
    np.testing.assert_array_equal(found, parents)
    assert found is not parents


def test_mutation_is_distributed_as_pymoos() -> None:
    box = Space(np.zeros(2), np.array([1.0, 2.0]), np.zeros(2, dtype=bool), 2)
    x = np.tile([0.02, 1.4], (20_000, 1))
    ours = mutate(x, box, 0.3, 20.0, np.random.default_rng(0))
    theirs = mut_pm(x, box.low, box.high, np.full(20_000, 20.0), np.full(20_000, 0.3), False,
                    random_state=np.random.default_rng(1))  # fmt: skip
    for column in (0, 1):
        assert ks_2samp(ours[:, column], theirs[:, column]).pvalue > 1e-3
    changed = (ours != x).mean(axis=0)
    np.testing.assert_allclose(changed, 0.3, atol=0.02)


def test_every_point_takes_part_in_as_many_tournaments() -> None:
    """Alone at the top, a point wins both of its tournaments, and the worst wins none."""
    f = np.column_stack([np.arange(10.0), np.arange(10.0)])
    winners = tournament(f, np.zeros(10), ranks(f), np.zeros(10), 10, np.random.default_rng(0))
    assert np.bincount(winners, minlength=10)[[0, 9]].tolist() == [2, 0]
    by_violation = tournament(f, np.arange(10.0)[::-1], ranks(f), np.zeros(10), 10, np.random.default_rng(0))
    assert np.bincount(by_violation, minlength=10)[[0, 9]].tolist() == [0, 2]
    flat = np.column_stack([np.arange(10.0), -np.arange(10.0)])
    crowded = np.r_[np.inf, np.arange(8.0), np.inf]
    by_crowding = tournament(flat, np.zeros(10), ranks(flat), crowded, 10, np.random.default_rng(0))
    counts = np.bincount(by_crowding, minlength=10)
    assert counts[[0, 9]].sum() in (3, 4)  # they may meet each other
    assert counts[1] == 0


def test_different_others_are_uniform() -> None:
    found = np.stack([draw_other_rows(6, 3, np.random.default_rng(seed)) for seed in range(4000)])
    assert np.all(found != np.arange(6)[:, None])
    assert np.all(np.diff(np.sort(found, axis=2), axis=2) > 0)
    for column in range(3):
        counts = np.bincount(found[:, 0, column], minlength=6)
        np.testing.assert_allclose(counts[1:] / 4000, 0.2, atol=0.03)


def test_trial_points_stay_inside_and_change_at_the_rate() -> None:
    rng = np.random.default_rng(0)
    box = Space(np.zeros(5), np.ones(5), np.zeros(5, dtype=bool), 2)
    x = rng.random((4000, 5))
    found = differential_evolution_trials(x, box, 0.4, (0.0, 1.0), rng)
    assert np.all((found >= 0.0) & (found <= 1.0))
    changed = found != x
    assert changed.any(axis=1).all()
    assert changed.mean() == pytest.approx(0.4 + 0.6**5 / 5.0, abs=0.01)


def values_of(problem: Problem, x: Array) -> tuple[Array, Array]:
    out = problem.evaluate(x, return_as_dictionary=True)
    return out["F"], out["G"]


@pytest.mark.parametrize("kind", [NSGA2Engine, GDE3Engine])
def test_restored_engine_goes_on_equally(kind: Any) -> None:
    problem = CostAndSpread()
    engine = kind(space(problem), 20, np.random.default_rng(0))
    for _ in range(5):
        x = engine.ask()
        engine.tell(x, *values_of(problem, x))
    other = kind(space(problem), 20, np.random.default_rng(9))
    other.restore(engine.state())
    for _ in range(5):
        asked = [one.ask() for one in (engine, other)]
        np.testing.assert_array_equal(*asked)
        for one in (engine, other):
            one.tell(asked[0], *values_of(problem, asked[0]))
    np.testing.assert_array_equal(engine.crowding, other.crowding)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (
            lambda: ArrayNSGA2(60, mutation=(0.1, 20.0)),
            lambda: PymooNSGA2(60, mutation=PM(prob=1.0, prob_var=0.1, eta=20.0)),
        ),
        (lambda: ArrayGDE3(60, CR=0.9), lambda: PymooGDE3(60, CR=0.9, sampling=FloatRandomSampling())),
    ],
    ids=["nsga2", "gde3"],
)
def test_hypervolume_is_that_of_pymoo(ours: Any, theirs: Any) -> None:
    """15 seeds each: medians within the spread over seeds, no difference by Mann-Whitney."""
    problem, box = CostAndSpread(), (np.array([37.5, 0.0]), np.array([500.0, 0.5]))
    one, other = (
        [hypervolume(minimize(problem, make(), ("n_eval", 2400), seed=seed).F, *box) for seed in range(15)]
        for make in (ours, theirs)
    )
    assert mannwhitneyu(one, other).pvalue > 0.01
    spread = max(float(np.std(one)), float(np.std(other)))
    assert abs(np.median(one) - np.median(other)) < spread


@pytest.mark.parametrize("kind", [ArrayNSGA2, ArrayGDE3])
def test_whole_numbers_and_bounds(kind: Any) -> None:
    result = minimize(CostAndSpread(integer=True), kind(40), ("n_eval", 800), seed=1)
    np.testing.assert_array_equal(result.X, np.rint(result.X))
    assert result.X.min() >= 1
    assert result.X.max() <= 30
    assert np.all(result.G <= 0.0)
    again = minimize(CostAndSpread(integer=True), kind(40), ("n_eval", 800), seed=1)
    np.testing.assert_array_equal(result.X, again.X)


@pytest.mark.parametrize("kind", [GDE3Engine, NSGA2Engine])
def test_a_rounding_of_the_values_changes_no_generation(kind: Any) -> None:
    """Both objectives have steps, so that values of points are equal but for what another processor rounds."""
    steps = space(CostAndSpread())

    def generations(rounding: float) -> Array:
        engine, last = kind(steps, 20, np.random.default_rng(1)), np.random.default_rng(2)
        for _ in range(15):
            x = engine.ask()
            f = 0.1 + np.column_stack([np.ceil(10.0 * x.sum(axis=1)), np.ceil(10.0 * (1.0 - x[:, :4].sum(axis=1)))])
            engine.tell(x, f * (1.0 + rounding * last.normal(size=f.shape)), np.empty((len(x), 0)))
        return np.asarray(engine.x)

    np.testing.assert_array_equal(generations(1e-14), generations(0.0))


def test_what_an_engine_cannot_take_is_refused() -> None:
    with pytest.raises(ValueError, match="needs bounds"):
        minimize(Problem(n_var=2, n_obj=2), ArrayNSGA2(10), ("n_eval", 20))
    with pytest.raises(ValueError, match="inequality constraints only"):
        minimize(Problem(n_var=2, n_obj=2, n_eq_constr=1, xl=0, xu=1), ArrayNSGA2(10))


def test_engines_are_named() -> None:
    kinds = {name: registry.load("algorithms", name) for name in registry.names("algorithms")}
    assert tuple(name for name, kind in kinds.items() if kind.array_engine) == ENGINES
