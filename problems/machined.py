"""Problems whose tolerances may be made by machines with a known scatter."""

from __future__ import annotations

from abc import abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from scipy.special import ndtri

from ..models.capability import Knowledge, PartSample
from ..models.costs import CostCurve
from ..models.input_reading import read_distribution
from ..models.inputs import Normal
from ..models.machine_offers import PLUG_IN, Offer, Owner, Way, departures_from_normality, read_offers, samples_of
from ..models.machines import GoodPartsBySpread
from ..section import Array, Assumption, Flags, Integers, Kind, Section, Variable
from ..units import split_unit
from .cost_columns import choice_of
from .declaration import ConfiguredProblem, Declaration, Interval, Response, evaluations
from .deviations import Draws
from .promise import WithPromise
from .settings import ASSURED, Settings, VariableSetting, assured_percent
from .tolerance_problem import ToleranceProblem

# A tolerance that machines make: its ways, the scatter of its good parts, and what they cost.


SCALE = 3.0
"""Half-widths of a normal input with Cp = 1 per standard deviation."""


@dataclass(frozen=True, eq=False)
class MachinedTolerance:
    """A tolerance that is made by machines: the ways to use them, and the variable that chooses."""

    name: str
    offers: tuple[Offer, ...]

    @property
    def choice(self) -> str:
        """Name of the variable that chooses a way."""
        return choice_of(self.name)

    @cached_property
    def ways(self) -> tuple[Way, ...]:
        """Every machine with and without inspection."""
        return tuple(way for offer in self.offers for way in offer.ways())

    @property
    def low(self) -> float:
        """Tightest limit of any way."""
        return min(way.low for way in self.ways)

    @property
    def high(self) -> float:
        """Loosest limit of any way."""
        return max(way.high for way in self.ways)

    def by_spread(self, way: Way) -> GoodPartsBySpread:
        """An inspected way by the spread of its good parts, in half-widths."""
        return GoodPartsBySpread(way.machine, way.low, way.high, SCALE)

    def clipped(self, t: Array, chosen: Integers) -> Array:
        """Limits (n,) moved to the nearest that the chosen way holds."""
        low, high = (np.array([getattr(way, end) for way in self.ways]) for end in ("low", "high"))
        return np.clip(t, low[chosen], high[chosen])

    def spread_and_mean(self, t: Array, chosen: Integers) -> tuple[Array, Array]:
        """Half-width of a normal input with the scatter of good parts, and their mean (n,)."""
        return self.by_way(
            t, chosen, lambda way, t: (SCALE * way.machine.good_parts(t).std, way.machine.good_parts(t).mean)
        )

    def slopes(self, t: Array, chosen: Integers) -> tuple[Array, Array]:
        """Derivatives of the two by the limit (n,)."""
        return self.by_way(
            t,
            chosen,
            lambda way, t: (SCALE * way.machine.good_parts(t).std_slope, way.machine.good_parts(t).mean_slope),
        )

    def cost(self, t: Array, chosen: Integers) -> tuple[Array, Array]:
        """Cost of a good part, and its derivative by the limit (n,)."""
        return self.by_way(t, chosen, lambda way, t: (way.curve.cost(t), way.curve.slope(t)))

    def by_way(self, t: Array, chosen: Integers, values: Any) -> tuple[Array, Array]:
        """Two values (n,) of each design by its way."""
        first, second = np.zeros_like(t), np.zeros_like(t)
        for number, way in enumerate(self.ways):
            rows = chosen == number
            if np.any(rows):
                first[rows], second[rows] = values(way, t[rows])
        return first, second

    def limits(self, spread: Array, chosen: Integers) -> Array:
        """Limits (n,) at spreads (n,) of good parts."""
        return self.by_way(
            spread, chosen, lambda way, x: (way.low if way.low == way.high else self.by_spread(way).limit(x), 0.0)
        )[0]


def curve_of(tolerance: MachinedTolerance, way: Way, low: float, high: float) -> CostCurve:
    """Cost of a way against the spread of its good parts."""
    return way.curve if low == high else tolerance.by_spread(way)


