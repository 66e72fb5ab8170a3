"""One requirement of a stack: its linear variations, their slopes and proven ends, its margin."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...models.stack import (
    Law,
    Linear,
    LinearSum,
    Mechanism,
    Tolerances,
    law_of,
    least_margin,
    limit_of,
    linear_sum_of,
    linearised,
    mean_of,
    spread_of,
    worst_by_corners,
)
from ...models.stack.linear import SIGMAS
from .definition import Definition, Part, Requirement

Interval = tuple[float, float]
STEP = 1e-6
"""Relative step of a tolerance for the slope of a domain margin, which is nearly linear."""


@dataclass(frozen=True, eq=False)
class Measured:
    """A requirement and its mechanism on the parts that all requirements share."""

    requirement: Requirement
    mechanism: Mechanism
    parts: tuple[Part, ...]

    @cached_property
    def linear(self) -> Linear:
        """The linear model about the mid-limits."""
        return linearised(self.mechanism)

    @cached_property
    def law(self) -> Law | str:
        """The law of a linear requirement of even deviations, or why there is none."""
        return law_of(self.mechanism, self.linear.covariance)

    @cached_property
    def distribution(self) -> Law | LinearSum | None:
        """The distribution of the requirement where it is known without a sample."""
        return self.law if isinstance(self.law, Law) else linear_sum_of(self.mechanism)

    @property
    def partial(self) -> bool:
        """Whether its formula leaves its domain within the widest tolerances."""
        return bool(self.mechanism.undefined)

    @property
    def rough(self) -> bool:
        """Whether slopes at the mid-limits do not describe the formula: its worst case is then by
        corners, and it has neither a root sum square nor contributions.
        """
        return bool(self.mechanism.rough)

    @property
    def bound_to_domain(self) -> bool:
        """Whether designs must stay in the domain: where the variation is the formula's own.

        The other methods know the formula by its slopes at the mid-limits alone.
        """
        return self.partial and (self.rough or self.requirement.method == "monte_carlo")

    def name(self, output: str) -> str:
        """The name of one of its outputs."""
        return self.requirement.output(output)

    @cached_property
    def shown(self) -> tuple[int, ...]:
        """The parts (places in `parts`) that it depends on: those with a contribution."""
        acting, owners = self.mechanism.acting, self.mechanism.owners
        alone = not self.requirement.key
        return tuple(at for at in range(len(self.parts)) if alone or np.any(acting[owners == at]))

    def contribution(self, at: int) -> str:
        """The name of the contribution of a part."""
        return self.name(f"contribution_{self.parts[at].name}_percent")

    def variations(self, t: Tolerances) -> dict[str, Array]:
        """The linear variations (n,) by output, of tolerances (n, parts)."""
        by_output = {"worst_case": self.linear.worst_case(t), "rss": self.linear.rss(t)}
        if self.rough:
            by_output = {"worst_case": worst_by_corners(self.mechanism, t), "rss": np.full(len(t), np.nan)}
        method = self.requirement.method
        if method == "shifted_rss":
            by_output["variation"] = self.linear.shifted_rss(t)
        elif method != "monte_carlo":
            by_output["variation"] = by_output[method]
        return {self.name(name): value for name, value in by_output.items()}

    def margin(self, t: Tolerances) -> dict[str, Array]:
        """The domain margin (n,), where the formula has an edge within the widest tolerances."""
        return {self.name("domain_margin"): least_margin(self.mechanism, t)} if self.partial else {}

    def shares(self, t: Tolerances) -> dict[str, Array]:
        """Contributions [%] of its parts (n,)."""
        worst = self.requirement.method == "worst_case"
        shares = self.linear.worst_shares(t) if worst else self.linear.variance_shares(t)
        if self.rough:
            shares = np.full_like(shares, np.nan)
        return {self.contribution(at): 100.0 * shares[:, at] for at in self.shown}

    # ---------------------------------------------------------------- slopes

    def slopes(self, t: Tolerances, wanted: Collection[str], coverage: float) -> dict[str, Array]:
        """Derivatives (n, parts) of the variations, and of a yield that is wanted.

        The derivative of a sampled yield, a step function, is the normal linear model's.
        """
        if self.rough:
            return self._rough_slopes(t, wanted)
        worst, rss = np.broadcast_to(self.linear.worst, spread_of(t).shape), self.linear.rss_slopes(t)
        by_output = {"worst_case": worst, "rss": rss}
        method, distribution = self.requirement.method, self.distribution
        if method != "monte_carlo":
            by_output["variation"] = {**by_output, "shifted_rss": rss + self.linear.shift}[method]
        elif distribution is not None:
            by_output["variation"] = distribution.half_width_slopes(t, coverage)
        if self.mechanism.bounded and self.name("yield_percent") in wanted:
            by_output["yield_percent"] = self.yield_slopes(t)
        if self.partial and self.name("domain_margin") in wanted:
            by_output["domain_margin"] = self._towards_tighter(least_margin, limit_of(t))
        return {self.name(name): value for name, value in by_output.items()}

    def _rough_slopes(self, t: Tolerances, wanted: Collection[str]) -> dict[str, Array]:
        """Derivatives (n, parts) of the worst case by corners, and of a domain margin that is wanted."""
        worst = self._towards_tighter(worst_by_corners, limit_of(t))
        by_output = {"worst_case": worst} | ({"variation": worst} if self.requirement.method == "worst_case" else {})
        if self.partial and self.name("domain_margin") in wanted:
            by_output["domain_margin"] = self._towards_tighter(least_margin, limit_of(t))
        return {self.name(name): value for name, value in by_output.items()}

    def _towards_tighter(self, of: Callable[[Mechanism, Tolerances], Array], t: Array) -> Array:
        """By differences towards tighter tolerances, on the corner that decides."""
        base, slopes = of(self.mechanism, t), np.zeros_like(t)
        for at in range(t.shape[1]):
            moved = t.copy()
            moved[:, at] *= 1.0 - STEP
            change = base - of(self.mechanism, moved)
            slopes[:, at] = change / np.where(t[:, at] > 0.0, STEP * t[:, at], 1.0)
        return slopes

    def yield_slopes(self, t: Tolerances) -> Array:
        """d yield_percent/dt (n, parts): where it takes a sample that of the normal linear model."""
        if self.distribution is not None:
            return self.distribution.yield_slopes(t)
        return 100.0 * self.linear.yield_slopes(t, *self._ends(len(t)))

    def _ends(self, n: int) -> tuple[Array, Array]:
        """Limits (n,) from the value at the mid-limits."""
        mechanism = self.mechanism
        return np.full(n, mechanism.lower - mechanism.centre), np.full(n, mechanism.upper - mechanism.centre)

    def linear_yield(self, t: Tolerances) -> Array:
        """Yield [%] (n,) of the linear model, as if the requirement were normal."""
        return 100.0 * self.linear.within(t, *self._ends(len(t)))

    # ---------------------------------------------------------------- what is known

    def intervals(self, low: Tolerances, high: Tolerances) -> dict[str, Interval]:
        """Proven ends of its outputs between the tightest and loosest parts, (1, parts) each."""
        worst = float(self.linear.worst_case(low)[0]), float(self.linear.worst_case(high)[0])
        rss = self._rss_interval(spread_of(low)[0], spread_of(high)[0])
        shift = self._shift(low), self._shift(high)
        by_output = {"worst_case": worst, "rss": rss, "yield_percent": (0.0, self._most_yield(low))}
        if self.rough:
            by_output = {"worst_case": (0.0, np.inf), "rss": (0.0, np.inf), "yield_percent": (0.0, 100.0)}
        by_method = by_output | {"shifted_rss": (rss[0] + shift[0], rss[1] + shift[1])}
        if self.requirement.method in by_method:
            by_output["variation"] = by_method[self.requirement.method]
        return {self.name(name): ends for name, ends in by_output.items()}

    @property
    def off_nominal(self) -> str:
        """In words where the value at the nominal sizes lies outside of the limits; else empty."""
        mechanism, unit = self.mechanism, f" {self.requirement.unit}".rstrip()
        if mechanism.lower <= mechanism.centre <= mechanism.upper:
            return ""
        above = mechanism.centre > mechanism.upper
        limit = f"above upper = {mechanism.upper:.10g}" if above else f"below lower = {mechanism.lower:.10g}"
        return f"is {mechanism.centre:.6g}{unit} at the nominal values, {limit}"

    @property
    def off_limits(self) -> bool:
        """Whether the mean lies outside of the limits, and no tolerance moves it: fewer than half
        of the units conform, as deviations are even.
        """
        return self._still and bool(self.off_nominal)

    @property
    def _still(self) -> bool:
        """Whether deviations are even and unimodal about a mean that no tolerance moves."""
        return (
            not any(part.by_machine or part.alternatives for part in self.parts)
            and isinstance(self.law, Law)
            and not np.any(self.law.mean)
            and not np.any(self.linear.covariance < 0.0)
        )

    def _most_yield(self, tightest: Tolerances) -> float:
        """The largest yield [percent]: that of the tightest parts, where the mean stays within the
        limits. Every wider deviation reduces it (Birnbaum 1948, on random variables with
        comparable peakedness, Annals of Mathematical Statistics 19(1), 76-81).
        """
        if not (self.mechanism.bounded and self._still):
            return 100.0
        if self.off_limits:
            return 50.0
        assert isinstance(self.law, Law)
        percent, error = self.law.yield_percent(tightest)
        return min(100.0, float(percent[0] + error[0]))

    def _shift(self, t: Tolerances) -> float:
        """Mean shifts in the worst direction of one design (1, parts)."""
        return float(spread_of(t)[0] @ self.linear.shift + np.abs(mean_of(t)[0]) @ self.linear.worst)

    def _rss_interval(self, low: Array, high: Array) -> Interval:
        """Bounds of the root sum square; exact unless contributions compensate each other."""
        adding = np.maximum(self.linear.covariance, 0.0)
        taking = np.minimum(self.linear.covariance, 0.0)
        ends = (low @ adding @ low + high @ taking @ high, high @ adding @ high + low @ taking @ low)
        least, most = SIGMAS * np.sqrt(np.maximum(ends, 0.0))
        return float(least), float(most)


def measured(definition: Definition) -> tuple[Measured, ...]:
    """Every requirement of a stack."""
    pairs = zip(definition.requirements, definition.mechanisms, strict=True)
    return tuple(Measured(requirement, mechanism, definition.parts) for requirement, mechanism in pairs)
