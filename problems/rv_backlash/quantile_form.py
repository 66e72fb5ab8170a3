"""The convex form of the effective backlash: its quantile, the yield and the interference.

Backlash is at least phi_1 + phi_2 + phi_3, unit by unit, and a sum of independent deviations; where
these are even and log-concave its quantile is convex in the tolerances (docs/proofs.md). The rest:

- modification and stagger move phi_2 by s alone, whose range is a linear programme;
- each involute grade is a way of its own, the range of the eccentricity is cut into `CELLS`, in
  which its term is replaced by a uniform one that is below it in convex order (`bent`); so is the
  clearance of the tighter planet, which is skewed;
- that holds where y - Y >= 0 for every unit. Designs for which it does not keep rows that hold
  without it: they have forms of their own (`Form.also`), and what is proven is the least of all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...models.costs import CostCurve, Reciprocal
from ...models.propagation.even import UNIFORM, Even, even_law
from ...models.propagation.sums import Term, total_cumulants
from ...units import ARCMIN
from ..forms import Feature, Form, Piece, Quantile, Way
from ..limits import Limit
from .bent import LEVELS, Cell, uniform_below
from .shift import SHIFT, Shift, columns_of, shift_of
from .terms import ends, unit_terms

if TYPE_CHECKING:
    from .problem import RvBacklash

Array = NDArray[np.float64]
CELLS, COARSE = 48, 4
"""Pieces of the range of the eccentricity, in geometric steps; those of designs for which
y - Y >= 0 fails, which cost more than is of interest."""
BETAS = (1.0, 0.5, 0.25)
"""Shares of units for which the eccentricity's term is bounded by its quantile."""
KEPT = ("dr_rp_mm", "dr_p_mm", "stagger_arcmin", "radial_gap_mm", "modification_backlash_arcmin")
"""Limits that the range of the shift keeps."""
SHIFTS = 5
"""Shifts at which the other limits of a modification are tried."""
NONE = Reciprocal(0.0, 0.0)
"""Cost of what has none."""


