"""The promise of `rv_reducer`: its units at any state of the processes that samples tell of."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..judged import Judged, Shortfall
from ..machined import Made
from ..promise import PLUG_IN, PROMISED
from . import promised
from .evaluation import Evaluation, Populations
from .units import UnitModel

Array = NDArray[np.float64]


class PromisingUnits(Judged):
    """Units that are built by processes in any state."""

    model: UnitModel
    made: dict[str, Made]

    @abstractmethod
    def as_built(self, design: Array) -> tuple[dict[str, float], dict[str, float]]:
        """Variables by name as good parts scatter, and by how much their means are off [um]."""

    @abstractmethod
    def populations(self, searching: bool) -> Populations:
        """The population of searches, or that of reported points."""

    @abstractmethod
    def evaluation(self, design: Array, searching: bool) -> Evaluation:
        """A full design (all variables,) on one of the two populations."""

    def promised_needs(self, designs: Array) -> dict[str, Array]:
        """The promised yield (n,) of designs that are tested, where there is one."""
        promise = self.settings.promise
        if promise is None or promise.statement == PLUG_IN:
            return {}
        return {PROMISED: self.promised_yields(designs, searching=False)}

    _has_slopes = True

    @cached_property
    def promised_model(self) -> UnitModel:
        """The model whose coverage is the promised share."""
        assert self.settings.promise is not None
        coverage = self.settings.promise.share
        return replace(self.model, conditions=replace(self.model.conditions, coverage=coverage))

    @cached_property
    def shifting(self) -> NDArray[np.bool_]:
        return promised.shifting(self)

    @cached_property
    def _mixed(self) -> dict[bool, Populations]:
        return {one: promised.mixed(self, self.populations(one), stream)
                for stream, one in enumerate((True, False), 1)}  # fmt: skip

    def shortfall(
        self, design: Array, scales: Array, shifts: Array, searching: bool = False
    ) -> Shortfall:
        return promised.shortfall(self, design, scales, shifts, searching)

    def steepness(self, design: Array, searching: bool) -> tuple[Array, Array]:
        found = self.evaluation(design, searching)
        return promised.slopes_at(self, design, found, promised.WORST)

    def yield_at(self, design: Array, scale: Array, shift: Array, searching: bool) -> float:
        found = promised.evaluation_at(self, design, scale, shift, searching)
        return found.value("yield_percent")

    def expected(self, design: Array, searching: bool) -> Evaluation:
        """Units of a full design (all,), each by processes of its own from the posterior."""
        return Evaluation(self.model, self._mixed[searching], *self.as_built(design))

    def expected_yields(self, designs: Array, searching: bool) -> Array:
        return np.array([self.expected(one, searching).value("yield_percent") for one in designs])
