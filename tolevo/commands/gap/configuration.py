"""Reads the configuration of `tolevo gap`, with [free], [next_measurement] and run: every fault at once."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields, replace
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from ... import registry
from ...configuration.configuration import TABLE, Configuration
from ...configuration.cost_files import fill_files
from ...configuration.parameters import (
    FORMULA,
    GEAR,
    UNRESOLVED,
    check_gear,
    formula_effect,
    resolved_effects,
    resolved_gear,
)
from ...configuration.plugins import KEYS as LABELS
from ...configuration.plugins import RECORD, SENSE, ZERO, ModelClass, foreign_model_message, model_belongs
from ...configuration.reader import PROBLEM_ONLY, build_model, read_table, rebuild_model
from ...configuration.source import GAP_ONLY, Source, folder_of, load, override_source
from ...directory import kind_of, standing
from ...errors import Fault, InputError, nearest, raise_all
from ...models.effects.effect import Effect
from ...models.effects.measurements import EXTRAS, target_of
from ...models.measurable import Column, MeasurableModel, MeasuredTable, Role
from ...problems.settings import Labels
from ...section import PLAIN, POSITIVE, Need, Output, Range, Section, completed, flat, shown
from ...units import converted, split_unit
from .drawing_configuration import Run, apply_drawing
from .next_field import rows_in_range
from .plan import GapPlan, GapSettings, NextPlan, Span


def read_free(top: Section, configuration: Configuration | None) -> dict[str, float]:
    """Tolerance by parameter; without the table the model's own list of free parameters."""
    section = top.section("free")
    kind = registry.load("models", configuration.model_name) if configuration else None
    if "free" not in top:
        if configuration is None or kind is None:
            return {}
        return dict(kind.free_of(configuration.settings.parameters))
    stated = top.take("free")
    known = _numeric_parameters(kind) if kind is not None else {}
    tolerances: dict[str, float | None] = {}
    for key, value in flat(stated).items() if isinstance(stated, dict) else ():
        if key not in known:
            why = "is not a parameter of the model" if kind else 'model = "table" has no parameters'
            section.fault(key, f"{why}{nearest(key, known)}")
            continue
        tolerances[key] = section.as_number(key, value, known[key], POSITIVE)
    return {key: value for key, value in tolerances.items() if value is not None}


def _numeric_parameters(kind: ModelClass) -> dict[str, str]:
    """Unit by name of every parameter that is a number, those of tables by dotted name."""
    units: dict[str, str] = {}
    for parameter in kind.parameters:
        if isinstance(parameter.default, Mapping):
            units |= {f"{parameter.name}.{name}": split_unit(name)[1] for name in parameter.choices}
        elif isinstance(parameter.default, float):
            units[parameter.name] = parameter.unit
    return units


KEY = "next_measurement"
MEASUREMENTS = Range(1, 100_000)
ABSOLUTE_ZERO = -273.15
"""[degC]"""
MESH = 100_000
"""Largest number of points that are tried."""
STEPS = 33
"""Values of each range that are tried to test whether the ranges together contain a point."""


def read_next(top: Section, model: MeasurableModel | None) -> NextPlan | None:
    """The table; None where there is none. `model` is None where it is not known."""
    section = top.section(KEY)
    if KEY not in top:
        return None
    measurements = section.integer("readings", MEASUREMENTS)
    effects = _valid_effect_names(section, "effects", section.names("effects"))
    amounts = section.section("amount")
    sizes = {name: amounts.number(name, "", POSITIVE) for name in amounts.all_keys()}
    _valid_effect_names(amounts, "", sizes)
    for name in sizes if effects else ():
        if name not in effects:
            amounts.fault(name, f"is not among the effects of this table: {', '.join(effects)}")
    ranges = section.section("range")
    spans = {name: _span(ranges, name, model) for name in ranges.all_keys()}
    section.finish()
    valid = {name: span for name, span in spans.items() if span is not None}
    if model is not None and valid and len(valid) == len(spans):
        _range_faults(ranges, model, valid)
    return NextPlan(
        readings=NextPlan().readings if measurements is None else measurements,
        ranges=valid,
        effects=tuple(effects),
        amounts={name: size for name, size in sizes.items() if size is not None},
    )


