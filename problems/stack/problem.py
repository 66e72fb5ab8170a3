"""Any mechanism that is written in its configuration: tolerance cost against its variation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import product
from math import floor, log10
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtr

from ...errors import Fault, ModelError
from ...models.capability import PartSample
from ...models.costs import CostCurve
from ...models.machine_offers import departures_from_normality
from ...models.stack.mechanism import (
    SIGMAS,
    Linear,
    Mechanism,
    Sample,
    Tolerances,
    interpolate_designs,
    limit_of,
    mean_of,
    percent_of,
    spread_of,
    yield_percent,
)
from ...section import Array, Assumption, Integers, Output, Section
from ...units import family, unit_hint
from ..declaration import ConfiguredProblem, Declaration, Interval
from ..forms import Form
from ..limits import keeps
from ..settings import YIELD, Promise, Settings, read_promise, rising_price_note
from ..tolerance_problem import ToleranceProblem
from .convex import corner_of, form_of, limits_by_spread, out_of_process, samples_of
from .definition import Definition, Part, parts_by_process, ranges_by_process
from .faults import faults_of, nominal_limit_faults, read_output_names, unit_faults
from .formulas import sensitivity_note
from .matched import LEFT_OVER, PER_GOOD_UNIT, factors_of_cost, left_over, read_sortings
from .outputs import (
    OBJECTIVES,
    PartCosts,
    Yields,
    complete_definition,
    intervals_of,
    joint_slopes,
    joint_variations,
    outputs_of,
    slopes_by_count,
    slopes_by_limit,
    variables_of,
)
from .parts import drawn, labels_of, placeholder_part, price_remark
from .promises import WINDOW, Measured, Promises, measured
from .reading import assumptions_of, read_definition, tables_of
from .rows import shortfall

if TYPE_CHECKING:
    import pandas as pd

# Linear against nonlinear spread: whether the root sum square is exceeded as rarely as stated.


VARIED = ("variation", "rss", "std")
"""Outputs of a requirement that leave out means, but for `variation` by `shifted_rss`."""
STEP_OF_T = 1e-4
"""Relative step of a tolerance for the slopes of what is left over, which is smooth in it."""
MIN_YIELD_DIFFERENCE = 0.01
"""Percentage points below which a difference does not matter."""
RELATIVE = 0.2
"""Fraction of the promise below which a difference does not matter."""
ERRORS = 3.0
"""Standard errors of the sample below which a difference is not detected."""
ROUNDING = 1e-9
"""Fraction of a tolerance up to which a mean is off its mid-limit by rounding alone."""
DIGITS = 4
"""Significant digits of a root sum square in a warning; its mean has as many decimals."""


def linearity_warnings(
    mechanism: Mechanism, linear: Linear, design: Tolerances, where: str, unit: str, sample: Sample
) -> tuple[str, ...]:
    """The errors of the linear model, in a sentence, at one design (1, p).

    The limits are those of the requirement, where there are some, and the linear mean +- the root
    sum square, beyond which 0.27 % are promised. What the same units differ by with the slopes in the place
    of the formula is the linear model's error, and the rest that of the normal distribution: the larger is named.
    """
    mean = mechanism.centre + float(linear.mean_shift(design)[0])
    rss = float(linear.rss(design)[0])
    if rss == 0.0:
        return ()
    places = max(DIGITS - 1 - floor(log10(rss)), 0)
    limits = {f"{mean:.{places}f} +- {rss:.{places}f}{unit} (root sum square)": (mean - rss, mean + rss)}
    if mechanism.bounded:
        limits["the limits of the requirement"] = (mechanism.lower, mechanism.upper)
    sentences: dict[str, list[str]] = {}
    ((_, y),) = sample.blocks(mechanism, design)
    ((_, straight),) = sample.blocks(replace(mechanism, formula=None), design)
    for name, (lower, upper) in limits.items():
        low, high = ((bound - mean) / (rss / SIGMAS) for bound in (lower, upper))
        promised = 100.0 * float(ndtr(low) + ndtr(-high))
        between = replace(mechanism, lower=lower, upper=upper)
        within, error = percent_of(between.conforms(y))
        actual, doubt = 100.0 - float(within[0]), float(error[0])
        by_slopes = 100.0 - float(percent_of(between.conforms(straight))[0][0])
        if abs(actual - promised) > max(MIN_YIELD_DIFFERENCE, ERRORS * doubt, RELATIVE * promised):
            model, truth = "normal distribution", "parts' distributions give"
            if abs(actual - by_slopes) > abs(by_slopes - promised):
                model, truth = "linear model", "formula itself gives"
            sentences.setdefault(model, []).append(
                f"outside {name} it promises {promised:.2g} %, but the {truth} {actual:.3g} % (standard error "
                f"{doubt:.1g} %)"
            )
    return tuple(f"the {model} misleads {where}: {'; '.join(texts)}" for model, texts in sentences.items())


# Warnings to the user of a stack before a run.


FINEST, COARSEST = 1e-6, 0.25
"""Half-widths between which tolerances of lengths lie, as fractions of the nominal size: from
half of IT01 at 500 mm to a quarter of the size.
"""
WARNING_SAMPLES = 131_072
"""Most units with which warnings are tested before a run."""


def warnings_of(stack: Stack) -> tuple[str, ...]:
    """Unverified grades, formulas that leave their domain, linear models that mislead."""
    sentences = [
        f"part {part.name}: {why}"
        for part in stack.definition.parts
        for key, why in part.assumed.items()
        if key in ("grade", "fit")
    ]
    sentences += [text for part in stack.definition.parts if (text := _implausible_tolerance_note(part))]
    remarks = [price_remark(part.name, part.processes, part.stated.get("price", {})) for part in stack.definition.parts]
    sentences += filter(None, remarks)
    for part in stack.definition.parts:
        for process in part.processes:
            name = f"{part.name} ({process.name})" if process.name else part.name
            sentences += [f"part {name}: {process.note}"] if process.note else []
            sentences += [note] if (note := rising_price_note(f"part {name}", process.curve)) else []
    pairs = product(stack.definition.parts, stack.definition.stated)
    sentences += filter(None, (sensitivity_note(part, requirement) for part, requirement in pairs))
    for part in stack.definition.parts:
        sentences += () if part.sample is None else part.sample.departures(f"part {part.name}")
    for part in stack.definition.parts:
        sentences += departures_from_normality(part.machines, f"part {part.name}")
    every = len(stack.definition.stated)  # a note on the first condition is one on all
    sentences += filter(None, [_ignored_means_note(stack, values) for values in stack.measured[:every]])
    together = sum(values.mechanism.bounded for values in stack.measured) > 1
    if YIELD in stack.required_outputs and together and stack.yields.joint is None:
        sentences.append(
            f"{YIELD} is the share of the units of a sample that keep all requirements together; `exact` finds the "
            "least cost by SLSQP on units of its own, and moves the limit until that sample keeps it"
        )
    if stack.declaration.objectives == stack.objectives == ("cost",) and stack.free and not stack.limits:
        sentences.append(
            "the requirements are in different units, so that the cost alone is minimised, and no output is limited: a "
            "run takes the loosest tolerances; state limits, or name a variation in objectives.minimise"
        )
    for values in stack.measured:
        if text := values.off_nominal:
            most = "fewer than half of the units conform whatever the tolerances" if values.off_limits else ""
            sentences.append(
                f"{values.requirement.place} {text}: {most or 'the tolerances are not what breaks its limits'}; move "
                "the nominal values or the limits"
            )
        sentences += [_domain(values)] if values.partial else []
        sentences += [_nonlinearity_warning(stack, values)] if values.mechanism.rough else []
        if not values.rough and not values.normal:
            unit = f" {values.requirement.unit}".rstrip()
            sample = stack.yields.drawn(WARNING_SAMPLES)
            warnings = linearity_warnings(
                values.mechanism, values.linear, *_loosest_feasible(stack, values), unit, sample
            )
            sentences += [f"{values.requirement.key}: {text}" if values.requirement.key else text for text in warnings]
    return tuple(sentences)


def _implausible_tolerance_note(part: Part) -> str:
    """A note on a tolerance that is implausible for the nominal size, with the unit it may be in."""
    size = abs(part.nominal or 0.0)
    if family(part.unit)[0] != "meter" or size == 0.0:
        return ""
    low, high = FINEST * size, COARSEST * size
    for t in (part.low, part.high):
        if 0.0 < t < low or t > high:
            hint = unit_hint(t, part.unit, low, high)
            extreme = "small" if t < low else "large"
            tolerance = f"part {part.name}: a tolerance of {t:g} {part.unit}"
            return f"{tolerance} is {extreme} for a size of {size:g} {part.unit}{hint}"
    return ""


def _ignored_means_note(stack: Stack, measured: Measured) -> str:
    """What a variation that is asked for leaves out of means that are off the middles of their zones."""
    method, linear, (_, loosest) = measured.requirement.method, measured.linear, stack.ends_as_made
    asked = {measured.name(name) for name in VARIED} | {"variation", "rss"}
    off = spread_of(loosest)[0] * linear.shift + np.abs(mean_of(loosest)[0]) * linear.worst
    off += [abs(part.mean - part.mid) for part in measured.parts] * linear.worst
    moved = [measured.parts[at].name for at in np.flatnonzero(off > ROUNDING * limit_of(loosest)[0] * linear.worst)]
    if measured.rough or method == "shifted_rss" or not moved or not asked & stack.required_outputs:
        return ""
    about = "is by the limits of the parts" if method == "worst_case" else "is a width about the mean"
    unit = f" {measured.requirement.unit}".rstrip()
    mean = float(linear.mean_shift(loosest)[0]) + measured.mechanism.centre - measured.drawn.centre
    return (
        f"{measured.requirement.place}.method: {method} {about}, and leaves out that {', '.join(moved)} "
        f"{'is' if len(moved) == 1 else 'are'} off the mid-limits on average (together {mean:+.3g}{unit} at the "
        "loosest tolerances); the yield counts it, and shifted_rss adds every shift in the worst direction"
    )


def _domain(measured: Measured) -> str:
    """Where the formula leaves its domain."""
    name = measured.name("domain_margin")
    designs = f"designs that do are infeasible ({name} below 0)"
    if not measured.bound_to_domain:
        designs = f"{name} is below 0 for designs that do, and limits.{name} = 0 refuses them"
        if not measured.assembles:
            designs += f" ({measured.requirement.method} knows the formula by its slopes alone)"
    return (
        f"{measured.requirement.place}.formula leaves its domain within the widest tolerances: "
        f"{measured.mechanism.undefined}; {designs}; units that do are non-conforming"
    )


def _nonlinearity_warning(stack: Stack, measured: Measured) -> str:
    """How the outputs of a formula that its slopes at the mid-limits do not describe are computed."""
    mechanism, unit = measured.mechanism, f" {measured.requirement.unit}".rstrip()
    _, loosest = stack.ends_as_made
    first, worst = (
        float(values[0])
        for values in (measured.linear.worst_case(loosest), measured.variations(loosest)[measured.name("worst_case")])
    )
    text = (
        f"{measured.requirement.place}.formula has no slope at the mid-limits (0, not defined, or another one on each "
        f"side) by {', '.join(mechanism.rough)}: rss and contributions are those of the formula itself, by a sample of "
        f"units; worst_case is that of the corners, {worst:.4g}{unit} at the loosest tolerances (first order: "
        f"{first:.4g}{unit})"
    )
    if mechanism.bounded:
        percent, error = yield_percent(mechanism, loosest, stack.yields.drawn(WARNING_SAMPLES))
        text += f"; {percent[0]:.3f} % of the units (standard error {error[0]:.1g} %) are then within the limits"
    return text


def domain_remarks(requirements: Sequence[Measured], front: pd.DataFrame) -> tuple[str, ...]:
    """Which reported points have a corner of their tolerances at which a formula has no value."""
    sentences = []
    for values in requirements:
        name = values.name("domain_margin")
        below = int((front[name] < 0.0).sum()) if name in front and len(front) else 0
        if below:
            sentences.append(
                f"{below} of {len(front)} points leave the domain of {values.requirement.place}.formula at a corner "
                f"of their tolerances ({name} down to {front[name].min():.3g}, 0 at the edge): units there have no "
                "value and do not conform"
            )
    return tuple(sentences)


def _loosest_feasible(stack: Stack, measured: Measured) -> tuple[Tolerances, str]:
    """The loosest design (1, p) that keeps the limits on the linear variations, and its name."""
    low, high = stack.ends_as_made
    line = interpolate_designs(low, high, np.linspace(0.0, 1.0, 257)[:, None])
    values = measured.variations(line)
    if measured.requirement.method == "monte_carlo":
        values.pop(measured.name("variation"), None)
    kept = np.ones(len(line), dtype=bool)
    for limit in stack.limits:
        if limit.name in values:
            kept &= keeps(values[limit.name], limit.high)
        elif measured.partial and limit.name == measured.name("domain_margin"):
            kept &= limit.kept(measured.margin(line)[limit.name])
    if np.all(kept) or not np.any(kept):
        return high, "at the loosest tolerances"
    last = int(np.flatnonzero(kept)[-1])
    rss = float(measured.linear.rss(line[last : last + 1])[0])
    return line[last : last + 1], f"at a variation of {rss:.4g} (rss)"


class Stack(ToleranceProblem):
    """Any mechanism written in its configuration: cost of its tolerances against its variation.

    Keys, definitions and formulas: docs/stack.md. It is made from `Settings.definition`, which
    `configured` reads.
    """

    def __init__(self, settings: Settings | None = None) -> None:
        definition = None if settings is None else settings.definition
        if not isinstance(definition, Definition):
            raise ModelError("a stack is made from its definition: read it from a configuration")
        self.definition = definition
        self.measured: tuple[Measured, ...] = measured(definition)
        self.declaration = _declare_stack(
            definition.parts,
            outputs_of(
                definition.requirements, definition.parts, self.measured, definition.promise, definition.sortings
            ),
        )
        if definition.conditions and settings is not None:
            from ..conditions import limits_in_all

            known = {o.name for o in self.declaration.outputs} | {v.name for v in self.declaration.variables}
            names = [condition.name for condition in definition.conditions]
            settings = replace(settings, limits=limits_in_all(names, settings.limits, known))
        super().__init__(settings)

    @classmethod
    def configured(cls, top: Section) -> ConfiguredProblem | None:
        """The stack of its requirements, `[[part]]` and `[[correlation]]`, faulty or not."""
        faults: list[Fault] = []
        parts, requirements, conditions, definition = read_definition(top, faults)
        faults += unit_faults(requirements, *read_output_names(top))
        for fault in faults:
            top.fault(fault.place, fault.message)
        known = [
            part or placeholder_part(table, at)
            for at, (part, table) in enumerate(zip(parts, [*top.tables("part"), *top.tables("feature")], strict=True))
        ]
        mechanisms = measured(definition) if definition is not None else ()
        promise = read_promise(top)
        sortings = read_sortings(top, None, [])
        outputs = outputs_of(requirements, known, () if conditions else mechanisms, promise, sortings)
        if conditions:
            from ..conditions import limitable
            from .conditions import requirements_at

            every = outputs_of(requirements_at(conditions, requirements), known, mechanisms, promise, sortings)
            outputs = limitable(every, outputs, [condition.name for condition in conditions], top)
        declaration = _declare_stack(known, outputs)
        declaration = replace(declaration, conditions=tuple(condition.name for condition in conditions))
        return ConfiguredProblem(declaration, cls, {"definition": definition})

    def tables(self) -> dict[str, Any]:
        given = self.settings.propagation
        propagation = {"coverage": given.coverage, "samples": given.samples}
        return {"propagation": propagation} | tables_of(self.definition)

    def _completed(self, given: Settings) -> Settings:
        return super()._completed(complete_definition(self.definition, self.measured, given))

    # ---------------------------------------------------------------- designs

    @property
    def _parts(self) -> tuple[Part, ...]:
        return self.definition.parts

    def tolerances(self, designs: Array) -> Array:
        """Half-widths (n, parts) of full designs, each in the unit of its part."""
        names = self.names
        return designs[:, [names.index(f"{part.name}_t") for part in self._parts]]

    def _chosen(self, designs: Array, part: Part) -> Integers:
        """Number of the process (n,) that a part is made by."""
        if not part.alternatives:
            return np.zeros(len(designs), dtype=np.int64)
        return np.rint(self.column(designs, f"{part.name}_process")).astype(np.int64)

    def parts_as_made(self, designs: Array) -> Tolerances:
        """Parts of full designs as they come out: with the scatter of their machines."""
        return parts_by_process(self._parts, self.tolerances(designs), self._chosen_of_all(designs))

    def _chosen_of_all(self, designs: Array) -> Integers:
        """Number of the process (n, parts) that each part is made by."""
        return np.stack([self._chosen(designs, part) for part in self._parts], axis=1)

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
        return {
            f"{part.name}_t": wrong
            for part in self._parts
            if (wrong := out_of_process(part, self.column(designs, f"{part.name}_t"), self._chosen(designs, part)))
        }

    # ---------------------------------------------------------------- outputs

    def needed(self, designs: Array) -> dict[str, Array]:
        return self._evaluated(np.asarray(designs, dtype=float), searching=False, needed=True)

    def smooth(self) -> ToleranceProblem:
        return self._smooth if self.yields.sampled else self

    @cached_property
    def _smooth(self) -> Stack:
        """The same stack with smooth yields and half-widths in a search."""
        anew = type(self)(self.given)
        anew.__dict__["yields"] = replace(self.yields, smooth=True)
        return anew

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        return self._evaluated(designs, searching, needed=searching)

    def _evaluated(self, designs: Array, searching: bool, needed: bool) -> dict[str, Array]:
        t = self.parts_as_made(designs)
        outputs = {"cost": self.cost_of(designs)} | self.yields.outputs(t, searching, needed)
        for requirement in self.measured:
            outputs |= requirement.variations(t) | requirement.margin(t)
            ends = {requirement.name(end) for end in WINDOW}
            outputs |= requirement.window(t, not needed or bool(self.required_outputs & ends))
            outputs |= self._shares(requirement, t, searching)
        if self.promises is not None:
            outputs |= self.promises.outputs(t, searching, self.required_outputs)
        if self.definition.sortings:
            outputs |= self._matching(designs, outputs)
        return outputs | joint_variations(self.measured, outputs)

    def _matching(self, designs: Array, outputs: Mapping[str, Array]) -> dict[str, Array]:
        """What is left over (n,) of matched parts, and the cost of a good unit."""
        lost = left_over(self.definition, self.tolerances(designs))
        good = 0.01 * outputs[YIELD] if YIELD in outputs else np.full(len(designs), np.nan)
        with np.errstate(divide="ignore"):
            return {LEFT_OVER: 100.0 * lost.max(axis=1), PER_GOOD_UNIT: outputs["cost"] / good}

    @property
    def promise(self) -> Promise | None:
        return self.definition.promise

    @cached_property
    def promises(self) -> Promises | None:
        """The promises of the yields, None where there are none."""
        promise = self.definition.promise
        return None if promise is None else Promises(self.measured, promise, self.settings.seed)

    def _shares(self, requirement: Measured, t: Tolerances, searching: bool) -> dict[str, Array]:
        """Contributions of the parts; NaN where a search does not need them."""
        names = [requirement.contribution(at) for at in requirement.shown]
        if searching and not self.required_outputs & set(names):
            return dict.fromkeys(names, np.full(len(t), np.nan))
        return self.yields.shares(requirement, t)

    @cached_property
    def yields(self) -> Yields:
        """Yields and half-widths by sample."""
        per_good_unit = {YIELD} if PER_GOOD_UNIT in self.required_outputs else set()
        return Yields(self.measured, self.settings, self.limits, self.required_outputs | per_good_unit)

    @property
    def linear(self) -> Linear:
        """The linear model of the first requirement."""
        return self.measured[0].linear

    def _part_of(self, name: str) -> Part | None:
        return next((part for part in self._parts if name == f"{part.name}_t"), None)

    def pieces_of(self, name: str) -> int:
        part = self._part_of(name)
        return 1 if part is None else part.count

    def ranges_of(self, name: str) -> tuple[Interval, ...]:
        part = self._part_of(name)
        return super().ranges_of(name) if part is None else tuple((p.low, p.high) for p in part.processes)

    def cost_of(self, designs: Array) -> Array:
        """Sum over parts of count times the cost of the chosen process, and the price of sorting (n,)."""
        return np.asarray(self._by_part(designs).sum(axis=1)) + self._price_of_sorting

    @property
    def _price_of_sorting(self) -> float:
        return sum(sorting.price for sorting in self.definition.sortings)

    def costs_of(self, designs: Array) -> dict[str, Array]:
        pairs = zip(self._parts, self._by_part(designs).T, strict=True)
        return {f"{part.name}_t": cost for part, cost in pairs if not part.free_of_charge}

    def room(self, name: str, design: Array) -> Interval:
        low, high = super().room(name, design)
        for part in self._parts:
            if name == f"{part.name}_t":
                process = part.processes[self._chosen(design[None], part)[0]]
                low, high = max(low, process.low), min(high, process.high)
        return low, high

    def zone(self, name: str) -> tuple[float | None, float]:
        return {f"{p.name}_t": (p.nominal, p.mid) for p in self._parts}.get(name, (None, 0.0))

    def title(self) -> str:
        names = [requirement.name for requirement in self.definition.stated]
        return super().title() or ", ".join(filter(None, names))

    def mechanism(self) -> dict[str, object]:
        requirements = [
            labels_of(measured.requirement) | {"centre": measured.mechanism.centre} for measured in self.measured
        ]
        return super().mechanism() | {"requirements": requirements}

    def drawn(self, name: str) -> Mapping[str, str]:
        return {f"{p.name}_t": drawn(p) for p in self._parts}.get(name, {})

    def curves_of(self, name: str) -> tuple[tuple[CostCurve, float], ...]:
        part = self._part_of(name)
        curves = [process.curve for process in part.processes] if part else []
        known = [curve for curve in curves if curve is not None]
        if part is None or part.by_machine or len(known) != len(curves):
            return ()
        return tuple((curve, float(part.count)) for curve in known)

    @cached_property
    def _costs(self) -> PartCosts:
        return PartCosts(self._parts)

    def _by_part(self, designs: Array, slope: bool = False) -> Array:
        """Cost, or its slope, of each part (n, parts); of more parts than are built in where some find no mate."""
        chosen, t = self._chosen_of_all(designs), self.tolerances(designs)
        costs = self._costs.by_part(t, chosen, slope)
        return costs * factors_of_cost(self.definition, t) if self.definition.sortings else costs

    def gradient(self, designs: Array) -> dict[str, Array]:
        """Derivatives of the cost, the variations and the yields; 0 for a process."""
        t, coverage = self.parts_as_made(designs), self.settings.propagation.coverage
        derivatives: dict[str, Array] = {}
        values: dict[str, Array] = {}
        for requirement in self.measured:
            derivatives |= requirement.slopes(t, self.required_outputs, coverage)
            values |= requirement.variations(t)
        derivatives |= self.promises.slopes(t, self.required_outputs) if self.promises is not None else {}
        if all(requirement.name("variation") in values for requirement in self.measured):
            derivatives |= joint_slopes(self.measured, values, derivatives)
        if YIELD in self.yields.required_outputs and self.yields.joint is not None:
            derivatives[YIELD] = self.yields.joint.slopes(t)
        if not any(part.by_machine for part in self._parts):
            derivatives |= self.yields.slopes(t, coverage)
        derivatives = slopes_by_limit(self, designs, derivatives) | {"cost": self._by_part(designs, slope=True)}
        derivatives |= slopes_by_count(self, designs)
        if self.definition.sortings:
            derivatives |= self._matching_slopes(designs, derivatives.get(YIELD))
        at = [self.names.index(f"{part.name}_t") for part in self._parts]
        wide = {name: np.zeros_like(designs) for name in derivatives}
        for name, slopes in derivatives.items():
            wide[name][:, at] = slopes
        return wide

    def _matching_slopes(self, designs: Array, of_yield: Array | None) -> dict[str, Array]:
        """Derivatives (n, parts) of cost, of what is left over and, given those of the yield, of a good unit's cost."""
        shape = len(designs), len(self._parts)
        slopes = {"cost": np.zeros(shape), LEFT_OVER: np.zeros(shape)}
        for at, part in enumerate(self._parts):
            column, ends = self.names.index(f"{part.name}_t"), []
            for side in (1.0, -1.0):
                moved = designs.copy()
                moved[:, column] *= 1.0 + side * STEP_OF_T
                lost = left_over(self.definition, self.tolerances(moved)).max(axis=1)
                ends.append({"cost": self.cost_of(moved), LEFT_OVER: 100.0 * lost})
            for name, slope in slopes.items():
                slope[:, at] = (ends[0][name] - ends[1][name]) / (2.0 * STEP_OF_T * designs[:, column])
        if PER_GOOD_UNIT in self.required_outputs and of_yield is not None:
            good = 0.01 * self.yields.percentages(self.parts_as_made(designs), needed=True)[YIELD][:, None]
            slopes[PER_GOOD_UNIT] = (slopes["cost"] - self.cost_of(designs)[:, None] * 0.01 * of_yield / good) / good
        return slopes

    # ---------------------------------------------------------------- what is known

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Limits of inspection from the spread of good parts, which a form searches."""
        return limits_by_spread(self, columns)

    def form(self) -> Form | None:
        return form_of(self)

    def form_values(self, form: Form, designs: Array, outputs: Mapping[str, Array]) -> Array:
        values = super().form_values(form, designs, outputs)
        for at, (name, most) in enumerate(zip(form.outputs, form.own_limits, strict=True)):
            if np.isfinite(most):
                values[:, at] = most + shortfall(self, name, designs, outputs)
        return values

    def guide(self) -> Form | None:
        """The form; for a half-width without a law, that of the root sum square."""
        return form_of(self, gaussian=True)

    def interval(self, output: str) -> Interval:
        """Proven bounds: cost and linear variations are monotone in every tolerance."""
        if output == "cost":
            return self._cost_interval
        if output in self._intervals:
            return self._intervals[output]
        if output in self.names and output.endswith("_t"):
            at = [f"{part.name}_t" for part in self._parts].index(output)
            return float(self.ends_of_t[0][at]), float(self.ends_of_t[1][at])
        if output in self.names and output not in self.fixed:  # a process: neither end need be the tightest
            variable = self.variables[self.names.index(output)]
            return variable.low, variable.high
        return super().interval(output)

    @cached_property
    def _intervals(self) -> dict[str, Interval]:
        return intervals_of(self)

    @cached_property
    def ends_of_t(self) -> tuple[Array, Array]:
        """Tightest and loosest half-width (parts,)."""
        return np.array([part.low for part in self._parts]), np.array([part.high for part in self._parts])

    @cached_property
    def ends_as_made(self) -> tuple[Tolerances, Tolerances]:
        """Tightest and loosest parts as they come out (1, parts)."""
        return ranges_by_process(self._parts)

    @property
    def negative(self) -> bool:
        """Whether deviations of parts may compensate each other."""
        return any(bool(np.any(requirement.linear.covariance < 0.0)) for requirement in self.measured)

    @cached_property
    def _cost_interval(self) -> Interval:
        """Least and largest cost: every part in its cheapest and its most expensive process."""
        low, high = self._costs.interval
        if self.definition.sortings:
            most = max(float(factors_of_cost(self.definition, t[None, :]).max()) for t in self.ends_of_t)
            low, high = low + self._price_of_sorting, most * high + self._price_of_sorting
        return low, high

    def corner(self, tight: bool) -> Array:
        """The design with every tolerance at its tightest or loosest, and a process for it."""
        return corner_of(self._parts, self.names, tight)

    def least_cost(self) -> tuple[str, Stack] | None:
        """The cheapest design within the limits, where a run has further objectives."""
        kept = [limit.name for limit in self.limits if limit.name != "cost"]
        if self.objectives == ("cost",) or "cost" not in self.objectives or not kept:
            return None
        return "GA, least cost within the limits", Stack(replace(self.given, objectives=("cost",)))

    # ---------------------------------------------------------------- faults and warnings

    def faults(self) -> list[Fault]:
        return faults_of(self, super().faults)

    def out_of_reach(self) -> list[Fault]:
        return nominal_limit_faults(self, super().out_of_reach())

    def assumptions(self) -> tuple[Assumption, ...]:
        return assumptions_of(self.definition)

    def samples(self) -> tuple[tuple[str, str, PartSample], ...]:
        return samples_of(self.definition.parts)

    def requirements_at(self, design: Array | None = None) -> pd.DataFrame | None:
        from .analysis import analysed_design, requirements_table

        return requirements_table(self, analysed_design(self)[0] if design is None else design)

    def remarks(self, front: pd.DataFrame) -> tuple[str, ...]:
        return domain_remarks(self.measured, front)

    def quantile_units(self) -> Mapping[str, int]:
        counted = any(self.yields.counts_half_width(measured) for measured in self.measured)
        return {"propagation.samples": self.settings.propagation.samples} if counted else {}

    def warnings(self) -> tuple[str, ...]:
        return self._warnings

    @cached_property
    def _warnings(self) -> tuple[str, ...]:
        return warnings_of(self)


def _declare_stack(parts: Sequence[Part], outputs: tuple[Output, ...]) -> Declaration:
    """Its objectives are those that it has: requirements in different units have no variation together."""
    own = tuple(name for name in OBJECTIVES if any(output.name == name for output in outputs))
    machines = {f"{part.name}_t": part.machines for part in parts if part.machines}
    return Declaration(
        variables_of(parts), outputs, objectives=own, algorithm="exact", machines=machines, tables=("condition",)
    )
