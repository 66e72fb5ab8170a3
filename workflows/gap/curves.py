"""The contribution of an effect as a generic curve: the part of a larger effect without formula."""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...models.effects.unresolved import Term, Unresolved
from ...models.measurable import Role
from .abstain import acts_in
from .data import GapData
from .fit import Fit, Fitter, Member
from .linear import basis, projected_out
from .unresolved import member_with

KNOTS = 60
"""Knots of a curve, at most."""
EXACT = 1e-3
"""Deviation at which no more knots are added, as a fraction of the largest value."""
NO_CURVE = 0.02
"""Deviation from which a contribution is no function of one variable, as a fraction of its rms."""


def as_curve(fitter: Fitter, fit: Fit, small: int, large: int, data: GapData) -> Member | None:
    """The contribution of a small member of a fit that a large one cannot explain, as a term over
    its variable; None where it has several variables, or acts on several outputs.

    The part that the large member can explain, with equal weights, is attributed to that member,
    whose parameters are then those of its formula alone.
    """
    small_member, large_member = fit.members[small], fit.members[large]
    contribution, large_columns = (fitter.columns.of(m.candidate, m.shape) for m in (small_member, large_member))
    contribution, q = contribution @ fit.coefficients[small], basis(fitter.raw_base)
    shared = np.linalg.lstsq(projected_out(large_columns, q), projected_out(contribution, q), rcond=1e-9)[0]
    parts = np.split(contribution - large_columns @ shared, len(data.outputs))
    acting = [at for at, part in enumerate(parts) if np.any(part)]
    variables = acts_in(small_member.candidate.effect.needs) - {Role.DIRECTION}
    inputs = [c.name for c in data.inputs if c.role in variables]
    if len(acting) != 1 or len(inputs) != 1:
        return None
    output, part = data.outputs[acting[0]].name, parts[acting[0]]
    turns = Role.DIRECTION in small_member.candidate.effect.needs
    y = part * np.asarray(data.measurements[Role.DIRECTION], dtype=float) if turns else part
    knots, heights, off = _through(data.values(inputs[0]), y)
    if off > NO_CURVE:
        return None
    effect = Unresolved(Term(output, inputs[0], "curve", knots=knots, heights=heights, turns=turns))
    return member_with(effect, data)


def _through(x: Array, y: Array) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """Knots and heights of a broken line through points (n,), of magnitude 1 at most, and its rms
    error relative to the points. Knots are added one by one where the error is largest (Douglas and
    Peucker, Cartographica 10, 1973).
    """
    order = np.argsort(x, kind="stable")
    x, first = np.unique(x[order], return_index=True)
    y = y[order][first] / max(float(np.abs(y).max()), 1e-300)
    at = [0, len(x) - 1]
    while True:
        deviations = y - np.interp(x, x[at], y[at])
        worst = int(np.argmax(np.abs(deviations)))
        if abs(deviations[worst]) < EXACT or len(at) >= KNOTS:
            break
        at = sorted([*at, worst])
    off = float(np.sqrt(np.mean(deviations**2) / max(float(np.mean(y**2)), 1e-300)))
    return tuple(x[at].tolist()), tuple(y[at].tolist()), off
