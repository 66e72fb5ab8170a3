"""Problems whose tolerances may be made by machines with a scatter of their own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..declarations import Assumption, Kind, Value, Variable
from ..models.capability import PartSample
from ..models.costs import CostCurve
from ..models.inputs import Normal
from ..models.inputs.reading import read_distribution
from ..models.machines import GoodPartsBySpread
from ..models.machines.offers import PLUG_IN, Offer, Way, departures, samples_of
from ..models.machines.reading import Owner, read_offers
from ..section import Section
from ..units import split_unit
from .drawing import Interval
from .settings import Settings, VariableSetting
from .tolerance_problem import ToleranceProblem

Array = NDArray[np.float64]
SCALE = 3.0
"""Half-widths of a normal input with Cp = 1 per standard deviation."""


@dataclass(frozen=True, eq=False)
class Made:
    """A tolerance that is made by machines: the ways to use them, and the variable that chooses."""

    name: str
    offers: tuple[Offer, ...]

    @property
    def choice(self) -> str:
        """Name of the variable that chooses a way."""
        return f"{self.name.removesuffix('_um').removesuffix('_mrad')}_process"

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

    def clipped(self, t: Array, chosen: NDArray[np.int64]) -> Array:
        """Limits (n,) moved to the nearest that the chosen way holds."""
        low, high = (np.array([getattr(way, end) for way in self.ways]) for end in ("low", "high"))
        return np.clip(t, low[chosen], high[chosen])

    def spread_and_mean(self, t: Array, chosen: NDArray[np.int64]) -> tuple[Array, Array]:
        """Half-width of a normal input with the scatter of good parts, and their mean (n,)."""
        return self.each(
            t,
            chosen,
            lambda way, t: (SCALE * way.machine.good_parts(t).std, way.machine.good_parts(t).mean),
        )

    def slopes(self, t: Array, chosen: NDArray[np.int64]) -> tuple[Array, Array]:
        """Derivatives of the two by the limit (n,)."""
        return self.each(
            t,
            chosen,
            lambda way, t: (
                SCALE * way.machine.good_parts(t).std_slope,
                way.machine.good_parts(t).mean_slope,
            ),
        )

    def cost(self, t: Array, chosen: NDArray[np.int64]) -> tuple[Array, Array]:
        """Cost of a good part, and its derivative by the limit (n,)."""
        return self.each(t, chosen, lambda way, t: (way.curve.cost(t), way.curve.slope(t)))

    def each(self, t: Array, chosen: NDArray[np.int64], values: Any) -> tuple[Array, Array]:
        """Two values (n,) of each design by its way."""
        first, second = np.zeros_like(t), np.zeros_like(t)
        for number, way in enumerate(self.ways):
            rows = chosen == number
            if np.any(rows):
                first[rows], second[rows] = values(way, t[rows])
        return first, second

    def limits(self, spread: Array, chosen: NDArray[np.int64]) -> Array:
        """Limits (n,) at spreads (n,) of good parts."""
        t = np.zeros_like(spread)
        for number, way in enumerate(self.ways):
            rows = chosen == number
            if np.any(rows):
                fixed = way.low == way.high
                t[rows] = way.low if fixed else self.by_spread(way).limit(spread[rows])
        return t


@dataclass(frozen=True)
class MachinedKind:
    """A problem with machines as its configuration has them; with settings it makes the problem."""

    base: type[ToleranceProblem]
    machines: Mapping[str, tuple[Offer, ...]]
    machined: tuple[str, ...]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.base, name)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Those of the problem, and the choices of machines."""
        return with_choices(self.base.variables, self.machines)

    def unpriced(self, parameters: Mapping[str, Value]) -> frozenset[str]:
        """Variables without a cost curve: their machines have prices."""
        return self.base.unpriced(parameters) | set(self.machined)

    def __call__(self, settings: Settings) -> ToleranceProblem:
        return self.base(replace(settings, machines=self.machines))


def with_choices(
    variables: tuple[Variable, ...], machines: Mapping[str, tuple[Offer, ...]]
) -> tuple[Variable, ...]:
    """The variables, and at the end a choice of machine for each that is made by some."""
    more = []
    for name, offers in machines.items():
        one = Made(name, offers)
        labels = tuple(way.label for way in one.ways)
        last = float(len(labels) - 1)
        more.append(
            Variable(
                one.choice,
                "",
                Kind.CHOICE,
                0.0,
                last,
                f"machine for {name}",
                document=0.0,
                integer=True,
                valid_low=0.0,
                valid_high=last,
                labels=labels,
            )
        )
    return (*variables, *more)


