"""Evolutionary algorithms on plain arrays: every step works on the whole population at once."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..section import Array, Flags, Integers
from .archive import SavedState, State, lowest_ranks_in_order, without_rounding

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem

__all__ = ["ArrayEngine", "GDE3Engine", "NSGA2Engine", "Space"]

# Survival on whole arrays: feasible before infeasible points, then by rank, then by crowding.


def violation_of(g: Array) -> Array:
    """Total violation (n,) of constraints (n, any number): the sum of the positive ones."""
    if not g.shape[1]:
        return np.zeros(len(g))
    return np.asarray(np.maximum(g, 0.0).sum(axis=1))


def crowding_distances(f: Array, rank: Integers) -> Array:
    """Crowding distance (n,) within each rank (Deb et al. 2002) of points `in_order`, as pymoo's.

    The sum over the objectives of the gap between the two neighbours, divided by the range of the
    rank and by the number of objectives; infinite at the ends of a rank.
    """
    crowding = _crowding_of_two if f.shape[1] == 2 else _crowding
    if not np.count_nonzero(rank):
        return crowding(f)
    distances = np.empty(len(f))
    for level in range(int(rank.max()) + 1):
        rows = (rank == level).nonzero()[0]
        distances[rows] = crowding(f.take(rows, axis=0))
    return distances


def _crowding_of_two(f: Array) -> Array:
    """`crowding_distances` (n,) of points of one rank, in order: of the second objective, reversed.

    Of equal points the first has the gaps before them and the last those after them.
    """
    distances = np.full(len(f), np.inf)
    if len(f) > 2:
        span = f[-1] - f[0]
        gap = (f[2:] - f[:-2]) / span if span[0] > 0.0 else np.zeros((len(f) - 2, 2))
        np.add(gap[:, 0], gap[:, 1], out=distances[1:-1])
        distances *= 0.5
    return distances


def _crowding(f: Array) -> Array:
    """`crowding_distances` (n,) of points that all have the same rank."""
    if len(f) <= 2:  # these are the ends, whatever their values
        return np.full(len(f), np.inf)
    distances, gap = np.zeros(len(f)), np.empty(len(f))
    for values in f.T:
        order = values.argsort(kind="stable")
        value = values.take(order)
        span = value[-1] - value[0]
        if span > 0.0:  # an objective that does not differ carries no information
            np.subtract(value[2:], value[:-2], out=gap[1:-1])
            gap[0] = gap[-1] = np.inf
            gap /= span
            distances[order] += gap
    distances /= f.shape[1]
    return distances


def survivors(f: Array, v: Array, count: int, rng: np.random.Generator) -> tuple[Integers, Integers, Array]:
    """Rows of the best `count` points, their ranks and crowding distances.

    Feasible points by rank, the last rank that fits in part by crowding with ties drawn at random;
    then infeasible points by total violation `v`, with the rank after the last feasible one and a
    crowding of 0.
    """
    kept = v <= 0.0
    if np.count_nonzero(kept) == len(kept):
        return _feasible_survivors(f, count, rng)
    feasible = kept.nonzero()[0]
    if not len(feasible):
        rows = np.argsort(v, kind="stable")[:count]
        return rows, np.zeros(len(rows), dtype=np.int64), np.zeros(len(rows))
    inside, level, crowding = _feasible_survivors(f[feasible], count, rng)
    rows = feasible[inside]
    missing = min(count, len(f)) - len(rows)
    if missing:
        infeasible = np.flatnonzero(v > 0.0)
        more = infeasible[np.argsort(v[infeasible], kind="stable")[:missing]]
        rows = np.concatenate([rows, more])
        level = np.concatenate([level, np.full(missing, level.max() + 1)])
        crowding = np.concatenate([crowding, np.zeros(missing)])
    return rows, level, crowding


def _feasible_survivors(f: Array, count: int, rng: np.random.Generator) -> tuple[Integers, Integers, Array]:
    """`survivors` where all points are feasible."""
    sequence = np.lexsort(f.T[::-1])
    f = f.take(sequence, axis=0)
    rank = lowest_ranks_in_order(f, count)
    last = np.bincount(rank).cumsum().searchsorted(count)  # the rank with which `count` is reached
    inside = (rank <= last).nonzero()[0]
    level = rank.take(inside)
    crowding = crowding_distances(f.take(inside, axis=0), level)
    rows = sequence.take(inside)
    if len(rows) <= count:
        return rows, level, crowding
    drawn = rng.random(len(rows)).argsort()
    order = drawn.take((-crowding).take(drawn).argsort(kind="stable"))
    if last:
        order = order.take(level.take(order).argsort(kind="stable"))
    order = order[:count]
    return rows.take(order), level.take(order), crowding.take(order)


# The common part of all array engines: the search space, ask and tell, the state.


@dataclass(frozen=True, eq=False)
class Space:
    """A box: bounds (variables,), which variables are integers, and the number of objectives."""

    low: Array
    high: Array
    integer: Flags
    objectives: int
    _tiled: Array = field(default_factory=lambda: np.empty((2, 0)), init=False)

    @classmethod
    def of(cls, problem: ToleranceProblem) -> Space:
        """The search space of a problem."""
        return cls(problem.xl, problem.xu, np.array([v.integer for v in problem.free]), problem.n_obj)

    @cached_property
    def ends(self) -> Array:
        """Lower and upper bounds (2, variables)."""
        return np.stack([self.low, self.high])

    def ends_of(self, points: int) -> Array:
        """Lower and upper bounds (2, points * variables) of so many points, one after the other."""
        size = points * len(self.low)
        if self._tiled.shape[1] < size:
            object.__setattr__(self, "_tiled", np.tile(self.ends, points))
        return self._tiled[:, :size]

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Uniformly drawn points (count, variables)."""
        x = self.low + (self.high - self.low) * rng.random((count, len(self.low)))
        return self.repaired(x)

    def repaired(self, x: Array) -> Array:
        """The points, with their integer variables rounded."""
        return np.where(self.integer, np.rint(x), x) if np.count_nonzero(self.integer) else x


