"""The convex form of a problem: what the exact solvers and the proven bounds work on.

Cost is separable, and every requirement is convex in the tolerances t_j:

    cost      = base + sum_j count_j C_j(t_j)
    value_i   = offset_i + sum_j (o_ij + m_ij t_j) + S_i,  s_ij = a_ij t_j
    S_i       = sqrt(constant_i + s_i' R s_i), with a `Surplus` of the squares of s_i under the root
                where processes are known from samples (a norm, docs/proofs.md), or
                the p_i-quantile of sum_j s_ij D_ij + fixed deviations, p_i >= 1/2

Worst case has a = 0, root sum square has m = 0, an estimated mean shift (Cpk) and "mean plus k
standard deviations" have both. The deviations D of a `Quantile` are independent, even and
log-concave; then it is convex in the tolerances (docs/proofs.md). A yield is such a requirement: a
fraction p of the units lies below a limit u where mean + q_p <= u. A feature may be made in several
ways (alternative processes, grades, or pieces of a range), with different coefficients.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..arrays import Array
from ..models.capability.norm import Surplus
from ..models.costs import CostCurve
from ..models.propagation.even import Even
from ..models.propagation.symmetric_sum import SymmetricSum, Tangent


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
    """The quantile at a `probability` >= 1/2 of what features deviate.

    Feature j deviates by s_j sum over its `pieces` of weight z; `fixed` pieces deviate as well.
    """

    probability: float
    pieces: tuple[tuple[Piece, ...], ...]
    fixed: tuple[Piece, ...] = ()


class Quantiles:
    """The quantiles among the requirements of a form, all at once.

    Deviations that several of them have in common are one term of one sum, with a weight of its own
    (0 where it is left out) in each.
    """

    def __init__(self, rows: Sequence[Quantile | None]) -> None:
        self.rows = np.array([at for at, quantile in enumerate(rows) if quantile is not None], dtype=int)
        known = [quantile for quantile in rows if quantile is not None]
        self.probability = np.array([quantile.probability for quantile in known])
        weight: dict[tuple[int, int, Even], Array] = {}
        for row, quantile in enumerate(known):
            for at, pieces in enumerate((*quantile.pieces, quantile.fixed)):
                owner = at if at < len(quantile.pieces) else -1
                for place, piece in enumerate(pieces):
                    column = weight.setdefault((owner, place, piece.law), np.zeros(len(known)))
                    column[row] += abs(piece.weight)
        self._sum = SymmetricSum([law for _, _, law in weight])
        self._owner = np.array([owner for owner, _, _ in weight], dtype=int)
        self._weight = np.array(list(weight.values())).reshape(len(weight), len(known)).T

    def tangent(self, s: Array, sure: bool = True) -> Tangent:
        """Values (n, k) of the k quantiles and gradients (n, k, features) at scales of that shape.

        The errors of both are included; those of gradients are wider than necessary unless `sure`.
        """
        n, k, features = s.shape
        featured = self._owner >= 0
        scale = np.where(featured, s[:, :, np.maximum(self._owner, 0)], 1.0) * self._weight
        quantiles = self._sum.quantile(scale.reshape(n * k, -1), np.tile(self.probability, n), sure)
        gradient, doubt = np.zeros((2, features, n, k))
        slopes, errors = (
            np.where(self._weight > 0.0, values.reshape(n, k, -1), 0.0) * self._weight
            for values in (quantiles.gradient, quantiles.gradient_error)
        )
        np.add.at(gradient, self._owner[featured], np.moveaxis(slopes, 2, 0)[featured])
        np.add.at(doubt, self._owner[featured], np.moveaxis(errors, 2, 0)[featured])
        side = np.where(s < 0.0, -1.0, 1.0)
        value, error = (values.reshape(n, k) for values in (quantiles.value, quantiles.value_error))
        return Tangent(value, side * np.moveaxis(gradient, 0, 2), error, np.moveaxis(doubt, 0, 2))


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


@dataclass(frozen=True, eq=False)
class Form:
    """The convex form of a problem; see the module for its formula.

    `outputs` names the requirements, in the order of the coefficients. `settled` holds the
    best values of the variables that the form does not search. `relaxed` names the
    limits that it leaves out: with any, it still bounds the cost from below. `exact` says that
    its values are those of the outputs; else they are lower bounds of them. `statement` says in
    words what is proven. `tested` names limits that it leaves out as well, but that are rarely met:
    its optimum counts where it keeps them.

    `quantiles` holds for each requirement what its S is, None for a root; empty: all are roots.
    `most` (r,) are the requirements' own upper limits, in place of a limit of the problem (on a
    yield); inf where the limit is on the output. `also` are forms for designs that this one
    leaves out: the proven bound is the least of all.
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
    surpluses: tuple[Surplus | None, ...] = ()
    """By requirement, what uncertain processes add under its root; empty: nothing anywhere."""
    labels: tuple[tuple[str, str], ...] = ()
    """By requirement, which part of its output it is ("upper limit of gap"), and its unit; empty: it
    is the output."""

    @property
    def rows(self) -> tuple[Quantile | None, ...]:
        """What S of each requirement is: a quantile, or None for a root."""
        return self.quantiles or (None,) * len(self.outputs)

    @cached_property
    def joint(self) -> Quantiles | None:
        """All quantiles of the form, None where there is none."""
        return Quantiles(self.rows) if any(quantile is not None for quantile in self.rows) else None

    def requesting_outputs(self, row: str) -> tuple[str, str]:
        """Outputs that ask for a requirement: itself and what it stands for."""
        return row, self.stands.get(row, row)

    @property
    def own_limits(self) -> Array:
        """The requirements' own upper limits (r,), inf where they have none."""
        return np.array(self.most) if self.most else np.full(len(self.outputs), np.inf)

    @property
    def separable(self) -> bool:
        """Whether prices alone make it separable: one root without correlation."""
        alone = len(self.outputs) == 1 and self.correlation is None and self.rows == (None,)
        return alone and not self.surpluses

    @property
    def combinations(self) -> int:
        """Number of ways to choose one way per feature."""
        return int(np.prod([float(len(feature.ways)) for feature in self.features]))
