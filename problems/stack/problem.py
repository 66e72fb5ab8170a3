"""Any mechanism that is written in its configuration: tolerance cost against its variation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...counts import Need, too_many
from ...declarations import Assumption, Output, Parameter, Variable
from ...errors import Fault, ModelError
from ...models.costs import CostCurve
from ...models.stack import (
    Law,
    Linear,
    Sample,
    half_width,
    law_of,
    linearised,
    yield_percent,
)
from ...section import Section
from ..forms import Form
from ..settings import Bound, Settings, VariableSetting
from ..tolerance_problem import Interval, ToleranceProblem
from .assumptions import assumptions_of
from .convex import form_of, shortfall
from .costs import PartCosts
from .definition import Definition, Part
from .linearity import linearity_warnings
from .outputs import OBJECTIVES, outputs_of, variables_of
from .reading import read_definition
from .stand_in import stand_in
from .writing import tables_of

Array = NDArray[np.float64]
DEVIATIONS = Need("deviation", bytes=16.0)
"""Of every piece of every unit of the sample: a point, and the deviation."""
WARNING_SAMPLES = 131_072
"""Units at most by which warnings are judged before a run."""
SEARCH_SAMPLES = 8192
"""Units of the search's own yields and half-widths; reported ones take `[propagation] samples`."""

UNDECIDED = 6.0
"""Standard errors about a limit within which a search takes the whole sample."""


@dataclass(frozen=True)
class StackKind:
    """What a configuration declares a stack to be; called with settings, it makes the problem."""

    definition: Definition | None
    variables: tuple[Variable, ...]
    outputs: tuple[Output, ...]
    parameters: tuple[Parameter, ...] = ()
    default_costs: Mapping[str, CostCurve] = field(default_factory=dict)
    default_limits: Mapping[str, Bound] = field(default_factory=dict)
    default_objectives: tuple[str, ...] = OBJECTIVES
    default_model: str = ""

    def __call__(self, settings: Settings) -> Stack:
        return Stack(replace(settings, definition=self.definition))


