"""Which point of a front to build: its settings, the named rules, and how sure their choice is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...problems.settings import Bound
from ...registry import PLUGIN_FAULTS, Kinds, origin
from ...section import Array

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["ChoiceSettings"]

# What `[choice]` and `[rounding]` say.


PREFERRED, IT_GRADES, R20 = "preferred", "grades", "R20"
RULES = {rule: rule for rule in (PREFERRED, IT_GRADES, R20)} | {"IT": IT_GRADES}
"""Rounding by name: numbers that people write, ISO 286 grades at the nominal size (once "IT"), preferred numbers of
ISO 3."""
ALL = "steps"
"""The key of `[rounding]` for all tolerances that have no key of their own."""

Step = str | float | tuple[float, ...]
"""One of `RULES`, a step whose multiples can be ordered, or the list of what can be."""


@dataclass(frozen=True, slots=True)
class ChoiceSettings:
    """How a point is chosen; `weights` of objectives (equal where empty) need not add up to one.

    `limits` are what the cheapest point must keep in addition to those of the run, `budget` is the
    most that the best point may cost, and `steps` says by variable, or of `ALL`, what can be ordered.
    `roughness_share` is the most that Ra may be of the width of a zone, None where it is not
    stated.
    """

    weights: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, Bound] = field(default_factory=dict)
    budget: float | None = None
    steps: Mapping[str, Step] = field(default_factory=dict)
    roughness_share: float | None = None


# A rule by which a point of a front is chosen, and the front that it takes: base of plugins.


COST = "cost"


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """A front in the form that the rules take.

    `objectives` (n, m) are called `names`, `cost` (n,) what each point costs, `weights` (m,)
    add up to one, `kept` (n,) says which points keep the limits of the choice, None without any.
    """

    objectives: Array
    names: tuple[str, ...]
    cost: Array | None
    weights: Array
    kept: NDArray[np.bool_] | None = None
    budget: float | None = None


class ChoiceRule(ABC):
    """A rule of choice: it names a row of a front of two or more objectives."""

    meaning: ClassVar[str]
    """What it chooses, in a few words, for `choices.csv` and the page."""

    @abstractmethod
    def row(self, points: Points) -> int | None:
        """The row that it chooses, None where it does not apply or chooses none."""

    def limits(self, settings: ChoiceSettings) -> Mapping[str, Bound]:
        """What it asks of the point that it chooses, and so of the rounded point as well."""
        return {}


# The registered rules of choice, and what they choose from a front.


RULE_KINDS: Kinds[ChoiceRule] = Kinds("rules")
"""The rules by name: entry points of `tolevo.rules`."""
ONLY = "only"
"""Name of the choice where there is but one objective."""
FIRST = (
    "knee",
    "knee_plane",
    "knee_bend",
    "knee_tradeoff",
    "nash",
    "pseudo_weights",
    "topsis",
    "cheapest_within_limits",
    "best_for_budget",
)
"""The order of the rules of tolevo; those of plugins follow in the order of the alphabet."""


def meaning_of(name: str) -> str:
    """What a rule chooses, in a few words."""
    return "the one point of the front" if name == ONLY else RULE_KINDS[name].meaning


def choose_rows(points: Points, notes: list[str] | None = None) -> dict[str, int]:
    """The row that each rule chooses; rules that do not apply, or choose none, are left out.

    A rule that fails is left out as well, with its name and its reason in `notes`.
    """
    values = points.objectives
    if not len(values):
        return {}
    if values.shape[1] == 1:
        return {ONLY: int(np.argmin(values[:, 0]))}
    rows: dict[str, int] = {}
    for name in _names():
        try:
            at = RULE_KINDS[name]().row(points)
            if at is not None and not 0 <= (at := int(at)) < len(values):
                raise ValueError(f"chose row {at} of a front of {len(values)} points")
        except (InputError, *PLUGIN_FAULTS) as error:
            if notes is not None:
                notes.append(f'the choice rule "{name}" of {origin("rules", name)} is left out: {_reason(error)}')
            continue
        if at is not None:
            rows[name] = at
    return rows


def _names() -> Iterator[str]:
    """The rules of tolevo in their order, then those of plugins."""
    yield from (name for name in FIRST if name in RULE_KINDS)
    yield from (name for name in RULE_KINDS if name not in FIRST)


def _reason(error: Exception | SystemExit) -> str:
    if isinstance(error, InputError):
        return "; ".join(fault.message for fault in error.faults)
    return f"{type(error).__name__}: {error}"


# Knees of a front by several definitions; objectives (n, m) are scaled to [0, 1] before.


ARM = 0.1
"""Length of the arms of a bend, as a fraction of the length of the front."""
COMPARED = 500
"""Points that every point's trade-off is compared with at most, evenly spaced."""


