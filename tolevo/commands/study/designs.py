"""Designs of experiments, of which `[design] kind` names one of `DESIGNS`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import product
from math import prod
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import qmc

from ...errors import Fault, InputError, nearest
from ...registry import Kinds
from ...section import SETTINGS, is_forced
from ...tables import NO_OPTIONS, cell_faults, open_or_raise, parse_columns
from .plan import Design, Factor, Level

__all__ = ["DESIGNS", "Factorial", "LatinHypercube", "Morris", "OneAtATime", "Sobol", "Table"]

# What designs require of factors and replicates.


def replicate_faults(seeds: int, statistic: str) -> list[Fault]:
    """A fault where one seed per setting confounds the noise of a run with an effect."""
    if seeds >= 2:
        return []
    text = f"is {seeds}: {statistic} need at least 2 replicates, or the noise of a run counts as an"
    return [Fault("seeds", f"{text} effect of the settings")]


def level_faults(factors: tuple[Factor, ...], kind: str) -> list[Fault]:
    """A fault of every factor that has no levels to go through."""
    return [
        Fault(
            f"vary.{factor.key}",
            f"has one level or none: {kind} needs two or more; give a list of values, or `levels` with low and high",
        )
        for factor in factors
        if len(factor.grid()) < 2
    ]


def small_value_fault(name: str, value: int, least: int, statistic: str) -> list[Fault]:
    """A fault where `value` is below what a statistic needs."""
    return [] if value >= least else [Fault(name, f"is {value}: {statistic} at least {least}")]


def unit_cube(factors: tuple[Factor, ...]) -> dict[str, object]:
    """The keys as SALib describes them, each from 0 to 1."""
    names = [factor.key for factor in factors]
    return {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}


def frame_of(factors: tuple[Factor, ...], shares: NDArray[np.float64]) -> pd.DataFrame:
    """The values of the factors at `shares` (n, factors), each in [0, 1]."""
    columns = zip(factors, shares.T.tolist(), strict=True)
    return pd.DataFrame({factor.key: column(map(factor.at, values)) for factor, values in columns})


def column(values: Iterable[Level]) -> pd.Series:
    """A column that keeps whole numbers whole and names as they are."""
    return pd.Series(list(values), dtype=object).infer_objects()


# Full factorial: every level of every key with every level of the others.


MAX_SETTINGS = 100_000
"""Settings at most; more are probably a mistake."""


@dataclass(frozen=True, slots=True)
class Factorial(Design):
    """All combinations, the last key fastest."""

    kind: ClassVar[str] = "factorial"
    analysis: ClassVar[str] = "factorial"

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        issues = level_faults(factors, self.kind)
        count = self.size(factors)
        if count > MAX_SETTINGS and not is_forced():
            text = f"has {count} settings, {MAX_SETTINGS} at most: give fewer levels, use sobol, or add --force"
            issues.append(Fault("kind", text))
        return issues + replicate_faults(seeds, "shares of variance")

    def size(self, factors: tuple[Factor, ...]) -> int:
        return prod(len(factor.grid()) or 1 for factor in factors)

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        rows = list(product(*(factor.grid() for factor in factors)))
        columns = zip(factors, zip(*rows, strict=True), strict=True)
        return pd.DataFrame({factor.key: column(values) for factor, values in columns})


# Latin hypercube: every key in as many strata as there are settings.


def terms(factors: tuple[Factor, ...]) -> int:
    """Terms of the analysis: a line and a curve for a range, one less than its levels for a list.

    Its last degree of freedom is the constant.
    """
    return 1 + sum(2 if factor.ranged else len(factor.levels) - 1 for factor in factors)


@dataclass(frozen=True, slots=True)
class LatinHypercube(Design):
    """`samples` settings that fill the space of the keys."""

    kind: ClassVar[str] = "latin_hypercube"
    samples: int = field(default=64, metadata={"low": 2, "need": SETTINGS})

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        issues = small_value_fault(
            "samples", self.samples, 2 * terms(factors), "an analysis of variance needs twice its terms,"
        )
        return issues + replicate_faults(seeds, "shares of variance")

    def size(self, factors: tuple[Factor, ...]) -> int:
        return self.samples

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        return frame_of(factors, qmc.LatinHypercube(len(factors), rng=rng).random(self.samples))


# Morris: trajectories through a grid that change one key at each step.


MIN_TRAJECTORIES = 10
"""Trajectories from which on the intervals of the statistics are reliable."""
SHARE = "_share_"
"""Prefix of the columns that hold the place in the grid, in [0, 1]."""


@dataclass(frozen=True, slots=True)
class Morris(Design):
    """Elementary effects (Morris 1991) along `trajectories` of one setting more than keys."""

    kind: ClassVar[str] = "morris"
    analysis: ClassVar[str] = "morris"
    trajectories: int = field(default=20, metadata={"low": 1, "need": SETTINGS})
    levels: int = field(default=4, metadata={"low": 2})

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        issues = small_value_fault(
            "trajectories", self.trajectories, MIN_TRAJECTORIES, "intervals of elementary effects need"
        )
        if self.levels % 2:
            issues.append(Fault("levels", f"is {self.levels}: steps of half the grid need an even number of levels"))
        return issues + replicate_faults(seeds, "elementary effects")

    def size(self, factors: tuple[Factor, ...]) -> int:
        return self.trajectories * (len(factors) + 1)

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        """Columns `_share_<key>` hold the place of each key in the grid."""
        from SALib.sample.morris import sample

        # A generator: SALib takes the seed 0 for none.
        shares = sample(unit_cube(factors), self.trajectories, num_levels=self.levels, seed=rng)
        named = pd.DataFrame(shares, columns=[SHARE + factor.key for factor in factors])
        return frame_of(factors, self._places(factors, shares)).join(named)

    def _places(self, factors: tuple[Factor, ...], shares: np.ndarray) -> np.ndarray:
        """Ranges keep both ends; a list is entered in the middle of each step, so none is rare."""
        middles = (np.rint(shares * (self.levels - 1)) + 0.5) / self.levels
        return np.where([factor.ranged for factor in factors], shares, middles)


# One at a time: every key through its levels, the others as in the run configuration.


@dataclass(frozen=True, slots=True)
class OneAtATime(Design):
    """The documents' design. It shows no interaction, and the first point is the run as it is."""

    kind: ClassVar[str] = "one_at_a_time"
    analysis: ClassVar[str] = "one_at_a_time"

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        return level_faults(factors, self.kind)

    def size(self, factors: tuple[Factor, ...]) -> int:
        return 1 + sum(len(factor.grid()) for factor in factors)

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        base_levels = {factor.key: base[factor.key] for factor in factors}
        varied = [
            base_levels | {factor.key: level}
            for factor in factors
            for level in factor.grid()
            if level != base[factor.key]
        ]
        return pd.DataFrame({key: column(row[key] for row in [base_levels, *varied]) for key in base_levels})


