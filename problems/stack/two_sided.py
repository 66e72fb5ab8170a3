"""Two limits about a mean that moves, as limits of straight lines.

A normal deviation with the mean m and the standard deviation s keeps -T and T with the probability
P where s <= s(|m|), Phi((T - m)/s) + Phi((T + m)/s) - 1 = P. The curve s falls from T/z((1 + P)/2)
at m = 0 towards (T - |m|)/z(P); it is concave, so that its tangents

    side m + z s <= room,    z = -1/s'(d),    room = d + z s(d)

lie above it, and what breaks one of them breaks P. Concavity is tried at `TRIED` points for every
P. The line at m = 0 holds for every deviation that is even and unimodal about its mean: none keeps
more of it between two limits than when these are even about the mean (Anderson 1955, The integral
of a symmetric unimodal function, Proc. American Mathematical Society 6(2), 170-176).
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr, ndtri

from ...arrays import Array
from ...models.roots import bracketed_roots

AT = np.array([0.1, 0.21, 0.35, 0.55])
"""Means, in standard deviations, at which tangents are drawn: at P = 0.9973 s is then at most
0.14 % too large, at 0.99 0.18 %."""
FAR, TRIED = 6.0, 65
"""Means, in standard deviations, up to which the curve is tried, and at how many."""


def tangents(p: float) -> tuple[tuple[float, float], ...]:
    """Factors z and rooms, in units of T, of tangents of the curve at the probability p > 1/2.

    None where the curve is not concave at the points that are tried.
    """
    slopes = _curve(p, np.linspace(0.0, FAR, TRIED))[2]
    if not np.all(np.diff(slopes) <= 1e-9):
        return ()
    d, s, slope = _curve(p, AT)
    z = -1.0 / slope
    return tuple(zip(z.tolist(), (d + z * s).tolist(), strict=True))


def _curve(p: float, delta: Array) -> tuple[Array, Array, Array]:
    """Means d, standard deviations s and slopes of s by d for T = 1 at d = delta s."""

    def excess(k: Array, delta: Array) -> Array:
        return np.asarray(ndtr(k - delta) + ndtr(k + delta) - 1.0 - p)

    low = np.full(len(delta), float(ndtri(p)))
    k = bracketed_roots(excess, (low, low + delta + 8.0), delta).x
    near, far = (np.exp(-0.5 * (k - sign * delta) ** 2) for sign in (1.0, -1.0))
    slope = -(near - far) / ((k - delta) * near + (k + delta) * far)
    return delta / k, 1.0 / k, slope
