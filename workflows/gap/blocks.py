"""Held-out errors: blocks of rows that a fit never sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from ...models.inputs.distribution import Array
from .data import GapData
from .fit import Fit, Fitter, Member
from .linear import GONE, Groups, products
from .scan import Dictionary


def block_labels(data: GapData) -> NDArray[np.int64]:
    """Block (n,) of each row: the labels of the chosen column, else stretches of equal length."""
    n = len(data)
    if data.blocks is not None:
        return np.unique(data.blocks.astype(str), return_inverse=True)[1].astype(np.int64)
    count = int(np.clip(n // 20, 5, 10))
    return np.minimum(np.arange(n) * count // n, count - 1)


SURE = 2.7
"""Gain from which a nonlinear parameter is excluded: 90 % of one number (chi square)."""


@dataclass(frozen=True)
class HeldOut:
    """Whitened residuals (N,) of rows that their fit never saw, and predictions of the effects and
    the free parameters there (N,), in the outputs' units.
    """

    white: Array
    fitted: Array

    def squares(self, labels: NDArray[np.int64]) -> Array:
        """Sum of squares in each block."""
        return np.asarray(np.bincount(labels, self.white**2), dtype=float)


def held_out(
    fitter: Fitter, fit: Fit, labels: NDArray[np.int64], book: Dictionary, white: Groups
) -> HeldOut:
    """Every block predicted by a fit of the others; nonlinear parameters are fitted there too.

    `labels` (N,) repeats the block of each row for every output.
    """
    y, kept = fitter.y, Kept(fitter, fit.members, book, white)
    residual, fitted = np.zeros(len(labels)), np.zeros(len(labels))
    for block in np.unique(labels):
        out = np.flatnonzero(labels == block)
        members = _for_training(kept, out)
        x, raw, trained = kept.columns(members)
        found = _admissible(trained.without(out, y), members, x, y, out)
        residual[out] = y[out] - x[out] @ found
        fitted[out] = raw[out] @ found
    return HeldOut(residual, fitted)


def _admissible(
    found: Array, members: Sequence[Member], x: Array, y: Array, out: NDArray[np.int64]
) -> Array:
    """Coefficients (k,) within the bounds of the effects, fitted to all rows but `out`; those of
    effects whose size is in a nonlinear parameter are free.
    """
    bounds = [one.candidate.bounds for one in members if not one.candidate.alone]
    sizes = [1 if one.candidate.alone else len(one.candidate.linear) for one in members]
    own = np.repeat([not one.candidate.alone for one in members], sizes)
    low, high = np.full(len(found), -np.inf), np.full(len(found), np.inf)
    at = len(found) - len(own) + np.flatnonzero(own)
    if not len(at):
        return found
    low[at], high[at] = (np.concatenate(ends) for ends in zip(*bounds, strict=True))
    if (found >= low).all() and (found <= high).all():
        return found
    seen = np.ones(len(x), dtype=bool)
    seen[out] = False
    size = np.maximum(np.linalg.norm(x, axis=0), 1e-300)
    q, r = np.linalg.qr(x[seen] / size)
    ends = (low * size, high * size)
    return np.asarray(optimize.lsq_linear(r, q.T @ y[seen], ends, method="bvls").x / size)


@dataclass(frozen=True)
class Trained:
    """Columns q r, of unit length but for `size`, and what they make of a record: q' y."""

    q: Array
    r: Array
    size: Array
    product: Array

    @classmethod
    def of(cls, x: Array, y: Array) -> Trained:
        """Of columns (N, k) and a record (N,)."""
        size = np.maximum(np.linalg.norm(x, axis=0), 1e-300)
        q, r = np.linalg.qr(x / size)
        return cls(q, r, size, q.T @ y)

    def without(self, out: NDArray[np.int64], y: Array) -> Array:
        """Coefficients of a fit that never saw the rows `out`."""
        mine = self.q[out]
        gram = np.eye(len(self.product)) - mine.T @ mine
        turned = np.linalg.lstsq(gram, self.product - mine.T @ y[out], rcond=1e-12)[0]
        return np.asarray(np.linalg.lstsq(self.r, turned, rcond=1e-7)[0] / self.size)


