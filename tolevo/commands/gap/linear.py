"""Linear algebra of whitened columns, many small groups of them at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from ...section import Array, Item

GONE = 1e-7
"""Fraction of a column's square below which it lies in the span of others."""
TIE = 1e-6
"""Fraction of a gain, or of 1, that may be rounding: columns that others nearly span, up to `GONE`, amplify it."""


def ranking(merits: Sequence[float] | Array) -> NDArray[np.int64]:
    """The order of merits (n,), the largest first; of those that differ by rounding alone the first one precedes."""
    values = np.asarray(merits, dtype=float)
    order = np.argsort(-values, kind="stable")
    high, low = values[order][:-1], values[order][1:]
    lower = low < high - TIE * np.maximum(np.abs(high), 1.0)
    ranks = np.concatenate([[0], np.cumsum(lower)])[: len(order)]
    return np.asarray(order[np.lexsort((order, ranks))])


def ranked(items: Sequence[Item], merit: Callable[[Item], float]) -> list[Item]:
    """The items in the `ranking` of their merits."""
    return [items[k] for k in ranking([merit(item) for item in items])]


def basis(columns: Array) -> Array:
    """An orthonormal basis (N, r) of what columns (N, k) span but for the directions in which they hardly reach.

    By singular values: of nearly dependent columns, a rounding would decide which of them a factorisation drops.
    """
    size = np.linalg.norm(columns, axis=0)
    u, reach, _ = scipy.linalg.svd(columns[:, size > 0] / size[size > 0], full_matrices=False)
    return np.ascontiguousarray(u[:, reach > np.sqrt(GONE)], dtype=np.float64)


def project_out(columns: Array, q: Array) -> Array:
    """The part of columns (N, ...) that is orthogonal to an orthonormal basis (N, r)."""
    return columns - q @ (q.T @ columns)


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def unit(columns: Array) -> Array:
    """Columns (N, k) of unit length, but for those that are 0."""
    return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))


def whitening(gram: Array) -> Array:
    """T (..., k, k) such that Z T' is orthonormal, of columns Z of unit length with products Z' Z;
    rows of dependent directions are 0.
    """
    values, vectors = np.linalg.eigh(gram)
    root = np.where(values > GONE, 1.0 / np.sqrt(np.maximum(values, GONE)), 0.0)
    return np.asarray(np.swapaxes(vectors * root[..., None, :], -1, -2))


class Whitening(Protocol):
    """A noise, or the space of several."""

    def whiten(self, columns: Array) -> Array:
        """Columns (N, m) such that the noise in them is independent with variance 1."""
        ...


@dataclass(frozen=True)
class Block:
    """Groups of one size m: which ones (g,), their columns (g, m), and the products (g, m, m)."""

    groups: NDArray[np.int64]
    at: NDArray[np.int64]
    gram: Array


@dataclass(frozen=True)
class Groups:
    """Columns (N, C) in groups that are fitted together; `starts` (g,) are their first columns.

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
        parts = [np.arange(s, s + m) for s, m in zip(self.starts[groups], self.sizes[groups], strict=True)]
        sizes = self.sizes[groups]
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
        at = np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)
        return Groups(self.columns[:, at], starts if len(groups) else at, self.one_sided[groups])

    def orthonormal(self, q: Array) -> Groups:
        """The groups orthogonal to a basis (N, r), the columns of each made orthonormal.

        A gain is then the sum of the squares of a group's products with a residual. Columns within
        the basis become zero. The sign of single columns stays.
        """
        before = np.einsum("ij,ij->j", self.columns, self.columns)
        remaining = project_out(self.columns, q)
        for size in np.unique(self.sizes):
            at = self.starts[self.sizes == size][:, None] + np.arange(size)
            remaining[:, at.ravel()] = _each_orthonormal(remaining, before, at)
        return Groups(remaining, self.starts, self.one_sided)

    def white(self, space: Whitening) -> Groups:
        """The groups, their columns whitened."""
        return Groups(space.whiten(self.columns), self.starts, self.one_sided)

    def part(self, first: int, last: int) -> Groups:
        """Groups from `first` to before `last`, their columns not copied."""
        if (first, last) not in self._parts:
            ends = np.append(self.starts, self.columns.shape[1])
            columns, starts = self.columns[:, ends[first] : ends[last]], self.starts[first:last] - ends[first]
            self._parts[first, last] = Groups(columns, starts, self.one_sided[first:last])
        return self._parts[first, last]

    @cached_property
    def _parts(self) -> dict[tuple[int, int], Groups]:
        return {}

    @cached_property
    def _blocks(self) -> tuple[Block, ...]:
        """The groups by size, with the products of their columns."""
        sizes = self.sizes
        blocks = []
        for size in np.unique(sizes):
            which = np.flatnonzero(sizes == size)
            at = self.starts[which][:, None] + np.arange(size)
            blocks.append(Block(which, at, _grams(self.columns, at)))
        return tuple(blocks)

    def grams(self, rows: slice | NDArray[np.int64] = slice(None)) -> list[Array]:
        """Products (g, m, m) of each group's columns in some rows, by the size m of the groups."""
        return [_grams(self.columns[rows], block.at) for block in self._blocks]

    def conditional_gains(self, projected: Array, products: Array, grams: Sequence[Array] | None = None) -> Array:
        """Gain (..., g) of each group given an orthonormal basis Q (N, r).

        The residual is orthogonal to Q.

        `projected` (..., r, C) are Q' X and `products` (..., C) the columns' products with the
        residual; `grams` (..., g, m, m) those of each group's columns by size, otherwise of all
        rows. The columns themselves are not used: their parts orthogonal to Q follow from their
        products.
        """
        gains = np.zeros((*products.shape[:-1], len(self.starts)))
        block_grams = [block.gram for block in self._blocks] if grams is None else grams
        for block, gram in zip(self._blocks, block_grams, strict=True):
            p = projected[..., block.at]
            remaining = gram - np.einsum("...rgm,...rgk->...gmk", p, p)
            gains[..., block.groups] = _gains_of(gram, remaining, products[..., block.at], self.one_sided[block.groups])
        return gains

    def gains(self, residuals: Array) -> Array:
        """Gain (g,) or (g, S) of each group for residuals (N,) or (N, S); groups orthonormal."""
        z = self.columns.T @ residuals
        lone = self.starts[self.one_sided]
        z[lone] = np.maximum(z[lone], 0.0)
        return np.asarray(np.add.reduceat(z * z, self.starts, axis=0))


