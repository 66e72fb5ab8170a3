"""Descents on the units that decide: tangent linear programmes on a lattice, where SLSQP ends on kinks.

A quantile of few units has a kink wherever another unit becomes the decisive one. SLSQP ends on these, at whichever the
last digit of a processor leads to. Here all points lie on a lattice that is coarser than a rounding, comparisons
have room, and the tangents of all points that are near stand for the kinks between them (Kelley 1960, within
a trust distance).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from ...section import Array
from ..run import Run
from ..settings import Budget
from .local import Branch

STARTS = 4
"""Starts of a problem from which descents begin at most."""
FEW_UNITS = 256
"""Units up to which any end of SLSQP on a sample may be a kink: descents, quick there, are compared with its ends."""

LATTICE = 1e-4
"""Distance of the points of a descent in scaled coordinates."""
WIDEST, NARROWEST = 0.2, 1e-3
"""Trust distances in scaled coordinates, of which each is half of the one before."""
POINTS, NULL_STEPS = 150, 6
"""Points of a descent at most, and steps in a row that gain nothing before the trust distance is halved."""
ROOM = 3e-4
"""Violation by which linear programmes keep limits, so that points of the lattice do."""
GAIN = 1e-6
"""Fraction of a value by which a step gains at least."""
PENALTY = 100.0
"""Price of a broken limit in a linear programme, in scales of the objective."""


class Point(NamedTuple):
    """A point y (size,) of the lattice: objective and violations (k,), both as scaled, and their slopes."""

    y: Array
    f: float
    g: Array
    df: Array
    dg: Array

    @property
    def violation(self) -> float:
        """The largest violation, 0 where all limits are kept."""
        return float(self.g.max(initial=0.0))

    def improves(self, other: Point) -> bool:
        """Whether it keeps the limits better than another point, or is cheaper and keeps them as well."""
        if other.violation > 0.0:
            return self.violation <= 0.0 or self.violation < other.violation - GAIN
        return self.violation <= 0.0 and self.f < other.f - GAIN * abs(other.f)


class End(NamedTuple):
    """The objective, as scaled, and the search vector (1, variables) where a descent ended within the limits."""

    f: float
    x: Array


class Descents:
    """The descents of a search on the fresh units of its problem, each done once and within the budget of its `run`."""

    def __init__(self, run: Run) -> None:
        self._run, self._problem, self._fresh = run, run.problem, run.problem.on_fresh_units()
        self._ends: dict[tuple[int, ...], End | None] = {}

    @staticmethod
    def of(run: Run) -> Descents | None:
        """Those of a search for the least of one objective; None where there are more, or no fresh units."""
        return Descents(run) if run.problem.n_obj == 1 and run.problem.fresh_units else None

    @property
    def few_units(self) -> bool:
        """Whether so few units decide that any end of SLSQP may lie on a kink."""
        return self._problem.fresh_units <= FEW_UNITS

    def cheapest(self, sets: Sequence[Array], unit: Array) -> Array | None:
        """The search vector (1, variables) of the least objective that descents lead to, None where none of them keeps
        the limits; `sets` are search vectors with the integers to try, `unit` is the scale of the objective.

        They begin from the first start of the problem in every set, and from the others in the set that comes out
        cheapest; never from where a search stopped, so that the end does not depend on it. Once the budget is spent,
        none begins, and one in progress ends where it is.
        """
        best: End | None = None
        nearest = sets[0]
        for integers in sets:
            end = self._end(integers, 0, unit)
            if end and (not best or end.f < best.f - GAIN * abs(best.f)):
                best, nearest = end, integers
        for start in range(1, STARTS if best else 1):
            end = self._end(nearest, start, unit)
            if end and best and end.f < best.f - GAIN * abs(best.f):
                best = end
        return None if best is None else best.x

    def _end(self, integers: Array, start: int, unit: Array) -> End | None:
        """Where the descent from a start of the problem ends, None without such a start, or beyond the limits."""
        branch = Branch(Run(self._fresh, Budget(), seed=0), integers, unit)
        key = *np.rint(integers[~branch.smooth.moving]).astype(int).tolist(), start
        if key in self._ends or self._run.spent:
            return self._ends.get(key)
        starts = branch.starts(Run(self._problem, Budget(), seed=0))
        self._ends[key] = None
        if start < len(starts):
            end = descended(branch, starts[start], self._goes_on)
            x = branch.smooth.vectors(end.y[None, :])
            if np.all(self._problem.tested(x)[1] <= 0.0):
                self._ends[key] = End(end.f, x)
        return self._ends[key]

    def _goes_on(self) -> bool:
        """Whether budget is left, after the progress has been reported."""
        self._run.phase("descents on fresh units")
        self._run.pulse()
        return not self._run.spent


def descended(branch: Branch, start: Array, goes_on: Callable[[], bool] = lambda: True) -> Point:
    """Where a descent from a point (size,) ends on the units that the branch searches; its best point so far once it
    no longer `goes_on`.
    """

    def point(y: Array) -> Point:
        f, g = branch.smooth.values(y)
        df, dg = branch.smooth.slopes(y)
        return Point(y, float(f[0] / branch.unit[0]), g, df[0] / branch.unit[0], dg)

    best = point(_on_lattice(start))
    points, trust, failed = [best], WIDEST, 0
    while trust >= NARROWEST and len(points) < POINTS and goes_on():
        y = _on_lattice(_step(best, points, trust))
        known = any(np.array_equal(y, other.y) for other in points)
        if not known:
            points.append(point(y))
        if not known and points[-1].improves(best):
            best, failed = points[-1], 0
        elif known or failed >= NULL_STEPS:
            trust, failed = 0.5 * trust, 0
        else:
            failed += 1
    return best


def _step(best: Point, points: list[Point], trust: float) -> Array:
    """The point (size,) of the linear programme of all tangents at points within the trust distance of the best."""
    near = [point for point in points if np.all(np.abs(point.y - best.y) <= trust + 0.5 * LATTICE)]
    size, rows, ends = len(best.y), [], []
    for point in near:
        to_best = best.y - point.y
        rows.append(np.concatenate([point.df, [-1.0, 0.0]]))
        ends.append(-min(float(point.f + point.df @ to_best), best.f))
        for g, slope, own in zip(point.g, point.dg, best.g, strict=True):
            rows.append(np.concatenate([slope, [0.0, -1.0]]))
            ends.append(-min(g + slope @ to_best, own) - ROOM)
    low, high = np.maximum(-trust, -best.y), np.minimum(trust, 1.0 - best.y)
    bounds = [*zip(low, high, strict=True), (None, None), (0.0, None)]
    price = np.concatenate([np.zeros(size), [1.0, PENALTY]])
    solution = scipy.optimize.linprog(price, np.array(rows), np.array(ends), bounds=bounds)
    return best.y if solution.x is None else best.y + solution.x[:size]


def _on_lattice(y: Array) -> Array:
    """The nearest point of the lattice."""
    return np.asarray(np.clip(np.rint(y / LATTICE) * LATTICE, 0.0, 1.0))