@dataclass(frozen=True)
class Without:
    """Groups, the basis q (N, r) of what they stand beside, and their products with it and with the
    record: in the rows that a fit never saw only these have to be looked at again.
    """

    groups: Groups
    q: Array
    y: Array
    projected: Array
    products: Array

    @classmethod
    def of(cls, groups: Groups, q: Array, y: Array) -> Without:
        """Of all rows."""
        return cls(groups, q, y, *products(groups, q, y))

    def gains(self, out: NDArray[np.int64]) -> Array:
        """Gain (g,) of each group in all rows but `out`, beside the same."""
        mine, x, y = self.q[out], self.groups.columns[out], self.y[out]
        values, vectors = np.linalg.eigh(np.eye(self.q.shape[1]) - mine.T @ mine)
        turned = (vectors[:, values > GONE] / np.sqrt(values[values > GONE])).T
        projected = turned @ (self.projected - mine.T @ x)
        of_record = turned @ (self.q.T @ self.y - mine.T @ y)
        return self.groups.gains_beside(
            projected, self.products - x.T @ y - projected.T @ of_record, out
        )


class Kept:
    """What the blocks of one held-out test share: the columns of each set of members."""

    def __init__(
        self, fitter: Fitter, members: Sequence[Member], book: Dictionary, white: Groups
    ) -> None:
        self.fitter, self.members, self.book, self._white = fitter, members, book, white
        self._columns: dict[tuple[int, ...], tuple[Array, Array, Trained]] = {}
        self._grids: dict[tuple[int, ...], tuple[Without, Without]] = {}

    def columns(self, members: Sequence[Member]) -> tuple[Array, Array, Trained]:
        """Whitened and raw columns (N, k) of what is free and of members, and their fit."""
        key = tuple(map(id, members))
        if key not in self._columns:
            of, fitter = self.fitter.columns.of, self.fitter
            x = np.hstack([fitter.base, *(fitter.white(one) for one in members)])
            raw = np.hstack([fitter.raw_base, *(of(one.candidate, one.shape) for one in members)])
            self._columns[key] = x, raw, Trained.of(x, fitter.y)
        return self._columns[key]

    def grid(self, members: Sequence[Member], at: int) -> tuple[Without, Without]:
        """All grid points of one member beside the others, and the member itself."""
        key = (at, *map(id, members))
        if key not in self._grids:
            fitter, one = self.fitter, members[at]
            q = fitter.spanned([other for k, other in enumerate(members) if k != at])
            own = Groups(fitter.white(one), np.zeros(1, dtype=np.int64),
                         np.array([one.candidate.one_sided]))  # fmt: skip
            grid = self._white.part(*self.book.places[one.name])
            self._grids[key] = Without.of(grid, q, fitter.y), Without.of(own, q, fitter.y)
        return self._grids[key]


def _for_training(kept: Kept, out: NDArray[np.int64]) -> list[Member]:
    """The members with the nonlinear parameters that all rows but `out` choose, in turn; those of
    the whole record stay where these rows do not exclude them.
    """
    found = list(kept.members)
    for at, one in enumerate(found):
        if not one.shape:
            continue
        grid, own = kept.grid(found, at)
        gains = grid.gains(out)
        if gains.max(initial=0.0) > float(own.gains(out)[0]) + SURE:
            first, _ = kept.book.places[one.name]
            found[at] = kept.book.members[first + int(np.argmax(gains))]
    return found


@dataclass(frozen=True)
class Improvement:
    """Fall of the squared held-out error by an addition, and its standard error over the blocks."""

    gain: float
    error: float

    @property
    def real(self) -> bool:
        """Whether it is more than its standard error."""
        return self.gain > self.error


def improvement(before: HeldOut, after: HeldOut, labels: NDArray[np.int64]) -> Improvement:
    """By how much rows that the fit never saw are predicted better."""
    falls = before.squares(labels) - after.squares(labels)
    error = float(np.std(falls, ddof=1) * np.sqrt(len(falls))) if len(falls) > 1 else np.inf
    return Improvement(float(falls.sum()), error)
