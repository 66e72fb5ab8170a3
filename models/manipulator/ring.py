"""Machines whose pose errors keep their bounds at every pose of the ring.

In standard deviations of the sources the errors of a machine are x = rho u + (1 - E E') g: g is
normal, the orthonormal E spans the plane in which errors act most over the ring, u = E E' g/|E E' g|
is a direction in it, and rho the length of a normal vector there (Rayleigh), independent of both. They
depend on the plane alone, not on its frame E. The errors that keep a bound at a pose are convex, at
given u and g an interval of rho, so that rho is integrated and not sampled:

    P(some pose > L) = 1 - exp(-lo^2/2) + exp(-hi^2/2),  [lo, hi] the intersection of the intervals.

The probability of exceeding L at the worst pose alone is known exactly, so that only the
contribution of the other poses is sampled. The sum is never below the probability at that pose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import chdtri, dawsn, erfc, ndtri

from ...section import Array
from ..propagation import MonteCarlo
from ..roots import bracketed_roots
from .geometry import Manipulator, TaskRing
from .maps import NAMES, Combination, first_order, matrix

# Length of a centred Gaussian vector in space: how often it exceeds a bound, and its quantiles.
#
# With the variances l_1 >= l_2 >= l_3 along the principal axes, the square of the two smaller
# components together is s(phi) = l_2 cos^2 phi + l_3 sin^2 phi times an exponential variable of mean
# 2, phi uniform. At a given phi the integral over the largest component has a closed form, and one
# integral remains:
#
#     P(|v| > r) = erfc(a) + (2/sqrt pi) exp(-a^2) mean over phi of D(a sqrt k)/sqrt k,
#     a = r/sqrt(2 l_1),  k = l_1/s(phi) - 1,  D Dawson's function.
#
# The length of one component is half-normal (l_2 = l_3 = 0), that of two equal ones Rayleigh's, of
# two unequal ones Hoyt's, and of three equal ones Maxwell's.


ANGLES = 16
"""Midpoints of phi in a quarter turn: the error of P is up to 1e-6 from r = sqrt(l_1) on, and up to
1e-4 below."""
LEAST, MOST = 1e-14, 1e300
"""Range of k: below it D(a sqrt k)/sqrt k is a to rounding; beyond it one component counts."""


def principal(covariance: Array) -> Array:
    """Principal variances (..., 3), largest first, of covariances (..., c, c), c = 1, 2 or 3."""
    size = covariance.shape[-1]
    variances = np.zeros((*covariance.shape[:-2], 3))
    if size == 2:  # in closed form: many times faster
        a, b, d = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
        largest = 0.5 * (a + d) + np.hypot(0.5 * (a - d), b)
        safe = np.where(largest > 0.0, largest, 1.0)
        variances[..., 0], variances[..., 1] = largest, (a * d - b * b) / safe
    else:
        variances[..., :size] = np.linalg.eigvalsh(covariance)[..., ::-1]
    return np.maximum(variances, 0.0)


def exceedance(variances: Array, length: Array | float) -> Array:
    """P(|v| > r), shape (...), of principal variances (..., 3), largest first, and r > 0, (...)."""
    largest = np.maximum(variances[..., 0], np.finfo(float).tiny)
    a = np.asarray(length) / np.sqrt(2.0 * largest)
    probability = erfc(a)
    if np.any(variances[..., 1] > 0.0):
        phi = 0.5 * np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
        s = variances[..., 1, None] * np.cos(phi) ** 2 + variances[..., 2, None] * np.sin(phi) ** 2
        with np.errstate(divide="ignore"):
            root = np.sqrt(np.clip(largest[..., None] / s - 1.0, LEAST, MOST))
        integrand = dawsn(np.minimum(a[..., None] * root, MOST)) / root
        probability += 2.0 / np.sqrt(np.pi) * np.exp(-(a**2)) * np.mean(integrand, axis=-1)
    return np.asarray(probability)


def quantile(variances: Array, coverage: float) -> Array:
    """Length (...) that v does not exceed with the probability `coverage`.

    The variances are those of `exceedance`. The length lies between those of one component and of three equal ones.
    """
    scale = np.sqrt(variances[..., 0])
    relative = variances / np.where(scale > 0.0, scale, 1.0)[..., None] ** 2

    def excess(length: Array, second: Array, third: Array) -> Array:
        parts = np.stack([np.ones_like(second), second, third], axis=-1)
        return exceedance(parts, length) - (1.0 - coverage)

    low, high = ndtri(0.5 * (1.0 + coverage)), np.sqrt(chdtri(3.0, 1.0 - coverage))
    bracket = np.full(scale.shape, 0.999 * low), np.full(scale.shape, 1.001 * high)
    roots = bracketed_roots(excess, bracket, relative[..., 1], relative[..., 2])
    return np.asarray(scale * roots.x)


Rows = NDArray[np.int64]
WIDER = 1.1
"""Factor by which the bracket of a quantile grows."""
BLOCK = 128
"""Machines that are computed at once: matrices this small are multiplied by a single thread, which
on a busy computer is many times faster than waiting for another."""
BRACKET_SHRINKAGE = 0.999
"""Lower end of the bracket in units of the quantile at the worst pose, where too many exceed it."""
STEP = 1e-3
"""Relative step of the density at a quantile."""
RELATIVE_TOLERANCE = 1e-9
"""Relative tolerance of a quantile."""
NEGLIGIBLE_FRACTION = 1e-4
"""Fraction of the exceeding machines that is neglected: 1e-5 of a quantile at most."""
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
"""Angle [rad] of which no two multiples are the same direction."""
MIN_SQUARE = 1e-200
"""Square of an effect in the plane that counts as zero."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """The sample common to all designs: `g` (m, sources) normal.

    The m machines are `replicates` scrambled Sobol samples, one after another. `first` (m, 2) are normal
    numbers of the first two dimensions, which are the most even.
    """

    first: Array
    g: Array
    replicates: int

    @classmethod
    def draw(cls, machines: int, sources: int, rng: np.random.Generator) -> Sample:
        """At least that many machines."""
        points = MonteCarlo.draw(machines, 2 + sources, rng).points
        normal = ndtri(np.clip(points, 1e-12, 1.0 - 1e-12)).reshape(-1, 2 + sources)
        return cls(normal[:, :2], np.ascontiguousarray(normal[:, 2:]), len(points))

    def about(self, plane: Array) -> Sample:
        """The same with `first` in the place of what `g` has in a plane E (sources, 2)."""
        return replace(self, g=self.g + (self.first - self.g @ plane) @ plane.T)


def main_plane(effects: Sequence[Array]) -> Array:
    """Orthonormal E (sources, 2) of the plane in which errors act most, over all poses.

    `effects` (poses, c, sources) are those of one standard deviation of each source. E is as near as possible
    to a frame without symmetry: the signs of eigenvectors are those of the processor's rounding.
    """
    rows = np.concatenate([effect.reshape(-1, effect.shape[-1]) for effect in effects])
    plane, angle = np.linalg.eigh(rows.T @ rows)[1][:, -2:], GOLDEN_ANGLE * np.arange(rows.shape[1])
    left, _, right = np.linalg.svd(plane.T @ np.column_stack([np.cos(angle), np.sin(angle)]))
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
        b = (sample.g @ plane) @ plane.T
        a = sample.g - b
        b /= np.linalg.norm(b, axis=1, keepdims=True)
        parts = [_quadratic(effect, a.T.copy(), b.T.copy()) for effect in effects]
        square, product, offset = (np.concatenate(blocks) for blocks in zip(*parts, strict=True))
        inverse = 1.0 / np.maximum(square, MIN_SQUARE)
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
            scipy.optimize.brentq(
                lambda at: np.log(fraction(at) / (1.0 - coverage)),
                BRACKET_SHRINKAGE * least,
                high,
                rtol=RELATIVE_TOLERANCE,
            )
        )
        fall = fraction(root * (1.0 - STEP)) - fraction(root * (1.0 + STEP))
        return max(root, least), relevant.beyond(root, row)[1] * 2.0 * STEP * root / fall

    def _relevant(self, bound: float, worst: int, fraction: float) -> tuple[Machines, int]:
        """The same without the poses at which, all together, almost no machine exceeds the bound.

        Also the row of the worst pose among the remaining ones.
        """
        over = exceedance(self.variances, bound)
        order = np.argsort(over)
        kept = np.union1d(order[np.cumsum(over[order]) > NEGLIGIBLE_FRACTION * fraction], [worst])
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


# Pose errors of machines over poses, to first order: a linear map of independent normal sources.
#
# A machine has one error per source and keeps it at every pose, so that its pose errors at different
# poses are dependent; the spread over machines at one pose needs the covariance there alone.


FieldRows = NDArray[np.int64]
EXCEEDANCE_TOLERANCE = 1e-9
"""Relative difference of two probabilities that counts as equal."""


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A pose error of c = 1, 2 or 3 components at poses: `effects` (poses, c, sources), per unit
    of each source.
    """

    effects: Array

    def at(self, poses: FieldRows | slice) -> Field:
        """The same error at some of the poses."""
        return Field(self.effects[poses])

    def variances(self, sigma: Array) -> Array:
        """Principal variances (n, poses, 3) over machines, of standard deviations (n, sources)."""
        poses, size, sources = self.effects.shape
        products = self.effects[:, :, None, :] * self.effects[:, None, :, :]
        covariance = sigma**2 @ products.reshape(-1, sources).T
        return principal(covariance.reshape(len(sigma), poses, size, size))


