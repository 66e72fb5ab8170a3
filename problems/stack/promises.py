"""The promise of a stack: its outputs, its rows in the convex form, what it takes for granted."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

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

Array = NDArray[np.float64]


def promise_outputs(promise: Promise | None, requirements: Sequence[Requirement]) -> list[Output]:
    """The outputs of a promise: of each requirement with limits, and of all together."""
    if promise is None:
        return []
    bounded = [one for one in requirements if one.lower is not None or one.upper is not None]
    found = [output for one in bounded for output in outputs_of_promise(promise, one.output(""))]
    joint = bool(requirements[0].key) and bool(bounded)
    return found + (list(assurances(ASSURANCE)) if joint else [])


def promise_limits(definition: Definition, given: Mapping[str, Bound]) -> dict[str, Bound]:
    """The limits of a run with its promise: a limit on the yield means the promise."""
    promise = definition.promise
    if promise is None:
        return dict(given)
    found = {name: bound for name, bound in given.items() if not means_promise(name, promise)}
    for one in definition.requirements:
        if one.lower is not None or one.upper is not None:
            found[one.output(promise.output)] = Bound(low=promise.yield_percent)
    return found


def promise_faults(definition: Definition, given: Mapping[str, Bound]) -> list[Fault]:
    """What contradicts a promise, or leaves it without a meaning."""
    promise = definition.promise
    if promise is None:
        return []
    found = contradictions(promise, given)
    if not any(one.lower is not None or one.upper is not None for one in definition.requirements):
        text = "is of no requirement: none has lower or upper, without which there is no yield"
        found.append(Fault("promise", text))
    if definition.correlations and promise.statement != PLUG_IN:
        text = (
            f"cannot be {promise.statement} beside [[correlation]]: what samples tell of "
            "correlated parts is not known; state plug_in"
        )
        found.append(Fault("promise.statement", text))
    return found


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
    def each(self) -> tuple[Promised, ...]:
        """The promise of each requirement with limits."""
        bounded = [one for one in self.measured if one.mechanism.bounded]
        level = self.level.confidence if self.level is not None else None
        return tuple(Promised(one, self.promise, self.posterior, level) for one in bounded)

    @cached_property
    def level(self) -> Level | None:
        """The level of the norm where sampled processes are chosen among."""
        return level_of(self.measured, self.promise, self.seed)

    def outputs(self, t: Tolerances, searching: bool, wanted: Collection[str]) -> dict[str, Array]:
        """Promised yields and assurances (n,); NaN where a search does not need them."""
        found = {}
        for one in self.each if self.promise.statement != PLUG_IN else ():
            name = one.measured.name(PROMISED)
            asked = not searching or name in wanted
            found[name] = one.promised(t) if asked else np.full(len(t), np.nan)
        groups = {one.measured.name(ASSURANCE): [one.measured] for one in self.each}
        if self.measured[0].requirement.key:
            groups[ASSURANCE] = [one.measured for one in self.each]
        for name, group in groups.items():
            names = name, f"{name}_error"
            if searching and name not in wanted:
                found |= {one: np.full(len(t), np.nan) for one in names}
                continue
            own = self.posterior.assurance(group, t, self.promise.share)
            found |= dict(zip(names, own, strict=True))
        return found

    def slopes(self, t: Tolerances, wanted: Collection[str]) -> dict[str, Array]:
        """Derivatives (n, parts) of promised yields that are wanted."""
        return {
            name: one.slopes(t)
            for one in self.each
            if (name := one.measured.name(PROMISED)) in wanted
        }

    def intervals(self, tightest: Tolerances) -> dict[str, Interval]:
        """Proven ends: an assured yield is largest at the tightest tolerances (1, parts)."""
        found: dict[str, Interval] = {}
        for one in self.each if self.promise.statement != PLUG_IN else ():
            still = not np.any(one.measured.linear.mean)
            proven = self.promise.statement == ASSURED and still and len(one.norms) == 1
            most = max(0.0, float(one.promised(tightest)[0])) if proven else 100.0
            found[one.measured.name(PROMISED)] = 0.0, most
        return found | {one.measured.name(ASSURANCE): (0.0, 100.0) for one in self.each}

    def row(self, output: str) -> Promised | None:
        """The promise that an output is of."""
        return next((one for one in self.each if one.measured.name(PROMISED) == output), None)
