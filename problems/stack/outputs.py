"""Variables and outputs of a stack, from its parts."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...models.cost_reading import Joint
from ...models.stack.conditioned import Conditioned, condition_on_piece
from ...models.stack.joint_normal import JointNormal, joint_normal
from ...models.stack.mechanism import (
    SIGMAS,
    Sample,
    Tolerances,
    fractions,
    half_width,
    joint_yield_percent,
    limit_of,
    mean_and_deviation,
    scaled,
)
from ...section import Array, Integers, Kind, Output, Variable
from ..limits import Limit
from ..settings import YIELD, Bound, Promise, Settings, VariableSetting
from .definition import Definition, Part, Requirement, Sorting
from .matched import outputs_of_matching
from .promises import WINDOW, Interval, Measured, promise_limits, promise_outputs

if TYPE_CHECKING:
    from .problem import Stack

# Several requirements together: the largest variation, the joint yield.


VARIATIONS = ("variation", "worst_case", "rss")
"""Outputs of which the largest is taken, each times the weight of its requirement."""


def common_unit(requirements: Sequence[Requirement]) -> str | None:
    """The unit of all requirements, None where they differ."""
    units = {requirement.unit for requirement in requirements}
    return units.pop() if len(units) == 1 else None


def joint_variations(requirements: Sequence[Measured], values: Mapping[str, Array]) -> dict[str, Array]:
    """The largest weighted variation (n,) of several requirements of one unit, by kind."""
    if not requirements[0].requirement.key or common_unit([measured.requirement for measured in requirements]) is None:
        return {}
    return {
        kind: np.max([measured.requirement.weight * values[measured.name(kind)] for measured in requirements], axis=0)
        for kind in VARIATIONS
        if all(measured.name(kind) in values for measured in requirements)
    }


def joint_slopes(
    requirements: Sequence[Measured], values: Mapping[str, Array], slopes: Mapping[str, Array]
) -> dict[str, Array]:
    """Derivatives (n, parts) of `joint_variations`: those of the largest."""
    largest_slopes = {}
    for kind, largest in joint_variations(requirements, values).items():
        if not all(measured.name(kind) in slopes for measured in requirements):
            continue
        weighted = [measured.requirement.weight * values[measured.name(kind)] for measured in requirements]
        at = np.argmax(np.array(weighted) == largest, axis=0)
        whole = np.stack([measured.requirement.weight * slopes[measured.name(kind)] for measured in requirements])
        largest_slopes[kind] = whole[at, np.arange(len(at))]
    return largest_slopes


def joint_intervals(requirements: Sequence[Measured], intervals: Mapping[str, Interval]) -> dict[str, Interval]:
    """Proven ends of `joint_variations` from those of the requirements."""
    joint = {}
    for kind in VARIATIONS if requirements[0].requirement.key else ():
        ends = [(measured.requirement.weight, intervals.get(measured.name(kind))) for measured in requirements]
        known = [(weight * low, weight * high) for weight, pair in ends if pair is not None for low, high in [pair]]
        if len(known) == len(requirements):
            joint[kind] = max(low for low, _ in known), max(high for _, high in known)
    return joint


OBJECTIVES = ("cost", "variation")
_MEANING = {
    "worst_case": "worst case",
    "rss": "root sum square",
    "shifted_rss": "mean shifts and root sum square",
    "monte_carlo": "half-width at the coverage",
}
_WORST = ("sum of |sensitivity| times tolerance", "largest deviation over the corners of the tolerances")
"""Of a formula that its slopes describe, and of another."""
_BY = ("by the linear model", "by a sample of units")
"""The same."""


def variables_of(parts: Iterable[Part]) -> tuple[Variable, ...]:
    """`<part>_t`, and `<part>_process` where there is something to choose."""
    variables = []
    for part in parts:
        high = part.processes[0].high if part.fixed else part.high
        variables.append(
            Variable(
                name=f"{part.name}_t",
                unit=part.unit,
                kind=Kind.HALF_WIDTH,
                low=part.low,
                high=high,
                meaning=f"{'tolerance' if part.feature is None else 'reach'} of {part.label}",
                valid_low=0.0,
            )
        )
        if part.alternatives:
            variables.append(
                Variable(
                    name=f"{part.name}_process",
                    unit="",
                    kind=Kind.CHOICE,
                    low=0.0,
                    high=float(len(part.processes) - 1),
                    meaning=f"process that part {part.name} is made by",
                    integer=True,
                    valid_low=0.0,
                    valid_high=float(len(part.processes) - 1),
                    labels=tuple(process.name for process in part.processes),
                )
            )
    return tuple(variables)


def outputs_of(
    requirements: Sequence[Requirement],
    parts: Sequence[Part],
    measured: Sequence[Measured] = (),
    promise: Promise | None = None,
    sortings: Sequence[Sorting] = (),
) -> tuple[Output, ...]:
    """The outputs of a stack, in the order of the tables.

    Without `measured`, all outputs that there may be.
    """
    outputs = [Output("cost", "", "cost of all parts", low=0.0)]
    outputs += outputs_of_matching(sortings, any(requirement.bounded for requirement in requirements))
    if requirements[0].key:
        outputs += _joint_outputs(requirements)
    for at, requirement in enumerate(requirements):
        outputs += _requirement_outputs(requirement, measured[at] if measured else None, parts)
    return (*outputs, *promise_outputs(promise, requirements))


def _joint_outputs(requirements: Sequence[Requirement]) -> list[Output]:
    """Outputs over all of several requirements."""
    unit, outputs = common_unit(requirements), []
    if unit is not None:
        outputs = [
            Output(kind, unit, f"largest {kind.replace('_', ' ')} of all requirements, each times its weight", low=0.0)
            for kind in VARIATIONS
        ]
    return outputs + _yields("yield_percent", "units that keep every requirement within its limits")


def _requirement_outputs(requirement: Requirement, measured: Measured | None, parts: Sequence[Part]) -> list[Output]:
    """Outputs of one requirement."""
    unit, name = requirement.unit, requirement.name or "the requirement"
    of_what = "worst case" if requirement.method == "worst_case" else "variance"
    meaning = f"variation of {name}: {_MEANING[requirement.method]}"
    qualified = requirement.output
    shown = range(len(parts)) if measured is None else measured.shown
    rough = measured is not None and measured.rough
    outputs = [
        Output(qualified("variation"), unit, meaning, low=0.0),
        Output(qualified("worst_case"), unit, _WORST[rough], low=0.0),
        Output(qualified("rss"), unit, f"three standard deviations, {_BY[rough]}", low=0.0),
        Output(qualified("std"), unit, f"standard deviation of {name}, {_BY[rough]}", low=0.0),
        *(
            Output(qualified(end), unit, f"{words} {name} of parts within their zones", larger_is_better=side < 0.0)
            for (end, side), words in zip(WINDOW.items(), ("least", "greatest"), strict=True)
        ),
        *_yields(qualified("yield_percent"), f"units with {name} within its limits"),
    ]
    if measured is None or measured.partial:
        outputs.append(
            Output(
                qualified("domain_margin"),
                "",
                f"distance of {name} from the edge of its formula's domain, in units of that at the mid-limits",
                larger_is_better=True,
            )
        )
    return outputs + [
        Output(
            qualified(f"contribution_{parts[at].name}_percent"),
            "percent",
            f"fraction of the {of_what} due to part {parts[at].name}",
        )
        for at in shown
    ]


def _yields(name: str, meaning: str) -> list[Output]:
    return [
        Output(name, "percent", meaning, larger_is_better=True, low=0.0, high=100.0),
        Output(f"{name}_error", "percent", "standard error of the yield", error_of=name),
    ]


# Proven bounds of the outputs of a stack.


def intervals_of(stack: Stack) -> dict[str, Interval]:
    """Proven bounds of the outputs of every requirement, and of all together."""
    tightest, loosest = stack.ends_as_made
    intervals: dict[str, Interval] = {}
    for measured in stack.measured:
        intervals |= measured.intervals(tightest, loosest)
        if measured.partial:
            name = measured.name("domain_margin")
            most, least = (float(measured.margin(t)[name][0]) for t in (tightest, loosest))
            intervals[name] = least, most
    if stack.promises is not None:
        intervals |= stack.promises.intervals(tightest)
    most = min(intervals[measured.name("yield_percent")][1] for measured in stack.measured)
    joint = joint_intervals(stack.measured, intervals)
    return intervals | joint | {"yield_percent": (0.0, most)}


# Derivatives by differences: by the limits of parts that machines make, and of counted yields.


STEP = 1e-6
"""Relative step of a limit."""
RELATIVE_STEP = 0.05
"""Relative step of a tolerance for outputs that are counted: enough units must change sides."""


def slopes_by_limit(stack: Stack, designs: Array, slopes: dict[str, Array]) -> dict[str, Array]:
    """Derivatives (n, parts) by tolerances: by differences where a machine makes the part."""
    parts = stack.definition.parts
    by_machine = [at for at, part in enumerate(parts) if part.by_machine]
    if not by_machine:
        return slopes
    derivatives = {name: slope.copy() for name, slope in slopes.items()}
    for at in by_machine:
        column = stack.names.index(f"{parts[at].name}_t")
        step = STEP * designs[:, column]
        ends = []
        for side in (1.0, -1.0):
            moved = designs.copy()
            moved[:, column] += side * step
            ends.append(_linear_outputs(stack, moved, derivatives.keys()))
        for name in derivatives:
            derivatives[name][:, at] = (ends[0][name] - ends[1][name]) / (2.0 * step)
    return derivatives


def slopes_by_count(stack: Stack, designs: Array) -> dict[str, Array]:
    """Derivatives (n, parts) of the required yields and half-widths where a formula is not described
    by its slopes at the mid-limits: by central differences, on the units of a report.
    """
    rough = [measured for measured in stack.measured if measured.rough]
    names = {measured.name(output) for measured in rough for output in ("yield_percent", "variation", "rss", "std")}
    names = (names | ({"yield_percent"} if rough else set())) & stack.yields.required_outputs
    names -= {measured.name("variation") for measured in rough if measured.requirement.method == "worst_case"}
    derivatives = {name: np.zeros((len(designs), len(stack.definition.parts))) for name in names}
    for at, part in enumerate(stack.definition.parts if names else ()):
        if part.low == part.high:
            continue
        column, ends = stack.names.index(f"{part.name}_t"), []
        for side in (1.0, -1.0):
            moved = designs.copy()
            moved[:, column] *= 1.0 + side * RELATIVE_STEP
            ends.append(stack.yields.outputs(stack.parts_as_made(moved), searching=False, needed=True))
        for name in names & set(ends[0]):
            derivatives[name][:, at] = (ends[0][name] - ends[1][name]) / (2.0 * RELATIVE_STEP * designs[:, column])
    return derivatives


def _linear_outputs(stack: Stack, designs: Array, wanted: Collection[str]) -> dict[str, Array]:
    """The outputs (n,) that have derivatives, yields and half-widths by their laws; ends by corners where `wanted`."""
    t, coverage = stack.parts_as_made(designs), stack.settings.propagation.coverage
    outputs: dict[str, Array] = {}
    for measured in stack.measured:
        outputs |= measured.variations(t) | measured.margin(t)
        outputs |= measured.window(t, asked=any(measured.name(end) in wanted for end in WINDOW))
        if (distribution := measured.distribution) is not None:
            outputs[measured.name("yield_percent")] = distribution.yield_percent(t)[0]
            if measured.requirement.method == "monte_carlo":
                outputs[measured.name("variation")] = distribution.half_width(t, coverage)
        else:
            outputs[measured.name("yield_percent")] = measured.linear_yield(t)
    if YIELD in wanted and stack.yields.joint is not None:
        outputs[YIELD] = stack.yields.joint.yield_percent(t)[0]
    if stack.promises is not None:
        outputs |= stack.promises.outputs(t, True, stack.required_outputs)
    return outputs | joint_variations(stack.measured, outputs)


# Costs of the parts of a stack.


@dataclass(frozen=True, eq=False)
class PartCosts:
    """Costs of `parts`, each made by one of its processes; tolerances t have shape (n, parts)."""

    parts: tuple[Part, ...]

    def by_part(self, t: Array, chosen: Integers, slope: bool = False) -> Array:
        """Cost, or its slope, of every part (n, parts) by the processes chosen (n, parts)."""
        if self._joint is not None and not slope:
            with np.errstate(divide="ignore"):
                return self._joint.cost(t) * self._counts
        costs = np.zeros_like(t)
        for at, part in enumerate(self.parts):
            for number, process in enumerate(part.processes):
                rows = chosen[:, at] == number
                if process.curve is not None and np.any(rows):
                    curve = process.curve.slope if slope else process.curve.cost
                    with np.errstate(divide="ignore", invalid="ignore"):
                        costs[rows, at] = part.count * curve(t[rows, at])
        return costs

    @cached_property
    def interval(self) -> tuple[float, float]:
        """Least and largest cost: every part in its cheapest and its most expensive process."""
        ends = np.zeros(2)
        for part in self.parts:
            costs = [
                process.curve.cost(np.array([process.high, process.low]))
                for process in part.processes
                if process.curve is not None
            ]
            if costs:
                ends += part.count * np.array([np.min(costs), np.max(costs)])
        return float(ends[0]), float(ends[1])

    @cached_property
    def _joint(self) -> Joint | None:
        """The curves of all parts as one, where each has one and there are no alternatives."""
        curves = [part.processes[0].curve for part in self.parts if not part.alternatives]
        known = [curve for curve in curves if curve is not None]
        return Joint.of(known) if len(known) == len(self.parts) else None

    @cached_property
    def _counts(self) -> Array:
        return np.array([float(part.count) for part in self.parts])


# Settings that follow from the definition of a stack.


def complete_definition(definition: Definition, measured: Sequence[Measured], given: Settings) -> Settings:
    """With fixed tolerances, the only process of a part, and limits of margins and promises."""
    fixed = {f"{p.name}_t": p.low for p in definition.parts if p.low == p.high}
    fixed |= {f"{p.name}_process": 0.0 for p in definition.parts if p.alternatives and len(p.processes) == 1}
    variables = {name: VariableSetting(value=value) for name, value in fixed.items()}
    limits = {
        requirement.name("domain_margin"): Bound(low=0.0) for requirement in measured if requirement.bound_to_domain
    }
    limits |= promise_limits(definition, given.limits)
    return replace(given, variables=variables | dict(given.variables), limits=limits)


# Yields and half-widths of a stack, by samples that all its requirements and designs share.


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
    _samples: dict[tuple[int, bool], Sample] = field(default_factory=dict, init=False)

    def __getstate__(self) -> dict[str, object]:
        """Everything but the samples, which another process draws again."""
        return {**self.__dict__, "_samples": {}}

    def outputs(self, t: Tolerances, searching: bool, needed: bool) -> dict[str, Array]:
        """Half-widths and yields; NaN without limits.

        Outputs that only a report shows are NaN where only those `needed` are asked for.
        """
        by_output: dict[str, Array] = {}
        for measured in self.measured:
            if measured.requirement.method == "monte_carlo":
                by_output |= self._half_width(measured, t, searching, needed)
            if measured.rough:
                by_output |= self._deviations(measured, t, needed)
        return by_output | self.percentages(t, searching, needed)

    def percentages(self, t: Tolerances, searching: bool = False, needed: bool = False) -> dict[str, Array]:
        """The yields and their errors (n,) [percent]; NaN without limits."""
        by_output: dict[str, Array] = {}
        for name, bounded in self._yields():
            by_output |= self._yield(name, bounded, t, searching, needed)
        return by_output

    def _deviations(self, measured: Measured, t: Tolerances, needed: bool) -> dict[str, Array]:
        """Root sum square, and what follows from it, of a formula that its slopes do not describe."""
        method = measured.requirement.method
        names = {"rss", "std"} | ({"variation"} if method in ("rss", "shifted_rss") else set())
        if needed and not self.required_outputs & ({measured.name(name) for name in names} | names):
            return {measured.name(name): np.full(len(t), np.nan) for name in names}
        mean, std = mean_and_deviation(measured.mechanism, t, self.reported)
        rss = SIGMAS * std
        shift = np.abs(mean - measured.mechanism.centre) + measured.measured_shift if method == "shifted_rss" else 0.0
        by_output = {"rss": rss, "std": std, "variation": rss + shift}
        return {measured.name(name): by_output[name] for name in names}

    def shares(self, measured: Measured, t: Tolerances) -> dict[str, Array]:
        """Contributions [%] of the parts (n,) of a requirement.

        Where slopes do not describe its formula, those in the growth of the standard deviation s with
        all tolerances, t_j ds/dt_j, which for a linear formula are those in the variance.
        """
        if not measured.rough or measured.requirement.method == "worst_case":
            return measured.shares(t)
        growth = np.zeros_like(limit_of(t))
        for at in measured.shown:
            for side in (1.0, -1.0):
                factor = np.ones(len(measured.parts))
                factor[at] += side * RELATIVE_STEP
                growth[:, at] += side * mean_and_deviation(measured.mechanism, scaled(t, factor), self.reported)[1]
        shares = fractions(growth)
        return {measured.contribution(at): 100.0 * shares[:, at] for at in measured.shown}

    def _yields(self) -> list[tuple[str, list[Measured]]]:
        """The yields by name, with the requirements that have limits."""
        bounded = [measured for measured in self.measured if measured.mechanism.bounded]
        pairs = [
            (measured.name("yield_percent"), [measured] if measured in bounded else []) for measured in self.measured
        ]
        return [*pairs, ("yield_percent", bounded)] if self.measured[0].requirement.key else pairs

    def counts_half_width(self, measured: Measured) -> bool:
        """Whether the variation of a requirement is the half-width of a sample."""
        return measured.requirement.method == "monte_carlo" and measured.distribution is None

    @cached_property
    def joint(self) -> JointNormal | None:
        """The law of all requirements with limits together, where that is known and they are several."""
        name, bounded = self._yields()[-1]
        known = name == YIELD and len(bounded) > 1
        return joint_normal([m.mechanism for m in bounded], [m.law for m in bounded]) if known else None

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
            if self.counts_half_width(measured) and self.required_outputs & {name, "variation"}:
                slopes[name] = self._by_design([measured], t, lambda c, row: c.half_width_slopes(row, coverage))
                normal = measured.linear.rss_slopes(t) * self._normal_factor(measured, t)
                slopes[name] = np.where(np.isnan(slopes[name]), normal, slopes[name])
        for name, bounded in self._yields():
            if name not in self.required_outputs or (len(bounded) == 1 and bounded[0].distribution is not None):
                continue
            if len(bounded) > 1 and self.joint is not None:
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
            sample = self.drawn(units if searching else self.settings.propagation.samples // per_unit, searching)
            mechanisms = [measured.mechanism for measured in requirements]
            self._conditioned[key] = condition_on_piece(mechanisms, sample)
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
            whole, error = distribution.yield_percent(t)
            constant = bounded[0].linear.variance(t) == 0.0  # every unit is the mean, which may just keep a limit
            return {name: np.where(constant, 100.0 * bounded[0].means_kept(t), whole), names[1]: error}
        if len(bounded) > 1 and self.joint is not None:
            return dict(zip(names, self.joint.yield_percent(t), strict=True))
        estimates = np.full((2, len(t)), np.nan)
        if (integrated := self._estimate(bounded, searching)) is not None:
            for at in range(len(t)):
                if (kept := integrated.within(t[at : at + 1])) is not None:
                    estimates[:, at] = 100.0 * kept.mean(), 100.0 * kept.std(ddof=1) / np.sqrt(len(kept))
                    if np.any(kept == 1.0):  # too few units decide for a scatter
                        estimates[1, at] = max(estimates[1, at], 100.0 / integrated.sample.size)
        missing = np.isnan(estimates[0])
        if not searching:
            counted = estimates[0] * (100.0 - estimates[0]) / self.settings.propagation.samples
            missing |= estimates[1] > np.sqrt(np.maximum(counted, 0.0))  # the error of a count
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

    @property
    def reported(self) -> Sample:
        """The whole sample."""
        return self.drawn(self.settings.propagation.samples)

    @property
    def searching(self) -> Sample:
        """The sample of a search."""
        return self.drawn(SEARCH_SAMPLES, searching=True)

    def drawn(self, most: int, searching: bool = False) -> Sample:
        """At most so many units, drawn once; fewer are the first ones of more. Those of a search are others than those
        of a report, which it is tested on.
        """
        samples = min(most, self.settings.propagation.samples)
        if (samples, searching) not in self._samples:
            rng = np.random.default_rng((self.settings.seed, 1) if searching else self.settings.seed)
            self._samples[samples, searching] = Sample.draw(self.measured[0].mechanism, samples, rng)
        return self._samples[samples, searching]