class ArrayEngine(ABC):
    """A population search on arrays: alternately `ask` for points and `tell` their values.

    The population is x (n, variables), f (n, objectives) and the total violation v (n,), the sum of
    the positive constraints; it is empty before the first `tell`. The arrays are replaced, never
    changed, so that an earlier state stays valid.
    """

    def __init__(self, space: Space, population: int, rng: np.random.Generator) -> None:
        self.space = space
        self.population = population
        self.rng = rng
        self.x = np.empty((0, len(space.low)))
        self.f = np.empty((0, space.objectives))
        self.v = np.empty(0)
        self.rank = np.empty(0, dtype=np.int64)
        self.crowding = np.empty(0)

    def ask(self) -> Array:
        """Points (n, variables) to be evaluated, within the bounds."""
        if not len(self.x):
            return self.space.draw(self.population, self.rng)
        return self.space.repaired(self._offspring())

    def tell(self, x: Array, f: Array, g: Array) -> Integers:
        """Take in the points that were asked for: objectives f, constraints g (n, any number).

        Returns which rows of the old population and these points, one after the other, are the new
        population.
        """
        return self._select(x, without_rounding(f), violation_of(without_rounding(g)))

    @abstractmethod
    def _offspring(self) -> Array:
        """New points from the population."""

    @abstractmethod
    def _select(self, x: Array, f: Array, v: Array) -> Integers:
        """Replace the population by the best of it and the new points; see `tell`."""

    def _keep_best(self, candidates: Integers | slice, x: Array, f: Array, v: Array) -> Integers:
        """Make the best of some rows of the population and new points the population."""
        x, f = np.concatenate([self.x, x]), np.concatenate([self.f, f])
        v = np.concatenate([self.v, v])
        best, self.rank, self.crowding = survivors(f[candidates], v[candidates], self.population, self.rng)
        rows = best if isinstance(candidates, slice) else candidates[best]
        self.x, self.f, self.v = x.take(rows, axis=0), f.take(rows, axis=0), v.take(rows)
        return rows

    def state(self) -> State:
        """Everything that the next step depends on, as arrays; the generator as JSON."""
        return {
            "x": self.x,
            "f": self.f,
            "v": self.v,
            "rank": self.rank,
            "crowding": self.crowding,
            "rng": np.array(json.dumps(self.rng.bit_generator.state)),
        }

    def restore(self, state: SavedState) -> None:
        """Continue from a `state()`."""
        self.x, self.f, self.v = state["x"], state["f"], state["v"]
        self.rank, self.crowding = state["rank"], state["crowding"]
        self.rng.bit_generator.state = json.loads(str(state["rng"]))


# Genetic operators on whole populations, with the distributions of those of pymoo.


