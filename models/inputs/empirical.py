"""Empirical input: the distribution of measured deviations."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...arrays import Array
from .distribution import Distribution, coarse


@dataclass(frozen=True, slots=True)
class Empirical(Distribution):
    """z with the piecewise linear quantile function through the sorted `values`.

    `values` are measured deviations from the mid-limit in half-widths, at least two of them
    distinct, in any order; they may lie beyond the limits. The i-th of n sorted values is the
    quantile at (i - 1)/(n - 1), so that 1/(n - 1) of the units is uniform between neighbours, and
    equal values are an atom. All moments are exact for this law. It has no tails beyond the sample,
    and less variance than its values, a third of theirs where there are only two.

    Reference: type 7 of Hyndman & Fan (1996), Sample quantiles in statistical packages, American
    Statistician 50(4), 361-365.
    """

    values: tuple[float, ...] = field(metadata={"low": -1e6, "high": 1e6})

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", tuple(float(value) for value in self.values))

    @property
    def support(self) -> tuple[float, float]:
        return min(self.values), max(self.values)

    @property
    def grain(self) -> float:
        return coarse(self)

    def faults(self) -> list[tuple[str, str]]:
        faults = Distribution.faults(self)
        if len(set(self.values)) < 2:
            faults.append(("values", "need at least two distinct deviations, in half-widths"))
        return faults

    def raw_moments(self, order: int) -> Array:
        x = np.sort(self.values)
        low, high = x[:-1], x[1:]
        moments = np.ones(order + 1)
        total = np.ones_like(low)  # sum of low^j high^(k-j), j = 0 .. k
        for k in range(1, order + 1):
            total = total * low + high**k
            moments[k] = np.mean(total) / (k + 1)
        return moments

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        x = np.sort(self.values)
        pieces = len(x) - 1
        at = np.clip(np.searchsorted(x, z, side="right") - 1, 0, pieces - 1)
        low, high = x[at], x[at + 1]
        end, width = np.clip(z, low, high), high - low
        fraction = np.where(width > 0.0, (end - low) / np.where(width > 0.0, width, 1.0), z >= low)
        moments, part = _piece(x[:-1], x[1:]), _piece(low, end)
        before = [np.concatenate([[0.0], np.cumsum(value)])[at] for value in moments]
        mass, first, second = (b + fraction * p for b, p in zip(before, part, strict=True))
        return mass / pieces, first / pieces, second / pieces

    def quantile(self, probability: Array) -> Array:
        x = np.sort(self.values)
        return np.asarray(np.interp(probability, np.linspace(0.0, 1.0, len(x)), x))


def _piece(low: Array, high: Array) -> tuple[Array, Array, Array]:
    """E[u^k] of a uniform u on [low, high], k = 0, 1, 2."""
    return np.ones_like(low), 0.5 * (low + high), (low * low + low * high + high * high) / 3.0
