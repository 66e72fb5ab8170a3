"""Problems whose free variables are all whole numbers: no design is evaluated twice."""

from __future__ import annotations

import itertools

import numpy as np

from ..arrays import Array, Integers
from ..problems.tolerance_problem import ToleranceProblem
from .states import SavedState, State

Key = tuple[int, ...]


class DiscreteDesigns:
    """Objectives (objectives,) and constraints (constraints,) of the designs evaluated so far."""

    def __init__(self, problem: ToleranceProblem) -> None:
        self._low, self._high = np.rint(problem.xl).astype(np.int64), np.rint(problem.xu).astype(np.int64)
        self._shape = problem.n_obj, problem.n_ieq_constr
        self._values: dict[Key, tuple[Array, Array]] = {}

    @staticmethod
    def of(problem: ToleranceProblem) -> DiscreteDesigns | None:
        """The designs of a problem, None where a free variable is not a whole number."""
        whole = bool(problem.free) and all(variable.integer for variable in problem.free)
        return DiscreteDesigns(problem) if whole else None

    @property
    def remaining(self) -> float:
        """The number of designs that have not been evaluated."""
        return float(np.prod(self._high - self._low + 1.0)) - len(self._values)

    def unknown(self, x: Array) -> Integers:
        """Rows of search vectors (n, variables) that have not been evaluated, each design once."""
        first: dict[Key, int] = {}
        for row, key in enumerate(_keys(x)):
            if key not in self._values:
                first.setdefault(key, row)
        return np.array(list(first.values()), dtype=np.int64)

    def learn(self, x: Array, f: Array, g: Array) -> None:
        """Remember objectives (n, objectives) and constraints (n, constraints)."""
        self._values.update(zip(_keys(x), zip(f, g, strict=True), strict=True))

    def values(self, x: Array) -> tuple[Array, Array]:
        """Objectives (n, objectives) and constraints (n, constraints) of evaluated designs."""
        rows = [self._values[key] for key in _keys(x)]
        f, g = (np.array([row[at] for row in rows]).reshape(len(rows), self._shape[at]) for at in range(2))
        return f, g

    def rest(self, most: int) -> Array:
        """Search vectors (n, variables) of at most so many designs that have not been evaluated."""
        ranges = (range(low, high + 1) for low, high in zip(self._low.tolist(), self._high.tolist(), strict=True))
        unknown = (key for key in itertools.product(*ranges) if key not in self._values)
        return np.array(list(itertools.islice(unknown, most)), dtype=float).reshape(-1, len(self._low))

    def state(self) -> State:
        """Everything as arrays."""
        x = np.array(list(self._values), dtype=float).reshape(-1, len(self._low))
        f, g = self.values(x)
        return {"x": x, "f": f, "g": g}

    def restore(self, state: SavedState) -> None:
        """Continue from a `state()`."""
        self._values = {}
        self.learn(state["x"], state["f"], state["g"])


def _keys(x: Array) -> list[Key]:
    return [tuple(row) for row in np.rint(x).astype(np.int64).tolist()]
