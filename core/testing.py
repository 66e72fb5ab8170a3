"""Contract tests that plugins inherit, ours first.

class TestMyProblem(ProblemContract):
problem_type = MyProblem
"""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import ClassVar

import numpy as np

from .algorithms.checkpoint import Checkpoint
from .algorithms.search import Progress, search
from .algorithms.settings import AlgorithmSettings, Budget
from .problems.tolerance_problem import ToleranceProblem


class ProblemContract:
    """What every `ToleranceProblem` must keep."""

    problem_type: ClassVar[type[ToleranceProblem]]

    def problem(self) -> ToleranceProblem:
        """The problem that is tried; override it where the type needs settings."""
        return self.problem_type()

    def _designs(self, count: int = 5) -> tuple[ToleranceProblem, np.ndarray]:
        problem = self.problem()
        rng = np.random.default_rng(0)
        return problem, rng.uniform(problem.xl, problem.xu, size=(count, problem.n_var))

    def test_bounds_are_finite_and_ordered(self) -> None:
        problem = self.problem()
        assert np.all(np.isfinite(problem.xl)) and np.all(problem.xl < problem.xu)

    def test_shapes(self) -> None:
        problem, x = self._designs()
        out = problem.evaluate(x, return_as_dictionary=True)
        assert out["F"].shape == (5, problem.n_obj)
        assert problem.n_ieq_constr == 0 or out["G"].shape == (5, problem.n_ieq_constr)

    def test_batch_equals_row_by_row(self) -> None:
        problem, x = self._designs()
        whole = problem.outputs_of(problem.complete(x))
        for row in range(len(x)):
            one = problem.outputs_of(problem.complete(x[row : row + 1]))
            for name, values in whole.items():
                np.testing.assert_allclose(one[name][0], values[row], rtol=1e-6, atol=1e-8)

    def test_finite_at_all_corners(self) -> None:
        problem = self.problem()
        signs = np.random.default_rng(1).integers(0, 2, size=(64, problem.n_var))
        x = np.vstack([problem.xl, problem.xu, np.where(signs == 1, problem.xu, problem.xl)])
        for name, values in problem.outputs_of(problem.complete(x)).items():
            assert np.all(np.isfinite(values)), name

    def test_picklable(self) -> None:
        problem, x = self._designs()
        again = pickle.loads(pickle.dumps(problem))
        np.testing.assert_array_equal(again.evaluate(x)[0], problem.evaluate(x)[0])

    def test_known_answer_is_a_front_or_none(self) -> None:
        problem = self.problem()
        front = problem.exact_front()
        assert front is None or front.shape[1] == problem.n_obj

    def test_box_is_a_box(self) -> None:
        ideal, nadir = self.problem().box()
        assert np.all(ideal < nadir)


class AlgorithmContract:
    """What every algorithm plugin must keep, on a problem with as many objectives as it takes."""

    settings: ClassVar[AlgorithmSettings]

    def problem(self) -> ToleranceProblem:
        """The problem it is tried on."""
        raise TypeError("give the problem to try the algorithm on")

    def test_evaluation_budget_is_exact(self) -> None:
        found = search(self.problem(), self.settings, Budget(evaluations=73), seed=0)
        assert found.evaluations == 73

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
        found = search(problem, self.settings, Budget(evaluations=80), seed=3)
        assert np.all(found.x >= problem.xl) and np.all(found.x <= problem.xu)

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
            found = search(
                self.problem(), self.settings, budget, 0, None, engine, Checkpoint.read(path)
            )
            assert found.evaluations == whole.evaluations
            np.testing.assert_array_equal(found.x, whole.x)
            np.testing.assert_array_equal(found.f, whole.f)
            np.testing.assert_array_equal(found.miss, whole.miss)
            values = [[p.hypervolume for p in one.history] for one in (found, whole)]
            assert values[0] == values[1]
