"""A problem in several conditions of its life: the same units evaluated once in each of them.

Each condition is the problem itself with the effects and operating parameters of that condition, drawn
from the same seed: units and errors of parts are the same in all of them, so that differences between
conditions are not those of samples. Outputs are named `<condition>.<output>`; those that no condition
changes, as the cost, keep their names.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import Fault
from ..models.effects.measurements import Active
from ..models.effects.temperature_time import DifferentialThermalExpansion
from ..records import UnitsShown
from ..section import Array, Output, Section, Value, flat
from .declaration import Declaration, Interval
from .settings import Bound, Settings
from .tolerance_problem import ToleranceProblem, Variant

if TYPE_CHECKING:
    from .forms import CostBound, Form

COMPARED = 33
"""Values of t at which costs of two ways are compared."""

# Names and limits of outputs in conditions, also of problems that have conditions of their own.


def limitable(
    outputs: Sequence[Output], plain: Sequence[Output], conditions: Sequence[str], top: Section
) -> tuple[Output, ...]:
    """The `outputs` in every condition, and the `plain` ones, which limits may name; elsewhere it is a fault."""
    limited = {output.name: output for output in (*plain, *outputs)}
    alone = limited.keys() - {output.name for output in outputs}
    objectives = top.section("objectives").take("minimise")
    named = [("objectives.minimise", name) for name in objectives] if isinstance(objectives, list) else []
    chosen = top.section("choice").take("limits")
    named += [(f"choice.limits.{name}", name) for name in flat(chosen)] if isinstance(chosen, dict) else []
    for place, name in named:
        if name in alone:
            text = f"{name} has a value in each condition: name one, like {conditions[0]}.{name}"
            top.fault(place, text)
    return tuple(limited.values())


def limits_in_all(conditions: Iterable[str], limits: Mapping[str, Bound], outputs: Collection[str]) -> dict[str, Bound]:
    """The limits of a run, those on outputs that there are only in conditions in each of them."""
    names = list(conditions)
    spread = {name: bound for name, bound in limits.items() if name in outputs or not names}
    for name in [name for name in limits if name not in spread]:
        for condition in names:
            own = spread.get(f"{condition}.{name}", Bound())
            low, high = max(own.low, limits[name].low), min(own.high, limits[name].high)
            spread[f"{condition}.{name}"] = Bound(low, high)
    return spread


THERMAL, WEAR = "differential_thermal_expansion", "wear"
DISC, HOUSING, APART = "disc_temperature_C", "housing_temperature_C", "temperature_difference_K"
TEMPERATURES = ("temperature_C", DISC, HOUSING, APART)
"""Keys of a condition and the effect by which they act; its hours act by that of wear."""


def contradictory(bounds: Mapping[str, Bound], place: str = "limits") -> list[Fault]:
    """A fault for each pair of limits on one output that no value keeps."""
    return [
        Fault(
            f"{place}.{name}",
            f"limits in all conditions and in {name.partition('.')[0]} contradict each other: at least {bound.low:g} "
            f"and at most {bound.high:g}",
        )
        for name, bound in bounds.items()
        if bound.low > bound.high
    ]


@dataclass(frozen=True, slots=True)
class Condition:
    """A state in the life of a unit: `effects` that act in it and operating `parameters`; `stated` is
    its table as the configuration has it at `place`, without limits and objectives.
    """

    name: str
    place: str
    effects: tuple[Active, ...] = ()
    parameters: Mapping[str, Value] = field(default_factory=dict)
    hours: float = 0.0
    stated: Mapping[str, Any] = field(default_factory=dict)

    def effects_with(self, always: Iterable[Active]) -> tuple[Active, ...]:
        """Those of the condition and those that act `always`, after the hours of the condition."""
        every = (*always, *self.effects)
        return tuple(replace(a, values={**a.values, "hours": self.hours}) for a in every) if self.hours else every


@dataclass(frozen=True, slots=True)
class OperatingConditions:
    """The `conditions` of a problem and how it is made from settings without them."""

    make: Callable[[Settings], ToleranceProblem]
    conditions: tuple[Condition, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the conditions."""
        return tuple(condition.name for condition in self.conditions)