class Stack(ToleranceProblem):
    """Any mechanism written in its configuration: cost of its tolerances against its variation.

    Keys, definitions and formulas: docs/stack.md. It is made from `Settings.definition`, which
    `configured` reads.
    """

    parameters = ()
    default_costs: Mapping[str, CostCurve] = MappingProxyType({})
    default_limits: ClassVar[Mapping[str, Bound]] = {}
    default_objectives = OBJECTIVES

    def __init__(self, settings: Settings | None = None) -> None:
        definition = None if settings is None else settings.definition
        if not isinstance(definition, Definition):
            raise ModelError("a stack is made from its definition: read it from a configuration")
        self.definition = definition
        self.variables = variables_of(definition.parts)
        self.outputs = outputs_of(definition.requirement, definition.parts)
        self.linear: Linear = linearised(definition.mechanism)
        self.law = law_of(definition.mechanism, self.linear.covariance)
        super().__init__(settings)

    @classmethod
    def configured(cls, top: Section) -> Any:
        """The stack of `[requirement]`, `[[part]]` and `[[correlation]]`, faulty or not."""
        faults: list[Fault] = []
        parts, requirement, definition = read_definition(top, faults)
        for fault in faults:
            top.fault(fault.place, fault.message)
        known = [
            part or stand_in(table, at)
            for at, (part, table) in enumerate(zip(parts, top.tables("part"), strict=True))
        ]
        return StackKind(definition, variables_of(known), outputs_of(requirement, known))

    def tables(self) -> dict[str, Any]:
        given = self.settings.propagation
        propagation = {"coverage": given.coverage, "samples": given.samples}
        return {"propagation": propagation} | tables_of(self.definition)

    def _completed(self, given: Settings) -> Settings:
        """Fixed tolerances, and processes without an alternative, are fixed variables."""
        fixed = {f"{p.name}_t": p.low for p in self.definition.parts if p.fixed}
        fixed |= {f"{p.name}_process": 0.0 for p in self.definition.parts
                  if p.alternatives and len(p.processes) == 1}  # fmt: skip
        settings = {name: VariableSetting(value=value) for name, value in fixed.items()}
        return super()._completed(replace(given, variables=settings | dict(given.variables)))

    # ---------------------------------------------------------------- designs

    @property
    def _parts(self) -> tuple[Part, ...]:
        return self.definition.parts

    def tolerances(self, designs: Array) -> Array:
        """Half-widths (n, parts) of full designs, each in the unit of its part."""
        return designs[:, [self.names.index(f"{part.name}_t") for part in self._parts]]

    def _chosen(self, designs: Array, part: Part) -> NDArray[np.int64]:
        """Number of the process (n,) that a part is made by."""
        if not part.alternatives:
            return np.zeros(len(designs), dtype=np.int64)
        return np.rint(self.column(designs, f"{part.name}_process")).astype(np.int64)

    def complete(self, x: Array) -> Array:
        """Full designs; a tolerance that its process cannot hold is moved to the nearest it can."""
        designs = super().complete(x)
        for part in self._parts:
            if part.alternatives:
                at, chosen = self.names.index(f"{part.name}_t"), self._chosen(designs, part)
                low, high = part.ends
                designs[:, at] = np.clip(designs[:, at], low[chosen], high[chosen])
        return designs

    def misplaced(self, designs: Array) -> dict[str, dict[int, str]]:
        found: dict[str, dict[int, str]] = {}
        for part in self._parts:
            name = f"{part.name}_t"
            if not part.alternatives:
                continue
            for row, (t, at) in enumerate(
                zip(self.column(designs, name), self._chosen(designs, part), strict=True)
            ):
                process = part.processes[at]
                if not process.low <= t <= process.high:
                    found.setdefault(name, {})[row] = (
                        f"process {process.name} holds {process.low:g} to {process.high:g} "
                        f"{part.unit}, got {t:g}"
                    )
        return found

    # ---------------------------------------------------------------- outputs

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        t, method = self.tolerances(designs), self.definition.requirement.method
        worst, rss = self.linear.worst_case(t), self.linear.rss(t)
        found = {"cost": self.cost_of(designs), "worst_case": worst, "rss": rss}
        sample = self._searching if searching else self._sample
        match method:
            case "worst_case":
                found["variation"] = worst
            case "rss":
                found["variation"] = rss
            case "shifted_rss":
                found["variation"] = self.linear.shifted_rss(t)
            case "monte_carlo" if searching and not self._wanted("variation"):
                found["variation"] = np.full(len(t), np.nan)
            case "monte_carlo" if isinstance(self.law, Law):
                found["variation"] = self.law.half_width(t, self.settings.propagation.coverage)
            case "monte_carlo":
                coverage = self.settings.propagation.coverage
                found["variation"] = half_width(self.definition.mechanism, t, sample, coverage)
        found |= self._yield(t, sample, searching)
        return found | self._shares(t, searching)

    def _shares(self, t: Array, searching: bool) -> dict[str, Array]:
        """Contributions of the parts; NaN where a search does not need them."""
        names = [f"contribution_{part.name}_percent" for part in self._parts]
        if searching and not any(self._wanted(name) for name in names):
            return dict.fromkeys(names, np.full(len(t), np.nan))
        worst = self.definition.requirement.method == "worst_case"
        shares = self.linear.worst_shares(t) if worst else self.linear.variance_shares(t)
        return dict(zip(names, 100.0 * shares.T, strict=True))

    def _wanted(self, output: str) -> bool:
        return output in (*self.objectives, *(limit.name for limit in self.limits))

    def _yield(self, t: Array, sample: Sample, searching: bool) -> dict[str, Array]:
        """The yield and its error; NaN without limits, or where a search does not need it."""
        names = ("yield_percent", "yield_percent_error")
        bounded = self.definition.mechanism.bounded
        if not bounded or (searching and not self._wanted("yield_percent")):
            return {name: np.full(len(t), np.nan) for name in names}
        if isinstance(self.law, Law):
            return dict(zip(names, self.law.yield_percent(t), strict=True))
        found = yield_percent(self.definition.mechanism, t, sample)
        if searching and len(close := self._undecided(*found)):
            exact = yield_percent(self.definition.mechanism, t[close], self._sample)
            for values, better in zip(found, exact, strict=True):
                values[close] = better
        return dict(zip(names, found, strict=True))

    def _undecided(self, found: Array, error: Array) -> NDArray[np.int64]:
        """Rows whose yield is so close to its limit that only the whole sample can judge it.

        A search converges to its limits: what is judged otherwise in the end would all be lost.
        """
        near = np.zeros(len(found), dtype=bool)
        for limit in self.limits:
            if limit.name == "yield_percent":
                for end in (limit.low, limit.high):
                    near |= np.abs(found - end) <= UNDECIDED * error
        return np.flatnonzero(near)

    @cached_property
    def _sample(self) -> Sample:
        return self._drawn(self.settings.propagation.samples)

    @cached_property
    def _searching(self) -> Sample:
        return self._drawn(SEARCH_SAMPLES)

    def _drawn(self, most: int) -> Sample:
        """At most so many units; fewer are the first ones of more."""
        rng = np.random.default_rng(self.settings.seed)
        samples = min(most, self.settings.propagation.samples)
        return Sample.draw(self.definition.mechanism, samples, rng)

    def cost_of(self, designs: Array) -> Array:
        """Sum over parts of count times the cost of the chosen process (n,)."""
        return np.asarray(self._by_part(designs).sum(axis=1))

    def costs_of(self, designs: Array) -> dict[str, Array]:
        each = zip(self._parts, self._by_part(designs).T, strict=True)
        return {f"{part.name}_t": cost for part, cost in each if not part.free_of_charge}

    def room(self, name: str, design: Array) -> Interval:
        low, high = super().room(name, design)
        for part in self._parts:
            if name == f"{part.name}_t":
                process = part.processes[self._chosen(design[None], part)[0]]
                low, high = max(low, process.low), min(high, process.high)
        return low, high

    def zone(self, name: str) -> tuple[float | None, float]:
        return {f"{p.name}_t": (p.nominal, p.mid) for p in self._parts}.get(name, (None, 0.0))

    @cached_property
    def _costs(self) -> PartCosts:
        return PartCosts(self._parts)

    def _by_part(self, designs: Array, slope: bool = False) -> Array:
        """Cost, or its slope, of each part (n, parts)."""
        chosen = np.stack([self._chosen(designs, part) for part in self._parts], axis=1)
        return self._costs.each(self.tolerances(designs), chosen, slope)

    def gradient(self, designs: Array) -> dict[str, Array]:
        """Derivatives of cost and of the linear variations; 0 for a process.

        That of a sampled yield, a step function, is the normal linear model's.
        """
        t, method = self.tolerances(designs), self.definition.requirement.method
        worst = np.broadcast_to(self.linear.worst, t.shape)
        rss = self.linear.rss_slopes(t)
        found = {"cost": self._by_part(designs, slope=True), "worst_case": worst, "rss": rss}
        if method == "monte_carlo" and isinstance(self.law, Law):
            coverage = self.settings.propagation.coverage
            found["variation"] = self.law.half_width_slopes(t, coverage)
        if method != "monte_carlo":
            found["variation"] = {
                "worst_case": worst,
                "rss": rss,
                "shifted_rss": rss + self.linear.shift,
            }[method]
        mechanism = self.definition.mechanism
        if mechanism.bounded and self._wanted("yield_percent") and isinstance(self.law, Law):
            found["yield_percent"] = self.law.yield_slopes(t)
        elif mechanism.bounded and self._wanted("yield_percent"):
            ends = (np.full(len(t), end - mechanism.centre)
                    for end in (mechanism.lower, mechanism.upper))  # fmt: skip
            found["yield_percent"] = 100.0 * self.linear.yield_slopes(t, *ends)
        at = [self.names.index(f"{part.name}_t") for part in self._parts]
        wide = {name: np.zeros_like(designs) for name in found}
        for name, slopes in found.items():
            wide[name][:, at] = slopes
        return wide

    # ---------------------------------------------------------------- what is known

    def form(self) -> Form | None:
        method = self.definition.requirement.method
        return form_of(self, method)

    def form_values(self, form: Form, designs: Array, found: Mapping[str, Array]) -> Array:
        values = super().form_values(form, designs, found)
        own = np.isfinite(form.own_limits)
        values[:, own] = form.own_limits[own] + shortfall(self, designs, found)[:, None]
        return values

    def guide(self) -> Form | None:
        """The form; of a half-width by Monte Carlo that of the root sum square."""
        method = self.definition.requirement.method
        known = method != "monte_carlo" or isinstance(self.law, Law)
        return form_of(self, method if known else "rss")

    def interval(self, output: str) -> Interval:
        """Proven bounds: cost and linear variations are monotone in every tolerance."""
        low, high = self._ends_of_t
        method = self.definition.requirement.method
        kind = method if output == "variation" else output
        if kind == "cost":
            return self.cost_interval
        if kind == "worst_case":
            return float(low @ self.linear.worst), float(high @ self.linear.worst)
        if kind in ("rss", "shifted_rss"):
            least, most = self._rss_interval
            shift = self.linear.shift if kind == "shifted_rss" else np.zeros_like(low)
            return least + float(low @ shift), most + float(high @ shift)
        if kind == "yield_percent":
            return 0.0, 100.0
        if output in self.names and output.endswith("_t"):
            at = [f"{part.name}_t" for part in self._parts].index(output)
            return float(low[at]), float(high[at])
        return super().interval(output)

    @cached_property
    def _ends_of_t(self) -> tuple[Array, Array]:
        """Tightest and loosest half-width (parts,)."""
        return (np.array([part.low for part in self._parts]),
                np.array([part.high for part in self._parts]))  # fmt: skip

    @cached_property
    def _rss_interval(self) -> Interval:
        """Bounds of the root sum square; exact unless contributions compensate each other."""
        low, high = self._ends_of_t
        adding = np.maximum(self.linear.covariance, 0.0)
        taking = np.minimum(self.linear.covariance, 0.0)
        ends = (
            low @ adding @ low + high @ taking @ high,
            high @ adding @ high + low @ taking @ low,
        )
        least, most = 3.0 * np.sqrt(np.maximum(ends, 0.0))
        return float(least), float(most)

    @cached_property
    def cost_interval(self) -> Interval:
        """Least and largest cost: every part in its cheapest and its dearest process."""
        return self._costs.interval

    def _corner(self, tight: bool) -> Array:
        """The design with every tolerance at its tightest or loosest, and a process for it."""
        found = np.zeros(len(self.variables))
        for part in self._parts:
            ends = [p.low if tight else -p.high for p in part.processes]
            at = int(np.argmin(ends))
            found[self.names.index(f"{part.name}_t")] = abs(ends[at])
            if part.alternatives:
                found[self.names.index(f"{part.name}_process")] = at
        return found

    def least_cost(self) -> tuple[str, Stack] | None:
        """The cheapest design within the limits, where a run has other objectives beside."""
        kept = [limit.name for limit in self.limits if limit.name != "cost"]
        if self.objectives == ("cost",) or "cost" not in self.objectives or not kept:
            return None
        return "GA, least cost within the limits", Stack(replace(self.given, objectives=("cost",)))

    # ---------------------------------------------------------------- faults and warnings

    def faults(self) -> list[Fault]:
        found = self._size_faults() or super().faults()
        if self._wanted("yield_percent") and not self.definition.mechanism.bounded:
            text = "needs requirement.lower, requirement.upper or both: without them there is none"
            found.append(Fault("limits.yield_percent", text))
        if self.definition.requirement.method == "monte_carlo" and not found:
            loose = self.tolerances(self._corner(tight=False)[None, :])
            coverage = self.settings.propagation.coverage
            width = half_width(self.definition.mechanism, loose, self._searching, coverage)
            if not np.isfinite(width[0]):
                text = ("the formula has no value for some units of the sample at the loosest "
                        "tolerances; tighten the ranges")  # fmt: skip
                found.append(Fault("requirement.formula", text))
        return found

    def _size_faults(self) -> list[Fault]:
        """A sample of too many pieces."""
        pieces, samples = len(self.definition.mechanism.owner), self.settings.propagation.samples
        complaint = too_many(samples, DEVIATIONS, pieces, "samples x pieces")
        return [Fault("propagation.samples", complaint)] if complaint else []

    def assumptions(self) -> tuple[Assumption, ...]:
        return assumptions_of(self.definition)

    def warnings(self) -> tuple[str, ...]:
        return self._warnings

    @cached_property
    def _warnings(self) -> tuple[str, ...]:
        found = [f"part {part.name}: {why}" for part in self._parts
                 for key, why in part.assumed.items() if key in ("grade", "fit")]  # fmt: skip
        if self.definition.mechanism.formula is None:
            return tuple(found)
        unit = f" {self.definition.requirement.unit}".rstrip()
        found += linearity_warnings(self.definition.mechanism, self.linear, *self._tried, unit,
                                    self._drawn(WARNING_SAMPLES))  # fmt: skip
        return tuple(found)

    @cached_property
    def _tried(self) -> tuple[Array, str]:
        """The loosest design that keeps the limits on the linear variations, and its name."""
        low, high = self._ends_of_t
        share = np.linspace(0.0, 1.0, 257)[:, None]
        line = low + share * (high - low)
        values = {
            "worst_case": self.linear.worst_case(line),
            "rss": self.linear.rss(line),
            "shifted_rss": self.linear.shifted_rss(line),
        }
        kept = np.ones(len(line), dtype=bool)
        for limit in self.limits:
            method = self.definition.requirement.method
            name = method if limit.name == "variation" else limit.name
            if name in values:
                kept &= values[name] <= limit.high
        if np.all(kept) or not np.any(kept):
            return high, "at the loosest tolerances"
        rows = np.flatnonzero(kept)
        return line[rows[-1]], f"at a variation of {values['rss'][rows[-1]]:.4g} (rss)"
