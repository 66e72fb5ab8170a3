"""Roots of many functions of one variable at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..section import Array

MAX_ITERATIONS = 200
"""Evaluations at most; bisection alone would take some 60."""


@dataclass(frozen=True, slots=True, eq=False)
class Roots:
    """Roots `x`, and the last `bracket` of each: its ends, in the order of those given."""

    x: Array
    bracket: tuple[Array, Array]


def bracketed_roots(function: Callable[..., Any], ends: tuple[Any, Any], *args: Any) -> Roots:
    """Roots of function(x, *args) between `ends`, where its signs differ (or it is 0).

    `ends` and `args` broadcast; `function` is called with arrays of one dimension, of those roots
    alone that are not yet computed. Inverse quadratic interpolation where it is safe, else
    bisection, to the last digits. NaN where the signs at the ends are equal.

    Reference: Chandrupatla (1997), A new hybrid quadratic/bisection algorithm for finding the zero
    of a nonlinear function without using derivatives, Advances in Engineering Software 28(3),
    145-149.
    """
    low, high, *more = (np.array(array, dtype=float) for array in np.broadcast_arrays(*ends, *args))
    shape = low.shape
    a, b = low.ravel(), high.ravel()
    arguments = [array.ravel() for array in more]

    def values(x: Array, rows: Any) -> Array:
        return np.asarray(function(x, *(argument[rows] for argument in arguments)), dtype=float)

    fa, fb = values(a, slice(None)), values(b, slice(None))
    best = np.where(np.abs(fa) < np.abs(fb), a, b)
    valid = np.sign(fa) * np.sign(fb) <= 0.0
    roots = np.where(valid, best, np.nan)
    rows = np.flatnonzero(valid & (fa != 0.0) & (fb != 0.0))
    ends_a, ends_b = a.copy(), b.copy()
    first = a < b
    # b is the newest estimate, a the other end of its bracket, c the estimate before.
    a, b, fa, fb = b[rows], a[rows], fb[rows], fa[rows]
    c, fc, t = a.copy(), fa.copy(), np.full(len(rows), 0.5)
    for _ in range(MAX_ITERATIONS):
        if not len(rows):
            break
        x = b + t * (a - b)
        fx = values(x, rows)
        same = np.sign(fx) == np.sign(fb)
        c, fc = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = x, fx
        near = np.where(np.abs(fa) < np.abs(fb), a, b)
        roots[rows] = near
        lower, upper = np.minimum(a, b), np.maximum(a, b)
        ends_a[rows] = np.where(first[rows], lower, upper)
        ends_b[rows] = np.where(first[rows], upper, lower)
        least = 2.0 * np.finfo(float).eps * np.abs(near) + np.finfo(float).tiny
        least_fraction = 0.5 * least / (upper - lower)
        t = _step(a, b, c, fa, fb, fc, least_fraction)
        open_ = (least_fraction <= 0.5) & (np.minimum(np.abs(fa), np.abs(fb)) > 0.0)
        rows, t = rows[open_], t[open_]
        a, b, c, fa, fb, fc = (array[open_] for array in (a, b, c, fa, fb, fc))
    return Roots(roots.reshape(shape), (ends_a.reshape(shape), ends_b.reshape(shape)))


def _step(a: Array, b: Array, c: Array, fa: Array, fb: Array, fc: Array, least_fraction: Array) -> Array:
    """The next estimate, as a fraction of the distance from b to a."""
    with np.errstate(divide="ignore", invalid="ignore"):
        xi, phi = (b - a) / (c - a), (fb - fa) / (fc - fa)
        quadratic = fb / (fa - fb) * fc / (fa - fc) + ((c - b) / (a - b) * fb / (fc - fb) * fa / (fc - fa))
    safe = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi) & np.isfinite(quadratic)
    t = np.where(safe, quadratic, 0.5)
    return np.clip(t, least_fraction, 1.0 - least_fraction)