@dataclass(frozen=True)
class Member:
    """A way of a feature, whose deviation is `spread` t z, z ~ `law`, about mean + slope t.

    Means [arcmin] are bounds from below of those in the backlash (`mean`, `slope`), and from above
    in phi_2 (`top`, `top_slope`). `least` is the least value of its deviation, `range` the width.
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
    """The parts of the backlash, the constant of phi_2 (`cycloid`) and what is added to all."""

    parts: tuple[Part, ...]
    shift: Shift
    cycloid: float
    more: float


def quantile_form(problem: RvBacklash) -> Form | str:
    """The form of `backlash_arcmin`, or why there is none."""
    total = _sum_of(problem)
    if isinstance(total, str):
        return total
    main = [row for row in _rows(problem) if row is not None]
    if not main:
        return "neither backlash_arcmin nor a yield of one half at least is asked for"
    relaxed = _relaxed(problem, total.shift, main)
    left_out = f"; limits left out: {', '.join(relaxed)}" if relaxed else ""
    statement = f"quantile of the geometric backlash, which the effective one exceeds{left_out}"
    forms = [_form(total, main, statement, relaxed)]
    others, coarse = _branches(main, total), _coarse(problem, total)
    forms += [_form(coarse, rows, statement, relaxed) for rows in others]
    return replace(forms[0], also=tuple(forms[1:]))


@dataclass(frozen=True)
class Row:
    """A quantile of the backlash (`clipped` false) or of -phi_2 at a probability.

    `kind` says what stands for the parts that are bent: their uniform law ("convex"), their least
    value ("least"), their quantile at `share` ("share"), or nothing but their range ("range": the
    quantile of all others is at most that). "edge" is no quantile: s lets phi_2 be below zero.
    """

    output: str
    probability: float
    clipped: bool
    most: float = np.inf
    kind: str = "convex"
    share: float = 1.0


def _rows(problem: RvBacklash) -> list[Row | None]:
    """What objectives and limits ask for, as quantiles."""
    coverage = problem.settings.propagation.coverage
    limits = {limit.name: limit for limit in problem.limits}
    found: list[Row | None] = []
    if "backlash_arcmin" in {*problem.objectives, *limits} and coverage >= 0.5:
        found.append(Row("backlash_arcmin", coverage, clipped=False))
    if "yield_percent" in limits and 50.0 <= limits["yield_percent"].low < 100.0:
        share = 0.01 * limits["yield_percent"].low
        found.append(Row("yield_percent", share, False, problem.limit))
    interfering = (
        limits["interference_probability"].high if ("interference_probability" in limits) else 1.0
    )
    if 0.0 < interfering <= 0.5:
        share = 1.0 - interfering
        found.append(Row("interference_probability", share, True, 0.0))
    return found


def _branches(main: list[Row], total: Sum) -> list[list[Row]]:
    """The rows of designs for which y - Y >= 0 fails, in one row after the other."""
    found = []
    safe = [one for row in main for one in _safe(row)]
    for row in main:
        if any(part.bent and (part.clipped or not row.clipped) for part in total.parts):
            kind = "edge" if row.clipped else "range"
            own = replace(row, kind=kind, output=f"{row.output} ({kind})", most=0.0)
            found.append([*safe, own])
    return found


def _safe(row: Row) -> list[Row]:
    """Rows that hold for every design which keeps a row."""
    if not row.clipped:
        return [replace(row, kind="least")]
    lacking = 1.0 - row.probability
    return [
        replace(row, probability=1.0 - lacking / beta, kind="share", share=beta,
                output=f"{row.output} ({beta:g})")
        for beta in BETAS if lacking / beta <= 0.5
    ]  # fmt: skip


def _form(total: Sum, rows: list[Row], statement: str, relaxed: tuple[str, ...]) -> Form:
    features = [_feature(part, rows) for part in total.parts]
    features.append(_shift_feature(total.shift, rows))
    return Form(
        outputs=tuple(row.output for row in rows),
        features=tuple(features),
        offset=np.array([_offset(row, total) for row in rows]),
        constant=np.zeros(len(rows)),
        statement=statement,
        base=0.0,
        exact=False,
        relaxed=relaxed,
        quantiles=tuple(_quantile(row, total) for row in rows),
        most=tuple(row.most for row in rows),
    )


def _offset(row: Row, total: Sum) -> float:
    """Constant of a row; that of the shift's scale is counted there."""
    if row.kind == "range":
        return 0.0
    if row.kind == "edge":
        return total.cycloid
    return -total.cycloid if row.clipped else total.cycloid + total.more


def _quantile(row: Row, total: Sum) -> Quantile | None:
    if row.kind == "edge":
        return None
    pieces = [
        (Piece(1.0, part.members[0].law),) if _spreads(part, row) else () for part in total.parts
    ]
    return Quantile(row.probability, (*pieces, ()))


def _inside(part: Part, row: Row) -> bool:
    """Whether a part belongs to the sum of a row."""
    return part.clipped or not row.clipped


def _spreads(part: Part, row: Row) -> bool:
    return _inside(part, row) and not (part.bent and row.kind != "convex")


def _feature(part: Part, rows: list[Row]) -> Feature:
    ways = tuple(
        Way(
            member.curve,
            member.low,
            member.high,
            linear=tuple(_means(part, member, row)[0] for row in rows),
            spread=tuple(member.spread if _spreads(part, row) else 0.0 for row in rows),
            offset=tuple(_means(part, member, row)[1] for row in rows),
            choice=member.choice,
        )
        for member in part.members
    )
    return Feature(part.variable, ways, part.choice)


def _means(part: Part, member: Member, row: Row) -> tuple[float, float]:
    """Slope and constant of what a way adds to a row beside its spread."""
    if not _inside(part, row):
        return 0.0, 0.0
    match row.kind:
        case "range":
            return 0.0, -member.range if part.bent else 0.0
        case "edge" if part.bent:
            return 0.0, member.least
        case "edge":
            return member.slope, member.mean
        case "least" if part.bent:
            return 0.0, member.least
        case "share" if part.bent:
            assert member.cell is not None
            return 0.0, -member.cell.quantile_above(row.share)
    if row.clipped:
        return -member.top_slope, -member.top
    return member.slope, member.mean


