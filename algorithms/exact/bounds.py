"""How far points are from the best possible: proven lower bounds of their cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Array, Flags
from ...errors import ModelError
from ...problems.forms import Feature, Form, Way
from ...problems.interfaces import Provable
from ...problems.least import least_values
from ...problems.limits import ROOM, loosened
from ...problems.tolerance_problem import ToleranceProblem
from .between import least_bounds
from .choices import cost_range
from .pieces import convex_pieces

LOOSER = 1e-11
"""Relative widening of a point's own values, so that the point always keeps them."""
BEYOND = 2.0
"""Widening of a limit, in units of the room within which it counts as kept: no design that keeps it
is excluded, whatever its rounding."""


@dataclass(frozen=True, slots=True)
class Proof:
    """Proven lower bounds (n,) of the costs of n points, NaN where there is none.

    `statement` states the problem for which the bound holds, or why there is none, which `missing`
    says alone; `omitted_limits` names the limits that it ignores.
    """

    bound: Array
    statement: str
    omitted_limits: tuple[str, ...] = ()
    missing: str = ""

    @classmethod
    def without(cls, points: int, why: str) -> Proof:
        """No bound of any of so many points, and the reason."""
        return cls(np.full(points, np.nan), f"nothing is proven: {why}", missing=why)

    def gap_percent(self, cost: Array) -> Array:
        """Distance (n,) of costs from their bounds, in percent; NaN where the bound is 0."""
        whole = np.where(self.bound == 0.0, np.nan, np.abs(self.bound))
        return np.asarray(100.0 * np.maximum(cost - self.bound, 0.0) / whole)


def proof(problem: ToleranceProblem, values: Mapping[str, Array], points: int) -> Proof:
    """Bounds of the cost of `points` points at equal or better other objectives.

    `values` holds the objectives (n,) of points that keep the limits. No design of the problem that
    keeps them and is as good in all other objectives costs less than the bound.
    Raises ModelError where a point disproves its bound.
    """
    form = Provable.of(problem).form()
    missing = reason(problem, form)
    if missing or form is None:
        return Proof.without(points, missing)
    if not points:
        return Proof(np.empty(0), form.statement, form.relaxed)
    own = [_values_if_required(problem, form, values, name, points) for name in form.outputs]
    limits = np.minimum(loosened(np.stack(own, axis=1), LOOSER / ROOM), loosened(row_limits(problem, form), BEYOND))
    distinct, place = np.unique(limits, axis=0, return_inverse=True)
    bound = _least_bound(form, distinct)[np.ravel(place)]
    cost = np.asarray(values["cost"])
    least, most = cost_range(form)
    excess = np.subtract(bound, cost, out=np.full(len(cost), -np.inf), where=np.isfinite(cost))
    if np.any(excess > 1e-9 * np.maximum(np.abs(cost), min(abs(least), abs(most)))):
        at = int(np.argmax(excess))
        raise ModelError(
            f"the proven bound {bound[at]} lies above a cost of {cost[at]}: the form "
            f"of {type(problem).__name__} does not bound that cost"
        )
    return Proof(np.minimum(bound, cost), form.statement, form.relaxed)


def _least_bound(form: Form, limits: Array) -> Array:
    """Proven least costs (n,) of a form and of the forms of the designs that it omits.

    A design that is too expensive at the widest limits is so at all of them.
    """
    bound = _bound(form, limits)
    for alternative in form.also:
        wide = np.full(len(alternative.outputs), np.inf)
        shared = [alternative.outputs.index(name) if name in alternative.outputs else -1 for name in form.outputs]
        alternative_limits = np.tile(np.minimum(wide, alternative.own_limits), (len(limits), 1))
        for at, row in enumerate(shared):
            if row >= 0:
                alternative_limits[:, row] = limits[:, at]
        rest = bound > _bound(alternative, alternative_limits.max(axis=0)[None, :])[0]
        if np.any(rest):
            bound[rest] = np.minimum(bound[rest], _bound(alternative, alternative_limits[rest]))
    return bound


def _bound(form: Form, limits: Array) -> Array:
    """Proven least costs (n,) of one form at limits (n, r)."""
    used = np.any(np.isfinite(limits), axis=0)
    used[0] |= not np.any(used)
    form, limits = convex_pieces(restricted(form, used)), limits[:, used]
    bound, possible = np.full(len(limits), np.inf), within_reach(form, limits)
    if np.any(possible):
        bound[possible] = least_bounds(form, limits[possible])
    return bound


def within_reach(form: Form, limits: Array) -> Flags:
    """Whether limits (n, r) are not proven to be contradictory by the least values alone."""
    possible = np.ones(len(limits), dtype=bool)
    every = range(len(form.outputs) if form.quantiles else 0)
    for row, least in zip(every, least_values(form, every, limits.max(axis=0)), strict=True):
        if least is not None:
            possible &= limits[:, row] >= least.value - BEYOND * ROOM * abs(least.value)
    return possible


def reason(problem: ToleranceProblem, form: Form | None) -> str:
    """Why nothing can be proven of the points of a problem; empty where something can."""
    if "cost" not in problem.objectives:
        return "cost is not an objective"
    if form is None:
        return "the problem has no convex form"
    known_by = ("cost", *form.outputs, *form.stands.values())
    others = [name for name in problem.objectives if name not in known_by]
    if others:
        known = ", ".join(form.outputs)
        why = Provable.of(problem).unproven()
        return f"no convex form of {', '.join(others)} is known (there is one of {known}){f': {why}' if why else ''}"
    return ""


def upper_limit(problem: ToleranceProblem, name: str) -> float:
    """The upper limit of an output, inf where there is none."""
    return next((limit.high for limit in problem.limits if limit.name == name), np.inf)


def row_limits(problem: ToleranceProblem, form: Form) -> Array:
    """The upper limits (r,) that the problem sets to the requirements of its form."""
    return np.minimum([upper_limit(problem, name) for name in form.outputs], form.own_limits)


def _values_if_required(
    problem: ToleranceProblem, form: Form, values: Mapping[str, Array], name: str, points: int
) -> Array:
    """The values at the points of a requirement that is an objective, or that represents an output
    which is an objective or limited; inf for others.
    """
    requested = {*problem.objectives, *(limit.name for limit in problem.limits)}
    required = name in problem.objectives or form.stands.get(name) in requested
    return np.asarray(values[name]) if required else np.full(points, np.inf)


def restricted(form: Form, used: Flags) -> Form:
    """The form with some of its requirements only."""
    kept = np.flatnonzero(used).tolist()
    surpluses = tuple(form.surpluses[i] for i in kept) if form.surpluses else ()

    def cut_way(way: Way) -> Way:
        linear, spread = (tuple(part[i] for i in kept) for part in (way.linear, way.spread))
        offset = tuple(way.offset[i] for i in kept) if way.offset else ()
        return replace(way, linear=linear, spread=spread, offset=offset)

    features = tuple(
        Feature(f.variable, tuple(cut_way(way) for way in f.ways), f.choice, f.count) for f in form.features
    )
    return replace(
        form,
        outputs=tuple(form.outputs[i] for i in kept),
        quantiles=tuple(form.quantiles[i] for i in kept) if form.quantiles else (),
        surpluses=surpluses if any(surplus is not None for surplus in surpluses) else (),
        most=tuple(form.most[i] for i in kept) if form.most else (),
        labels=tuple(form.labels[i] for i in kept) if form.labels else (),
        features=features,
        offset=form.offset[kept],
        constant=form.constant[kept],
    )
