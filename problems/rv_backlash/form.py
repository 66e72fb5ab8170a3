"""The convex form of the geometric backlash: mean and standard deviation over units.

Every error adds a term constant + b t z (+ q t^2 z^2 for the eccentricity), so that the mean is
linear in the tolerances and the variance a sum of squares; mean + k standard deviations is convex
for k >= 0. Two things are no tolerances of that kind: the involute grade, one way per grade, and
the eccentricity, whose mean bends down and whose variance grows with t^4. Its range is cut into
`CELLS` ways; in each, mean and standard deviation are replaced by lower bounds of them. Where pins and holes are
matched, what their class centres differ by is left out: an even, independent deviation, without which no quantile from
one half on of an even, unimodal one is higher.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from ...models.cost_reading import SumOfCurves
from ...models.costs import CostCurve, Reciprocal
from ...models.inputs import Distribution, Triangular
from ...models.propagation.convolution import UNIFORM, Even, even_law
from ...models.propagation.even_below import LOST, even_law_below
from ...models.propagation.sums import Term
from ...section import Array
from ...units import ARCMIN, MM, UM
from ..forms import Feature, Form, Way
from ..limits import Limit
from ..settings import ASSURED, PROMISED
from .matching import HOLE, PIN
from .shift import (
    BEARING,
    GRADE,
    Piece,
    Shift,
    allows_any,
    bearing_term,
    ends,
    extreme_pair,
    grades_of,
    pieces_of,
    play_slopes,
    profile_at,
    unit_terms,
)
from .shift import CELLS as CELLS_OF_MEANS

if TYPE_CHECKING:
    from .problem import RvBacklash

CELLS = 16
"""Pieces of the range of the eccentricity."""
OUTPUTS = ("backlash_geometric_arcmin", "backlash_geometric_mean_arcmin", "backlash_geometric_std_arcmin")
MODIFICATION_LIMITS = ("dr_rp_mm", "dr_p_mm", "radial_gap_mm", "modification_backlash_arcmin")
"""Limits that the modification of the form keeps."""


def deviations(problem: RvBacklash) -> float:
    """k of mean + k standard deviations: the standard normal quantile at the coverage."""
    return float(ndtri(problem.settings.propagation.coverage))


def form_of(problem: RvBacklash, tied: bool | None = None) -> Form | None:
    """The form, None where the coverage is below one half or the modification has no room; `tied` as in
    `terms_of_form`, by default where it can be.
    """
    if tied is None and problem.matching is not None and not can_be_tied(problem):
        return None
    tied = can_be_tied(problem) if tied is None else tied
    k, pair = deviations(problem), extreme_pair(problem, play_slopes(problem))
    if k < 0.0 or pair is None:
        return None
    stagger = problem.interval("stagger_arcmin")[1]
    settled = {"dr_rp_mm": pair[0], "dr_p_mm": pair[1], "stagger_arcmin": stagger}
    terms = terms_of_form(problem, tied)
    offset = _nominal(problem, pair, stagger)
    offset += sum(float(term.constant[0]) for term in terms.values()) / ARCMIN
    offset += problem.change.effective / ARCMIN
    features = [tolerance_feature(problem, name, term, k, tied) for name, term in terms.items()]
    features += [bearing_feature(problem, k), grade_feature(problem, k)]
    unknown = 0.0 if problem.matching is None else _spread_of_matching(problem)
    relaxed = _relaxed_limits(problem, settled)
    left_out = f"; limits left out: {', '.join(relaxed)}" if relaxed else ""
    loose = form_of(problem, tied=False) if tied else None
    return Form(
        OUTPUTS,
        tuple(features),
        np.array([offset, offset, 0.0]),
        unknown**2 * np.array([k**2, 0.0, 1.0]),
        f"geometric backlash, mean + {k:.4g} standard deviations{left_out}",
        base=base_of(problem),
        exact=False,
        settled=settled,
        relaxed=relaxed,
        also=() if loose is None else (loose,),
    )


def _nominal(problem: RvBacklash, pair: tuple[float, float], stagger: float) -> float:
    """phi_2 [arcmin] of parts without errors, at a modification [mm] and a stagger [arcmin]."""
    model = problem.model
    unit = 2.0 / model.geometry.lever / ARCMIN * MM
    play = unit * (pair[0] - model.geometry.flank * pair[1])
    return model.output_factor * (play - model.stagger_gain * stagger)


def can_be_tied(problem: RvBacklash) -> bool:
    """Whether pins and holes are matched, and may have the same zone."""
    low, high = np.transpose([ends(problem, name) for name in (HOLE, PIN)])
    return problem.matching is not None and low.max() <= high.min()


def terms_of_form(problem: RvBacklash, tied: bool) -> dict[str, Term]:
    """The terms of phi_2 at half-widths of 1 um; where they are `tied`, pins and holes are made to equal zones and
    are one term, by the tolerance of the holes.

    Then their class centres do not differ. The best pair of zones is cheaper by at most 0.5 % in the document's case,
    and a form does not know the product of two tolerances: designs of all zones have a separate form.
    """
    terms = unit_terms(problem)
    if tied:
        hole, pin = terms[HOLE], terms.pop(PIN)
        terms[HOLE] = Term(Triangular(), hole.constant + pin.constant, hole.linear - pin.linear)
    return terms


def made_of(problem: RvBacklash, name: str, tied: bool) -> tuple[CostCurve, tuple[float, float]]:
    """Cost curve and range [um] of a tolerance; that of holes `tied` to pins costs both."""
    costs = problem.settings.costs
    if not tied or name != HOLE:
        return costs[name], ends(problem, name)
    low, high = np.transpose([ends(problem, part) for part in (HOLE, PIN)])
    return SumOfCurves(((1.0, costs[HOLE]), (1.0, costs[PIN]))), (float(low.max()), float(high.min()))


def base_of(problem: RvBacklash) -> float:
    """What every design costs in addition to its features: sorting."""
    return 0.0 if problem.matching is None else problem.matching.price


def _spread_of_matching(problem: RvBacklash) -> float:
    """Standard deviation [arcmin] of phi_2 by what the measurement of matched parts does not tell."""
    assert problem.matching is not None
    return problem.model.gain("pin_hole_radius") * UM * problem.matching.accuracy / ARCMIN


def _rows(mean: float, std: float, k: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Linear and spread coefficients of the three outputs."""
    return (mean, mean, 0.0), (k * std, 0.0, std)


