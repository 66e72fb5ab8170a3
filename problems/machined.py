"""Problems whose tolerances may be made by machines with a known scatter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..arrays import Array, Integers
from ..declarations import Assumption, Kind, Variable
from ..models.capability import PartSample
from ..models.costs import CostCurve
from ..models.inputs import Normal
from ..models.inputs.reading import read_distribution
from ..models.machines.offers import PLUG_IN, Offer, departures, samples_of
from ..models.machines.reading import Owner, read_offers
from ..section import Section
from ..units import split_unit
from .declaration import ConfiguredProblem, Declaration, Interval
from .interfaces import Checks, Differentiable, Drawing
from .machined_tolerance import MachinedTolerance
from .settings import Settings, VariableSetting
from .tolerance_problem import ToleranceProblem


def with_choices(variables: tuple[Variable, ...], machines: Mapping[str, tuple[Offer, ...]]) -> tuple[Variable, ...]:
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


def _machined(
    declaration: Declaration, machines: Mapping[str, tuple[Offer, ...]], stated: Sequence[str]
) -> Declaration:
    """With the choices of machines; variables that are made by machines have no cost curve."""
    by_problem = declaration.unpriced
    return replace(
        declaration,
        variables=with_choices(declaration.variables, machines),
        unpriced=lambda parameters: by_problem(parameters) | set(stated),
        machined=tuple(stated),
    )


class Machined(ToleranceProblem, Checks, Drawing, Differentiable):
    """A problem with tolerances that machines may make: `[[variables.NAME.machine]]`.

    Good parts count as normal with the mean and standard deviation of their machine. `machinable`
    names the variables that may have machines.
    """

    machinable: frozenset[str] = frozenset()

    def __init__(self, settings: Settings | None = None) -> None:
        given = settings or Settings()
        self.machined_tolerances = {name: MachinedTolerance(name, offers) for name, offers in given.machines.items()}
        if self.machined_tolerances:
            variables = with_choices(type(self).declaration.variables, given.machines)
            self.declaration = replace(self.declaration, variables=variables)
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
            declaration=_machined(configured.declaration, machines, stated),
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
        return (*super().cautions(), *(text for name, made in tolerances for text in departures(made.offers, name)))

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

    def room(self, name: str, design: Array) -> Interval:
        low, high = super().room(name, design)
        if tolerance := self.machined_tolerances.get(name):
            way = tolerance.ways[int(self.chosen(design[None], tolerance)[0])]
            low, high = max(low, way.low), min(high, way.high)
        return low, high

    def _corner(self, tight: bool) -> Array:
        corner = super()._corner(tight)
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
        ends = np.stack([super()._corner(tight=False), super()._corner(tight=True)])
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
