"""A value as a quadratic function of scales and shifts of processes, fitted to evaluations of it.

Reference: Box & Draper (1987), Empirical Model-Building and Response Surfaces, section 7.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array

SPARE = 2.5
"""Equations for each coefficient."""
FEWEST = 12
"""Evaluations at least."""


def evaluations(size: int, with_slopes: bool) -> int:
    """How many evaluations a fit in `size` coordinates takes."""
    count = SPARE * (1 + size + size * (size + 1) // 2)
    return max(FEWEST, int(np.ceil(count / (1 + size if with_slopes else 1))))


@dataclass(frozen=True, eq=False)
class Response:
    """The fitted function of x (n, d) in units of `unit` (d,); `rms` is the residual scatter of the
    values that it was fitted to.
    """

    coefficients: Array
    unit: Array
    rms: float

    @classmethod
    def of(cls, x: Array, values: Array, slopes: Array | None) -> Response:
        """Least squares of values (n,) at x (n, d), and of slopes (n, d) where they are known."""
        unit = np.maximum(np.std(x, axis=0), 1e-9)
        rows = _terms(x / unit)
        equations, right = [rows], [values]
        if slopes is not None:
            equations += [_slopes(x / unit, at) for at in range(x.shape[1])]
            right += list((slopes * unit).T)
        coefficients = np.linalg.lstsq(np.concatenate(equations), np.concatenate(right), rcond=None)[0]
        return cls(
            np.asarray(coefficients, dtype=np.float64),
            unit,
            float(np.sqrt(np.mean((rows @ coefficients - values) ** 2))),
        )

    def __call__(self, x: Array) -> Array:
        """Values (n,)."""
        return np.asarray(_terms(x / self.unit) @ self.coefficients)


def _terms(z: Array) -> Array:
    """1, z and all products of two, (n, 1 + d + d (d + 1)/2)."""
    pairs = np.triu_indices(z.shape[1])
    return np.hstack([np.ones((len(z), 1)), z, z[:, pairs[0]] * z[:, pairs[1]]])


def _slopes(z: Array, at: int) -> Array:
    """Their derivatives by one coordinate."""
    size = z.shape[1]
    first, second = np.triu_indices(size)
    plain = np.zeros((len(z), 1 + size))
    plain[:, 1 + at] = 1.0
    return np.hstack([plain, (first == at) * z[:, second] + (second == at) * z[:, first]])
