"""The contract of a problem that promises a yield on the basis of samples of its variables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..models.capability import Knowledge
from ..problems.deviations import Deviations, PromisedOutput
from ..problems.promise import ASSURED, PROMISED, Promise
from ..problems.promising import Promising
from .problem import ProblemContract


class PromisingContract(ProblemContract):
    """What every `Promising` problem must keep in addition to the contract of a problem."""

    def promising(self) -> Promising:
        """The problem that is tried, with an assured promise."""
        plain = self.problem()
        assert isinstance(plain, Promising)
        assured = type(plain)(replace(plain.given, promise=Promise(95.0, ASSURED)))
        assert isinstance(assured, Promising)
        return assured

    def _deviations(self, count: int = 5) -> tuple[Promising, np.ndarray, Deviations]:
        problem, rng = self.promising(), np.random.default_rng(3)
        x = rng.uniform(problem.xl, problem.xu, size=(count, problem.n_var))
        designs = problem.complete(x)
        return problem, designs, problem.deviations(designs)

    def test_deviations_are_of_its_variables_and_have_a_limit(self) -> None:
        problem, designs, deviations = self._deviations()
        assert deviations.sides
        assert set(deviations.each) <= set(problem.names)
        for values in (deviations.mean, deviations.rest, *deviations.each.values()):
            assert values.shape == (len(designs),) and np.all(np.isfinite(values))
        assert np.all(deviations.rest >= 0.0) and all(np.all(spread >= 0.0) for spread in deviations.each.values())

    def test_deviations_of_a_batch_are_those_of_its_rows(self) -> None:
        problem, designs, deviations = self._deviations()
        for row in range(len(designs)):
            single = problem.deviations(designs[row : row + 1])
            np.testing.assert_allclose(single.mean, deviations.mean[row], rtol=1e-9)
            for name, values in deviations.each.items():
                np.testing.assert_allclose(single.each[name], values[row], rtol=1e-9)

    def test_the_promised_yield_is_the_output(self) -> None:
        problem, designs, deviations = self._deviations()
        promised = problem.promised
        assert promised is not None
        outputs = problem.outputs_of(designs)
        np.testing.assert_allclose(outputs[PROMISED], promised.promised(deviations), atol=1e-9)

    def test_fewer_parts_promise_less(self) -> None:
        """The same estimates from 8 and from 80 parts."""
        problem, _, deviations = self._deviations()
        promise = problem.promise
        assert promise is not None
        yields = []
        for n in (8, 80):
            known = {name: Knowledge(0.0, 1.0, n, n - 1.0) for name in deviations.each}
            yields.append(PromisedOutput(promise, known, 0).promised(deviations))
        assert np.all(yields[0] <= yields[1] + 1e-9)