def worst_deviation(variances: Array) -> Array:
    """Largest root mean square length (n,) over poses, of principal variances (n, poses, 3)."""
    return np.asarray(np.sqrt(variances.sum(axis=-1).max(axis=-1)))


def worst_exceedance(variances: Array, bound: float) -> tuple[Array, FieldRows]:
    """Largest P(length > bound) (n,) over poses, and the pose (n,) where it is."""
    probabilities = exceedance(variances, bound)
    at = first_largest(probabilities)
    return probabilities[np.arange(len(probabilities)), at], at


def first_largest(over: Array) -> FieldRows:
    """The first pose (...) of the largest probability (..., poses): some poses are equal but for rounding."""
    least = np.max(over, axis=-1, keepdims=True) * (1.0 - EXCEEDANCE_TOLERANCE)
    return np.asarray(np.argmax(over >= least, axis=-1))


def worst_quantile(variances: Array, coverage: float) -> tuple[Array, FieldRows]:
    """Largest quantile (n,) of the length over poses, and the pose (n,) where it is.

    A pose has a larger quantile than another where its error exceeds the quantile of the other with
    a probability above 1 - coverage. The widest axis of all poses alone, half-normal, gives a lower
    bound of the worst quantile: only poses that exceed it too often are examined again.
    """
    rows, missed = np.arange(len(variances)), (1.0 - coverage) * (1.0 + EXCEEDANCE_TOLERANCE)
    axis = np.zeros((len(variances), 3))
    axis[:, 0] = variances[..., 0].max(axis=1)
    over = exceedance(variances, quantile(axis, coverage)[:, None])
    at = first_largest(over)
    while True:
        bound = quantile(variances[rows, at], coverage)
        remaining = over > missed
        remaining[rows, at] = False
        if not np.any(remaining):
            return bound, at
        over = np.zeros_like(over)
        over[remaining] = exceedance(variances[remaining], bound[np.nonzero(remaining)[0]])
        worst = first_largest(over)
        at = np.where(over[rows, worst] > missed, worst, at)


