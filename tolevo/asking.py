"""A search in the loop of a user: it asks for designs and is told their outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from .algorithms.archive import Archive, nondominated
from .algorithms.engine import violation_of
from .algorithms.run import DiscreteDesigns, mark_failures_infeasible
from .algorithms.search import driver
from .algorithms.settings import AlgorithmSettings, Solver
from .errors import Fault, raise_all, refuse
from .execution import pinned
from .problems.tolerance_problem import ToleranceProblem, designs_frame, designs_of
from .section import Array, Flags, Integers

# Outputs that a user tells of designs: brought into the order in which the designs were asked for.


DESIGN_TOLERANCE = 1e-6
"""Difference, as a fraction of the range of a variable, up to which designs are the same: a table
may round them."""
NOT_ASKED = "must be the designs that ask() returned last, in their order, or with its index or columns"
OTHER = "belong to other designs than those that ask() returned last: see their columns"
NO_ORDER = (
    "come in an order that is not known: their rows are not numbered as those of the designs; keep the index that "
    "ask() returned, or the columns {}, or bring them into its order"
)


def align_outputs(
    problem: ToleranceProblem, asked: pd.DataFrame, x: pd.DataFrame, outputs: pd.DataFrame | Mapping[str, Any]
) -> Mapping[str, Any] | pd.DataFrame:
    """The outputs, by name, in the order of the designs that were `asked` for.

    `x` are these designs, as the user has them. Columns (n,) without an index follow the rows of
    `x`; the rows of a frame belong to the designs in their own columns where it has them all, else
    to the designs of the same index. Raises InputError where no order fits.
    """
    order = _row_order(problem, asked, x)
    if order is None:
        raise refuse("x", NOT_ASKED)
    if not isinstance(outputs, pd.DataFrame):
        if not (outputs and all(isinstance(column, pd.Series) for column in outputs.values())):
            return {
                name: np.asarray(column)[order] if np.shape(column) == np.shape(order) else column
                for name, column in outputs.items()
            }
        outputs = pd.DataFrame(dict(outputs))
    if len(outputs) != len(order):
        return outputs
    if set(_free(problem)) <= set(outputs):
        rows = _row_order(problem, asked, outputs)
        if rows is None:
            raise refuse("outputs", OTHER)
    else:
        rows = _align_by_index(x.index, outputs.index, order)
        if rows is None:
            raise refuse("outputs", NO_ORDER.format(", ".join(_free(problem))))
    outputs = outputs.iloc[rows].reset_index(drop=True)
    stated = asked.assign(**{name: outputs[name].to_numpy() for name in _free(problem) if name in outputs})
    wanted, given = _vectors(problem, asked), _vectors(problem, stated)
    if wanted is None or given is None or not np.all(np.abs(given - wanted) <= DESIGN_TOLERANCE):
        raise refuse("outputs", OTHER)
    return outputs


FAILED = "failed"
"""Column of results that says whether an evaluation failed, as `result().failed` lists them."""
YES, NO = ("true", "yes", "1", "1.0", FAILED), ("false", "no", "0", "0.0", "", "nan", "none")


def failed_rows(column: Any) -> tuple[Flags, object | None]:
    """Which evaluations of a column `failed` (n,) did; the first value that says neither, None without one."""
    texts = ["" if value is None else str(value).strip().casefold() for value in np.asarray(column, dtype=object)]
    wrong = next((text for text in texts if text not in (*YES, *NO)), None)
    return np.array([text in YES for text in texts], dtype=bool), wrong


def _free(problem: ToleranceProblem) -> list[str]:
    return [variable.name for variable in problem.free]


def _align_by_index(index: pd.Index[Any], outputs: pd.Index[Any], order: Integers) -> Integers | None:
    """The rows of outputs in the order that was asked for, by their index; None where it does not fit."""
    if index.equals(outputs):
        return order
    if not index.is_unique or not outputs.is_unique or set(index) != set(outputs):
        return None
    if not index[order].equals(index):  # the designs were brought into another order, the outputs into a third
        return None
    return np.asarray(outputs.get_indexer(index[order]), dtype=np.int64)


def _row_order(problem: ToleranceProblem, asked: pd.DataFrame, table: pd.DataFrame) -> Integers | None:
    """The rows of a table in the order of the designs `asked` for, None where it holds others."""
    if len(table) != len(asked) or not set(_free(problem)) <= set(table):
        return None
    wanted, given = _vectors(problem, asked), _vectors(problem, table)
    if given is None or wanted is None or not np.all(np.isfinite(given)):
        return None
    rows = np.arange(len(asked))
    if np.array_equal(wanted, given):
        return rows
    distance = cdist(wanted, given, "chebyshev")
    rows = linear_sum_assignment(distance)[1]
    return rows if np.all(distance[np.arange(len(rows)), rows] <= DESIGN_TOLERANCE) else None


def _first_text(column: Any) -> object | None:
    """The first value of a column that is no number; None where all are, or are missing."""
    known = pd.Series(np.asarray(column, dtype=object)).dropna()
    wrong = known[pd.to_numeric(known, errors="coerce").isna()]
    return None if wrong.empty else wrong.iloc[0]


def _vectors(problem: ToleranceProblem, table: pd.DataFrame) -> Array | None:
    """The free variables (n, variables) of a table, as fractions of their ranges; None where they
    are no numbers.
    """
    whole = table.assign(**{name: value for name, value in problem.fixed.items() if name not in table})
    try:
        designs = designs_of(problem, whole)
    except (TypeError, ValueError):
        return None
    free = [problem.names.index(name) for name in _free(problem)]
    return np.asarray((designs[:, free] - problem.xl) / (problem.xu - problem.xl))


MAX_ASK_ATTEMPTS = 50
"""Generations without a new design of whole numbers after which the remaining ones are asked for."""


def askable(name: str, algorithm: AlgorithmSettings | None) -> list[Fault]:
    """A fault where an algorithm evaluates its designs itself."""
    if not isinstance(algorithm, Solver):
        return []
    text = f"{name} evaluates designs itself and cannot be asked for them; take one such as nsga2"
    return [Fault("algorithm.name", text)]


def needed_outputs(problem: ToleranceProblem) -> list[str]:
    """The outputs that `tell` takes: objectives and limited outputs; a limited variable is known."""
    limited = [limit.name for limit in problem.limits if limit.count]
    names = dict.fromkeys((*problem.objectives, *limited))
    return [name for name in names if name not in problem.names]


@dataclass(frozen=True, eq=False)
class Asked:
    """The results of a search so far.

    `front` has the non-dominated feasible designs, one per row, by the first objective: every
    variable, and every objective that is an output. `evaluations` counts designs. `failed` are the
    designs whose evaluation failed.
    """

    front: pd.DataFrame
    evaluations: int
    failed: pd.DataFrame

    def _repr_html_(self) -> str:
        """The front: what a notebook shows."""
        return str(self.front.to_html())


class Search:
    """A population search whose designs are evaluated by the user.

    `ask` and `tell` take turns. Which designs are asked for depends on problem, algorithm, seed,
    engine, the designs to `start` with (search vectors (n, variables)), and the outputs so far. Designs of whole
    numbers alone are asked for once: `ask` returns none when all of them have been evaluated.
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
        self._discrete = DiscreteDesigns.of(problem)
        self._start = start
        self._open: Array | None = None
        self._new: Array = np.empty((0, problem.n_var))
        self._failed = np.empty((0, problem.n_var))
        self._evaluations = 0

    @pinned()
    def ask(self) -> pd.DataFrame:
        """The next designs, one per row, every variable a column; the same until they are told."""
        tries = 0
        while self._open is None:
            self._open = self._driver.ask()
            if self._start is not None:
                rows = np.linspace(0, len(self._start) - 1, min(len(self._start), len(self._open)))
                self._open = self._driver.begin_with(self._start[rows.round().astype(np.int64)])
                self._start = None
            self._new = self._open
            if self._discrete is not None:
                self._new = self._open[self._discrete.unknown(self._open)]
                tries += 1
                if not len(self._new) and self._discrete.remaining > 0.0:
                    if tries < MAX_ASK_ATTEMPTS:
                        self._driver.tell(*self._discrete.values(self._open))
                        self._open = None
                    else:  # the algorithm has converged
                        self._new = self._discrete.rest(len(self._open))
        return designs_frame(self.problem, self.problem.complete(self._new))

    @pinned()
    def tell(self, x: pd.DataFrame, outputs: pd.DataFrame | Mapping[str, Any]) -> None:
        """Take the outputs at the designs `x` that `ask` returned.

        `outputs` are columns (n,) by name: every objective and every output with a limit. Rows in
        another order are recognised by the design columns of a frame, or by its index; a value that
        is not finite, or true in a column `failed`, states that an evaluation failed, and its design
        counts as infeasible. Raises
        ConfigurationError where an output is missing or of another length, or where the order of
        the rows is not known.
        """
        outputs = align_outputs(self.problem, self.ask(), x, outputs)
        raise_all(self._faults(outputs, len(self._new)))
        assert self._open is not None
        designs = self.problem.complete(self._new)
        values = {name: np.asarray(outputs[name], dtype=float) for name in needed_outputs(self.problem)}
        if FAILED in outputs and FAILED not in values:
            marked = failed_rows(outputs[FAILED])[0]
            values = {name: np.where(marked, np.nan, column) for name, column in values.items()}
        f, g = self.problem.objective_values(values), self.problem.violations(designs, values)
        f, g, failed = mark_failures_infeasible(f, g, self.problem.box)
        self._archive.add(self._new, f, np.where(failed, np.inf, violation_of(g)))
        self._failed = np.concatenate([self._failed, self._new[failed]])
        self._evaluations += len(f)
        if self._discrete is not None:
            self._discrete.learn(self._new, f, g)
            f, g = self._discrete.values(self._open)
        self._driver.tell(f, g)
        self._open = None

    def result(self) -> Asked:
        """The results so far."""
        x, f = self._archive.arrays()
        rows = np.flatnonzero(nondominated(f)) if len(f) else np.zeros(0, dtype=np.int64)
        front = designs_frame(self.problem, self.problem.complete(x[rows]))
        front[list(self.problem.objectives)] = f[rows]
        failed = designs_frame(self.problem, self.problem.complete(self._failed))
        return Asked(front.sort_values(self.problem.objectives[0], ignore_index=True), self._evaluations, failed)

    def _faults(self, outputs: Mapping[str, Any] | pd.DataFrame, count: int) -> list[Fault]:
        faults = []
        for name in needed_outputs(self.problem):
            if name not in outputs:
                text = "is missing: state every objective and every output with a limit"
            elif np.shape(outputs[name]) != (count,):
                text = f"must have shape ({count},), a value for each design"
            elif (word := _first_text(outputs[name])) is not None:
                text = f'must have numbers, and NaN where an evaluation failed, got "{word}"'
            else:
                continue
            faults.append(Fault(f"outputs.{name}", text))
        if FAILED in outputs and FAILED not in needed_outputs(self.problem):
            if np.shape(outputs[FAILED]) != (count,):
                faults.append(Fault(f"outputs.{FAILED}", f"must have shape ({count},), true or false for each design"))
            elif (word := failed_rows(outputs[FAILED])[1]) is not None:
                faults.append(Fault(f"outputs.{FAILED}", f'must be true or false for each design, got "{word}"'))
        return faults
