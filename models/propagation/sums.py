"""The sum of independent inputs that is propagated, the interface of a propagation method, and its results:
estimates, each with the error that its method states.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from math import comb
from typing import Any

import numpy as np

from ...section import Array
from ..inputs import Distribution


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value per design and its stated numerical (or standard) error, both of shape (n,)."""

    value: Array
    error: Array


@dataclass(frozen=True, slots=True)
class Propagated:
    """Statistics of a `ClippedSum` over the units built to each of n designs.

    `geometric_mean`, `geometric_std` are exact in every method. `mean`, `std` and `quantile` (at
    the one-sided coverage) are those of the effective value, `conforming` is the probability that
    it does not exceed the limit, `negative` the probability that the clipped part is below zero.
    """

    geometric_mean: Array
    geometric_std: Array
    mean: Estimate
    std: Estimate
    quantile: Estimate
    conforming: Estimate
    negative: Estimate


def join_propagated(parts: list[Propagated]) -> Propagated:
    """The results of consecutive blocks of designs, joined."""
    return Propagated(*(_join_estimates([getattr(part, field.name) for part in parts]) for field in fields(Propagated)))


def _join_estimates(pieces: list[Any]) -> Any:
    if not isinstance(pieces[0], Estimate):
        return np.concatenate(pieces)
    value, error = (np.concatenate(arrays) for arrays in zip(*((p.value, p.error) for p in pieces), strict=True))
    return Estimate(value, error)


# The propagated sum of independent inputs, a part of which cannot go below zero.


@dataclass(frozen=True, slots=True)
class Term:
    """An independent contribution constant + linear z + quadratic z^2, z ~ `distribution`.

    The three coefficients have shape (n,): a value per design. Unit: that of the sum.
    """

    distribution: Distribution
    constant: Array
    linear: Array
    quadratic: Array | None = None

    def rows(self, chosen: slice) -> Term:
        """The same contribution for some of the designs."""
        bent = None if self.quadratic is None else self.quadratic[chosen]
        return replace(self, constant=self.constant[chosen], linear=self.linear[chosen], quadratic=bent)

    def cumulants(self) -> Array:
        """First four cumulants, shape (4, n)."""
        if self.quadratic is None:
            scale = self.linear ** np.arange(1, 5)[:, None]
            cumulants = scale * cumulants_of(self.distribution.raw_moments(4)[1:])[:, None]
        else:
            cumulants = cumulants_of(self._centred_raw_moments(self.quadratic))
        cumulants[0] += self.constant
        return cumulants

    def _centred_raw_moments(self, quadratic: Array) -> Array:
        """E[(linear z + quadratic z^2)^k], k = 1..4, shape (4, n), by the binomial theorem."""
        m = self.distribution.raw_moments(8)
        return np.array(
            [
                sum(comb(k, j) * self.linear ** (k - j) * quadratic**j * m[k + j] for j in range(k + 1))
                for k in range(1, 5)
            ]
        )

    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper end of the contribution, each (n,)."""
        low, high = self.distribution.support
        at = [self._value(low), self._value(high)]
        if self.quadratic is not None:
            safe = np.where(self.quadratic == 0.0, 1.0, self.quadratic)
            vertex = np.where(self.quadratic == 0.0, 0.0, -0.5 * self.linear / safe)
            at.append(self._value(np.clip(vertex, low, high)))
        return np.min(at, axis=0), np.max(at, axis=0)

    def _value(self, z: float | Array) -> Array:
        bent = 0.0 if self.quadratic is None else self.quadratic * z * z
        return self.constant + self.linear * z + bent


@dataclass(frozen=True, slots=True)
class ClippedSum:
    """X = sum(free) + max(0, sum(clipped)) of independent terms, for n designs at once.

    `sum(free) + sum(clipped)` is the geometric value, X the effective one; a negative clipped part
    is interference (preload), not play.
    """

    free: tuple[Term, ...]
    clipped: tuple[Term, ...]

    def shifted(self, by: float) -> ClippedSum:
        """The sum with `by` added to its clipped part."""
        first, *rest = self.clipped
        return ClippedSum(self.free, (replace(first, constant=first.constant + by), *rest))

    def freed(self, by: Array) -> ClippedSum:
        """The sum with `by` (n,) added to its free part."""
        first, *rest = self.free
        return ClippedSum((replace(first, constant=first.constant + by), *rest), self.clipped)

    @property
    def size(self) -> int:
        """Number of designs n."""
        return len(self.clipped[0].constant)

    def rows(self, chosen: slice) -> ClippedSum:
        """The same sum for some of the designs."""
        return ClippedSum(
            tuple(term.rows(chosen) for term in self.free), tuple(term.rows(chosen) for term in self.clipped)
        )


def total_cumulants(terms: tuple[Term, ...]) -> Array:
    """First four cumulants of a sum of independent terms, shape (4, n)."""
    return np.asarray(np.sum([term.cumulants() for term in terms], axis=0))


def cumulants_of(raw: Array) -> Array:
    """Cumulants k1..k4 from raw moments E[x^1..4], both of shape (4, ...)."""
    m1, m2, m3, m4 = raw
    variance = m2 - m1**2
    third = m3 - 3.0 * m1 * m2 + 2.0 * m1**3
    fourth = m4 - 4.0 * m1 * m3 - 3.0 * m2**2 + 12.0 * m1**2 * m2 - 6.0 * m1**4
    return np.array([m1, variance, third, fourth])


# The interface of a propagation method.


class Propagation(ABC):
    """Propagates the spread of the inputs to that of a `ClippedSum`."""

    @property
    @abstractmethod
    def block(self) -> int:
        """Designs computed at once, so that the working set stays in the cache."""

    @abstractmethod
    def _propagate(self, total: ClippedSum, coverage: float, limit: float) -> Propagated:
        """`propagate` for a block of designs."""

    def propagate(self, total: ClippedSum, coverage: float, limit: float) -> Propagated:
        """Statistics of `total` for its n designs.

        `coverage` is the one-sided probability of the quantile, in (0, 1); `limit` is the value
        that conforming units do not exceed, in the unit of the sum.
        """
        starts = range(0, total.size, self.block)
        return join_propagated(
            [self._propagate(total.rows(slice(at, at + self.block)), coverage, limit) for at in starts]
        )
