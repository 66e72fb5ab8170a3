"""The convex form of a stack: what is proven about its cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ...models.costs import Reciprocal
from ...models.stack import Law
from ...models.stack.linear import SIGMAS
from ..forms import Feature, Form, Piece, Quantile, Way
from ..limits import Limit
from .definition import Part

if TYPE_CHECKING:
    from .problem import Stack

Array = NDArray[np.float64]
FREE = Reciprocal(a=0.0, b=0.0)
"""Cost of a part that has none."""
ROWS = ("variation", "worst_case", "rss")
"""Outputs that the form can describe, beside a limit on the yield."""
CENTRED = 1e-12
"""Relative difference of two limits' distances from the mean that counts as none."""


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A requirement of the form: its output, coefficients (parts,), and its quantile if it is one.

    A root has its spread in `spread`; of a quantile that is 1 for each part. `most` is an upper
    limit of its own.
    """

    output: str
    linear: Array
    spread: Array
    probability: float | None = None
    most: float = np.inf


def form_of(stack: Stack, method: str) -> Form | None:
    """The convex form with the variation of a `method`; None where limits leave no process.

    Fixed parts go into the offset and the constant, but for those that are correlated with others.
    None as well where the half-width of a sample has no law.
    """
    rows = _rows(stack, method)
    if not rows or not _possible(stack):
        return None
    linear, spread = np.array([one.linear for one in rows]), np.array([one.spread for one in rows])
    parts, t = stack.definition.parts, np.array([part.low for part in stack.definition.parts])
    settled = _settled(stack)
    kept = [at for at in range(len(parts)) if not settled[at]]
    diagonal = np.sqrt(np.diag(stack.linear.covariance))
    safe = np.where(diagonal > 0.0, diagonal, 1.0)  # 0: pieces that compensate each other wholly
    correlation = stack.linear.covariance / np.outer(safe, safe)
    np.fill_diagonal(correlation, 1.0)
    within = correlation[np.ix_(kept, kept)]
    left_out = _left_out(stack, tuple(one.output for one in rows))
    independent = np.array_equal(within, np.eye(len(kept)))
    quantiles = tuple(_quantile(stack, one, kept, settled, t) for one in rows)
    rooted = [0.0 if one.probability else _square(one.spread, t, correlation, settled)
              for one in rows]  # fmt: skip
    names = [one.output for one in rows if one.most < np.inf]
    return Form(
        outputs=tuple(one.output for one in rows),
        features=tuple(
            _feature(parts[at], linear[:, at], spread[:, at], _range(stack, parts[at]))
            for at in kept
        ),
        offset=linear[:, settled] @ t[settled],
        constant=np.array(rooted),
        statement=_statement(stack, method, left_out),
        base=float(sum(_fixed_cost(p) for p, out in zip(parts, settled, strict=True) if out)),
        correlation=None if independent else within,
        exact=len(names) == len(set(names)),
        relaxed=left_out,
        quantiles=quantiles if any(one is not None for one in quantiles) else (),
        most=tuple(one.most for one in rows) if names else (),
    )


def _rows(stack: Stack, method: str) -> list[Row]:
    """The requirements that the form describes."""
    named = {*stack.objectives, *(limit.name for limit in stack.limits)}
    outputs = tuple(name for name in ROWS if name == "variation" or name in named)
    if method == "monte_carlo":
        if not isinstance(stack.law, Law):
            return []
        p = 0.5 * (1.0 + stack.settings.propagation.coverage)
        found = [_at(stack, "variation", p), *_linear_rows(stack, outputs[1:], method)]
    else:
        found = _linear_rows(stack, outputs, method)
    return [*found, *_yield_rows(stack)]


def _linear_rows(stack: Stack, outputs: tuple[str, ...], method: str) -> list[Row]:
    linear, spread = _coefficients(stack, outputs, method)
    return [Row(*one) for one in zip(outputs, linear, spread, strict=True)]


def _at(stack: Stack, output: str, p: float, side: float = 0.0, most: float = np.inf) -> Row:
    """side * mean + the p-quantile of the deviations: a root where all parts are normal."""
    law = stack.law
    assert isinstance(law, Law)
    linear = side * law.mean
    if law.covariance is not None:
        return Row(output, linear, ndtri(p) * np.sqrt(np.diag(law.covariance)), None, most)
    return Row(output, linear, np.ones_like(linear), p, most)


def _yield_rows(stack: Stack) -> list[Row]:
    """A least yield of one half at least, as quantiles that keep the limits of the requirement.

    Exact for one limit, and for two about a mean that does not move with the tolerances; else both
    are kept at the whole yield, which any design does that keeps it.
    """
    least = max((one.low for one in stack.limits if one.name == "yield_percent"), default=0.0)
    p, law = 0.01 * least, stack.law
    if not isinstance(law, Law) or not 0.5 <= p < 1.0:
        return []
    mechanism = law.mechanism
    above, below = mechanism.upper - mechanism.centre, mechanism.centre - mechanism.lower
    two = bool(np.isfinite(above) and np.isfinite(below))
    if two and abs(above - below) <= CENTRED * (above + below) and not np.any(law.mean):
        return [_at(stack, "yield_percent", 0.5 * (1.0 + p), 0.0, max(above, below))]
    return [
        _at(stack, "yield_percent", p, side, room)
        for side, room in ((1.0, above), (-1.0, below))
        if np.isfinite(room)
    ]


def _quantile(
    stack: Stack, row: Row, kept: list[int], settled: NDArray[np.bool_], t: Array
) -> Quantile | None:
    """The deviations of a row: of the parts `kept`, and fixed ones of those that are `settled`."""
    law = stack.law
    if row.probability is None or not isinstance(law, Law):
        return None
    pieces: list[list[Piece]] = [[] for _ in t]
    for at, slope, one in zip(law.mechanism.owner, law.slopes, law.laws, strict=True):
        pieces[at].append(Piece(float(slope), one))
    fixed = [
        Piece(float(one.weight * t[at]), one.law)
        for at in np.flatnonzero(settled).tolist()
        for one in pieces[at]
    ]
    return Quantile(row.probability, tuple(tuple(pieces[at]) for at in kept), tuple(fixed))


def shortfall(stack: Stack, designs: Array, found: Mapping[str, Array]) -> Array:
    """By how much (n,) the limits of the requirement would have to give way for the yield asked.

    One step of Newton's method; 0 where no yield is asked or its law is not known.
    """
    least = max((one.low for one in stack.limits if one.name == "yield_percent"), default=0.0)
    if not isinstance(stack.law, Law) or least <= 0.0:
        return np.zeros(len(designs))
    edge = stack.law.edge_density(stack.tolerances(designs))
    lacking = 0.01 * (least - found["yield_percent"])
    return np.asarray(lacking / np.maximum(edge, 1e-300))


def _possible(stack: Stack) -> bool:
    """Whether limits leave every part a process."""
    ends = [(part, *_range(stack, part)) for part in stack.definition.parts]
    return all(
        any(max(one.low, low) <= min(one.high, high) for one in part.processes)
        for part, low, high in ends
    )


def _coefficients(stack: Stack, rows: tuple[str, ...], method: str) -> tuple[Array, Array]:
    """Linear and spread coefficients (rows, parts)."""
    model = stack.linear
    std = SIGMAS * np.sqrt(np.diag(model.covariance))
    nothing = np.zeros_like(std)
    kinds = {
        "worst_case": (model.worst, nothing),
        "rss": (nothing, std),
        "shifted_rss": (model.shift, std),
    }
    found = [kinds[method if row == "variation" else row] for row in rows]
    return np.array([one for one, _ in found]), np.array([one for _, one in found])


def _settled(stack: Stack) -> NDArray[np.bool_]:
    """Fixed parts that vary independently of all others, or not at all."""
    covariance = stack.linear.covariance
    alone = np.count_nonzero(covariance, axis=1) <= 1
    fixed = np.array([part.fixed for part in stack.definition.parts])
    none = np.array([part.high <= 0.0 for part in stack.definition.parts])
    return np.asarray(fixed & (alone | none))


def _square(spread: Array, t: Array, correlation: Array, settled: NDArray[np.bool_]) -> float:
    along = (spread * t)[settled]
    return float(along @ correlation[np.ix_(settled, settled)] @ along)


def _range(stack: Stack, part: Part) -> tuple[float, float]:
    """What limits leave of the tolerance of a part."""
    own = [limit for limit in stack.limits if limit.name == f"{part.name}_t"]
    low = max((limit.low for limit in own), default=-np.inf)
    return low, min((limit.high for limit in own), default=np.inf)


def _feature(part: Part, linear: Array, spread: Array, ends: tuple[float, float]) -> Feature:
    """The processes of a part as ways."""
    ways = tuple(
        Way(
            curve=process.curve or FREE,
            low=low,
            high=high,
            linear=tuple(linear.tolist()),
            spread=tuple(spread.tolist()),
            choice=float(at) if part.alternatives else 0.0,
        )
        for at, process in enumerate(part.processes)
        for low, high in [(max(process.low, ends[0]), min(process.high, ends[1]))]
        if low <= high
    )
    choice = f"{part.name}_process" if part.alternatives else ""
    return Feature(f"{part.name}_t", ways, choice, part.count)


def _fixed_cost(part: Part) -> float:
    curve = part.processes[0].curve
    return 0.0 if curve is None else part.count * float(curve.cost(np.array([part.low]))[0])


def _statement(stack: Stack, method: str, left_out: tuple[str, ...]) -> str:
    what = {
        "worst_case": "its worst case",
        "rss": "its root sum square",
        "shifted_rss": "mean shifts plus root sum square",
        "monte_carlo": "half the width that holds the coverage",
    }[method]
    more = f"; limits left out: {', '.join(left_out)}" if left_out else ""
    if "yield_percent" in left_out and isinstance(stack.law, str):
        more += f" ({stack.law})"
    return f"least cost of the linearised stack, variation = {what}{more}"


def _left_out(stack: Stack, rows: tuple[str, ...]) -> tuple[str, ...]:
    """Limits that the form cannot keep: on other quantities, or from below."""
    tolerances = {f"{part.name}_t" for part in stack.definition.parts if not part.fixed}
    return tuple(
        limit.name
        for limit in stack.limits
        if limit.name not in tolerances and (limit.name not in (*rows, "cost") or _left(limit))
    )


def _left(limit: Limit) -> bool:
    """Whether the form leaves out one side of a limit on an output that it has."""
    return bool(np.isfinite(limit.high if limit.name == "yield_percent" else limit.low))
