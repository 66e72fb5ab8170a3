"""A design rounded to what can be ordered, checked by the model."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...problems.interfaces import Accuracy
from ...problems.settings import Bound
from ...problems.tolerance_problem import ToleranceProblem
from .moves import by_moves
from .neighbours import Neighbours, neighbours
from .ranking import Ranking, best

Mask = NDArray[np.bool_]
ALL = 8
"""Variables up to which every combination of neighbours is tried at once."""
HARD = 12
"""Variables up to which every combination is tried where no other keeps the limits."""
VERIFIED = 24
"""Best candidates that are tested by the full model."""


def rounded(
    problem: ToleranceProblem,
    design: Array,
    values: dict[str, Array],
    bounds: Mapping[str, Bound] = MappingProxyType({}),
) -> Array:
    """The design (all variables,) at the neighbour that can be ordered.

    The cheapest combination of neighbours that keeps all limits (those of the problem, and the
    `bounds`) and is no worse in the other objectives; where there is none, the one that breaks
    the limits least, then the least worse. Up to `ALL` variables every combination is tried, and up
    to `HARD` where limits would break; else changes are priced one by one (`by_moves`). The full
    model decides between the best `VERIFIED`; where all of them break a limit, the quick search is
    repeated, corrected by the difference of the full model at the design: on a sample of units the
    quick one may be the more lenient.
    """
    near = neighbours(problem, design, values)
    if not len(near.at):
        return design
    quick = Ranking(problem, design, True, bounds)
    full = Ranking(Accuracy.of(problem).reported(), design, False, bounds)
    rounded_design, keys = _best(near, quick, full)
    if keys[0] > 0.0:
        quick.learn(full, design)
        retried, retried_keys = _best(near, quick, full)
        rounded_design = retried if tuple(retried_keys.tolist()) < tuple(keys.tolist()) else rounded_design
    return rounded_design


def _best(near: Neighbours, quick: Ranking, full: Ranking) -> tuple[Array, Array]:
    """The best design of the search, and its key."""
    masks = _every(near) if len(near.at) <= ALL else by_moves(near, quick, VERIFIED)
    best_design, keys = _verified(near, masks, quick, full)
    if keys[0] > 0.0 and ALL < len(near.at) <= HARD:
        best_design, keys = _verified(near, _every(near), quick, full)
    return best_design, keys


def _every(near: Neighbours) -> Mask:
    """Every combination (2^k', k) of the variables that have two neighbours."""
    open_ = np.flatnonzero(near.below < near.above)
    masks = np.zeros((2 ** len(open_), len(near.at)), dtype=bool)
    masks[:, open_] = list(product((False, True), repeat=len(open_)))
    return masks


def _verified(near: Neighbours, masks: Mask, quick: Ranking, full: Ranking) -> tuple[Array, Array]:
    """The best design by the full model among the best by the quick model, and its key."""
    designs = np.unique(near.designs(masks), axis=0)
    shortlist = designs[best(quick.keys(designs))[:VERIFIED]]
    keys = full.keys(shortlist)
    at = best(keys)[0]
    return shortlist[at], keys[at]
