"""Yields and half-widths of a stack, by samples that all its requirements and designs share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...arrays import Array, Integers
from ...models.stack import Conditioned, Sample, Tolerances, conditioned, half_width, joint_yield_percent
from ..limits import Limit
from ..settings import Settings
from .measured import Measured

SEARCH_SAMPLES = 8192
"""Units of the yields and half-widths of a search; reported ones take `[propagation] samples`."""
INTEGRATED = 8, 4, 16
"""Units of a count that one unit replaces, of which a piece is integrated: in a search,
in a report of one point, and in that of a front."""
UNDECIDED = 6.0
"""Standard errors about a limit within which a search takes the whole sample."""


@dataclass(frozen=True, eq=False)
class Yields:
    """The outputs (n,) at tolerances t (n, parts) that take a sample of units.

    A search counts units; where it is `smooth`, and in a report of one point, a piece is integrated. A
    report takes whichever estimate of a yield has the smaller error.
    """

    measured: tuple[Measured, ...]
    settings: Settings
    limits: tuple[Limit, ...]
    required_outputs: frozenset[str]
    smooth: bool = False
    _conditioned: dict[tuple[tuple[int, ...], bool], Conditioned | None] = field(default_factory=dict, init=False)

    def outputs(self, t: Tolerances, searching: bool, needed: bool) -> dict[str, Array]:
        """Half-widths and yields; NaN without limits.

        Outputs that only a report shows are NaN where only those `needed` are asked for.
        """
        by_output: dict[str, Array] = {}
        for measured in self.measured:
            if measured.requirement.method == "monte_carlo":
                by_output |= self._half_width(measured, t, searching, needed)
        for name, bounded in self._yields():
            by_output |= self._yield(name, bounded, t, searching, needed)
        return by_output

    def _yields(self) -> list[tuple[str, list[Measured]]]:
        """The yields by name, with the requirements that have limits."""
        bounded = [measured for measured in self.measured if measured.mechanism.bounded]
        pairs = [
            (measured.name("yield_percent"), [measured] if measured in bounded else []) for measured in self.measured
        ]
        return [*pairs, ("yield_percent", bounded)] if self.measured[0].requirement.key else pairs

    @property
    def sampled(self) -> bool:
        """Whether a required output takes a sample."""
        return not self.smooth and bool(self.slopes(np.ones((0, len(self.measured[0].parts))), 0.5))

    def slopes(self, t: Tolerances, coverage: float) -> dict[str, Array]:
        """Derivatives (n, parts) of the required outputs that take a sample.

        They are those of the linear model where no piece can be integrated.
        """
        slopes: dict[str, Array] = {}
        for measured in self.measured:
            name = measured.name("variation")
            sampled = measured.requirement.method == "monte_carlo" and measured.distribution is None
            if sampled and self.required_outputs & {name, "variation"}:
                slopes[name] = self._by_design([measured], t, lambda c, row: c.half_width_slopes(row, coverage))
                normal = measured.linear.rss_slopes(t) * self._normal_factor(measured, t)
                slopes[name] = np.where(np.isnan(slopes[name]), normal, slopes[name])
        for name, bounded in self._yields():
            if name not in self.required_outputs or (len(bounded) == 1 and bounded[0].distribution is not None):
                continue
            if bounded:
                slopes[name] = 100.0 * self._by_design(bounded, t, lambda c, row: c.within_slopes(row))
                normal = np.sum([measured.yield_slopes(t) for measured in bounded], axis=0)
                slopes[name] = np.where(np.isnan(slopes[name]), normal, slopes[name])
        return slopes

    def _normal_factor(self, measured: Measured, t: Tolerances) -> Array:
        """The half-width over the root sum square (n, 1)."""
        rss = measured.linear.rss(t)
        width = self._half_width(measured, t, True, False)[measured.name("variation")]
        return np.divide(width, rss, out=np.ones_like(rss), where=rss > 0.0)[:, None]

    def _by_design(
        self, requirements: Sequence[Measured], t: Tolerances, slopes: Callable[[Conditioned, Tolerances], Array | None]
    ) -> Array:
        """Derivatives (n, parts), NaN for designs without."""
        derivatives = np.full((len(t), len(self.measured[0].parts)), np.nan)
        if (estimate := self._integrated(requirements, True)) is not None:
            for at in range(len(t)):
                if (row := slopes(estimate, t[at : at + 1])) is not None:
                    derivatives[at] = row
        return derivatives

    def _estimate(self, requirements: Sequence[Measured], searching: bool) -> Conditioned | None:
        """The estimate of a report or of a smooth search; None where units are counted."""
        return self._integrated(requirements, searching) if self.smooth or not searching else None

    def _integrated(self, requirements: Sequence[Measured], searching: bool) -> Conditioned | None:
        """The estimate of which a piece is integrated; None without any."""
        key = tuple(self.measured.index(measured) for measured in requirements), searching
        if key not in self._conditioned:
            units = min(SEARCH_SAMPLES, self.settings.propagation.samples) // INTEGRATED[0]
            per_unit = INTEGRATED[1 if len(self.settings.objectives) == 1 else 2]
            sample = self.drawn(units if searching else self.settings.propagation.samples // per_unit)
            mechanisms = [measured.mechanism for measured in requirements]
            self._conditioned[key] = conditioned(mechanisms, sample)
        return self._conditioned[key]

    def _half_width(self, measured: Measured, t: Tolerances, searching: bool, needed: bool) -> dict[str, Array]:
        name = measured.name("variation")
        if needed and not self.required_outputs & {name, "variation"}:
            return {name: np.full(len(t), np.nan)}
        coverage = self.settings.propagation.coverage
        if measured.distribution is not None:
            return {name: measured.distribution.half_width(t, coverage)}
        widths = np.full(len(t), np.nan)
        counted = not searching and len(self.settings.objectives) > 1  # by all units, not by a sixteenth of them
        if not counted and (estimate := self._estimate([measured], searching)) is not None:
            for at in range(len(t)):
                width = estimate.half_width(t[at : at + 1], coverage)
                widths[at] = np.nan if width is None else width
        if len(rest := np.flatnonzero(np.isnan(widths))):
            widths[rest] = half_width(measured.mechanism, t[rest], self._sample(searching), coverage)
        return {name: widths}

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
        estimates = np.full((2, len(t)), np.nan)
        if (integrated := self._estimate(bounded, searching)) is not None:
            for at in range(len(t)):
                if (kept := integrated.within(t[at : at + 1])) is not None:
                    estimates[:, at] = 100.0 * kept.mean(), 100.0 * kept.std(ddof=1) / np.sqrt(len(kept))
        missing = np.isnan(estimates[0])
        if not searching:
            missing |= estimates[1] > _error_of_count(estimates[0], self.settings.propagation.samples)
        if len(rest := np.flatnonzero(missing)):
            estimates[:, rest] = self._counted(name, bounded, t[rest], searching)
        return dict(zip(names, estimates, strict=True))

    def _counted(self, name: str, bounded: Sequence[Measured], t: Tolerances, searching: bool) -> Array:
        """A yield and its error (2, n) as counts."""
        mechanisms = [measured.mechanism for measured in bounded]
        estimates = np.array(joint_yield_percent(mechanisms, t, self._sample(searching)))
        if searching and len(close := self._undecided(name, *estimates)):
            estimates[:, close] = joint_yield_percent(mechanisms, t[close], self.reported)
        return estimates

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


def _error_of_count(percent: Array, units: int) -> Array:
    """Standard error [percent] of a yield that is counted."""
    return np.asarray(np.sqrt(np.maximum(percent * (100.0 - percent), 0.0) / units))
