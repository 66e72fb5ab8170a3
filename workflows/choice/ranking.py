"""Which of several designs is the better one to order."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...problems.interfaces import Accuracy
from ...problems.limits import limits_of
from ...problems.settings import Bound
from ...problems.tolerance_problem import ToleranceProblem
from .neighbours import SLACK
from .rule import COST

BATCH = 64
"""Designs that are evaluated at once: every output of each is held meanwhile."""


class Ranking:
    """Ranks designs: limits first, then the objectives but the cost, then the cost.

    The outputs of `bounds` are requested as well: the problem may leave them out
    otherwise.
    """

    def __init__(self, problem: ToleranceProblem, design: Array, searching: bool, bounds: Mapping[str, Bound]) -> None:
        self.problem = problem
        known = {COST, *problem.names, *problem.objectives, *(limit.name for limit in problem.limits)}
        more = {name: bound for name, bound in bounds.items() if name not in known}
        self.extended = problem.relaxed(more) if more else problem
        self.searching = searching
        self.limits = limits_of(bounds, problem.outputs, problem.variables)
        self.reference = self._outputs(design[None])
        self.correction: Array | float = 0.0

    def _outputs(self, designs: Array) -> dict[str, Array]:
        if self.searching:
            return self.extended.outputs_of(designs, searching=True)
        return Accuracy.of(self.extended).needed(designs)

    def use(self, designs: Array) -> tuple[Array, Array]:
        """How far designs use up limits and other objectives (n, columns), and their cost (n,).

        Above 0 a limit is broken, or an objective worse than that of the design; the first columns
        are those of limits, the last ones those of objectives.
        """
        parts = [designs[at : at + BATCH] for at in range(0, max(len(designs), 1), BATCH)]
        use, cost = zip(*map(self._use, parts), strict=True)
        return np.concatenate(use) + self.correction, np.concatenate(cost)

    def learn(self, other: Ranking, design: Array) -> None:
        """Correct `use` from now on by the excess of `other.use` at a full design (all,)."""
        missing = other.use(design[None])[0][0] - self.use(design[None])[0][0]
        self.correction = self.correction + np.where(np.isfinite(missing), missing, 0.0)

    def _use(self, designs: Array) -> tuple[Array, Array]:
        outputs = self._outputs(designs)
        columns = [self.problem.violations(designs, outputs)]
        for limit in self.limits:
            value = self.problem.values(designs, outputs, limit.name)
            columns += [column[:, None] for column in limit.violations(value)]
        for name in self._objectives_except_cost:
            reference = self.reference[name][0]
            columns.append(((outputs[name] - reference) / (abs(reference) or 1.0))[:, None])
        cost = outputs.get(COST, np.zeros(len(designs)))
        return np.concatenate(columns, axis=1), cost

    def keys(self, designs: Array) -> Array:
        """Violation, worsening of the other objectives and cost, shape (n, 3); less is better."""
        return self.ranked(*self.use(designs))

    def ranked(self, use: Array, cost: Array) -> Array:
        """The keys (n, 3) of values that `use` returns, or of predicted ones."""
        limits = use.shape[1] - len(self._objectives_except_cost)
        violation = np.maximum(use[:, :limits], 0.0).sum(axis=1)
        worse = np.max(use[:, limits:], axis=1, initial=0.0)
        return np.stack([violation, np.where(worse > SLACK, worse, 0.0), cost], axis=1)

    @property
    def _objectives_except_cost(self) -> list[str]:
        return [name for name in self.problem.objectives if name != COST]


def best(keys: Array) -> NDArray[np.int64]:
    """Rows from the best to the worst."""
    return np.lexsort(keys.T[::-1])
