"""The promise of the geometric backlash as a row of the form, in addition to the quantiles.

Every way enters by a lower bound of its mean (linear in t) and of its standard deviation
(proportional to t), as in `form`; the row holds for every design, whatever others leave out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from ...arrays import Array
from ...models.capability import Surplus
from ...models.propagation.sums import Term
from ..forms import Way
from ..promise import ASSURED
from .deviating import MEAN, STD, doubt_of
from .form import OUTPUTS, bearing_feature, cell_way, grade_feature, tolerance_feature
from .pieces import Member, Part
from .terms import unit_terms

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
