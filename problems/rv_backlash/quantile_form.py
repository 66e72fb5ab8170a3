"""The promise of the geometric backlash as a row of the form, in addition to the quantiles.

Every way enters by a lower bound of its mean (linear in t) and of its standard deviation
(proportional to t), as in `form`; the row holds for every design, whatever others leave out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...models.capability import Surplus
from ...models.costs import Reciprocal
from ...models.propagation.convolution import EvenNormal
from ...models.propagation.sums import Term, total_cumulants
from ...section import Array
from ...units import ARCMIN
from ..forms import Feature, Form, Piece, Quantile, Way
from ..limits import Limit
from ..settings import ASSURED, PROMISED
from .counterparts import MEAN, STD, doubt_of, statement_of
from .form import (
    OUTPUTS,
    Member,
    Part,
    Sum,
    bearing_feature,
    can_be_tied,
    cell_way,
    coarsen_sum,
    grade_feature,
    sum_of,
    tolerance_feature,
)
from .shift import SHIFT, Shift, allows_any, columns_of, profile_at, unit_terms

if TYPE_CHECKING:
    from .problem import RvBacklash


@dataclass(frozen=True, eq=False)
class PromisedRow:
    """The coefficients of an assured promise in a form of the parts of the backlash."""

    problem: RvBacklash

    @classmethod
    def of(cls, problem: RvBacklash) -> PromisedRow | None:
        """None where nothing is assured, where machines make a part, or where moments of the
        geometric backlash are asked for: these have a form of their own.
        """
        promise = problem.promise
        if promise is None or promise.statement != ASSURED or problem.machined_tolerances:
            return None
        return None if problem.required_outputs.intersection(OUTPUTS) else cls(problem)

    def doubt(self, parts: tuple[Part, ...]) -> tuple[Array, Surplus | None]:
        """Factors of the standard deviations, and what doubt adds, of parts and one feature more
        that does not scatter.
        """
        return doubt_of(self.problem, [*(part.variable for part in parts), ""])

    def moments(self, part: Part, member: Member) -> tuple[float, float, float]:
        """Slope and constant [arcmin] of the mean, slope of the standard deviation by t."""
        ways = self._ways(part, member)
        offset = min(way.offset[MEAN] if way.offset else 0.0 for way in ways)
        return (min(way.linear[MEAN] for way in ways), offset, min(way.spread[STD] for way in ways))

    def _ways(self, part: Part, member: Member) -> tuple[Way, ...]:
        """The way of the moments' form that a member is; all grades where it stands for all."""
        if not part.variable:
            every = self._grades
            same_grade = tuple(way for way in every if way.choice == member.choice)
            return same_grade if len(part.members) == len(every) else every
        term = self._terms.get(part.variable)
        if term is None:
            return bearing_feature(self.problem, 1.0).ways
        if term.quadratic is not None:
            return (cell_way(term, member.curve, (member.low, member.high), 1.0),)
        return tolerance_feature(self.problem, part.variable, term, 1.0).ways

    @cached_property
    def _terms(self) -> dict[str, Term]:
        return unit_terms(self.problem)

    @cached_property
    def _grades(self) -> tuple[Way, ...]:
        return grade_feature(self.problem, 1.0).ways


# The convex form of the effective backlash: its quantile, the yield and the interference.
#
# Backlash is at least phi_1 + phi_2 + phi_3, unit by unit, and a sum of independent deviations; where
# these are even and log-concave its quantile is convex in the tolerances (docs/proofs.md). The rest:
#
# - modification and stagger move phi_2 by s alone, whose range is a linear programme;
# - each involute grade is a separate way, the range of the eccentricity is cut into `CELLS`, in
#   which its term is replaced by a uniform one that is below it in convex order (`bent`);
# - skewed laws, as of the clearance of the tighter planet, enter by even ones below them;
# - that holds where y - Y >= 0 for every unit. Designs for which it does not keep rows that hold
#   without it: they have separate forms (`Form.also`), and what is proven is the least of all.