def declaration_in(names: Sequence[str], plain: Declaration) -> Declaration:
    """The declaration of a problem whose outputs that conditions change exist in each of them."""

    def everywhere(output: str) -> tuple[str, ...]:
        return (output,) if output in plain.unconditional else tuple(f"{name}.{output}" for name in names)

    own = {output.name for output in plain.outputs}
    common = tuple(output for output in plain.outputs if output.name in plain.unconditional)
    outputs = tuple(
        replace(
            output,
            name=f"{name}.{output.name}",
            meaning=f"{output.meaning} (condition {name})",
            error_of=f"{name}.{output.error_of}" if output.error_of else "",
        )
        for name in names
        for output in plain.outputs
        if output.name not in plain.unconditional
    )
    limits = {
        name: bound
        for output, bound in plain.limits.items()
        for name in (everywhere(output) if output in own else [output])
    }
    return replace(
        plain,
        outputs=(*common, *outputs),
        limits=limits,
        objectives=tuple(name for name in plain.objectives if name in plain.unconditional),
        performance=frozenset(name for output in plain.performance for name in everywhere(output)),
        explained={
            name: other
            for output, by in plain.explained.items()
            for name, other in zip(everywhere(output), everywhere(by), strict=False)
        },
        conditions=tuple(names),
    )


def joined_form(conditions: Sequence[str], forms: Sequence[Form | None], common: Collection[str]) -> Form | None:
    """The form whose requirements are those of every condition; None where one has none, where the same features are
    not made in the same ways, or where there are more than sums and roots of them.
    """
    known = [form for form in forms if form is not None]
    if len(known) < len(forms):
        return None
    first = known[0]
    for form in known:
        more = (form.correlation, form.quantiles, form.surpluses, form.also, form.settled, form.labels, form.tested)
        if any(part is not None and len(part) for part in more) or form.base != first.base or not _alike(form, first):
            return None

    def named(condition: str, name: str) -> str:
        return name if name in common else f"{condition}.{name}"

    pairs = list(zip(conditions, known, strict=True))
    features = tuple(
        replace(
            feature,
            ways=tuple(
                replace(
                    way,
                    linear=sum((form.features[at].ways[number].linear for form in known), ()),
                    spread=sum((form.features[at].ways[number].spread for form in known), ()),
                    offset=sum(
                        (form.features[at].ways[number].offset or (0.0,) * len(form.outputs) for form in known), ()
                    ),
                )
                for number, way in enumerate(feature.ways)
            ),
        )
        for at, feature in enumerate(first.features)
    )
    return replace(
        first,
        outputs=tuple(f"{condition}.{name}" for condition, form in pairs for name in form.outputs),
        features=features,
        offset=np.concatenate([form.offset for form in known]),
        constant=np.concatenate([form.constant for form in known]),
        statement=f"{first.statement}; in every condition",
        exact=all(form.exact for form in known),
        relaxed=tuple(dict.fromkeys(named(condition, name) for condition, form in pairs for name in form.relaxed)),
        most=tuple(np.concatenate([form.own_limits for form in known]).tolist()) if any(f.most for f in known) else (),
        stands={f"{c}.{name}": f"{c}.{output}" for c, form in pairs for name, output in form.stands.items()},
        only_bounds=any(form.only_bounds for form in known),
    )


def _alike(one: Form, other: Form) -> bool:
    """Whether two forms have the same features, made in the same ways at the same costs."""

    def ways_of(form: Form) -> list[tuple[Any, ...]]:
        marks = []
        for feature in form.features:
            for way in feature.ways:
                t = np.linspace(way.low, way.high, COMPARED)
                marks.append((feature.variable, feature.choice, feature.count, way.choice, *t, *way.curve.cost(t)))
        return marks

    return ways_of(one) == ways_of(other)


def _of_plain(name: str) -> Any:
    """A method that is the same in all conditions."""

    def method(self: InConditions, *args: Any, **kwargs: Any) -> Any:
        return getattr(self.plain, name)(*args, **kwargs)

    return method