def _valid_effect_names(section: Section, key: str, stated: Iterable[str] | None) -> list[str]:
    """The names that are effects; a fault for every name that is not."""
    known, names = registry.names("effects"), list(stated or ())
    for name in names:
        if name not in known:
            text = f"is not an effect{nearest(name, known)}"
            section.fault(key or name, f'"{name}" {text}' if key else text)
    return [name for name in names if name in known]


def _span(section: Section, name: str, model: MeasurableModel | None) -> Span | None:
    """The range of one input; None where it is at fault."""
    value = section.take(name)
    column = _column(section, name, model)
    unit = column.unit if column is not None else ""
    span = _interval_or_values(section, name, value, unit, column is not None and column.role is Role.DIRECTION)
    if span is None or column is None or model is None:
        return None
    _physical(section, column, model, span)
    return span


def _column(section: Section, name: str, model: MeasurableModel | None) -> Column | None:
    """The input of that name; a fault where there is none that can be chosen."""
    if model is None:
        return None
    known = {c.name: c for c in (*model.columns, *EXTRAS)}
    free = [n for n, c in known.items() if not c.text and c.role is not Role.REPEAT]
    column = known.get(name)
    if name in {output.name for output in model.outputs}:
        section.fault(name, "is measured, not chosen: name inputs only")
    elif column is None:
        section.fault(name, f"is not a column of the model{nearest(name, free)}")
    elif column.text or column.role is Role.REPEAT:
        section.fault(name, "holds labels: only inputs that are numbers have a range")
        return None
    elif isinstance(model, MeasuredTable) and name in {p for p, _ in model.predictions.values()}:
        section.fault(name, "is a prediction, not an input")
        return None
    return column


def _interval_or_values(section: Section, name: str, value: Any, unit: str, signs: bool) -> Span | None:
    """The interval or the set as it is written."""
    chosen = isinstance(value, dict)
    if chosen:
        inner = section.of(name, value)
        value = inner.take("values")
        inner.finish()
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        value, chosen = [value], True
    if not isinstance(value, list):
        section.fault(name, f"must be [low, high], a number, or {{ values = [...] }}, got {shown(value)}")
        return None
    if not value:
        section.fault(name, "is empty: give at least one value")
        return None
    numbers = [section.as_number(name, entry, unit) for entry in value]
    finite = [number for number in numbers if number is not None]
    if len(finite) < len(numbers):
        return None
    if chosen or signs:
        return Span(min(finite), max(finite), tuple(sorted(set(finite))))
    return _interval(section, name, finite)


def _interval(section: Section, name: str, ends: list[float]) -> Span | None:
    if len(ends) != 2:
        section.fault(name, f"must be [low, high], or {{ values = [...] }} for a set, got {len(ends)} numbers")
        return None
    low, high = ends
    if low > high:
        section.fault(name, f"goes from {low:g} down to {high:g}: write the lower end first")
        return None
    return Span(low, high)


def _physical(section: Section, column: Column, model: MeasurableModel, span: Span) -> None:
    """Faults of values that cannot be, or that are beyond the range of the model."""
    ends = np.array(span.values or (span.low, span.high))
    if column.role is Role.DIRECTION and not set(ends.tolist()) <= {-1.0, 1.0}:
        none = not set(ends.tolist()) & {-1.0, 1.0}
        text = "holds neither +1 nor -1" if none else f"must hold only +1 and -1, got {ends.tolist()}"
        section.fault(column.name, f"{text}; a direction is +1 or -1")
        return
    if column.role is Role.TEMPERATURE:
        zero = float(converted(ABSOLUTE_ZERO, "degC", column.unit))
        if (ends < zero).any():
            section.fault(column.name, f"{ends.min():g} is below absolute zero")
            return
    unknown = {c.name: np.full(len(ends), np.nan) for c in model.columns if not c.text}
    for wrong, text in model.outside({**unknown, column.name: ends}).values():
        if wrong.any():
            section.fault(column.name, f"{ends[wrong][0]:g} {text}; narrow the range")


def _range_faults(section: Section, model: MeasurableModel, spans: dict[str, Span]) -> None:
    """A fault where no point of the ranges is in the range of the model."""
    steps = np.linspace(0.0, 1.0, STEPS)
    axes = [
        np.array(span.values) if span.values else span.low + steps * (span.high - span.low) for span in spans.values()
    ]
    if len(axes) > 3 or prod(len(axis) for axis in axes) > MESH:
        return  # the points themselves are tested again
    mesh = np.meshgrid(*axes, indexing="ij")
    table = {name: axis.ravel() for name, axis in zip(spans, mesh, strict=True)}
    if not rows_in_range(model, table).any():
        section.fault("", f"holds no point that the model reaches: widen {' or '.join(spans)}")


