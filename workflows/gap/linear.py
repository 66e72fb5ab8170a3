"""Linear algebra of whitened columns, many small groups of them at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ...models.inputs.distribution import Array

GONE = 1e-7
"""Share of a column's square below which nothing of it is left beside others."""


def basis(columns: Array) -> Array:
    """An orthonormal basis (N, r) of what columns (N, k) span."""
    size = np.linalg.norm(columns, axis=0)
    kept = columns[:, size > 0] / size[size > 0]
    if kept.shape[1] == 0:
        return np.zeros((len(columns), 0))
    q, r, _ = linalg.qr(kept, mode="economic", pivoting=True)
    return np.ascontiguousarray(q[:, np.abs(np.diag(r)) > np.sqrt(GONE)], dtype=np.float64)


def beside(columns: Array, q: Array) -> Array:
    """What is left of columns (N, ...) beside an orthonormal basis (N, r)."""
    return columns - q @ (q.T @ columns)


@dataclass(frozen=True)
class Groups:
    """Columns (N, C) in groups that are fitted together; `starts` (g,), where each one begins.

    `one_sided` (g,) are single columns whose coefficient cannot be negative.
    """

    columns: Array
    starts: NDArray[np.int64]
    one_sided: NDArray[np.bool_]

    @property
    def sizes(self) -> NDArray[np.int64]:
        """Columns of each group."""
        return np.diff(np.append(self.starts, self.columns.shape[1]))

    def of(self, group: int) -> Array:
        """The columns (N, m) of one group."""
        start = int(self.starts[group])
        return self.columns[:, start : start + int(self.sizes[group])]

    def some(self, groups: NDArray[np.int64]) -> Groups:
        """Only these groups."""
        parts = [np.arange(s, s + m) for s, m in
                 zip(self.starts[groups], self.sizes[groups], strict=True)]  # fmt: skip
        sizes = self.sizes[groups]
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
        at = np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)
        return Groups(self.columns[:, at], starts if len(groups) else at, self.one_sided[groups])

    def orthonormal(self, q: Array) -> Groups:
        """The groups beside a basis (N, r), the columns of each made orthonormal.

        A gain is then the sum of the squares of a group's products with a residual. What nothing is
        left of becomes zero. The sign of single columns stays.
        """
        before = np.einsum("ij,ij->j", self.columns, self.columns)
        left = beside(self.columns, q)
        for size in np.unique(self.sizes):
            at = self.starts[self.sizes == size][:, None] + np.arange(size)
            left[:, at.ravel()] = _each_orthonormal(left, before, at)
        return Groups(left, self.starts, self.one_sided)

    def gains(self, residuals: Array) -> Array:
        """Gain (g,) or (g, S) of each group for residuals (N,) or (N, S); groups orthonormal."""
        z = self.columns.T @ residuals
        lone = self.starts[self.one_sided]
        z[lone] = np.maximum(z[lone], 0.0)
        return np.asarray(np.add.reduceat(z * z, self.starts, axis=0))


def _each_orthonormal(left: Array, before: Array, at: NDArray[np.int64]) -> Array:
    """Columns (N, g m) of the groups `at` (g, m), each group orthonormal."""
    count, size = at.shape
    if size == 1:
        square = np.einsum("ij,ij->j", left[:, at[:, 0]], left[:, at[:, 0]])
        good = square > GONE * np.maximum(before[at[:, 0]], 1e-300)
        return np.asarray(
            left[:, at[:, 0]] * np.where(good, 1.0 / np.sqrt(np.where(good, square, 1.0)), 0.0)
        )
    scale = np.sqrt(np.maximum(before[at], 1e-300))
    blocks = np.moveaxis(left[:, at] / scale, 1, 0)  # (g, N, m)
    gram = np.matmul(np.swapaxes(blocks, 1, 2), blocks)
    values, vectors = np.linalg.eigh(gram)
    good = values > GONE
    turned = vectors * np.where(good, 1.0 / np.sqrt(np.where(good, values, 1.0)), 0.0)[:, None, :]
    return np.asarray(np.moveaxis(blocks @ turned, 0, 1).reshape(len(left), count * size))


def joined(parts: list[Array], one_sided: list[bool], rows: int = 0) -> Groups:
    """Groups from their columns (N, m) each; of none, N is `rows`."""
    ends = np.cumsum([0, *(part.shape[1] for part in parts)], dtype=np.int64)
    columns = np.hstack(parts) if parts else np.zeros((rows, 0))
    return Groups(columns, ends[: len(parts)], np.array(one_sided, dtype=bool))
