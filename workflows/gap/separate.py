"""The measurement that would separate two explanations best."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...gap_records import Measurement
from ...models.measurable import Column, Role
from .data import GapData
from .fit import Fit
from .library import Columns
from .linear import basis, projected_out
from .next.rows import placed, zero_prediction
from .predictor import predictor
from .setup import Setup

ROWS = 240
"""Number of measurements of a design that is tried."""
WIDER = 1.6
"""Factor by which the range of an input is extended."""
CERTAIN = 12.0
"""Squared distance in noise units from which explanations are separated."""
OTHER_QUANTITIES = {
    frozenset(
        ["viscous_friction", "read_out_lag"]
    ): "record runs that accelerate: a lag follows the speed itself, friction the torque it needs",
    frozenset(
        ["gauge_bias", "process_mean_shift"]
    ): "measure a reference unit, or some units on a second gauge: a bias stays, a shift does not",
}


@dataclass(frozen=True)
class Design:
    """Operating points of a possible measurement, and the description of what is new in them."""

    text: str
    table: Mapping[str, NDArray[Any]]
    inputs: Mapping[str, tuple[float, float]]


def separating(setup: Setup, levels: Array, fit: Fit, rival: Fit) -> Measurement:
    """The best of a few designs, each input varied alone or further, at noise of `levels` (q,)."""
    names = frozenset(set(fit.names) ^ set(rival.names))
    if names in OTHER_QUANTITIES:
        return Measurement(OTHER_QUANTITIES[names])
    best: tuple[float, Design] | None = None
    for design in _designs(setup.data, np.random.default_rng([setup.plan.seed, 3])):
        if not _within(setup, design):
            continue
        size = _difference(setup, levels, design, fit, rival)
        if np.isfinite(size) and (best is None or size > 1.05 * best[0]):
            best = (size, design)
    if best is None or best[0] < 1e-3:
        return Measurement("no design of these inputs separates them: another quantity has to be measured")
    size, design = best
    count = int(min(np.ceil(CERTAIN / size**2), 10**6))
    subject = f"{count} measurements separate" if count > 1 else "1 measurement separates"
    text = f"{design.text}: {subject} them ({size:.2g} of the noise per measurement)"
    return Measurement(text, design.inputs, size, count)


def _within(setup: Setup, design: Design) -> bool:
    """Whether the model has a prediction at all points of a design."""
    model = setup.plan.model
    outside = {} if model is None else model.outside(design.table)
    return not any(wrong.any() for wrong, _ in outside.values())


def _designs(data: GapData, rng: np.random.Generator) -> Iterator[Design]:
    """More of the same; each input varied alone, in its range and further; all inputs at once."""
    rows = rng.choice(len(data), size=min(ROWS, len(data)), replace=False)
    now = {name: values[np.sort(rows)] for name, values in data.measurements.table.items()}
    yield Design("more measurements like these", now, {})
    moving = [c for c in data.inputs if c.role not in (Role.TIME, Role.REPEAT)]
    for column in moving:
        spread = _apart(now, column, rng, 1.0)
        yield Design(f"vary {column.name} independently of the other inputs", *spread)
        if column.role not in (Role.DIRECTION, Role.ANGLE):
            far = _apart(now, column, rng, WIDER)
            low, high = far[1][column.name]
            text = f"vary {column.name} independently, out to {low:.4g} .. {high:.4g}"
            yield Design(f"{text} {column.unit}".rstrip(), *far)
    table: Mapping[str, NDArray[Any]] = now
    ends: dict[str, tuple[float, float]] = {}
    for column in moving:
        table, more = _apart(table, column, rng, 1.0)
        ends |= more
    yield Design("vary all inputs independently of each other", table, ends)


def _apart(
    table: Mapping[str, NDArray[Any]], column: Column, rng: np.random.Generator, wider: float
) -> tuple[Mapping[str, NDArray[Any]], dict[str, tuple[float, float]]]:
    values = np.asarray(table[column.name], dtype=float)
    low, high = float(values.min()), float(values.max())
    if column.role is Role.DIRECTION:
        new = rng.choice([-1.0, 1.0], len(values))
    else:
        if low < 0.0 < high:
            low, high = wider * low, wider * high
        else:
            high = low + wider * (high - low)
        new = rng.uniform(low, high, len(values))
    return {**table, column.name: new}, {column.name: (low, high)}


def _difference(setup: Setup, levels: Array, design: Design, fit: Fit, rival: Fit) -> float:
    """Rms per measurement [noise] of the prediction of `fit` that the rival cannot explain."""
    data = placed(setup.data, design.table)
    columns = Columns(data, predictor(setup.plan, data) if setup.plan.model else zero_prediction(data))
    level = np.repeat(levels, len(data))
    explained = sum(
        (columns.of(m.candidate, m.shape) @ c for m, c in zip(fit.members, fit.coefficients, strict=True)),
        np.zeros(len(level)),
    )
    free = [columns.of(m.candidate, m.shape) for m in rival.members]
    ones = np.kron(np.eye(len(data.outputs)), np.ones((len(data), 1)))
    q = basis(np.hstack([ones, *free]) / level[:, None])
    residual = projected_out(np.asarray(explained) / level, q)
    return float(np.sqrt(np.mean(residual**2)))
