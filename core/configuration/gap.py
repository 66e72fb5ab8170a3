"""Reads the configuration of `tolevo gap`: every fault of every section at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from functools import partial
from typing import Any

import tomli_w

from .. import registry
from ..counts import PLAIN, Need
from ..declarations import completed
from ..errors import Fault, InputError, nearest, raise_all
from ..models.measurable import MeasurableModel
from ..problems.settings import Labels
from ..section import POSITIVE, Range, Section, shown
from ..workflows.gap.plan import GapPlan, GapSettings
from .configuration import Configuration
from .effects import resolved_effects
from .gap_contradictions import Run
from .gap_drawing import as_drawn
from .gap_free import read_free
from .gap_next import read_next
from .gap_run import RUN_KEYS, counterparts, read_run
from .gear import GEAR, check_gear, resolved_gear
from .reader import read_table
from .senses import SENSE, ZERO
from .simulated import build_model, rebuilt
from .source import Source, folder_of, load, overridden
from .table import TABLE
from .unresolved import UNRESOLVED

GAP_ONLY = ("built_to", "free", "effects", "noise", "validation", "data", "settings", "next_measurement")
"""Tables that only the configuration of a gap analysis has."""
MODEL_KEYS = (*RUN_KEYS, "effect", UNRESOLVED, ZERO, SENSE)
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


def is_gap(source: Source) -> bool:
    """Whether a configuration has a table that only that of a gap analysis has."""
    table = load(source, [])
    return table is not None and "model" in table and not table.keys().isdisjoint(GAP_ONLY)


def gap_plan(source: Source, overrides: Sequence[str] = ()) -> tuple[GapPlan | None, list[Fault]]:
    """`read_gap` that returns the faults.

    The plan is then complete enough to check data with it: defaults replace faulty entries. It is
    None where not even the columns are known.
    """
    faults: list[Fault] = []
    try:
        table = overridden(source, overrides, faults)
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
    noise = _noise(top.section("noise"), configuration) if checkable else {}
    validation = top.section("validation")
    blocks = validation.text("blocks") or "auto"
    validation.finish()
    data = top.section("data")
    drop = bool(data.flag("drop_bad_rows"))
    data.finish()
    run_tables, run = read_run(top, name or "", table, folder_of(source))
    simulated = configuration or _stand_in(table, name)
    simulated, drawing = (simulated, None) if simulated is None else as_drawn(top, simulated, run, folder_of(source))
    model = build_model(simulated) if simulated is not None else None
    planned = read_next(top, model)
    top.finish()
    if simulated is None:
        return None, faults
    plan = _of_model(simulated, model, name, table, configuration is not None)
    plan = replace(
        plan,
        free=free,
        library=tuple(name for name in library if name not in {active.effect.name for active in plan.active}),
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
    return _with_text(plan, table), faults


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
        rebuild=None if of_table else partial(rebuilt, configuration),
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
    try:
        return read_table(part, [])
    except InputError as error:
        faults += error.faults
        return None


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


def _noise(section: Section, configuration: Configuration | None) -> dict[str, float]:
    """`[noise]`: a known standard deviation per output that is measured."""
    outputs = build_model(configuration).outputs if configuration else ()
    units = {output.name: output.unit for output in outputs}
    deviations = {n: section.number(n, units.get(n, ""), POSITIVE) for n in section.all_keys()}
    for name in deviations if units else ():
        if name not in units:
            section.fault(name, f"is not a measured output{nearest(name, units)}")
    return {name: value for name, value in deviations.items() if value is not None}


def _with_text(plan: GapPlan, table: Mapping[str, Any]) -> GapPlan:
    """The plan with the TOML text that repeats it: as given, with the settings complete."""
    stated = {key: value for key, value in table.items() if key != "settings"}
    return replace(plan, configuration=tomli_w.dumps({**stated, "seed": plan.seed, "settings": asdict(plan.settings)}))
