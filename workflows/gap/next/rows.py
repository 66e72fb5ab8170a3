"""Measurements at other operating points: predictions of an explanation, and its free columns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ....arrays import Array
from ....models.effects.measurements import measurements_of
from ....models.measurable import Column
from ..data import GapData
from ..fit import Fit, Fitter, Member
from ..library import Columns, Predict
from ..linear import basis, projected_out
from ..predictor import predictor
from ..setup import Setup, change_of, zeros_of
from .points import Table

STRIDE = 0.02
"""Fraction of a nonlinear parameter by which it is moved for its column."""


def placed(data: GapData, table: Table, more: tuple[Column, ...] = ()) -> GapData:
    """The data's columns, and `more` ones, at the rows of a table, nothing measured there."""
    count = len(next(iter(table.values())))
    target = replace(data.target, columns=(*data.target.columns, *more))
    return replace(
        data,
        target=target,
        measurements=measurements_of(target.columns, table),
        measured={},
        predicted={},
        std={},
        rows=np.arange(count),
        repeats=None,
        blocks=None,
    )


def columns_at(setup: Setup, data: GapData) -> Columns:
    """Columns of effects at rows where nothing was measured."""
    plan = setup.plan
    if plan.model is None:
        return Columns(data, zero_prediction(data))
    moved = plan.rebuild(setup.at) if plan.rebuild and setup.at else None
    return Columns(data, predictor(plan, data, moved))


def base_at(setup: Setup, data: GapData) -> Array:
    """Columns (N, p) of the free parameters, each for its whole tolerance, and of the zeros."""
    changes = [change_of(setup.plan, data, setup.at, name) for name in setup.free]
    return np.column_stack([*changes, zeros_of(data)])


def zero_prediction(data: GapData) -> Predict:
    """The prediction 0 of every output, at rows for which a table has none."""
    zero = {o.name: np.zeros(len(data)) for o in data.outputs}
    return lambda changes: zero


@dataclass(frozen=True)
class Predictions:
    """The prediction (N,) of a fit at N rows, and the columns (N, p) of all that is fitted in it:
    free parameters, zeros, effects, and the derivatives by their nonlinear parameters.
    """

    values: Array
    columns: Array


def predictions(columns: Columns, base: Array, fit: Fit) -> Predictions:
    """The prediction of a fit at the rows of `columns`, in the outputs' units."""
    values, parts = base @ fit.free, [base]
    for member, coefficients in zip(fit.members, fit.coefficients, strict=True):
        member_columns = columns.of(member.candidate, member.shape)
        values = values + member_columns @ coefficients
        if not member.candidate.is_nonlinear:
            parts.append(member_columns)
        parts += [column[:, None] for column in _moving(columns, member, coefficients)]
    return Predictions(np.asarray(values), np.hstack(parts))


def _moving(columns: Columns, member: Member, coefficients: Array) -> Iterator[Array]:
    """The derivative (N,) by each fitted nonlinear parameter."""
    for parameter in member.candidate.shape:
        if parameter.choices:
            continue
        value = member.shape[parameter.name]
        step = STRIDE * (abs(value) or 1.0)
        ends = max(value - step, parameter.low), min(value + step, parameter.high)
        low, high = (columns.of(member.candidate, {**member.shape, parameter.name: end}) for end in ends)
        yield (high - low) @ coefficients / max(ends[1] - ends[0], 1e-300)


def of_record(fitter: Fitter, fit: Fit) -> Predictions:
    """The prediction of a fit at the N whitened rows of the record, followed by the tolerances."""
    prediction = predictions(fitter.columns, fitter.raw_base, fit)
    free = fitter.base.shape[1]
    columns = fitter.space.whiten(prediction.columns)
    columns[:, :free] = fitter.base
    values = fitter.space.whiten(prediction.values)
    tail = slice(len(values) - fitter.space.prior, None)
    values[tail] = fitter.base[tail] @ fit.free
    return Predictions(values, columns)


def distance(explanation: Predictions, rival: Predictions) -> float:
    """Squared norm of the difference of two predictions outside the span of the rival's columns."""
    return float(np.sum(projected_out(explanation.values - rival.values, basis(rival.columns)) ** 2))
