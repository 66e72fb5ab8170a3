"""Tolerances of an RV reducer that machines make: their means, and ways of the forms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...models.costs import CostCurve
from ...models.machines import convex_cost
from ...models.propagation.sums import ClippedSum
from ...models.rv_reducer.cycloid import LINEAR_ERRORS
from ..machined import Made, curve_of

if TYPE_CHECKING:
    from .problem import RvBacklash

Array = NDArray[np.float64]
TERMS = tuple(f"{name}_um" for name in (*LINEAR_ERRORS, "eccentricity"))
"""Variables of the terms of phi_2, in their order."""
MACHINABLE = TERMS
CELLS = 6
"""Pieces of the range of a machine that is not centred."""
TRIED = 33
"""Points of a piece at which lines are tried."""


def moved(problem: RvBacklash, designs: Array, total: ClippedSum) -> ClippedSum:
    """The sum with the means of what machines make; spreads are in the place of limits already."""
    if not problem.made:
        return total
    terms = list(total.clipped)
    for one in problem.made.values():
        at = TERMS.index(one.name)
        t = problem.column(designs, one.name)
        spread, mean = one.spread_and_mean(t, problem.chosen(designs, one))
        term = terms[at]
        terms[at] = replace(term, constant=term.constant + term.linear / spread * mean)
    return replace(total, clipped=tuple(terms))


@dataclass(frozen=True, slots=True)
class Piece:
    """Spreads between which a tolerance is made in the way `choice`.

    What its mean adds lies between `least[0] x + least[1]` and `most[0] x + most[1]`.
    """

    curve: CostCurve
    low: float
    high: float
    choice: float
    least: tuple[float, float] = (0.0, 0.0)
    most: tuple[float, float] = (0.0, 0.0)


def pieces_of(one: Made, ends: tuple[float, float], per_unit: float) -> Iterator[Piece]:
    """The ways of a tolerance within `ends` of its limit, whose mean counts `per_unit`."""
    for number, way in enumerate(one.ways):
        low, high = max(way.low, ends[0]), min(way.high, ends[1])
        if low > high:
            continue
        choice = np.full(2, number)
        spread, mean = one.spread_and_mean(np.array([low, high]), choice)
        if way.low == way.high:
            fixed = (0.0, per_unit * float(mean[0]))
            yield Piece(way.curve, float(spread[0]), float(spread[0]), float(number), fixed, fixed)
            continue
        plain = one.by_spread(way)
        curve, _ = convex_cost(curve_of(one, way, low, high), plain.tried)
        cells = CELLS if way.machine.mean else 1
        for first, last in pairwise(np.linspace(spread[0], spread[1], cells + 1).tolist()):
            x = np.linspace(first, last, TRIED)
            value = per_unit * way.machine.good_parts(plain.limit(x)).mean
            slope = float((value[-1] - value[0]) / (last - first)) if last > first else 0.0
            rest = value - slope * x
            slack = float(np.max(np.abs(np.diff(value, 2)))) + 1e-12 * abs(per_unit)
            yield Piece(curve, first, last, float(number), (slope, float(rest.min()) - slack),
                        (slope, float(rest.max()) + slack))  # fmt: skip
