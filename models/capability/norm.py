"""The standard deviation in an assured allocation: a norm of the tolerances.

Of squares v_j = (a_j t_j)^2 of independent parts, E_j the posterior mean of a variance over its
estimate, G_j its upper confidence limit less that,

    h^2 = sum E_j v_j + sqrt( sum (G_j v_j)^2 + (sum M_j v_j)^2 )

(modified large-sample limit of a sum of variances, by posterior moments). Each sum over v is a norm
of v >= 0 that rises with every v_j, and so is sqrt(sum of squares) of such norms; the root of one,
as a function of t, is its 2-convexification and a norm again: h is convex and homogeneous.

At one limit with the mean's error c = z sqrt(sum v_j/n_j)/K and a^2 = sum E_j v_j,

    h = a + sqrt( (sqrt(a^2 + N) - a)^2 + c^2 ),    N = sqrt( sum (G_j v_j)^2 )

It is the largest of a (1 - cos f) + sqrt(a^2 + N) cos f + c sin f for f from 0 to 90 degrees, each
a sum of norms: a norm again.

Reference: Graybill & Wang (1980), Confidence intervals on nonnegative linear combinations of
variances, J. American Statistical Association 75(372), 869-873; Lindenstrauss & Tzafriri (1979),
Classical Banach Spaces II, section 1.d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.special import ndtri

from ...arrays import Array
from .knowledge import Knowledge


@dataclass(frozen=True, slots=True, eq=False)
class Surplus:
    """What uncertainty adds to a sum a^2 of squares v (..., f) under a root.

    N = sqrt( sum_j (own_j v_j)^2 + fixed_own^2 + (sum_j shared_j v_j + fixed_shared)^2 ) between
    two limits. At one limit, where the mean's error counts in full, `error` is given and it is
    (a + H)^2 - a^2, H = sqrt(b^2 + c^2), b = sqrt(a^2 + N) - a, c^2 = sum_j error_j v_j +
    fixed_error, a^2 = sum_j v_j + fixed_even. `own`, `shared` and `error` (f,) belong to the
    squares that vary.
    """

    own: Array
    shared: Array
    fixed_own: float = 0.0
    fixed_shared: float = 0.0
    error: Array | None = None
    fixed_error: float = 0.0
    fixed_even: Array | float = 0.0

    @property
    def convex(self) -> bool:
        """Whether it is convex in the squares; the root is convex in the tolerances in any case."""
        return self.error is None

    def value(self, square: Array) -> tuple[Array, Array]:
        """The surplus (...,) at squares (..., f), and its derivatives by them (..., f)."""
        own_terms = self.own * square
        shared = np.sum(square * self.shared, axis=-1) + self.fixed_shared
        value = np.sqrt(np.sum(own_terms**2, axis=-1) + self.fixed_own**2 + shared**2)
        safe = np.where(value > 0.0, value, 1.0)[..., None]
        rise = (own_terms * self.own + shared[..., None] * self.shared) / safe
        return (value, rise) if self.error is None else self._at_one_limit(square, value, rise)

    def _at_one_limit(self, square: Array, value: Array, rise: Array) -> tuple[Array, Array]:
        """The same with the error of the mean, from N (...,) and its derivatives."""
        assert self.error is not None
        a = np.sqrt(np.sum(square, axis=-1) + self.fixed_even)
        root = np.sqrt(a**2 + value)
        b, c = root - a, np.sqrt(np.sum(square * self.error, axis=-1) + self.fixed_error)
        both = np.hypot(b, c)
        by_a, by_root, by_c = (0.5 * _inverse(size)[..., None] for size in (a, root, c))
        by_b = (1.0 + rise) * by_root - by_a
        slope = (b[..., None] * by_b + c[..., None] * self.error * by_c) * _inverse(both)[..., None]
        far = (a + both)[..., None]
        return both * (2.0 * a + both), 2.0 * (by_a * both[..., None] + far * slope)


def _inverse(value: Array) -> Array:
    """1/value, and 0 for 0."""
    return np.divide(1.0, value, out=np.zeros_like(value), where=value > 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Norm:
    """h by parts: `even` (p,) are E_j, `own` G_j and `shared` M_j, each times (a_j/t_j)^2.

    For parts made by several processes all may be (n, p), a row for each design. At one limit
    `error` is the weight of the square of the mean's error in h.
    """

    even: Array
    own: Array
    shared: Array
    error: Array | None = None

    def value(self, t: Array, rest: Array | float = 0.0) -> Array:
        """h (n,) of tolerances (n, p), in addition to a known variance `rest` (n,)."""
        square = t**2 * self.even
        more = self.surplus(rest).value(square)[0]
        return np.asarray(np.sqrt(np.sum(square, axis=1) + rest + more))

    def slopes(self, t: Array) -> Array:
        """dh/dt, (n, p); 0 where nothing scatters."""
        square, value = t**2 * self.even, self.value(t)[:, None]
        rise = t * self.even * (1.0 + self.surplus().value(square)[1])
        return np.divide(rise, value, out=np.zeros_like(t), where=value > 0.0)

    def surplus(self, rest: Array | float = 0.0) -> Surplus:
        """What uncertainty adds, as a function of the squares E v."""
        error = None if self.error is None else over(self.error, self.even)
        return Surplus(over(self.own, self.even), over(self.shared, self.even), error=error, fixed_even=rest)


def over(value: Array, by: Array, otherwise: float = 0.0) -> Array:
    """value/by, and `otherwise` where `by` is 0."""
    return np.divide(value, by, out=np.full_like(value, otherwise), where=by > 0.0)


def factor_of(df: Array, level: float) -> Array:
    """G of the limit without posterior moments: an upper limit over its estimate, less 1."""
    finite = np.isfinite(df)
    safe = np.where(finite, df, 1.0)
    limit = safe / scipy.stats.chi2.ppf(1.0 - level, safe) - 1.0
    return np.asarray(np.where(finite, np.maximum(limit, 0.0), 0.0))


def norm_of(
    known: Sequence[Knowledge | None],
    square: Array,
    moved: Array,
    confidence: float,
    level: float | None = None,
    quantile: float | None = None,
) -> Norm:
    """The norm of parts with the processes `known`, None for one without uncertainty.

    `square` (p,) is the variance that each adds to the requirement at t = 1, `moved` (p,) by how
    much that rises with the square of its mean's error: (sum of slopes)^2, in units of variances.
    M differs from 0 only for parts with a stated prior: without one the uncertainty of the variance
    outweighs that of the mean. With a `level` the limit is that of the estimates (E = 1): among
    alternatives it matters how often the choice is kept, not the moments of a single process.

    Between two limits the error of the mean counts by the variance that it adds (Howe 1969). At one
    limit alone, `quantile` standard deviations from it, it counts in full in addition to the
    uncertainty of the variance: as the root of the sum of both squares.
    """
    inflation = np.array([1.0 if knowledge is None or level else knowledge.inflation for knowledge in known])
    surplus = np.array([_surplus(knowledge, confidence, level) for knowledge in known])
    error = moved * np.array([0.0 if knowledge is None else 1.0 / knowledge.n for knowledge in known])
    if quantile is not None:
        counted = (float(ndtri(confidence)) / quantile) ** 2
        return Norm(inflation * square, surplus * square, np.zeros_like(square), counted * inflation * error)
    prior = np.array([knowledge is not None and knowledge.prior_parts > 0.0 for knowledge in known], dtype=float)
    far = float(ndtri(0.5 * (1.0 + confidence))) ** 2 - 1.0
    return Norm(inflation * (square + error), surplus * (square + error), prior * far * inflation * error)


def _surplus(knowledge: Knowledge | None, confidence: float, level: float | None) -> float:
    """The upper limit of a variance less its posterior mean, or less its estimate."""
    if knowledge is None:
        return 0.0
    if level is None:
        return knowledge.surplus_at(confidence)
    return knowledge.surplus_at(level) + knowledge.inflation - 1.0
