"""The standard deviation that an assured allocation reckons with: a norm of the tolerances.

Of squares v_j = (a_j t_j)^2 of independent parts, E_j the posterior mean of a variance over its
estimate, G_j its upper confidence limit less that,

    h^2 = sum E_j v_j + sqrt( sum (G_j v_j)^2 + (sum M_j v_j)^2 )

(modified large-sample limit of a sum of variances, by posterior moments). Each sum over v is a norm
of v >= 0 that rises with every v_j, and so is sqrt(sum of squares) of such norms; the root of one,
as a function of t, is its 2-convexification and a norm again: h is convex and homogeneous.

Reference: Graybill & Wang (1980), Confidence intervals on nonnegative linear combinations of
variances, J. American Statistical Association 75(372), 869-873; Lindenstrauss & Tzafriri (1979),
Classical Banach Spaces II, section 1.d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import ndtri

from .knowledge import Knowledge

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Surplus:
    """sqrt( sum_j (own_j v_j)^2 + fixed_own^2 + (sum_j shared_j v_j + fixed_shared)^2 ) of squares.

    `own` and `shared` (f,) are of the squares v (..., f) that vary; what is fixed is a number.
    """

    own: Array
    shared: Array
    fixed_own: float = 0.0
    fixed_shared: float = 0.0

    def value(self, square: Array) -> tuple[Array, Array]:
        """The surplus (...,) at squares (..., f), and its derivatives by them (..., f)."""
        each = self.own * square
        shared = np.sum(square * self.shared, axis=-1) + self.fixed_shared
        value = np.sqrt(np.sum(each**2, axis=-1) + self.fixed_own**2 + shared**2)
        safe = np.where(value > 0.0, value, 1.0)[..., None]
        return value, (each * self.own + shared[..., None] * self.shared) / safe


@dataclass(frozen=True, slots=True, eq=False)
class Norm:
    """h by parts: `even` (p,) are E_j, `own` G_j and `shared` M_j, each times (a_j/t_j)^2.

    Of parts by several processes all may be (n, p), a row for each design.
    """

    even: Array
    own: Array
    shared: Array

    def value(self, t: Array) -> Array:
        """h (n,) of tolerances (n, p)."""
        square = t**2
        even = np.sum(square * self.even, axis=1)
        return np.asarray(np.sqrt(even + self._surplus.value(square)[0]))

    def slopes(self, t: Array) -> Array:
        """dh/dt, (n, p); 0 where nothing scatters."""
        square, value = t**2, self.value(t)[:, None]
        rise = t * (self.even + self._surplus.value(square)[1])
        return np.divide(rise, value, out=np.zeros_like(t), where=value > 0.0)

    @property
    def _surplus(self) -> Surplus:
        return Surplus(self.own, self.shared)


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
) -> Norm:
    """The norm of parts whose processes are known as `known`, None where without doubt.

    `square` (p,) is the variance that each adds to the requirement at t = 1, `moved` (p,) by how
    much that rises with the square of its mean's error: (sum of slopes)^2, in units of variances.
    M is there only for parts with a stated prior: without one the doubt of the variance outweighs
    that of the mean. With a `level` of its own the limit is that of the estimates (E = 1): among
    alternatives no moment of one process is what counts, but how often the choice is kept.
    """
    inflation = np.array([1.0 if one is None or level else one.inflation for one in known])
    surplus = np.array([0.0 if one is None else one.surplus_at(confidence) if level is None
                        else one.surplus_at(level) + one.inflation - 1.0 for one in known])  # fmt: skip
    error = moved * np.array([0.0 if one is None else 1.0 / one.n for one in known])
    prior = np.array([one is not None and one.prior_parts > 0.0 for one in known], dtype=float)
    far = float(ndtri(0.5 * (1.0 + confidence))) ** 2 - 1.0
    return Norm(inflation * (square + error), surplus * (square + error),
                prior * far * inflation * error)  # fmt: skip
