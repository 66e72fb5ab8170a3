"""The front of a form that is a bound: solved on the form, corrected by the full model.

A form that understates its requirements has nearly the right tolerances at slightly wrong limits.
Every point is solved again with its limits moved by the excess of the model over the form, so that
it keeps them by the model. The ends of the front, the least of each objective, are solved first.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...journal import recall_arrays
from ...problems.forms import Form, least_value
from ...section import Array, Flags, Integers
from ..run import Run
from .bounds import row_limits
from .choices import least_cost, search_vector
from .combination import Combination, Optimum, arc_length
from .programme import Programme

MAX_COARSE_LEVELS = 24
"""Levels of a coarse front, by which the points are spread."""
FIRST = 5e-4
"""Fraction of the range of levels between the least one, which leaves no room, and the first."""
STEPS = (-4, 4, -1, 1)
"""Steps of ways that are tried from the ways of the form's optimum."""
MANY_WAYS_THRESHOLD = 12
"""Ways of a feature above which long steps are tried."""
ROUNDS, FURTHER = 5, 10
"""Times that limits are moved, and further times where a point still breaks them by little."""
RELATIVE_LIMIT_SLACK = 2e-3
"""Fraction of a level by which a point may miss it, because the value of the point counts."""
DEARER, FAR = 1.003, 2e-3
"""A point of a cost higher by this factor is not corrected further where it breaks limits by less
than this fraction."""
EXCESS_TOLERANCE = 1e-5
"""Fraction of a limit's scale by which a point may stay inside it."""
INSIDE = 2e-6
"""Fraction of a limit's scale by which a point is to stay inside it."""


@dataclass(frozen=True, slots=True)
class Point:
    """A search vector (variables,) within limits by the full model; ways, cost, t (features,)."""

    ways: tuple[int, ...]
    x: Array
    cost: float
    t: Array


