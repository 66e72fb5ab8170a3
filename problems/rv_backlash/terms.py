"""The terms of phi_2 by tolerance, and the ranges of variables, as convex forms need them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from ...models.propagation.sums import Term
from ..limits import narrowed
from .machined_tolerances import TERMS

if TYPE_CHECKING:
    from .problem import RvBacklash

GRADE, BEARING = "involute_grade", "crank_bearing_um"
"""Variables of the first and last stage, in the order of their terms."""


def unit_terms(problem: RvBacklash) -> dict[str, Term]:
    """The terms of the cycloid stage at half-widths of 1 um, without modification and stagger."""
    design = np.ones((1, len(problem.names)))
    for name in ("dr_rp_mm", "dr_p_mm", "stagger_arcmin"):
        design[:, problem.names.index(name)] = 0.0
    return dict(zip(TERMS, problem.change.opened(problem.plain_total(design)).clipped, strict=True))


def grades_of(problem: RvBacklash) -> tuple[Array, Term]:
    """The involute grades (k,) within their range, and the clearance of the first stage at each."""
    low, high = ends(problem, GRADE)
    grades = np.arange(np.ceil(low), np.floor(high) + 1.0)
    designs = np.ones((len(grades), len(problem.names)))
    designs[:, problem.names.index(GRADE)] = grades
    return grades, problem.total(designs).free[0]


def bearing_term(problem: RvBacklash) -> Term:
    """The clearance of the crank-arm bearings at 1 um."""
    return problem.total(np.ones((1, len(problem.names)))).free[1]


def ends(problem: RvBacklash, name: str) -> tuple[float, float]:
    """Range of a variable within the limits on it."""
    return narrowed(problem.limits, name, *problem.interval(name))
