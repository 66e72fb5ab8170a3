"""Reversed signs: an output or a column whose sign is opposite to the convention.

An effect has the sign that physics gives it, and a load that resists winds a drive up. Where the
data fit far better with the opposite sign, a note says so first: effects selected with the wrong
sign are wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter

import numpy as np

from ...arrays import Array
from ...declarations import Output
from ...models.effects.effect import kind_of
from ...models.effects.inside import InsideSeveral
from ...models.effects.shapes import POSITIONS
from ...models.measurable import Role
from .data import GapData
from .library import Candidate, Columns, grid
from .linear import basis, projected_out

FAR = 0.25
"""Residual squares with the opposite sign, as a fraction of those with the given one, below which a
sign is doubted.
"""
SHAPES = 12
"""Number of points of an effect's grid that are tried."""
ROWS = 600
LEAST = 20
"""Number of rows from which a sign is tested."""
STEPS = 4
"""Number of effects that are fitted one after the other: a dominating wave has no sign."""
ENOUGH = 0.98
"""Largest fraction of the squares that may remain after a further effect."""
FALLS = -0.7
"""Correlation from which a prediction falls with the load."""


@dataclass(frozen=True)
class _Best:
    """The residual sum of squares after a few effects, and the first of them that has a sign."""

    rss: float
    name: str = ""


def turned(
    data: GapData, predicted: Mapping[str, Array], base: Array, library: Sequence[Candidate], columns: Columns
) -> list[str]:
    """Sentences about outputs that fit far better with the opposite sign; `base` (N, p) is free."""
    if data.target.population or len(data) < LEAST:
        return []
    rows = np.unique(np.linspace(0, len(data) - 1, min(len(data), ROWS)).astype(np.int64))
    blocks = list(_blocks(data, library, columns))
    sentences = []
    for at, output in enumerate(data.outputs):
        output_rows = rows + at * len(data)
        q = basis(base[output_rows])
        output_blocks = [(candidate, projected_out(block[output_rows], q)) for candidate, block in blocks]
        y = projected_out(data.measured[output.name][rows], q)
        p = projected_out(predicted[output.name][rows], q)
        as_given = _best(y - p, output_blocks)
        reversed_output, reversed_gap = _best(-y - p, output_blocks), _best(p - y, output_blocks)
        best = min(reversed_output, reversed_gap, key=attrgetter("rss"))
        if best.rss < FAR * as_given.rss:
            ratio = float(np.sqrt(as_given.rss / max(best.rss, 1e-300)))
            note = _of_output if best is reversed_output else partial(_of_gap, data, library)
            sentences.append(f"is the sign of {output.name} reversed? {note(output.name, best.name, ratio)}")
        elif text := _falls(data, output, predicted[output.name]):
            sentences.append(text)
    return sentences


def _falls(data: GapData, output: Output, predicted: Array) -> str:
    """The note on a prediction that falls with the load, which winds a drive up, else empty."""
    load = next((c for c in data.inputs if c.role in (Role.TORQUE, Role.FORCE)), None)
    if load is None or kind_of(output.unit) not in POSITIONS or not np.ptp(predicted):
        return ""
    if float(np.corrcoef(data.measurements[load.role], predicted)[0, 1]) > FALLS:
        return ""
    return (
        f"is the sign of {output.name} or of {load.name} reversed? The prediction falls as "
        f"{load.name} rises, and a load that resists winds a drive up: give sense = -1 to what is "
        f"opposite to docs/conventions.md ({output.name} and its prediction, or {load.name})"
    )


def _blocks(data: GapData, library: Sequence[Candidate], columns: Columns) -> Iterator[tuple[Candidate, Array]]:
    """Columns (N, m) of effects that act at the output, for some of their nonlinear parameters."""
    for candidate in library:
        inside = candidate.effect.place(data.target) is not None or isinstance(candidate.effect, InsideSeveral)
        if candidate.is_nonlinear or inside:
            continue
        shapes = grid(candidate, 1.0)
        every = max(1, len(shapes) // SHAPES)
        for shape in shapes[::every]:
            yield candidate, columns.of(candidate, shape)


def _best(gap: Array, blocks: Sequence[tuple[Candidate, Array]]) -> _Best:
    """A few effects on a gap (n,), each the best on the residual of those before it."""
    whole, name, taken = float(gap @ gap), "", set[str]()
    for _ in range(STEPS):
        tried = [
            (*_residual_of(gap, candidate, x), candidate) for candidate, x in blocks if candidate.name not in taken
        ]
        if not tried:
            break
        rss, rest, candidate = min(tried, key=lambda attempt: attempt[0])
        if rss > ENOUGH * whole:
            break
        whole, gap = rss, rest
        taken.add(candidate.name)
        name = name or (candidate.name if (candidate.bounds[0] > -np.inf).any() else "")
    return _Best(whole, name)


def _residual_of(gap: Array, candidate: Candidate, x: Array) -> tuple[float, Array]:
    """The residual sum of squares and the residual of a gap after bounded columns (n, m)."""
    kept = np.linalg.norm(x, axis=0) > 0.0
    low, high = (ends[kept] for ends in candidate.bounds)
    x = x[:, kept]
    sizes, *_ = np.linalg.lstsq(x, gap, rcond=1e-9)
    if (sizes < low).any() or (sizes > high).any():
        sizes = _within(x, gap, low, high)
    rest = np.asarray(gap - x @ sizes)
    return float(rest @ rest), rest


def _within(x: Array, gap: Array, low: Array, high: Array) -> Array:
    """Sizes within their bounds: those that leave them are held at the end, the others refitted."""
    held, sizes = np.zeros(len(low), dtype=bool), np.zeros(len(low))
    for _ in range(len(low)):
        rest = gap - x[:, held] @ sizes[held]
        sizes[~held] = np.linalg.lstsq(x[:, ~held], rest, rcond=1e-9)[0]
        out = ~held & ((sizes < low) | (sizes > high))
        if not out.any():
            break
        sizes = np.where(out, np.clip(sizes, low, high), sizes)
        held |= out
    return sizes


def _of_output(output: str, effect: str, ratio: float) -> str:
    """The note on an output that is nearer to its prediction with the opposite sign."""
    more = f" with {effect}" if effect else ""
    return (
        f"With the opposite sign it is {ratio:.3g} times nearer to its prediction{more}; give it "
        "sense = -1 if a positive value means the opposite of docs/conventions.md"
    )


def _of_gap(data: GapData, library: Sequence[Candidate], output: str, effect: str, ratio: float) -> str:
    """The note on a gap that effects explain better with the opposite sign."""
    needs = {role for candidate in library if candidate.name == effect for role in candidate.effect.needs}
    acting = [c.name for c in data.target.columns if c.role in needs]
    of = f", or {' or '.join(acting)}," if acting else ""
    first = f" ({effect} first)" if effect else ""
    return (
        f"With the opposite sign of the gap the effects of the library{first} leave a residual that is "
        f"{ratio:.3g} times smaller. If {output} and its prediction{of} are opposite to "
        "docs/conventions.md, give them sense = -1; if not, the simulation contains too much of the effect"
    )
