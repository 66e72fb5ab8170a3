"""The probability that the right one of two explanations fits better after further measurements.

Both are linearised about their fits. Each predicts a normal distribution of the new measurements:
the noise, and the uncertainty that the record leaves in its coefficients. The difference of the two
sums of squares is a quadratic form of the measurements; its distribution is sampled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize

from ....arrays import Array
from .rows import Predictions

MOST = 1e4
"""Largest multiple of the number of measurements for which a result is given."""
DRAWN = 2000
"""Number of samples of the new measurements."""


@dataclass(frozen=True)
class Duel:
    """Two explanations of the same new measurements, in the subspace of their predictions.

    `apart` (r,) is the difference of their predictions, `wide` (r, p) a root of the covariance of
    each that the record leaves open. `ahead` is by how much the first fits better already, the
    price of parameters included.
    """

    apart: Array
    wide: tuple[Array, Array]
    ahead: float

    @classmethod
    def of(cls, record: tuple[Predictions, Predictions], points: tuple[Predictions, Predictions], ahead: float) -> Duel:
        """The duel from both predictions at the record and at the new measurements, whitened."""
        wide = tuple(_open(old.columns, new.columns) for old, new in zip(record, points, strict=True))
        apart = points[0].values - points[1].values
        r = np.asarray(np.linalg.qr(np.column_stack([apart, *wide]), mode="r"))
        first = 1 + wide[0].shape[1]
        return cls(r[:, 0], (r[:, 1:first], r[:, first:]), ahead)

    def chance(self, times: float = 1.0, by: float = 0.0) -> float:
        """The probability that the right one ends up ahead by more than `by`, with `times` the
        measurements; the prior probability of each follows from its fit.
        """
        prior = 1.0 / (1.0 + np.exp(-0.5 * np.clip(self.ahead, -60.0, 60.0)))
        return float(prior * self._ahead(times, by, 0, 1) + (1.0 - prior) * self._ahead(times, by, 1, 0))

    def _ahead(self, times: float, by: float, right: int, wrong: int) -> float:
        """The probability that `right`, if it is true, ends up ahead."""
        covariances = [np.eye(len(self.apart)) + times * self.wide[k] @ self.wide[k].T for k in (right, wrong)]
        right_root, wrong_root = (linalg.cholesky(covariance, lower=True) for covariance in covariances)
        draws = np.random.default_rng(0).standard_normal((len(self.apart), DRAWN))
        sign = 1.0 if right == 0 else -1.0
        apart = sign * np.sqrt(times) * self.apart[:, None]
        of_wrong = linalg.solve_triangular(wrong_root, apart + right_root @ draws, lower=True)
        gained = np.sum(of_wrong**2, axis=0) - np.sum(draws**2, axis=0)
        return float(np.mean(gained + sign * self.ahead > by))

    def times_until(self, chance: float) -> float:
        """The multiple of the measurements for that probability; inf where none suffices."""
        if self.chance(MOST) < chance:
            return float("inf")
        least = next((k for k in (1.0 / MOST, 1.0) if self.chance(k) < chance), None)
        if least is None:
            return 1.0 / MOST
        ends = (np.log(least), np.log(MOST))
        power = optimize.brentq(lambda power: self.chance(float(np.exp(power))) - chance, *ends, xtol=1e-3)
        return float(np.exp(power))


def _open(record: Array, new: Array) -> Array:
    """New columns (n, p) times a root of the covariance of their coefficients given the record."""
    size = np.sqrt(np.sum(record**2, axis=0) + np.sum(new**2, axis=0))
    kept = size > 0.0
    if not kept.any():
        return np.zeros((len(new), 0))
    scaled = record[:, kept] / size[kept]
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    root = vectors / np.sqrt(np.maximum(values, 1e-10))
    return np.asarray((new[:, kept] / size[kept]) @ root)