def add_machine_choices(
    variables: tuple[Variable, ...], machines: Mapping[str, tuple[Offer, ...]]
) -> tuple[Variable, ...]:
    """The variables, and at the end a choice of machine for each that is made by some."""
    return (*variables, *(_choice(MachinedTolerance(name, offers)) for name, offers in machines.items()))


def _choice(tolerance: MachinedTolerance) -> Variable:
    """The variable that chooses the machine of a tolerance."""
    last = float(len(tolerance.ways) - 1)
    return Variable(
        tolerance.choice,
        "",
        Kind.CHOICE,
        0.0,
        last,
        f"machine for {tolerance.name}",
        document=0.0,
        integer=True,
        valid_low=0.0,
        valid_high=last,
        labels=tuple(way.label for way in tolerance.ways),
    )


def _declare_machines(
    declaration: Declaration, machines: Mapping[str, tuple[Offer, ...]], stated: Sequence[str]
) -> Declaration:
    """With the choices of machines; variables that are made by machines, faulty or not, have no cost curve."""
    by_problem = declaration.unpriced
    return replace(
        declaration,
        variables=add_machine_choices(declaration.variables, machines),
        unpriced=lambda parameters: by_problem(parameters) | set(stated),
        machines=dict.fromkeys(stated, ()) | dict(machines),
    )