def _shift_feature(shift: Shift, rows: list[Row]) -> Feature:
    """s on a scale that begins at 1: t = s - low + 1."""
    sides = [0.0 if row.kind == "range" else
             (1.0 if row.kind == "edge" or not row.clipped else -1.0) for row in rows]  # fmt: skip
    start = shift.low - 1.0
    way = Way(NONE, 1.0, 1.0 + shift.high - shift.low, tuple(sides), (0.0,) * len(rows),
              offset=tuple(side * start for side in sides))  # fmt: skip
    return Feature(SHIFT, (way,))


def shortfalls(problem: RvBacklash, designs: Array, found: Mapping[str, Array]) -> dict[str, Array]:
    """By how much (n,) [arcmin] phi_2, or the limit of the yield, falls short of what is asked.

    A step of Newton's method by the density of a normal law.
    """
    total = problem.total(designs)
    limits, missing = {limit.name: limit for limit in problem.limits}, {}
    if "interference_probability" in limits:
        mean, variance = total_cumulants(total.clipped)[:2]
        excess = found["interference_probability"] - limits["interference_probability"].high
        missing["interference_probability"] = _step(excess, mean, variance)
    if "yield_percent" in limits:
        mean, variance = total_cumulants(total.clipped + total.free)[:2]
        lacking = 0.01 * (limits["yield_percent"].low - found["yield_percent"])
        missing["yield_percent"] = _step(lacking, problem.limit * ARCMIN - mean, variance)
    return missing


def _step(excess: Array, at: Array, variance: Array) -> Array:
    """A probability over the normal density at a distance from the mean [rad], in arcmin."""
    std = np.sqrt(variance)
    density = np.exp(-0.5 * np.minimum((at / std) ** 2, 9.0)) / (std * np.sqrt(2.0 * np.pi))
    return np.asarray(excess / density / ARCMIN)


# ---------------------------------------------------------------- the parts


def _sum_of(problem: RvBacklash) -> Sum | str:
    shift = shift_of(problem)
    if shift is None:
        return "the ranges and limits of the modification leave no room"
    if problem.change.growth != 0.0:
        return "an effect inflates the spread"
    parts: list[Part] = []
    cycloid = 0.0
    for name, term in unit_terms(problem).items():
        cycloid += float(term.constant[0]) / ARCMIN
        part = _bent(problem, name, term) if term.quadratic is not None else _straight(
            problem, name, term, clipped=True)  # fmt: skip
        if isinstance(part, str):
            return part
        parts.append(part)
    bearing = problem.total(np.ones((1, len(problem.names)))).free[1]
    more = [_straight(problem, "crank_bearing_um", bearing, clipped=False), _grades(problem)]
    for one in more:
        if isinstance(one, str):
            return one
        parts.append(one)
    return Sum(tuple(parts), shift, cycloid, problem.change.effective / ARCMIN)


def _straight(problem: RvBacklash, name: str, term: Term, clipped: bool) -> Part | str:
    """A term that grows with its tolerance as a whole; of phi_2 its constant is counted apart."""
    known = even_law(term.distribution)
    if known is None:
        return f"the deviations of {name} are skewed or have poles"
    linear = float(term.linear[0]) / ARCMIN
    slope = linear * known[0] + (0.0 if clipped else float(term.constant[0]) / ARCMIN)
    member = Member(problem.settings.costs[name], *ends(problem, name), abs(linear), known[1],
                    slope=slope, top_slope=slope)  # fmt: skip
    return Part(name, (member,), clipped)


def _bent(problem: RvBacklash, name: str, term: Term, cells: int = CELLS) -> Part:
    """The eccentricity, cut into cells."""
    assert term.quadratic is not None
    low, high = ends(problem, name)
    b, q = float(term.linear[0]) / ARCMIN, float(term.quadratic[0]) / ARCMIN
    edges = np.geomspace(low, high, cells + 1) if low < high else np.array([low, high])
    members = []
    for start, end in pairwise(edges.tolist()):
        cell = Cell(term.distribution, b, q, start, end)
        (slope, mean), (top_slope, top) = cell.mean_below, cell.mean_above
        curve = problem.settings.costs[name]
        members.append(Member(curve, start, end, cell.spread, UNIFORM, mean, slope, top, top_slope,
                              cell.least, cell.range, cell))  # fmt: skip
    return Part(name, tuple(members), clipped=True, bent=True)


