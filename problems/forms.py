"""The convex form of a problem: what the exact solvers and the proven bounds work on.

Cost is separable, and every requirement is convex in the tolerances t_j:

    cost      = base + sum_j count_j C_j(t_j)
    value_i   = offset_i + sum_j (o_ij + m_ij t_j) + sqrt(constant_i + s_i' R s_i),  s_ij = a_ij t_j

Worst case is a = 0, root sum square is m = 0, an estimated mean shift (Cpk) and "mean plus k
standard deviations" have both. A feature may be made in several ways (alternative processes,
grades, or pieces of a range), each with coefficients of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..models.costs import CostCurve

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
    tested: tuple[str, ...] = ()

    @property
    def combinations(self) -> int:
        """Number of ways to choose one way per feature."""
        return int(np.prod([float(len(feature.ways)) for feature in self.features]))
