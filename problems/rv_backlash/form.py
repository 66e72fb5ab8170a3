"""The convex form of the geometric backlash: mean and standard deviation over units.

Every error adds a term constant + b t z (+ q t^2 z^2 for the eccentricity), so that the mean is
linear in the tolerances and the variance a sum of squares; mean + k standard deviations is convex
for k >= 0. Two things are no tolerances of that kind: the involute grade, one way per grade, and
the eccentricity, whose mean bends down and whose variance grows with t^4. Its range is cut into
`CELLS` ways; in each, mean and standard deviation are replaced by lower bounds of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from ...models.costs import CostCurve, Reciprocal
from ...models.propagation.sums import Term
from ...units import ARCMIN, MM
from ..forms import Feature, Form, Way
from ..limits import Limit
from ..promise import ASSURED, PROMISED
from .machined_tolerances import CELLS as CELLS_OF_MEANS
from .machined_tolerances import Piece, pieces_of
from .refused import allows_any
from .shift import extreme_pair, play_slopes, profile_at
from .terms import BEARING, GRADE, bearing_term, ends, grades_of, unit_terms

if TYPE_CHECKING:
    from .problem import RvBacklash

CELLS = 16
"""Pieces of the range of the eccentricity."""
OUTPUTS = ("backlash_geometric_arcmin", "backlash_geometric_mean_arcmin", "backlash_geometric_std_arcmin")
KEPT = ("dr_rp_mm", "dr_p_mm", "radial_gap_mm", "modification_backlash_arcmin")
"""Limits that the modification of the form keeps."""


def deviations(problem: RvBacklash) -> float:
    """k of mean + k standard deviations: the standard normal quantile at the coverage."""
    return float(ndtri(problem.settings.propagation.coverage))


def form_of(problem: RvBacklash) -> Form | None:
    """The form, None where the coverage is below one half or the modification has no room."""
    k, pair = deviations(problem), extreme_pair(problem, play_slopes(problem))
    if k < 0.0 or pair is None:
        return None
    stagger = problem.interval("stagger_arcmin")[1]
    settled = {"dr_rp_mm": pair[0], "dr_p_mm": pair[1], "stagger_arcmin": stagger}
    terms = unit_terms(problem)
    offset = _nominal(problem, pair, stagger)
    offset += sum(float(term.constant[0]) for term in terms.values()) / ARCMIN
    offset += problem.change.effective / ARCMIN
    features = [tolerance_feature(problem, name, term, k) for name, term in terms.items()]
    features += [bearing_feature(problem, k), grade_feature(problem, k)]
    relaxed = _relaxed(problem, settled)
    left_out = f"; limits left out: {', '.join(relaxed)}" if relaxed else ""
    return Form(
        OUTPUTS,
        tuple(features),
        np.array([offset, offset, 0.0]),
        np.zeros(3),
        f"geometric backlash, mean + {k:.4g} standard deviations{left_out}",
        exact=False,
        settled=settled,
        relaxed=relaxed,
    )


def _nominal(problem: RvBacklash, pair: tuple[float, float], stagger: float) -> float:
    """phi_2 [arcmin] of parts without errors, at a modification [mm] and a stagger [arcmin]."""
    model = problem.model
    unit = 2.0 / model.geometry.lever / ARCMIN * MM
    play = unit * (pair[0] - model.geometry.flank * pair[1])
    return model.output_factor * (play - model.stagger_gain * stagger)


def _rows(mean: float, std: float, k: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Linear and spread coefficients of the three outputs."""
    return (mean, mean, 0.0), (k * std, 0.0, std)


def tolerance_feature(problem: RvBacklash, name: str, term: Term, k: float) -> Feature:
    """A tolerance of the cycloid stage."""
    if name in problem.machined_tolerances:
        return _machines(problem, name, term, k)
    curve, (low, high) = problem.settings.costs[name], ends(problem, name)
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


def _from_below(limit: Limit) -> bool:
    """Whether a limit keeps an output of the form, or the cost, from falling."""
    return limit.name in (*OUTPUTS, "cost") and bool(np.isfinite(limit.low))


def _relaxed(problem: RvBacklash, settled: dict[str, float]) -> tuple[str, ...]:
    """Limits that the form leaves out; those that its modification keeps are not among them."""
    profile = profile_at(problem, {name: np.array([value]) for name, value in settled.items()})
    kept = {PROMISED} if problem.promise and problem.promise.statement == ASSURED else set()
    known = {*OUTPUTS, *KEPT, *kept, "cost", *(v.name for v in problem.variables if v.tolerance)}
    return tuple(
        limit.name
        for limit in problem.limits
        if not allows_any(limit)
        and (limit.name not in known or _from_below(limit))
        and not (limit.name in profile and np.all(limit.kept(profile[limit.name])))
    )
