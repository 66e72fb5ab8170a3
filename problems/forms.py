"""The convex form of a problem: what the exact solvers and the proven bounds work on.

Cost is separable, and every requirement is convex in the tolerances t_j:

    cost      = base + sum_j count_j C_j(t_j)
    value_i   = offset_i + sum_j (o_ij + m_ij t_j) + S_i,  s_ij = a_ij t_j
    S_i       = sqrt(constant_i + s_i' R s_i), or
                the p_i-quantile of sum_j s_ij D_ij + fixed deviations, p_i >= 1/2

Worst case is a = 0, root sum square is m = 0, an estimated mean shift (Cpk) and "mean plus k
standard deviations" have both. The deviations D of a `Quantile` are independent, even and
log-concave; then it is convex in the tolerances (docs/proofs.md). A yield is such a requirement: a
share p of the units lies below a limit u where mean + q_p <= u. A feature may be made in several
ways (alternative processes, grades, or pieces of a range), each with coefficients of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..models.costs import CostCurve
from ..models.propagation.even import Even
from ..models.propagation.symmetric_sum import SymmetricSum, Tangent

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Way:
    """One way of making a feature: cost curve, range of t (low may equal high), coefficients.

    `linear` (m_ij), `spread` (a_ij) and `offset` (o_ij) hold one number per requirement; an empty
    offset is zero. `choice` is the value that the feature's choice variable takes for it.
    """

    curve: CostCurve
    low: float
    high: float
    linear: tuple[float, ...]
    spread: tuple[float, ...]
    offset: tuple[float, ...] = ()
    choice: float = 0.0


@dataclass(frozen=True, slots=True)
class Piece:
    """One independent deviation `weight` z, z ~ `law`, of a feature or of what is fixed."""

    weight: float
    law: Even


@dataclass(frozen=True, eq=False)
class Quantile:
    """The quantile at a `probability` >= 1/2 of what features deviate, with gradient and error.

    Feature j deviates by s_j sum over its `pieces` of weight z; `fixed` pieces deviate as well.
    """

    probability: float
    pieces: tuple[tuple[Piece, ...], ...]
    fixed: tuple[Piece, ...] = ()

    @cached_property
    def _sum(self) -> tuple[SymmetricSum, Array, Array]:
        """All deviations, the feature of each (-1: none), and its weight."""
        every = [(at, one) for at, own in enumerate(self.pieces) for one in own]
        every += [(-1, one) for one in self.fixed]
        owner = np.array([at for at, _ in every], dtype=float)
        weight = np.array([abs(one.weight) for _, one in every])
        return SymmetricSum([one.law for _, one in every]), owner, weight

    def tangent(self, s: Array) -> Tangent:
        """Value (n,) and gradient (n, features) at scales s (n, features), and their errors."""
        total, owner, weight = self._sum
        own = owner.astype(int)
        wide = np.where(own >= 0, s[:, np.maximum(own, 0)], 1.0) * weight
        found = total.quantile(wide, self.probability)
        kept = np.flatnonzero(own >= 0)
        gradient, doubt = np.zeros((2, len(self.pieces), len(s)))
        np.add.at(gradient, own[kept], (found.gradient * weight).T[kept])
        np.add.at(doubt, own[kept], (found.gradient_error * weight).T[kept])
        side = np.where(s < 0.0, -1.0, 1.0)
        return Tangent(found.value, side * gradient.T, found.value_error, doubt.T)


@dataclass(frozen=True, slots=True)
class Feature:
    """A toleranced feature, made in one of several ways; `count` like parts share one tolerance.

    `variable` is the design variable that t is (empty where t only stands for the choice), `choice`
    the design variable that names the way (empty where there is nothing to choose).
    """

    variable: str
    ways: tuple[Way, ...]
    choice: str = ""
    count: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """The convex form of a problem; see the module for its formula.

    `outputs` names the requirements, in the order of the coefficients. `settled` holds the
    variables that the form does not search, at the values that are best for it. `relaxed` names the
    limits that it leaves out: with any, it still bounds the cost from below. `exact` says that
    its values are those of the outputs; else they are lower bounds of them. `statement` says in
    words what is proven. `tested` names limits that it leaves out as well, but that are rarely met:
    its optimum counts where it keeps them.

    `quantiles` holds for each requirement what its S is, None for a root; empty: all are roots.
    `most` (r,) are upper limits that requirements have of themselves, in the place of a limit of
    the problem (a yield); inf where it is the output's. `also` are forms for designs that this one
    leaves out: what is proven is the least of all.
    """

    outputs: tuple[str, ...]
    features: tuple[Feature, ...]
    offset: Array
    constant: Array
    statement: str
    base: float = 0.0
    correlation: Array | None = None
    exact: bool = True
    settled: Mapping[str, float] = field(default_factory=dict)
    relaxed: tuple[str, ...] = ()
    quantiles: tuple[Quantile | None, ...] = ()
    most: tuple[float, ...] = ()
    also: tuple[Form, ...] = ()
    tested: tuple[str, ...] = ()
    stands: Mapping[str, str] = field(default_factory=dict)
    """By requirement, an output that it stands for: what is proven holds at equal requirements."""

    @property
    def rows(self) -> tuple[Quantile | None, ...]:
        """What S of each requirement is: a quantile, or None for a root."""
        return self.quantiles or (None,) * len(self.outputs)

    def asked(self, row: str) -> tuple[str, str]:
        """Outputs that ask for a requirement: itself and what it stands for."""
        return row, self.stands.get(row, row)

    @property
    def own_limits(self) -> Array:
        """Upper limits (r,) that requirements have of themselves, inf where they have none."""
        return np.array(self.most) if self.most else np.full(len(self.outputs), np.inf)

    @property
    def separable(self) -> bool:
        """Whether prices alone make it separable: one root without correlation."""
        return len(self.outputs) == 1 and self.correlation is None and self.rows == (None,)

    @property
    def combinations(self) -> int:
        """Number of ways to choose one way per feature."""
        return int(np.prod([float(len(feature.ways)) for feature in self.features]))
