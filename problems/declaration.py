"""The declaration of a problem: the record that configurations, pages and proofs read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models.costs import CostCurve
from ..models.machine_offers import Offer
from ..section import Array, Output, Parameter, Value, Variable
from .settings import Bound, Settings

if TYPE_CHECKING:
    from .tolerance_problem import ToleranceProblem

Interval = tuple[float, float]
"""Lower and upper end: of a search range, or proven of an output; infinite where not known."""
Unpriced = Callable[[Mapping[str, Value]], frozenset[str]]


def check_costs(parameters: Mapping[str, Value]) -> frozenset[str]:
    """No variable is without a cost."""
    return frozenset()


@dataclass(frozen=True)
class Declaration:
    """Variables, outputs and parameters of a problem, and the defaults of its configuration."""

    variables: tuple[Variable, ...] = ()
    outputs: tuple[Output, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    costs: Mapping[str, CostCurve] = field(default_factory=dict)
    """Cost curves, by variable, where a configuration states none."""
    limits: Mapping[str, Bound] = field(default_factory=dict)
    """Limits that hold unless a configuration states others for the same output or variable."""
    objectives: tuple[str, ...] = ()
    """Outputs that are minimised where a configuration names none."""
    model: str = ""
    """The model that the problem belongs to; empty: a configuration has to name one."""
    algorithm: str = ""
    """The best algorithm for the problem; empty: NSGA-II or, for one objective, the GA."""
    reference_ga: Mapping[str, float] = field(default_factory=dict)
    """Settings of a run's single-objective GA, where the documents name them: population,
    generations, crossover and mutation probability; and, where not the GA's own, their eta."""
    sampled: bool = False
    """Whether a search sees a fixed sample of units; its points are tested on a fresh one."""
    performance: frozenset[str] = frozenset()
    """Outputs whose upper limits a search may find to be out of reach (see `sampled`)."""
    grain: int = 0
    """Designs of a batch that a search computes at once, such that workers can share the batch; 0
    where designs are so cheap that the whole batch is computed at once."""
    explained: Mapping[str, str] = field(default_factory=dict)
    """By output without a derivative, the output whose derivative gives its contributions."""
    model_name: str = ""
    """Which of several models of one thing the numbers are of; empty where there is one."""
    model_statement: str = ""
    """The same in words, printed wherever the numbers appear."""
    unpriced: Unpriced = check_costs
    """Variables without a cost at some parameters, though there are curves for them."""
    priceable: frozenset[str] = frozenset()
    """Variables that have no cost unless a configuration states one."""
    machines: Mapping[str, tuple[Offer, ...]] = field(default_factory=dict)
    """By variable, the machines of a configuration that make its tolerance."""
    conditions: tuple[str, ...] = ()
    """Names of the conditions of `[[condition]]`: outputs there are `<condition>.<output>`."""
    unconditional: frozenset[str] = frozenset(["cost"])
    """Outputs that no condition changes: effects and operating parameters have no part in them."""
    operation: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Keys of a condition that stand for parameters of operation, which change no part of a unit."""
    tables: tuple[str, ...] = ()
    """Top-level tables of a configuration that only this problem reads."""
    reducers: tuple[str, ...] = ()
    """Keys of the table `[reducers]`, each a reducer that the problem contains."""
    reducers_in: str = ""
    """The tables of a configuration that name a reducer each, in the place of `[reducers]`."""


@dataclass(frozen=True)
class ConfiguredProblem:
    """A problem as its configuration declares it; called with settings, it makes the problem."""

    declaration: Declaration
    make: Callable[[Settings], ToleranceProblem]
    read: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `Settings` that the problem read from further tables."""

    def __call__(self, settings: Settings) -> ToleranceProblem:
        return self.make(replace(settings, **self.read))


# A value as a quadratic function of scales and shifts of processes, fitted to evaluations of it.
#
# Reference: Box & Draper (1987), Empirical Model-Building and Response Surfaces, section 7.


SPARE = 2.5
"""Equations for each coefficient."""
FEWEST = 12
"""Evaluations at least."""


def evaluations(size: int, with_slopes: bool) -> int:
    """How many evaluations a fit in `size` coordinates takes."""
    count = SPARE * (1 + size + size * (size + 1) // 2)
    return max(FEWEST, int(np.ceil(count / (1 + size if with_slopes else 1))))


@dataclass(frozen=True, eq=False)
class Response:
    """The fitted function of x (n, d) in units of `unit` (d,); `rms` is the residual scatter of the
    values that it was fitted to.
    """

    coefficients: Array
    unit: Array
    rms: float

    @classmethod
    def of(cls, x: Array, values: Array, slopes: Array | None) -> Response:
        """Least squares of values (n,) at x (n, d), and of slopes (n, d) where they are known."""
        unit = np.maximum(np.std(x, axis=0), 1e-9)
        rows = _terms(x / unit)
        equations, right = [rows], [values]
        if slopes is not None:
            equations += [_slopes(x / unit, at) for at in range(x.shape[1])]
            right += list((slopes * unit).T)
        coefficients = np.linalg.lstsq(np.concatenate(equations), np.concatenate(right), rcond=None)[0]
        return cls(
            np.asarray(coefficients, dtype=np.float64),
            unit,
            float(np.sqrt(np.mean((rows @ coefficients - values) ** 2))),
        )

    def __call__(self, x: Array) -> Array:
        """Values (n,)."""
        return np.asarray(_terms(x / self.unit) @ self.coefficients)


def _terms(z: Array) -> Array:
    """1, z and all products of two, (n, 1 + d + d (d + 1)/2)."""
    pairs = np.triu_indices(z.shape[1])
    return np.hstack([np.ones((len(z), 1)), z, z[:, pairs[0]] * z[:, pairs[1]]])


def _slopes(z: Array, at: int) -> Array:
    """Their derivatives by one coordinate."""
    size = z.shape[1]
    first, second = np.triu_indices(size)
    plain = np.zeros((len(z), 1 + size))
    plain[:, 1 + at] = 1.0
    return np.hstack([plain, (first == at) * z[:, second] + (second == at) * z[:, first]])
