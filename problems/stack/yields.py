"""Yields and half-widths of a stack, by samples that all its requirements and designs share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Array, Integers
from ...models.stack import Sample, Tolerances, half_width, joint_yield_percent
from ..limits import Limit
from ..settings import Settings
from .measured import Measured

SEARCH_SAMPLES = 8192
"""Units of the yields and half-widths of a search; reported ones take `[propagation] samples`."""
UNDECIDED = 6.0
"""Standard errors about a limit within which a search takes the whole sample."""


@dataclass(frozen=True, eq=False)
class Yields:
    """The outputs (n,) at tolerances t (n, parts) that take a sample of units."""

    measured: tuple[Measured, ...]
    settings: Settings
    limits: tuple[Limit, ...]
    required_outputs: frozenset[str]

    def outputs(self, t: Tolerances, searching: bool, needed: bool) -> dict[str, Array]:
        """Half-widths and yields; NaN without limits.

        Outputs that only a report shows are NaN where only those `needed` are asked for.
        """
        by_output: dict[str, Array] = {}
        bounded = [measured for measured in self.measured if measured.mechanism.bounded]
        for measured in self.measured:
            if measured.requirement.method == "monte_carlo":
                by_output |= self._half_width(measured, t, searching, needed)
            with_limits = [measured] if measured.mechanism.bounded else []
            by_output |= self._yield(measured.name("yield_percent"), with_limits, t, searching, needed)
        if self.measured[0].requirement.key:
            by_output |= self._yield("yield_percent", bounded, t, searching, needed)
        return by_output

    def _half_width(self, measured: Measured, t: Tolerances, searching: bool, needed: bool) -> dict[str, Array]:
        name = measured.name("variation")
        if needed and not self.required_outputs & {name, "variation"}:
            return {name: np.full(len(t), np.nan)}
        coverage = self.settings.propagation.coverage
        if measured.distribution is not None:
            return {name: measured.distribution.half_width(t, coverage)}
        return {name: half_width(measured.mechanism, t, self._sample(searching), coverage)}

    def _sample(self, searching: bool) -> Sample:
        return self.searching if searching else self.reported

    def _yield(
        self, name: str, bounded: Sequence[Measured], t: Tolerances, searching: bool, needed: bool
    ) -> dict[str, Array]:
        """A yield and its error over requirements with limits."""
        names = (name, f"{name}_error")
        if not bounded or (needed and name not in self.required_outputs):
            return {name: np.full(len(t), np.nan) for name in names}
        distribution = bounded[0].distribution
        if len(bounded) == 1 and distribution is not None:
            return dict(zip(names, distribution.yield_percent(t), strict=True))
        mechanisms = [measured.mechanism for measured in bounded]
        estimates = joint_yield_percent(mechanisms, t, self._sample(searching))
        if searching and len(close := self._undecided(name, *estimates)):
            exact = joint_yield_percent(mechanisms, t[close], self.reported)
            for values, better in zip(estimates, exact, strict=True):
                values[close] = better
        return dict(zip(names, estimates, strict=True))

    def _undecided(self, name: str, percent: Array, error: Array) -> Integers:
        """Rows whose yield is so close to its limit that only the whole sample can decide.

        A search converges to its limits: a different verdict at the end would lose all its points.
        """
        near = np.zeros(len(percent), dtype=bool)
        for limit in self.limits:
            if limit.name == name:
                for end in (limit.low, limit.high):
                    near |= np.abs(percent - end) <= UNDECIDED * error
        return np.flatnonzero(near)

    @cached_property
    def reported(self) -> Sample:
        """The whole sample."""
        return self.drawn(self.settings.propagation.samples)

    @cached_property
    def searching(self) -> Sample:
        """The sample of a search."""
        return self.drawn(SEARCH_SAMPLES)

    def drawn(self, most: int) -> Sample:
        """At most so many units; fewer are the first ones of more."""
        rng = np.random.default_rng(self.settings.seed)
        samples = min(most, self.settings.propagation.samples)
        return Sample.draw(self.measured[0].mechanism, samples, rng)
