"""Proven lower bounds of cost, at limits and at the points of a front; costs that are not convex are several
ways with convex ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import ModelError
from ...problems.forms import Feature, Form, Way, largest_parts, least_values
from ...problems.limits import LIMIT_ROUNDING, loosened
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array, Flags
from .choices import cost_range, least_cost
from .combination import Combination, Optimum, less_rounding, spread_at, tabulate_priced_costs


def convex_pieces(form: Form) -> Form:
    """The form with every way cut where its cost curve bends down: in each piece it is convex."""
    return form.with_ways(lambda _, feature: (piece for way in feature.ways for piece in _pieces(way)))


def _pieces(way: Way) -> list[Way]:
    edges = [way.low, *(t for t in way.curve.bends if way.low < t < way.high), way.high]
    return [replace(way, low=low, high=high) for low, high in pairwise(edges)]


# Bounds at many limits from the solutions at some: the prices of a neighbour are nearly right.


FIRST, SOLVED = 12, 48
"""Sets of limits that are solved first where there are more, and at most."""
LOST = 5e-4
"""Fraction of a cost that a bound by its neighbours' prices may lose before it is solved itself."""
GRID = np.geomspace(0.6, 1.6, 15)
"""Prices that are tried, in units of a neighbour's."""
PAIRS = 1024
"""Combinations of ways that are bounded separately at most."""


def least_bounds(form: Form, limits: Array) -> Array:
    """Proven least costs (n,) at limits (n, r).

    Quantiles take long: at most `SOLVED` sets are solved for them. The others have the Lagrangian
    bounds of their neighbours' prices, or the proven bound at wider limits where it is larger. The
    loss of a bound is estimated from the neighbours' costs: the set that may lose most is solved next.
    """
    if not form.quantiles or len(limits) <= FIRST:
        return least_cost(form, limits).bound
    order = np.lexsort(limits.T[::-1])
    course = _Course(form, limits[order])
    course.solve(np.unique(np.linspace(0, len(order) - 1, FIRST).astype(int)))
    while len(worst := course.worst()):
        course.solve(worst)
    bound = np.empty(len(limits))
    bound[order] = course.bound
    return bound


class _Course:
    """Sets of limits (n, r) in order, some of them solved, with the bounds (n,) of all."""

    def __init__(self, form: Form, limits: Array) -> None:
        self.form, self.limits = form, limits
        self.bound = np.full(len(limits), -np.inf)
        self.cost = np.full(len(limits), np.inf)
        self.solved = np.zeros(len(limits), dtype=bool)
        moving = np.flatnonzero(np.ptp(np.nan_to_num(limits, posinf=0.0), axis=0) > 0.0)
        self._axis = int(moving[0]) if len(moving) == 1 else None

    def solve(self, rows: NDArray[np.intp]) -> None:
        """Solve some sets of limits, and bound those between by them."""
        known = least_cost(self.form, self.limits[rows])
        self.bound[rows], self.cost[rows], self.solved[rows] = known.bound, known.cost, True
        rest = np.flatnonzero(~self.solved)
        place = np.searchsorted(np.flatnonzero(self.solved), rest)
        for side in (-1, 0):
            every = np.flatnonzero(self.solved)
            near = every[np.clip(place + side, 0, len(every) - 1)]
            at = np.searchsorted(rows, near)
            new = (at < len(rows)) & np.isfinite(self.cost[near])
            new[new] = rows[at[new]] == near[new]
            if np.any(new):
                neighbour_bound = _bound_by_tangents(self.form, known.at(at[new]), self.limits[rest[new]])
                self.bound[rest[new]] = np.maximum(self.bound[rest[new]], neighbour_bound)
        wider = np.all(self.limits[rows][None, :, :] >= self.limits[rest][:, None, :], axis=2)
        proven = np.where(wider, known.bound[None, :], -np.inf).max(axis=1, initial=-np.inf)
        self.bound[rest] = np.maximum(self.bound[rest], proven)

    def worst(self) -> NDArray[np.intp]:
        """The sets between solved ones whose bounds may lose most, one in each gap."""
        every, rest = np.flatnonzero(self.solved), np.flatnonzero(~self.solved)
        if not len(rest) or len(every) >= SOLVED:
            return np.empty(0, dtype=np.intp)
        above = self._most(every, rest)
        bound, lost = self.bound[rest], np.full(len(rest), np.inf)
        real = np.isfinite(above)
        lost[real] = above[real] - bound[real] - LOST * np.abs(above[real])
        lost[bound == np.inf] = -np.inf  # proven impossible: there is nothing to gain
        gap = np.searchsorted(every, rest)
        worst_rows = [rest[gap == index][np.argmax(lost[gap == index])] for index in np.unique(gap[lost > 0.0])]
        return np.array(worst_rows[: SOLVED - len(every)], dtype=np.intp)

    def _most(self, every: NDArray[np.intp], rest: NDArray[np.intp]) -> Array:
        """Costs (n,) that the unsolved ones hardly exceed: along one limit the chord's."""
        if self._axis is None:
            at = np.searchsorted(every, rest)
            return np.asarray(self.cost[every[np.clip(at - 1, 0, None)]])
        x = self.limits[:, self._axis]
        return np.asarray(np.interp(x[rest], x[every], self.cost[every]))


