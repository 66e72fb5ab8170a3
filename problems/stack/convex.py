"""The convex form of a stack: what is proven about its cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...models.costs import Reciprocal
from ...models.stack.linear import SIGMAS
from ..forms import Feature, Form, Way
from .definition import Part

if TYPE_CHECKING:
    from .problem import Stack

Array = NDArray[np.float64]
FREE = Reciprocal(a=0.0, b=0.0)
"""Cost of a part that has none."""
ROWS = ("variation", "worst_case", "rss")
"""Outputs that the form can describe."""


def form_of(stack: Stack, method: str) -> Form | None:
    """The convex form with the linear variation of a `method`; None where limits leave no process.

    Fixed parts go into the offset and the constant, but for those that are correlated with others.
    """
    if not _possible(stack):
        return None
    named = {*stack.objectives, *(limit.name for limit in stack.limits)}
    rows = tuple(name for name in ROWS if name == "variation" or name in named)
    linear, spread = _coefficients(stack, rows, method)
    parts, t = stack.definition.parts, np.array([part.low for part in stack.definition.parts])
    settled = _settled(stack)
    kept = [at for at in range(len(parts)) if not settled[at]]
    diagonal = np.sqrt(np.diag(stack.linear.covariance))
    safe = np.where(diagonal > 0.0, diagonal, 1.0)  # 0: pieces that compensate each other wholly
    correlation = stack.linear.covariance / np.outer(safe, safe)
    np.fill_diagonal(correlation, 1.0)
    within = correlation[np.ix_(kept, kept)]
    left_out = _left_out(stack, rows)
    independent = np.array_equal(within, np.eye(len(kept)))
    return Form(
        outputs=rows,
        features=tuple(
            _feature(parts[at], linear[:, at], spread[:, at], _range(stack, parts[at]))
            for at in kept
        ),
        offset=linear[:, settled] @ t[settled],
        constant=np.array([_square(one, t, correlation, settled) for one in spread]),
        statement=_statement(method, left_out),
        base=float(sum(_fixed_cost(p) for p, out in zip(parts, settled, strict=True) if out)),
        correlation=None if independent else within,
        relaxed=left_out,
    )


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


def _statement(method: str, left_out: tuple[str, ...]) -> str:
    what = {
        "worst_case": "its worst case",
        "rss": "its root sum square",
        "shifted_rss": "mean shifts plus root sum square",
    }[method]
    more = f"; limits left out: {', '.join(left_out)}" if left_out else ""
    return f"least cost of the linearised stack, variation = {what}{more}"


def _left_out(stack: Stack, rows: tuple[str, ...]) -> tuple[str, ...]:
    """Limits that the form cannot keep: on other quantities, or from below."""
    tolerances = {f"{part.name}_t" for part in stack.definition.parts if not part.fixed}
    return tuple(
        limit.name
        for limit in stack.limits
        if limit.name not in tolerances
        and (limit.name not in (*rows, "cost") or np.isfinite(limit.low))
    )
