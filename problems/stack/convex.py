"""The convex form of a stack: what is proven about its cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...models.costs import Reciprocal
from ...models.stack.linear import SIGMAS
from ..forms import Feature, Form, Way
from .definition import Part, Process

if TYPE_CHECKING:
    from .problem import Stack

Array = NDArray[np.float64]
FREE = Reciprocal(a=0.0, b=0.0)
"""Cost of a part that has none."""
ROWS = ("variation", "worst_case", "rss")
"""Outputs that the form can describe."""


def form_of(stack: Stack) -> Form | None:
    """The convex form; None where `variation` is a Monte Carlo estimate.

    Fixed parts go into the offset and the constant, but for those that are correlated with others.
    """
    method = stack.definition.requirement.method
    if method == "monte_carlo":
        return None
    named = {*stack.objectives, *(limit.name for limit in stack.limits)}
    rows = tuple(name for name in ROWS if name == "variation" or name in named)
    linear, spread = _coefficients(stack, rows)
    parts, t = stack.definition.parts, np.array([part.low for part in stack.definition.parts])
    settled = _settled(stack)
    kept = [at for at in range(len(parts)) if not settled[at]]
    correlation = _correlation(stack.linear.covariance)
    within = correlation[np.ix_(kept, kept)]
    independent = np.array_equal(within, np.eye(len(kept)))
    return Form(
        outputs=rows,
        features=tuple(_feature(parts[at], linear[:, at], spread[:, at]) for at in kept),
        offset=linear[:, settled] @ t[settled],
        constant=np.array([_square(one, t, correlation, settled) for one in spread]),
        statement=_statement(method) + _without(_left_out(stack, rows)),
        base=float(sum(_fixed_cost(p) for p, out in zip(parts, settled, strict=True) if out)),
        correlation=None if independent else within,
        relaxed=_left_out(stack, rows),
    )


def _coefficients(stack: Stack, rows: tuple[str, ...]) -> tuple[Array, Array]:
    """Linear and spread coefficients (rows, parts)."""
    model = stack.linear
    std = SIGMAS * np.sqrt(np.diag(model.covariance))
    nothing = np.zeros_like(std)
    kinds = {
        "worst_case": (model.worst, nothing),
        "rss": (nothing, std),
        "shifted_rss": (model.shift, std),
    }
    method = stack.definition.requirement.method
    found = [kinds[method if row == "variation" else row] for row in rows]
    return np.array([one for one, _ in found]), np.array([one for _, one in found])


def _correlation(covariance: Array) -> Array:
    """Correlation of the parts' contributions; a part without spread goes with no other."""
    std = np.sqrt(np.diag(covariance))
    scale = np.outer(std, std)
    found: Array = np.divide(covariance, scale, out=np.zeros_like(covariance), where=scale > 0.0)
    np.fill_diagonal(found, 1.0)
    return found


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


def _feature(part: Part, linear: Array, spread: Array) -> Feature:
    ways = tuple(
        _way(process, at, linear, spread, part.alternatives)
        for at, process in enumerate(part.processes)
    )
    choice = f"{part.name}_process" if len(ways) > 1 else ""
    return Feature(f"{part.name}_t", ways, choice, part.count)


def _way(process: Process, at: int, linear: Array, spread: Array, chosen: bool) -> Way:
    return Way(
        curve=process.curve or FREE,
        low=process.low,
        high=process.high,
        linear=tuple(linear.tolist()),
        spread=tuple(spread.tolist()),
        choice=float(at) if chosen else 0.0,
    )


def _fixed_cost(part: Part) -> float:
    curve = part.processes[0].curve
    return 0.0 if curve is None else part.count * float(curve.cost(np.array([part.low]))[0])


def _statement(method: str) -> str:
    what = {
        "worst_case": "its worst case",
        "rss": "its root sum square",
        "shifted_rss": "mean shifts plus root sum square",
    }[method]
    return f"least cost of the linearised stack, variation = {what}"


def _without(limits: tuple[str, ...]) -> str:
    return f"; limits left out: {', '.join(limits)}" if limits else ""


def _left_out(stack: Stack, rows: tuple[str, ...]) -> tuple[str, ...]:
    """Limits that the form cannot keep: on other quantities, or from below."""
    return tuple(
        limit.name
        for limit in stack.limits
        if limit.name not in (*rows, "cost") or np.isfinite(limit.low)
    )