CROSSED = 0.5
"""Probability per variable that simulated binary crossover changes it, as pymoo has it."""
MIN_CROSSOVER_DISTANCE = 1e-14
"""Parents' values nearer than this are not crossed, as pymoo has it."""
OUTWARD = np.array([[-2.0], [2.0]])
"""Twice the senses in which the smaller and the larger of two children lie from their middle."""


def tournament(f: Array, v: Array, rank: Integers, crowding: Array, count: int, rng: np.random.Generator) -> Integers:
    """Winners (count,) of binary tournaments in which every point takes part equally often.

    The smaller violation wins; of two feasible points the dominating point, else the less crowded
    point; of a tie the first, in random order. No point dominates another where all ranks are 0.
    """
    n = len(f)
    turns = np.arange(n)[None, :].repeat(-(-2 * count // n), axis=0)
    rounds = rng.permuted(turns, axis=1, out=turns).ravel()
    a, b = rounds[: 2 * count : 2], rounds[1 : 2 * count : 2]
    second = crowding.take(b) > crowding.take(a)
    if np.count_nonzero(rank):
        fa, fb = f.take(a, axis=0), f.take(b, axis=0)
        below, above = (fa <= fb).all(axis=1), (fb <= fa).all(axis=1)
        even = below == above  # neither dominates, or the objectives are equal
        second = np.where(even, second, above)
    if np.count_nonzero(v):
        va, vb = v.take(a), v.take(b)
        second = np.where((va > 0.0) | (vb > 0.0), vb < va, second)
    return np.where(second, b, a)


def crossover(parents: Array, space: Space, probability: float, eta: float, rng: np.random.Generator) -> Array:
    """Simulated binary crossover (Deb & Agrawal 1995) of parents (2 k, variables), as a copy.

    The first is mated with the (k + 1)-th, and so on. `probability` is that of a mating to be
    crossed at all.
    """
    children = parents.copy()
    k, variables = len(parents) // 2, parents.shape[1]
    drawn = rng.random(k * (1 + variables))
    crossed = drawn[k:].reshape(k, variables) < CROSSED
    crossed[drawn[:k] >= probability] = False
    crossed &= np.abs(parents[:k] - parents[k:]) > MIN_CROSSOVER_DISTANCE
    at = crossed.ravel().nonzero()[0]
    flat = children.reshape(-1)
    partner = at + k * variables
    p, q = flat.take(at), flat.take(partner)
    low, high = ends = space.ends_of(k).take(at, axis=1)
    u, swapped = rng.random((2, len(at)))
    delta, power = np.abs(p - q), eta + 1.0
    scaled = np.empty((2, len(at)))  # of the smaller child, and of the larger
    np.minimum(p, q, out=scaled[0])
    np.maximum(p, q, out=scaled[1])
    np.subtract(ends, scaled, out=scaled)
    scaled *= OUTWARD
    scaled /= delta
    scaled += 1.0
    scaled **= -power
    np.subtract(2.0, scaled, out=scaled)  # alpha of the paper
    scaled *= u
    scaled = np.where(scaled > 1.0, 1.0 / (2.0 - scaled), scaled)
    scaled **= 1.0 / power
    scaled *= delta
    scaled /= OUTWARD
    p += q
    p *= 0.5
    scaled += p
    smaller, larger = _clip_to_bounds(scaled, low, high)
    above = np.where(swapped < 0.5, at, partner)
    flat[above], flat[at + partner - above] = larger, smaller
    return children


def _clip_to_bounds(x: Array, low: Array, high: Array) -> Array:
    """x between low and high; np.clip does the same more slowly."""
    return np.minimum(np.maximum(x, low), high)


def mutate(x: Array, space: Space, probability: float, eta: float, rng: np.random.Generator) -> Array:
    """Polynomial mutation (Deb & Goyal 1996) of points (n, variables), bounded; as a copy."""
    low, high = space.ends_of(len(x))
    changed = rng.random(x.size) < probability
    changed &= low < high
    mutated = x.copy()
    flat, at = mutated.reshape(-1), changed.nonzero()[0]
    low, high = low.take(at), high.take(at)
    old, u, power = flat.take(at), rng.random(len(at)), eta + 1.0
    u -= 0.5  # below 0 the point moves down
    step, span = np.where(u <= 0.0, low, high), high - low
    step -= old
    np.abs(step, out=step)
    step /= span
    np.subtract(1.0, step, out=step)
    step **= power
    aside = np.abs(u)
    aside *= 2.0
    step *= aside
    np.subtract(1.0, aside, out=aside)
    step += aside
    step **= 1.0 / power
    step -= 1.0
    np.copysign(step, u, out=step)
    step *= span
    step += old
    flat[at] = _clip_to_bounds(step, low, high)
    return mutated


def draw_other_rows(n: int, count: int, rng: np.random.Generator) -> Integers:
    """For each of n points `count` others (n, count), all different, uniformly drawn."""
    taken = np.arange(n)[:, None]
    for drawn in range(1, count + 1):
        candidates = rng.integers(0, n - drawn, n)
        for previous in np.sort(taken, axis=1).T:
            candidates += candidates >= previous
        taken = np.column_stack([taken, candidates])
    return taken[:, 1:]


def differential_evolution_trials(
    x: Array, space: Space, rate: float, scale: tuple[float, float], rng: np.random.Generator
) -> Array:
    """Trial points (n, variables) of DE/rand/1/bin: crossover rate, range of the scale factor.

    A value beyond a bound is drawn between the bound and the base vector, as pymoo does.
    """
    n, variables = x.shape
    base, plus, minus = draw_other_rows(n, 3, rng).T
    factor = scale[0] + (scale[1] - scale[0]) * rng.random((n, 1))
    origin = x[base]
    donor = origin + factor * (x[plus] - x[minus])
    bound = _clip_to_bounds(donor, space.low, space.high)
    row, column = np.nonzero(donor != bound)
    end, back = bound[row, column], rng.random(len(row))
    donor[row, column] = end + back * (origin[row, column] - end)
    taken = rng.random((n, variables)) < rate
    none = np.flatnonzero(~taken.any(axis=1))  # one variable at least
    taken[none, rng.integers(0, variables, len(none))] = True
    return np.where(taken, donor, x)


# GDE3 on arrays.


class GDE3Engine(ArrayEngine):
    """GDE3 (Kukkonen & Lampinen 2005): differential evolution for several objectives.

    A trial point replaces its parent where it dominates it, is dropped where the parent dominates
    it, and otherwise joins the population, which is then pruned by rank and crowding.
    """

    def __init__(
        self,
        space: Space,
        population: int,
        rng: np.random.Generator,
        rate: float = 0.9,
        scale: tuple[float, float] = (0.0, 1.0),
    ) -> None:
        super().__init__(space, population, rng)
        self.rate = rate
        self.scale = scale

    def _offspring(self) -> Array:
        return differential_evolution_trials(self.x, self.space, self.rate, self.scale, self.rng)

    def _select(self, x: Array, f: Array, v: Array) -> Integers:
        if not len(self.x):
            return self._keep_best(slice(None), x, f, v)
        stay = np.concatenate(_replace_parents(self.f, self.v, f, v))
        return self._keep_best(np.flatnonzero(stay), x, f, v)


def _replace_parents(f: Array, v: Array, trial_f: Array, trial_v: Array) -> tuple[Flags, Flags]:
    """Which parents and which trial points stay; of equal points the trial point stays."""
    feasible = (v <= 0.0) & (trial_v <= 0.0)
    better = np.where(feasible, (trial_f <= f).all(axis=1), trial_v < v)
    worse = np.where(feasible, (f <= trial_f).all(axis=1), v < trial_v)
    return ~better, better | ~worse


# NSGA-II on arrays.


class NSGA2Engine(ArrayEngine):
    """NSGA-II (Deb, Pratap, Agarwal & Meyarivan 2002), with pymoo's operators in distribution.

    `mating` and `mutation` are pairs of probability and distribution index eta.
    """

    def __init__(
        self,
        space: Space,
        population: int,
        rng: np.random.Generator,
        mating: tuple[float, float] = (0.9, 15.0),
        mutation: tuple[float, float] = (0.1, 20.0),
    ) -> None:
        super().__init__(space, population, rng)
        self.mating = mating
        self.mutation = mutation

    def _offspring(self) -> Array:
        pairs = -(-self.population // 2)
        parents = tournament(self.f, self.v, self.rank, self.crowding, 2 * pairs, self.rng)
        mated = self.x.take(parents.reshape(pairs, 2).T.ravel(), axis=0)
        children = crossover(mated, self.space, *self.mating, self.rng)
        return mutate(children[: self.population], self.space, *self.mutation, self.rng)

    def _select(self, x: Array, f: Array, v: Array) -> Integers:
        return self._keep_best(slice(None), x, f, v)
