"""Machines whose pose errors keep their bounds at every pose of the ring.

In standard deviations of the sources the errors of a machine are x = rho E u + (1 - E E') g: the
orthonormal E spans the plane in which errors act most over the ring, u is a direction in it, rho
the length of a normal vector there (Rayleigh), and g is normal. The errors that keep a bound at a
pose are convex, at given u and g an interval of rho, so that rho is integrated and not sampled:

    P(some pose > L) = 1 - exp(-lo^2/2) + exp(-hi^2/2),  [lo, hi] the intersection of the intervals.

The probability of exceeding L at the worst pose alone is known exactly, so that only the
contribution of the other poses is sampled. The sum is never below the probability at that pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import ndtri

from ...arrays import Array
from ..gaussian_length import exceedance
from ..propagation import MonteCarlo

Rows = NDArray[np.int64]
WIDER = 1.1
"""Factor by which the bracket of a quantile grows."""
BLOCK = 128
"""Machines that are computed at once: matrices this small are multiplied by a single thread, which
on a busy computer is many times faster than waiting for another."""
SHORT = 0.999
"""Lower end of the bracket in units of the quantile at the worst pose, where too many exceed it."""
STEP = 1e-3
"""Relative step of the density at a quantile."""
CLOSE = 1e-9
"""Relative tolerance of a quantile."""
NONE = 1e-4
"""Fraction of the exceeding machines that is neglected: 1e-5 of a quantile at most."""
TINY = 1e-200
"""Square of an effect in the plane that counts as zero."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """The sample common to all designs: `u` (m, 2) of length 1, `g` (m, sources) normal.

    The m machines are `replicates` scrambled Sobol samples, one after another.
    """

    u: Array
    g: Array
    replicates: int

    @classmethod
    def draw(cls, machines: int, sources: int, rng: np.random.Generator) -> Sample:
        """At least that many machines."""
        points = MonteCarlo.draw(machines, 2 + sources, rng).points
        normal = ndtri(np.clip(points, 1e-12, 1.0 - 1e-12)).reshape(-1, 2 + sources)
        u = normal[:, :2]
        u = u / np.linalg.norm(u, axis=1, keepdims=True)
        return cls(u, np.ascontiguousarray(normal[:, 2:]), len(points))


def main_plane(effects: Sequence[Array], near: Array | None = None) -> Array:
    """Orthonormal E (sources, 2) of the plane in which errors act most, over all poses.

    `effects` (poses, c, sources) are those of one standard deviation of each source. E is turned
    as near to the frame `near` as possible, so that it changes smoothly with the design.
    """
    rows = np.concatenate([effect.reshape(-1, effect.shape[-1]) for effect in effects])
    plane = np.linalg.eigh(rows.T @ rows)[1][:, -2:]
    if near is None:
        return np.asarray(plane)
    left, _, right = np.linalg.svd(plane.T @ near)
    return np.asarray(plane @ (left @ right))


@dataclass(frozen=True, slots=True, eq=False)
class Machines:
    """Machines of one design, and the intervals of rho in which they keep a bound at each pose.

    The error at a pose is a + rho b: `inverse` is 1/b.b, `middle` a.b/b.b and `apart`
    a.a/b.b - (a.b/b.b)^2, each (poses, m), so that the interval is that of
    (rho + middle)^2 <= L^2 inverse - apart. The errors have the principal `variances` (poses, 3).
    """

    inverse: Array
    middle: Array
    apart: Array
    variances: Array
    replicates: int

    @classmethod
    def of(cls, effects: Sequence[Array], variances: Array, sample: Sample, plane: Array) -> Machines:
        """Machines with one kind of error, `effects` (poses, c, sources), or with several in units
        of their bounds, whose poses follow each other in `variances`; `plane` is E (sources, 2).
        """
        b, a = sample.u @ plane.T, sample.g - (sample.g @ plane) @ plane.T
        parts = [_quadratic(effect, a.T.copy(), b.T.copy()) for effect in effects]
        square, product, offset = (np.concatenate(blocks) for blocks in zip(*parts, strict=True))
        inverse = 1.0 / np.maximum(square, TINY)
        middle = product * inverse
        return cls(inverse, middle, offset * inverse - middle**2, variances, sample.replicates)

    def at(self, poses: slice | Rows) -> Machines:
        """The same machines at some of the poses."""
        return Machines(
            self.inverse[poses], self.middle[poses], self.apart[poses], self.variances[poses], self.replicates
        )

    def beyond(self, bound: float, worst: int) -> tuple[float, float]:
        """Fraction of machines that exceed the bound at some pose, and its standard error.

        `worst` is the row of the pose at which most exceed it.
        """
        fractions = self._fractions(bound, worst)
        error = float(fractions.std(ddof=1) / np.sqrt(len(fractions)))
        return min(1.0, float(fractions.mean())), error

    def quantile(self, coverage: float, worst: int, least: float) -> tuple[float, float]:
        """Bound that a machine keeps at every pose with that probability, and its standard error:
        that of the fraction, over the density.

        `least` is the largest quantile at a pose, and `worst` the row of that pose.
        """
        if least <= 0.0:
            return 0.0, 0.0
        relevant, row = self._relevant(least, worst, 1.0 - coverage)

        def fraction(bound: float) -> float:
            return float(relevant._fractions(bound, row).mean())

        high = WIDER * least
        while fraction(high) > 1.0 - coverage:
            high *= WIDER
        root = float(
            scipy.optimize.brentq(lambda at: np.log(fraction(at) / (1.0 - coverage)), SHORT * least, high, rtol=CLOSE)
        )
        fall = fraction(root * (1.0 - STEP)) - fraction(root * (1.0 + STEP))
        return max(root, least), relevant.beyond(root, row)[1] * 2.0 * STEP * root / fall

    def _relevant(self, bound: float, worst: int, fraction: float) -> tuple[Machines, int]:
        """The same without the poses at which, all together, almost no machine exceeds the bound.

        Also the row of the worst pose among the remaining ones.
        """
        over = exceedance(self.variances, bound)
        order = np.argsort(over)
        kept = np.union1d(order[np.cumsum(over[order]) > NONE * fraction], [worst])
        return self.at(kept), int(np.searchsorted(kept, worst))

    def _fractions(self, bound: float, worst: int) -> Array:
        """Fraction of machines that exceed the bound at some pose (replicates,)."""
        worst_pose = slice(worst, worst + 1)
        more = self._exceeding(bound, slice(None)) - self._exceeding(bound, worst_pose)
        at_worst = float(exceedance(self.variances[worst], bound))
        return np.asarray(at_worst + np.mean(more.reshape(self.replicates, -1), axis=1))

    def _exceeding(self, bound: float, poses: slice) -> Array:
        """Probability (m,) of a rho at which the bound is exceeded at one of the poses."""
        square = bound**2 * self.inverse[poses] - self.apart[poses]
        missed = np.min(square, axis=0) < 0.0
        half, middle = np.sqrt(np.maximum(square, 0.0)), self.middle[poses]
        low = np.maximum(-np.min(half + middle, axis=0), 0.0)
        high = np.where(missed, low, np.maximum(np.min(half - middle, axis=0), low))
        return np.asarray(1.0 - np.exp(-0.5 * low**2) + np.exp(-0.5 * high**2))


def _quadratic(effects: Array, a: Array, b: Array) -> tuple[Array, Array, Array]:
    """b.b, a.b and a.a (poses, m) of the errors that machines a, b (sources, m) make at poses."""
    shape = (len(effects), a.shape[1])
    products_of = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    rows = [np.ascontiguousarray(effects[:, at]) for at in range(effects.shape[1])]
    for start in range(0, shape[1], BLOCK):
        some = slice(start, start + BLOCK)
        for row in rows:
            fixed, along = row @ a[:, some], row @ b[:, some]
            products = along * along, fixed * along, fixed * fixed
            for total, product in zip(products_of, products, strict=True):
                total[:, some] += product
    return products_of