def tolerance_feature(problem: RvBacklash, name: str, term: Term, k: float, tied: bool = False) -> Feature:
    """A tolerance of the cycloid stage."""
    if name in problem.machined_tolerances:
        return _machines(problem, name, term, k)
    curve, (low, high) = made_of(problem, name, tied)
    m1, m2 = term.distribution.raw_moments(2)[1:]
    linear = float(term.linear[0]) / ARCMIN
    if term.quadratic is not None:
        edges = np.linspace(low, high, CELLS + 1) if low < high else np.array([low, high])
        cells = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
        return Feature(name, tuple(cell_way(term, curve, cell, k) for cell in cells))
    rows = _rows(linear * m1, abs(linear) * float(np.sqrt(m2 - m1**2)), k)
    return Feature(name, (Way(curve, low, high, *rows),))


def _machines(problem: RvBacklash, name: str, term: Term, k: float) -> Feature:
    """A tolerance that machines make, by the spread of its good parts."""
    tolerance, moves = problem.machined_tolerances[name], problem.model.moves(name.removesuffix("_um"))
    cells = (CELLS_OF_MEANS if moves else 1, 1) if term.quadratic is None else (CELLS, CELLS)
    pieces = pieces_of(tolerance, ends(problem, name), *cells)
    return Feature(name, tuple(_way_of_piece(term, piece, moves, k) for piece in pieces), tolerance.choice)