def scale_objectives(values: Array) -> Array:
    """Objectives (n, m) with the least of the front at 0 and its largest at 1."""
    low, span = values.min(axis=0), np.ptp(values, axis=0)
    return np.asarray((values - low) / np.where(span > 0.0, span, 1.0))


def farthest_from_chord(values: Array) -> int | None:
    """The point farthest below the chord (with more objectives: the plane) through the ends.

    Reference: Das (1999), On characterizing the "knee" of the Pareto curve, Structural
    Optimization 18, 107-115.
    """
    return int(np.argmin(scale_objectives(values).sum(axis=1))) if len(values) >= 3 else None


def sharpest_bend(values: Array) -> int | None:
    """The point of two objectives at which the front turns by the largest angle.

    Its arms reach over `ARM` of the length of the front to either side, so that neighbours that lie
    close together make no bend.

    Reference: Branke, Deb, Dierolf & Osswald (2004), Finding knees in multi-objective optimization,
    PPSN VIII, 722-731, with arms in place of neighbours.
    """
    if values.shape[1] != 2 or len(values) < 3:
        return None
    order = np.lexsort(values.T[::-1])
    line = scale_objectives(values)[order]
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    arm = ARM * at[-1]
    inner = np.flatnonzero((at >= arm) & (at <= at[-1] - arm))
    if not len(inner):
        return None
    ends = (np.stack([np.interp(at[inner] + step, at, column) for column in line.T], axis=1) for step in (-arm, arm))
    before, after = (end - line[inner] for end in ends)
    turn = np.pi - np.abs(np.arctan2(_cross(before, after), np.sum(before * after, axis=1)))
    bent_down = _cross(before, after) < 0.0
    if not np.any(bent_down):
        return None
    return int(order[inner[np.argmax(np.where(bent_down, turn, -1.0))]])


def _cross(first: Array, second: Array) -> Array:
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def best_trade_off(values: Array) -> int | None:
    """The point whose least rate of loss over gain, of a move to any other point, is largest.

    Reference: Rachmawati & Srinivasan (2009), Multiobjective evolutionary algorithm with
    controllable focus on the knees of the Pareto front, IEEE TEVC 13(4), 810-824.
    """
    if len(values) < 3:
        return None
    points = scale_objectives(values)
    sampled = points[np.unique(np.linspace(0, len(points) - 1, COMPARED).astype(int))]
    loss, gain = np.zeros((len(points), len(sampled))), np.zeros((len(points), len(sampled)))
    for a, b in zip(points.T, sampled.T, strict=True):  # one objective at a time: memory
        moved = b[None, :] - a[:, None]
        loss += np.maximum(moved, 0.0)
        gain += np.maximum(-moved, 0.0)
    rate = np.divide(loss, gain, out=np.full_like(loss, np.inf), where=gain > 0.0)
    return int(np.argmax(rate.min(axis=1)))


def largest_product(values: Array) -> int | None:
    """Nash's bargaining solution: the largest product of the gains over the worst of the front.

    Reference: Nash (1950), The bargaining problem, Econometrica 18(2), 155-162.
    """
    return int(np.argmax(np.prod(1.0 - scale_objectives(values), axis=1))) if len(values) >= 3 else None


# Choices by the weights of the objectives (n, m), all of them minimised.


def choose_by_weights(values: Array, weights: Array) -> int | None:
    """The point whose pseudo-weights are nearest to `weights` (m,), which add up to one.

    Reference: Deb (2001), Multi-objective optimization using evolutionary algorithms, section
    8.7.2. None where an objective does not vary: a pseudo-weight is not defined then.
    """
    span = np.ptp(values, axis=0)
    if not np.all(span > 0.0):
        return None
    # pymoo's own class imports a name of scipy that is deprecated
    gained = (values.max(axis=0) - values) / span
    pseudo_weights = gained / gained.sum(axis=1, keepdims=True)
    return int(np.argmin(np.abs(pseudo_weights - weights).sum(axis=1)))


def closeness(values: Array, weights: Array) -> Array:
    """TOPSIS: closeness (n,) to the ideal, between 0 and 1.

    Reference: Hwang & Yoon (1981), Multiple attribute decision making, with their vector
    normalisation. A criterion that is better when larger enters with its sign reversed.
    """
    lengths = np.linalg.norm(values, axis=0)
    rated = weights * values / np.where(lengths > 0.0, lengths, 1.0)
    to_best = np.linalg.norm(rated - rated.min(axis=0), axis=1)
    to_worst = np.linalg.norm(rated - rated.max(axis=0), axis=1)
    whole = to_best + to_worst
    return np.asarray(np.divide(to_worst, whole, out=np.ones_like(whole), where=whole > 0.0))


def choose_by_topsis(values: Array, weights: Array) -> int | None:
    """The point closest to the ideal by TOPSIS."""
    return int(np.argmax(closeness(values, weights)))


# The rules of choice that come with tolevo.