class InConditions(ToleranceProblem):
    """The problem of `Settings.operating` in every condition of it.

    Known answer: none beyond those of the problem in one condition.
    """

    _of_searches = frozenset(("_finer",))
    _drawn_again = _of_searches | {"_starts"}

    complete = _of_plain("complete")
    costs_of = _of_plain("costs_of")
    cost_slopes = _of_plain("cost_slopes")
    corner = _of_plain("corner")
    _corners = _of_plain("_corners")
    references = _of_plain("references")
    model_labels = _of_plain("model_labels")
    misplaced = _of_plain("misplaced")
    room = _of_plain("room")
    zone = _of_plain("zone")
    drawn = _of_plain("drawn")
    curves_of = _of_plain("curves_of")
    ranges_of = _of_plain("ranges_of")
    sample_sizes = _of_plain("sample_sizes")
    quantile_units = _of_plain("quantile_units")
    samples = _of_plain("samples")
    title = _of_plain("title")
    tables = _of_plain("tables")

    def __init__(self, settings: Settings | None = None) -> None:
        assert settings is not None and settings.operating is not None
        self.operating: OperatingConditions = settings.operating
        objectives = ("cost",) if len(settings.objectives) == 1 else ()
        self.plain = self.operating.make(replace(settings, operating=None, objectives=objectives, limits={}))
        self.declaration = declaration_in(self.operating.names, self.plain.declaration)
        known = {o.name for o in self.declaration.outputs} | {v.name for v in self.declaration.variables}
        settings = replace(settings, limits=limits_in_all(self.operating.names, settings.limits, known))
        super().__init__(settings)
        self.alone = tuple(self._in(condition) for condition in self.operating.conditions)

    def _in(self, condition: Condition) -> ToleranceProblem:
        """The problem in one condition, with the limits and objectives there."""
        prefix, common = f"{condition.name}.", self.plain.declaration.unconditional
        limits = {name.removeprefix(prefix): b for name, b in self.settings.limits.items() if name.startswith(prefix)}
        limits |= {name: b for name, b in self.settings.limits.items() if name in self.names or name in common}
        objectives = [
            name.removeprefix(prefix) for name in self.settings.objectives if name.startswith(prefix) or name in common
        ]
        given = replace(
            self.plain.given,
            objectives=tuple(objectives) or ("cost",),
            limits=limits,
            effects=condition.effects_with(self.given.effects),
            parameters={**self.plain.given.parameters, **self.plain.sample_sizes(), **condition.parameters},
        )
        return self.operating.make(given)

    def release(self, of_searches: bool = False) -> None:
        super().release(of_searches)
        for problem in (self.plain, *self.alone):
            problem.release(of_searches)

    def _completed(self, given: Settings) -> Settings:
        completed = self.plain.settings
        return replace(
            completed,
            objectives=given.objectives or self.declaration.objectives,
            limits=dict(self.declaration.limits) | dict(given.limits),
            operating=given.operating,
        )

    # ---------------------------------------------------------------- outputs

    def _named(self, values: Iterable[Mapping[str, Array]]) -> dict[str, Array]:
        """Values by output of each condition, by their names here."""
        named: dict[str, Array] = {}
        for condition, of_condition in zip(self.operating.names, values, strict=True):
            for name, value in of_condition.items():
                if name in self.plain.declaration.unconditional:
                    named.setdefault(name, value)
                else:
                    named[f"{condition}.{name}"] = value
        return named

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        return self._named(problem.outputs_of(designs, searching, errors=False) for problem in self.alone)

    def _own(self, outputs: Mapping[str, Array]) -> list[dict[str, Array]]:
        """Outputs of each condition, by their names there."""
        common = self.plain.declaration.unconditional
        return [
            {
                name.removeprefix(f"{condition}."): value
                for name, value in outputs.items()
                if name in common or name.startswith(f"{condition}.")
            }
            for condition in self.operating.names
        ]

    def _verified(self, designs: Array, outputs: Mapping[str, Array]) -> dict[str, Array]:
        own = self._own(outputs)
        return self._named(p._verified(designs, values) for p, values in zip(self.alone, own, strict=True))

    def needed(self, designs: Array) -> dict[str, Array]:
        return self._named(problem.needed(designs) for problem in self.alone)

    def gradient(self, designs: Array) -> dict[str, Array]:
        return self._named(problem.gradient(designs) for problem in self.alone)

    def interval(self, output: str) -> Interval:
        condition, _, name = output.partition(".")
        if condition in self.operating.names and name:
            return self.alone[self.operating.names.index(condition)].interval(name)
        return self.plain.interval(output)

    # ---------------------------------------------------------------- the same problem with other settings

    def _like(self, changed: ToleranceProblem, base: ToleranceProblem) -> InConditions:
        """The problem with what differs between two of its problems in one condition."""
        if changed is base:
            return self
        before, after = base.given, changed.given
        parameters = {name: v for name, v in after.parameters.items() if before.parameters.get(name) != v}
        fields = {
            name: getattr(after, name)
            for name in ("variables", "costs", "propagation", "machines", "definition", "seed", "effects")
            if getattr(after, name) is not getattr(before, name)
        }
        return InConditions(replace(self.given, parameters={**self.given.parameters, **parameters}, **fields))

    def reported(self) -> ToleranceProblem:
        return self._like(self.plain.reported(), self.plain)

    def coarser(self) -> ToleranceProblem:
        return self._like(self.plain.coarser(), self.plain)

    def smooth(self) -> ToleranceProblem:
        return self._like(self.plain.smooth(), self.plain)

    def finer(self) -> ToleranceProblem:
        return self._finer

    @cached_property
    def _finer(self) -> ToleranceProblem:
        return self._like(self.plain.finer(), self.plain)

    @property
    def fresh_units(self) -> int:
        return self.plain.fresh_units

    def on_fresh_units(self) -> ToleranceProblem:
        fresh = copy.copy(self)
        fresh.alone = tuple(problem.on_fresh_units() for problem in self.alone)
        return fresh

    def relaxed(self, limits: Mapping[str, Bound]) -> ToleranceProblem:
        same = self._like(self.plain.relaxed({}), self.plain)
        return InConditions(replace(same.given, limits=dict(self.given.limits) | dict(limits)))

    def without_effects(self) -> ToleranceProblem:
        return InConditions(replace(self.given, effects=()))

    def least_cost(self) -> tuple[str, ToleranceProblem] | None:
        if not any(limit.name not in self.names for limit in self.limits) or self.plain.least_cost() is None:
            return None
        return "GA, least cost within the limits", InConditions(replace(self.given, objectives=("cost",))).coarser()

    def variants(self) -> tuple[Variant, ...]:
        """Those of the unit with the limits and objectives of all conditions, and the run without each condition that
        only limits it.
        """
        every = [problem.given for problem in self.alone]
        unit = self.operating.make(
            replace(
                every[0],
                objectives=tuple(dict.fromkeys(name for given in every for name in given.objectives)),
                limits={name: bound for given in every for name, bound in given.limits.items()},
                effects=next((given.effects for given in every if given.effects), ()),
            )
        )
        known = unit.variants()
        if not known:
            return ()
        small = self._like(known[0].problem, unit)
        changed = [replace(v, problem=small._like(v.problem, known[0].problem)) for v in known]
        return (*changed, *small._without_conditions())

    def _without_conditions(self) -> Iterator[Variant]:
        """The problem without each condition that nothing is minimised in."""
        for condition in self.operating.conditions:
            prefix = f"{condition.name}."
            others = tuple(other for other in self.operating.conditions if other is not condition)
            if others and not any(name.startswith(prefix) for name in self.objectives):
                limits = {name: b for name, b in self.given.limits.items() if not name.startswith(prefix)}
                operating = replace(self.operating, conditions=others)
                problem = InConditions(replace(self.given, limits=limits, operating=operating))
                if not problem.search_faults():  # else its cheapest designs are those that no limit holds
                    yield Variant("conditions", f"without {condition.name}", problem)

    # ---------------------------------------------------------------- where a search begins, and its bounds

    def starts(self) -> Array:
        """Of the starts in every condition, those that break the limits of all of them least."""
        return self._starts.copy()

    @cached_property
    def _starts(self) -> Array:
        each = [starts for problem in self.alone if len(starts := problem.starts())]
        if not each:
            return self.plain.starts()
        rows = []
        for candidates in zip(*each, strict=False):
            designs = np.array(candidates)
            broken = self.violations(designs, self.outputs_of(designs, searching=True))
            rows.append(designs[int(np.argmin(np.maximum(broken, 0.0).sum(axis=1)))])
        return np.array(rows)

    def form(self) -> Form | None:
        forms = [problem.form() for problem in self.alone]
        return joined_form(self.operating.names, forms, self.plain.declaration.unconditional)

    def form_values(self, form: Form, designs: Array, outputs: Mapping[str, Array]) -> Array:
        values = np.empty((len(designs), len(form.outputs)))
        for problem, condition, own in zip(self.alone, self.operating.names, self._own(outputs), strict=True):
            rows = [at for at, name in enumerate(form.outputs) if name.startswith(f"{condition}.")]
            alone = replace(
                form,
                outputs=tuple(form.outputs[at].removeprefix(f"{condition}.") for at in rows),
                most=tuple(form.most[at] for at in rows) if form.most else (),
                stands={name.rpartition(".")[2]: output.rpartition(".")[2] for name, output in form.stands.items()},
            )
            if rows:
                values[:, rows] = problem.form_values(alone, designs, own)
        return values

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        return self.plain.form_columns(columns)

    def stand_in_limit(self, name: str, high: float) -> float:
        condition, _, output = name.partition(".")
        return self.alone[self.operating.names.index(condition)].stand_in_limit(output, high)

    def unproven(self) -> str:
        return self.plain.unproven()

    def cost_bound(self) -> CostBound | None:
        bounds = {
            name: bound
            for name, problem in zip(self.operating.names, self.alone, strict=True)
            if (bound := problem.cost_bound()) is not None
        }
        return GreatestBound(bounds) if bounds else None

    # ---------------------------------------------------------------- faults, and what a reader is told

    def faults(self) -> list[Fault]:
        if faults := [*self._without_counterpart(), *self._idle_hours()]:
            return faults
        for name, problem in zip(self.operating.names, self.alone, strict=True):
            faults += [replace(fault, place=self._place(fault.place, name)) for fault in problem.faults()]
        return list({(fault.place, fault.message): fault for fault in faults}.values())

    def _place(self, place: str, condition: str) -> str:
        """The place of a fault that the problem of one condition has."""
        table, _, name = place.partition(".")
        of = self.operating.conditions[self.operating.names.index(condition)]
        if table == "parameters" and name in of.parameters:
            return f"{of.place}.{name}"
        if table.startswith("effect["):
            return of.place
        own = table == "limits" and f"{condition}.{name}" in self.settings.limits
        return f"limits.{condition}.{name}" if own else place

    def _without_counterpart(self) -> Iterator[Fault]:
        """A fault for every effect of a condition that changes nothing in this problem."""
        for condition, problem in zip(self.operating.conditions, self.alone, strict=True):
            does = problem.counterparts()[len(self.given.effects) :]
            for effect, words in zip(condition.effects, does, strict=True):
                if not words:
                    text = (
                        f"{effect.effect.name} has no counterpart in this problem, or does nothing here: leave it out"
                    )
                    yield Fault(condition.place, text)

    def _idle_hours(self) -> Iterator[Fault]:
        """A fault for hours of a condition where nothing in this problem wears; a unit that may wear says so itself."""
        for condition in self.operating.conditions:
            wears = any(active.effect.name == WEAR for active in condition.effects_with(self.given.effects))
            if condition.hours and "hours" not in condition.parameters and not wears:
                text = f"{condition.hours:g} h change nothing: nothing wears in this problem; leave them out"
                yield Fault(f"{condition.place}.hours", text)

    def search_faults(self) -> list[Fault]:
        """Those that every condition has: what one of them limits is limited."""
        first, *others = [problem.search_faults() for problem in self.alone]
        return [fault for fault in first if all(fault in other for other in others)]

    def out_of_reach(self) -> list[Fault]:
        return [
            replace(fault, place=self._place(fault.place, name))
            for name, problem in zip(self.operating.names, self.alone, strict=True)
            for fault in problem.out_of_reach()
        ]

    def warnings(self) -> tuple[str, ...]:
        """Those of the conditions; what the unit alone is warned of only where every condition repeats it."""
        each, unit = [problem.warnings() for problem in self.alone], self.plain.warnings()
        texts = dict.fromkeys(text for texts in each for text in texts)
        kept = tuple(text for text in texts if text not in unit or all(text in texts for texts in each))
        return (*kept, *self._idle_temperatures())

    @cached_property
    def _acts_by_temperature(self) -> bool:
        """Whether a difference of temperatures changes anything in this problem."""
        warmer = (Active(DifferentialThermalExpansion(), {APART: 1.0}),)
        return any(type(self.plain)(replace(self.plain.given, effects=warmer)).counterparts())

    def _idle_temperatures(self) -> Iterator[str]:
        """Conditions whose parts are all at one temperature, which changes no angle of a drive."""
        for condition in self.operating.conditions:
            stated = [name for name in TEMPERATURES if name in condition.stated]
            if not stated or any(active.effect.name == THERMAL for active in condition.effects):
                continue
            text = f"condition {condition.name}: {' and '.join(stated)} {'change' if stated[1:] else 'changes'} nothing"
            if not self._acts_by_temperature:
                yield f"{text} in this problem, which has no effect of temperature: leave it out"
            elif APART in stated:
                yield f"{text}: all parts are at one temperature, which closes and opens no gap"
            else:
                yield f"{text}, as disc and housing grow alike; state temperatures that differ, or {APART}"

    def validity(self) -> tuple[str, ...]:
        """Those of all conditions, and those of some with the names of these."""
        each = dict(zip(self.operating.names, (problem.validity() for problem in self.alone), strict=True))
        own = {text: [name for name, texts in each.items() if text in texts] for text in sum(each.values(), ())}
        shared = (text if len(names) == len(each) else f"{', '.join(names)}: {text}" for text, names in own.items())
        return (*shared, "Units and errors of their parts are the same in all conditions.")

    def counterparts(self) -> tuple[str, ...]:
        """What each effect that acts in all conditions does, in the last of them."""
        return self.alone[-1].counterparts()[: len(self.given.effects)]

    def effect_notes(self) -> tuple[str, ...]:
        return tuple(
            f"condition {name}: {note}"
            for name, problem in zip(self.operating.names, self.alone, strict=True)
            for note in problem.effect_notes()
        )

    @cached_property
    def _shown(self) -> int:
        """The first condition that limits or minimises what units are shown by, the first of all without one."""
        limit = self.plain.shown_limit()
        asked = {name for name in (*self.settings.limits, *self.objectives) if limit}
        own = [f"{name}.{limit[0]}" in asked for name in self.operating.names] if limit else []
        return own.index(True) if True in own else 0

    def shown_limit(self) -> tuple[str, float] | None:
        limit = self.plain.shown_limit()
        return None if limit is None else (f"{self.operating.names[self._shown]}.{limit[0]}", limit[1])

    def sketch(self) -> dict[str, Any]:
        """That of the first condition."""
        sketch, common = self.plain.sketch(), self.plain.declaration.unconditional
        if not sketch:
            return sketch
        first = self.operating.names[0]
        parts = [
            {**part, "shares": [name if name in common else f"{first}.{name}" for name in part["shares"]]}
            for part in sketch["parts"]
        ]
        return {**sketch, "parts": parts}

    def shown_units(self, design: Array) -> UnitsShown | None:
        """Those of the condition of `shown_limit`."""
        return self.alone[self._shown].shown_units(design)

    def more_tables(self) -> dict[str, Any]:
        return {
            **self.plain.more_tables(),
            "condition": [dict(condition.stated) for condition in self.operating.conditions],
        }