def _way_of_piece(term: Term, piece: Piece, moves: bool, k: float) -> Way:
    """Lower bounds of mean and standard deviation of b y + q y^2, y = mean + x z, z normal."""
    _, _, m2, _, m4 = term.distribution.raw_moments(4)
    b = float(term.linear[0]) / ARCMIN
    q = 0.0 if term.quadratic is None else float(term.quadratic[0]) / ARCMIN
    x, m = piece.x, piece.means if moves else 0.0 * piece.means
    slope, offset = piece.line(b * m + q * (m**2 + m2 * x**2), 1.0)
    std = np.sqrt(m2 * (b + 2.0 * q * m) ** 2 + (m4 - m2**2) * (q * x) ** 2)  # over x
    rest = float(np.max(np.abs(np.diff(std, 2)), initial=0.0))
    rows = _rows(slope, float(std.min()) - rest, k)
    return Way(piece.curve, piece.low, piece.high, *rows, (offset, offset, 0.0), piece.choice)


def cell_way(term: Term, curve: CostCurve, ends: tuple[float, float], k: float) -> Way:
    """Lower bounds of mean and standard deviation for half-widths between `ends` [um]."""
    m1, m2, m3, m4 = term.distribution.raw_moments(4)[1:]
    assert term.quadratic is not None
    b, q = float(term.linear[0]) / ARCMIN, float(term.quadratic[0]) / ARCMIN
    low, high = ends
    # t^2 lies below its chord and above its tangent
    slope = low + high
    constant = -low * high if q < 0.0 else -0.25 * slope**2
    mean, offset = b * m1 + q * m2 * slope, q * m2 * constant
    # variance / t^2 = c0 + c1 t + c2 t^2
    c0, c1, c2 = b**2 * (m2 - m1**2), 2.0 * b * q * (m3 - m1 * m2), q**2 * (m4 - m2**2)
    vertex = np.clip(-0.5 * c1 / c2, low, high) if c2 > 0.0 else low
    least = min(c0 + c1 * t + c2 * t**2 for t in (low, high, float(vertex)))
    rows = _rows(mean, float(np.sqrt(max(least, 0.0))), k)
    return Way(curve, low, high, *rows, offset=(offset, offset, 0.0))


def bearing_feature(problem: RvBacklash, k: float) -> Feature:
    """The crank-arm bearing: mid and half-width of its zone both grow with the clearance."""
    mean, variance = (float(value[0]) for value in bearing_term(problem).cumulants()[:2])
    rows = _rows(mean / ARCMIN, float(np.sqrt(variance)) / ARCMIN, k)
    return Feature(BEARING, (Way(problem.settings.costs[BEARING], *ends(problem, BEARING), *rows),))


def grade_feature(problem: RvBacklash, k: float) -> Feature:
    """The involute grade: every grade of the range is a separate way."""
    grades, term = grades_of(problem)
    means, variances = term.cumulants()[:2]
    costs = problem.settings.costs[GRADE].cost(grades)
    ways = [
        Way(
            Reciprocal(float(c), 0.0),
            1.0,
            1.0,
            *_rows(float(m) / ARCMIN, float(np.sqrt(v)) / ARCMIN, k),
            choice=float(g),
        )
        for g, c, m, v in zip(grades, costs, means, variances, strict=True)
    ]
    return Feature("", tuple(ways), GRADE)


def _limits_from_below(limit: Limit, costs: tuple[str, ...]) -> bool:
    """Whether a limit keeps an output of the form, or one of the costs, from falling."""
    return limit.name in (*OUTPUTS, *costs) and bool(np.isfinite(limit.low))


def _relaxed_limits(problem: RvBacklash, settled: dict[str, float]) -> tuple[str, ...]:
    """Limits that the form leaves out; those that its modification keeps are not among them."""
    profile = profile_at(problem, {name: np.array([value]) for name, value in settled.items()})
    kept = {PROMISED} if problem.promise and problem.promise.statement == ASSURED else set()
    tolerances = {v.name for v in problem.variables if v.tolerance}
    known = {*OUTPUTS, *MODIFICATION_LIMITS, *kept, *problem.cost_names, *tolerances}
    return tuple(
        limit.name
        for limit in problem.limits
        if not allows_any(limit)
        and (limit.name not in known or _limits_from_below(limit, problem.cost_names))
        and not (limit.name in profile and np.all(limit.kept(profile[limit.name])))
    )


