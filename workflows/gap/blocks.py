"""Held-out errors: blocks of rows that a fit never sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.inputs.distribution import Array
from .data import GapData
from .fit import Fit, Fitter, Member
from .linear import Groups, basis, beside
from .scan import Dictionary


def block_labels(data: GapData) -> NDArray[np.int64]:
    """Block (n,) of each row: the labels of the chosen column, else stretches of equal length."""
    n = len(data)
    if data.blocks is not None:
        return np.unique(data.blocks.astype(str), return_inverse=True)[1].astype(np.int64)
    count = int(np.clip(n // 20, 5, 10))
    return np.minimum(np.arange(n) * count // n, count - 1)


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
    rows = len(labels)
    y = fitter.y
    residual, fitted = np.zeros(rows), np.zeros(rows)
    for block in np.unique(labels):
        out = np.flatnonzero(labels == block)
        seen = np.ones(len(y), dtype=bool)
        seen[out] = False
        members = _for_training(fitter, fit.members, seen, book, white)
        x = np.hstack([fitter.base, *(fitter.white(one) for one in members)])
        size = np.maximum(np.linalg.norm(x[seen], axis=0), 1e-300)
        found = np.linalg.lstsq(x[seen] / size, y[seen], rcond=1e-7)[0] / size
        residual[out] = y[out] - x[out] @ found
        raw = [fitter.columns.of(one.candidate, one.shape)[out] for one in members]
        fitted[out] = np.hstack([fitter.raw_base[out], *raw]) @ found
    return HeldOut(residual, fitted)


def _for_training(
    fitter: Fitter, members: Sequence[Member], seen: NDArray[np.bool_], book: Dictionary,
    white: Groups,
) -> list[Member]:  # fmt: skip
    """The members with the nonlinear parameters that the seen rows choose, one after another."""
    found = list(members)
    for at, one in enumerate(found):
        if not one.shape:
            continue
        others = [fitter.white(other) for k, other in enumerate(found) if k != at]
        q = basis(np.hstack([fitter.base, *others])[seen])
        mine = np.flatnonzero([m.name == one.name for m in book.members])
        some = white.some(mine)
        left = beside(fitter.y[seen], q)
        gains = Groups(some.columns[seen], some.starts, some.one_sided).orthonormal(q).gains(left)
        own = Groups(fitter.white(one)[seen], np.zeros(1, dtype=np.int64),
                     np.array([one.candidate.one_sided])).orthonormal(q).gains(left)  # fmt: skip
        if len(mine) and gains.max() > own[0]:
            found[at] = book.members[int(mine[np.argmax(gains)])]
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