RUN_KEYS = ("problem", "model", "seed", "parameters", "variables", *LABELS, *PROBLEM_ONLY)


def read_run(top: Section, model: str, table: Mapping[str, Any], folder: Path) -> tuple[dict[str, Any], Run | None]:
    """The raw tables of that configuration: of the file that `run` names or, where the analysis is
    itself a run configuration (as `corrected.toml` is), its own; empty for none. The second result
    is the configuration in the file, None where there is none or it is at fault.
    """
    run = top.text("run")
    if "problem" in top:
        if run is not None:
            top.fault("run", "this configuration states a problem itself: leave out run")
        return {key: table[key] for key in RUN_KEYS if key in table}, None
    if run is None:
        return {}, None
    tables, configuration = _read(top, model, folder / run)
    return tables, Run(run, configuration) if configuration is not None else None


def _read(top: Section, model: str, path: Path) -> tuple[dict[str, Any], Configuration | None]:
    faults = mixed(path)
    table = load(path, faults) if not faults else None
    if table is None:
        top.fault("run", "; ".join(f"{fault.place} {fault.message}" for fault in faults))
        return {}, None
    run_faults: list[Fault] = []
    filled = fill_files(table, path.parent, run_faults)
    configuration = top.attempt(
        lambda: read_table(filled.table, run_faults, filled.notes), lambda fault: (f"run: {fault.place}", fault.message)
    )
    if configuration is None:
        return {}, None
    if configuration.problem is None:
        top.fault("run", f"{path} has no problem: there is no allocation to repeat")
    elif _belongs(top, model, configuration):
        return filled.table, configuration
    return filled.table, None


def mixed(path: Path) -> list[Fault]:
    """Faults of the result that a file belongs to, where its files do not belong together."""
    if not kind_of(path.parent):
        return []
    here = standing(path.parent)
    return list(here.faults) if here.manifest is None or path.name in here.manifest.files else []


def _belongs(top: Section, model: str, run: Configuration) -> bool:
    """Whether a correction of the model applies to the problem; a fault where it does not."""
    if model == TABLE:
        top.fault(
            "run",
            'model = "table" corrects no problem: leave run out (`simulate` takes its '
            "corrected configuration), or name the model of the problem",
        )
        return False
    try:
        measured = registry.load("models", model)
    except InputError:
        return False  # the name is reported where it stands
    of_problem = run.problem.declaration.model if run.problem else ""
    if not model_belongs(run.problem_name, of_problem, model, measured):
        text = foreign_model_message(run.problem_name, model, measured)
        top.fault("run", f"{text}; name a run configuration of it, or leave run out")
        return False
    return True


def counterparts(text: str) -> dict[str, str]:
    """What each effect of a configuration does in its problem; empty where it does nothing.

    Raises InputError where the text is not a configuration with a problem.
    """
    problem = read_table(tomllib.loads(text), []).problem
    if problem is None:
        return {}
    pairs = zip(problem.settings.effects, problem.counterparts(), strict=True)
    return {active.effect.name: counterpart for active, counterpart in pairs}


MODEL_KEYS = (*RUN_KEYS, "effect", UNRESOLVED, ZERO, SENSE, RECORD)
NEEDS = {
    "simulations": Need("simulation", bytes=3.2e3),  # 400 columns of noise
    "bootstrap": Need("replicate", bytes=1e3, seconds=0.1),
    "rows_used": Need("row", bytes=1e4),  # in every column of the library
}
"""What the counts of `[settings]` take."""


def read_gap(source: Source, overrides: Sequence[str] = ()) -> GapPlan:
    """The gap analysis that a TOML file or dictionary asks for, with `key=value` overrides applied.

    Raises InputError with every fault.
    """
    plan, faults = gap_plan(source, overrides)
    raise_all(faults)
    assert plan is not None
    return plan