# The eccentricity's term b t z + q t^2 z^2, bounded by terms that are linear in t.
#
# S is a sum of even, unimodal deviations. Where y - Y >= 0 for every unit, P(S + Y <= y) is at most
# what it is with Y replaced by any Y' below it in convex order: F_S is concave above 0 (Jensen). Y'
# is uniform about Y's mean, on the largest half-width a for which the integrals of the upper
# quantiles of Y' stay below those of Y: a u (1 - u) <= int_u^1 (Q_Y - mean), all u.


LEVELS = 4001
"""Quantiles by which a law is compared with a uniform one."""
QUANTILE_SAFETY_FRACTION = 2e-3
"""Fraction of a half-width, or of a range, that is given up for values between the points."""
WITHIN = 5
"""Points of a cell that are evaluated."""


def uniform_bound(values: Array) -> float:
    """Half-width of the largest uniform law about the mean below a sample in convex order.

    `values` (n,) are quantiles at the levels (i + 1/2)/n.
    """
    ordered = np.sort(values)
    n = len(ordered)
    fraction = np.arange(1, n) / n  # fraction above the first i of n quantiles
    upper = np.cumsum((ordered - ordered.mean())[::-1])[::-1][1:] / n
    return max(0.0, float(np.min(upper / (fraction * (1.0 - fraction)))) * (1.0 - QUANTILE_SAFETY_FRACTION))


def quantiles_of(law: Distribution) -> Array:
    """Quantiles (n,) of a law at the levels (i + 1/2)/n."""
    return np.asarray(law.quantile((np.arange(LEVELS) + 0.5) / LEVELS))