class Machined(ToleranceProblem):
    """A problem with tolerances that machines may make: `[[variables.NAME.machine]]`.

    Good parts count as normal with the mean and standard deviation of their machine. `machinable`
    names the variables that may have machines.
    """

    machinable: frozenset[str] = frozenset()

    def __init__(self, settings: Settings | None = None) -> None:
        given = settings or Settings()
        self.machined_tolerances = {name: MachinedTolerance(name, offers) for name, offers in given.machines.items()}
        if self.machined_tolerances:
            variables = add_machine_choices(self.declaration.variables, given.machines)
            self.declaration = replace(self.declaration, variables=variables, machines=given.machines)
        super().__init__(settings)

    @classmethod
    def configured(cls, top: Section) -> ConfiguredProblem | None:
        section = top.section("variables")
        declared = {v.name: v for v in cls.declaration.variables}
        stated = [name for name in declared if name in section and "machine" in section.section(name)]
        machines = {}
        for name in stated:
            table = section.section(name)
            if name not in cls.machinable:
                table.fault(
                    "machine", f"{name} has no machines here; these may have some: {', '.join(sorted(cls.machinable))}"
                )
                continue
            offers = read_offers(table, _owner(table, declared[name], top.section("parameters")))
            cls._check(table)
            if name in top.section("costs"):
                top.section("costs").fault(name, "is stated in addition to machines, which have prices: leave it out")
            if offers is not None:
                machines[name] = offers
        configured = super().configured(top)
        if not stated or configured is None:
            return configured
        return replace(
            configured,
            declaration=_declare_machines(configured.declaration, machines, stated),
            read={**configured.read, "machines": machines},
        )

    @classmethod
    def _check(cls, table: Section) -> None:
        """Faults of the other keys of a variable that machines make."""
        if "value" in table:
            table.fault("value", "is fixed although machines are stated: limits of inspection are low and high")
        if table.take("measured") is not None:
            table.fault("measured", "is stated in addition to machines: state it in each [[...machine]]")
        given = read_distribution(table) if "distribution" in table else Normal()
        if given != Normal():
            table.fault(
                "distribution",
                "must be left out where machines are stated: their good parts count as normal, with the mean and "
                "scatter of the machine",
            )

    def _completed(self, given: Settings) -> Settings:
        variables = dict(given.variables)
        for tolerance in self.machined_tolerances.values():
            setting = given.variables.get(tolerance.name, VariableSetting())
            fixed = tolerance.low == tolerance.high
            variables[tolerance.name] = VariableSetting(
                value=tolerance.low if fixed else None,
                low=None if fixed else tolerance.low,
                high=None if fixed else tolerance.high,
                distribution=Normal(),
                mid=setting.mid,
            )
            if len(tolerance.ways) == 1:
                variables[tolerance.choice] = VariableSetting(value=0.0)
        settings = super()._completed(replace(given, variables=variables))
        if not self.machined_tolerances:
            return settings
        costs = {name: curve for name, curve in settings.costs.items() if name not in self.machined_tolerances}
        return replace(settings, costs=costs)

    def assumptions(self) -> tuple[Assumption, ...]:
        return (
            *super().assumptions(),
            *(assumed for tolerance in self.machined_tolerances.values() for assumed in _assumptions(tolerance)),
        )

    def cautions(self) -> tuple[str, ...]:
        tolerances = self.machined_tolerances.items()
        return (
            *super().cautions(),
            *(text for name, made in tolerances for text in departures_from_normality(made.offers, name)),
        )

    def samples(self) -> tuple[tuple[str, str, PartSample], ...]:
        return (
            *super().samples(),
            *(
                (f"{tolerance.name}, machine {machine}", split_unit(tolerance.name)[1], sample)
                for tolerance in self.machined_tolerances.values()
                for machine, sample in samples_of(tolerance.offers)
            ),
        )

    # ---------------------------------------------------------------- designs

    def chosen(self, designs: Array, tolerance: MachinedTolerance) -> Integers:
        """Number of the way (n,) that a tolerance is made in."""
        return np.rint(self.column(designs, tolerance.choice)).astype(np.int64)

    def complete(self, x: Array) -> Array:
        designs = super().complete(x)
        for tolerance in self.machined_tolerances.values():
            at = self.names.index(tolerance.name)
            designs[:, at] = tolerance.clipped(designs[:, at], self.chosen(designs, tolerance))
        return designs

    def misplaced(self, designs: Array) -> dict[str, dict[int, str]]:
        messages: dict[str, dict[int, str]] = {}
        for tolerance in self.machined_tolerances.values():
            t, chosen = self.column(designs, tolerance.name), self.chosen(designs, tolerance)
            for row in np.flatnonzero(np.abs(tolerance.clipped(t, chosen) - t) > 1e-9 * t).tolist():
                way = tolerance.ways[chosen[row]]
                messages.setdefault(tolerance.name, {})[row] = (
                    f"{way.label} holds {way.low:g} to {way.high:g}, got {t[row]:g}"
                )
        return messages

    def effective(self, designs: Array) -> Array:
        """Full designs with the spreads of good parts in place of the limits."""
        if not self.machined_tolerances:
            return designs
        with_spreads = np.array(designs, dtype=float)
        for name, (spread, _) in self.as_made(designs).items():
            with_spreads[:, self.names.index(name)] = spread
        return with_spreads

    def as_made(self, designs: Array) -> dict[str, tuple[Array, Array]]:
        """Spread and mean (n,) of good parts of each tolerance that machines make."""
        return {
            tolerance.name: tolerance.spread_and_mean(
                self.column(designs, tolerance.name), self.chosen(designs, tolerance)
            )
            for tolerance in self.machined_tolerances.values()
        }

    def interval(self, output: str) -> Interval:
        for tolerance in self.machined_tolerances.values():
            if output == tolerance.choice:
                return 0.0, float(len(tolerance.ways) - 1)
        return super().interval(output)

    def by_limits(
        self, designs: Array, slopes: dict[str, Array], by_mean: dict[str, dict[str, Array]]
    ) -> dict[str, Array]:
        """Derivatives (n, all variables) by limits from those by the spreads of good parts.

        `by_mean` are those by the means (n,), by output and tolerance.
        """
        for tolerance in self.machined_tolerances.values():
            at = self.names.index(tolerance.name)
            rise, moved = tolerance.slopes(self.column(designs, tolerance.name), self.chosen(designs, tolerance))
            for name, slope in slopes.items():
                slope[:, at] = rise * slope[:, at] + moved * by_mean[name].get(tolerance.name, 0.0)
        return slopes

    def ranges_of(self, name: str) -> tuple[Interval, ...]:
        tolerance = self.machined_tolerances.get(name)
        return super().ranges_of(name) if tolerance is None else tuple((way.low, way.high) for way in tolerance.ways)

    def room(self, name: str, design: Array) -> Interval:
        low, high = super().room(name, design)
        if tolerance := self.machined_tolerances.get(name):
            way = tolerance.ways[int(self.chosen(design[None], tolerance)[0])]
            low, high = max(low, way.low), min(high, way.high)
        return low, high

    def corner(self, tight: bool) -> Array:
        corner = super().corner(tight)
        for tolerance in self.machined_tolerances.values():
            ends = [way.low if tight else -way.high for way in tolerance.ways]
            corner[self.names.index(tolerance.name)] = abs(min(ends))
            corner[self.names.index(tolerance.choice)] = float(np.argmin(ends))
        return corner

    # ---------------------------------------------------------------- costs

    def costs_of(self, designs: Array) -> dict[str, Array]:
        costs = super().costs_of(designs)
        return costs | {
            tolerance.name: tolerance.cost(self.column(designs, tolerance.name), self.chosen(designs, tolerance))[0]
            for tolerance in self.machined_tolerances.values()
        }

    def curves_of(self, name: str) -> tuple[tuple[CostCurve, float], ...]:
        return () if name in self.machined_tolerances else super().curves_of(name)

    def cost_slopes(self, designs: Array) -> Array:
        slopes = super().cost_slopes(designs)
        for tolerance in self.machined_tolerances.values():
            t, chosen = self.column(designs, tolerance.name), self.chosen(designs, tolerance)
            slopes[:, self.names.index(tolerance.name)] = tolerance.cost(t, chosen)[1]
        return slopes

    @cached_property
    def _cost_interval(self) -> Interval:
        """Least and largest cost: of machines those of any way at either end."""
        ends = np.stack([super().corner(tight=False), super().corner(tight=True)])
        plain = ToleranceProblem.costs_of(self, ends)
        low, high = (float(sum(cost[at] for cost in plain.values())) for at in (0, 1))
        for tolerance in self.machined_tolerances.values():
            costs = [way.curve.cost(np.linspace(way.low, way.high, 257)) for way in tolerance.ways]
            low += min(float(cost.min()) for cost in costs)
            high += max(float(cost.max()) for cost in costs)
        return low, high


