"""Where the residual has structure: successive regions, each given those before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...gap_records import Region
from ...models.measurable import Role
from .fit import Fit, Fitter
from .generic import PREDICTED, Form
from .linear import basis, products, projected_out
from .regions import along, curve_of, densest
from .scan import Remaining, evidence
from .setup import Setup

MOST = 6
LEAKAGE = 0.6
"""Distance of orders that are leakage of a located one: angles seldom cover whole turns."""
AS_MUCH = 0.8
"""Fraction of the gain of a flexible form from which a symmetric one is reported instead."""
WIDTHS = np.geomspace(0.01, 1.0, 24)
"""Half-widths of symmetric intervals, as fractions of the largest magnitude."""
OVER_INPUT = ("interval", "power", "trend")


def regions(setup: Setup, fitter: Fitter, generic: Remaining, fit: Fit, limit: float) -> tuple[Region, ...]:
    """The significant regions, the strongest first.

    A located region is removed with a flexible form of its variable before the next search: two
    variables in which a single cause shows, through chance correlation, are not two regions.
    """
    located: list[Region] = []
    groups, q = generic.white, fitter.q
    residual = projected_out(fit.residual, q)
    projected, product = products(groups, q, residual)
    beyond = fit.rss - fitter.space.count
    while len(located) < MOST:
        gains = groups.conditional_gains(projected, product)
        level = evidence(groups, gains)
        at = int(np.argmax(level))
        if level[at] <= limit:
            break
        parts = [generic.white.of(int(k)) for k in _flexible(generic, at)]
        taken = basis(projected_out(np.hstack(parts), q))
        explained = max(float(np.sum((taken.T @ residual) ** 2)) - taken.shape[1], float(gains[at]))
        beyond = max(beyond, explained)
        low, high = _ends(setup, fitter, generic, at, q, residual, explained)
        located.append(_region(setup, generic, at, low, high, explained / beyond, float(level[at]), limit))
        q, residual = np.hstack([q, taken]), projected_out(residual, taken)
        more, product = products(groups, taken, residual)
        projected = np.vstack([projected, more])
    return tuple(located)


def _flexible(generic: Remaining, at: int) -> NDArray[np.int64]:
    """The forms that are removed with a located one: all of its variable, or of about its order."""
    form = generic.forms[at]

    def same(other: Form) -> bool:
        if (other.variables, other.direction) != (form.variables, form.direction):
            return False
        if form.kind == "order":
            near = other.kind == "order" and abs(other.order - form.order) < LEAKAGE
            return near and (other.by, other.by_power) == (form.by, form.by_power)
        return other.kind in OVER_INPUT and form.kind in OVER_INPUT

    together = [
        same(candidate) and generic.outputs[k] == generic.outputs[at] for k, candidate in enumerate(generic.forms)
    ]
    together[at] = True
    return np.flatnonzero(together)


def _ends(
    setup: Setup, fitter: Fitter, generic: Remaining, at: int, q: Array, residual: Array, explained: float
) -> tuple[float, float]:
    """The interval of its variable in which a form has its gain; nan where it has none."""
    form = generic.forms[at]
    x = along(setup, form.variable) if form.kind in OVER_INPUT else None
    if x is None:
        return np.nan, np.nan
    if (x < 0).any() and (x > 0).any():
        width, gain = _turning(setup, fitter, form, int(generic.outputs[at]), x, q, residual)
        if gain >= AS_MUCH * explained:
            return max(-width, float(x.min())), min(width, float(x.max()))
    return densest(x, curve_of(setup, generic, at, q, residual))


def _turning(
    setup: Setup, fitter: Fitter, form: Form, output: int, x: Array, q: Array, residual: Array
) -> tuple[float, float]:
    """Half-width of the interval about zero in which an odd function of x rises, and its gain.

    The function is clip(x/w, -1, 1), constant beyond w.
    """
    widths = WIDTHS * float(np.abs(x).max())
    columns = np.zeros((len(x) * len(setup.data.outputs), len(widths)))
    odd = np.clip(x[:, None] / widths, -1.0, 1.0)
    if form.direction:
        odd = odd * np.asarray(setup.data.measurements[Role.DIRECTION], dtype=float)[:, None]
    columns[setup.data.rows_of(output)] = odd
    remaining = projected_out(fitter.space.whiten(columns), q)
    size = np.einsum("ij,ij->j", remaining, remaining)
    gains = (remaining.T @ residual) ** 2 / np.maximum(size, 1e-9)
    best = int(np.argmax(gains))
    return float(widths[best]), float(gains[best])


def _region(
    setup: Setup, generic: Remaining, at: int, low: float, high: float, fraction: float, level: float, limit: float
) -> Region:
    form, output = generic.forms[at], setup.data.outputs[int(generic.outputs[at])]
    unit = next((c.unit for c in setup.data.inputs if c.name == form.variable), "")
    return Region(
        output=output.name,
        variable=" x ".join(form.variables),
        kind="interval" if form.kind == "power" else form.kind,
        unit=output.unit if form.variable.startswith(PREDICTED) else unit,
        low=low,
        high=high,
        order=form.order if form.kind == "order" else np.nan,
        direction="opposite in the two directions" if form.direction else "",
        share=float(np.clip(fraction, 0.0, 1.0)),
        statistic=level,
        threshold=limit,
    )