@dataclass(frozen=True)
class ConditionalGroups:
    """Gains of groups given columns Z of unit length, by products alone: `turned` (..., k, k) makes
    Z orthonormal, `record` (..., k) are then its products with a record.
    """

    turned: Array
    record: Array

    @classmethod
    def of(cls, gram: Array, record: Array) -> ConditionalGroups:
        """From the products Z' Z (..., k, k) and Z' y (..., k)."""
        turned = whitening(gram)
        return cls(turned, np.einsum("...jk,...k->...j", turned, record))

    def gains(self, groups: Groups, with_z: Array, with_y: Array, grams: Sequence[Array] | None = None) -> Array:
        """Gain (..., g) of groups X for the record, with Z' X (..., k, C) and X' y (..., C)."""
        projected = self.turned @ with_z
        remaining = with_y - np.einsum("...k,...kc->...c", self.record, projected)
        return groups.conditional_gains(projected, remaining, grams)


def _each_orthonormal(columns: Array, before: Array, at: NDArray[np.int64]) -> Array:
    """Columns (N, g m) of the groups `at` (g, m), each group orthonormal."""
    count, size = at.shape
    if size == 1:
        square = np.einsum("ij,ij->j", columns[:, at[:, 0]], columns[:, at[:, 0]])
        good = square > GONE * np.maximum(before[at[:, 0]], 1e-300)
        return np.asarray(columns[:, at[:, 0]] * np.where(good, 1.0 / np.sqrt(np.where(good, square, 1.0)), 0.0))
    scale = np.sqrt(np.maximum(before[at], 1e-300))
    blocks = np.moveaxis(columns[:, at] / scale, 1, 0)  # (g, N, m)
    gram = np.matmul(np.swapaxes(blocks, 1, 2), blocks)
    values, vectors = np.linalg.eigh(gram)
    good = values > GONE
    turned = vectors * np.where(good, 1.0 / np.sqrt(np.where(good, values, 1.0)), 0.0)[:, None, :]
    return np.asarray(np.moveaxis(blocks @ turned, 0, 1).reshape(len(columns), count * size))


def _grams(columns: Array, at: NDArray[np.int64]) -> Array:
    """Products (g, m, m) of the columns of each group `at` (g, m)."""
    count, size = at.shape
    gram = np.empty((count, size, size))
    for j in range(size):
        for k in range(j, size):
            pair = np.einsum("ij,ij->j", columns[:, at[:, j]], columns[:, at[:, k]])
            gram[:, j, k] = gram[:, k, j] = pair
    return gram


def _gains_of(gram: Array, remaining: Array, z: Array, one_sided: NDArray[np.bool_]) -> Array:
    """Gains (..., g) of groups with products `gram` (..., g, m, m), which are `remaining` given
    others, and products z (..., g, m) with a residual.
    """
    before = np.maximum(np.diagonal(gram, axis1=-2, axis2=-1), 1e-300)
    if gram.shape[-1] == 1:
        square = remaining[..., 0, 0]
        lone = np.where(one_sided, np.maximum(z[..., 0], 0.0), z[..., 0])
        good = square > GONE * before[..., 0]
        return np.asarray(np.where(good, lone**2 / np.where(good, square, 1.0), 0.0))
    scale = np.sqrt(before)
    values, vectors = np.linalg.eigh(remaining / scale[..., :, None] / scale[..., None, :])
    good = values > GONE
    turned = np.einsum("...mk,...m->...k", vectors, z / scale)
    return np.asarray(np.sum(np.where(good, turned**2 / np.where(good, values, 1.0), 0.0), axis=-1))


def products(groups: Groups, q: Array, residual: Array) -> tuple[Array, Array]:
    """Q' X (r, C) and X' y (C,) of the columns X of groups, in one pass over them."""
    both = np.column_stack([q, residual]).T @ groups.columns
    return both[:-1], both[-1]


def join_groups(parts: list[Array], one_sided: list[bool] | None = None, rows: int = 0) -> Groups:
    """Groups from the columns (N, m) of each, of either sign if not stated; without any, N is `rows`."""
    ends = np.cumsum([0, *(part.shape[1] for part in parts)], dtype=np.int64)
    columns = np.hstack(parts) if parts else np.zeros((rows, 0))
    return Groups(columns, ends[: len(parts)], np.array(one_sided or [False] * len(parts), dtype=bool))