@dataclass(eq=False)
class Corrected:
    """Allocations of a form that keep limits by the full model."""

    run: Run
    form: Form
    _moved: Array | None = field(default=None, init=False)
    _start: Array | None = field(default=None, init=False)
    _apart: Integers | None = field(default=None, init=False)

    def best(self, ways: tuple[int, ...], limit: Array) -> Point | None:
        """The cheapest allocation that keeps limits (r,), by `ways` (features,) and those near.

        The ways of the form's optimum are the best only as far as the form is right: the ways next
        to them are tried as long as they are cheaper.
        """
        best = self.point(self._expected(ways), limit)
        if best is None:
            best = self.point(ways, limit)
        for at, step in self._steps():
            while best is not None and self._has(at, best.ways[at] + step):
                move = (*best.ways[:at], best.ways[at] + step, *best.ways[at + 1 :])
                neighbour = self.point(move, limit, than=best.cost)
                if neighbour is None or neighbour.cost >= best.cost:
                    break
                best = neighbour
        if best is not None:
            self._apart = np.subtract(best.ways, ways)
        return best

    def _expected(self, ways: tuple[int, ...]) -> tuple[int, ...]:
        """The ways of the form's optimum, moved by as many steps as the best ways last time."""
        if self._apart is None:
            return ways
        return tuple(
            min(max(way + int(step), 0), len(feature.ways) - 1) if len(feature.ways) > MANY_WAYS_THRESHOLD else way
            for way, step, feature in zip(ways, self._apart, self.form.features, strict=True)
        )

    @property
    def _open(self) -> list[int]:
        """Features with several ways, those with most first."""
        open_features = [at for at, feature in enumerate(self.form.features) if len(feature.ways) > 1]
        return sorted(open_features, key=lambda at: -len(self.form.features[at].ways))

    def _has(self, at: int, way: int) -> bool:
        return 0 <= way < len(self.form.features[at].ways)

    def _steps(self) -> list[tuple[int, int]]:
        """Feature and step; long steps only where a feature has many ways and no best way is known."""
        return [
            (at, step)
            for at in self._open
            for step in STEPS
            if abs(step) == 1 or (len(self.form.features[at].ways) > MANY_WAYS_THRESHOLD and self._apart is None)
        ]

    def point(self, ways: tuple[int, ...], limit: Array, least: int = -1, than: float = np.inf) -> Point | None:
        """The allocation of least cost at limits (r,), made in `ways`; None without any.

        Where `least` is a row, its value is minimised and its limit ignored. The result is None too
        where the cost is clearly higher than `than`.
        """
        nothing = np.zeros(0)

        def arrays() -> tuple[Array | Integers, ...]:
            point = self._point(ways, limit, least, than)
            after = (nothing if array is None else array for array in (self._moved, self._start))
            if point is None:
                return (nothing, *after)
            return (point.x, *after, np.array(point.cost), point.t, np.array(point.ways, dtype=np.int64))

        x, moved, start, *more = recall_arrays((np.array(ways), limit, least, than), arrays)
        self._moved, self._start = (array if len(array) else None for array in (moved, start))
        return Point(tuple(more[2].tolist()), x, float(more[0]), more[1]) if more else None

    def _point(self, ways: tuple[int, ...], limit: Array, least: int, than: float) -> Point | None:
        problem, best = self.run.problem, None
        real = np.isfinite(limit)
        scale = Combination(self.form, ways).sizes(limit)
        moved = limit if self._moved is None else np.where(real, limit + self._moved, limit)
        t: Array | None = None
        for done in range(ROUNDS + FURTHER):
            t = self._solved(ways, moved, least, self._start if t is None else t)
            if t is None:
                break
            x = search_vector(problem, self.form, ways, t)[0]
            designs = problem.complete(x[None, :])
            outputs = problem.needed_outputs(designs)
            values = problem.form_values(self.form, designs, outputs)[0]
            kept = np.all(problem.violations(designs, outputs) <= 0.0)
            cost = float(values[least] if least >= 0 else outputs["cost"][0])
            if kept and self._near_enough(values, limit, least) and (best is None or cost < best.cost):
                best = Point(ways, x, cost, t)
            excess = np.subtract(values, limit, out=np.zeros_like(values), where=real) / scale
            if cost > than * DEARER and np.all(excess < FAR):
                return None
            if best is not None and (
                done + 1 >= ROUNDS or np.all(np.abs(excess[self._active(moved, t, ways, scale)]) < EXCESS_TOLERANCE)
            ):
                break
            if done + 1 >= ROUNDS and np.any(excess >= FAR):
                break
            # a limit that the model breaks but the form does not reach starts at the form's value
            base = np.where(excess > 0.0, np.minimum(moved, self._values(ways, t)), moved)
            counts = real & self._answers_for_excess(excess, self._active(moved, t, ways, scale))
            moved = np.where(counts, base - scale * (excess + INSIDE), moved)
        if best is not None:
            self._moved = np.subtract(moved, limit, out=np.zeros_like(limit), where=real)
            self._start = best.t
        return best

    def _active(self, limit: Array, t: Array, ways: tuple[int, ...], scale: Array) -> Flags:
        """Which limits (r,) hold an allocation back."""
        values, real = self._values(ways, t), np.isfinite(limit)
        level = np.where(real, limit, 0.0)
        return np.asarray(real & (values >= level - 1e-6 * scale))

    def _answers_for_excess(self, excess: Array, active: Flags) -> Flags:
        """Which limits (r,) are moved by an excess: of several that stand for one output, such as a joint yield, those
        that hold the allocation back, or all where it is broken and none does.
        """
        same = np.equal.outer(np.array(self.form.outputs), np.array(self.form.outputs))
        led = np.any(same & active, axis=1)
        return np.asarray((np.count_nonzero(same, axis=1) == 1) | active | ((excess > 0.0) & ~led))

    def _values(self, ways: tuple[int, ...], t: Array) -> Array:
        """The form's values of an allocation, (r,)."""
        return np.asarray(Combination(self.form, ways).values(t[None, :])[0])

    def _near_enough(self, values: Array, limit: Array, least: int) -> bool:
        """Whether a point keeps limits of the requirements that the problem does not check."""
        slack = np.where(np.isfinite(self.form.own_limits), np.inf, RELATIVE_LIMIT_SLACK * np.abs(limit))
        if least >= 0:
            slack[least] = np.inf
        return bool(np.all(values <= limit + slack))

    def _solved(self, ways: tuple[int, ...], limit: Array, least: int, start: Array | None) -> Array | None:
        """Tolerances (features,) of least cost, from a `start`, or of the least value of a row."""
        if least >= 0:
            lowest = least_value(self.form.made_in(ways), least, limit)
            return None if lowest is None else lowest.t
        return Programme(Combination(self.form, ways)).allocation(limit, start)


def is_corrected(form: Form) -> bool:
    """Whether a form is a bound that its problem's own values correct."""
    return bool(form.quantiles) and not form.exact


