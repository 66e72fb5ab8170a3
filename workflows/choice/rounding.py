"""A design rounded to what can be ordered, checked by the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations, product
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ...problems.limits import limits_of
from ...problems.settings import Bound
from ...problems.tolerance_problem import ToleranceProblem
from .rules import COST

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
ALL = 8
"""Variables up to which every combination of neighbours is tried at once."""
HARD = 12
"""Variables up to which every combination is tried where no other keeps the limits."""
VERIFIED = 24
"""Best candidates that are judged by the full model."""
MOVES = 40
"""Changes of a search by steps at most."""
SLACK = 1e-9
"""Relative difference that counts as none."""


@dataclass(frozen=True, slots=True, eq=False)
class Neighbours:
    """The orderable values beside those of a design (all variables,): `below` and `above`.

    Both have shape (k,), for the variables of the columns `at` (k,); they are equal where there is
    one neighbour only.
    """

    design: Array
    at: NDArray[np.int64]
    below: Array
    above: Array

    def designs(self, up: Mask) -> Array:
        """Full designs (c, all variables) of choices (c, k): the upper neighbour where true."""
        found = np.repeat(self.design[None], len(up), axis=0)
        found[:, self.at] = np.where(up, self.above, self.below)
        return found

    @property
    def nearest(self) -> Mask:
        """The nearer neighbour of each variable (k,)."""
        own = self.design[self.at]
        return np.asarray(self.above - own < own - self.below)


def neighbours(problem: ToleranceProblem, design: Array, values: dict[str, Array]) -> Neighbours:
    """The neighbours of `design` among the orderable `values` by variable, in the room it has.

    A variable without an orderable value in its room keeps its own.
    """
    at, below, above = [], [], []
    for name, every in values.items():
        low, high = problem.room(name, design)
        column = problem.names.index(name)
        own = design[column]
        edge = SLACK * max(abs(low), abs(high))
        kept = np.clip(every[(every >= low - edge) & (every <= high + edge)], low, high)
        if not len(kept):
            continue
        lower, upper = kept[kept <= own], kept[kept >= own]
        at.append(column)
        below.append(lower.max() if len(lower) else upper.min())
        above.append(upper.min() if len(upper) else lower.max())
    return Neighbours(design, np.array(at, dtype=np.int64), np.array(below), np.array(above))


class Judge:
    """Ranks designs: limits first, then the objectives but the cost, then the cost.

    An output that nothing but a bound of `kept` asks for may be left out by the problem otherwise.
    """

    def __init__(
        self,
        problem: ToleranceProblem,
        design: Array,
        searching: bool,
        kept: Mapping[str, Bound],
    ) -> None:
        self.problem = problem
        known = {COST, *problem.names, *problem.objectives, *(one.name for one in problem.limits)}
        more = {name: bound for name, bound in kept.items() if name not in known}
        self.asked = problem.relaxed(more) if more else problem
        self.searching = searching
        self.limits = limits_of(kept, problem.outputs, problem.variables)
        self.own = self._outputs(design[None])

    def _outputs(self, designs: Array) -> dict[str, Array]:
        if self.searching:
            return self.asked.outputs_of(designs, searching=True)
        return self.asked.needed(designs)

    def keys(self, designs: Array) -> Array:
        """Violation, worsening of the other objectives and cost, shape (n, 3); less is better."""
        found = self._outputs(designs)
        broken = self.problem.violations(designs, found)
        violation = np.maximum(broken, 0.0).sum(axis=1)
        for limit in self.limits:
            for column in limit.violations(self.problem.values(designs, found, limit.name)):
                violation += np.maximum(column, 0.0)
        worse = np.zeros(len(designs))
        for name in self.problem.objectives:
            if name != COST:
                own = self.own[name][0]
                worse = np.maximum(worse, (found[name] - own) / (abs(own) or 1.0))
        cost = found.get(COST, np.zeros(len(designs)))
        return np.stack([violation, np.where(worse > SLACK, worse, 0.0), cost], axis=1)


def best(keys: Array) -> NDArray[np.int64]:
    """Rows from the best to the worst."""
    return np.lexsort(keys.T[::-1])


def rounded(
    problem: ToleranceProblem,
    design: Array,
    values: dict[str, Array],
    kept: Mapping[str, Bound] = MappingProxyType({}),
) -> Array:
    """The design (all variables,) at the neighbour that can be ordered.

    The cheapest combination of neighbours that keeps all limits (those of the problem, and the
    bounds `kept`) and is no worse in the other objectives; where there is none, the one that breaks
    the limits least, then the least worse. Up to `ALL` variables every combination is tried, and up
    to `HARD` where limits would break; else single and pairwise changes. The full model decides
    between the best `VERIFIED`.
    """
    near = neighbours(problem, design, values)
    if not len(near.at):
        return design
    quick, full = Judge(problem, design, True, kept), Judge(problem.reported(), design, False, kept)
    some = _every(near) if len(near.at) <= ALL else _by_steps(near, quick)
    found, keys = _verified(near, some, quick, full)
    if keys[0] > 0.0 and ALL < len(near.at) <= HARD:
        found, keys = _verified(near, _every(near), quick, full)
    return found


def _every(near: Neighbours) -> Mask:
    """Every combination (2^k', k) of the variables that have two neighbours."""
    open_ = np.flatnonzero(near.below < near.above)
    found = np.zeros((2 ** len(open_), len(near.at)), dtype=bool)
    found[:, open_] = list(product((False, True), repeat=len(open_)))
    return found


def _by_steps(near: Neighbours, judge: Judge) -> Mask:
    """What a search from the better of two starts has seen: all below, and the nearest."""
    count = len(near.at)
    flips = np.zeros((count + count * (count - 1) // 2, count), dtype=bool)
    flips[np.arange(count), np.arange(count)] = True
    for row, pair in enumerate(combinations(range(count), 2), start=count):
        flips[row, list(pair)] = True
    seen = np.stack([np.zeros(count, dtype=bool), near.nearest])
    keys = judge.keys(near.designs(seen))
    for _ in range(MOVES):
        at = best(keys)[0]
        more = seen[at] ^ flips
        seen, keys = np.vstack([seen, more]), np.vstack([keys, judge.keys(near.designs(more))])
        if best(keys)[0] == at:
            break
    return seen


def _verified(near: Neighbours, masks: Mask, quick: Judge, full: Judge) -> tuple[Array, Array]:
    """The best design by the full model among the best of a quick look, and its key."""
    designs = np.unique(near.designs(masks), axis=0)
    some = designs[best(quick.keys(designs))[:VERIFIED]]
    keys = full.keys(some)
    at = best(keys)[0]
    return some[at], keys[at]