def _owner(table: Section, variable: Variable, parameters: Section) -> Owner:
    """Unit, limits of inspection and mid-limit of the variable that machines make."""
    ends = [table.number(key, variable.unit) for key in ("low", "high")]
    mid = table.number("mid", variable.unit)
    if mid is None:
        stem, unit = split_unit(variable.name)
        mid = parameters.quantity(f"{stem}_mid_{unit}", unit)
    return Owner(variable.unit, (ends[0], ends[1]), mid=variable.mid or 0.0 if mid is None else mid)


def _assumptions(tolerance: MachinedTolerance) -> list[Assumption]:
    place = f"variables.{tolerance.name}.machine"
    unit = split_unit(tolerance.name)[1]
    assumptions = [
        Assumption(f"{place}.{name}.measured", sample.statement(unit), "", PLUG_IN)
        for name, sample in samples_of(tolerance.offers)
    ]
    open_ = "; ".join(offer.assumed for offer in tolerance.offers if offer.assumed)
    return assumptions + ([Assumption(place, "", "", open_)] if open_ else [])


# The most unfavourable processes that samples allow, to first order in their effect on a value.
#
# Let independent processes have the posterior mean E of the variance ratio, G from there to its
# upper confidence limit, and the limit z sqrt(E/n) standard deviations of the mean. The ellipsoid
#
#     sum_j ((r_j - E_j)/G_j)^2 + sum_j (m_j/(z sqrt(E_j/n_j)))^2 <= b^2
#
# is the region in which a promise must hold: for a sum of deviations and b = 1 that is the norm of
# an assured promise. Its worst point for a value follows from slopes (first-order reliability).
#
# Reference: Hasofer & Lind (1974), Exact and invariant second-moment code format, J. Engineering
# Mechanics Division ASCE 100(1), 111-121.


