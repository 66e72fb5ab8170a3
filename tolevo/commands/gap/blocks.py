"""Held-out errors: blocks of rows that are excluded from a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...journal import Arrays, recall_arrays
from ...models.effects.measurements import SESSION, measurements_of
from ...models.effects.unresolved import Unresolved
from ...models.measurable import Role
from ...section import Array
from .data import GapData
from .fit import Fitter, Member
from .linear import TIE, ConditionalGroups, Groups, unit
from .scan import Dictionary


def block_labels(data: GapData) -> NDArray[np.int64]:
    """Block (n,) of each row: the labels of the chosen column, else stretches of equal length."""
    n = len(data)
    if data.blocks is not None:
        return np.unique(data.blocks.astype(str), return_inverse=True)[1].astype(np.int64)
    count = int(np.clip(n // 20, 5, 10))
    return np.arange(n) * count // n


LEVELS = 4
"""Levels of an input that varies freely, with equally many rows."""
MOST_LEVELS = 12
"""Distinct values of an input up to which each of them is a test condition."""
LEAST_SPLIT = 10
"""Rows of a part of a split, at least."""
CONDITIONS = (Role.SPEED, Role.TORQUE, Role.FORCE, Role.PAYLOAD, Role.TEMPERATURE)
"""Inputs whose levels are test conditions, the first one of the table counts."""


@dataclass(frozen=True)
class Split:
    """The coarsest split of a record: `by` what, the part (n,) of each row, and which parts lie at an
    end of an input's range, so that they are predicted by extrapolation.
    """

    by: str
    labels: NDArray[np.int64]
    ends: tuple[int, ...] = ()

    @property
    def natural(self) -> bool:
        """Whether the record itself has these parts: other sessions, units or test conditions."""
        return self.by != STRETCHES and not self.by.startswith(LEVELS_OF)


STRETCHES, LEVELS_OF = "stretches", "levels of "


def coarsest_split(data: GapData) -> Split:
    """The parts of a record that differ most: the blocks of the configuration, sessions, units or lots,
    test conditions (an input with few values), levels of an input, else stretches.
    """
    if data.blocks is not None:
        return Split("blocks", block_labels(data))
    table = data.measurements.table
    of_labels = [SESSION] if SESSION in table else []
    for name in [*of_labels, *(c.name for c in data.target.columns if c.role in (Role.UNIT, Role.LOT))]:
        labels = np.unique(np.asarray(table[name]).astype(str), return_inverse=True)[1]
        if _is_split(labels):
            return Split(name, labels.astype(np.int64))
    inputs = sorted((c for c in data.inputs if c.role in CONDITIONS), key=lambda c: CONDITIONS.index(c.role))
    of_levels = [(c.name, np.unique(data.values(c.name), return_inverse=True)) for c in inputs]
    for name, (values, labels) in of_levels:
        if len(values) <= MOST_LEVELS and _is_split(labels):
            return Split(name, labels.astype(np.int64), (0, len(values) - 1))
    for name, (values, labels) in of_levels:
        levels = np.argsort(np.argsort(labels, kind="stable"), kind="stable") * LEVELS // len(data)
        if len(values) > MOST_LEVELS and _is_split(levels):
            return Split(f"{LEVELS_OF}{name}", levels.astype(np.int64), (0, LEVELS - 1))
    return Split(STRETCHES, block_labels(data))


def _is_split(labels: NDArray[Any]) -> bool:
    """Whether labels (n,) are of two or more parts with enough rows each."""
    counts = np.bincount(labels)
    return len(counts) > 1 and int(counts.min()) >= LEAST_SPLIT


EXCLUSION_GAIN = 2.7
"""Gain from which a value of a nonlinear parameter is excluded: chi square, 90 %."""
RANK = 1e-7
"""Size of a direction of columns of unit length, relative to the largest, below which it is none.
"""
Rows = slice | NDArray[np.int64]


@dataclass(frozen=True)
class Fold:
    """One block: its rows, and the members and coefficients (k,) of a fit of all other rows."""

    rows: Rows
    members: tuple[Member, ...]
    coefficients: Array


@dataclass(frozen=True)
class HeldOut:
    """Whitened residuals (N,) of held-out rows, and the fit of each block."""

    white: Array
    fitter: Fitter
    folds: tuple[Fold, ...]

    @cached_property
    def fitted(self) -> Array:
        """Predictions of the effects and the free parameters there (N,), in the outputs' units."""
        predicted = np.zeros(len(self.white))
        for fold in self.folds:
            columns_of, base = self.fitter.columns.of, self.fitter.raw_base
            raw = [base, *(columns_of(member.candidate, member.shape) for member in fold.members)]
            predicted[fold.rows] = np.hstack([part[fold.rows] for part in raw]) @ fold.coefficients
        return predicted

    @property
    def held_at_ends(self) -> Array:
        """The same predictions (N,) as a corrected model makes them: in rows beyond the range of all others, terms
        without a name stay as at the end of that range.
        """
        predicted, columns = self.fitted.copy(), self.fitter.columns
        data = columns.data
        table, places = data.measurements.table, np.arange(len(self.white)) % len(data)
        for fold in self.folds:
            others = np.setdiff1d(places, places[fold.rows])
            ranges = {c.name: data.values(c.name)[others] for c in data.inputs}
            held = {name: np.clip(data.values(name), x.min(), x.max()) for name, x in ranges.items()}
            at_ends = measurements_of(data.target.columns, {**table, **held})
            at = self.fitter.raw_base.shape[1]
            for member in fold.members:
                known = columns.of(member.candidate, member.shape)
                if isinstance(member.candidate.effect, Unresolved):
                    change = columns.of_term(member.candidate.effect, at_ends) - known
                    predicted[fold.rows] += change[fold.rows] @ fold.coefficients[at : at + known.shape[1]]
                at += known.shape[1]
        return predicted

    @property
    def rss(self) -> float:
        """Sum of squares of all rows."""
        return float(np.sum(self.white**2))

    def squares(self, labels: NDArray[np.int64]) -> Array:
        """Sum of squares in each block."""
        return np.asarray(np.bincount(labels, self.white**2), dtype=float)


