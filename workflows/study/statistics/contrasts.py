"""The levels of a key side by side: the value of each seed at each of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ....arrays import Array
from ..records import Factor, Level


@dataclass(frozen=True, slots=True)
class Contrast:
    """A key, its levels, and the settings (rows of the design) at each of them."""

    key: str
    levels: tuple[Level, ...]
    members: tuple[np.ndarray, ...]

    def table(self, values: Array) -> Array:
        """Mean over each level, shape (replicates, levels); NaN where a run failed."""
        return np.column_stack([values[rows].mean(axis=0) for rows in self.members])


def contrasts(
    kind: str, design: pd.DataFrame, factors: tuple[Factor, ...], base: Mapping[str, Level]
) -> list[Contrast]:
    """What the design lets one compare: levels of a key, whole settings of a table, or nothing.

    One at a time: the levels of a key with the others as in the run. Factorial: the levels of a key
    over all settings of the others.
    """
    keys = [factor.key for factor in factors]
    if kind == "table":
        names = design[keys].astype(str).agg(", ".join, axis=1)
        rows = tuple(np.array([at]) for at in range(len(design)))
        return [Contrast("", tuple(f"{at}: {name}" for at, name in enumerate(names)), rows)]
    if kind not in ("one_at_a_time", "factorial"):
        return []
    at_base = pd.DataFrame({key: design[key] == base.get(key) for key in keys})
    compared = []
    for key in keys:
        others = at_base.drop(columns=key).all(axis=1).to_numpy()
        usable = others if kind == "one_at_a_time" else np.ones(len(design), dtype=bool)
        levels = _ordered(design.loc[usable, key])
        rows = tuple(np.flatnonzero(usable & (design[key] == level).to_numpy()) for level in levels)
        compared.append(Contrast(key, levels, rows))
    return compared


def _ordered(column: pd.Series) -> tuple[Level, ...]:
    """The different values, numbers by size, names as they come."""
    values = list(dict.fromkeys(column.tolist()))
    names = any(isinstance(value, str) for value in values)
    return tuple(values if names else sorted(values))
