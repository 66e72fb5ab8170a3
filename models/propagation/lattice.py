"""Distributions on a lattice of multiples of a step, one step per design.

A term is split onto the lattice by linear allocation: the mass at x goes to the two neighbouring
points so that its mean stays. The masses are second differences of E[(x - Y)+], which the partial
moments of the input give exactly, so no density is ever sampled. Panjer & Lutek (1983), Insurance:
Mathematics and Economics 2(3), 159-177, call it the method of matching the first moment.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from ...arrays import Array, Integers
from .sums import Term

Spectrum = NDArray[np.complex128]


def stop_loss(term: Term, x: Array) -> Array:
    """E[(x - Y)+] of the contribution Y of `term`, for x of shape (n, k)."""
    away = x - term.constant[:, None]
    if term.quadratic is None:
        return _stop_loss_linear(term, away)
    return np.where((term.quadratic == 0.0)[:, None], _stop_loss_linear(term, away), _stop_loss_bent(term, away))


def _stop_loss_linear(term: Term, away: Array) -> Array:
    slope = term.linear[:, None]
    flat = slope == 0.0
    safe = np.where(flat, 1.0, slope)
    mass, first, _ = term.distribution.partial_moments(away / safe)
    mean = term.distribution.raw_moments(1)[1]
    rising = away * mass - slope * first
    falling = away * (1.0 - mass) - slope * (mean - first)
    return np.where(flat, np.maximum(away, 0.0), np.where(slope > 0.0, rising, falling))


def _stop_loss_bent(term: Term, away: Array) -> Array:
    """The same for linear z + quadratic z^2: the mass between the roots, or outside of them."""
    assert term.quadratic is not None
    b, a = term.linear[:, None], np.where(term.quadratic == 0.0, 1.0, term.quadratic)[:, None]
    square = b * b + 4.0 * a * away
    root = np.sqrt(np.maximum(square, 0.0))
    stable = -0.5 * (b + np.where(b < 0.0, -root, root))
    first_root = stable / a
    single = (square <= 0.0) | (stable == 0.0)  # beyond the vertex: no root, an empty interval
    second_root = np.where(single, first_root, -away / np.where(single, 1.0, stable))
    low = term.distribution.partial_moments(np.minimum(first_root, second_root))
    high = term.distribution.partial_moments(np.maximum(first_root, second_root))
    inside = [upper - lower for lower, upper in zip(low, high, strict=True)]
    between = away * inside[0] - b * inside[1] - a * inside[2]
    _, first, second = term.distribution.raw_moments(2)
    return np.where(a > 0.0, between, away - b * first - a * second - between)


def masses(term: Term, step: Array) -> tuple[Array, Integers]:
    """Masses (n, k) of `term` on the lattice and the lattice index (n,) of the first of them."""
    low, high = term.bounds()
    start = np.floor(low / step).astype(np.int64) - 1
    count = int(np.max(np.ceil(high / step).astype(np.int64) - start)) + 3
    x = (start[:, None] + np.arange(count)) * step[:, None]
    mass = np.diff(stop_loss(term, x), n=2, axis=1) / step[:, None]
    near = (x > (low - step)[:, None]) & (x < (high + step)[:, None])
    return np.where(near[:, 1:-1], np.maximum(mass, 0.0), 0.0), start + 1


def spectrum(terms: tuple[Term, ...], step: Array, points: int) -> tuple[Spectrum, Integers]:
    """Transform (n, points // 2 + 1) of the sum of `terms`, and the lattice index of its start."""
    product: Spectrum | None = None
    start = np.zeros(len(step), dtype=np.int64)
    for term in terms:
        mass, first = masses(term, step)
        transform = scipy.fft.rfft(_wrapped(mass, points), n=points, axis=1)
        product = transform if product is None else product * transform
        start += first
    assert product is not None
    return product, start


def _wrapped(mass: Array, points: int) -> Array:
    """Mass beyond the last lattice point, folded round: the lattice is periodic."""
    if mass.shape[1] <= points:
        return mass
    folds = -(-mass.shape[1] // points)
    padded = np.zeros((len(mass), folds * points))
    padded[:, : mass.shape[1]] = mass
    return np.asarray(padded.reshape(len(mass), folds, points).sum(axis=1))


def window(transform: Spectrum, start: Integers, first: Integers, points: int) -> Array:
    """Masses at lattice indices first .. first + points - 1, shape (n, points)."""
    periodic = scipy.fft.irfft(transform, n=points, axis=1)
    at = (first - start)[:, None] + np.arange(points)
    return np.take_along_axis(periodic, at % points, axis=1)