class GreatestBound:
    """The greatest of the bounds of the cost in the conditions, each of which holds for the run."""

    def __init__(self, bounds: Mapping[str, CostBound]) -> None:
        self.bounds = {name: bound for name, bound in bounds.items() if not bound.missing}
        why: dict[str, list[str]] = {}
        for name, bound in bounds.items():
            why.setdefault(bound.missing, []).append(name)
        self._missing = "; ".join(f"{', '.join(names)}: {text}" for text, names in why.items())

    @property
    def missing(self) -> str:
        """Why there is none, empty where there is one."""
        return "" if self.bounds else self._missing

    @property
    def statement(self) -> str:
        """What the bounds hold for."""
        stated = "; ".join(f"in condition {name}: {bound.statement}" for name, bound in self.bounds.items())
        return stated or self._missing

    def least_costs(self, values: Mapping[str, Array], points: int) -> Array:
        """The greatest bound (points,) of any condition; NaN where none is known."""
        greatest = np.full(points, np.nan)
        for condition, bound in self.bounds.items():
            own = {name.removeprefix(f"{condition}."): value for name, value in values.items()}
            greatest = np.fmax(greatest, bound.least_costs(own, points))
        return greatest

    def estimate(self, values: Mapping[str, float]) -> None:
        """No sample of several conditions is estimated from."""
