"""Signs that are the other way round: an output, or a column, that counts against the convention.

An effect has the sign that physics gives it. Where the data fit far better turned round, that is
said before anything else: what is named otherwise is named for the wrong reason.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.effects.inside import InsideSeveral
from ...models.inputs.distribution import Array
from .data import GapData
from .library import Candidate, Columns, grid
from .linear import basis, beside

FAR = 0.25
"""What a turned reading must leave, as a share of what the given one leaves (of squares)."""
SHAPES = 12
"""Points of an effect's grid that are tried."""
ROWS = 600
LEAST = 20
"""Rows from which a sign is judged."""


@dataclass(frozen=True)
class _Best:
    """The smallest sum of squares that one effect, or none, leaves, and its name."""

    left: float
    name: str = ""


def turned(
    data: GapData,
    predicted: Mapping[str, Array],
    base: Array,
    library: Sequence[Candidate],
    columns: Columns,
) -> list[str]:
    """Sentences about outputs that fit far better with the opposite sign; `base` (N, p) is free."""
    if data.target.population or len(data) < LEAST:
        return []
    rows = np.unique(np.linspace(0, len(data) - 1, min(len(data), ROWS)).astype(np.int64))
    blocks = list(_blocks(data, library, columns))
    found = []
    for at, output in enumerate(data.outputs):
        mine = rows + at * len(data)
        q = basis(base[mine])
        own = [(one, beside(block[mine], q)) for one, block in blocks]
        y = beside(data.measured[output.name][rows], q)
        p = beside(predicted[output.name][rows], q)
        given = _best(y - p, own)
        ways = {"reading": _best(-y - p, own), "gap": _best(p - y, own)}
        way = min(ways, key=lambda one: ways[one].left)
        if ways[way].left < FAR * given.left:
            found.append(_said(data, output.name, way, ways[way], given, library))
    return found


def _blocks(
    data: GapData, library: Sequence[Candidate], columns: Columns
) -> Iterator[tuple[Candidate, Array]]:
    """Columns (N, m) of effects that act at the output, at some of their shapes."""
    for one in library:
        inside = one.effect.place(data.target) is not None or isinstance(one.effect, InsideSeveral)
        if one.alone or inside:
            continue
        shapes = grid(one, 1.0)
        every = max(1, len(shapes) // SHAPES)
        for shape in shapes[::every]:
            yield one, columns.of(one, shape)


def _best(gap: Array, blocks: Sequence[tuple[Candidate, Array]]) -> _Best:
    """The best single effect on a gap (n,), its bounds kept."""
    whole = float(gap @ gap)
    found = _Best(whole)
    for one, x in blocks:
        low, high = one.bounds
        kept = np.linalg.norm(x, axis=0) > 0.0
        if not kept.any():
            continue
        x, low, high = x[:, kept], low[kept], high[kept]
        sizes, *_ = np.linalg.lstsq(x, gap, rcond=1e-9)
        if (sizes < low).any() or (sizes > high).any():
            sizes = _within(x, gap, low, high)
        left = float(np.sum((gap - x @ sizes) ** 2))
        if left < found.left:
            found = _Best(left, one.name)
    return found


def _within(x: Array, gap: Array, low: Array, high: Array) -> Array:
    """Sizes within their bounds: those that leave them are held at the end, the others refitted."""
    held: NDArray[np.bool_] = np.zeros(len(low), dtype=bool)
    sizes = np.zeros(len(low))
    for _ in range(len(low)):
        rest = gap - x[:, held] @ sizes[held]
        sizes[~held] = np.linalg.lstsq(x[:, ~held], rest, rcond=1e-9)[0]
        out = ~held & ((sizes < low) | (sizes > high))
        if not out.any():
            break
        sizes = np.where(out, np.clip(sizes, low, high), sizes)
        held |= out
    return sizes


def _said(
    data: GapData, output: str, way: str, best: _Best, given: _Best, library: Sequence[Candidate]
) -> str:
    """The note about one output."""
    ratio = np.sqrt(given.left / max(best.left, 1e-300))
    head = f"is the sign of {output} the other way round? "
    if way == "reading":
        what = f"Turned, it is {ratio:.3g} times nearer to its prediction"
        more = f" with {best.name}" if best.name else ""
        return (f"{head}{what}{more}; give it sense = -1 if a positive reading means the opposite "
                "of docs/conventions.md")  # fmt: skip
    effect = next(one.effect for one in library if one.name == best.name)
    acting = [c.name for c in data.target.columns if c.role in effect.needs]
    of = f", or of {' or '.join(acting)}," if acting else ""
    return (f"{head}With the opposite sign of the gap {best.name} leaves {ratio:.3g} times less "
            f"than any effect with its own. If {output} and its prediction{of} count against "
            "docs/conventions.md, give them sense = -1; if not, the simulation has too much of "
            "it")  # fmt: skip
