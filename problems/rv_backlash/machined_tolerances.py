"""Tolerances of an RV reducer that machines make: their means, and ways of the forms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from ...models.costs import CostCurve
from ...models.machines import convex_cost
from ...models.propagation.sums import ClippedSum
from ...models.rv_reducer.cycloid import LINEAR_ERRORS
from ..machined_tolerance import MachinedTolerance, curve_of

if TYPE_CHECKING:
    from .problem import RvBacklash

TERMS = tuple(f"{name}_um" for name in (*LINEAR_ERRORS, "eccentricity"))
"""Variables of the terms of phi_2, in their order."""
CELLS = 6
"""Pieces of the range of a machine that is not centred."""
TRIED = 33
"""Points of a piece at which lines are tried."""
ROUNDING = 1e-12
"""Fraction of its values by which a line keeps below."""


def moved(problem: RvBacklash, designs: Array, total: ClippedSum) -> ClippedSum:
    """The sum with the means of machined parts; spreads already replace the limits.

    A term b x z + q (x z)^2 of the spread x becomes, about a mean m, b m + q m^2 and
    (b + 2 q m) x z + q (x z)^2.
    """
    if not problem.machined_tolerances:
        return total
    terms = list(total.clipped)
    for name, (x, m) in problem.as_made(designs).items():
        at = TERMS.index(name)
        term = terms[at]
        if not problem.model.moves(name.removesuffix("_um")):
            continue
        q = 0.0 if term.quadratic is None else term.quadratic / x**2
        terms[at] = replace(
            term, constant=term.constant + (term.linear / x + q * m) * m, linear=term.linear + 2.0 * q * m * x
        )
    return replace(total, clipped=tuple(terms))


@dataclass(frozen=True, slots=True)
class Piece:
    """Spreads between which a tolerance is made in the way `choice`, and means of its good parts.

    `means` (k,) belong to spreads `x` (k,) from `low` to `high`.
    """

    curve: CostCurve
    low: float
    high: float
    choice: float
    x: Array
    means: Array

    def line(self, values: Array, side: float) -> tuple[float, float]:
        """Slope and constant of a line below (`side` = 1) or above (-1) values (k,) at `x`."""
        wide = self.high > self.low
        slope = float((values[-1] - values[0]) / (self.high - self.low)) if wide else 0.0
        rest = side * (values - slope * self.x)
        slack = float(np.max(np.abs(np.diff(values, 2)), initial=0.0))
        slack += ROUNDING * float(np.max(np.abs(values)))
        return slope, side * (float(rest.min()) - (slack if wide else 0.0))


def pieces_of(
    tolerance: MachinedTolerance, ends: tuple[float, float], moving: int = CELLS, still: int = 1
) -> Iterator[Piece]:
    """The ways of a tolerance within `ends` of its limit.

    Those that are inspected are cut, into `moving` pieces where their mean moves, else `still`.
    """
    for number, way in enumerate(tolerance.ways):
        low, high = max(way.low, ends[0]), min(way.high, ends[1])
        if low > high:
            continue
        choice = np.full(2, number)
        spread, mean = tolerance.spread_and_mean(np.array([low, high]), choice)
        if way.low == way.high:
            x = float(spread[0])
            yield Piece(way.curve, x, x, float(number), spread[:1], mean[:1])
            continue
        plain = tolerance.by_spread(way)
        curve, _ = convex_cost(curve_of(tolerance, way, low, high), plain.tabulated)
        cells = moving if way.machine.mean else still
        for first, last in pairwise(np.linspace(spread[0], spread[1], cells + 1).tolist()):
            x_of = np.linspace(first, last, TRIED)
            means = way.machine.good_parts(plain.limit(x_of)).mean
            yield Piece(curve, first, last, float(number), x_of, means)
