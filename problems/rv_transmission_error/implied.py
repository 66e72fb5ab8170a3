"""The relative costs that document A's allocation implies.

Least cost sum a_i / v_i^b with a root sum of squares sum J_i^2 v_i^2 = P^2 has, by Lagrange,
a_i b / v_i^(b + 1) proportional to J_i^2 v_i: v_i proportional to (a_i / J_i^2)^(1/(b + 2)), and
read backwards a_i proportional to J_i^2 v_i^(b + 2) / b.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...models.assembly.chain import DatumFlowChain
from .declared import AXES

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
