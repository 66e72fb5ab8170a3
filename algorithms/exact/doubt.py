"""Roots with a surplus of doubt under them: reweighted roots, proven at every step.

A surplus N(v) of squares v lies above its tangent planes, so that a root with weighted squares,
w = 1 + dN/dv at any reference point, lies below the requirement and is separable at prices
(`separable`): its least cost, over all choices of ways, is a proven bound. At the weights of the
optimum it is the optimum's cost. The weights of an allocation give the next allocation; every
allocation is moved back within the limits, and the best counts.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...problems.forms import Form
from .combination import Combination, Optimum
from .separable import Leaf, Squares, least_leaf

STEPS = 40
"""Times the weights are renewed at most."""
GAP = 1e-10
"""Relative gap at which the weights are no longer renewed."""
NEAR, SETTLED = 1e-3, 1e-11
"""Relative change of the squares from which on allocations are moved back within the limits, and
the change that counts as none.
"""
RATIOS = -0.9, 0.5
"""Range of the ratio of a step to the one before that is used for extrapolation."""
CHORDS, CLOSE = 8, 1e-14
"""Points that are tried on the way to the limits, and the relative distance from a limit that
counts as met."""


def least_under_doubt(form: Form, limits: Array, floor: float) -> Optimum:
    """The cheapest allocation that keeps each set of upper limits (n, r); `floor` bounds its cost.

    Cost and bound are inf where no allocation can keep them, the cost alone where none is known.
    """
    optimum = Optimum.unknown(form, limits, floor)
    reference: Array | None = None
    for row, limit in enumerate(limits):
        reweighted = _Reweighted(form, limit, reference)
        reweighted.run()
        reference = reweighted.reference
        optimum.bound[row] = max(floor, min(reweighted.bound, reweighted.cost))
        if reweighted.leaf is not None:
            optimum.chosen[row], optimum.t[row] = reweighted.leaf.ways, reweighted.t
            optimum.cost[row], optimum.multiplier[row] = reweighted.cost, reweighted.multiplier
    return optimum


class _Reweighted:
    """The best allocation and the best bound so far, at limits (r,).

    `reference` (r, features) are the squares at which the tangents touch.
    """

    def __init__(self, form: Form, limit: Array, reference: Array | None) -> None:
        self.form, self.limit, self.reference = form, limit, reference
        self.leaf: Leaf | None = None
        self.t, self.multiplier = np.empty(0), np.zeros(len(limit))
        self.cost, self.bound = np.inf, -np.inf

    def run(self) -> None:
        """Renew the weights until the gap closes or nothing changes."""
        known: Leaf | None = None
        step: Array | None = None
        for _ in range(STEPS):
            squares = self._squares()
            known, bound = least_leaf(squares, self.limit, known)
            self.bound = max(self.bound, bound)
            if not np.isfinite(known.cost):
                return
            squared_parts = Combination(self.form, known.ways).parts(known.t[None, :])[0] ** 2
            last, step = step, self._step(squared_parts)
            change = np.max(np.abs(step))
            if change <= NEAR:
                self._keep(known, squares)
                if self.cost - self.bound <= GAP * abs(self.cost) or change <= SETTLED:
                    return
            self.reference = self._drawn(squared_parts, step, last)
        if known is not None:
            self._keep(known, self._squares())

    def _squares(self) -> Squares:
        """The separable relaxation by the tangents at the reference."""
        weights = np.ones((len(self.limit), len(self.form.features)))
        constant = self.form.constant.copy()
        for row, surplus in enumerate(self.form.surpluses):
            if surplus is not None and self.reference is not None:
                at = self.reference[row]
                value, rise = surplus.value(at)
                weights[row] += rise
                constant[row] += max(float(value - rise @ at), 0.0)
        return Squares(self.form, weights, constant)

    def _step(self, squared_parts: Array) -> Array:
        """Logarithms of squares (r, features) over those of the reference."""
        if self.reference is None:
            return np.full_like(squared_parts, np.inf)
        real = (squared_parts > 0.0) & (self.reference > 0.0)
        ratio = np.divide(squared_parts, self.reference, out=np.ones_like(squared_parts), where=real)
        return np.asarray(np.log(ratio))

    def _drawn(self, squared_parts: Array, step: Array, last: Array | None) -> Array:
        """The next reference: the step times a factor by the ratio of the last two steps.

        Steps that overshoot are shortened, and slow ones lengthened (Aitken 1926).
        """
        if self.reference is None or last is None or not np.all(np.isfinite(last)):
            return squared_parts
        ratio = float(np.sum(step * last) / max(float(np.sum(last * last)), 1e-300))
        factor = 1.0 / (1.0 - float(np.clip(ratio, *RATIOS)))
        return np.asarray(np.where(self.reference > 0.0, self.reference, squared_parts) * np.exp(factor * step))

    def _keep(self, leaf: Leaf, squares: Squares) -> None:
        """Record an allocation, moved back within the limits, where it is the cheapest yet."""
        combination = Combination(self.form, leaf.ways)
        t = _within(combination, leaf.t, self.limit)
        if t is None:
            return
        cost = float(combination.cost(t[None, :])[0])
        if cost < self.cost:
            self.leaf, self.t, self.cost = leaf, t, cost
            self.multiplier = leaf.mu * squares.worth(self.limit)


def _within(combination: Combination, t: Array, limit: Array) -> Array | None:
    """Tolerances that keep the limits, nearly the first on the way from t to the tightest.

    Values are convex, so that they lie below their chord: where it meets a limit they keep it.
    """
    low, asked = combination.low, np.isfinite(limit)

    def excess(fraction: float) -> Array:
        values = combination.values((low + fraction * (t - low))[None, :])[0]
        return np.asarray((values - limit)[asked])

    outside, inside, fraction = excess(1.0), excess(0.0), 0.0
    if np.all(outside <= 0.0):
        return t
    if np.any(inside > 0.0):
        return None
    broken = outside > 0.0
    for _ in range(CHORDS):
        room = -inside[broken]
        tried = fraction + float(np.min(room / (room + outside[broken]))) * (1.0 - fraction)
        tried_excess = excess(tried)
        if np.any(tried_excess > 0.0):
            break
        fraction, inside = tried, tried_excess
        if np.max(tried_excess[broken] / limit[asked][broken]) >= -CLOSE:
            break
    return np.asarray(low + fraction * (t - low))