def predict_held_out(training: Training, members: Sequence[Member]) -> HeldOut:
    """Every block predicted by a fit of the others; nonlinear parameters are fitted there too."""
    grid = training.dictionary.members

    def computed() -> Arrays:
        white, chosen, coefficients = _held_out_fits(training, members)
        numbers = {id(member): number for number, member in enumerate(grid)}
        pairs = [zip(of_block, members, strict=True) for of_block in chosen]
        places = [[-1 if own is m else numbers[id(own)] for own, m in of_block] for of_block in pairs]
        return white, np.array(places, dtype=np.int64).reshape(len(chosen), len(members)), np.array(coefficients)

    keys = (member.key for member in members)
    white, places, coefficients = recall_arrays(("held out", *keys, training.fitter.y), computed)
    folds = [
        Fold(rows, tuple(m if at < 0 else grid[at] for at, m in zip(places_of, members, strict=True)), numbers)
        for rows, places_of, numbers in zip(training.rows, places.astype(np.int64).tolist(), coefficients, strict=True)
    ]
    return HeldOut(white, training.fitter, tuple(folds))


def _held_out_fits(training: Training, members: Sequence[Member]) -> tuple[Array, list[list[Member]], list[Array]]:
    """Whitened residuals (N,) of held-out rows; members and coefficients (k,) of the fit without each block."""
    fitter, chosen = training.fitter, training.chosen(members)
    white, fits = np.zeros(training.count), []
    known: dict[tuple[object, ...], tuple[Array, Trained]] = {}
    for rows, fold_members in zip(training.rows, chosen, strict=True):
        key = tuple(member.key for member in fold_members)
        if key not in known:
            x = np.hstack([fitter.base, *(fitter.white(member) for member in fold_members)])
            known[key] = x, Trained.of(x, fitter.y)
        x, trained = known[key]
        coefficients = _fit_within_bounds(trained.without(rows, fitter.y), fold_members, x, fitter.y, rows)
        white[rows] = fitter.y[rows] - x[rows] @ coefficients
        fits.append(coefficients)
    return white, chosen, fits