BELOW, ABOVE = (1.0, 0.5, 0.25), (1.0,)
"""Fractions of units at whose quantile parts that are bent are bounded: in phi_2 from above,
in the backlash from below."""
SHIFT_LIMITS = ("dr_rp_mm", "dr_p_mm", "stagger_arcmin", "radial_gap_mm", "modification_backlash_arcmin")
"""Limits that the range of the shift keeps."""
SHIFTS = 5
"""Shifts at which the other limits of a modification are tried."""
ZERO_COST = Reciprocal(0.0, 0.0)
"""Cost curve of a feature that costs nothing."""


def quantile_form(problem: RvBacklash, tied: bool | None = None) -> Form | str:
    """The form of `backlash_arcmin`, or why there is none; `tied` as in `form_of`."""
    if tied is None and problem.matching is not None and not can_be_tied(problem):
        return "pins and holes in classes cannot have equal zones"
    tied = can_be_tied(problem) if tied is None else tied
    main, promised = _rows(problem), PromisedRow.of(problem)
    if promised is not None and main:
        main.append(Row(PROMISED, problem.stated_promise.fraction, False, problem.limit, kind="promise"))
    if all(row.clipped for row in main):
        return "neither backlash_arcmin nor a yield of at least one half is required"
    total = sum_of(problem, tied)
    if isinstance(total, str):
        return total
    if total.skewed and promised is not None:
        return f"the deviations of {', '.join(total.skewed)} are skewed or have poles"
    main = [
        row
        if row.kind == "promise"
        else replace(row, probability=row.probability - total.lost[0 if row.clipped else 1])
        for row in main
    ]
    if any(row.kind != "promise" and row.probability < 0.5 for row in main):
        return "a yield or coverage of one half leaves no room for what a skewed law loses"
    relaxed = _relaxed_limits(problem, total.shift, main)
    left_out = f"; limits left out: {', '.join(relaxed)}" if relaxed else ""
    statement = f"quantile of the geometric backlash, which the effective one exceeds{left_out}"
    if total.skewed:
        statement += f"; even laws below those of {', '.join(total.skewed)}, which are skewed or have poles"
    if promised is not None:
        statement += f"; {statement_of(problem)}"
    if tied and isinstance(every := quantile_form(problem, tied=False), Form):
        form = _form(total, main, statement, relaxed, promised)
        return replace(form, also=(replace(every, also=()), *every.also))
    wide = coarsen_sum(problem, total, grades=promised is not None)
    others = tuple(_form(wide, rows, statement, relaxed, promised) for rows in _branches(main, total))
    main_form = _form(total, main, statement, relaxed, promised)
    return replace(main_form, also=others, only_bounds=bool(total.skewed))


@dataclass(frozen=True)
class Row:
    """A quantile of the backlash (`clipped` false) or of -phi_2 at a probability.

    `kind` says what stands for the parts that are bent: their uniform law ("convex"), their
    quantile at `fraction` ("fraction"), or nothing but their range ("range": the
    quantile of all others is at most that). "edge" is no quantile: s lets phi_2 be below zero; nor
    is "promise", by the moments of all parts (`PromisedRow`).
    """

    output: str
    probability: float
    clipped: bool
    most: float = np.inf
    kind: str = "convex"
    fraction: float = 1.0


def _rows(problem: RvBacklash) -> list[Row]:
    """The quantiles that objectives and limits ask for."""
    coverage = problem.settings.propagation.coverage
    limits = {limit.name: limit for limit in problem.limits}
    rows: list[Row] = []
    if "backlash_arcmin" in problem.required_outputs and coverage >= 0.5:
        rows.append(Row("backlash_arcmin", coverage, clipped=False))
    if "yield_percent" in limits and 50.0 <= limits["yield_percent"].low < 100.0:
        rows.append(Row("yield_percent", 0.01 * limits["yield_percent"].low, False, problem.limit))
    interfering = limits["interference_probability"].high if "interference_probability" in limits else 1.0
    if 0.0 < interfering <= 0.5:
        rows.append(Row("interference_probability", 1.0 - interfering, True, 0.0))
    return rows