def gap_plan(source: Source, overrides: Sequence[str] = ()) -> tuple[GapPlan | None, list[Fault]]:
    """`read_gap` that returns the faults.

    The plan is then complete enough to check data with it: defaults replace faulty entries. It is
    None where not even the columns are known.
    """
    faults: list[Fault] = []
    try:
        table = override_source(source, overrides, faults)
    except InputError as error:
        return None, list(error.faults)
    top = Section(table, "", faults)
    top.accept((*MODEL_KEYS, *GAP_ONLY, "run", "columns", GEAR))
    name = top.text("model")
    top.accept(_tables(name or ""))
    if name is None and "model" not in top:
        top.fault("model", 'is missing: name a model (see `tolevo list`), or model = "table"')
    configuration = _configuration(top, name or "", table, faults)
    settings = _settings(top.section("settings"))
    checkable = configuration is not None or name == TABLE
    free = read_free(top, configuration if name != TABLE else None) if checkable else {}
    library = _library(top.section("effects"))
    validation = top.section("validation")
    blocks = validation.text("blocks") or "auto"
    validation.finish()
    data = top.section("data")
    drop = bool(data.flag("drop_bad_rows"))
    data.finish()
    run_tables, run = read_run(top, name or "", table, folder_of(source))
    simulated = configuration or _stand_in(table, name)
    simulated, drawing = (
        (simulated, None) if simulated is None else apply_drawing(top, simulated, run, folder_of(source))
    )
    model = build_model(simulated) if simulated is not None else None
    noise = _noise(top.section("noise"), model.outputs if configuration and model else ()) if checkable else {}
    planned = read_next(top, model)
    own = _own_effects(top, model, name or "")
    top.finish()
    if simulated is None:
        return None, faults
    plan = _of_model(simulated, model, name, table, configuration is not None)
    plan = replace(
        plan,
        free=free,
        library=tuple(name for name in library if name not in {active.effect.name for active in plan.active}),
        own=own,
        noise=noise,
        blocks=blocks,
        drop_bad_rows=drop,
        settings=settings,
        run=run_tables,
        counterparts=counterparts if run_tables else None,
        next_measurement=planned,
        drawing=drawing,
        labels=_labels(simulated, run),
    )
    stated = {key: value for key, value in table.items() if key != "settings"}
    text = tomli_w.dumps({**stated, "seed": plan.seed, "settings": asdict(plan.settings)})
    return replace(plan, configuration=text), faults


def _of_model(
    configuration: Configuration, model: MeasurableModel | None, name: str | None, table: Mapping[str, Any], whole: bool
) -> GapPlan:
    """The part of a plan that says what is simulated; `whole` unless defaults replace it."""
    of_table, active = name == TABLE, tuple(configuration.settings.effects)
    return GapPlan(
        model_name=str(name),
        model=None if of_table else model,
        seed=configuration.seed,
        parameters=_parameters(configuration),
        stated_parameters=dict(table.get("parameters", {})) if whole and not of_table else {},
        columns=configuration.settings.definition if of_table else {},
        rebuild=None if of_table else partial(rebuild_model, configuration),
        active=active,
        zero=dict(configuration.settings.zero),
        sense=dict(configuration.settings.sense),
        gear=configuration.settings.gear,
        uses=dict(configuration.settings.columns),
        tables=configuration.settings.labels.stated()
        | resolved_gear(configuration.settings.gear)
        | resolved_effects(active)
        if of_table
        else dict(configuration.resolved),
    )


def _configuration(top: Section, name: str, table: Mapping[str, Any], faults: list[Fault]) -> Configuration | None:
    """The part of the configuration that `simulate` would take; None where it is at fault."""
    if name != TABLE:
        check_gear(top, _kind(name), name)
    if not name:
        return None
    known = (*MODEL_KEYS, "columns", *((GEAR,) if name == TABLE else _tables(name)))
    part = {key: table[key] for key in known if key in table}
    if isinstance(given := part.get("effect"), list):  # those that are to be fitted are not in the model yet
        part["effect"] = [entry for entry in given if not _is_open(entry)]
    try:
        return read_table(part, [])
    except InputError as error:
        faults += error.faults
        return None


def _is_open(entry: Any) -> bool:
    """Whether an `[[effect]]` table states a formula whose parameters are to be fitted."""
    return isinstance(entry, Mapping) and FORMULA in entry and "parameters" not in entry


def _own_effects(top: Section, model: MeasurableModel | None, name: str) -> tuple[Effect, ...]:
    """The effects that `[[effect]]` states by formulas without parameters."""
    target = None if model is None else target_of(model, name)
    effects: list[Effect | None] = []
    given = top.take("effect")
    for at, entry in enumerate(given if isinstance(given, list) else ()):
        if _is_open(entry):
            section = top.item("effect", at)
            effects.append(formula_effect(section, target))
            section.finish()
    return tuple(effect for effect in effects if effect is not None)


