"""The promise of `rv_reducer`: its units where processes differ from the samples' estimates.

A state of the processes scales the scatter of measured errors and moves their means; the units are
built and measured as usual. The promised fraction keeps the limit where its quantile of the
largest backlash does.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np

from ...models.rv_reducer.population.contact import Population, Slopes
from ...models.rv_reducer.population.units import stem
from ...section import Array, Flags
from ..machined import MachinedTolerance, ProcessProblem, Shortfall
from ..settings import ASSURED, PROMISED, YIELD
from .evaluation import Evaluation, Populations, UnitModel

WORST = "backlash_max_arcmin"
POSITION = "pin_position"
"""The error whose mean turns the unit, and moves nothing."""
MAX_CACHED_POPULATIONS = 4
"""Most designs whose promised units are stored, so that a derivative costs no second evaluation."""


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
        return {PROMISED: self.promised_yields(designs, searching=False)} if self.promises_by_samples else {}

    # ---------------------------------------------------------------- states of the processes

    _has_slopes = True

    @cached_property
    def promised_model(self) -> UnitModel:
        """The model whose coverage is the promised fraction."""
        return replace(self.model, conditions=replace(self.model.conditions, coverage=self.stated_promise.fraction))

    @cached_property
    def shifting(self) -> Flags:
        return np.array(
            [self.settings.variables[name].mid is not None and stem(name) != POSITION for name in self.known],
            dtype=bool,
        )

    def _deviations(self, row: Mapping[str, float]) -> Array:
        """Standard deviations (k,) of the measured errors by the estimates."""
        laws = (self.settings.variables[name].distribution for name in self.known)
        return np.array(
            [
                law.sigma * row[name]  # type: ignore[union-attr]
                for law, name in zip(laws, self.known, strict=True)
            ]
        )

    def _evaluation_at(self, design: Array, scale: Array, shift: Array, searching: bool) -> Evaluation:
        """A full design (all,) at one state (k,) of the processes."""
        row, means = self.as_built(design)
        moved = shift * self._deviations(row) * self.shifting
        for name, widening, more in zip(self.known, scale, moved, strict=True):
            row[name] *= float(widening)
            means[stem(name)] = means.get(stem(name), 0.0) + float(more)
        return Evaluation(self.promised_model, self.populations(searching), row, means)

    def _slopes_at(self, design: Array, evaluation: Evaluation) -> tuple[Array, Array]:
        """Derivatives (k,) of the quantile by scales and shifts, at the state of an evaluation."""
        row, _ = self.as_built(design)
        slopes, means = evaluation.gradient(WORST), evaluation.slopes_of_means(WORST)
        by_scale = np.array([row[variable] * slopes[variable] for variable in self.known])
        by_mean = np.array([means[variable] for variable in self.known])
        return by_scale, by_mean * self._deviations(row) * self.shifting

    def shortfall(self, design: Array, scales: Array, shifts: Array, searching: bool = False) -> Shortfall:
        """Quantiles [arcmin] above the limit of the backlash."""
        values, slopes, error = np.empty(len(scales)), [], 0.0
        for at, (scale, shift) in enumerate(zip(scales, shifts, strict=True)):
            evaluation = self._evaluation_at(design, scale, shift, searching)
            values[at] = evaluation.value(WORST) - self.model.conditions.limit
            by_scale, by_shift = self._slopes_at(design, evaluation)
            slopes.append(np.append(by_scale, by_shift[self.shifting]))
            error = evaluation.error(WORST)
        return Shortfall(values, error, np.array(slopes))

    def steepness(self, design: Array, searching: bool) -> tuple[Array, Array]:
        return self._slopes_at(design, self.evaluation(design, searching))

    def yield_at(self, design: Array, scale: Array, shift: Array, searching: bool) -> float:
        return self._evaluation_at(design, scale, shift, searching).value(YIELD)

    # ---------------------------------------------------------------- yields

    @cached_property
    def _mixed(self) -> dict[bool, Populations]:
        return {searching: self._mix(searching, stream) for stream, searching in enumerate((True, False), 1)}

    def _mix(self, searching: bool, stream: int) -> Populations:
        """Units that are each built by processes drawn for it alone: their yield is the expected."""
        drawn = self.populations(searching)

        def draw(positions: int, units: int) -> Population:
            population = drawn.draw(positions, units)
            z = dict(population.sample.z)
            for at, (name, knowledge) in enumerate(self.known.items()):
                rng = np.random.default_rng([self.settings.seed, stream, 1 + at])
                variance, error = knowledge.drawn(units, rng)
                law = self.settings.variables[name].distribution
                off = error * law.sigma * self.shifting[at]  # type: ignore[union-attr]
                for key in z:
                    if key.removesuffix("_radial").removesuffix("_tangential") == stem(name):
                        z[key] = z[key] * np.sqrt(variance) + off
            sample = replace(population.sample, z=z)
            return replace(population, sample=sample, slopes=Slopes.of(population.lattice.geometry, sample))

        return Populations(draw, drawn.sizes)

    def expected(self, design: Array, searching: bool) -> Evaluation:
        """Units of a full design (all,), each by other processes from the posterior."""
        return Evaluation(self.model, self._mixed[searching], *self.as_built(design))

    def expected_yields(self, designs: Array, searching: bool) -> Array:
        if searching:
            return np.array([self.unfavourable_yield(design) for design in designs])
        return np.array([self.expected(design, False).value(YIELD) for design in designs])

    def unfavourable_yield(self, design: Array) -> float:
        return self.promised_units(design)[1].value(YIELD)

    def promised_units(self, design: Array) -> tuple[tuple[Array, Array], Evaluation]:
        """State (k,), (k,) of the processes at which a search promises the yield of a full design
        (all,), and its units there: the worst state, or units by processes drawn for each of them.
        """
        key = design.tobytes()
        if key not in self._promised_units:
            self._promised_units[key] = self._promised_anew(design)
            while len(self._promised_units) > MAX_CACHED_POPULATIONS:
                self._promised_units.popitem(last=False)
        return self._promised_units[key]

    @cached_property
    def _promised_units(self) -> OrderedDict[bytes, tuple[tuple[Array, Array], Evaluation]]:
        return OrderedDict()

    def _promised_anew(self, design: Array) -> tuple[tuple[Array, Array], Evaluation]:
        if self.stated_promise.statement != ASSURED:
            return (np.ones(len(self.known)), np.zeros(len(self.known))), self.expected(design, True)
        state = self.worst(design, True).at(1.0)
        return state, self._evaluation_at(design, *state, True)

    def add_promised_slopes(
        self, designs: Array, gradients: dict[str, Array], by_mean: dict[str, dict[str, Array]]
    ) -> None:
        """Add derivatives of the promised yield to those of the other outputs: by variables, and by
        the means of errors that machines make. The processes of an assured yield are held fixed.
        """
        if not self.promises_by_samples:
            return
        rows, means = [], {tolerance: np.zeros(len(designs)) for tolerance in self.machined_tolerances}
        for at, design in enumerate(designs):
            (scale, shift), evaluation = self.promised_units(design)
            slopes = evaluation.gradient(YIELD)
            needed = np.any(self.shifting) or self.machined_tolerances
            by_means = evaluation.slopes_of_means(YIELD) if needed else {}
            row, _ = self.as_built(design)
            moved = shift * self._deviations(row) * self.shifting
            for name, wider, more in zip(self.known, scale, moved, strict=True):
                slopes[name] = float(wider) * slopes[name]
                slopes[name] += by_means.get(name, 0.0) * more / row[name] if more else 0.0
            rows.append([slopes.get(v.name, 0.0) for v in self.variables])
            for tolerance in self.machined_tolerances:
                means[tolerance][at] = by_means[tolerance]
        gradients[PROMISED], by_mean[PROMISED] = np.array(rows).reshape(designs.shape), means