class Machined(ToleranceProblem):
    """A problem with tolerances that machines may make: `[[variables.NAME.machine]]`.

    Good parts count as normal with their own mean and standard deviation. `machinable` names the
    variables that may have machines.
    """

    machinable: frozenset[str] = frozenset()

    def __init__(self, settings: Settings | None = None) -> None:
        given = settings or Settings()
        self.made = {name: Made(name, offers) for name, offers in given.machines.items()}
        if self.made:
            self.variables = with_choices(type(self).variables, given.machines)
        super().__init__(settings)

    @classmethod
    def configured(cls, top: Section) -> Any:
        section = top.section("variables")
        stated = [
            name
            for name in (v.name for v in cls.variables)
            if name in section and "machine" in section.section(name)
        ]
        declared = {v.name: v for v in cls.variables}
        machines = {}
        for name in stated:
            own = section.section(name)
            if name not in cls.machinable:
                own.fault(
                    "machine",
                    f"{name} has no machines here; these may have some: "
                    f"{', '.join(sorted(cls.machinable))}",
                )
                continue
            offers = read_offers(own, _owner(own, declared[name], top.section("parameters")))
            cls._check(own)
            if name in top.section("costs"):
                top.section("costs").fault(
                    name, "is stated beside machines, which have prices: leave it out"
                )
            if offers is not None:
                machines[name] = offers
        return MachinedKind(cls, machines, tuple(stated)) if stated else cls

    @classmethod
    def _check(cls, own: Section) -> None:
        """Faults of what stands beside the machines of a variable."""
        if "value" in own:
            own.fault("value", "is fixed beside machines: limits of inspection are low and high")
        if own.take("measured") is not None:
            own.fault("measured", "is stated beside machines: state it in each [[...machine]]")
        given = read_distribution(own) if "distribution" in own else Normal()
        if given != Normal():
            own.fault(
                "distribution",
                "must be left out beside machines, whose good parts count as "
                "normal with a mean and scatter of their own",
            )

    def _completed(self, given: Settings) -> Settings:
        variables = dict(given.variables)
        for one in self.made.values():
            own = given.variables.get(one.name, VariableSetting())
            fixed = one.low == one.high
            variables[one.name] = VariableSetting(
                value=one.low if fixed else None,
                low=None if fixed else one.low,
                high=None if fixed else one.high,
                distribution=Normal(),
                mid=own.mid,
            )
            if len(one.ways) == 1:
                variables[one.choice] = VariableSetting(value=0.0)
        found = super()._completed(replace(given, variables=variables))
        if not self.made:
            return found
        costs = {name: curve for name, curve in found.costs.items() if name not in self.made}
        return replace(found, costs=costs)

    def assumptions(self) -> tuple[Assumption, ...]:
        return (
            *super().assumptions(),
            *(assumed for one in self.made.values() for assumed in _assumptions(one)),
        )

    def cautions(self) -> tuple[str, ...]:
        told = (departures(one.offers, name) for name, one in self.made.items())
        return (*super().cautions(), *(text for each in told for text in each))

    def samples(self) -> tuple[tuple[str, str, PartSample], ...]:
        return (
            *super().samples(),
            *(
                (f"{one.name}, machine {machine}", split_unit(one.name)[1], sample)
                for one in self.made.values()
                for machine, sample in samples_of(one.offers)
            ),
        )

    # ---------------------------------------------------------------- designs

    def chosen(self, designs: Array, one: Made) -> NDArray[np.int64]:
        """Number of the way (n,) that a tolerance is made in."""
        return np.rint(self.column(designs, one.choice)).astype(np.int64)

    def complete(self, x: Array) -> Array:
        designs = super().complete(x)
        for one in self.made.values():
            at = self.names.index(one.name)
            designs[:, at] = one.clipped(designs[:, at], self.chosen(designs, one))
        return designs

    def misplaced(self, designs: Array) -> dict[str, dict[int, str]]:
        found: dict[str, dict[int, str]] = {}
        for one in self.made.values():
            t, chosen = self.column(designs, one.name), self.chosen(designs, one)
            for row in np.flatnonzero(np.abs(one.clipped(t, chosen) - t) > 1e-9 * t).tolist():
                way = one.ways[chosen[row]]
                found.setdefault(one.name, {})[row] = (
                    f"{way.label} holds {way.low:g} to {way.high:g}, got {t[row]:g}"
                )
        return found

    def effective(self, designs: Array) -> Array:
        """Full designs with the spread of good parts in the place of limits."""
        if not self.made:
            return designs
        found = np.array(designs, dtype=float)
        for name, (spread, _) in self.as_made(designs).items():
            found[:, self.names.index(name)] = spread
        return found

    def as_made(self, designs: Array) -> dict[str, tuple[Array, Array]]:
        """Spread and mean (n,) of good parts of each tolerance that machines make."""
        return {
            one.name: one.spread_and_mean(self.column(designs, one.name), self.chosen(designs, one))
            for one in self.made.values()
        }

    def interval(self, output: str) -> Interval:
        for one in self.made.values():
            if output == one.choice:
                return 0.0, float(len(one.ways) - 1)
        return super().interval(output)

    def by_limits(
        self, designs: Array, slopes: dict[str, Array], by_mean: dict[str, dict[str, Array]]
    ) -> dict[str, Array]:
        """Derivatives (n, all variables) by limits from those by the spreads of good parts.

        `by_mean` are those by the means (n,), by output and tolerance.
        """
        for one in self.made.values():
            at = self.names.index(one.name)
            rise, moved = one.slopes(self.column(designs, one.name), self.chosen(designs, one))
            for name, slope in slopes.items():
                slope[:, at] = rise * slope[:, at] + moved * by_mean[name].get(one.name, 0.0)
        return slopes

    def room(self, name: str, design: Array) -> Interval:
        low, high = super().room(name, design)
        if name in self.made:
            way = self.made[name].ways[int(self.chosen(design[None], self.made[name])[0])]
            low, high = max(low, way.low), min(high, way.high)
        return low, high

    def _corner(self, tight: bool) -> Array:
        found = super()._corner(tight)
        for one in self.made.values():
            ends = [way.low if tight else -way.high for way in one.ways]
            found[self.names.index(one.name)] = abs(min(ends))
            found[self.names.index(one.choice)] = float(np.argmin(ends))
        return found

    # ---------------------------------------------------------------- costs

    def costs_of(self, designs: Array) -> dict[str, Array]:
        found = super().costs_of(designs)
        return found | {
            one.name: one.cost(self.column(designs, one.name), self.chosen(designs, one))[0]
            for one in self.made.values()
        }

    def curves_of(self, name: str) -> tuple[tuple[CostCurve, float], ...]:
        return () if name in {one.name for one in self.made.values()} else super().curves_of(name)

    def cost_slopes(self, designs: Array) -> Array:
        found = super().cost_slopes(designs)
        for one in self.made.values():
            t, chosen = self.column(designs, one.name), self.chosen(designs, one)
            found[:, self.names.index(one.name)] = one.cost(t, chosen)[1]
        return found

    @cached_property
    def cost_interval(self) -> Interval:
        """Least and largest cost: of machines those of any way at either end."""
        ends = np.stack([super()._corner(tight=False), super()._corner(tight=True)])
        plain = ToleranceProblem.costs_of(self, ends)
        low, high = (float(sum(cost[at] for cost in plain.values())) for at in (0, 1))
        for one in self.made.values():
            each = [way.curve.cost(np.linspace(way.low, way.high, 257)) for way in one.ways]
            low += min(float(cost.min()) for cost in each)
            high += max(float(cost.max()) for cost in each)
        return low, high


def curve_of(one: Made, way: Way, low: float, high: float) -> CostCurve:
    """Cost of a way against the spread of its good parts."""
    return way.curve if low == high else one.by_spread(way)


def _owner(own: Section, variable: Variable, parameters: Section) -> Owner:
    """What machines of a variable make: limits of inspection, and the mid-limit."""
    ends = [own.number(key, variable.unit) for key in ("low", "high")]
    mid = own.number("mid", variable.unit)
    if mid is None:
        stem, unit = split_unit(variable.name)
        mid = parameters.quantity(f"{stem}_mid_{unit}", unit)
    return Owner(variable.unit, (ends[0], ends[1]), mid=variable.mid or 0.0 if mid is None else mid)


def _assumptions(one: Made) -> list[Assumption]:
    """What is taken for granted of the machines of a tolerance."""
    place = f"variables.{one.name}.machine"
    unit = split_unit(one.name)[1]
    found = [
        Assumption(f"{place}.{name}.measured", sample.statement(unit), "", PLUG_IN)
        for name, sample in samples_of(one.offers)
    ]
    open_ = "; ".join(offer.assumed for offer in one.offers if offer.assumed)
    return found + ([Assumption(place, "", "", open_)] if open_ else [])
