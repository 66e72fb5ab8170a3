"""Tooth modification by document B: least sum of deviations from a target, under g1 to g5.

Every clearance is linear in (dr_rp, dr_p), so that the problem is a linear programme: minimise
sum w_i t_i with |clearance(phi_i) - target_i| <= t_i. HiGHS solves it, and its multipliers prove
it: for multipliers y of any origin, y . b + min over the box of (c - A'y) . x is a lower bound of
the optimum, which is computed here independently of the solver.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from ...arrays import Array
from ...units import UM
from .clearance_targets import Target
from .geometry import RvGeometry
from .modification import clearance, raw_clearance

Clearance = Callable[[RvGeometry, Array, Array, Array], Array]
CLEARANCES: dict[str, Clearance] = {"raw": raw_clearance, "after_contact": clearance}
"""D_raw, the profile in its nominal position, and D, after the disc has turned to first contact."""
LARGEST = 1e-3
"""Largest size [m] of a modification in the search: ten times the largest modification in use."""


@dataclass(frozen=True, slots=True)
class Fit:
    """The optimum: modifications [m], the sum of deviations [m] and its proven lower bound [m]."""

    dr_rp: float
    dr_p: float
    deviation: float
    bound: float

    @property
    def gap(self) -> float:
        """Deviation minus its proven lower bound [m]."""
        return self.deviation - self.bound


@dataclass(frozen=True, slots=True, eq=False)
class Programme:
    """min cost . x, above x <= below, equal x = to, 0 bound: low <= x <= high."""

    cost: Array
    above: Array
    below: Array
    equal: Array
    to: Array
    low: Array
    high: Array

    def bound(self, upper: Array, equality: Array) -> float:
        """Lower bound of the optimum by multipliers (upper <= 0) of the constraints."""
        upper = np.minimum(upper, 0.0)
        reduced = self.cost - self.above.T @ upper - self.equal.T @ equality
        within = np.minimum(reduced * self.low, reduced * self.high).sum()
        return float(upper @ self.below + equality @ self.to + within)


def fit(geometry: RvGeometry, target: Target, radial_gap: float | None, kind: str = "raw") -> Fit:
    """The modification nearest to `target`; `radial_gap` [m] is kept exactly, or free where None.

    `kind` is one of `CLEARANCES`. g4 is printed as > 0: its closure, >= 0, is used. Raises
    ArithmeticError where no modification meets the constraints (a gap beyond `LARGEST`).
    """
    programme = _programme(geometry, target, radial_gap, CLEARANCES[kind])
    solution = scipy.optimize.linprog(
        programme.cost,
        A_ub=programme.above,
        b_ub=programme.below,
        A_eq=programme.equal,
        b_eq=programme.to,
        bounds=list(zip(programme.low.tolist(), programme.high.tolist(), strict=True)),
        method="highs",
    )
    if solution.x is None or solution.fun is None:
        raise ArithmeticError(f"no modification meets the constraints g1 to g5: {solution.message}")
    bound = programme.bound(solution.ineqlin.marginals, solution.eqlin.marginals)
    dr_rp, dr_p = (float(value) * UM for value in solution.x[:2])
    return Fit(dr_rp, dr_p, float(solution.fun) * UM, bound * UM)


def _programme(geometry: RvGeometry, target: Target, radial_gap: float | None, kind: Clearance) -> Programme:
    """In micrometres: x = (dr_rp, dr_p, t of every angle that counts)."""
    zero, unit = np.zeros(1), np.ones(1)
    rows = np.stack([kind(geometry, unit, zero, target.phi), kind(geometry, zero, unit, target.phi)], axis=1)
    counts = target.weight > 0.0
    size, clearance = int(counts.sum()), target.clearance[counts] / UM
    slack = -np.eye(size)
    inside = rows[counts]
    g34 = np.array([[-1.0, 1.0], [-1.0, geometry.flank]])
    nonnegative = np.vstack([g34, -rows])
    above = np.block([[inside, slack], [-inside, slack], [nonnegative, np.zeros((len(nonnegative), size))]])
    below = np.concatenate([clearance, -clearance, np.zeros(len(nonnegative))])
    equal = np.zeros((0 if radial_gap is None else 1, 2 + size))
    equal[:, :2] = (1.0, -1.0)
    to = np.full(len(equal), 0.0 if radial_gap is None else radial_gap / UM)
    most = LARGEST / UM
    reach = float(np.abs(clearance).max(initial=0.0)) + most * float(np.abs(rows).sum(axis=1).max())
    low = np.concatenate([[-most, -most], np.zeros(size)])
    high = np.concatenate([[0.0, 0.0], np.full(size, reach)])
    cost = np.concatenate([[0.0, 0.0], target.weight[counts]])
    return Programme(cost, above, below, equal, to, low, high)
