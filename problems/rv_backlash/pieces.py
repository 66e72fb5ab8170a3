"""The parts of the backlash of an RV reducer as members of a convex form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from ...models.costs import CostCurve, Reciprocal
from ...models.propagation.even import UNIFORM, Even, even_law
from ...models.propagation.sums import Term
from ...units import ARCMIN
from .bent import LEVELS, SAFE, Cell, quantiles_of, uniform_below
from .machined_tolerances import CELLS as CELLS_OF_MEANS
from .machined_tolerances import pieces_of
from .shift import Shift
from .terms import BEARING, GRADE, bearing_term, ends, grades_of, unit_terms

if TYPE_CHECKING:
    from .problem import RvBacklash

CELLS, COARSE = 48, 4
"""Pieces of the range of the eccentricity, in geometric steps; and pieces for designs at which
y - Y >= 0 fails, which are too expensive to be of interest."""
ROUNDING = 1e-6
"""Error of a mean by quantiles, as a fraction of the range."""


@dataclass(frozen=True)
class Member:
    """A way of a feature, whose deviation is `spread` t z, z ~ `law`, about mean + slope t.

    Means [arcmin] are bounds from below of those in the backlash (`mean`, `slope`), and from above
    in phi_2 (`top`, `top_slope`). `least` is the least value of its deviation, `range` the width,
    `units` are values of evenly many units, where they are known.
    """

    curve: CostCurve
    low: float
    high: float
    spread: float
    law: Even
    mean: float = 0.0
    slope: float = 0.0
    top: float = 0.0
    top_slope: float = 0.0
    least: float = 0.0
    range: float = 0.0
    cell: Cell | None = None
    units: Array | None = None
    choice: float = 0.0

    def above(self, fraction: float) -> float:
        """A value that at least a fraction `fraction` of the units exceeds."""
        if self.units is None:
            return self.least
        quantile = float(np.quantile(self.units, 1.0 - fraction)) - SAFE * float(np.ptp(self.units))
        return max(self.least, quantile)


@dataclass(frozen=True)
class Part:
    """A feature of the form: its variable or choice, its ways, whether phi_2 contains it.

    A `bent` one is not even: it enters by a law that is below its own in convex order.
    """

    variable: str
    members: tuple[Member, ...]
    clipped: bool
    bent: bool = False
    choice: str = ""


@dataclass(frozen=True)
class Sum:
    """The parts of the backlash, the constant of phi_2 (`cycloid`) and what is added to all."""

    parts: tuple[Part, ...]
    shift: Shift
    cycloid: float
    effective_change: float


def sum_of(problem: RvBacklash, cut: float) -> Sum | str:
    """All parts of the backlash, or why there is none of their forms; `cut` as in `_grades`."""
    shift = problem.shift
    if shift is None:
        return "the ranges and limits of the modification leave no room"
    if problem.change.growth != 0.0:
        return "an effect inflates the spread"
    parts: list[Part] = []
    cycloid = 0.0
    if "eccentricity_um" in problem.machined_tolerances:
        return "the eccentricity is made by machines, whose law is not bounded"
    for name, term in unit_terms(problem).items():
        cycloid += float(term.constant[0]) / ARCMIN
        part = (
            _bent(problem, name, term) if term.quadratic is not None else _straight(problem, name, term, clipped=True)
        )
        if isinstance(part, str):
            return part
        parts.append(part)
    bearing = _straight(problem, BEARING, bearing_term(problem), clipped=False)
    if isinstance(bearing, str):
        return bearing
    parts += [bearing, _grades(problem, cut)]
    return Sum(tuple(parts), shift, cycloid, problem.change.effective / ARCMIN)


def _straight(problem: RvBacklash, name: str, term: Term, clipped: bool) -> Part | str:
    """A term that grows with its tolerance as a whole; of phi_2 its constant is counted apart."""
    known = even_law(term.distribution)
    if known is None:
        return f"the deviations of {name} are skewed or have poles"
    linear = float(term.linear[0]) / ARCMIN
    if name in problem.machined_tolerances:
        return _machines(problem, name, linear, known[1])
    slope = linear * known[0] + (0.0 if clipped else float(term.constant[0]) / ARCMIN)
    member = Member(
        problem.settings.costs[name], *ends(problem, name), abs(linear), known[1], slope=slope, top_slope=slope
    )
    return Part(name, (member,), clipped)


def _machines(problem: RvBacklash, name: str, linear: float, law: Even) -> Part:
    """A tolerance that machines make, by the spread of its good parts."""
    tolerance, moves = problem.machined_tolerances[name], problem.model.moves(name.removesuffix("_um"))
    members = []
    for piece in pieces_of(tolerance, ends(problem, name), CELLS_OF_MEANS if moves else 1):
        values = linear * moves * piece.means
        (slope, mean), (top_slope, top) = piece.line(values, 1.0), piece.line(values, -1.0)
        members.append(
            Member(
                piece.curve, piece.low, piece.high, abs(linear), law, mean, slope, top, top_slope, choice=piece.choice
            )
        )
    return Part(name, tuple(members), clipped=True, choice=tolerance.choice)


def _bent(problem: RvBacklash, name: str, term: Term, cells: int = CELLS) -> Part:
    """The eccentricity, cut into cells."""
    assert term.quadratic is not None
    low, high = ends(problem, name)
    b, q = float(term.linear[0]) / ARCMIN, float(term.quadratic[0]) / ARCMIN
    edges = np.geomspace(low, high, cells + 1) if low < high else np.array([low, high])
    members, z = [], quantiles_of(term.distribution)
    for start, end in pairwise(edges.tolist()):
        cell = Cell(term.distribution, b, q, start, end, z)
        (slope, mean), (top_slope, top) = cell.mean_below, cell.mean_above
        curve = problem.settings.costs[name]
        members.append(
            Member(curve, start, end, cell.spread, UNIFORM, mean, slope, top, top_slope, cell.least, cell.range, cell)
        )
    return Part(name, tuple(members), clipped=True, bent=True)


def coarse(problem: RvBacklash, total: Sum, grades: bool = False) -> Sum:
    """The sum with few cells, for designs of no interest; without `grades` one that is better than
    all stands for them.
    """
    terms = unit_terms(problem)

    def coarser(part: Part) -> Part:
        if part.choice and not part.variable and not grades:
            return replace(part, members=(_best_of(part.members),))
        cut = part.bent and bool(part.variable)
        return _bent(problem, part.variable, terms[part.variable], COARSE) if cut else part

    return replace(total, parts=tuple(coarser(part) for part in total.parts))


def _best_of(members: tuple[Member, ...]) -> Member:
    """A way that costs no more than any, and deviates no more; its range is the widest."""
    least = min(float(member.curve.cost(np.array([1.0]))[0]) for member in members)
    return replace(
        members[0],
        curve=Reciprocal(least, 0.0),
        spread=min(member.spread for member in members),
        mean=min(member.mean for member in members),
        least=min(member.least for member in members),
        range=max(member.range for member in members),
        units=None,
    )


def _grades(problem: RvBacklash, cut: float) -> Part:
    """The involute grade: every grade of the range is a separate way.

    A skewed clearance G enters as min(G, g), where a fraction `cut` of the units exceeds g: it is
    less than G, and y - g cannot be below the rest of W for designs that keep a limit (`OUTSIDE`).
    """
    grades, term = grades_of(problem)
    known = even_law(term.distribution)
    mean, law, width = (known[0], known[1], 1.0) if known else _below(term, cut)
    ends_of_z = term.distribution.support
    units = term.distribution.quantile((np.arange(LEVELS) + 0.5) / LEVELS)
    members = []
    for g, m, a, cost in zip(
        grades.tolist(),
        term.constant / ARCMIN,
        term.linear / ARCMIN,
        problem.settings.costs[GRADE].cost(grades),
        strict=True,
    ):
        z = sorted((float(a) * ends_of_z[0], float(a) * ends_of_z[1]))
        members.append(
            Member(
                Reciprocal(float(cost), 0.0),
                1.0,
                1.0,
                abs(float(a)) * width,
                law,
                mean=float(m + a * mean),
                least=float(m) + z[0],
                units=m + a * units,
                choice=g,
            )
        )
    return Part("", tuple(members), clipped=False, bent=known is None, choice=GRADE)


def _below(term: Term, cut: float) -> tuple[float, Even, float]:
    """Mean of a skewed law cut off at the top, and the largest uniform law that is below it."""
    z = term.distribution.quantile((np.arange(LEVELS) + 0.5) / LEVELS)
    z = np.minimum(z, np.quantile(z, 1.0 - cut))
    return float(z.mean() - ROUNDING * np.ptp(z)), UNIFORM, uniform_below(z)