def _branches(main: list[Row], total: Sum) -> list[list[Row]]:
    """The rows of designs for which y - Y >= 0 fails, in one row after the other."""
    branches = []
    safe = [kept for row in main for kept in _safe_rows(row)]
    for row in main:
        if row.kind != "promise" and any(part.bent and _is_in_sum(part, row) for part in total.parts):
            kind = "edge" if row.clipped else "range"
            branch = replace(row, kind=kind, output=f"{row.output} ({kind})", most=0.0)
            branches.append([*safe, branch])
    return branches


def _safe_rows(row: Row) -> list[Row]:
    """Rows that hold for every design which keeps a row."""
    if row.kind == "promise":
        return [row]
    lacking = 1.0 - row.probability
    return [
        replace(
            row,
            probability=1.0 - lacking / fraction,
            kind="fraction",
            fraction=fraction,
            output=row.output if fraction == 1.0 and not row.clipped else f"{row.output} ({fraction:g})",
        )
        for fraction in (BELOW if row.clipped else ABOVE)
        if lacking / fraction <= 0.5
    ]


def _form(total: Sum, rows: list[Row], statement: str, relaxed: tuple[str, ...], promised: PromisedRow | None) -> Form:
    factors, surplus = (np.zeros(len(total.parts)), None) if promised is None else promised.doubt(total.parts)
    features = [
        _feature(part, rows, promised, float(factor)) for part, factor in zip(total.parts, factors, strict=False)
    ]
    features.append(_shift_feature(total.shift, rows))
    doubts = tuple(surplus if row.kind == "promise" else None for row in rows)
    return Form(
        outputs=tuple(row.output for row in rows),
        features=tuple(features),
        offset=np.array([_offset(row, total) for row in rows]),
        constant=np.zeros(len(rows)),
        statement=statement,
        base=total.sorting_price,
        exact=False,
        relaxed=relaxed,
        quantiles=tuple(_quantile(row, total) for row in rows),
        most=tuple(row.most for row in rows),
        surpluses=doubts if any(doubt is not None for doubt in doubts) else (),
    )


def _offset(row: Row, total: Sum) -> float:
    """Constant of a row; that of the shift's scale is counted there."""
    if row.kind == "range":
        return 0.0
    if row.kind == "edge":
        return total.cycloid
    return -total.cycloid if row.clipped else total.cycloid + total.effective_change


def _quantile(row: Row, total: Sum) -> Quantile | None:
    if row.kind in ("edge", "promise"):
        return None
    laws = [part.members[0].top_law if row.clipped else part.members[0].law for part in total.parts]
    pieces = [(Piece(1.0, law),) if _spreads(part, row) else () for part, law in zip(total.parts, laws, strict=True)]
    fixed = (Piece(total.unknown, EvenNormal(1.0)),) if total.unknown else ()
    return Quantile(row.probability, (*pieces, ()), fixed)


def _is_in_sum(part: Part, row: Row) -> bool:
    """Whether a part belongs to the sum of a row."""
    return part.clipped or not row.clipped


def _spreads(part: Part, row: Row) -> bool:
    return _is_in_sum(part, row) and not (part.bent and row.kind != "convex")


def _feature(part: Part, rows: list[Row], promised: PromisedRow | None, factor: float) -> Feature:
    ways = []
    for member in part.members:
        coefficients = [_coefficients(part, member, row, promised, factor) for row in rows]
        linear, offset, spread = zip(*coefficients, strict=True)
        ways.append(Way(member.curve, member.low, member.high, linear, spread, offset, member.choice))
    return Feature(part.variable, tuple(ways), part.choice)


