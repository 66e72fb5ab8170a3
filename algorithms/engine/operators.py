"""Genetic operators on whole populations, with the distributions of pymoo's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .base import Space

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
CROSSED = 0.5
"""Probability per variable that simulated binary crossover changes it, as pymoo has it."""
CLOSE = 1e-14
"""Parents' values nearer than this are not crossed."""


def tournament(
    f: Array, v: Array, crowding: Array, count: int, rng: np.random.Generator
) -> Indices:
    """Winners (count,) of binary tournaments in which every point takes part equally often.

    The smaller violation wins; of two feasible points the one that dominates, else the less
    crowded one; ties are drawn.
    """
    n = len(f)
    rounds = np.concatenate([rng.permutation(n) for _ in range(-(-2 * count // n))])
    a, b = rounds[: 2 * count].reshape(count, 2).T
    fa, fb, ca, cb = f[a], f[b], crowding[a], crowding[b]
    below, above = (fa <= fb).all(axis=1), (fb <= fa).all(axis=1)
    same = below == above  # neither dominates, or the objectives are equal
    first, second = np.where(same, ca > cb, below), np.where(same, cb > ca, above)
    if v.any():
        va, vb = v[a], v[b]
        broken = (va > 0.0) | (vb > 0.0)
        first, second = np.where(broken, va < vb, first), np.where(broken, vb < va, second)
    return np.where(first | (~second & (rng.random(count) < 0.5)), a, b)


def crossover(
    first: Array, second: Array, space: Space, probability: float, eta: float,
    rng: np.random.Generator,
) -> Array:  # fmt: skip
    """Simulated binary crossover (Deb & Agrawal 1995) of parents (k, variables): (2 k, variables).

    `probability` is that of a mating to be crossed at all.
    """
    mated = rng.random((len(first), 1)) < probability
    crossed = mated & (rng.random(first.shape) < CROSSED) & (np.abs(first - second) > CLOSE)
    at = np.flatnonzero(crossed)
    column = at % first.shape[1]
    p, q = first.ravel()[at], second.ravel()[at]
    low, high = np.minimum(p, q), np.maximum(p, q)
    ends = space.low[column], space.high[column]
    delta, u, power = high - low, rng.random(len(at)), eta + 1.0
    gap = np.stack([low - ends[0], ends[1] - high])
    alpha = 2.0 - (1.0 + 2.0 * gap / delta) ** -power
    scaled = u * alpha
    inner = scaled <= 1.0
    spread = np.where(inner, scaled, 1.0 / np.where(inner, 1.0, 2.0 - scaled)) ** (1.0 / power)
    step = 0.5 * delta * spread
    middle = 0.5 * (low + high)
    smaller, larger = (_within(value, *ends) for value in (middle - step[0], middle + step[1]))
    swapped = rng.random(len(at)) < 0.5
    found = np.concatenate([first, second])
    flat = found.reshape(-1)
    flat[at] = np.where(swapped, larger, smaller)
    flat[at + first.size] = np.where(swapped, smaller, larger)
    return found


def _within(x: Array, low: Array, high: Array) -> Array:
    """x between low and high; np.clip does the same more slowly."""
    return np.minimum(np.maximum(x, low), high)


def mutate(
    x: Array, space: Space, probability: float, eta: float, rng: np.random.Generator
) -> Array:
    """Polynomial mutation (Deb & Goyal 1996) of points (n, variables), bounded; as a copy."""
    changed = (rng.random(x.shape) < probability) & (space.low < space.high)
    at = np.flatnonzero(changed)
    column = at % x.shape[1]
    low, high = space.low[column], space.high[column]
    old, u, power = x.ravel()[at], rng.random(len(at)), eta + 1.0
    down, span = u <= 0.5, high - low
    share = np.where(down, old - low, high - old) / span
    base = np.where(down, u, 1.0 - u)
    step = (2.0 * base + (1.0 - 2.0 * base) * (1.0 - share) ** power) ** (1.0 / power) - 1.0
    found = x.copy()
    found.reshape(-1)[at] = _within(old + np.where(down, step, -step) * span, low, high)
    return found


def different(n: int, count: int, rng: np.random.Generator) -> Indices:
    """For each of n points `count` others (n, count), all different, uniformly drawn."""
    taken = np.arange(n)[:, None]
    for drawn in range(1, count + 1):
        one = rng.integers(0, n - drawn, n)
        for other in np.sort(taken, axis=1).T:
            one += one >= other
        taken = np.column_stack([taken, one])
    return taken[:, 1:]


def differential(
    x: Array, space: Space, rate: float, scale: tuple[float, float], rng: np.random.Generator
) -> Array:
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
