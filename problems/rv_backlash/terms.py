"""The terms of phi_2 by tolerance, and the ranges of variables, as convex forms need them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...models.propagation.sums import Term
from ...models.rv_reducer.cycloid import LINEAR_ERRORS
from ..limits import narrowed

if TYPE_CHECKING:
    from .problem import RvBacklash


def unit_terms(problem: RvBacklash) -> dict[str, Term]:
    """The terms of the cycloid stage at half-widths of 1 um, without modification and stagger."""
    design = np.ones((1, len(problem.names)))
    for name in ("dr_rp_mm", "dr_p_mm", "stagger_arcmin"):
        design[:, problem.names.index(name)] = 0.0
    names = (*LINEAR_ERRORS, "eccentricity")
    return dict(
        zip((f"{n}_um" for n in names), problem.change.opened(problem.plain_total(design)).clipped, strict=True)
    )


def ends(problem: RvBacklash, name: str) -> tuple[float, float]:
    """Range of a variable within the limits on it."""
    return narrowed(problem.limits, name, *problem.interval(name))
