"""The promise of `rv_reducer`: its units at any state of the sampled processes."""

from __future__ import annotations

from abc import abstractmethod
from collections import OrderedDict
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..arrays import Array, Flags
from ..machined_tolerance import MachinedTolerance
from ..process_problem import ProcessProblem, Shortfall
from ..promise import ASSURED, PLUG_IN, PROMISED, YIELD
from . import promised
from .evaluation import Evaluation, Populations
from .units import UnitModel

KEPT = 4
"""Promised units kept, so that a derivative costs no second evaluation."""


class PromisingUnits(ProcessProblem):
    """Units that are built by processes in any state."""

    model: UnitModel
    machined_tolerances: dict[str, MachinedTolerance]

    @abstractmethod
    def as_built(self, design: Array) -> tuple[dict[str, float], dict[str, float]]:
        """Variables by name with the scatter of good parts, and the offsets of their means [um]."""

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
        """The model whose coverage is the promised fraction."""
        assert self.settings.promise is not None
        coverage = self.settings.promise.fraction
        return replace(self.model, conditions=replace(self.model.conditions, coverage=coverage))

    @cached_property
    def shifting(self) -> Flags:
        return promised.shifting(self)

    @cached_property
    def _mixed(self) -> dict[bool, Populations]:
        return {
            searching: promised.mixed(self, self.populations(searching), stream)
            for stream, searching in enumerate((True, False), 1)
        }

    def shortfall(self, design: Array, scales: Array, shifts: Array, searching: bool = False) -> Shortfall:
        return promised.shortfall(self, design, scales, shifts, searching)

    def steepness(self, design: Array, searching: bool) -> tuple[Array, Array]:
        evaluation = self.evaluation(design, searching)
        return promised.slopes_at(self, design, evaluation, promised.WORST)

    def yield_at(self, design: Array, scale: Array, shift: Array, searching: bool) -> float:
        evaluation = promised.evaluation_at(self, design, scale, shift, searching)
        return evaluation.value(YIELD)

    def expected(self, design: Array, searching: bool) -> Evaluation:
        """Units of a full design (all,), each by processes of its own from the posterior."""
        return Evaluation(self.model, self._mixed[searching], *self.as_built(design))

    def expected_yields(self, designs: Array, searching: bool) -> Array:
        if searching:
            return np.array([self.promised_units(design)[1].value(YIELD) for design in designs])
        return np.array([self.expected(design, False).value(YIELD) for design in designs])

    def unfavourable_yield(self, design: Array) -> float:
        return self.promised_units(design)[1].value(YIELD)

    def promised_units(self, design: Array) -> tuple[tuple[Array, Array], Evaluation]:
        """State (k,), (k,) of the processes at which a search promises the yield of a full design
        (all,), and its units there: the worst, or units that draw their own.
        """
        key = design.tobytes()
        if key not in self._promised_units:
            self._promised_units[key] = self._promised_anew(design)
            while len(self._promised_units) > KEPT:
                self._promised_units.popitem(last=False)
        return self._promised_units[key]

    @cached_property
    def _promised_units(self) -> OrderedDict[bytes, tuple[tuple[Array, Array], Evaluation]]:
        """The last of them, by design."""
        return OrderedDict()

    def _promised_anew(self, design: Array) -> tuple[tuple[Array, Array], Evaluation]:
        promise = self.settings.promise
        assert promise is not None
        if promise.statement != ASSURED:
            state = np.ones(len(self.known)), np.zeros(len(self.known))
            return state, self.expected(design, True)
        state = self.worst(design, True).at(1.0)
        return state, promised.evaluation_at(self, design, *state, True)
