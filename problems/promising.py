"""Problems that give the variances of the output that their promise is of."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property

import numpy as np

from ..arrays import Array
from .deviations import Deviations, PromisedOutput
from .interfaces import Differentiable
from .promise import ASSURED, PROMISED
from .with_promise import WithPromise

STEP = 1e-5
"""Relative step of a variable for the slope of a promised yield."""


class Promising(WithPromise, Differentiable):
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
