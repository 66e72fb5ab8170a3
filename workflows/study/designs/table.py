"""Table: settings that the user has written down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from ....errors import Fault, InputError, nearest
from ....tables import NO_OPTIONS, cell_faults, opened_whole, parsed
from ..records import Design, Factor, Level
from .needs import column


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
            raw = opened_whole(Path(self.file), self.file, NO_OPTIONS).cells
        except InputError as error:
            return pd.DataFrame(), list(error.faults)
        names = [factor.key for factor in factors if factor.categorical]
        typed, faults = parsed(raw, self.file, [factor.key for factor in factors], text=names)
        known = [factor for factor in factors if factor.key in typed]
        for factor in known:
            faults += cell_faults(self.file, factor.key, _bad_cells(factor, typed[factor.key]))
        return pd.DataFrame({factor.key: column(_levels(factor, typed[factor.key])) for factor in known}), faults


def _bad_cells(factor: Factor, cells: pd.Series) -> dict[Any, str]:
    """What is no level of the factor, or outside of its range, by row."""
    present = cells.dropna()
    if not factor.ranged:
        bad = present[~present.isin(factor.levels)]
        names = [str(level) for level in factor.levels]
        known = ", ".join(names)
        return {
            at: f"must be one of {known}, got {_shown(value)}{nearest(str(value), names)}" for at, value in bad.items()
        }
    bad = present[(present < factor.low) | (present > factor.high)]
    messages = {
        at: f"must lie in [{factor.low:.10g}, {factor.high:.10g}], got {_shown(value)}" for at, value in bad.items()
    }
    if factor.integer:
        broken = present[present != np.floor(present)]
        messages |= {at: f"must be a whole number, got {_shown(value)}" for at, value in broken.items()}
    return messages


def _shown(value: Any) -> str:
    return f"{value:.10g}" if isinstance(value, float) else f'"{value}"'


def _levels(factor: Factor, cells: pd.Series) -> list[Any]:
    """The cells as the levels are written, whole numbers whole."""
    if factor.ranged:
        whole = factor.integer and not cells.isna().any()
        return [int(cell) if whole else float(cell) for cell in cells]
    known: dict[Any, Level] = {level: level for level in factor.levels}
    return [known.get(cell, cell) for cell in cells]