def _fit_within_bounds(coefficients: Array, members: Sequence[Member], x: Array, y: Array, out: Rows) -> Array:
    """Coefficients (k,) within the bounds of the effects, fitted to all rows but `out`; free are
    those of effects whose size is a nonlinear parameter.
    """
    unbounded = np.full(1, -np.inf), np.full(1, np.inf)
    bounds = [unbounded if member.candidate.is_nonlinear else member.candidate.bounds for member in members]
    free = len(coefficients) - sum(len(low) for low, _ in bounds)
    ends = [(np.full(free, -np.inf), np.full(free, np.inf)), *bounds]
    low, high = (np.concatenate(side) for side in zip(*ends, strict=True))
    if (coefficients >= low).all() and (coefficients <= high).all():
        return coefficients
    training = np.ones(len(x), dtype=bool)
    training[out] = False
    size = np.maximum(np.linalg.norm(x, axis=0), 1e-300)
    q, r = np.linalg.qr(x[training] / size)
    solution = scipy.optimize.lsq_linear(r, q.T @ y[training], (low * size, high * size), method="bvls")
    return np.asarray(solution.x / size)


@dataclass(frozen=True)
class Trained:
    """An orthonormal basis q (N, r) of columns (N, k), the matrix `back` (k, r) that turns its
    coefficients into those of the columns, and its product q' y with a record.

    Columns may be duplicates, such as a gauge's offset and a free zero: a basis of all k would have
    directions of rounding errors, which fit any rows.
    """

    q: Array
    back: Array
    product: Array

    @classmethod
    def of(cls, x: Array, y: Array) -> Trained:
        """The basis of columns (N, k) for a record (N,)."""
        size = np.maximum(np.linalg.norm(x, axis=0), 1e-300)
        q, r = np.linalg.qr(x / size)
        left, values, right = np.linalg.svd(r)
        kept = values > RANK * values.max(initial=0.0)
        q = q @ left[:, kept]
        return cls(q, right[kept].T / values[kept] / size[:, None], q.T @ y)

    def without(self, out: Rows, y: Array) -> Array:
        """Coefficients of a fit without the rows `out`."""
        held_out_basis = self.q[out]
        gram = np.eye(len(self.product)) - held_out_basis.T @ held_out_basis
        turned = np.linalg.lstsq(gram, self.product - held_out_basis.T @ y[out], rcond=1e-12)[0]
        return np.asarray(self.back @ turned)


@dataclass(frozen=True)
class Grid:
    """The grid points of an effect, or a single point: groups of columns (N, C), and for each block
    the products in all other rows: of each group's columns (B, g, m, m) by size, and with the
    record (B, C).
    """

    groups: Groups
    grams: tuple[Array, ...]
    with_record: Array


