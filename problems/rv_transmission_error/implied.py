"""What document A's allocation implies: relative costs, and crankshafts against gears.

Least cost sum a_i / v_i^b with a root sum of squares sum J_i^2 v_i^2 = P^2 has, by Lagrange,
a_i b / v_i^(b + 1) proportional to J_i^2 v_i: v_i proportional to (a_i / J_i^2)^(1/(b + 2)), and
read backwards a_i proportional to J_i^2 v_i^(b + 2) / b.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...models.assembly import DatumFlowChain
from ..arrays import Array
from .declared import AXES, DOCUMENT_MRAD, PARTS

COMPOSITES = ("sum", "rss")


def sensitivities(composite: str = "sum", chain: DatumFlowChain | None = None) -> Array:
    """J, shape (12,), of the composite final error: per part, alike about its three axes.

    `sum`: the composite is the sum of the four final angles; `rss`: their root sum of squares.
    """
    flow = (chain or DatumFlowChain()).error_matrix()
    composite_error = flow.sum(axis=0) if composite == "sum" else np.linalg.norm(flow, axis=0)
    return np.repeat(composite_error, len(AXES))


def implied_costs(tolerances: Array, influence: Array, exponent: float = 1.0) -> Array:
    """Relative costs a (n,), mean 1, under which the allocation `tolerances` (n,) is the optimum.

    `influence` is J (n,), `exponent` b > 0.
    """
    costs = influence**2 * tolerances ** (exponent + 2.0) / exponent
    return np.asarray(costs / costs.mean())


def optimal_allocation(costs: Array, influence: Array, limit: float, exponent: float = 1.0) -> Array:
    """Tolerances v (n,) of least cost sum a/v^b with sqrt(sum J^2 v^2) = `limit`."""
    shape = (costs / influence**2) ** (1.0 / (exponent + 2.0))
    return np.asarray(limit * shape / np.linalg.norm(influence * shape))


@dataclass(frozen=True, slots=True)
class Claim:
    """The text's claim "crankshafts need slightly tighter tolerances than gears" and its table."""

    ratios: Mapping[str, tuple[float, ...]]
    """Crankshaft over gear tolerance about x, y and z by chain: below 1 where the claim holds."""
    expected: Mapping[str, float]
    """The same ratio at equal reciprocal costs, by composite: alike in both chains."""
    tightest: str
    """The part with the tightest printed tolerance."""
    holds: bool
    """Whether the table bears the claim out in every chain."""
    statement: str


def crankshafts_against_gears() -> Claim:
    """Document A's claim against its own table."""
    printed = np.reshape(list(DOCUMENT_MRAD.values()), (len(PARTS), len(AXES)))
    ratios = {f"chain {at + 1}": tuple((printed[2 * at] / printed[2 * at + 1]).tolist()) for at in (0, 1)}
    expected = {}
    for composite in COMPOSITES:
        free = optimal_allocation(np.ones(printed.size), sensitivities(composite), 1.0)
        expected[composite] = float(free[0] / free[len(AXES)])
    tightest = PARTS[int(np.argmin(printed.mean(axis=1)))]
    holds = all(max(by_axis) < 1.0 for by_axis in ratios.values())
    shown = "; ".join(f"{name}: {', '.join(f'{ratio:.2f}' for ratio in by_axis)}" for name, by_axis in ratios.items())
    return Claim(
        ratios,
        expected,
        tightest,
        holds,
        f"crankshaft/gear tolerance about x, y, z: {shown}; tightest part: "
        f"{tightest.replace('_', ' ')}; that crankshafts are tighter {_verdict(holds)}; equal "
        f"reciprocal costs would give {expected['sum']:.2f} (sum of the angles) or "
        f"{expected['rss']:.2f} (root sum of squares) in both chains",
    )


def _verdict(holds: bool) -> str:
    return "holds in both chains" if holds else "does not hold in both chains"
