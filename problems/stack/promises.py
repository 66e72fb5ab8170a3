"""The promise of a stack: its outputs, its limits and its faults."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...declarations import Output
from ...errors import Fault
from ...models.capability import Level
from ...models.stack import Tolerances
from ..promise import ASSURANCE, ASSURED, PLUG_IN, PROMISED, Promise
from ..promise_outputs import assurances, contradictions, means_promise, outputs_of_promise
from ..settings import Bound
from .chosen import level_of
from .definition import Definition, Requirement
from .measured import Interval, Measured
from .posterior import Posterior
from .promised import Promised


def promise_outputs(promise: Promise | None, requirements: Sequence[Requirement]) -> list[Output]:
    """The outputs of a promise: of each requirement with limits, and of all together."""
    if promise is None:
        return []
    bounded = [requirement for requirement in requirements if requirement.bounded]
    outputs = [output for requirement in bounded for output in outputs_of_promise(promise, requirement.output(""))]
    joint = bool(requirements[0].key) and bool(bounded)
    return outputs + (list(assurances(ASSURANCE)) if joint else [])


def promise_limits(definition: Definition, given: Mapping[str, Bound]) -> dict[str, Bound]:
    """The limits of a run with its promise: a limit on the yield means the promise."""
    promise = definition.promise
    if promise is None:
        return dict(given)
    limits = {name: bound for name, bound in given.items() if not means_promise(name, promise)}
    for requirement in definition.requirements:
        if requirement.bounded:
            limits[requirement.output(promise.output)] = Bound(low=promise.yield_percent)
    return limits


def promise_faults(definition: Definition, given: Mapping[str, Bound]) -> list[Fault]:
    """Faults of settings that contradict a promise, or make it meaningless."""
    promise = definition.promise
    if promise is None:
        return []
    faults = contradictions(promise, given)
    if not any(requirement.bounded for requirement in definition.requirements):
        faults.append(Fault("promise", "has no yield: no requirement has a limit; state lower or upper of one"))
    if definition.correlations and promise.statement != PLUG_IN:
        text = (
            f"cannot be {promise.statement} with [[correlation]]: the uncertainty of correlated parts from samples is "
            "not modelled; state plug_in"
        )
        faults.append(Fault("promise.statement", text))
    return faults


@dataclass(frozen=True, eq=False)
class Promises:
    """The promise of every requirement with limits; tolerances have shape (n, parts)."""

    measured: tuple[Measured, ...]
    promise: Promise
    seed: int

    @cached_property
    def posterior(self) -> Posterior:
        """Processes that all requirements share."""
        return Posterior(self.measured[0].parts, self.seed)

    @cached_property
    def requirement_promises(self) -> tuple[Promised, ...]:
        """The promise of each requirement with limits."""
        bounded = [measured for measured in self.measured if measured.mechanism.bounded]
        level = self.level.confidence if self.level is not None else None
        return tuple(Promised(measured, self.promise, self.posterior, level) for measured in bounded)

    @cached_property
    def level(self) -> Level | None:
        """The level of the norm where sampled processes are chosen among."""
        return level_of(self.measured, self.promise, self.seed)

    def outputs(self, t: Tolerances, searching: bool, wanted: Collection[str]) -> dict[str, Array]:
        """Promised yields and assurances (n,); NaN where a search does not need them."""
        by_output = {}
        for promised in self.requirement_promises if self.promise.statement != PLUG_IN else ():
            name = promised.measured.name(PROMISED)
            asked = not searching or name in wanted
            by_output[name] = promised.promised(t) if asked else np.full(len(t), np.nan)
        groups = {promised.measured.name(ASSURANCE): [promised.measured] for promised in self.requirement_promises}
        if self.measured[0].requirement.key:
            groups[ASSURANCE] = [promised.measured for promised in self.requirement_promises]
        for name, group in groups.items():
            names = name, f"{name}_error"
            if searching and name not in wanted:
                by_output |= {output: np.full(len(t), np.nan) for output in names}
                continue
            assurance = self.posterior.assurance(group, t, self.promise.fraction)
            by_output |= dict(zip(names, assurance, strict=True))
        return by_output

    def slopes(self, t: Tolerances, wanted: Collection[str]) -> dict[str, Array]:
        """Derivatives (n, parts) of promised yields that are wanted."""
        return {
            name: promised.slopes(t)
            for promised in self.requirement_promises
            if (name := promised.measured.name(PROMISED)) in wanted
        }

    def intervals(self, tightest: Tolerances) -> dict[str, Interval]:
        """Proven ends: an assured yield is largest at the tightest tolerances (1, parts)."""
        by_output: dict[str, Interval] = {}
        for promised in self.requirement_promises if self.promise.statement != PLUG_IN else ():
            still = not np.any(promised.measured.linear.mean)
            proven = self.promise.statement == ASSURED and still and len(promised.norms) == 1
            most = max(0.0, float(promised.promised(tightest)[0])) if proven else 100.0
            by_output[promised.measured.name(PROMISED)] = 0.0, most
        return by_output | {promised.measured.name(ASSURANCE): (0.0, 100.0) for promised in self.requirement_promises}

    def row(self, output: str) -> Promised | None:
        """The promise that an output is of."""
        return next(
            (promised for promised in self.requirement_promises if promised.measured.name(PROMISED) == output), None
        )