class Training:
    """What the fits without each block of rows have in common. They follow from the products of the
    columns in all other rows, so that a single pass over the columns serves all blocks.

    `labels` (N,) repeats the block of each row for every output.
    """

    def __init__(self, fitter: Fitter, labels: NDArray[np.int64], dictionary: Dictionary, white: Groups) -> None:
        self.fitter, self.count = fitter, len(labels)
        self.rows = [_rows(np.flatnonzero(labels == label)) for label in np.unique(labels)]
        self.dictionary, self._white = dictionary, white
        self._grids: dict[str, Grid] = {}
        self._grid_products: dict[tuple[object, ...], Array] = {}

    def products(self, a: Array, b: Array) -> Array:
        """Products (B, j, k) of columns (N, j) and (N, k) in all rows but those of each block."""
        return a.T @ b - np.stack([a[rows].T @ b[rows] for rows in self.rows])

    def chosen(self, members: Sequence[Member]) -> list[list[Member]]:
        """For each block the members with the nonlinear parameters that fit all other rows best,
        member by member; those of the whole record stay where these rows do not exclude them.
        """
        by_block = [list(members) for _ in self.rows]
        for at, member in enumerate(members):
            if not member.shape:
                continue
            alike: dict[tuple[object, ...], list[int]] = {}
            for block, block_members in enumerate(by_block):
                alike.setdefault(tuple(m.key for m in block_members), []).append(block)
            first, _ = self.dictionary.places[member.name]
            for blocks in alike.values():
                grid, kept = self.gains(by_block[blocks[0]], at, blocks)
                best = np.argmax(grid >= (1.0 - TIE) * grid.max(axis=1, keepdims=True), axis=1)
                for block, k, gains, kept_gain in zip(blocks, best, grid, kept[:, 0], strict=True):
                    if gains[k] > kept_gain + EXCLUSION_GAIN:
                        by_block[block][at] = self.dictionary.members[first + int(k)]
        return by_block

    def gains(self, members: Sequence[Member], at: int, blocks: Sequence[int]) -> tuple[Array, Array]:
        """Gains (b, g) of all grid points of one member given the others, and (b, 1) of the member
        as it is, in all rows but those of each of some blocks.
        """
        fitter, member = self.fitter, members[at]
        others = [*members[:at], *members[at + 1 :]]
        z = np.hstack([fitter.q, *(unit(fitter.white(other)) for other in others)])
        given_others = ConditionalGroups.of(self.products(z, z)[blocks], self._with_record(z)[blocks])
        white = fitter.white(member)
        start, sided = np.zeros(1, dtype=np.int64), np.array([member.candidate.one_sided])
        whole, kept = self._grid(member.name), self._as_grid(Groups(white, start, sided))
        parts = [self._with_grid((), fitter.q, member.name)]
        parts += [self._with_grid(other.key, fitter.white(other), member.name) for other in others]

        def gains(grid: Grid, with_z: Array) -> Array:
            grams = [gram[blocks] for gram in grid.grams]
            return given_others.gains(grid.groups, with_z[blocks], grid.with_record[blocks], grams)

        return gains(whole, np.concatenate(parts, axis=1)), gains(kept, self.products(z, white))

    def _grid(self, name: str) -> Grid:
        if name not in self._grids:
            self._grids[name] = self._as_grid(self._white.part(*self.dictionary.places[name]))
        return self._grids[name]

    def _as_grid(self, groups: Groups) -> Grid:
        parts = [groups.grams(rows) for rows in self.rows]
        grams = tuple(whole - np.stack(block_grams) for whole, *block_grams in zip(groups.grams(), *parts, strict=True))
        return Grid(groups, grams, self._with_record(groups.columns))

    def _with_record(self, columns: Array) -> Array:
        """Products (B, k) of columns (N, k) with the record."""
        return self.products(columns, self.fitter.y[:, None])[..., 0]

    def _with_grid(self, key: tuple[object, ...], columns: Array, name: str) -> Array:
        """Products (B, k, C) of the columns (N, k) of a key, of unit length, with a grid."""
        if (key, name) not in self._grid_products:
            grid = self._grid(name).groups.columns
            self._grid_products[key, name] = self.products(unit(columns), grid)
        return self._grid_products[key, name]


def _rows(at: NDArray[np.int64]) -> Rows:
    """Contiguous rows as a slice, which copies nothing; other rows as they are."""
    contiguous = len(at) and int(at[-1]) - int(at[0]) + 1 == len(at)
    return slice(int(at[0]), int(at[-1]) + 1) if contiguous else at


@dataclass(frozen=True)
class Improvement:
    """Decrease of the squared held-out error by an addition, and its standard error over blocks; and
    whether the error falls by a factor in most of them, by more than its standard error.
    """

    gain: float
    error: float
    by_factor: bool = False

    @classmethod
    def of(cls, decreases: Array) -> Improvement:
        """The improvement from the decrease in each block (B,)."""
        count = len(decreases)
        error = float(np.std(decreases, ddof=1) * np.sqrt(count)) if count > 1 else np.inf
        return cls(float(decreases.sum()), error)

    @property
    def real(self) -> bool:
        """Whether the decrease exceeds its standard error; or the logarithm of the factor does, which a
        single block at the end of the range does not decide.
        """
        return self.gain > self.error or self.by_factor


def improvement(before: HeldOut, after: HeldOut, labels: NDArray[np.int64]) -> Improvement:
    """By how much held-out rows are predicted better."""
    first, last = (np.maximum(held_out.squares(labels), 1e-300) for held_out in (before, after))
    factors = Improvement.of(np.log(first / last))
    return replace(Improvement.of(first - last), by_factor=factors.gain > factors.error)
