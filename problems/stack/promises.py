"""One requirement of a stack: its linear variations, their slopes and proven ends, its margin."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from ...errors import Fault
from ...models.capability import Aim, Knowledge, Level, Norm, PartSample, Processes, Ways, calibrated, norm_of
from ...models.stack.linear_sum import LinearSum, linear_sum_of
from ...models.stack.mechanism import (
    SIGMAS,
    AsMade,
    Law,
    Linear,
    Mechanism,
    Tolerances,
    ends_by_corners,
    fractions,
    law_of,
    least_margin,
    limit_of,
    linear_model,
    mean_of,
    spread_of,
    worst_by_corners,
)
from ...section import Array, Flags, Integers, Output
from ..deviations import Draws, Sums
from ..limits import keeps
from ..promise import assurances, contradictions, means_promise, outputs_of_promise
from ..settings import (
    ASSURANCE,
    ASSURED,
    DRAWS,
    PLUG_IN,
    PROMISED,
    VALUES_PER_BLOCK,
    Bound,
    Promise,
    assured_percent,
    normal_yield,
)
from .definition import Definition, Part, Requirement, spread_and_mean

if TYPE_CHECKING:
    from .problem import Stack

Interval = tuple[float, float]
LEAST, GREATEST = "worst_case_least", "worst_case_greatest"
WINDOW = {LEAST: -1.0, GREATEST: 1.0}
"""The ends that no unit within the zones of its parts exceeds, and their sides."""
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
        return linear_model(self.mechanism)

    @cached_property
    def law(self) -> Law | str:
        """The law of a linear requirement of even deviations, or why there is none."""
        return law_of(self.mechanism, self.linear.covariance)

    @property
    def normal(self) -> bool:
        """Whether the requirement is exactly normal: linear, of normal parts."""
        return isinstance(self.law, Law) and self.law.covariance is not None

    @cached_property
    def distribution(self) -> Law | LinearSum | None:
        """The distribution of the requirement where it is known without a sample."""
        if self.mechanism.matches:
            return None
        return self.law if isinstance(self.law, Law) else linear_sum_of(self.mechanism)

    @property
    def label(self) -> str:
        """Its name in tables: its key, or the name of the only requirement."""
        return self.requirement.key or self.requirement.name or "requirement"

    @property
    def partial(self) -> bool:
        """Whether its formula leaves its domain within the widest tolerances."""
        return bool(self.mechanism.undefined)

    @property
    def rough(self) -> bool:
        """Whether slopes at the mid-limits do not describe the units: the worst case of a formula is then by
        corners, the root sum square and the contributions are by a sample (`Yields`).
        """
        return bool(self.mechanism.rough) or self.mechanism.matches

    @property
    def bound_to_domain(self) -> bool:
        """Whether designs must stay in the domain: where the variation is the formula's own.

        The other methods know the formula by its slopes at the mid-limits alone. Units that cannot be
        assembled only do not conform.
        """
        return self.partial and not self.assembles and (self.rough or self.requirement.method == "monte_carlo")

    @property
    def assembles(self) -> bool:
        """Whether a unit for which its formula has no value is one that cannot be assembled."""
        return self.mechanism.formula is not None and self.mechanism.formula.assembles

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
        """The variations (n,) by output, of tolerances (n, parts), that take no sample."""
        by_corners = self.rough and not self.straight
        by_output = {"worst_case": worst_by_corners(self.mechanism, t) if by_corners else self.linear.worst_case(t)}
        if not self.rough:
            rss = self.linear.rss(t)
            by_output |= {"rss": rss, "std": rss / SIGMAS}
        if self.straight:
            by_output |= {name: self.drawn.centre + side * by_output["worst_case"] for name, side in WINDOW.items()}
        method = self.requirement.method
        if method == "shifted_rss" and not self.rough:
            by_output["variation"] = self.shifted_rss(t)
        elif method in by_output:
            by_output["variation"] = by_output[method]
        return {self.name(name): value for name, value in by_output.items()}

    @property
    def straight(self) -> bool:
        """Whether it is linear in its parts, so that its worst case is about the middles of their zones."""
        return self.mechanism.formula is None or self.mechanism.formula.linear

    @cached_property
    def drawn(self) -> Mechanism:
        """The mechanism about the middles of the zones: a measured mean moves units, and no limit of a part."""
        mechanism = self.mechanism
        moved = np.array([part.mean - part.mid for part in self.parts])[mechanism.owners]
        if mechanism.formula is not None:
            _, mids, scale = mechanism.stated
            mechanism = replace(mechanism, mids=mids - scale * moved)
        return replace(mechanism, centre=mechanism.centre - float(mechanism.sensitivities @ moved))

    @cached_property
    def measured_shift(self) -> float:
        """Shifts of measured means from the middles of the zones, all in the worst direction."""
        off = np.array([abs(part.mean - part.mid) for part in self.parts])
        return float(np.abs(self.mechanism.sensitivities) @ off[self.mechanism.owners])

    def shifted_rss(self, t: Tolerances) -> Array:
        """Root sum square with all mean shifts (n,), measured ones included, in the worst direction."""
        return self.linear.shifted_rss(t) + self.measured_shift

    def window(self, t: Tolerances, asked: bool) -> dict[str, Array]:
        """Least and greatest value (n,) of a formula that is not linear, by corners; NaN if not `asked` for."""
        if self.straight:
            return {}
        ends = ends_by_corners(self.drawn, t) if asked else np.full((2, len(t)), np.nan)
        return dict(zip(map(self.name, WINDOW), ends, strict=True))

    def margin(self, t: Tolerances) -> dict[str, Array]:
        """The domain margin (n,), where the formula has an edge within the widest tolerances."""
        return {self.name("domain_margin"): least_margin(self.mechanism, t)} if self.partial else {}

    def shares(self, t: Tolerances) -> dict[str, Array]:
        """Contributions [%] of its parts (n,)."""
        worst = self.requirement.method == "worst_case"
        if self.rough and worst and not self.straight:
            limits = limit_of(t)
            shares = fractions(limits * self._towards_tighter(worst_by_corners, limits))
            tied = ~np.any(shares, axis=1)  # as of min(a, b): no part by itself makes less of it
            if np.any(tied):
                alone = [worst_by_corners(self.mechanism, limits[tied] * row) for row in np.eye(len(self.parts))]
                shares[tied] = fractions(np.stack(alone, axis=1))
        else:
            shares = self.linear.worst_shares(t) if worst else self.linear.variance_shares(t)
        return {self.contribution(at): 100.0 * shares[:, at] for at in self.shown}

    def means_kept(self, t: Tolerances) -> Flags:
        """Whether the linear mean is within the limits (n,), to the rounding with which all are kept."""
        mean = self.mechanism.centre + self.linear.mean_shift(t)
        return keeps(mean, self.mechanism.upper) & keeps(-mean, -self.mechanism.lower)

    # ---------------------------------------------------------------- slopes

    def slopes(self, t: Tolerances, wanted: Collection[str], coverage: float) -> dict[str, Array]:
        """Derivatives (n, parts) of the variations, and of a yield and a domain margin that are wanted.

        The derivative of a sampled yield, a step function, is the normal linear model's. Where slopes do not
        describe the units, only the worst case and the margin have derivatives here.
        """
        worst = np.broadcast_to(self.linear.worst, spread_of(t).shape)
        if self.rough and not self.straight:
            worst = self._towards_tighter(worst_by_corners, limit_of(t))
        by_method = by_output = {"worst_case": worst}
        if not self.rough:
            rss = self.linear.rss_slopes(t)
            by_output |= {"rss": rss, "std": rss / SIGMAS}
            by_method = by_output | {"shifted_rss": rss + self.linear.shift}
            if self.requirement.method == "monte_carlo" and self.distribution is not None:
                by_output["variation"] = self.distribution.half_width_slopes(t, coverage)
            if self.mechanism.bounded and self.name("yield_percent") in wanted:
                by_output["yield_percent"] = self.yield_slopes(t)
        if self.requirement.method in by_method:
            by_output["variation"] = by_method[self.requirement.method]
        by_output |= {name: side * worst for name, side in WINDOW.items()} if self.straight else {}
        if self.partial and self.name("domain_margin") in wanted:
            by_output["domain_margin"] = self._towards_tighter(least_margin, limit_of(t))
        return {self.name(name): value for name, value in by_output.items()} | self._window_slopes(t, wanted)

    def _window_slopes(self, t: Tolerances, wanted: Collection[str]) -> dict[str, Array]:
        """Derivatives (n, parts) of the ends by corners that are wanted."""
        names = [self.name(name) for name in WINDOW if not self.straight and self.name(name) in wanted]
        return {name: self._towards_tighter(partial(self._end, name), limit_of(t)) for name in names}

    def _end(self, name: str, _: Mechanism, t: Tolerances) -> Array:
        return self.window(t, asked=True)[name]

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
        return 100.0 * self.linear.yield_slopes(t, *self._ends)

    @property
    def _ends(self) -> tuple[float, float]:
        """Limits from the value at the mid-limits."""
        return self.mechanism.lower - self.mechanism.centre, self.mechanism.upper - self.mechanism.centre

    def linear_yield(self, t: Tolerances) -> Array:
        """Yield [%] (n,) of the linear model, as if the requirement were normal."""
        return 100.0 * self.linear.within(t, *self._ends)

    # ---------------------------------------------------------------- what is known

    def intervals(self, low: Tolerances, high: Tolerances) -> dict[str, Interval]:
        """Proven ends of its outputs between the tightest and loosest parts, (1, parts) each."""
        worst = float(self.linear.worst_case(low)[0]), float(self.linear.worst_case(high)[0])
        rss = self._rss_interval(spread_of(low)[0], spread_of(high)[0])
        shift = self._shift(low) + self.measured_shift, self._shift(high) + self.measured_shift
        by_output = {"worst_case": worst, "rss": rss, "yield_percent": (0.0, self._most_yield(low))}
        if self.rough:
            rss, shift = (0.0, np.inf), (0.0, 0.0)
            by_output = {"worst_case": rss, "rss": rss, "yield_percent": (0.0, 100.0)}
        by_output["std"] = rss[0] / SIGMAS, rss[1] / SIGMAS
        if self.straight and not self.rough:
            centre = self.drawn.centre
            by_output |= {
                LEAST: (centre - worst[1], centre - worst[0]),
                GREATEST: (centre + worst[0], centre + worst[1]),
            }
        by_method = by_output | {"shifted_rss": (rss[0] + shift[0], rss[1] + shift[1])}
        if self.requirement.method in by_method:
            by_output["variation"] = by_method[self.requirement.method]
        return {self.name(name): ends for name, ends in by_output.items()}

    @property
    def off_nominal(self) -> str:
        """In words where the value at the nominal sizes lies outside of the limits; else empty."""
        mechanism, unit = self.mechanism, f" {self.requirement.unit}".rstrip()
        if keeps(mechanism.centre, mechanism.upper) and keeps(-mechanism.centre, -mechanism.lower):
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


# Yields over the posterior of the processes: how surely a promise is kept, and what to expect.
#
# The requirement is normal in every draw: its variance is the sum of the drawn ones, its mean is off
# by the drawn errors of the means, both in proportion to the tolerances. Where a part is made by one
# of several processes, those that a design chooses count.


@dataclass(frozen=True, eq=False)
class Posterior:
    """Processes of all parts, drawn once: designs and requirements share the draws."""

    parts: tuple[Part, ...]
    seed: int
    draws: int = DRAWS

    def _drawn(self, chosen: tuple[int, ...]) -> Draws:
        """Draws of the processes that make the parts."""
        none = np.ones(self.draws), np.zeros(self.draws)
        pairs = [self._drawn_processes.get((at, self._source(at, number)), none) for at, number in enumerate(chosen)]
        variance, error = zip(*pairs, strict=True)
        return Draws(np.stack(variance, axis=1), np.stack(error, axis=1))

    @cached_property
    def _drawn_processes(self) -> dict[tuple[int, str], tuple[Array, Array]]:
        """Draws of variance and error of each sampled process, by part and machine."""
        draws = {}
        for at, part in enumerate(self.parts):
            for number in range(len(part.processes)):
                key, known = (at, self._source(at, number)), part.knowledge_of(number)
                if known is not None and key not in draws:
                    machine = [] if part.sample is not None else [number + 1]
                    drawn = Draws.of([known], [(self.seed, at, *machine)], self.draws)
                    draws[key] = drawn.variance[:, 0], drawn.error[:, 0]
        return draws

    def _source(self, at: int, number: int) -> str:
        """The machine of a process: it scatters alike with and without inspection."""
        machine = self.parts[at].processes[number].machine
        return "" if machine is None else machine.name

    def _choices(self, t: Tolerances) -> list[tuple[tuple[int, ...], Integers]]:
        """The choices of processes (p,) among designs, each with the rows that make it."""
        made = t.chosen if isinstance(t, AsMade) else None
        if made is None or not any(part.machines for part in self.parts if part.sampled):
            return [((0,) * len(self.parts), np.arange(len(t)))]
        ways, owner = np.unique(made, axis=0, return_inverse=True)
        return [(tuple(choice), np.flatnonzero(owner.ravel() == at)) for at, choice in enumerate(ways.tolist())]

    def assurance(self, of: Sequence[Measured], t: Tolerances, fraction: float) -> tuple[Array, Array]:
        """Probability [percent] (n,) that a fraction of units keeps every requirement, its error.

        The fraction is required of every requirement separately.
        """
        kept = np.empty(len(t))
        for chosen, rows in self._portions(t):
            every = np.all([self._yields(measured, t[rows], chosen) >= fraction for measured in of], axis=0)
            kept[rows] = every.mean(axis=1)
        return assured_percent(kept, self.draws)

    def expected(self, measured: Measured, t: Tolerances) -> Array:
        """Expected yield [percent] (n,) of a requirement."""
        percent = np.empty(len(t))
        for chosen, rows in self._portions(t):
            percent[rows] = 100.0 * self._yields(measured, t[rows], chosen).mean(axis=1)
        return percent

    def expected_slopes(self, measured: Measured, t: Tolerances) -> Array:
        """Derivatives (n, parts) of the expected yield by the spread of the parts."""
        slopes = np.empty_like(spread_of(t))
        for chosen, rows in self._portions(t):
            slopes[rows] = self._slopes(measured, t[rows], chosen)
        return slopes

    def _portions(self, t: Tolerances) -> list[tuple[tuple[int, ...], Integers]]:
        """Rows of designs that are evaluated together, with the processes that they choose."""
        step = max(1, VALUES_PER_BLOCK // self.draws)
        return [
            (chosen, rows[first : first + step])
            for chosen, rows in self._choices(t)
            for first in range(0, len(rows), step)
        ]

    @property
    def _std(self) -> Array:
        """Standard deviations (p,) at t = 1 of parts that are known by samples, else 0."""
        return np.array(
            [
                p.distribution.sigma if p.sampled else 0.0  # type: ignore[attr-defined]
                for p in self.parts
            ]
        )

    def _sums(self, measured: Measured, t: Tolerances) -> Sums:
        """The requirement as a sum of the deviations of the parts."""
        s, mechanism, linear = spread_of(t), measured.mechanism, measured.linear
        mean = mechanism.centre + mean_of(t) @ linear.slope + s @ linear.mean
        return Sums(
            mean,
            s * np.sqrt(np.diag(linear.covariance)),
            s * linear.slope * self._std,
            np.zeros(len(s)),
            mechanism.lower,
            mechanism.upper,
        )

    def _yields(self, measured: Measured, t: Tolerances, chosen: tuple[int, ...]) -> Array:
        """Yields (n, draws)."""
        return self._sums(measured, t).yields(self._drawn(chosen))

    def _slopes(self, measured: Measured, t: Tolerances, chosen: tuple[int, ...]) -> Array:
        sums, drawn = self._sums(measured, t), self._drawn(chosen)
        std, above, below = sums.ends(drawn)
        bells = [
            np.where(np.isfinite(z), np.exp(-0.5 * np.where(np.isfinite(z), z, 0.0) ** 2), 0.0)
            / (np.sqrt(2.0 * np.pi) * std)
            for z in (above, below)
        ]
        far = [np.where(np.isfinite(z), z, 0.0) for z in (above, below)]
        by_mean = -(bells[0] - bells[1])
        by_std = -(bells[0] * far[0] - bells[1] * far[1])
        s, linear = spread_of(t), measured.linear
        moved = by_mean @ drawn.error * linear.slope * self._std
        moved += by_mean.sum(axis=1)[:, None] * linear.mean
        wider = ((by_std / std) @ drawn.variance) * np.diag(linear.covariance) * s
        return np.asarray(100.0 * (moved + wider) / self.draws)


# The promise of one requirement's yield, given the knowledge of the processes.


MIN_NORM = 1e-300


@dataclass(frozen=True, eq=False)
class Promised:
    """The promise of one requirement with limits; tolerances have shape (n, parts)."""

    measured: Measured
    promise: Promise
    posterior: Posterior
    level: float | None = None

    @cached_property
    def norms(self) -> tuple[Norm, ...]:
        """The standard deviation that an assured promise uses, by the spreads of the parts.

        One norm for each process number; parts with fewer processes count with their last one.
        """
        measured = self.measured
        variances = np.diag(measured.linear.covariance)
        slopes = measured.mechanism.sensitivities
        squares = np.bincount(measured.mechanism.owners, slopes**2, minlength=len(variances))
        alone = np.divide(variances, squares, out=np.zeros_like(variances), where=squares > 0.0)
        return tuple(
            norm_of(
                [part.knowledge_of(min(number, len(part.processes) - 1)) for part in measured.parts],
                variances,
                measured.linear.slope**2 * alone,
                self.promise.confidence,
                self.level,
                self.quantile if len(self.sides) == 1 else None,
            )
            for number in range(max(len(part.processes) for part in measured.parts))
        )

    def norm(self, t: Tolerances) -> Norm:
        """The norm of designs by the processes that they choose."""
        if not isinstance(t, AsMade) or t.chosen is None or len(self.norms) == 1:
            return self.norms[0]
        at = t.chosen, np.arange(t.chosen.shape[1])
        even, own, shared = (
            np.array([getattr(norm, name) for norm in self.norms])[at] for name in ("even", "own", "shared")
        )
        errors = [norm.error for norm in self.norms if norm.error is not None]
        return Norm(even, own, shared, np.array(errors)[at] if errors else None)

    @property
    def sides(self) -> list[tuple[float, float]]:
        """Direction and distance of each limit from the mean that does not move with t."""
        mechanism = self.measured.mechanism
        ends = [(1.0, mechanism.upper - mechanism.centre), (-1.0, mechanism.centre - mechanism.lower)]
        return [(side, room) for side, room in ends if np.isfinite(room)]

    @property
    def quantile(self) -> float:
        """Standard deviations that must fit between mean and each limit."""
        return self.promise.quantile(two_sided=len(self.sides) == 2)

    def promised(self, t: Tolerances) -> Array:
        """The promised yield [percent] (n,): assured by the norm, or expected.

        For an assured yield between two limits, both count at the distance of the nearer one.
        """
        if self.promise.statement != ASSURED:
            return self.posterior.expected(self.measured, t)
        z = np.min([self._room(t, *end) for end in self.sides], axis=0) / self._spread(t)
        return normal_yield(z, two_sided=len(self.sides) == 2)

    def slopes(self, t: Tolerances) -> Array:
        """Derivatives (n, parts) of the promised yield by the spread of the parts."""
        if self.promise.statement != ASSURED:
            return self.posterior.expected_slopes(self.measured, t)
        room = np.array([self._room(t, *end) for end in self.sides])
        nearest, spread = np.argmin(room, axis=0), self._spread(t)
        side = np.array([side for side, _ in self.sides])[nearest]
        z = room.min(axis=0) / spread
        rise = -side[:, None] * self.measured.linear.mean - z[:, None] * self.norm(t).slopes(spread_of(t))
        bell = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi) * (1.0 + (len(self.sides) == 2))
        return np.asarray(100.0 * (bell / spread)[:, None] * rise)

    def lacking(self, t: Tolerances) -> Array:
        """By how much (n,) the nearest limit would have to be widened for the promise."""
        z = self.quantile * self._spread(t)
        return np.asarray(np.max([z - self._room(t, *end) for end in self.sides], axis=0))

    def _spread(self, t: Tolerances) -> Array:
        return np.maximum(self.norm(t).value(spread_of(t)), MIN_NORM)

    def _room(self, t: Tolerances, side: float, room: float) -> Array:
        """Distance (n,) of a limit from the mean."""
        linear = self.measured.linear
        moved = spread_of(t) @ linear.mean + mean_of(t) @ linear.slope
        return np.asarray(room - side * moved)


# Processes of a stack that are chosen by sampled scatter: the level that keeps such a choice.


POINTS = 6
"""Tolerances that represent a range in the choices that are tested."""
UNREACHABLE_LEVEL = 1.0 - 1e-12
"""Level of the norm where no level is sure: hardly any allocation keeps it."""


def level_of(requirements: Sequence[Measured], promise: Promise, seed: int) -> Level | None:
    """The level of the norm; None where no sampled process is chosen among others, or no assurance
    is asked for. A stated level is taken as it is.
    """
    parts, bounded = requirements[0].parts, [measured for measured in requirements if measured.mechanism.bounded]
    if promise.statement != ASSURED or not bounded or not is_chosen_by_sample(parts):
        return None
    if promise.level_percent is not None:
        return Level(0.01 * promise.level_percent, float("nan"), float("nan"), sure=True)
    owners: list[tuple[int, str]] = []
    df: list[float] = []
    n: list[float] = []
    for at, part in enumerate(parts):
        for number in range(len(part.processes)):
            if _owner(part, at, number) not in owners:
                known = part.knowledge_of(number)
                owners.append(_owner(part, at, number))
                df.append(np.inf if known is None else known.df)
                n.append(np.inf if known is None else known.n)
    ways = [_ways(part, at, bounded, owners) for at, part in enumerate(parts)]
    level = calibrated(
        ways, Processes(np.array(df), np.array(n)), _aim(bounded, promise), np.random.default_rng([seed, len(parts)])
    )
    return level if level.sure else Level(UNREACHABLE_LEVEL, level.kept_fraction, level.without, sure=False)


def is_chosen_by_sample(parts: Sequence[Part]) -> bool:
    """Whether a part has several processes, one of them known by a sample."""
    return any(part.sampled and len(part.processes) > 1 for part in parts)


def _owner(part: Part, at: int, number: int) -> tuple[int, str]:
    """Part and machine: a machine scatters alike with and without inspection."""
    machine = part.processes[number].machine
    return at, "" if machine is None else machine.name


def _aim(bounded: Sequence[Measured], promise: Promise) -> Aim:
    """The promise of every requirement with limits."""
    ends = np.array([[measured.mechanism.lower, measured.mechanism.upper] for measured in bounded])
    ends -= np.array([[measured.mechanism.centre] for measured in bounded])
    both = np.all(np.isfinite(ends), axis=1)
    quantile = np.array([promise.quantile(two_sided) for two_sided in both.tolist()])
    return Aim(promise.fraction, promise.confidence, ends, quantile)


def _ways(part: Part, at: int, bounded: Sequence[Measured], owners: Sequence[tuple[int, str]]) -> Ways:
    """All processes of a part, at points of their ranges."""
    cost, owner, spread, mean = [], [], [], []
    for number, process in enumerate(part.processes):
        ends = process.low, process.high
        t = np.array([process.low]) if ends[0] == ends[1] else np.geomspace(*ends, POINTS)
        made = spread_and_mean(part, process, t)
        price = np.zeros(len(t)) if process.curve is None else process.curve.cost(t)
        cost.append(part.count * price)
        owner += [owners.index(_owner(part, at, number))] * len(t)
        spread.append(made[0])
        mean.append(made[1])
    spreads, means = np.concatenate(spread), np.concatenate(mean)
    variance = np.array([measured.linear.covariance[at, at] for measured in bounded])
    squares = np.array(
        [np.sum(measured.mechanism.sensitivities[measured.mechanism.owners == at] ** 2) for measured in bounded]
    )
    slope = np.array([measured.linear.slope[at] for measured in bounded])
    moving = np.array([measured.linear.mean[at] for measured in bounded])
    return Ways(
        cost=np.concatenate(cost),
        process=np.array(owner, dtype=np.int64),
        std=np.sqrt(variance)[:, None] * spreads,
        mean=slope[:, None] * means + moving[:, None] * spreads,
        pieces=np.divide(slope**2, squares, out=np.zeros_like(slope), where=squares > 0.0),
    )


# The promise of a stack: its outputs, its limits and its faults.


def promise_outputs(promise: Promise | None, requirements: Sequence[Requirement]) -> list[Output]:
    """The outputs of a promise: of each requirement with limits, and of all together."""
    if promise is None:
        return []
    bounded = [requirement for requirement in requirements if requirement.bounded]
    outputs = [output for requirement in bounded for output in outputs_of_promise(promise, requirement.output(""))]
    joint = bool(requirements[0].key) and bool(bounded)
    return outputs + (list(assurances(ASSURANCE)) if joint else [])


def promise_limits(definition: Definition, given: Mapping[str, Bound]) -> dict[str, Bound]:
    """The limits of a run with its promise: a limit on the yield means the promise."""
    promise = definition.promise
    if promise is None:
        return dict(given)
    limits = {name: bound for name, bound in given.items() if not means_promise(name, promise)}
    for requirement in definition.requirements:
        if requirement.bounded:
            limits[requirement.output(promise.output)] = Bound(low=promise.yield_percent)
    return limits


def promise_faults(definition: Definition, given: Mapping[str, Bound]) -> list[Fault]:
    """Faults of settings that contradict a promise, or make it meaningless."""
    promise = definition.promise
    if promise is None:
        return []
    faults = contradictions(promise, given)
    if not any(requirement.bounded for requirement in definition.requirements):
        faults.append(Fault("promise", "has no yield: no requirement has a limit; state lower or upper of one"))
    if definition.correlations and promise.statement != PLUG_IN:
        text = (
            f"cannot be {promise.statement} with [[correlation]]: the uncertainty of correlated parts from samples is "
            "not modelled; state plug_in"
        )
        faults.append(Fault("promise.statement", text))
    return faults


@dataclass(frozen=True, eq=False)
class Promises:
    """The promise of every requirement with limits; tolerances have shape (n, parts)."""

    measured: tuple[Measured, ...]
    promise: Promise
    seed: int

    @cached_property
    def posterior(self) -> Posterior:
        """Processes that all requirements share."""
        return Posterior(self.measured[0].parts, self.seed)

    @cached_property
    def requirement_promises(self) -> tuple[Promised, ...]:
        """The promise of each requirement with limits."""
        bounded = [measured for measured in self.measured if measured.mechanism.bounded]
        level = self.level.confidence if self.level is not None else None
        return tuple(Promised(measured, self.promise, self.posterior, level) for measured in bounded)

    @cached_property
    def level(self) -> Level | None:
        """The level of the norm where sampled processes are chosen among."""
        return level_of(self.measured, self.promise, self.seed)

    def outputs(self, t: Tolerances, searching: bool, wanted: Collection[str]) -> dict[str, Array]:
        """Promised yields and assurances (n,); NaN where a search does not need them."""
        by_output = {}
        for promised in self.requirement_promises if self.promise.statement != PLUG_IN else ():
            name = promised.measured.name(PROMISED)
            asked = not searching or name in wanted
            by_output[name] = promised.promised(t) if asked else np.full(len(t), np.nan)
        groups = {promised.measured.name(ASSURANCE): [promised.measured] for promised in self.requirement_promises}
        if self.measured[0].requirement.key:
            groups[ASSURANCE] = [promised.measured for promised in self.requirement_promises]
        for name, group in groups.items():
            names = name, f"{name}_error"
            if searching and name not in wanted:
                by_output |= {output: np.full(len(t), np.nan) for output in names}
                continue
            assurance = self.posterior.assurance(group, t, self.promise.fraction)
            by_output |= dict(zip(names, assurance, strict=True))
        return by_output

    def slopes(self, t: Tolerances, wanted: Collection[str]) -> dict[str, Array]:
        """Derivatives (n, parts) of promised yields that are wanted."""
        return {
            name: promised.slopes(t)
            for promised in self.requirement_promises
            if (name := promised.measured.name(PROMISED)) in wanted
        }

    def intervals(self, tightest: Tolerances) -> dict[str, Interval]:
        """Proven ends: an assured yield is largest at the tightest tolerances (1, parts)."""
        by_output: dict[str, Interval] = {}
        for promised in self.requirement_promises if self.promise.statement != PLUG_IN else ():
            still = not np.any(promised.measured.linear.mean)
            proven = self.promise.statement == ASSURED and still and len(promised.norms) == 1
            most = max(0.0, float(promised.promised(tightest)[0])) if proven else 100.0
            by_output[promised.measured.name(PROMISED)] = 0.0, most
        return by_output | {promised.measured.name(ASSURANCE): (0.0, 100.0) for promised in self.requirement_promises}

    def row(self, output: str) -> Promised | None:
        """The promise that an output is of."""
        return next(
            (promised for promised in self.requirement_promises if promised.measured.name(PROMISED) == output), None
        )


# The same stack with another promise, or with more known of its processes.


def with_statement(stack: Stack, statement: str) -> Stack:
    """The stack with the same promise meant otherwise."""
    promise = stack.definition.promise
    assert promise is not None
    return with_promise(stack, replace(promise, statement=statement))


def with_promise(stack: Stack, promise: Promise) -> Stack:
    """The stack with a promise, whose limits take the place of those of the promise before."""
    limits = {
        name: bound for name, bound in stack.given.limits.items() if not name.split(".")[-1].endswith("yield_percent")
    }
    definition = replace(stack.definition, promise=promise)
    return type(stack)(replace(stack.given, definition=definition, limits=limits))


def least_cost_at_limits(stack: Stack, levels: Mapping[str, float]) -> Stack:
    """Least cost alone, at upper limits on outputs."""
    limits = dict(stack.given.limits) | {name: Bound(high=high) for name, high in levels.items()}
    return type(stack)(replace(stack.given, objectives=("cost",), limits=limits))


def with_knowledge(stack: Stack, known: Mapping[str, Knowledge] | Mapping[str, PartSample]) -> Stack:
    """The stack with other knowledge of the processes, or samples, of some measured parts, means included."""
    definition = stack.definition
    parts = tuple(_part(part, known[part.name]) if part.name in known else part for part in definition.parts)
    mechanisms = tuple(_mechanism(mechanism, definition.parts, parts) for mechanism in definition.mechanisms)
    anew = replace(definition, parts=parts, mechanisms=mechanisms)
    return type(stack)(replace(stack.given, definition=anew))


def _part(part: Part, known: Knowledge | PartSample) -> Part:
    assert part.sample is not None
    sample = known if isinstance(known, PartSample) else replace(part.sample, knowledge=known)
    sample = replace(sample, offset=sample.knowledge.mean if part.sample.offset else 0.0)
    return replace(part, sample=sample, distribution=sample.distribution)


def _mechanism(mechanism: Mechanism, before: tuple[Part, ...], parts: tuple[Part, ...]) -> Mechanism:
    """A mechanism of other processes: what a mean moves is taken to be linear."""
    moved = [new.mean - old.mean for old, new in zip(before, parts, strict=True)]
    shift = sum(slope * moved[at] for slope, at in zip(mechanism.sensitivities, mechanism.owner, strict=True))
    mids = mechanism.mids
    if mids is not None and mechanism.scale is not None:
        mids = mids + mechanism.scale * [moved[at] for at in mechanism.owner]
    return replace(
        mechanism, inputs=tuple(part.distribution for part in parts), centre=mechanism.centre + float(shift), mids=mids
    )
