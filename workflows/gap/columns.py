"""Columns of a table whose effects are confounded: constant, equal or collinear ones."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from ...models.measurable import Column, Role

CLOSE = 0.98
"""Correlation above which two columns carry the same information."""


def alike(first: pd.Series[Any], second: pd.Series[Any]) -> bool:
    """Whether two columns of numbers are equal but for rounding."""
    a, b = first.to_numpy(dtype=float), second.to_numpy(dtype=float)
    spread = max(float(np.ptp(a)), float(np.abs(a).max(initial=0.0)) * 1e-6)
    return bool(np.abs(a - b).max(initial=0.0) <= 1e-9 * spread)


def column_messages(frame: pd.DataFrame, columns: tuple[Column, ...]) -> list[str]:
    """Sentences about columns that are constant, equal or strongly correlated."""
    numbers = [c.name for c in columns if not c.text and c.role is not Role.REPEAT]
    moving = [name for name in numbers if np.ptp(frame[name].to_numpy(dtype=float))]
    notes = [
        f"{name} is the same in every row: effects that depend on it cannot be detected"
        for name in numbers
        if name not in moving
    ]
    if len(moving) < 2:
        return notes
    values = np.argsort(np.argsort(frame[moving].to_numpy(dtype=float), axis=0), axis=0)
    size = np.atleast_2d(np.abs(np.corrcoef(values, rowvar=False)))
    close = [(i, k) for i, k in combinations(range(len(moving)), 2) if size[i, k] > CLOSE]
    for i, k in close:
        first, second = moving[i], moving[k]
        same = "is a copy of" if alike(frame[first], frame[second]) else "follows"
        notes.append(f"{first} {same} {second}: their effects are confounded")
    if not close:
        notes += _collinear(frame[moving])
    return notes


def _collinear(frame: pd.DataFrame) -> list[str]:
    """A sentence about columns of which one is a linear combination of the others."""
    scaled = (frame - frame.mean()) / frame.std()
    values, vectors = np.linalg.eigh(np.corrcoef(scaled.to_numpy(dtype=float), rowvar=False))
    if values[0] > 1e-3:
        return []
    collinear = [name for name, x in zip(frame.columns, vectors[:, 0], strict=True) if abs(x) > 0.1]
    return [f"{', '.join(collinear)} are collinear: their effects are confounded"]
