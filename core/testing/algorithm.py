"""The contract of an algorithm."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import numpy as np

from ..algorithms.checkpoint import Checkpoint
from ..algorithms.search import Progress, search
from ..algorithms.settings import AlgorithmSettings, Budget
from ..problems.tolerance_problem import ToleranceProblem


class AlgorithmContract:
    """What every algorithm plugin must keep, on a problem with as many objectives as it takes."""

    settings: ClassVar[AlgorithmSettings]

    def problem(self) -> ToleranceProblem:
        """The problem that the algorithm is tested on."""
        raise TypeError("give the problem to try the algorithm on")

    def test_evaluation_budget_is_exact(self) -> None:
        result = search(self.problem(), self.settings, Budget(evaluations=73), seed=0)
        assert result.evaluations == 73

    def test_same_seed_same_result(self) -> None:
        budget = Budget(evaluations=90)
        runs = [search(self.problem(), self.settings, budget, seed=0) for _ in range(2)]
        np.testing.assert_array_equal(runs[0].x, runs[1].x)
        np.testing.assert_array_equal(runs[0].f, runs[1].f)

    def test_other_seed_other_result(self) -> None:
        budget = Budget(evaluations=40)
        runs = [search(self.problem(), self.settings, budget, seed=s) for s in (0, 1)]
        same = np.array_equal(runs[0].x, runs[1].x)
        assert not (same and np.array_equal(runs[0].miss, runs[1].miss))

    def test_stays_within_bounds(self) -> None:
        problem = self.problem()
        result = search(problem, self.settings, Budget(evaluations=80), seed=3)
        assert np.all(result.x >= problem.xl) and np.all(result.x <= problem.xu)

    def test_stopped_and_resumed_is_as_unbroken(self, tmp_path: Path) -> None:
        def stop(state: Progress) -> None:
            if state.evaluations > 55:
                raise KeyboardInterrupt

        budget, path = Budget(evaluations=110), tmp_path / "checkpoint.npz"
        for engine in ("pymoo", "array") if self.settings.array_engine else ("pymoo",):
            whole = search(self.problem(), self.settings, budget, 0, engine=engine)
            first = Checkpoint(path, "", every=0.0)
            first.write()
            search(self.problem(), self.settings, budget, 0, stop, engine, first)
            resumed = search(self.problem(), self.settings, budget, 0, None, engine, Checkpoint.read(path))
            assert resumed.evaluations == whole.evaluations
            np.testing.assert_array_equal(resumed.x, whole.x)
            np.testing.assert_array_equal(resumed.f, whole.f)
            np.testing.assert_array_equal(resumed.miss, whole.miss)
            values = [[p.hypervolume for p in result.history] for result in (resumed, whole)]
            assert values[0] == values[1]
