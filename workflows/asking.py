"""A search in the loop of a user: it asks for designs and is told their outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ..algorithms.archive import Archive
from ..algorithms.drivers import driver
from ..algorithms.indicators import nondominated
from ..algorithms.settings import AlgorithmSettings, Solver
from ..arrays import Array
from ..errors import Fault, raise_all
from ..problems.designs import designs_frame
from ..problems.tolerance_problem import ToleranceProblem


def askable(name: str, algorithm: AlgorithmSettings | None) -> list[Fault]:
    """A fault where an algorithm evaluates its designs itself."""
    if not isinstance(algorithm, Solver):
        return []
    text = f"{name} evaluates designs itself and cannot be asked for them; take one such as nsga2"
    return [Fault("algorithm.name", text)]


@dataclass(frozen=True, eq=False)
class Asked:
    """The results of a search so far.

    `front` has the non-dominated feasible designs, one per row, by the first objective: every
    variable, and every objective that is an output. `evaluations` counts designs.
    """

    front: pd.DataFrame
    evaluations: int

    def _repr_html_(self) -> str:
        """The front: what a notebook shows."""
        return str(self.front.to_html())


class Search:
    """A population search whose designs are evaluated by the user.

    `ask` and `tell` take turns. Which designs are asked for depends on problem, algorithm, seed,
    engine, the designs to `start` with (n, all variables), and the outputs so far.
    """

    def __init__(
        self,
        problem: ToleranceProblem,
        algorithm: AlgorithmSettings,
        seed: int,
        engine: str = "pymoo",
        start: Array | None = None,
    ) -> None:
        self.problem = problem
        self._driver = driver(problem, algorithm, seed, engine)
        self._archive = Archive(problem.n_var, problem.n_obj)
        self._start = start
        self._open: Array | None = None
        self._evaluations = 0

    def ask(self) -> pd.DataFrame:
        """The next designs, one per row, every variable a column; the same until they are told."""
        if self._open is None:
            self._open = self._driver.ask()
            if self._start is not None:
                names = self.problem.names
                free = [names.index(variable.name) for variable in self.problem.free]
                self._open = self._driver.begin_with(self._start[: len(self._open), free])
                self._start = None
        return designs_frame(self.problem, self.problem.complete(self._open))

    def tell(self, x: pd.DataFrame, outputs: pd.DataFrame | Mapping[str, Array]) -> None:
        """Take the outputs at the designs `x` that `ask` returned, in their order.

        `outputs` are columns (n,) by name: every objective and every output with a limit. Raises
        ConfigurationError where one is missing, not finite, or of another length.
        """
        asked = self.ask()
        raise_all(_order_faults(asked, x))
        raise_all(self._faults(outputs, len(asked)))
        assert self._open is not None
        designs = self.problem.complete(self._open)
        values = {name: np.asarray(outputs[name], dtype=float) for name in self._needed()}
        f = self.problem.objective_values(values)
        g = self.problem.violations(designs, values)
        self._driver.tell(f, g)
        self._archive.add(self._open, f, np.maximum(g, 0.0).sum(axis=1))
        self._evaluations += len(f)
        self._open = None

    def result(self) -> Asked:
        """The results so far."""
        x, f = self._archive.arrays()
        rows = np.flatnonzero(nondominated(f)) if len(f) else np.zeros(0, dtype=np.int64)
        front = designs_frame(self.problem, self.problem.complete(x[rows]))
        front[list(self.problem.objectives)] = f[rows]
        return Asked(front.sort_values(self.problem.objectives[0], ignore_index=True), self._evaluations)

    def _needed(self) -> list[str]:
        """Objectives and limited outputs; a limited variable is known."""
        limited = [limit.name for limit in self.problem.limits if limit.count]
        names = dict.fromkeys((*self.problem.objectives, *limited))
        return [name for name in names if name not in self.problem.names]

    def _faults(self, outputs: pd.DataFrame | Mapping[str, Array], count: int) -> list[Fault]:
        faults = []
        for name in self._needed():
            if name not in outputs:
                text = "is missing: state every objective and every output with a limit"
            elif np.shape(outputs[name]) != (count,):
                text = f"must have shape ({count},), a value for each design"
            elif not np.all(np.isfinite(np.asarray(outputs[name], dtype=float))):
                text = "must be finite at every design"
            else:
                continue
            faults.append(Fault(f"outputs.{name}", text))
        return faults


def _order_faults(asked: pd.DataFrame, x: pd.DataFrame) -> list[Fault]:
    """A fault where the designs are not those that `ask` returned."""
    same = set(asked) <= set(x) and len(x) == len(asked)
    if same and all(np.array_equal(asked[name].to_numpy(), x[name].to_numpy()) for name in asked):
        return []
    return [Fault("x", "must be the designs that ask() returned last, in their order")]
