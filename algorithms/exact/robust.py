"""The allocation of least worst regret, where cost curves are known within factors.

The true cost of a curve is c C(t) with l <= c <= u, each curve by itself. The regret of an allocation x is what
it costs more than the best one for the true curves, R(x) = max over c and y of sum c (C(x) - C(y)). For a given x
that is separable in y: where y is cheaper c = u, where it is dearer c = l, so that each way of a feature becomes
two with curves of their own, and branch and bound proves R(x). The least R is a game of allocations against
scenarios c (double oracle: McMahan, Gordon & Blum 2003). For weights w of scenarios s,

    min over x of sum w_s (c_s C(x) - c_s C(y_s))

is a lower bound of every worst regret, whatever the allocations y_s are that keep the limits.

Reference: Kouvelis & Yu (1997), Robust discrete optimization and its applications, Kluwer.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from ...models.cost_reading import add_constant_cost, times
from ...models.roots import bracketed_roots
from ...problems.forms import Feature, Form, Way
from ...problems.limits import loosened
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array
from .bounds import LIMIT_WIDENING, row_limits
from .choices import has_only_point_ways, least_cost, search_vector
from .combination import Combination
from .combination import within as inside_limits
from .solver import closed_form

MOVES = 40
"""Allocations and scenarios that are added at most."""
APART = 16
"""Choices of ways whose games are played apart at most."""
CLOSED = 5e-3
"""Fraction of the worst regret that the proof may leave open."""
Allocation = tuple[tuple[int, ...], Array]
"""Ways and tolerances (features,)."""
Scenario = dict[tuple[int, int], float]
"""Factors of the curves that are not as stated, by feature and curve."""


@dataclass(frozen=True, slots=True)
class RobustAllocation:
    """An allocation by its search vector x (1, variables), with proven bounds of worst regrets.

    `regret` is at least that of x, `nominal` that of the least cost by the curves as stated (x (1,
    variables) `nominal_x`); no allocation has a worst regret below `least`.
    """

    x: Array
    regret: float
    least: float
    nominal_x: Array
    nominal: float


def robust_allocation(problem: ToleranceProblem) -> RobustAllocation | str:
    """The allocation of least worst regret within the limits, or why there is none."""
    form = closed_form(problem)
    if form is None:
        return "the limits have no convex form together, by which regrets are proven"
    if form.also or form.stands:
        return "its form is one of several, or stands for other outputs"
    if any(way.curve.cost(np.array([way.high]))[0] < 0.0 for feature in form.features for way in feature.ways):
        return "a cost is below 0, of which a factor means nothing"
    return _Game(problem, form).play()


@dataclass(eq=False)
class _Game:
    """Allocations against scenarios; `best` is what is known to be cheap in each scenario."""

    problem: ToleranceProblem
    form: Form
    limits: Array = field(init=False)
    allocations: list[Allocation] = field(default_factory=list)
    scenarios: list[Scenario] = field(default_factory=list)
    best: list[float] = field(default_factory=list)
    most: float = np.inf
    chosen: Allocation = field(default=((), np.empty(0)))

    def __post_init__(self) -> None:
        self.limits = row_limits(self.problem, self.form)

    # ------------------------------------------------ curves and their factors

    def curve(self, at: int, way: int) -> int:
        """The number of the curve of a way: processes have curves of their own, grades and pieces share one."""
        feature = self.form.features[at]
        return int(feature.ways[way].choice) if feature.variable and feature.choice else 0

    def factor(self, at: int, way: int) -> float:
        """The factor within which the curve of a way is known."""
        robust, feature = self.problem.settings.robust, self.form.features[at]
        known = None if robust is None else robust.of(feature.variable or feature.choice, self.curve(at, way))
        return 1.0 if known is None else known

    def weighted(self, weights: Array) -> Form:
        """The form with every curve times its mean factor over the scenarios, by weights (s,)."""

        def mean(at: int, way: int) -> float:
            key = at, self.curve(at, way)
            return float(sum(w * s.get(key, 1.0) for w, s in zip(weights, self.scenarios, strict=True)))

        def ways(at: int, feature: Feature) -> list[Way]:
            return [replace(way, curve=times(way.curve, mean(at, number))) for number, way in enumerate(feature.ways)]

        return self.form.with_ways(ways)

    def costs(self, allocation: Allocation) -> Array:
        """Costs (s,) of an allocation in every scenario."""
        ways, t = allocation
        each = Combination(self.form, ways).costs(t[None, :])[:, 0].tolist()
        keys = [(at, self.curve(at, way)) for at, way in enumerate(ways)]
        return np.array([sum(c * s.get(key, 1.0) for c, key in zip(each, keys, strict=True)) for s in self.scenarios])

    # ------------------------------------------------ best answers

    def answer(self, form: Form, exact: bool = True) -> tuple[float, Allocation | None]:
        """The proven least cost of a form, and the allocation of least cost that keeps the limits."""
        optimum = least_cost(form, loosened(self.limits, LIMIT_WIDENING)[None, :])
        inside = optimum if has_only_point_ways(form) or not exact else inside_limits(form, optimum, self.limits)
        if not np.isfinite(inside.cost[0]):
            return float(optimum.bound[0]), None
        return float(optimum.bound[0]), (tuple(inside.chosen[0].tolist()), inside.t[0])

    def worst(self, allocation: Allocation) -> tuple[float, Scenario]:
        """A proven upper bound of the worst regret of an allocation, and the scenario of it."""
        ways, t = allocation
        split: list[list[tuple[Way, Scenario]]] = []
        given = 0.0
        for at, (feature, chosen) in enumerate(zip(self.form.features, ways, strict=True)):
            own = float(feature.ways[chosen].curve.cost(t[at : at + 1])[0])
            high, key = self.factor(at, chosen), (at, self.curve(at, chosen))
            given += feature.count * high * own
            split.append([])
            for number, way in enumerate(feature.ways):
                other = at, self.curve(at, number)
                if other == key:
                    split[at] += [(part, {key: factor}) for part, factor in _cheaper_and_dearer(way, own, high)]
                else:
                    low = 1.0 / self.factor(at, number)
                    split[at].append((replace(way, curve=times(way.curve, low)), {key: high, other: low}))
        form = self.form.with_ways(lambda at, _: (way for way, _ in split[at]))
        bound, best = self.answer(replace(form, base=0.0), exact=False)
        scenario: Scenario = {}
        for at, chosen in enumerate(ways):
            alone = {(at, self.curve(at, chosen)): self.factor(at, chosen)}
            scenario |= alone if best is None else split[at][best[0][at]][1]
        return max(given - bound, 0.0) if np.isfinite(bound) else 0.0, scenario

    # ------------------------------------------------ the game

    def play(self) -> RobustAllocation | str:
        """The game of each choice of ways, or of all at once where there are many."""
        _, nominal = self.answer(self.form)
        if nominal is None or not self.keeps(nominal):
            return "the least cost by the curves as stated is not known within the limits"
        nominal_regret, scenario = self.worst(nominal)
        self.most, self.chosen = nominal_regret, nominal
        self.allocations.append(nominal)
        self.add(scenario)
        choices: list[tuple[int, ...] | None] = [None]
        if 1 < self.form.combinations <= APART:
            choices = sorted(self.form.choices(), key=lambda c: c != nominal[0])
        least = min(self._least(choice) for choice in choices)
        x, nominal_x = (search_vector(self.problem, self.form, *one) for one in (self.chosen, nominal))
        return RobustAllocation(x, self.most, min(least, self.most), nominal_x, nominal_regret)

    def _least(self, choice: tuple[int, ...] | None) -> float:
        """A lower bound of the worst regret of every allocation of one choice of ways, or of all of them.

        Allocations and scenarios answer each other until the proof is nearly closed, or the choice is none of the best.
        """
        bound, first = self.answer(made_in(self.form, choice))
        if first is None:
            return bound if bound == np.inf else 0.0
        least, known = 0.0, [(first[0] if choice is None else choice, first[1])]
        worst: list[Scenario] = []
        for move in range(MOVES):
            results = [(*self.worst(one), one) for one in known if self.keeps(one)]
            for regret, scenario, one in results:
                self.allocations.append(one)
                worst.append(scenario)
                if regret < self.most:
                    self.most, self.chosen = regret, one
            new = sum(self.add(scenario) for scenario in worst) > 0
            rows = [one for one in self.allocations if choice in (None, one[0])]
            if not rows:
                return least
            weights, shares, value = self.equilibrium(rows)
            settled = move > 0 and not new and value - least <= CLOSED * self.most  # no better answers are expected
            if self.most - least <= CLOSED * self.most or settled:
                break
            bound, answer = self.answer(made_in(self.weighted(weights), choice))
            least = max(least, bound - self.form.base - float(weights @ np.array(self.best)))
            worst, known = [], [mixed(rows, shares)]
            if answer is not None:
                known.append((answer[0] if choice is None else choice, answer[1]))
        return least

    def keeps(self, allocation: Allocation) -> bool:
        """Whether an allocation keeps every limit by the full model."""
        return not np.any(self.problem.tested(search_vector(self.problem, self.form, *allocation))[1] > 0.0)

    def add(self, scenario: Scenario) -> bool:
        """Add a scenario with the least cost that is known in it; whether it is new."""
        if scenario in self.scenarios:
            return False
        self.scenarios.append(scenario)
        only = np.array([float(at == len(self.scenarios) - 1) for at in range(len(self.scenarios))])
        _, answer = self.answer(self.weighted(only))
        if answer is not None and self.keeps(answer):
            self.allocations.append(answer)
        self.best = np.min([self.costs(one) for one in self.allocations], axis=0).tolist()
        return True

    def equilibrium(self, rows: list[Allocation]) -> tuple[Array, Array, float]:
        """Weights (s,) of scenarios, (a,) of allocations, and the regret of the game between those known."""
        regrets = np.array([self.costs(one) for one in rows]) - np.array(self.best)
        count, columns = regrets.shape
        unit = float(np.max(np.abs(regrets))) or 1.0
        found = scipy.optimize.linprog(
            [*np.zeros(columns), -1.0],
            A_ub=np.hstack([-regrets / unit, np.ones((count, 1))]),
            b_ub=np.zeros(count),
            A_eq=[[*np.ones(columns), 0.0]],
            b_eq=[1.0],
            bounds=[(0.0, None)] * columns + [(None, None)],
        )
        assert found.x is not None and found.fun is not None
        weights = np.maximum(found.x[:-1], 0.0)
        return weights / weights.sum(), np.maximum(-found.ineqlin.marginals, 0.0), -float(found.fun) * unit


def made_in(form: Form, choice: tuple[int, ...] | None) -> Form:
    """The form with one choice of ways alone, all of them where there is none."""
    return form if choice is None else form.made_in(choice)


def mixed(rows: list[Allocation], shares: Array) -> Allocation:
    """The mean of the allocations with the heaviest ways, by shares (a,): it keeps convex limits."""
    weight: dict[tuple[int, ...], float] = {}
    for (ways, _), share in zip(rows, shares.tolist(), strict=True):
        weight[ways] = weight.get(ways, 0.0) + share
    heaviest = max(weight, key=lambda ways: weight[ways])
    known = [(t, share) for (ways, t), share in zip(rows, shares.tolist(), strict=True) if ways == heaviest]
    return heaviest, np.asarray(sum(share * t for t, share in known) / weight[heaviest])


def _cheaper_and_dearer(way: Way, own: float, factor: float) -> list[tuple[Way, float]]:
    """A way of the curve that an allocation has at a cost `own`, cut where it costs as much, each with the factor of
    the curve that is worst there.

    What the other allocation saves is worth `factor` times as much where it is cheaper, and 1/`factor`
    times as much is lost where it is dearer; both are relative to `factor` times `own`.
    """
    cheaper = times(way.curve, factor)
    dearer = add_constant_cost(times(way.curve, 1.0 / factor), (factor - 1.0 / factor) * own)
    ends = way.curve.cost(np.array([way.low, way.high]))
    if ends[0] <= own:
        return [(replace(way, curve=cheaper), factor)]
    if ends[1] >= own:
        return [(replace(way, curve=dearer), 1.0 / factor)]
    root = bracketed_roots(lambda x: own - way.curve.cost(np.exp(x)), (np.log(way.low), np.log(way.high))).x
    at = min(max(float(np.exp(root)), way.low), way.high)
    return [(replace(way, curve=dearer, high=at), 1.0 / factor), (replace(way, curve=cheaper, low=at), factor)]