def _coarse(problem: RvBacklash, total: Sum) -> Sum:
    """The sum with few cells and one grade that is better than all, for designs of no interest."""
    terms = unit_terms(problem)

    def coarse(part: Part) -> Part:
        if part.choice:
            return replace(part, members=(_best_of(part.members),))
        return _bent(problem, part.variable, terms[part.variable], COARSE) if part.bent else part

    return replace(total, parts=tuple(coarse(part) for part in total.parts))


def _best_of(members: tuple[Member, ...]) -> Member:
    """A way that costs no more than any, and deviates no more; its range is the widest."""
    least = min(float(one.curve.cost(np.array([1.0]))[0]) for one in members)
    return replace(
        members[0],
        curve=Reciprocal(least, 0.0),
        spread=min(one.spread for one in members),
        mean=min(one.mean for one in members),
        least=min(one.least for one in members),
        range=max(one.range for one in members),
    )


def _grades(problem: RvBacklash) -> Part | str:
    """The involute grade: every grade of the range is a way of its own."""
    name = "involute_grade"
    low, high = ends(problem, name)
    grades = np.arange(np.ceil(low), np.floor(high) + 1.0)
    designs = np.ones((len(grades), len(problem.names)))
    designs[:, problem.names.index(name)] = grades
    term = problem.total(designs).free[0]
    known = even_law(term.distribution)
    mean, law, width = (known[0], known[1], 1.0) if known else _below(term)
    ends_of_z = term.distribution.support
    members = []
    for g, m, a, cost in zip(grades.tolist(), term.constant / ARCMIN, term.linear / ARCMIN,
                             problem.settings.costs[name].cost(grades), strict=True):  # fmt: skip
        z = sorted((float(a) * ends_of_z[0], float(a) * ends_of_z[1]))
        members.append(Member(Reciprocal(float(cost), 0.0), 1.0, 1.0, abs(float(a)) * width, law,
                              mean=float(m + a * mean), least=float(m) + z[0], range=z[1] - z[0],
                              choice=g))  # fmt: skip
    return Part("", tuple(members), clipped=False, bent=known is None, choice=name)


def _below(term: Term) -> tuple[float, Even, float]:
    """Mean of a skewed law, and the largest uniform law below it in convex order."""
    z = term.distribution.quantile((np.arange(LEVELS) + 0.5) / LEVELS)
    return float(term.distribution.raw_moments(1)[1]), UNIFORM, uniform_below(z)


def _relaxed(problem: RvBacklash, shift: Shift, rows: list[Row]) -> tuple[str, ...]:
    """Limits that the form leaves out; those that a modification of every shift keeps are not."""
    s = np.linspace(shift.low, shift.high, SHIFTS)
    designs = np.repeat(problem.complete(np.atleast_2d(problem.xl)), SHIFTS, axis=0)
    for name, column in columns_of(problem, shift, s).items():
        designs[:, problem.names.index(name)] = column
    profile = problem.profile(designs)
    known = {row.output for row in rows} | {"cost", *KEPT}
    known |= {v.name for v in problem.variables if v.tolerance or v.name == "involute_grade"}
    return tuple(
        limit.name
        for limit in problem.limits
        if (limit.name not in known or _other_side(limit))
        and not (
            limit.name in profile
            and all(np.all(v <= 1e-9) for v in limit.violations(profile[limit.name]))
        )
    )


def _other_side(limit: Limit) -> bool:
    """Whether a limit has a side that no row keeps."""
    if limit.name == "yield_percent":
        return bool(np.isfinite(limit.high))
    rows = ("cost", "backlash_arcmin", "interference_probability")
    return limit.name in rows and bool(np.isfinite(limit.low))