def _coefficients(
    part: Part, member: Member, row: Row, promised: PromisedRow | None, factor: float
) -> tuple[float, float, float]:
    """Slope, constant and spread that a way adds to a row."""
    if row.kind == "promise":
        assert promised is not None
        slope, constant, std = promised.moments(part, member)
        return slope, constant, factor * std
    return *_means(part, member, row), member.spread if _spreads(part, row) else 0.0


def _means(part: Part, member: Member, row: Row) -> tuple[float, float]:
    """Slope and constant of what a way adds to a row in addition to its spread."""
    if not _is_in_sum(part, row):
        return 0.0, 0.0
    match row.kind:
        case "range":
            return 0.0, -member.range if part.bent else 0.0
        case "edge" if part.bent:
            return 0.0, member.least
        case "edge":
            return member.slope, member.mean
        case "fraction" if part.bent and not row.clipped:
            return 0.0, member.least
        case "fraction" if part.bent:
            assert member.cell is not None
            return 0.0, -member.cell.quantile_above(row.fraction)
    if row.clipped:
        return -member.top_slope, -member.top
    return member.slope, member.mean


def _shift_feature(shift: Shift, rows: list[Row]) -> Feature:
    """s on a scale that begins at 1: t = s - low + 1."""
    sides = [0.0 if row.kind == "range" else (1.0 if row.kind == "edge" or not row.clipped else -1.0) for row in rows]
    offsets = tuple(side * (shift.low - 1.0) for side in sides)
    way = Way(ZERO_COST, 1.0, 1.0 + shift.high - shift.low, tuple(sides), (0.0,) * len(rows), offsets)
    return Feature(SHIFT, (way,))


def shortfalls(problem: RvBacklash, designs: Array, outputs: Mapping[str, Array]) -> dict[str, Array]:
    """By how much (n,) [arcmin] phi_2, or the limit of the yield, falls short of what is asked.

    A step of Newton's method by the density of a normal law.
    """
    total = problem.total(designs)
    limits, missing = {limit.name: limit for limit in problem.limits}, {}
    if "interference_probability" in limits:
        mean, variance = total_cumulants(total.clipped)[:2]
        excess = outputs["interference_probability"] - limits["interference_probability"].high
        missing["interference_probability"] = _step(excess, mean, variance)
    if "yield_percent" in limits:
        mean, variance = total_cumulants(total.clipped + total.free)[:2]
        lacking = 0.01 * (limits["yield_percent"].low - outputs["yield_percent"])
        missing["yield_percent"] = _step(lacking, problem.limit * ARCMIN - mean, variance)
    return missing


def _step(excess: Array, at: Array, variance: Array) -> Array:
    """A probability over the normal density at a distance from the mean [rad], in arcmin."""
    std = np.sqrt(variance)
    density = np.exp(-0.5 * np.minimum((at / std) ** 2, 9.0)) / (std * np.sqrt(2.0 * np.pi))
    return np.asarray(excess / density / ARCMIN)


def _relaxed_limits(problem: RvBacklash, shift: Shift, rows: list[Row]) -> tuple[str, ...]:
    """Limits that the form leaves out; those that a modification of every shift keeps are not."""
    s = np.linspace(shift.low, shift.high, SHIFTS)
    profile = profile_at(problem, columns_of(problem, shift, s))
    known = {row.output for row in rows} | {*problem.cost_names, *SHIFT_LIMITS}
    known |= {v.name for v in problem.variables if v.tolerance or v.name == "involute_grade"}
    return tuple(
        limit.name
        for limit in problem.limits
        if not allows_any(limit)
        and (limit.name not in known or _has_unkept_side(limit, problem.cost_names))
        and not (limit.name in profile and np.all(limit.kept(profile[limit.name])))
    )


def _has_unkept_side(limit: Limit, costs: tuple[str, ...]) -> bool:
    """Whether a limit has a side that no row keeps."""
    if limit.name == "yield_percent":
        return bool(np.isfinite(limit.high))
    rows = (*costs, "backlash_arcmin", "interference_probability")
    return limit.name in rows and bool(np.isfinite(limit.low))