class Knee(ChoiceRule):
    """Largest distance to the chord between the ends of a front of two objectives (Das 1999)."""

    meaning = "largest distance to the chord between the ends"

    def row(self, points: Points) -> int | None:
        return farthest_from_chord(points.objectives) if len(points.names) == 2 else None


class KneePlane(ChoiceRule):
    """Largest distance to the plane through the ends of a front of more objectives (Das 1999)."""

    meaning = "largest distance to the plane through the ends"

    def row(self, points: Points) -> int | None:
        return farthest_from_chord(points.objectives) if len(points.names) > 2 else None


class KneeBend(ChoiceRule):
    """Largest bend, with arms of a tenth of the length of the front (after Branke et al. 2004)."""

    meaning = "largest bend, with arms of a tenth of the front"

    def row(self, points: Points) -> int | None:
        return sharpest_bend(points.objectives)


class KneeTradeoff(ChoiceRule):
    """Every move away loses most for what it gains (Rachmawati & Srinivasan 2009)."""

    meaning = "every move away from it loses most relative to what it gains"

    def row(self, points: Points) -> int | None:
        return best_trade_off(points.objectives)


class Nash(ChoiceRule):
    """Largest product of the gains over the worst of the front (Nash 1950)."""

    meaning = "largest product of the gains over the worst of the front"

    def row(self, points: Points) -> int | None:
        return largest_product(points.objectives)


class PseudoWeights(ChoiceRule):
    """Pseudo-weights nearest to the weights (Deb 2001)."""

    meaning = "pseudo-weights nearest to the weights"

    def row(self, points: Points) -> int | None:
        return choose_by_weights(points.objectives, points.weights)


class Topsis(ChoiceRule):
    """Closest to the ideal by TOPSIS with the weights (Hwang & Yoon 1981)."""

    meaning = "closest to the ideal by TOPSIS with the weights"

    def row(self, points: Points) -> int | None:
        return choose_by_topsis(points.objectives, points.weights)


class CheapestWithinLimits(ChoiceRule):
    """Cheapest point that keeps the limits of `[choice.limits]`."""

    meaning = "cheapest point that keeps [choice] limits"

    def row(self, points: Points) -> int | None:
        if points.kept is None or points.cost is None or not np.any(points.kept):
            return None
        return int(np.argmin(np.where(points.kept, points.cost, np.inf)))

    def limits(self, settings: ChoiceSettings) -> Mapping[str, Bound]:
        return settings.limits


class BestForBudget(ChoiceRule):
    """Best point that costs no more than the budget: least weighted sum of the other objectives."""

    meaning = "best point that costs no more than [choice] budget"

    def row(self, points: Points) -> int | None:
        if points.budget is None or points.cost is None:
            return None
        within = points.cost <= points.budget
        others = [at for at, name in enumerate(points.names) if name != COST]
        if not np.any(within) or not others:
            return None
        weights = np.maximum(points.weights[others], 1e-12)
        sums = scale_objectives(points.objectives)[:, others] @ weights
        return int(np.argmin(np.where(within, sums, np.inf)))

    def limits(self, settings: ChoiceSettings) -> Mapping[str, Bound]:
        return {} if settings.budget is None else {COST: Bound(high=settings.budget)}


# How sure a choice is: the same rules with each cost curve 20 % lower and higher.


FACTORS = (0.8, 1.2)


def sensitivity(points: Points, costs: Mapping[str, Array]) -> pd.DataFrame:
    """What each rule chooses where one cost curve (n,) is multiplied by one of `FACTORS`.

    A row per rule, curve and factor: `point` is the row of the front chosen then, `same` whether
    it is the choice of the run, the objectives are those of that point, and `cost` and `cost_kept`
    what it and the choice of the run cost with the changed curve. Points are those of the front:
    nothing is searched again. Empty where the cost is no objective.
    """
    import pandas as pd

    if COST not in points.names or points.cost is None:
        return pd.DataFrame()
    usual, rows = choose_rows(points), []
    for curve, part in costs.items():
        for factor in FACTORS:
            cost = points.cost + (factor - 1.0) * part
            choices = choose_rows(_replace_cost(points, cost))
            rows += [
                {
                    "choice": rule,
                    "curve": curve,
                    "factor": factor,
                    "point": at,
                    "same": at == usual.get(rule),
                    "cost": cost[at],
                    "cost_kept": cost[usual[rule]] if rule in usual else np.nan,
                }
                | _objectives_except_cost(points, at)
                for rule, at in choices.items()
            ]
    table = pd.DataFrame(rows)
    return table.sort_values("choice", kind="stable", ignore_index=True) if rows else table


def _replace_cost(points: Points, cost: Array) -> Points:
    values = points.objectives.copy()
    values[:, points.names.index(COST)] = cost
    return replace(points, objectives=values, cost=cost)


def _objectives_except_cost(points: Points, at: int) -> dict[str, float]:
    pairs = zip(points.names, points.objectives[at].tolist(), strict=True)
    return {name: value for name, value in pairs if name != COST}