def _labels(configuration: Configuration, run: Run | None) -> Labels:
    """Labels of the mechanism: as the analysis states them, else as its run does."""
    stated = configuration.settings.labels
    return stated if stated != Labels() or run is None else run.configuration.settings.labels


def _kind(name: str) -> Any:
    """The class of a model, None where it is not known."""
    try:
        return registry.load("models", name) if name else None
    except InputError:
        return None  # reported where it stands


def _tables(name: str) -> tuple[str, ...]:
    """The tables that a model is written in; none where it is not known."""
    kind = _kind(name)
    return tuple(kind.tables) if kind is not None else ()


def _stand_in(table: Mapping[str, Any], name: str | None) -> Configuration | None:
    """The model with its defaults instead of a faulty configuration, None where it is not known.

    A chain keeps its number of joints, which decides the columns of the data.
    """
    try:
        part = {key: table[key] for key in ("columns",) if key in table and name == TABLE}
        if isinstance(joints := table.get("joint"), list) and joints:
            part["joint"] = [dict.fromkeys(("d_mm", "a_mm", "alpha_deg"), 1.0)] * len(joints)
        return read_table({"model": name, **part}, []) if name else None
    except InputError:
        return None


def _parameters(configuration: Configuration) -> dict[str, Any]:
    """Every parameter of the model, those that a problem does not declare included."""
    if configuration.model_name == TABLE:
        return {}
    return completed(registry.load("models", configuration.model_name).parameters, configuration.settings.parameters)


def _settings(section: Section) -> GapSettings:
    """`[settings]`: how the loop decides."""
    ranges = {
        "false_rate": Range(0.0, 0.5, open_low=True),
        "simulations": Range(low=200),
        "set_distance": Range(low=0.0),
        "practical_limit": Range(0.0, 1.0),
        "bootstrap": Range(low=0),
        "interval": Range(0.0, 1.0, open_low=True, open_high=True),
        "rows_used": Range(low=200),
        "effects_at_most": Range(low=1, high=20),
        "terms_at_most": Range(low=0, high=20),
        "parts_out_of_limits": Range(0.0, 1.0, open_low=True, open_high=True),
    }
    values: dict[str, Any] = {
        setting.name: section.integer(setting.name, ranges[setting.name], NEEDS.get(setting.name, PLAIN))
        if isinstance(setting.default, int)
        else section.number(setting.name, "", ranges[setting.name])
        for setting in fields(GapSettings)
        if setting.name in ranges
    }
    values["empirical"] = section.flag("empirical")
    section.finish()
    stated: dict[str, Any] = {name: value for name, value in values.items() if value is not None}
    return GapSettings(**stated)


def _library(section: Section) -> tuple[str, ...]:
    """Names of the effects that are considered."""
    known = registry.names("effects")
    considered = section.take("consider")
    never = section.names("never") if "never" in section else []
    section.finish()
    wanted = known
    if considered is not None and considered != "all":
        wanted = _effects_named(section, "consider", [considered] if isinstance(considered, str) else considered, known)
    unwanted = _effects_named(section, "never", never or [], known)
    return tuple(name for name in wanted if name not in unwanted)


def _effects_named(section: Section, key: str, value: Any, known: list[str]) -> list[str]:
    """The effects that names of effects and families stand for."""
    if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
        section.fault(key, f'must be "all" or a list of names and families, got {shown(value)}')
        return []
    families: dict[str, str] = {}
    if any(entry not in known for entry in value):  # a family may have members of any plugin
        families = {name: registry.load("effects", name).family for name in known}
    effects: list[str] = []
    for entry in value:
        members = [entry] if entry in known else [n for n, family in families.items() if family == entry]
        if not members:
            valid = [*known, *families.values()]
            section.fault(key, f'"{entry}" is neither an effect nor a family{nearest(entry, valid)}')
        effects += [name for name in members if name not in effects]
    return effects


def _noise(section: Section, outputs: Sequence[Output]) -> dict[str, float]:
    """`[noise]`: a known standard deviation per output that is measured; any name where none is declared."""
    units = {output.name: output.unit for output in outputs}
    deviations = {n: section.number(n, units.get(n, ""), POSITIVE) for n in section.all_keys()}
    for name in deviations if units else ():
        if name not in units:
            section.fault(name, f"is not a measured output{nearest(name, units)}")
    return {name: value for name, value in deviations.items() if value is not None}
