"""Problems that promise a yield by what samples tell of their processes: `[promise]`."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..declarations import Output
from ..errors import Fault
from ..section import Section
from .deviations import Deviations, PromisedOutput
from .drawing import Interval
from .promise import ASSURANCE, ASSURED, PLUG_IN, PROMISED, Promise, read_promise
from .promise_outputs import contradictions, means_promise, outputs_of_promise
from .settings import Bound, Settings
from .tolerance_problem import ToleranceProblem

Array = NDArray[np.float64]
STEP = 1e-5
"""Relative step of a variable for the slope of a promised yield."""


@dataclass(frozen=True)
class PromisingKind:
    """A problem with the promise of its configuration; with settings it makes the problem."""

    base: Any
    promise: Promise

    def __getattr__(self, name: str) -> Any:
        return getattr(self.base, name)

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Those of the problem, and of its promise."""
        return (*self.base.outputs, *outputs_of_promise(self.promise))

    def __call__(self, settings: Settings) -> ToleranceProblem:
        made: ToleranceProblem = self.base(replace(settings, promise=self.promise))
        return made


class Promising(ToleranceProblem):
    """A problem that gives the mean and the variances of the output that its yield is of.

    With `deviations` a problem of one's own can promise a yield by samples of its variables,
    `[variables.NAME.measured]`; `tolevo.testing.PromisingContract` tests them.
    """

    def __init__(self, settings: Settings | None = None) -> None:
        if settings is not None and settings.promise is not None:
            self.outputs = (*type(self).outputs, *outputs_of_promise(settings.promise))
        super().__init__(settings)

    @abstractmethod
    def deviations(self, designs: Array) -> Deviations:
        """Mean, independent standard deviations by variable, and limits, of full designs (n, all).

        A half-width that is measured adds in proportion to it.
        """

    @classmethod
    def configured(cls, top: Section) -> Any:
        kind, promise = super().configured(top), read_promise(top)
        return kind if promise is None or kind is None else PromisingKind(kind, promise)

    def more_tables(self) -> dict[str, Any]:
        own = self.settings.promise
        return super().more_tables() | ({} if own is None else {"promise": own.table()})

    def _completed(self, given: Settings) -> Settings:
        promise = given.promise
        if promise is None:
            return super()._completed(given)
        limits = {name: one for name, one in given.limits.items()
                  if not means_promise(name, promise)}  # fmt: skip
        limits[promise.output] = Bound(low=promise.yield_percent)
        return super()._completed(replace(given, limits=limits))

    def faults(self) -> list[Fault]:
        promise = self.settings.promise
        if promise is None:
            return super().faults()
        found = contradictions(promise, self.given.limits)
        sampled = [name for name, offers in self.settings.machines.items()
                   if any(one.sample is not None for one in offers)]  # fmt: skip
        if promise.statement != PLUG_IN:
            found += [Fault(f"variables.{name}.machine", f"cannot be {promise.statement} where "
                            "machines are known by samples: state sigma, or plug_in")
                      for name in sampled]  # fmt: skip
        return found + super().faults()

    @cached_property
    def promised(self) -> PromisedOutput | None:
        """What is promised, where something is."""
        promise = self.settings.promise
        if promise is None:
            return None
        known = {name: own.sample.knowledge for name, own in self.settings.variables.items()
                 if own.sample is not None}  # fmt: skip
        return PromisedOutput(promise, known, self.settings.seed)

    def _further(self, designs: Array, searching: bool) -> dict[str, Array]:
        """Promised yield and assurance (n,); NaN where a search does not need them."""
        found = super()._further(designs, searching)
        if self.promised is None:
            return found
        given, nothing = self.deviations(designs), np.full(len(designs), np.nan)
        wanted = {*self.objectives, *(limit.name for limit in self.limits)}
        if self.promised.promise.statement != PLUG_IN:
            asked = not searching or PROMISED in wanted
            found[PROMISED] = self.promised.promised(given) if asked else nothing
        asked = not searching or ASSURANCE in wanted
        own = self.promised.assurance(given) if asked else (nothing, nothing)
        return found | {ASSURANCE: own[0], f"{ASSURANCE}_error": own[1]}

    def promised_slopes(self, designs: Array) -> dict[str, Array]:
        """Derivatives (n, all variables) of an assured yield, by central differences."""
        one = self.promised
        if one is None or one.promise.statement != ASSURED:
            return {}
        found = np.zeros_like(designs)
        for at in range(designs.shape[1]):
            ends, step = [], STEP * np.maximum(np.abs(designs[:, at]), STEP)
            for side in (1.0, -1.0):
                moved = designs.copy()
                moved[:, at] += side * step
                ends.append(one.promised(self.deviations(moved)))
            found[:, at] = (ends[0] - ends[1]) / (2.0 * step)
        return {PROMISED: found}

    def interval(self, output: str) -> Interval:
        if output in (PROMISED, ASSURANCE):
            return 0.0, 100.0
        return super().interval(output)