# Global sensitivity of the pose to its error sources, over the task ring.


Index = Literal["plane", "volume", "rms_plane", "rms_volume"]
INDICES: tuple[Index, ...] = ("plane", "volume", "rms_plane", "rms_volume")
"""Means over the rectangle in the rz plane (the document's), over the ring (weight r), and the
root mean squares of both."""
ORDER = 24
"""Nodes per axis of Gauss-Legendre quadrature, at first."""
FINEST = 192
"""Nodes per axis at most: an effect that changes its sign within the ring has a kink in its size,
on which the quadrature converges slowly."""
INDEX_TOLERANCE = 1e-3
"""Relative change by doubling the nodes at which an index counts as converged."""
GRID = 41
"""Nodes per axis of a grid of all poses."""


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Global indices of sources or combinations (m,), in the order of `names`.

    `squareness` sqrt(dth_r^2 + dth_t^2) and `yaw` |dth_z| [rad], `position` |dP| [m], each per
    metre or radian of the source. `error` is the largest relative change by the last doubling of
    the quadrature's `order`.
    """

    names: tuple[str, ...]
    squareness: Array
    yaw: Array
    position: Array
    error: float
    order: int

    def contributions(self, output: str, sigma: Array | float = 1.0) -> Array:
        """Contributions (m,) [percent] to the variance of `output` ("squareness", "yaw",
        "position") of sources with the standard deviations `sigma` (m,) [m, rad].
        """
        part = np.asarray(getattr(self, output) * sigma) ** 2
        total = part.sum()
        return 100.0 * part / total if total > 0.0 else np.zeros_like(part)


def quadrature(ring: TaskRing, index: Index, order: int = ORDER) -> tuple[Array, Array, Array]:
    """Gauss-Legendre nodes r, z [m] and weights (sum 1), each (order^2,), of a mean."""
    x, gauss = np.polynomial.legendre.leggauss(order)
    r, z = (lo + 0.5 * (hi - lo) * (x + 1.0) for lo, hi in (ring.r, ring.z))
    weight = np.outer(gauss * (r if index.endswith("volume") else 1.0), gauss)
    r, z = np.meshgrid(r, z, indexing="ij")
    return r.ravel(), z.ravel(), (weight / weight.sum()).ravel()


def grid(ring: TaskRing, count: int = GRID) -> tuple[Array, Array]:
    """Poses r, z (count^2,) [m] on a regular grid that includes the ring's edges."""
    r, z = np.meshgrid(np.linspace(*ring.r, count), np.linspace(*ring.z, count), indexing="ij")
    return r.ravel(), z.ravel()


