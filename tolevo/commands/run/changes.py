"""Designs of values that can be ordered: single steps tried by the full model, and rounding."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...problems.limits import Limit, limits_of
from ...problems.settings import Bound
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array, Kind, Variable
from ...units import drawing_number, plain_number, split_unit
from .choice import COST

# The values that can be ordered next to those of a design.


Mask = NDArray[np.bool_]
ROOM_TOLERANCE = 1e-9
"""Relative difference that counts as none."""


@dataclass(frozen=True, slots=True, eq=False)
class Neighbours:
    """The orderable values next to those of a design (all variables,): `below` and `above`.

    Both have shape (k,), for the variables of the columns `at` (k,); they are equal where there is
    one neighbour only.
    """

    design: Array
    at: NDArray[np.int64]
    below: Array
    above: Array

    def designs(self, up: Mask) -> Array:
        """Full designs (c, all variables) of choices (c, k): the upper neighbour where true."""
        full = np.repeat(self.design[None], len(up), axis=0)
        full[:, self.at] = np.where(up, self.above, self.below)
        return full

    @property
    def nearest(self) -> Mask:
        """The nearer neighbour of each variable (k,)."""
        values = self.design[self.at]
        return np.asarray(self.above - values < values - self.below)


def neighbours(problem: ToleranceProblem, design: Array, values: dict[str, Array]) -> Neighbours:
    """The neighbours of `design` among the orderable `values` by variable, in the room it has.

    A variable without an orderable value in its room keeps its own.
    """
    at, below, above = [], [], []
    for name, orderable in values.items():
        low, high = problem.room(name, design)
        column = problem.names.index(name)
        value = design[column]
        edge = ROOM_TOLERANCE * max(abs(low), abs(high))
        within = np.clip(orderable[(orderable >= low - edge) & (orderable <= high + edge)], low, high)
        if not len(within):
            continue
        lower, upper = within[within <= value], within[within >= value]
        at.append(column)
        below.append(lower.max() if len(lower) else upper.min())
        above.append(upper.min() if len(upper) else lower.max())
    return Neighbours(design, np.array(at, dtype=np.int64), np.array(below), np.array(above))


# Which of several designs is the better one to order.


BATCH = 64
"""Designs that are evaluated at once: every output of each is held meanwhile."""


class Ranking:
    """Ranks designs: limits first, then the objectives but the cost, then the cost.

    The outputs of `bounds` are requested as well: the problem may leave them out
    otherwise.
    """

    def __init__(self, problem: ToleranceProblem, design: Array, searching: bool, bounds: Mapping[str, Bound]) -> None:
        self.problem = problem
        known = {COST, *problem.names, *problem.objectives, *(limit.name for limit in problem.limits)}
        more = {name: bound for name, bound in bounds.items() if name not in known}
        self.extended = problem.relaxed(more) if more else problem
        self.searching = searching
        self.limits = limits_of(bounds, problem.outputs, problem.variables)
        self.reference = self._outputs(design[None])
        self.correction: Array | float = 0.0

    def _outputs(self, designs: Array) -> dict[str, Array]:
        if self.searching:
            return self.extended.outputs_of(designs, searching=True)
        return self.extended.needed_outputs(designs)

    def use(self, designs: Array) -> tuple[Array, Array]:
        """How far designs use up limits and other objectives (n, columns), and their cost (n,).

        Above 0 a limit is broken, or an objective worse than that of the design; the first columns
        are those of limits, the last ones those of objectives.
        """
        parts = [designs[at : at + BATCH] for at in range(0, max(len(designs), 1), BATCH)]
        use, cost = zip(*map(self._use, parts), strict=True)
        return np.concatenate(use) + self.correction, np.concatenate(cost)

    def learn(self, other: Ranking, design: Array) -> None:
        """Correct `use` from now on by the excess of `other.use` at a full design (all,)."""
        missing = other.use(design[None])[0][0] - self.use(design[None])[0][0]
        self.correction = self.correction + np.where(np.isfinite(missing), missing, 0.0)

    def _use(self, designs: Array) -> tuple[Array, Array]:
        outputs = self._outputs(designs)
        columns = [self.problem.violations(designs, outputs)]
        for limit in self.limits:
            value = self.problem.values(designs, outputs, limit.name)
            columns += [column[:, None] for column in limit.violations(value)]
        for name in self._objectives_except_cost:
            reference = self.reference[name][0]
            columns.append(((outputs[name] - reference) / (abs(reference) or 1.0))[:, None])
        cost = outputs.get(COST, np.zeros(len(designs)))
        return np.concatenate(columns, axis=1), cost

    def keys(self, designs: Array) -> Array:
        """Violation, worsening of the other objectives and cost, shape (n, 3); less is better."""
        return self.ranked(*self.use(designs))

    def ranked(self, use: Array, cost: Array) -> Array:
        """The keys (n, 3) of values that `use` returns, or of predicted ones."""
        limits = use.shape[1] - len(self._objectives_except_cost)
        violation = np.maximum(use[:, :limits], 0.0).sum(axis=1)
        worse = np.max(use[:, limits:], axis=1, initial=0.0)
        return np.stack([violation, np.where(worse > ROOM_TOLERANCE, worse, 0.0), cost], axis=1)

    @property
    def _objectives_except_cost(self) -> list[str]:
        return [name for name in self.problem.objectives if name != COST]


def best(keys: Array) -> NDArray[np.int64]:
    """Rows from the best to the worst."""
    return np.lexsort(keys.T[::-1])


# What changing one tolerance alone does to a chosen allocation: tried by the full model.


VALUE_TOLERANCE = 1e-9
"""Relative difference below which two values count as equal."""
NAMED = 8
"""Steps that a sentence names at most."""
FEW, MOST = 8, 100
"""Steps of a point that are tried at least, and at most."""
VALUES, IN_ALL = 4000, 20_000
"""Values of variables in the designs that are tried at most: of a point, and of all points."""

Step = tuple[Variable, str, float, Array]
"""The variable of a tolerance, its new value in words, that value, and the full design (all,)."""


def changes(
    problem: ToleranceProblem, designs: Mapping[int, Array], values: Mapping[str, Mapping[float, str]]
) -> pd.DataFrame:
    """Every tolerance of chosen points moved to the next value on either side, all others kept.

    `designs` are the full designs (all variables,) by the row of the front, `values` what can be
    ordered of a variable, with the name of its grade. Choices are moved to every other process, or
    to the next grade. Columns: `point`, `variable`, `to` (in words), `value`, `cost_change`,
    `change_<name>` of every other objective and limited output, `breaks` (the limits that the
    changed design breaks by the full model, separated by spaces), `broken` (with their values) and
    `untried` (steps of the point that were too many to be tried: those that save least). A point
    for which none is left of the budget has no row.
    """
    whole, size = problem.reported(), len(problem.variables)
    rows: list[dict[str, Any]] = []
    used = 0
    for point, design in designs.items():
        every = list(_steps(problem, design, values))
        steps = _select_steps(problem, every, int(np.clip(VALUES // size, FEW, MOST)))
        used += len(steps) * size
        if rows and used > IN_ALL:
            break
        tried = np.stack([design, *(step[3] for step in steps)])
        outputs = _evaluate_designs(whole, tried)
        cost = outputs.get(COST, np.zeros(len(tried)))
        names = [n for n in dict.fromkeys((*problem.objectives, *_limited_outputs(problem))) if n != COST]
        moved = {name: column - column[0] for name in names for column in (whole.values(tried, outputs, name),)}
        for at, (variable, to, value, _) in enumerate(steps, start=1):
            broken = _broken_limits(
                whole, tried[at : at + 1], {name: column[at : at + 1] for name, column in outputs.items()}
            )
            rows.append(
                {"point": point, "variable": variable.name, "to": to, "value": value}
                | {"cost_change": cost[at] - cost[0]}
                | {f"change_{name}": column[at] for name, column in moved.items()}
                | {"breaks": " ".join(broken), "broken": "; ".join(broken.values())}
                | {"untried": len(every) - len(steps)}
            )
    return pd.DataFrame(rows) if rows else pd.DataFrame({"point": [], "cost_change": [], "breaks": []})


def _select_steps(problem: ToleranceProblem, steps: list[Step], most: int) -> list[Step]:
    """At most so many steps, those that save most."""
    if len(steps) <= most:
        return steps
    order = np.argsort(problem.cost_of(np.stack([step[3] for step in steps])), kind="stable")[:most]
    return [steps[at] for at in np.sort(order)]


def _limited_outputs(problem: ToleranceProblem) -> list[str]:
    return [limit.name for limit in problem.limits if limit.count]


def _evaluate_designs(problem: ToleranceProblem, designs: Array) -> dict[str, Array]:
    """The outputs that are asked for of full designs, a batch at a time."""
    parts = [problem.needed_outputs(designs[at : at + BATCH]) for at in range(0, len(designs), BATCH)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _broken_limits(problem: ToleranceProblem, design: Array, outputs: Mapping[str, Array]) -> dict[str, str]:
    """The limits that a full design (1, all) breaks, and by which values."""
    broken = {}
    for limit in problem.limits:
        value = problem.values(design, outputs, limit.name)
        if not limit.kept(value)[0]:
            broken[limit.name] = f"{words(limit.name)} {value_against_limit(float(value[0]), limit)}"
    return broken


def value_against_limit(value: float, limit: Limit) -> str:
    """Like "0.1783 instead of at most 0.17 mm", with as many digits as show the difference."""
    if np.isnan(value):
        return "has no value"
    end, side = (limit.low, "least") if value < limit.low else (limit.high, "most")
    bound, digits = drawing_number(end), 4
    while digits < 12 and f"{value:.{digits}g}" == f"{end:.{digits}g}":
        digits += 1
    return f"{value:.{digits}g} instead of at {side} {bound} {limit.unit}".rstrip()


def words(name: str) -> str:
    """A column as words, without its unit."""
    return split_unit(name)[0].replace("_", " ").replace(".", " ")


def label_of(name: str) -> str:
    """A tolerance, or the choice of its process, as words: `hub_t` is hub."""
    return words(split_unit(name)[0].removesuffix("_t").removesuffix("_process"))


# ---------------------------------------------------------------- the steps


def _steps(problem: ToleranceProblem, design: Array, values: Mapping[str, Mapping[float, str]]) -> Iterator[Step]:
    """The next values of every free tolerance of a full design (all,), and its other processes."""
    names = problem.names
    for variable in problem.free:
        own = float(design[names.index(variable.name)])
        if variable.labels:
            yield from _processes(problem, variable, design, round(own))
        elif variable.kind is Kind.GRADE:
            low, high = problem.interval(variable.name)
            near = [value for value in (own - 1.0, own + 1.0) if low <= value <= high]
            yield from (
                (variable, f"grade {value:g}", value, _move_variable(problem, design, variable, value))
                for value in near
            )
        elif variable.tolerance and not variable.integer:
            for value, grade in _adjacent_values(problem, variable, design, values.get(variable.name, {})):
                to = grade or f"{drawing_number(value)} {variable.unit}".rstrip()
                yield variable, to, value, _move_variable(problem, design, variable, value)


def _adjacent_values(
    problem: ToleranceProblem, variable: Variable, design: Array, values: Mapping[float, str]
) -> list[tuple[float, str]]:
    """The orderable values below and above that of a design, in the room that it has."""
    low, high = problem.room(variable.name, design)
    own = float(design[problem.names.index(variable.name)])
    within = [value for value in values if low * (1.0 - VALUE_TOLERANCE) <= value <= high * (1.0 + VALUE_TOLERANCE)]
    below = max((value for value in within if value < own * (1.0 - VALUE_TOLERANCE)), default=None)
    above = min((value for value in within if value > own * (1.0 + VALUE_TOLERANCE)), default=None)
    return [(min(max(value, low), high), values[value]) for value in (below, above) if value is not None]


def _processes(problem: ToleranceProblem, variable: Variable, design: Array, own: int) -> list[Step]:
    """The other processes of a part; of grades to choose from, the next on either side."""
    others = [
        (variable, label, float(number), _move_variable(problem, design, variable, float(number)))
        for number, label in enumerate(variable.labels)
        if number != own and problem.interval(variable.name)[0] <= number <= problem.interval(variable.name)[1]
    ]
    tolerance = f"{variable.name.removesuffix('_process')}_t"
    if tolerance not in problem.names:
        return others
    at = problem.names.index(tolerance)
    rooms = [problem.room(tolerance, step[3]) for step in others] if _is_free(problem, tolerance) else []
    if not rooms or any(low < high for low, high in rooms):
        return others
    others.sort(key=lambda step: step[3][at])
    tighter = [step for step in others if step[3][at] < design[at]]
    return tighter[-1:] + [step for step in others if step[3][at] >= design[at]][:1]


def _is_free(problem: ToleranceProblem, name: str) -> bool:
    return any(variable.name == name for variable in problem.free)


def _move_variable(problem: ToleranceProblem, design: Array, variable: Variable, value: float) -> Array:
    """The full design with another value, in the room that a chosen process leaves."""
    moved = design.copy()
    moved[problem.names.index(variable.name)] = value
    free = [problem.names.index(v.name) for v in problem.free]
    return np.asarray(problem.complete(moved[None, free])[0])


# ---------------------------------------------------------------- in sentences


def advice(problem: ToleranceProblem, tried: pd.DataFrame, design_values: Mapping[Any, Any]) -> str:
    """Which tolerance of a point to loosen first, by its `changes`, or which limit forbids each.

    `design_values` are the objectives of the point, as far as it has them.
    """
    currency = problem.settings.money.currency
    others = [name for name in problem.objectives if name != COST]
    size = max(abs(float(design_values.get(COST, 0.0))), 1e-300)
    saving = tried[tried["cost_change"] < -VALUE_TOLERANCE * size]
    if saving.empty:
        return "No step of one tolerance by itself to the next value that can be ordered saves anything."
    kept = saving[saving["breaks"] == ""]
    if kept.empty:
        untried = int(tried["untried"].iloc[0])
        which = f"each of the {len(saving)} steps that save most" if untried else "every step"
        return f"No tolerance can be loosened by itself: {which} breaks a limit ({_list_steps(saving)})."
    worse = [kept[f"change_{name}"].to_numpy(dtype=float) / (abs(design_values[name]) or 1.0) for name in others]
    loss = np.max([np.zeros(len(kept)), *worse], axis=0)
    rate = -kept["cost_change"].to_numpy(dtype=float) / size / np.maximum(loss, VALUE_TOLERANCE)
    best = kept.iloc[int(np.argmax(rate))].to_dict()
    units = {o.name: o.unit for o in problem.outputs}
    text = f"Loosen first: {step_words(best)}: saves {_money(-float(best['cost_change']), currency)}"
    for name in others:
        change, unit = float(best[f"change_{name}"]), units.get(name, "")
        direction = "rises" if change > 0.0 else "falls"
        if change:
            text += f"; {words(name)} {direction} by {plain_number(abs(change), 3)} {unit}".rstrip()
    text += "; every limit is kept" if _limited_outputs(problem) else ""
    blocked = saving[saving["breaks"] != ""]
    return f"{text}. {_blocked_sentence(blocked)}" if len(blocked) else f"{text}."


def _blocked_sentence(blocked: pd.DataFrame) -> str:
    return f"Not to be loosened by themselves: {_list_steps(blocked)}."


def step_words(row: Mapping[Any, Any]) -> str:
    """Like "shaft, to IT11"."""
    return f"{label_of(str(row['variable']))}, to {row['to']}"


def _list_steps(rows: pd.DataFrame) -> str:
    """The steps, the largest saving first, each with what it breaks."""
    ordered = rows.sort_values("cost_change", kind="stable").to_dict("records")
    named = [f"{step_words(row)}: {row['broken']}" for row in ordered[:NAMED]]
    more = len(ordered) - len(named)
    return "; ".join([*named, f"{more} more break a limit"] if more else named)


def _money(amount: float, currency: str) -> str:
    return f"{plain_number(amount, 3)} {currency}".rstrip()


# Rounding of many variables: changes are priced one by one, and made where they pay.


ROUNDS = 40
"""Rounds of pricing at most."""
PAIRS = 24
"""Pairs of changes that are evaluated per round."""
LENGTHS = 24
"""Lengths of a series of changes that are evaluated per round."""
MIN_USE = 1e-12
"""Room below which there is none."""


@dataclass(frozen=True, slots=True, eq=False)
class Prices:
    """What every single change (k,) of a design adds: `use` (k, columns) and `cost` (k,).

    `base_use` (columns,) and `base_cost` are those of the design itself; see `Ranking.use`.
    """

    base_use: Array
    base_cost: float
    use: Array
    cost: Array


def choices_by_moves(near: Neighbours, ranking: Ranking, most: int) -> Mask:
    """The best choices (at most `most`, k) of neighbours that a search by prices finds.

    Each round evaluates every single change, the pairs that look best where the effects of two
    changes are added, and two series: single changes in the order of their saving per use of the
    remaining room, and pairs that save without a variable in common. A round grows with the
    variables.
    """
    count = len(near.at)
    masks = np.stack([np.zeros(count, dtype=bool), near.nearest])
    known = ranking.keys(near.designs(masks))
    masks, known = _select_moves(masks, known, most)
    for _ in range(ROUNDS):
        at, key = masks[0], known[0]
        singles = at ^ np.eye(count, dtype=bool)
        use, cost = ranking.use(near.designs(np.vstack([at[None], singles])))
        prices = Prices(use[0], float(cost[0]), use[1:] - use[0], cost[1:] - cost[0])
        series = np.vstack([_single_changes(at, prices), *_pairs(at, prices, ranking)])
        keys = np.vstack([ranking.ranked(use[1:], cost[1:]), ranking.keys(near.designs(series))])
        masks, known = _select_moves(np.vstack([masks, singles, series]), np.vstack([known, keys]), most)
        if tuple(known[0].tolist()) >= tuple(key.tolist()):
            break
    return masks


def _select_moves(masks: Mask, keys: Array, most: int) -> tuple[Mask, Array]:
    """The best `most` of them, in order."""
    order = best(keys)[:most]
    return masks[order], keys[order]


def _single_changes(at: Mask, prices: Prices) -> Mask:
    """Changes that save, in the order of their saving per use of the remaining room."""
    room = np.maximum(-prices.base_use, MIN_USE)
    used = np.max(np.maximum(prices.use, 0.0) / room, axis=1, initial=0.0)
    rows = np.flatnonzero(prices.cost < 0.0)
    order = rows[np.argsort(prices.cost[rows] / (used[rows] + MIN_USE), kind="stable")]
    return _apply_first_groups(at, order[:, None], prices)


def _pairs(at: Mask, prices: Prices, ranking: Ranking) -> tuple[Mask, Mask]:
    """The best pairs by added effects, and a series of pairs without a variable in common."""
    first, second = np.triu_indices(len(at), 1)
    use = prices.base_use + prices.use[first] + prices.use[second]
    keys = ranking.ranked(use, prices.base_cost + prices.cost[first] + prices.cost[second])
    order = best(keys)[: 4 * len(at)]
    pairs = np.stack([first[order], second[order]], axis=1)
    alone = np.repeat(at[None], min(PAIRS, len(pairs)), axis=0)
    for row, pair in enumerate(pairs[:PAIRS].tolist()):
        alone[row, pair] ^= True
    base = ranking.ranked(prices.base_use[None], np.array([prices.base_cost]))[0]
    pays = [tuple(key) < tuple(base.tolist()) for key in keys[order].tolist()]
    return alone, _apply_first_groups(at, _disjoint_pairs(pairs[np.array(pays, dtype=bool)]), prices)


def _disjoint_pairs(pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs, from the first, that have no variable in common."""
    taken, disjoint = set[int](), []
    for first, second in pairs.tolist():
        if first not in taken and second not in taken:
            taken |= {first, second}
            disjoint.append((first, second))
    return np.array(disjoint, dtype=np.int64).reshape(-1, 2)


