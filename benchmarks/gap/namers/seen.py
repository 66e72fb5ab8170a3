"""What a baseline sees of a record: its table, read again, and a dictionary of columns at it.

Nothing of the truth is at hand, and nothing of the library: the columns are the notes' formulas.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.gap.generator.kinds import KINDS, TABLE
from benchmarks.gap.generator.records import Record
from benchmarks.gap.generator.tables import Array, Points
from benchmarks.gap.scoring.held_out import Rows, held_out
from benchmarks.gap.scoring.rivals import RIVALS, Rival

Marks = NDArray[np.bool_]
OF_TABLES = ("rotating", "lost_motion", "friction")
"""The kinds of record that columns tell apart."""


@dataclass(frozen=True)
class Seen:
    """A table with its operating points (n,), what the simulation leaves (n,), and the names that
    may be given to it.
    """

    points: Points
    left: Array
    rivals: tuple[Rival, ...]
    kind: str

    def __len__(self) -> int:
        return len(self.left)

    @property
    def free(self) -> Array:
        """Gradient (n, k) of the zero, which is free where the output is an angle."""
        return KINDS[self.kind].free(len(self))


@dataclass(frozen=True)
class Dictionary:
    """Columns (n, m), each of mean 0 and variance 1, and the name that each belongs to."""

    names: tuple[str, ...]
    columns: Array


def seen(record: Record) -> Seen:
    """The record as a namer of tables has it.

    Raises ValueError where its table is of another kind.
    """
    table = record.table
    kinds = [
        kind for kind in OF_TABLES
        if {*KINDS[kind].roles, *KINDS[kind].outputs} <= set(table) and KINDS[kind].model == TABLE
    ]  # fmt: skip
    if not kinds:
        raise ValueError(f"{record.name}: no table of {', '.join(OF_TABLES)} with its prediction")
    output = KINDS[kinds[0]].outputs[0]
    if f"{output}_predicted" not in table:
        raise ValueError(f"{record.name}: no column {output}_predicted beside {output}")
    read = {name: table[name].to_numpy(dtype=np.float64) for name in table}
    at = Points(
        angle=np.radians(read["output_angle_deg"]),
        torque=read["torque_Nm"],
        direction=read["direction"],
        speed=read.get("output_speed_rpm", np.zeros(len(table))),
        tau=read["temperature_C"] - 20.0,
        time=read["time_s"],
    )
    return Seen(at, read[output] - read[f"{output}_predicted"], RIVALS[kinds[0]], kinds[0])


def middle(rival: Rival) -> Array:
    return np.array([grid[len(grid) // 2] for grid in rival.grids])


def dictionary(of: Seen) -> Dictionary:
    """All names at once, their nonlinear parameters in the middle of the grids."""
    blocks = [(one.name, one.columns(of.points, middle(one))) for one in of.rivals]
    names = tuple(name for name, block in blocks for _ in range(block.shape[1]))
    return Dictionary(names, standardised(np.hstack([block for _, block in blocks])))


def standardised(what: Array) -> Array:
    """Columns (n, m) or a vector (n,) with mean 0 and, unless constant, variance 1."""
    return np.asarray((what - what.mean(axis=0)) / np.maximum(what.std(axis=0), 1e-12))


def said(of: Seen, names: Sequence[str], columns: Array) -> dict[str, Any]:
    """An answer that gives those names, whose columns (n, m) have nothing to be fitted."""
    whole = np.hstack([of.free, columns])
    return said_as_fitted(of, names, lambda rows: whole)


def said_as_fitted(of: Seen, names: Sequence[str], columns_of: Callable[[Rows], Array]) -> dict[str, Any]:
    """An answer that gives those names, each once; without any, that there is no gap. `columns_of`
    rows are those of a fit to them, with what is free.
    """
    effects = [{"name": name} for name in dict.fromkeys(names)]
    word = "named" if effects else "no_gap"
    return {
        "verdict": word, "effects": effects, "alternatives": [],
        "gap_after": held_out(columns_of, of.left),
    }  # fmt: skip


def said_of(of: Seen, found: Dictionary, kept: Marks) -> dict[str, Any]:
    """An answer with the columns of a dictionary that `kept` (m,) marks."""
    names = [name for name, one in zip(found.names, kept, strict=True) if one]
    return said(of, names, found.columns[:, kept])
