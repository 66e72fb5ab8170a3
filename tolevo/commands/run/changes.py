"""Designs of values that can be ordered: single steps tried by the full model, and rounding."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...problems.limits import Limit, descending, limits_of
from ...problems.settings import Bound
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array, Kind, Variable
from ...units import drawing_number, plain_number, split_unit
from .choice import COST
from .tolerances import notation

if TYPE_CHECKING:
    import pandas as pd

# The values that can be ordered next to those of a design.


Rungs = NDArray[np.int64]
ROOM_TOLERANCE = 1e-9
"""Relative difference that counts as none."""


REACH, REACH_SAMPLED = 8, 4
"""Orderable values on either side of a value that are tried at most; where each takes a sample of units."""
SINGLES = 240
"""Changes of one variable that are evaluated at once at most, where every variable has two."""


@dataclass(frozen=True, slots=True, eq=False)
class Ladders:
    """The orderable values near those of a `design` (all variables,).

    `values` (k, width) are those of the variables of the `columns` (k,), ascending, of which the
    first `counts` (k,) are meant. A combination is one rung of each ladder, shape (k,).
    """

    design: Array
    columns: Rungs
    values: Array
    counts: Rungs

    def designs(self, rungs: Rungs) -> Array:
        """Full designs (c, all variables) of combinations (c, k)."""
        full = np.repeat(self.design[None], len(rungs), axis=0)
        full[:, self.columns] = self.values[np.arange(len(self.columns)), rungs]
        return full


def ladders(problem: ToleranceProblem, design: Array, values: Mapping[str, Array]) -> Ladders:
    """The orderable `values`, by variable, nearest to those of `design` in the room that it has.

    A variable without an orderable value in its room keeps its own.
    """
    most = REACH_SAMPLED if problem.declaration.sampled else REACH
    reach = int(np.clip(SINGLES // (2 * max(len(values), 1)), 1, most))
    near: dict[int, Array] = {}
    for name, orderable in values.items():
        low, high = problem.room(name, design)
        edge = ROOM_TOLERANCE * max(abs(low), abs(high))
        within = np.unique(np.clip(orderable[(orderable >= low - edge) & (orderable <= high + edge)], low, high))
        column = problem.names.index(name)
        below, upto = (int(np.searchsorted(within, design[column], side)) for side in ("left", "right"))
        if len(within):
            near[column] = within[max(below - reach, 0) : upto + reach]
    counts = np.array([len(rungs) for rungs in near.values()], dtype=np.int64)
    padded = [np.pad(rungs, (0, int(counts.max()) - len(rungs)), mode="edge") for rungs in near.values()]
    return Ladders(design, np.array(list(near), dtype=np.int64), np.array(padded), counts)


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


def best(keys: Array) -> Rungs:
    """Rows from the best to the worst; of rows that are equal but for their last digits, the first."""
    size = np.max(np.abs(keys), axis=0, initial=1e-300, where=np.isfinite(keys))
    return np.lexsort(np.round(keys / size, 11).T[::-1])


# What changing one tolerance alone does to a chosen allocation: tried by the full model.


VALUE_TOLERANCE = 1e-9
"""Relative difference below which two values count as equal."""
PROPAGATED = 1e-6
"""Fraction of a limit by which a value may differ between the lattices of two propagations."""
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
    import pandas as pd

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
    order = descending(-problem.cost_of(np.stack([step[3] for step in steps])))[:most]
    return [steps[at] for at in np.sort(order)]


def _limited_outputs(problem: ToleranceProblem) -> list[str]:
    return [limit.name for limit in problem.limits if limit.count]


def _evaluate_designs(problem: ToleranceProblem, designs: Array) -> dict[str, Array]:
    """The outputs that are asked for of full designs, a batch at a time."""
    parts = [problem.needed_outputs(designs[at : at + BATCH]) for at in range(0, len(designs), BATCH)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _broken_limits(problem: ToleranceProblem, design: Array, outputs: Mapping[str, Array]) -> dict[str, str]:
    """The limits that a full design (1, all) breaks, and by which values; those that it breaks by what a
    propagation differs between designs only where it breaks no other.
    """
    broken, by_little = {}, set[str]()
    for limit in problem.limits:
        value = problem.values(design, outputs, limit.name)
        if not limit.kept(value)[0]:
            broken[limit.name] = f"{words(limit.name)} {value_against_limit(float(value[0]), limit)}"
            if max(float(part[0]) for part in limit.violations(value)) <= PROPAGATED:
                by_little.add(limit.name)
    return {name: text for name, text in broken.items() if name not in by_little} or broken


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
                if "{}" in (zone := problem.drawn(variable.name).get("drawn_as", "")):  # of a feature
                    to = notation(variable, None, 0.0, value, drawn_as=zone)
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
    if problem.priced != COST:
        return ""  # what a step saves of the cost is no reason where another column is minimised
    currency = problem.settings.money.currency
    others = [name for name in problem.objectives if name != COST]
    size = max(abs(float(design_values.get(COST, 0.0))), 1e-300)
    saving = tried[tried["cost_change"] < -NOTABLE_SAVING * size]
    if saving.empty:
        much = "a millionth of the cost" if (tried["cost_change"] < 0.0).any() else "anything"
        return f"No step of one tolerance by itself to the next value that can be ordered saves {much}."
    kept = saving[saving["breaks"] == ""]
    if kept.empty:
        untried = int(tried["untried"].iloc[0])
        which = f"each of the {len(saving)} steps that save most" if untried else "every step"
        return f"No tolerance can be loosened by itself: {which} breaks a limit ({_list_steps(saving)})."
    worse = [kept[f"change_{name}"].to_numpy(dtype=float) / (abs(design_values[name]) or 1.0) for name in others]
    loss = np.max([np.zeros(len(kept)), *worse], axis=0)
    rate = -kept["cost_change"].to_numpy(dtype=float) / size / np.maximum(loss, VALUE_TOLERANCE)
    best = kept.iloc[int(descending(rate)[0])].to_dict()
    units = {o.name: o.unit for o in problem.outputs}
    text = f"Loosen first: {step_words(best)}: saves {_money(-float(best['cost_change']), currency)}"
    for name in others:
        change, unit = float(best[f"change_{name}"]), units.get(name, "")
        direction = "rises" if change > 0.0 else "falls"
        if abs(change) > NOTABLE_CHANGE * abs(design_values[name]):
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
    ordered = rows.iloc[descending(-rows["cost_change"].to_numpy(dtype=float))].to_dict("records")
    named = [f"{step_words(row)}: {row['broken']}" for row in ordered[:NAMED]]
    more = len(ordered) - len(named)
    return "; ".join([*named, f"{more} more break{'s' if more == 1 else ''} a limit"] if more else named)


def _money(amount: float, currency: str) -> str:
    return f"{plain_number(amount, 3)} {currency}".rstrip()


# A design rounded to what can be ordered: all variables together, checked by the model.


MAX_EXHAUSTIVE, MAX_EXHAUSTIVE_SAMPLED = 4096, 256
"""Combinations up to which every one is evaluated; where each takes a sample of units."""
BEAM = 4096
"""Combinations of the least reduced costs that are held."""
ROUNDS = 8
"""Rounds of pricing at most."""
PRICED = 1.0, 1.05, 1.1, 1.2, 1.5, 2.0, 4.0
"""Factors of the prices of limits, until a combination is predicted to keep them: a setting of few values
may leave the others less room than a mixture of its values does.
"""
TRIED, TRIED_SAMPLED = 128, 24
"""Combinations that are evaluated of each prediction; where each takes a sample of units."""
LEARNED = 4
"""Times that the search is corrected at most, while all candidates break a limit."""
VERIFIED = 24
"""Best candidates that are tested by the full model."""
NEGLIGIBLE = 0.01
"""Part of the cost that rounding may add without a reason."""
NOTABLE_SAVING, NOTABLE_CHANGE = 1e-6, 1e-4
"""Fractions of the cost and of another objective below which a change is not told: quantiles of sums are
approximated to the latter.
"""
PENALTY = 1e3
"""Price of breaking a limit, over the largest saving of a change per room that it uses."""


@dataclass(frozen=True, slots=True, eq=False)
class Rounded:
    """A design (all variables,) of values that can be ordered, and its `Ranking.keys`; `tried` are the
    combinations among which it was chosen, `every` whether they are all of those `near`.
    """

    design: Array
    keys: tuple[float, ...] = ()
    tried: int = 1
    every: bool = True
    near: Ladders | None = None


def round_design(
    problem: ToleranceProblem,
    design: Array,
    values: Mapping[str, Array],
    bounds: Mapping[str, Bound] = MappingProxyType({}),
    finer: Mapping[str, Array] = MappingProxyType({}),
) -> Rounded:
    """The design (all variables,) with every value at one that can be ordered.

    The cheapest combination of the nearest values that keeps all limits (those of the problem, and
    the `bounds`) and is no worse in the other objectives; where there is none, the one that breaks
    the limits least, then the least worse. Up to `MAX_EXHAUSTIVE` combinations are all evaluated;
    else they are searched (`search_combinations`). The full model decides between the best
    `VERIFIED`; where all of them break a limit, the search is repeated, corrected by the difference of the
    full model, at the design and then at what was found: on a sample of units the quick one may be the more lenient.
    The `finer` values of some variables are used where the others add more than `NEGLIGIBLE` to the cost.
    """
    near = ladders(problem, design, values)
    if not len(near.columns):
        return Rounded(design)
    quick = Ranking(problem, design, True, bounds)
    full = Ranking(problem.reported(), design, False, bounds)
    rounded = _best_combination(near, quick, full)
    last = design
    for _ in range(LEARNED):
        if rounded.keys[0] <= 0.0:
            break
        quick.learn(full, last)
        again = _best_combination(near, quick, full)
        rounded, last = min(rounded, again, key=lambda one: one.keys), again.design
    cost = float(np.broadcast_to(problem.cost_of(design[None]), 1)[0])
    if finer and (rounded.keys[0] > 0.0 or rounded.keys[-1] > cost + NEGLIGIBLE * abs(cost)):
        finest = round_design(problem, design, {**values, **finer}, bounds)
        rounded = min(rounded, finest, key=lambda one: one.keys)
    return rounded


def rounding_sentence(
    problem: ToleranceProblem,
    rounded: Rounded,
    before: float,
    after: float,
    broken: str,
    others: Mapping[str, tuple[float, float]] = MappingProxyType({}),
) -> str:
    """What rounding a design does to its cost, and why nothing cheaper is chosen where that is above
    `NEGLIGIBLE`; `broken` are the limits that the rounded design breaks, separated by spaces, `others` the
    values of further objectives before and after.
    """
    near, share = rounded.near, (after - before) / (abs(before) or 1.0)
    if near is None:
        return ""
    tried = f"all {rounded.tried}" if rounded.every else f"{rounded.tried} of the"
    tried = f"{tried} combinations of the values next to it were tried"
    if broken:
        named = " and ".join(words(name) for name in broken.split())
        return f"Rounded for the drawing, it breaks {named}: {tried} and none keeps all limits."
    currency = problem.settings.money.currency
    amount = f"{100.0 * abs(share):.2g} % {'more' if share > 0.0 else 'less'}"
    amount = amount if abs(share) > VALUE_TOLERANCE else "as much"
    text = f"Rounded for the drawing, it costs {plain_number(after)} {currency}".rstrip() + f" ({amount})"
    for name, (was, now) in others.items():
        if abs(now - was) > NOTABLE_CHANGE * abs(was):
            unit = next((output.unit for output in problem.outputs if output.name == name), "")
            change = f"{'rises' if now > was else 'falls'} from {plain_number(was)} to {plain_number(now)} {unit}"
            text += f"; {words(name)} {change}".rstrip()
    if share <= NEGLIGIBLE:
        return f"{text}."
    values, at = near.design[near.columns], np.arange(len(near.columns))
    upper = np.minimum((near.values < values[:, None]).sum(axis=1), near.counts - 1)
    below, above = near.values[at, np.maximum(upper - 1, 0)], near.values[at, upper]
    widest = int(np.argmax(np.round(above / below, 9))) if np.all(below > 0.0) else 0
    name = problem.names[near.columns[widest]]
    unit = next(v.unit for v in problem.variables if v.name == name)
    ends = f"{drawing_number(below[widest])} and {drawing_number(above[widest])} {unit}".rstrip()
    own = drawing_number(float(f"{values[widest]:.3g}"))
    why = f"{tried}, and none that keeps all limits and is no worse otherwise is cheaper"
    return f"{text}: {why}. The values of {label_of(name)} are the farthest apart: {ends} next to {own}."


def _best_combination(near: Ladders, quick: Ranking, full: Ranking) -> Rounded:
    """The best design by the full model among the best by the quick one."""
    most = MAX_EXHAUSTIVE_SAMPLED if quick.problem.declaration.sampled else MAX_EXHAUSTIVE
    every = float(np.prod(near.counts.astype(float))) <= most
    rungs = _all_combinations(near) if every else search_combinations(near, quick)
    designs = near.designs(rungs)
    shortlist = designs[best(quick.keys(designs))[:VERIFIED]]
    keys = full.keys(shortlist)
    at = best(keys)[0]
    return Rounded(shortlist[at], tuple(keys[at].tolist()), len(rungs), every, near)


def _all_combinations(near: Ladders) -> Rungs:
    """Every combination (n, k)."""
    return np.array(list(product(*(range(count) for count in near.counts.tolist()))), dtype=np.int64)


def search_combinations(near: Ladders, ranking: Ranking) -> Rungs:
    """Combinations (n, k) that a search by prices has evaluated.

    Each round evaluates every change of one variable of a base, first of the design itself, then of
    the best combination so far. Their effects added predict all combinations: those with the least
    reduced cost are listed (`_least_reduced`, at prices times `PRICED`), the best of them evaluated, and
    once more the best by predictions that are corrected by the errors of the first ones.
    """
    most = TRIED_SAMPLED if ranking.problem.declaration.sampled else TRIED
    known, keys = np.empty((0, len(near.columns)), dtype=np.int64), np.empty((0, 3))
    base = near.design
    for _ in range(ROUNDS):
        base_use, base_cost, prices = _prices(near, base, ranking)
        for dearer in PRICED:
            listed, more_use, more_cost = _least_reduced(near, base_use, *prices, dearer)
            if np.any(ranking.ranked(base_use + more_use, more_cost)[:, 0] <= 0.0):
                break
        use, cost = base_use + more_use, base_cost + more_cost
        error = np.zeros(use.shape[1])
        before = keys[best(keys)[:1]].tolist()
        for _ in range(2):
            chosen = best(ranking.ranked(use + error, cost))[:most]
            own_use, own_cost = ranking.use(near.designs(listed[chosen]))
            missed = np.median(own_use - use[chosen], axis=0)
            error = np.where(np.isfinite(missed), missed, 0.0)
            known, first = np.unique(np.vstack([known, listed[chosen]]), axis=0, return_index=True)
            keys = np.vstack([keys, ranking.ranked(own_use, own_cost)])[first]
        found = best(keys)[0]
        if keys[[found]].tolist() == before:
            break
        base = near.designs(known[[found]])[0]
    return known


def _prices(near: Ladders, base: Array, ranking: Ranking) -> tuple[Array, float, tuple[Array, Array]]:
    """`use` (columns,) and cost of a base (all variables,), and what every rung adds to them in the
    place of the value of the base, shapes (k, width, columns) and (k, width); see `Ranking.use`.
    """
    k, width = near.values.shape
    singles = np.repeat(base[None], k * width, axis=0)
    singles[np.arange(k * width), np.repeat(near.columns, width)] = near.values.ravel()
    use, cost = ranking.use(np.vstack([base[None], singles]))
    more_use, more_cost = use[1:] - use[0], cost[1:] - cost[0]
    return use[0], float(cost[0]), (more_use.reshape(k, width, -1), more_cost.reshape(k, width))


def _least_reduced(
    near: Ladders, base_use: Array, use: Array, cost: Array, dearer: float
) -> tuple[Rungs, Array, Array]:
    """At most `BEAM` combinations (n, k) of the least reduced cost, with the use and cost that they add.

    The reduced cost of a rung is its cost plus its use of each limit at the price that the linear
    programme of all rungs has for it: what a combination costs above the least that is possible
    without whole rungs, if it uses up the limits. Limits are `dearer` by a factor.
    """
    valid = (np.arange(cost.shape[1]) < near.counts[:, None]) & np.isfinite(cost) & np.all(np.isfinite(use), axis=2)
    valid |= ~np.any(valid, axis=1, keepdims=True) & (np.arange(cost.shape[1]) == 0)
    use, cost = np.where(valid[:, :, None], use, 0.0), np.where(valid, cost, 0.0)
    reduced = cost + dearer * use @ _limit_prices(base_use, use, cost, valid)
    reduced = np.where(valid, reduced, np.inf)
    reduced -= reduced.min(axis=1, keepdims=True)
    unit = np.max(reduced, initial=0.0, where=valid) or 1.0
    total, steps = np.zeros(1), []
    for own in np.round(reduced / unit, 11):
        sums = (total[:, None] + own).ravel()
        kept = np.argsort(sums, kind="stable")[:BEAM]
        kept = kept[np.isfinite(sums[kept])]
        total = sums[kept]
        steps.append(np.divmod(kept, len(own)))
    rungs, row = np.empty((len(total), len(steps)), dtype=np.int64), np.arange(len(total))
    for place in range(len(steps) - 1, -1, -1):
        rungs[:, place] = steps[place][1][row]
        row = steps[place][0][row]
    places = np.arange(len(steps))
    added = np.zeros((len(rungs), use.shape[2]))
    for column in range(use.shape[2]):
        added[:, column] = use[places, rungs, column].sum(axis=1)
    return rungs, added, cost[places, rungs].sum(axis=1)


def _limit_prices(base_use: Array, use: Array, cost: Array, valid: NDArray[np.bool_]) -> Array:
    """The price (columns,) of each limit: dual values of the linear programme that mixes rungs."""
    from scipy.optimize import linprog

    columns, (variables, rungs) = len(base_use), np.nonzero(valid)
    if not columns or not np.any(cost[valid]):
        return np.ones(columns)
    per_use = np.max(np.abs(cost)) / max(float(np.median(np.abs(use[valid]).max(axis=1))), 1e-12)
    penalty = PENALTY * per_use * np.ones(columns)
    one_each = (variables == np.arange(len(cost))[:, None]).astype(float)
    solved = linprog(
        np.concatenate([cost[variables, rungs], penalty]),
        A_ub=np.hstack([use[variables, rungs].T, -np.eye(columns)]),
        b_ub=-base_use,
        A_eq=np.hstack([one_each, np.zeros((len(cost), columns))]),
        b_eq=np.ones(len(cost)),
        method="highs",
    )
    return -np.asarray(solved.ineqlin.marginals) if solved.success else np.full(columns, per_use)
