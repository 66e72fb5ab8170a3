"""Promises on parts that are measured: what may be promised, at which confidence."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..errors import Fault
from ..models.capability import Knowledge
from ..section import Array, Output, Section
from .declaration import ConfiguredProblem, Declaration, Interval
from .deviations import Deviations, PromisedOutput
from .settings import ASSURANCE, ASSURED, PLUG_IN, PROMISED, YIELD, Bound, Promise, Settings, read_promise
from .tolerance_problem import ToleranceProblem


def outputs_of_promise(promise: Promise, prefix: str = "") -> tuple[Output, ...]:
    """The outputs of a promise of one requirement."""
    assured = assurances(f"{prefix}{ASSURANCE}")
    if promise.statement == PLUG_IN:
        return assured
    what = (
        f"with {promise.confidence_percent:g} % confidence, by the norm"
        if promise.statement == ASSURED
        else "expected over the posterior"
    )
    return (
        Output(
            f"{prefix}{PROMISED}", "percent", f"conforming units {what}", larger_is_better=True, low=0.0, high=100.0
        ),
        *assured,
    )


def assurances(name: str) -> tuple[Output, Output]:
    """An assurance and its standard error."""
    return (
        Output(
            name,
            "percent",
            "probability, over the uncertainty of the processes, that the promised fraction of units conforms",
            larger_is_better=True,
            low=0.0,
            high=100.0,
        ),
        Output(f"{name}_error", "percent", "standard error of the assurance", error_of=name),
    )


def means_promise(name: str, promise: Promise) -> bool:
    """Whether a limit on an output means the promise."""
    return name.split(".")[-1] in (YIELD, promise.of, promise.output)


def contradictions(promise: Promise, given: Mapping[str, Bound]) -> list[Fault]:
    """Limits that ask for another percentage than the promise."""
    return [
        Fault(
            f"limits.{name}",
            f"asks for {_percent_range(bound)}, but the promise is of {promise.yield_percent:g} %: leave the limit "
            "out, or state the same percentage",
        )
        for name, bound in given.items()
        if means_promise(name, promise) and bound != Bound(low=promise.yield_percent)
    ]


def _percent_range(bound: Bound) -> str:
    ends = [f"{end:g} % at {side}" for side, end in (("least", bound.low), ("most", bound.high)) if np.isfinite(end)]
    return ", ".join(ends)


# Problems that promise a yield, given samples of their processes: `[promise]`.


class WithPromise(ToleranceProblem):
    """A problem whose yield may be promised; `promised_of` output is the yield by the estimates."""

    promised_of: ClassVar[str] = YIELD

    def __init__(self, settings: Settings | None = None) -> None:
        if settings is not None and settings.promise is not None:
            self.declaration = _declare_promise(self.declaration, settings.promise)
        super().__init__(settings)

    @property
    def stated_promise(self) -> Promise:
        """The promise, where there must be one."""
        assert self.settings.promise is not None
        return self.settings.promise

    @property
    def promises_by_samples(self) -> bool:
        """Whether there is a promise that needs more than the estimates."""
        return self.settings.promise is not None and self.settings.promise.statement != PLUG_IN

    @abstractmethod
    def promised_yields(self, designs: Array, searching: bool) -> Array:
        """The promised yield [percent] (n,) of full designs (n, all), by the statement."""

    @abstractmethod
    def assurances(self, designs: Array) -> tuple[Array, Array]:
        """Probability [percent] (n,) that the promised fraction conforms, and its error."""

    @classmethod
    def configured(cls, top: Section) -> ConfiguredProblem | None:
        return cls.promising(super().configured(top), top)

    @classmethod
    def promising(cls, configured: ConfiguredProblem | None, top: Section) -> ConfiguredProblem | None:
        """The problem with the promise of its configuration, where there is one."""
        promise = read_promise(top, cls.promised_of)
        if promise is None or configured is None:
            return configured
        declaration = _declare_promise(configured.declaration, promise)
        read = {**configured.read, "promise": promise}
        return ConfiguredProblem(declaration, configured.make, read)

    def more_tables(self) -> dict[str, Any]:
        promise = self.settings.promise
        return super().more_tables() | ({} if promise is None else {"promise": promise.table()})

    def _completed(self, given: Settings) -> Settings:
        promise = given.promise
        if promise is None:
            return super()._completed(given)
        limits = {name: bound for name, bound in given.limits.items() if not means_promise(name, promise)}
        limits[promise.output] = Bound(low=promise.yield_percent)
        return super()._completed(replace(given, limits=limits))

    def faults(self) -> list[Fault]:
        promise = self.settings.promise
        if promise is None:
            return super().faults()
        promise_faults = contradictions(promise, self.given.limits)
        sampled = [
            name for name, offers in self.settings.machines.items() if any(offer.sample is not None for offer in offers)
        ]
        if promise.statement != PLUG_IN:
            promise_faults += [
                Fault(
                    f"variables.{name}.machine",
                    f"cannot be {promise.statement} where machines are known by samples: state sigma, or use plug_in",
                )
                for name in sampled
            ]
        return promise_faults + super().faults()

    @property
    def known(self) -> Mapping[str, Knowledge]:
        """Knowledge of the processes of variables from samples."""
        return {
            name: setting.sample.knowledge
            for name, setting in self.settings.variables.items()
            if setting.sample is not None
        }

    def _further(self, designs: Array, searching: bool) -> dict[str, Array]:
        """Promised yield and assurance (n,); NaN where a search does not need them."""
        outputs = super()._further(designs, searching)
        promise = self.settings.promise
        if promise is None:
            return outputs
        nothing = np.full(len(designs), np.nan)
        if promise.statement != PLUG_IN:
            asked = not searching or PROMISED in self.required_outputs
            outputs[PROMISED] = self.promised_yields(designs, searching) if asked else nothing
        asked = not searching or ASSURANCE in self.required_outputs
        assurances = self.assurances(designs) if asked else (nothing, nothing)
        return outputs | {ASSURANCE: assurances[0], f"{ASSURANCE}_error": assurances[1]}

    def interval(self, output: str) -> Interval:
        if output in (PROMISED, ASSURANCE):
            return 0.0, 100.0
        return super().interval(output)


def _declare_promise(declaration: Declaration, promise: Promise) -> Declaration:
    """With the outputs of a promise; by gradients where its units are evaluated for it."""
    algorithm = declaration.algorithm or ("exact" if promise.statement != PLUG_IN else "")
    outputs = (*declaration.outputs, *outputs_of_promise(promise))
    return replace(declaration, outputs=outputs, algorithm=algorithm)


# Problems that give the variances of the output that their promise is of.


STEP = 1e-5
"""Relative step of a variable for the slope of a promised yield."""


class Promising(WithPromise):
    """A problem that gives the mean and the variances of the output that its yield is of.

    With `deviations` the problem of a plugin can promise a yield by samples of its variables,
    `[variables.NAME.measured]`; `tolevo.testing.PromisingContract` tests them.
    """

    @abstractmethod
    def deviations(self, designs: Array) -> Deviations:
        """Mean, independent standard deviations by variable, and limits, of full designs (n, all).

        A half-width that is measured adds in proportion to it.
        """

    @cached_property
    def promised(self) -> PromisedOutput | None:
        """The promise of the output, None where there is none."""
        promise = self.settings.promise
        if promise is None:
            return None
        return PromisedOutput(promise, self.known, self.settings.seed)

    def promised_yields(self, designs: Array, searching: bool) -> Array:
        assert self.promised is not None
        return self.promised.promised(self.deviations(designs))

    def assurances(self, designs: Array) -> tuple[Array, Array]:
        assert self.promised is not None
        return self.promised.assurance(self.deviations(designs))

    def gradient(self, designs: Array) -> dict[str, Array]:
        return super().gradient(designs) | self.promised_slopes(designs)

    def promised_slopes(self, designs: Array) -> dict[str, Array]:
        """Derivatives (n, all variables) of an assured yield, by central differences."""
        promised = self.promised
        if promised is None or promised.promise.statement != ASSURED:
            return {}
        slopes = np.zeros_like(designs)
        for at in range(designs.shape[1]):
            ends, step = [], STEP * np.maximum(np.abs(designs[:, at]), STEP)
            for side in (1.0, -1.0):
                moved = designs.copy()
                moved[:, at] += side * step
                ends.append(promised.promised(self.deviations(moved)))
            slopes[:, at] = (ends[0] - ends[1]) / (2.0 * step)
        return {PROMISED: slopes}