def sensitivity(
    manipulator: Manipulator,
    ring: TaskRing,
    index: Index = "plane",
    combinations: Mapping[str, Combination] | None = None,
    order: int = ORDER,
) -> Sensitivity:
    """Indices of the `combinations`, or of all 63 sources; the order doubles until they are CLOSE.

    Raises OutOfReach.
    """
    names = NAMES if combinations is None else tuple(combinations)
    columns = None if combinations is None else matrix(combinations)
    coarse = _means(manipulator, ring, index, columns, max(1, order // 2))
    while True:
        fine = _means(manipulator, ring, index, columns, order)
        error = _change(fine, coarse)
        if error <= INDEX_TOLERANCE or 2 * order > FINEST:
            return Sensitivity(names, fine[0], fine[1], fine[2], error, order)
        coarse, order = fine, 2 * order


def _change(fine: Array, coarse: Array) -> float:
    """Largest relative change; values below rounding of the largest of their row count as zero."""
    floor = 1e-9 * fine.max(axis=1, keepdims=True)
    size = np.maximum(np.maximum(fine, floor), np.finfo(float).tiny)
    return float(np.max(np.abs(fine - coarse) / size))


def _means(manipulator: Manipulator, ring: TaskRing, index: Index, columns: Array | None, order: int) -> Array:
    """Means (3, m) of squareness, yaw and position."""
    r, z, weight = quadrature(ring, index, order)
    maps = first_order(manipulator, r, z)
    turn, move = maps.orientation, maps.position
    if columns is not None:
        turn, move = turn @ columns, move @ columns
    sizes = np.stack([np.hypot(turn[:, 0], turn[:, 1]), np.abs(turn[:, 2]), np.linalg.norm(move, axis=1)])
    if index.startswith("rms"):
        return np.sqrt(np.tensordot(sizes**2, weight, axes=(1, 0)))
    return np.tensordot(sizes, weight, axes=(1, 0))
