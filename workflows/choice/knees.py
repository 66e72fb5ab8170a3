"""Knees of a front by several definitions; objectives (n, m) are scaled to [0, 1] before."""

from __future__ import annotations

import numpy as np

from ...arrays import Array

ARM = 0.1
"""Length of the arms of a bend, as a fraction of the length of the front."""
COMPARED = 500
"""Points that every point's trade-off is compared with at most, evenly spaced."""


def scaled(values: Array) -> Array:
    """Objectives (n, m) with the least of the front at 0 and its largest at 1."""
    low, span = values.min(axis=0), np.ptp(values, axis=0)
    return np.asarray((values - low) / np.where(span > 0.0, span, 1.0))


def farthest_from_chord(values: Array) -> int | None:
    """The point farthest below the chord (with more objectives: the plane) through the ends.

    Reference: Das (1999), On characterizing the "knee" of the Pareto curve, Structural
    Optimization 18, 107-115.
    """
    return int(np.argmin(scaled(values).sum(axis=1))) if len(values) >= 3 else None


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
    line = scaled(values)[order]
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
    points = scaled(values)
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
    return int(np.argmax(np.prod(1.0 - scaled(values), axis=1))) if len(values) >= 3 else None
