"""The search loop and the algorithms, on a small problem."""

from __future__ import annotations

import numpy as np
import pytest

from tolevo.algorithms.archive import hypervolume, nondominated
from tolevo.algorithms.ga import GA
from tolevo.algorithms.gde3 import GDE3
from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.random_search import RandomSearch
from tolevo.algorithms.run import Progress
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import AlgorithmSettings, Budget
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, PropagationSetting, Settings
from tolevo.testing import AlgorithmContract

SMALL = Settings(propagation=PropagationSetting(method="moments"), limits={"interference_probability": Bound(high=0.5)})
ONE = Settings(
    propagation=PropagationSetting(method="moments"),
    objectives=("cost",),
    limits={"interference_probability": Bound(high=0.5), "backlash_arcmin": Bound(high=1.5)},
)


class TestNSGA2(AlgorithmContract):
    settings = NSGA2(population=20)

    def problem(self) -> RvBacklash:
        return RvBacklash(SMALL)


class TestGDE3(AlgorithmContract):
    settings = GDE3(population=20)

    def problem(self) -> RvBacklash:
        return RvBacklash(SMALL)


class TestRandom(AlgorithmContract):
    settings = RandomSearch(population=20)

    def problem(self) -> RvBacklash:
        return RvBacklash(SMALL)


class TestGA(AlgorithmContract):
    settings = GA(population=20)

    def problem(self) -> RvBacklash:
        return RvBacklash(ONE)


def test_search_beats_random() -> None:
    budget = Budget(evaluations=3000)
    smart, blind = (
        search(RvBacklash(SMALL), s, budget, seed=1).history[-1].hypervolume
        for s in (NSGA2(population=60), RandomSearch(population=60))
    )
    assert smart > blind + 0.01


def test_hypervolume_never_falls() -> None:
    found = search(RvBacklash(SMALL), NSGA2(population=30), Budget(generations=20), seed=0)
    values = [state.hypervolume for state in found.history]
    assert len(values) == 20
    assert np.all(np.diff(values) >= -1e-15)


def test_interrupt_keeps_what_was_found() -> None:
    def stop(state: Progress) -> None:
        if state.generation == 3:
            raise KeyboardInterrupt

    found = search(RvBacklash(SMALL), NSGA2(population=20), Budget(generations=9), 0, stop)
    assert found.interrupted
    assert found.evaluations == 60


def test_time_limit_ends_a_search() -> None:
    found = search(RvBacklash(SMALL), NSGA2(population=20), Budget(time_limit_s=0.3), seed=0)
    assert found.history[-1].seconds >= 0.25
    assert found.evaluations == 20 * len(found.history)


def test_hypervolume_closed_form() -> None:
    """The square up to (1.1, 1.1) without the corner that neither point dominates."""
    values = np.array([[0.0, 0.5], [0.5, 0.0]])
    exact = 1.1 * 1.1 - 0.5 * 0.5
    assert hypervolume(values, np.zeros(2), np.ones(2)) == pytest.approx(exact, rel=1e-12)


def test_nondominated_keeps_one_of_equals() -> None:
    values = np.array([[1.0, 1.0], [1.0, 1.0], [0.5, 2.0], [2.0, 2.0]])
    np.testing.assert_array_equal(nondominated(values), [True, False, True, False])
    np.testing.assert_array_equal(nondominated(np.array([[2.0], [1.0], [1.0]])), [0, 1, 0])
    rounded = values * np.array([[1.0], [1.0 - 1e-14], [1.0], [1.0]])
    np.testing.assert_array_equal(nondominated(rounded), nondominated(values))


@pytest.mark.parametrize("engine", ["pymoo", "array"])
@pytest.mark.parametrize("settings", [NSGA2(population=20), GDE3(population=20)])
def test_whole_numbers_are_searched_as_such(settings: AlgorithmSettings, engine: str) -> None:
    problem = RvBacklash(SMALL)
    found = search(problem, settings, Budget(generations=8), seed=0, engine=engine)
    grade = found.x[:, [v.integer for v in problem.free]]
    assert grade.shape[1] == 1
    assert len(np.unique(grade)) > 1
    np.testing.assert_array_equal(grade, np.rint(grade))


def test_engines_find_different_designs_of_one_distribution() -> None:
    """The engine is part of what a result depends on; both start from the same kind of sample."""
    budget = Budget(evaluations=400)
    one, other = (
        search(RvBacklash(SMALL), NSGA2(population=40), budget, 0, engine=engine) for engine in ("pymoo", "array")
    )
    assert one.evaluations == other.evaluations == 400
    assert not np.array_equal(one.x, other.x)


def test_an_algorithm_without_an_array_engine_says_so() -> None:
    with pytest.raises(TypeError, match="GA has no array engine"):
        search(RvBacklash(ONE), GA(), Budget(generations=1), 0, engine="array")
