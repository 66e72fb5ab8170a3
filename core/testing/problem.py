"""The contract of a problem."""

from __future__ import annotations

import pickle
from typing import ClassVar

import numpy as np

from ..problems.interfaces import Provable
from ..problems.tolerance_problem import ToleranceProblem


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
            single = problem.outputs_of(problem.complete(x[row : row + 1]))
            for name, values in whole.items():
                np.testing.assert_allclose(single[name][0], values[row], rtol=1e-6, atol=1e-8)

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
        front = Provable.of(problem).exact_front()
        assert front is None or front.shape[1] == problem.n_obj

    def test_box_is_a_box(self) -> None:
        ideal, nadir = self.problem().box()
        assert np.all(ideal < nadir)