@dataclass(frozen=True, eq=False)
class Worst:
    """Processes along the worst direction: ratios of variances `even` + b `growth`, errors of means
    b `shift` in estimated standard deviations, (k,) each.
    """

    even: Array
    growth: Array
    shift: Array

    @classmethod
    def of(cls, known: Sequence[Knowledge], by_scale: Array, by_shift: Array, confidence: float) -> Worst:
        """The direction, by derivatives (k,) of a value that is to be small.

        They are by the scale of each standard deviation, and by the error of each mean.
        """
        even = np.array([knowledge.inflation for knowledge in known])
        reach = np.array([knowledge.surplus_at(confidence) for knowledge in known])
        error = float(ndtri(confidence)) * np.sqrt(even / np.array([knowledge.n for knowledge in known]))
        steep = np.concatenate([0.5 * reach * np.maximum(by_scale, 0.0), error * by_shift])
        size = float(np.linalg.norm(steep))
        unit = steep / size if size > 0.0 else steep
        return cls(even, reach * unit[: len(known)], error * unit[len(known) :])

    def at(self, radius: float) -> tuple[Array, Array]:
        """Scales of standard deviations, and errors of means, (k,) each, at b."""
        ratio = np.maximum(self.even + radius * self.growth, 0.01)
        return np.sqrt(ratio), radius * self.shift


# Problems whose yield has no closed form: a promise is tested by draws of the posterior.
#
# In a search a promised yield is that of the most unfavourable processes that the samples allow
# (`worst_process`). At a reported point the units themselves are evaluated at a few draws of the
# posterior, a quadratic function is fitted to them, and all draws decide: the promised yield is that
# of the processes along the worst direction that are as unfavourable as the confidence requires.


SOFTEST, HARDEST = -2.0, 6.0
"""Range along the worst direction in which the processes of the confidence are sought."""
MOST_VERDICTS = 64
"""Most verdicts that are stored."""


@dataclass(frozen=True, eq=False)
class Shortfall:
    """By how much the promised fraction misses its limit, (q,) at q states of the processes; at
    most 0 where it is kept. `slopes` (q, d) are by scales and by the shifts that count, where
    known; `error` is the standard error of a value.
    """

    values: Array
    error: float
    slopes: Array | None = None


@dataclass(frozen=True, slots=True)
class Verdict:
    """The results of a design over the draws, in percent, and the shortfall of each draw."""

    promised: float
    assurance: float
    error: float
    shortfalls: Array