@dataclass(frozen=True)
class Cell:
    """Bounds of Y = b t z + q t^2 z^2 [arcmin] for half-widths t in [low, high] [um].

    `mean_below` and `mean_above` (slope, constant) bound its mean by lines in t, from below and
    from above; `spread` t is the half-width of a uniform law below it in convex order; `least` is
    the least value of any unit, `range` the width of its values, both for the whole cell.
    """

    law: Distribution
    b: float
    q: float
    low: float
    high: float
    z: Array = field(compare=False, repr=False)
    """Quantiles of the law, as `quantiles_of` gives them: cells of one law share them."""

    def values(self, t: float) -> Array:
        """Y at the levels (i + 1/2)/n of z."""
        return np.asarray(self.b * t * self.z + self.q * (t * self.z) ** 2)

    @cached_property
    def _inside(self) -> dict[float, Array]:
        """Y by half-width, at points of the cell."""
        points = np.linspace(self.low, self.high, WITHIN if self.low < self.high else 1)
        return {t: self.values(t) for t in points.tolist()}

    @cached_property
    def spread(self) -> float:
        """Half-width per um of a uniform law below Y in convex order."""
        return float(min(uniform_bound(y) / t for t, y in self._inside.items()))

    @property
    def mean_below(self) -> tuple[float, float]:
        """Slope and constant of a line below the mean."""
        return self._line(1.0)

    @property
    def mean_above(self) -> tuple[float, float]:
        """Slope and constant of a line above the mean."""
        slope, constant = self._line(-1.0)
        return -slope, -constant

    def _line(self, side: float) -> tuple[float, float]:
        """A line below side * mean: t^2 lies below its chord and above its tangents."""
        _, m1, m2 = self.law.raw_moments(2)
        bend, slope = side * self.q * float(m2), self.low + self.high
        constant = -self.low * self.high if bend < 0.0 else -0.25 * slope**2
        return side * self.b * float(m1) + bend * slope, bend * constant

    @property
    def least(self) -> float:
        """Least value of any unit."""
        return self._ends[0]

    @property
    def range(self) -> float:
        """Width of the values of all units."""
        return self._ends[1] - self._ends[0]

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Bounds of the values of all units of the cell: those of the loosest t reach farthest."""
        ends = np.array(self.law.support) * self.high
        if ends[0] > 0.0 or ends[1] < 0.0:
            ends = np.array([min(ends[0], 0.0), max(ends[1], 0.0)])
        vertex = np.clip(-0.5 * self.b / self.q, *ends) if self.q != 0.0 else ends[0]
        deviations = [float(self.b * u + self.q * u * u) for u in (*ends, vertex, 0.0)]
        return min(deviations), max(deviations)

    def quantile_above(self, fraction: float) -> float:
        """A value above the quantile of Y at `fraction`, for all t of the cell."""
        if fraction >= 1.0:
            return self._ends[1]
        quantile = max(float(np.quantile(y, fraction)) for y in self._inside.values())
        return min(self._ends[1], quantile + QUANTILE_SAFETY_FRACTION * self.range)


# The parts of the backlash of an RV reducer as members of a convex form.


CELLS_OF_PIECES, COARSE = 48, 4
"""Pieces of the range of the eccentricity, in geometric steps; and pieces for designs at which
y - Y >= 0 fails, which are too expensive to be of interest."""


@dataclass(frozen=True)
class Member:
    """A way of a feature, whose deviation is `spread` t z, z ~ `law`, about mean + slope t.

    Means [arcmin] are bounds from below of those in the backlash (`mean`, `slope`), and from above
    in phi_2 (`top`, `top_slope`), where z ~ `top_law`. `least` is the least value of its deviation,
    `range` the width.
    """

    curve: CostCurve
    low: float
    high: float
    spread: float
    law: Even
    top_law: Even
    mean: float = 0.0
    slope: float = 0.0
    top: float = 0.0
    top_slope: float = 0.0
    least: float = 0.0
    range: float = 0.0
    cell: Cell | None = None
    choice: float = 0.0


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
    """The parts of the backlash, the constant of phi_2 (`cycloid`) and what is added to all.

    `skewed` are the tolerances whose deviations even laws below them stand for, `lost` the fractions of the units in
    which such laws may lie above those of phi_2 and, with that of the grade, of the backlash.
    """

    parts: tuple[Part, ...]
    shift: Shift
    cycloid: float
    effective_change: float
    skewed: tuple[str, ...]
    lost: tuple[float, float]
    unknown: float = 0.0
    """Standard deviation [arcmin] of phi_2 by the measurement of matched parts."""
    sorting_price: float = 0.0


def sum_of(problem: RvBacklash, tied: bool = False) -> Sum | str:
    """All parts of the backlash, or why there is none of their forms; `tied` as in `terms_of_form`."""
    shift = problem.shift
    if shift is None:
        return "the ranges and limits of the modification leave no room"
    if problem.change.growth != 0.0:
        return "an effect inflates the spread"
    parts: list[Part] = []
    cycloid = 0.0
    if "eccentricity_um" in problem.machined_tolerances:
        return "the eccentricity is made by machines, whose law is not bounded"
    bearing, terms = bearing_term(problem), terms_of_form(problem, tied)
    for name, term in terms.items():
        cycloid += float(term.constant[0]) / ARCMIN
        parts.append(
            _eccentricity_feature(problem, name, term)
            if term.quadratic is not None
            else _linear_feature(problem, name, term, clipped=True, tied=tied)
        )
    parts += [_linear_feature(problem, BEARING, bearing, clipped=False), _grades(problem)]
    linear = {name: term for name, term in (terms | {BEARING: bearing}).items() if term.quadratic is None}
    skewed = tuple(name for name, term in linear.items() if even_law(term.distribution) is None)
    grades = even_law(grades_of(problem)[1].distribution) is None
    lost = LOST * len(set(skewed) - {BEARING}), LOST * (len(skewed) + grades)
    unknown = 0.0 if problem.matching is None else _spread_of_matching(problem)
    effective = problem.change.effective / ARCMIN
    return Sum(tuple(parts), shift, cycloid, effective, skewed, lost, unknown, base_of(problem))


def _law_below(law: Distribution, side: float) -> tuple[float, Even]:
    """Mean and even law of z (`side` = 1) or -z (-1), or where it is skewed of one below it."""
    known = even_law(law)
    return even_law_below(law, side) if known is None else (side * known[0], known[1])


def _linear_feature(problem: RvBacklash, name: str, term: Term, clipped: bool, tied: bool = False) -> Part:
    """A term that grows with its tolerance as a whole; of phi_2 its constant is counted apart."""
    linear = float(term.linear[0]) / ARCMIN
    side, scale = (1.0 if linear >= 0.0 else -1.0), abs(linear)
    (mean, law), (negative, top_law) = _law_below(term.distribution, side), _law_below(term.distribution, -side)
    if name in problem.machined_tolerances:
        return _machines_of_piece(problem, name, linear, law)
    constant = 0.0 if clipped else float(term.constant[0]) / ARCMIN
    slopes = scale * mean + constant, constant - scale * negative
    curve, (low, high) = made_of(problem, name, tied)
    member = Member(curve, low, high, scale, law, top_law, slope=slopes[0], top_slope=slopes[1])
    return Part(name, (member,), clipped)


def _machines_of_piece(problem: RvBacklash, name: str, linear: float, law: Even) -> Part:
    """A tolerance that machines make, by the spread of its good parts."""
    tolerance, moves = problem.machined_tolerances[name], problem.model.moves(name.removesuffix("_um"))
    members = []
    for piece in pieces_of(tolerance, ends(problem, name), CELLS_OF_MEANS if moves else 1):
        values = linear * moves * piece.means
        (slope, mean), (top_slope, top) = piece.line(values, 1.0), piece.line(values, -1.0)
        members.append(
            Member(
                piece.curve,
                piece.low,
                piece.high,
                abs(linear),
                law,
                law,
                mean,
                slope,
                top,
                top_slope,
                choice=piece.choice,
            )
        )
    return Part(name, tuple(members), clipped=True, choice=tolerance.choice)


def _eccentricity_feature(problem: RvBacklash, name: str, term: Term, cells: int = CELLS_OF_PIECES) -> Part:
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
            Member(
                curve,
                start,
                end,
                cell.spread,
                UNIFORM,
                UNIFORM,
                mean,
                slope,
                top,
                top_slope,
                cell.least,
                cell.range,
                cell,
            )
        )
    return Part(name, tuple(members), clipped=True, bent=True)


def coarsen_sum(problem: RvBacklash, total: Sum, grades: bool = False) -> Sum:
    """The sum with few cells, for designs of no interest; without `grades` one that is better than
    all stands for them.
    """
    terms = unit_terms(problem)

    def coarser(part: Part) -> Part:
        if part.choice and not part.variable and not grades:
            return replace(part, members=(_dominating_way(part.members),))
        cut = part.bent and bool(part.variable)
        return _eccentricity_feature(problem, part.variable, terms[part.variable], COARSE) if cut else part

    return replace(total, parts=tuple(coarser(part) for part in total.parts))


def _dominating_way(members: tuple[Member, ...]) -> Member:
    """A way that costs no more than any, and deviates no more."""
    least = min(float(member.curve.cost(np.array([1.0]))[0]) for member in members)
    return replace(
        members[0],
        curve=Reciprocal(least, 0.0),
        spread=min(member.spread for member in members),
        mean=min(member.mean for member in members),
    )


def _grades(problem: RvBacklash) -> Part:
    """The involute grade: every grade of the range is a separate way."""
    grades, term = grades_of(problem)
    mean, law = _law_below(term.distribution, 1.0)
    costs = problem.settings.costs[GRADE].cost(grades)
    rows = zip(grades.tolist(), (term.constant + term.linear * mean) / ARCMIN, term.linear / ARCMIN, costs, strict=True)
    members = [
        Member(Reciprocal(float(cost), 0.0), 1.0, 1.0, float(a), law, law, mean=float(m), choice=g)
        for g, m, a, cost in rows
    ]
    return Part("", tuple(members), clipped=False, choice=GRADE)
