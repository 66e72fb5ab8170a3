"""Genetic operators on whole populations, with the distributions of those of pymoo."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Integers
from .base import Space

CROSSED = 0.5
"""Probability per variable that simulated binary crossover changes it, as pymoo has it."""
CLOSE = 1e-14
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
    crossed &= np.abs(parents[:k] - parents[k:]) > CLOSE
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
    smaller, larger = _within(scaled, low, high)
    above = np.where(swapped < 0.5, at, partner)
    flat[above], flat[at + partner - above] = larger, smaller
    return children


def _within(x: Array, low: Array, high: Array) -> Array:
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
    flat[at] = _within(step, low, high)
    return mutated


def different(n: int, count: int, rng: np.random.Generator) -> Integers:
    """For each of n points `count` others (n, count), all different, uniformly drawn."""
    taken = np.arange(n)[:, None]
    for drawn in range(1, count + 1):
        candidates = rng.integers(0, n - drawn, n)
        for previous in np.sort(taken, axis=1).T:
            candidates += candidates >= previous
        taken = np.column_stack([taken, candidates])
    return taken[:, 1:]


def differential(x: Array, space: Space, rate: float, scale: tuple[float, float], rng: np.random.Generator) -> Array:
    """Trial points (n, variables) of DE/rand/1/bin: crossover rate, range of the scale factor.

    A value beyond a bound is drawn between the bound and the base vector, as pymoo does.
    """
    n, variables = x.shape
    base, plus, minus = different(n, 3, rng).T
    factor = scale[0] + (scale[1] - scale[0]) * rng.random((n, 1))
    origin = x[base]
    donor = origin + factor * (x[plus] - x[minus])
    bound = _within(donor, space.low, space.high)
    row, column = np.nonzero(donor != bound)
    end, back = bound[row, column], rng.random(len(row))
    donor[row, column] = end + back * (origin[row, column] - end)
    taken = rng.random((n, variables)) < rate
    none = np.flatnonzero(~taken.any(axis=1))  # one variable at least
    taken[none, rng.integers(0, variables, len(none))] = True
    return np.where(taken, donor, x)