# Sobol: Saltelli's pairs of samples, from which shares of variance are estimated.


MIN_SOBOL_POINTS = 128
"""Base samples from which on the intervals of the indices are reliable."""

PARTS = 8


@dataclass(frozen=True, slots=True)
class Sobol(Design):
    """`samples` blocks of A, A with one key from B for every key, and B (Saltelli et al. 2010).

    They are `PARTS` Sobol sequences of equal length, each scrambled by itself: the scatter of the
    estimates between them shows the precision of the whole.
    """

    kind: ClassVar[str] = "sobol"
    analysis: ClassVar[str] = "sobol"
    samples: int = field(default=128, metadata={"low": 1, "need": SETTINGS})

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        issues = small_value_fault("samples", self.samples, MIN_SOBOL_POINTS, "intervals of Sobol indices need")
        if self.samples & (self.samples - 1):
            lower = 1 << (self.samples.bit_length() - 1)
            text = f"is {self.samples}: a Sobol sequence is balanced at powers of 2; use"
            issues.append(
                Fault("samples", f"{text} {max(lower, MIN_SOBOL_POINTS)} or {max(2 * lower, MIN_SOBOL_POINTS)}")
            )
        return issues + replicate_faults(seeds, "Sobol indices")

    def size(self, factors: tuple[Factor, ...]) -> int:
        return self.samples * (len(factors) + 2)

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        """Row `block * (keys + 2) + at`: at 0 is A, 1 to keys is A with that key from B, then B."""
        from SALib.sample.sobol import sample

        cube = unit_cube(factors)
        # A generator: SALib takes the seed 0 for none.
        parts = [sample(cube, self.samples // PARTS, calc_second_order=False, seed=rng) for _ in range(PARTS)]
        return frame_of(factors, np.concatenate(parts))


# Table: settings that the user has written down.


@dataclass(frozen=True, slots=True)
class Table(Design):
    """One setting per row of `file` (CSV or Parquet), one column per varied key."""

    kind: ClassVar[str] = "table"
    analysis: ClassVar[str] = "table"
    file: str = ""

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        if not self.file:
            return [Fault("file", "is missing: name the CSV or Parquet file of the settings")]
        return self._parsed(factors)[1]

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        settings, faults = self._parsed(factors)
        if faults:
            raise InputError(faults)
        return settings.reset_index(drop=True)

    def _parsed(self, factors: tuple[Factor, ...]) -> tuple[pd.DataFrame, list[Fault]]:
        try:
            raw = open_or_raise(Path(self.file), self.file, NO_OPTIONS).cells
        except InputError as error:
            return pd.DataFrame(), list(error.faults)
        names = [factor.key for factor in factors if factor.categorical]
        typed, faults = parse_columns(raw, self.file, [factor.key for factor in factors], text=names)
        known = [factor for factor in factors if factor.key in typed]
        for factor in known:
            faults += cell_faults(self.file, factor.key, _cell_faults(factor, typed[factor.key]))
        return pd.DataFrame({factor.key: column(_levels(factor, typed[factor.key])) for factor in known}), faults


def _cell_faults(factor: Factor, cells: pd.Series) -> dict[Any, str]:
    """What is no level of the factor, or outside of its range, by row."""
    present = cells.dropna()
    if not factor.ranged:
        bad = present[~present.isin(factor.levels)]
        names = [str(level) for level in factor.levels]
        known = ", ".join(names)
        return {
            at: f"must be one of {known}, got {_level_text(value)}{nearest(str(value), names)}"
            for at, value in bad.items()
        }
    bad = present[(present < factor.low) | (present > factor.high)]
    messages = {
        at: f"must lie in [{factor.low:.10g}, {factor.high:.10g}], got {_level_text(value)}"
        for at, value in bad.items()
    }
    if factor.integer:
        broken = present[present != np.floor(present)]
        messages |= {at: f"must be a whole number, got {_level_text(value)}" for at, value in broken.items()}
    return messages


def _level_text(value: Any) -> str:
    return f"{value:.10g}" if isinstance(value, float) else f'"{value}"'


def _levels(factor: Factor, cells: pd.Series) -> list[Any]:
    """The cells as the levels are written, whole numbers whole."""
    if factor.ranged:
        whole = factor.integer and not cells.isna().any()
        return [int(cell) if whole else float(cell) for cell in cells]
    known: dict[Any, Level] = {level: level for level in factor.levels}
    return [known.get(cell, cell) for cell in cells]


DESIGNS: Kinds[Design] = Kinds("designs")
"""The kinds of designs by name: entry points of `tolevo.designs`."""