class ProcessProblem(WithPromise):
    """A problem that evaluates its units for any state of its processes.

    A state is a scale of each known standard deviation, and an error of each mean in standard
    deviations by the estimates, in the order of `known`.
    """

    @abstractmethod
    def shortfall(self, design: Array, scales: Array, shifts: Array, searching: bool = False) -> Shortfall:
        """The shortfall of a full design (all,) at states (q, k)."""

    @abstractmethod
    def steepness(self, design: Array, searching: bool) -> tuple[Array, Array]:
        """Derivatives (k,) of the shortfall by scales and shifts where the estimates are true."""

    @abstractmethod
    def yield_at(self, design: Array, scale: Array, shift: Array, searching: bool) -> float:
        """The yield [percent] of a full design (all,) at one state (k,)."""

    @abstractmethod
    def expected_yields(self, designs: Array, searching: bool) -> Array:
        """The yield [percent] (n,) that is expected over the posterior."""

    @cached_property
    def shifting(self) -> Flags:
        """Which means (k,) may be off; by default none."""
        return np.zeros(len(self.known), dtype=bool)

    def coordinates(self, scales: Array, shifts: Array) -> Array:
        """Coordinates (q, d) of states (q, k), of which the shortfall is a smooth function."""
        return np.hstack([scales - 1.0, shifts[:, self.shifting]])

    def worst(self, design: Array, searching: bool) -> Worst:
        """The worst direction of the processes of a full design (all,)."""
        steep = self.steepness(design, searching)
        return Worst.of(list(self.known.values()), *steep, self.stated_promise.confidence)

    def promised_yields(self, designs: Array, searching: bool) -> Array:
        if self.stated_promise.statement != ASSURED:
            return self.expected_yields(designs, searching)
        if not searching:
            return np.array([self.verdict(design).promised for design in designs])
        return np.array([self.unfavourable_yield(design) for design in designs])

    def unfavourable_yield(self, design: Array) -> float:
        """The yield [percent] of a full design (all,) at the worst state, as a search sees it."""
        return self.yield_at(design, *self.worst(design, True).at(1.0), True)

    def assurances(self, designs: Array) -> tuple[Array, Array]:
        verdicts = [self.verdict(design) for design in designs]
        assurance, error = np.array([(verdict.assurance, verdict.error) for verdict in verdicts]).reshape(-1, 2).T
        return assurance, error

    @cached_property
    def _posterior(self) -> Draws:
        """Draws of the processes, which all designs share."""
        return Draws.of(list(self.known.values()), [(self.settings.seed, at) for at in range(len(self.known))])

    @cached_property
    def _verdicts(self) -> OrderedDict[bytes, Verdict]:
        return OrderedDict()

    def verdict(self, design: Array) -> Verdict:
        """The verdict of the draws on a full design (all,)."""
        key = design.tobytes()
        if key not in self._verdicts:
            self._verdicts[key] = self._by_draws(design)
            while len(self._verdicts) > MOST_VERDICTS:
                self._verdicts.popitem(last=False)
        return self._verdicts[key]

    def _by_draws(self, design: Array) -> Verdict:
        if not self.known:
            return self._without_doubt(design)
        drawn = self._posterior
        x = self.coordinates(np.sqrt(drawn.variance), drawn.error)
        fitted = slice(0, evaluations(x.shape[1], self._has_slopes))
        tried = self.shortfall(design, np.sqrt(drawn.variance[fitted]), drawn.error[fitted])
        response, worst = Response.of(x[fitted], tried.values, tried.slopes), self.worst(design, False)

        def along(radius: float) -> float:
            scale, shift = worst.at(radius)
            return float(response(self.coordinates(scale[None, :], shift[None, :]))[0])

        values = response(x)
        wanted = float(np.quantile(values, self.stated_promise.confidence, method="higher"))
        scale, shift = worst.at(_position_of_value(along, wanted))
        there = self.shortfall(design, scale[None, :], shift[None, :])
        # the evaluated units correct the fitted response where it decides
        values += float(there.values[0]) - wanted
        assurance, error = assured_percent(np.array([float(np.mean(values <= 0.0))]), drawn.count)
        doubt = np.hypot(response.rms, there.error)
        reach = 50.0 * float(np.mean(values <= doubt) - np.mean(values <= -doubt))
        return Verdict(
            self.yield_at(design, scale, shift, False), float(assurance[0]), float(np.hypot(error[0], reach)), values
        )

    _has_slopes = False
    """Whether `shortfall` gives slopes."""

    def _without_doubt(self, design: Array) -> Verdict:
        """The verdict on a design whose processes are all known."""
        nothing = np.ones(0)
        shortfall = self.shortfall(design, nothing[None, :], nothing[None, :])
        assurance = 100.0 * float(shortfall.values[0] <= 0.0)
        return Verdict(self.yield_at(design, nothing, nothing, False), assurance, 0.0, shortfall.values)


def _position_of_value(along: Callable[[float], float], wanted: float) -> float:
    """Where along the worst direction a value is reached, or the nearest end."""
    ends = [along(end) for end in (SOFTEST, HARDEST)]
    if not ends[0] < wanted < ends[1]:
        return SOFTEST if wanted <= ends[0] else HARDEST
    return float(scipy.optimize.brentq(lambda b: along(b) - wanted, SOFTEST, HARDEST, xtol=1e-4))
