"""The law of a linear stack of even deviations: yield and half-width without a sample."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, ndtri

from ...arrays import Array
from ..inputs import Normal
from ..propagation.even import Even, even_law
from ..propagation.symmetric_sum import SymmetricSum
from .made import Tolerances, mean_of, spread_of
from .mechanism import Mechanism

ROUNDING = 1e-12
"""Least stated error of a yield [percent]."""


@dataclass(frozen=True, eq=False)
class Law:
    """y = centre + sum_i S_i t (mean_i + d_i) of k pieces, d_i independent, even and log-concave.

    `slopes` (k,) are |S_i|, `mean` (p,) the shift of the mean of y per unit of each tolerance.
    Where all parts are normal (`covariance`, p x p, at t = 1) pieces may be correlated.
    Tolerances t have shape (n, p); derivatives are by the spread of parts that are `AsMade`.
    """

    mechanism: Mechanism
    slopes: Array
    mean: Array
    deviations: SymmetricSum
    laws: tuple[Even, ...]
    covariance: Array | None = None

    def yield_percent(self, t: Tolerances) -> tuple[Array, Array]:
        """Fraction of units within the limits (n,), in percent, and a bound of its error (n,)."""
        ends = self._ends(t)
        if self.covariance is None:
            (_, high), (_, low) = ends
            yields, error = self.deviations.within(self._scales(t), low, high)
        else:
            yields, error = np.zeros(len(t)), np.zeros(len(t))
            for sign, end in ends:
                below, _, doubt = self._below(t, end)
                yields, error = yields + sign * below, error + doubt
        return 100.0 * np.clip(yields, 0.0, 1.0), 100.0 * error + ROUNDING

    def half_width(self, t: Tolerances, coverage: float) -> Array:
        """Half the width (n,) of the interval that holds `coverage` of the units, centred."""
        p = 0.5 * (1.0 + coverage)
        if self.covariance is not None:
            return np.asarray(float(ndtri(p)) * self._std(t))
        return self.deviations.values(self._scales(t), p)

    def half_width_slopes(self, t: Tolerances, coverage: float) -> Array:
        """d half_width/dt, (n, p)."""
        p = 0.5 * (1.0 + coverage)
        if self.covariance is not None:
            std = self._std(t)[:, None]
            return float(ndtri(p)) * (spread_of(t) @ self.covariance) / np.where(std > 0.0, std, 1.0)
        return self._to_parts(self.deviations.quantile(self._scales(t), p).gradient)

    def yield_slopes(self, t: Tolerances) -> Array:
        """d yield_percent/dt, (n, p)."""
        by_part = np.zeros_like(spread_of(t))
        for sign, end in self._ends(t):
            slopes = self._below(t, end)[1] - self.density(t, end)[:, None] * self.mean
            by_part += 100.0 * sign * np.where(np.isfinite(end)[:, None], slopes, 0.0)
        return by_part

    def density(self, t: Tolerances, at: Array) -> Array:
        """Density (n,) of y minus its mean."""
        if self.covariance is None:
            safe = np.where(np.isfinite(at), at, 0.0)
            return np.where(np.isfinite(at), self.deviations.density(self._scales(t), safe), 0.0)
        std = self._std(t)
        safe = np.where(std > 0.0, std, 1.0)
        bell = np.exp(-0.5 * (at / safe) ** 2) / (safe * np.sqrt(2.0 * np.pi))
        return np.where(std > 0.0, bell, 0.0)

    def edge_density(self, t: Tolerances) -> Array:
        """Density (n,) of y at its limits, both together."""
        return np.asarray(sum(self.density(t, end) for _, end in self._ends(t)))

    def _ends(self, t: Tolerances) -> list[tuple[float, Array]]:
        """Sign and distance (n,) of each limit from the mean of y."""
        slope = np.bincount(self.mechanism.owners, self.mechanism.sensitivities, len(self.mean))
        mean = self.mechanism.centre + spread_of(t) @ self.mean + mean_of(t) @ slope
        return [(1.0, self.mechanism.upper - mean), (-1.0, self.mechanism.lower - mean)]

    def _below(self, t: Tolerances, at: Array) -> tuple[Array, Array, Array]:
        """P(y - mean <= at), its derivatives in t by the spread alone, and its error."""
        if self.covariance is None:
            far = np.where(np.isfinite(at), at, 0.0)
            probability, slopes, error = self.deviations.below(self._scales(t), far)
            below = np.where(np.isfinite(at), probability, (at > 0.0).astype(float))
            return below, self._to_parts(slopes), np.where(np.isfinite(at), error, 0.0)
        std = self._std(t)
        safe = np.where(std > 0.0, std, 1.0)
        x = np.where(std > 0.0, at / safe, np.where(at >= 0.0, np.inf, -np.inf))
        level = np.where(np.isfinite(x), x, 0.0)
        bell = -level * np.exp(-0.5 * level**2) / np.sqrt(2.0 * np.pi)
        rise = (spread_of(t) @ self.covariance) / safe[:, None] ** 2
        return np.asarray(ndtr(x)), bell[:, None] * rise, np.zeros(len(t))

    def _std(self, t: Tolerances) -> Array:
        assert self.covariance is not None
        s = spread_of(t)
        return np.asarray(np.sqrt(np.maximum(np.sum((s @ self.covariance) * s, axis=1), 0.0)))

    def _scales(self, t: Tolerances) -> Array:
        return np.asarray(spread_of(t)[:, self.mechanism.owners] * self.slopes)

    def _to_parts(self, by_piece: Array) -> Array:
        """Derivatives in t (n, p) from those in the scales of the pieces (n, k)."""
        parts = np.arange(len(self.mechanism.inputs))
        owner = (self.mechanism.owners[:, None] == parts) * self.slopes[:, None]
        return np.asarray(by_piece @ owner)


def law_of(mechanism: Mechanism, covariance: Array) -> Law | str:
    """The law, or why there is none in closed form; `covariance` (p, p) is that of y at t = 1."""
    if mechanism.formula is not None and not mechanism.formula.linear:
        return "the formula is not linear"
    mechanism = _relevant_pieces(mechanism)
    used = dict.fromkeys(mechanism.owner)
    even_laws = {}
    for at in used:
        law = even_law(mechanism.inputs[at])
        if law is None:
            return f"the deviations of {mechanism.names[mechanism.owner.index(at)]} are skewed or have poles"
        even_laws[at] = law
    normal = all(isinstance(mechanism.inputs[at], Normal) for at in used)
    if mechanism.correlation is not None and not normal:
        return "correlated deviations have no even law"
    owners = mechanism.owners
    parts = (owners == np.arange(len(mechanism.inputs))[:, None]).astype(float)
    mean = parts @ (mechanism.sensitivities * np.array([even_laws[at][0] for at in owners]))
    laws = tuple(even_laws[at][1] for at in owners)
    slopes = np.abs(mechanism.sensitivities)
    return Law(mechanism, slopes, mean, SymmetricSum(laws), laws, covariance if normal else None)


def _relevant_pieces(mechanism: Mechanism) -> Mechanism:
    """The mechanism with only the pieces that the requirement depends on."""
    used = np.flatnonzero(mechanism.sensitivities)
    if len(used) == len(mechanism.owner):
        return mechanism
    correlation = mechanism.correlation
    return replace(
        mechanism,
        names=tuple(mechanism.names[i] for i in used),
        owner=tuple(mechanism.owner[i] for i in used),
        sensitivities=mechanism.sensitivities[used],
        mids=None if mechanism.mids is None else mechanism.mids[used],
        scale=None if mechanism.scale is None else mechanism.scale[used],
        correlation=None if correlation is None else correlation[np.ix_(used, used)],
    )
