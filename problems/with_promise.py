"""Problems that promise a yield, given samples of their processes: `[promise]`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ..arrays import Array
from ..errors import Fault
from ..models.capability import Knowledge
from ..section import Section
from .declaration import ConfiguredProblem, Declaration, Interval
from .interfaces import Written
from .promise import ASSURANCE, PLUG_IN, PROMISED, YIELD, Promise, read_promise
from .promise_outputs import contradictions, means_promise, outputs_of_promise
from .settings import Bound, Settings
from .tolerance_problem import ToleranceProblem


class WithPromise(ToleranceProblem, Written):
    """A problem whose yield may be promised; `promised_of` output is the yield by the estimates."""

    promised_of: ClassVar[str] = YIELD

    def __init__(self, settings: Settings | None = None) -> None:
        if settings is not None and settings.promise is not None:
            self.declaration = _promising(type(self).declaration, settings.promise)
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
        declaration = _promising(configured.declaration, promise)
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


def _promising(declaration: Declaration, promise: Promise) -> Declaration:
    """With the outputs of a promise; by gradients where its units are evaluated for it."""
    algorithm = declaration.algorithm or ("exact" if promise.statement != PLUG_IN else "")
    outputs = (*declaration.outputs, *outputs_of_promise(promise))
    return replace(declaration, outputs=outputs, algorithm=algorithm)
