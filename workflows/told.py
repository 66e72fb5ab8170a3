"""Outputs that a user tells of designs: brought into the order in which the designs were asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from ..arrays import Array, Integers
from ..errors import refuse
from ..problems.designs import designs_of
from ..problems.tolerance_problem import ToleranceProblem

SAME = 1e-6
"""Difference, as a fraction of the range of a variable, up to which designs are the same: a table
may round them."""
NOT_ASKED = "must be the designs that ask() returned last, in their order, or with its index or columns"
NO_ORDER = (
    "come in an order that is not known: their rows are not numbered as those of the designs; keep the index that "
    "ask() returned, or the columns {}, or bring them into its order"
)


def aligned(
    problem: ToleranceProblem, asked: pd.DataFrame, x: pd.DataFrame, outputs: pd.DataFrame | Mapping[str, Any]
) -> Mapping[str, Any] | pd.DataFrame:
    """The outputs, by name, in the order of the designs that were `asked` for.

    `x` are these designs, as the user has them. Columns (n,) without an index follow the rows of
    `x`; the rows of a frame belong to the designs in their own columns where it has them all, else
    to the designs of the same index. Raises InputError where no order fits.
    """
    order = _order(problem, asked, x)
    if order is None:
        raise refuse("x", NOT_ASKED)
    if not isinstance(outputs, pd.DataFrame):
        if not (outputs and all(isinstance(column, pd.Series) for column in outputs.values())):
            return {
                name: np.asarray(column)[order] if _fits(column, order) else column for name, column in outputs.items()
            }
        outputs = pd.DataFrame(dict(outputs))
    if len(outputs) != len(order):
        return outputs
    if set(_free(problem)) <= set(outputs):
        rows = _order(problem, asked, outputs)
        if rows is None:
            raise refuse("outputs", "belong to other designs than those that ask() returned last: see their columns")
    else:
        rows = _by_index(x.index, outputs.index, order)
        if rows is None:
            raise refuse("outputs", NO_ORDER.format(", ".join(_free(problem))))
    return outputs.iloc[rows].reset_index(drop=True)


def _fits(column: Any, order: Integers) -> bool:
    return bool(np.shape(column) == np.shape(order))


def _free(problem: ToleranceProblem) -> list[str]:
    return [variable.name for variable in problem.free]


def _by_index(index: pd.Index[Any], outputs: pd.Index[Any], order: Integers) -> Integers | None:
    """The rows of outputs in the order that was asked for, by their index; None where it does not fit."""
    if index.equals(outputs):
        return order
    if not index.is_unique or not outputs.is_unique or set(index) != set(outputs):
        return None
    if not index[order].equals(index):  # the designs were brought into another order, the outputs into a third
        return None
    return np.asarray(outputs.get_indexer(index[order]), dtype=np.int64)


def _order(problem: ToleranceProblem, asked: pd.DataFrame, table: pd.DataFrame) -> Integers | None:
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
    return rows if np.all(distance[np.arange(len(rows)), rows] <= SAME) else None


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