def corrected_vectors(run: Run, form: Form, points: int) -> Array:
    """Search vectors (k, variables) of about `points` along the front, or of the least cost."""
    limits = row_limits(run.problem, form)
    limited, corrected = np.isfinite(form.own_limits), Corrected(run, form)
    swept = np.array([name in run.problem.objectives for name in form.outputs]) & ~limited
    if run.problem.n_obj == 1 or np.count_nonzero(swept) != 1:
        cheapest = least_cost(form, limits[None, :])
        best = corrected.best(tuple(cheapest.chosen[0].tolist()), limits)
        return np.empty((0, run.problem.n_var)) if best is None else best.x[None, :]
    row = int(np.argmax(swept))
    run.phase("ends of the front", 0.05)
    ends, chosen_at_end = _range_along_front(form, limits, row)
    end = corrected.point(chosen_at_end, limits, least=row)
    x = [] if end is None else [end.x]
    asked, chosen = _levels(run, form, limits, row, ends, points)
    if end is not None and len(asked) == points <= MAX_COARSE_LEVELS:
        asked, chosen = asked[1:], chosen[1:]  # of few points none is next to the least level
    before: Point | None = None
    for done, (limit, ways) in enumerate(zip(asked, chosen.tolist(), strict=True)):
        run.phase("points on the full model", 0.3 + 0.7 * done / len(asked))
        best = corrected.best(tuple(ways), limit)
        if before is not None and best is not None and before.ways not in (tuple(ways), best.ways):
            alternative = corrected.point(before.ways, limit, than=best.cost)
            best = best if alternative is None or alternative.cost >= best.cost else alternative
        if best is not None:
            x.append(best.x)
            before = best
    return np.array(x).reshape(len(x), run.problem.n_var)


def _range_along_front(form: Form, limits: Array, row: int) -> tuple[tuple[float, float], tuple[int, ...]]:
    """Least and largest value of a row along the front, and the ways of the least."""
    free = limits.copy()
    free[row] = np.inf
    cheapest = least_cost(form, limits[None, :])
    chosen = tuple(cheapest.chosen[0].tolist())
    most = float(Combination(form, chosen).values(cheapest.t)[0, row])
    same = least_value(_fix_tolerances(form.made_in(chosen), cheapest.t[0]), row, free * (1.0 + 1e-9))
    least = least_value(form, row, free)
    if least is None:
        return (most, most), chosen
    return (least.value, most if same is None else min(most, same.value)), least.chosen


def _levels(
    run: Run, form: Form, limits: Array, row: int, ends: tuple[float, float], points: int
) -> tuple[Array, Integers]:
    """Limits (n, r) spread by the arc length of a coarse front, and ways (n, features) for each."""
    low, high = ends
    steps = np.linspace(0.0, 1.0, max(2, min(MAX_COARSE_LEVELS, points))) ** 2
    coarse = low + (high - low) * np.maximum(steps, FIRST)
    run.phase("coarse front", 0.1)
    optima, asked = _solve_at_levels(form, limits, row, coarse)
    if len(asked) < 2 or points <= len(coarse):
        return asked, optima.chosen
    length = arc_length(np.stack([asked[:, row], optima.cost]))
    even = np.interp(np.linspace(0.0, length[-1], points), length, asked[:, row])
    chosen = optima.chosen[np.argmin(np.abs(even[:, None] - asked[:, row]), axis=1)]
    fine = np.tile(limits, (points, 1))
    fine[:, row] = even
    return fine, chosen


def _solve_at_levels(form: Form, limits: Array, row: int, levels: Array) -> tuple[Optimum, Array]:
    """The form solved at levels (n,) of a row, and the limits (n, r); those that exist."""
    asked = np.tile(limits, (len(levels), 1))
    asked[:, row] = levels
    optima = least_cost(form, asked)
    real = np.isfinite(optima.cost)
    return optima.at(np.flatnonzero(real)), asked[real]


def _fix_tolerances(form: Form, t: Array) -> Form:
    """A form of one way per feature with every tolerance that has a cost held at t (features,)."""
    features = tuple(
        feature
        if np.ptp(feature.ways[0].curve.cost(np.array([way.low, way.high]))) == 0.0
        else replace(feature, ways=(replace(way, low=float(at), high=float(at)),))
        for feature, at in zip(form.features, t, strict=True)
        for way in feature.ways
    )
    return replace(form, features=features)
