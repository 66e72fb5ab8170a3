"""The discrimination of two explanations by measurements at some points and those of the record.

The criterion is that of T-optimality: the squared norm of the residual of the one prediction after
a refit of the other. Reference: Atkinson & Fedorov, Biometrika 62, 1975.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....arrays import Array
from .rows import Predictions

RIDGE = 1e-10
"""Fraction of a column's square that keeps a fit regular."""
Chosen = NDArray[np.int64]


@dataclass(frozen=True)
class Contest:
    """An explanation against a rival, in noise units. `gram` (p, p), `cross` (p,) and `square` are
    the rival's normal equations at the record; `residual` (C, k) is the residual of the explanation
    given the rival at C candidates of k measurements, `columns` (C, k, p) are the rival's.
    """

    gram: Array
    cross: Array
    square: float
    residual: Array
    columns: Array

    @classmethod
    def of(
        cls, record: tuple[Predictions, Predictions], points: tuple[Predictions, Predictions], count: int
    ) -> Contest:
        """The contest from both predictions at the record and at candidates of `count` measurements,
        all whitened; the rows of a candidate are adjacent.
        """
        explanation, rival = record
        square = np.sum(rival.columns**2, axis=0) + np.sum(points[1].columns ** 2, axis=0)
        kept = square > 0.0
        scale = 1.0 / np.sqrt(square[kept])
        x, new = rival.columns[:, kept] * scale, points[1].columns[:, kept] * scale
        y = explanation.values - rival.values
        start, *_ = np.linalg.lstsq(x, y, rcond=1e-9)
        y, residual = y - x @ start, points[0].values - points[1].values - new @ start
        return cls(
            gram=x.T @ x + RIDGE * np.eye(len(scale)),
            cross=x.T @ y,
            square=float(y @ y),
            residual=residual.reshape(-1, count),
            columns=new.reshape(-1, count, len(scale)),
        )

    def level(self, chosen: Chosen) -> tuple[float, Array, Array]:
        """Discrimination with these candidates, the rival's coefficients (p,), and the inverse
        (p, p) of its normal equations.
        """
        x = self.columns[chosen].reshape(-1, self.columns.shape[2])
        y = self.residual[chosen].ravel()
        inverse = np.asarray(np.linalg.inv(self.gram + x.T @ x), dtype=np.float64)
        cross = self.cross + x.T @ y
        coefficients = inverse @ cross
        return max(self.square + float(y @ y) - float(cross @ coefficients), 0.0), coefficients, inverse

    def with_each(self, chosen: Chosen) -> Array:
        """Discrimination (C,) with these candidates and each one in addition."""
        level, coefficients, inverse = self.level(chosen)
        residual = self.residual - self.columns @ coefficients
        spread = self.columns @ inverse
        if residual.shape[1] == 1:
            lever = np.einsum("ckp,ckp->c", spread, self.columns)
            return np.asarray(level + residual[:, 0] ** 2 / (1.0 + lever))
        covariance = np.eye(residual.shape[1]) + spread @ np.swapaxes(self.columns, 1, 2)
        solved = np.linalg.solve(covariance, residual[..., None])[..., 0]
        return np.asarray(level + np.einsum("ck,ck->c", residual, solved))