def _bound_by_tangents(form: Form, near: Optimum, limits: Array) -> Array:
    """Lagrangian bounds (n,) at limits (n, r) by the tangents and multiples of prices of `near`."""
    spread = spread_at(form, near.chosen, near.t, largest_parts(form))
    tables, received = tabulate_priced_costs(form, GRID, near.multiplier, limits, spread)
    return np.asarray(form.base + np.max(less_rounding(_combine_ways(tables), received), axis=1).min(axis=0))


def _combine_ways(tables: list[Array]) -> Array:
    """Costs plus prices (combinations, g, n) of every combination of ways, or of the best ways alone."""
    count = int(np.prod([float(len(table)) for table in tables]))
    if count > PAIRS:
        tables = [table.min(axis=0, keepdims=True) for table in tables]

    def joined(first: Array, second: Array) -> Array:
        return np.asarray((first[:, None] + second[None, :]).reshape(-1, *first.shape[1:]))

    return np.asarray(reduce(joined, tables))


# How far points are from the best possible: proven lower bounds of their cost.


LOOSER = 1e-11
"""Relative widening of a point's own values, so that the point always keeps them."""
LIMIT_WIDENING = 2.0
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
    form = problem.priced_form()
    missing = reason(problem, form)
    if missing:
        return Proof.without(points, missing)
    cost = np.asarray(values[problem.priced])
    if form is None:
        known = problem.cost_bound()
        assert known is not None  # else there is a reason
        bound = known.least_costs(values, points)
        return Proof(_checked(problem, bound, cost, np.abs(cost)), known.statement)
    if not points:
        return Proof(np.empty(0), form.statement, form.relaxed)
    own = [_values_if_required(problem, form, values, name, points) for name in form.outputs]
    limits = np.minimum(
        loosened(np.stack(own, axis=1), LOOSER / LIMIT_ROUNDING), loosened(row_limits(problem, form), LIMIT_WIDENING)
    )
    distinct, place = np.unique(limits, axis=0, return_inverse=True)
    bound = _least_bound(form, distinct)[np.ravel(place)]
    size = np.maximum(np.abs(cost), np.min(np.abs(cost_range(form))))
    statement, omitted = form.statement, form.relaxed
    if held := problem.held_costs:
        most = np.array([_most_of(problem, values, name, points) for name in held]).T
        higher = _bounds_within_costs(problem, form, limits, held, most, cost)
        if higher is None:
            omitted, statement = (*omitted, *held), f"{statement}; {', '.join(held)} left out"
        else:
            bound, statement = higher, f"{statement}, at no more {', '.join(held)}"
    return Proof(_checked(problem, bound, cost, size), statement, omitted)


# Bounds of a cost while further costs keep limits: Lagrangian ones, by forms of weighted sums of the costs.
#
# For any weights w >= 0 no design that keeps D(t) <= d costs less than min (C + w D) - w d. That is concave
# in w; its tangent at a solution t is D(t) - d, from which the next weights follow (Kelley 1960).


SOLVED_WITHIN, SOLVED_QUANTILES = 24, 4
"""Points whose weights are searched, and those where quantiles take long; others take their neighbours' weights."""
WEIGHTINGS = 40
"""Weights that are tried for a point at most."""
WEIGHTED_GAP = 1e-8
"""Relative gap between a bound and what better weights could add, at which a search ends."""
APART = 16
"""Choices of ways that are bounded apart at most, where all points of a front are searched; more of fewer points."""
LARGEST_WEIGHT, LARGER = 4.0, 30.0
"""Weights at most at first, in units of the ratio of the ranges of both costs, and how much larger they may be next."""


def _most_of(problem: ToleranceProblem, values: Mapping[str, Array], name: str, points: int) -> Array:
    """The most (n,) of a cost: that of the point where it is an objective, and the limit of the problem."""
    own = np.asarray(values[name]) if name in problem.objectives else np.full(points, np.inf)
    limit = float(loosened(np.array(upper_limit(problem, name)), LIMIT_WIDENING))
    return np.asarray(np.minimum(own + LOOSER * np.abs(own), limit))