def _apply_first_groups(at: Mask, groups: NDArray[np.int64], prices: Prices) -> Mask:
    """The design after the first n of the groups (g, size) of changes: several n around the largest
    that keeps to the remaining room where effects are added.
    """
    if not len(groups):
        return np.empty((0, len(at)), dtype=bool)
    total = prices.base_use + np.cumsum(prices.use[groups].sum(axis=1), axis=0)
    fits = np.all(total <= np.maximum(prices.base_use, 0.0), axis=1)
    most = len(groups) if np.all(fits) else int(np.argmin(fits))
    ends = np.unique(np.clip(most + np.arange(-LENGTHS // 2, LENGTHS // 2), 1, len(groups)))
    masks = np.repeat(at[None], len(ends), axis=0)
    for row, end in enumerate(ends.tolist()):
        masks[row, groups[:end].ravel()] ^= True
    return masks


# A design rounded to what can be ordered, checked by the model.


RoundingMask = NDArray[np.bool_]
MAX_EXHAUSTIVE_VARIABLES = 8
"""Variables up to which every combination of neighbours is tried at once."""
HARD = 12
"""Variables up to which every combination is tried where no other keeps the limits."""
VERIFIED = 24
"""Best candidates that are tested by the full model."""


def round_design(
    problem: ToleranceProblem,
    design: Array,
    values: dict[str, Array],
    bounds: Mapping[str, Bound] = MappingProxyType({}),
) -> Array:
    """The design (all variables,) at the neighbour that can be ordered.

    The cheapest combination of neighbours that keeps all limits (those of the problem, and the
    `bounds`) and is no worse in the other objectives; where there is none, the one that breaks
    the limits least, then the least worse. Up to `MAX_EXHAUSTIVE_VARIABLES` variables every
    combination is tried, and up to `HARD` where limits would break; else changes are priced one
    by one (`choices_by_moves`). The full model decides between the best `VERIFIED`; where all of
    them break a limit, the quick search is repeated, corrected by the difference of the full model
    at the design: on a sample of units the quick one may be the more lenient.
    """
    near = neighbours(problem, design, values)
    if not len(near.at):
        return design
    quick = Ranking(problem, design, True, bounds)
    full = Ranking(problem.reported(), design, False, bounds)
    rounded_design, keys = _search_best_design(near, quick, full)
    if keys[0] > 0.0:
        quick.learn(full, design)
        retried, retried_keys = _search_best_design(near, quick, full)
        rounded_design = retried if tuple(retried_keys.tolist()) < tuple(keys.tolist()) else rounded_design
    return rounded_design


def _search_best_design(near: Neighbours, quick: Ranking, full: Ranking) -> tuple[Array, Array]:
    """The best design of the search, and its key."""
    masks = (
        _all_combinations(near) if len(near.at) <= MAX_EXHAUSTIVE_VARIABLES else choices_by_moves(near, quick, VERIFIED)
    )
    best_design, keys = _verify_best(near, masks, quick, full)
    if keys[0] > 0.0 and MAX_EXHAUSTIVE_VARIABLES < len(near.at) <= HARD:
        best_design, keys = _verify_best(near, _all_combinations(near), quick, full)
    return best_design, keys


def _all_combinations(near: Neighbours) -> RoundingMask:
    """Every combination (2^k', k) of the variables that have two neighbours."""
    open_ = np.flatnonzero(near.below < near.above)
    masks = np.zeros((2 ** len(open_), len(near.at)), dtype=bool)
    masks[:, open_] = list(product((False, True), repeat=len(open_)))
    return masks


def _verify_best(near: Neighbours, masks: RoundingMask, quick: Ranking, full: Ranking) -> tuple[Array, Array]:
    """The best design by the full model among the best by the quick model, and its key."""
    designs = np.unique(near.designs(masks), axis=0)
    shortlist = designs[best(quick.keys(designs))[:VERIFIED]]
    keys = full.keys(shortlist)
    at = best(keys)[0]
    return shortlist[at], keys[at]