def apart(form: Form, most: int = APART) -> list[Form]:
    """The form in each choice of ways by itself, where these are few: weighted costs leave gaps between choices."""
    few = 1 < form.combinations <= most and not form.also
    return [form.made_in(choice) for choice in form.choices()] if few else [form]


def _bounds_within_costs(
    problem: ToleranceProblem, priced: Form, limits: Array, names: tuple[str, ...], most: Array, cost: Array
) -> Array | None:
    """Bounds (n,) at limits (n, r) and at most `most` (n, k) of some costs; None where these have no form.

    Few choices of ways are bounded apart, where nothing but their convexity is needed for the best weights to leave
    no gap; the least of their bounds is that of all, so that one is done with at the `cost` (n,) of a point. `priced`
    is the form of the cost without the others.
    """
    plain = problem.form()
    if plain is None or not _Weighted(problem, plain, names).known:
        return None
    order = np.lexsort([*most.T, *np.where(np.isfinite(limits), limits, 0.0).T])
    few = SOLVED_QUANTILES if plain.quantiles else SOLVED_WITHIN
    solved = np.unique(order[np.linspace(0, len(order) - 1, few).astype(int)])
    place, step = np.argsort(order), max(1, len(order) // few)
    bounds, choices = [], APART * SOLVED_WITHIN // len(solved)
    for form, alone in zip(apart(plain, choices), apart(priced, choices), strict=True):
        weighted, bound = _Weighted(problem, form, names), _least_bound(alone, limits)
        best = bound.copy()
        for at in solved:
            near = np.flatnonzero((np.abs(place - place[at]) <= step) & (best < cost))
            for weights in weighted.best_weights(limits[at], most[at], bound[at]) if len(near) else ():
                best[near] = np.maximum(best[near], weighted.bounds(weights, limits[near], most[near]))
        bounds.append(best)
    return np.asarray(np.min(bounds, axis=0))


class _Weighted:
    """Forms of the priced cost plus weighted others."""

    def __init__(self, problem: ToleranceProblem, form: Form, names: tuple[str, ...]) -> None:
        self._problem, self._plain, self._names = problem, form, names
        alone = [self.form(weights, priced=0.0) for weights in np.eye(len(names))]
        self._alone = [of for of in alone if of is not None]
        self.known = len(self._alone) == len(names) and self.form(np.zeros(len(names))) is not None

    def form(self, weights: Array, priced: float = 1.0) -> Form | None:
        """The form at weights (k,) of the others."""
        terms = {self._problem.priced: priced} | dict(zip(self._names, weights.tolist(), strict=True))
        return self._problem.weighted_form(self._plain, terms)

    def bounds(self, weights: Array, limits: Array, most: Array) -> Array:
        """Bounds (n,) at one set of weights (k,)."""
        form = self.form(weights)
        assert form is not None
        least, given = _least_bound(form, limits), np.where(weights > 0.0, most, 0.0) @ weights
        return np.asarray(less_rounding(least, given))

    def _costs_at(self, form: Form, limits: Array) -> tuple[float, Array] | None:
        """Least weighted cost at limits (r,), and the costs (k,) of a design that has it."""
        used = np.isfinite(limits)
        used[0] |= not np.any(used)
        optimum = least_cost(convex_pieces(restrict_form(form, used)), limits[None, used])
        if not np.isfinite(optimum.cost[0]):
            return None
        way_of = [[at for at, way in enumerate(f.ways) for _ in _pieces(way)] for f in form.features]
        chosen = tuple(ways[piece] for ways, piece in zip(way_of, optimum.chosen[0], strict=True))
        costs = [Combination(alone, chosen).cost(optimum.t)[0] for alone in self._alone]
        return float(optimum.bound[0]), np.array(costs)

    def best_weights(self, limits: Array, most: Array, bound: float) -> list[Array]:
        """The weights (k,) of the highest bound at limits (r,) and at most `most` (k,); none where 0 is best."""
        if not np.isfinite(bound):
            return []
        plain = self.form(np.zeros(len(most)))
        assert plain is not None
        start = self._costs_at(plain, limits)
        held, level = np.isfinite(most), np.where(np.isfinite(most), most, 0.0)
        if start is None or np.all(start[1][held] <= most[held]):
            return []
        spans = [max(*np.diff(ends), 1e-12 * abs(ends[1]), 1e-300) for ends in map(cost_range, [plain, *self._alone])]
        unit, none = spans[0] / np.array(spans[1:]), np.zeros(len(most))
        slopes, right = [np.where(held, start[1] - level, 0.0) * unit], [start[0]]
        best, chosen, reach = -np.inf, none, LARGEST_WEIGHT
        for _ in range(WEIGHTINGS):
            # maximise y with y <= value_m + slope_m (w - w_m)
            rows = np.hstack([-np.array(slopes), np.ones((len(slopes), 1))])
            ends = [*((0.0, reach if of else 0.0) for of in held), (None, None)]
            found = scipy.optimize.linprog([*none, -1.0], A_ub=rows, b_ub=right, bounds=ends)
            if found.x is None or found.fun is None:
                break
            weights = np.asarray(found.x[:-1])
            if best > -np.inf and -found.fun - best <= WEIGHTED_GAP * max(abs(best), 1e-300):
                if not np.any(chosen >= reach):
                    break
                reach *= LARGER
                continue
            form = self.form(weights * unit)
            known = None if form is None else self._costs_at(form, limits)
            if known is None:
                break
            value = known[0] - level @ (weights * unit)
            slopes.append(np.where(held, known[1] - level, 0.0) * unit)
            right.append(value - float(slopes[-1] @ weights))
            if value > best:
                best, chosen = value, weights
        return [chosen * unit] if np.any(chosen > 0.0) else []


def _checked(problem: ToleranceProblem, bound: Array, cost: Array, size: Array) -> Array:
    """Bounds (n,), none above its cost. Raises ModelError where one is, by more than rounding of a `size` (n,)."""
    excess = np.subtract(bound, cost, out=np.full(len(cost), -np.inf), where=np.isfinite(cost))
    if np.any(excess > 1e-9 * size):
        at = int(np.argmax(excess))
        raise ModelError(
            f"the proven bound {bound[at]} lies above a cost of {cost[at]}: the form "
            f"of {type(problem).__name__} does not bound that cost"
        )
    return np.minimum(bound, cost)


def _least_bound(form: Form, limits: Array) -> Array:
    """Proven least costs (n,) of a form and of the forms of the designs that it omits.

    A design that is too expensive at the widest limits is so at all of them.
    """
    bound = bounds_within(form, limits)
    for alternative in form.also:
        wide = np.full(len(alternative.outputs), np.inf)
        shared = [alternative.outputs.index(name) if name in alternative.outputs else -1 for name in form.outputs]
        alternative_limits = np.tile(np.minimum(wide, alternative.own_limits), (len(limits), 1))
        for at, row in enumerate(shared):
            if row >= 0:
                alternative_limits[:, row] = limits[:, at]
        rest = bound > bounds_within(alternative, alternative_limits.max(axis=0)[None, :])[0]
        if np.any(rest):
            bound[rest] = np.minimum(bound[rest], bounds_within(alternative, alternative_limits[rest]))
    return bound


def bounds_within(form: Form, limits: Array) -> Array:
    """Proven least costs (n,) of one form at limits (n, r)."""
    used = np.any(np.isfinite(limits), axis=0)
    used[0] |= not np.any(used)
    form, limits = convex_pieces(restrict_form(form, used)), limits[:, used]
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
            possible &= limits[:, row] >= least.value - LIMIT_WIDENING * LIMIT_ROUNDING * abs(least.value)
    return possible


def reason(problem: ToleranceProblem, form: Form | None) -> str:
    """Why nothing can be proven of the points of a problem; empty where something can."""
    if problem.priced not in problem.objectives:
        return "cost is not an objective"
    if form is None:
        bound = problem.cost_bound() if problem.priced == "cost" else None
        return "the problem has no convex form" if bound is None else bound.missing
    known_by = (*problem.cost_names, *form.outputs, *form.stands.values())
    others = [name for name in problem.objectives if name not in known_by]
    if others:
        known = ", ".join(form.outputs)
        why = problem.unproven()
        return f"no convex form of {', '.join(others)} is known (there is one of {known}){f': {why}' if why else ''}"
    return ""


def upper_limit(problem: ToleranceProblem, name: str) -> float:
    """The upper limit of an output, inf where there is none."""
    return next((limit.high for limit in problem.limits if limit.name == name), np.inf)


def row_limits(problem: ToleranceProblem, form: Form) -> Array:
    """The upper limits (r,) that the problem sets to the requirements of its form; own ones are in place of them."""
    own = form.own_limits
    return np.where(np.isfinite(own), own, [upper_limit(problem, name) for name in form.outputs])


def _values_if_required(
    problem: ToleranceProblem, form: Form, values: Mapping[str, Array], name: str, points: int
) -> Array:
    """The values at the points of a requirement that is an objective, or that represents an output
    which is an objective or limited; inf for others.
    """
    requested = {*problem.objectives, *(limit.name for limit in problem.limits)}
    required = name in problem.objectives or form.stands.get(name) in requested
    return np.asarray(values[name]) if required else np.full(points, np.inf)


def restrict_form(form: Form, used: Flags) -> Form:
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
