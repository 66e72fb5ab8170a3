"""Reads the configuration of `tolevo gap`: every fault of every section at once."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import tomli_w

from .. import registry
from ..errors import Fault, InputError, nearest, raise_all
from ..models.effects.compose import Active
from ..section import POSITIVE, Range, Section, shown
from ..workflows.gap.plan import ColumnRole, GapPlan, GapSettings
from .configuration import Configuration
from .effects import read_effects, resolved_effects
from .gap_columns import read_columns
from .reader import read, read_table
from .simulated import build_model
from .source import load, override
from .table import TABLE, table_model

OF_THE_MODEL = ("model", "seed", "parameters", "variables", "effect")
OWN = ("run", "free", "effects", "noise", "validation", "columns", "data", "settings")
ZERO = "zero"
"""What the zero of an angular output is called in `corrected.toml` and in messages."""


def read_gap(path: Path, overrides: Sequence[str] = ()) -> GapPlan:
    """The gap analysis that the TOML file `path` asks for, with `key=value` overrides applied.

    Raises InputError with every fault found.
    """
    faults: list[Fault] = []
    table = load(path, faults)
    if table is None:
        raise_all(faults)
    assert table is not None
    override(table, overrides, faults)
    top = Section(table, "", faults)
    top.known((*OF_THE_MODEL, *OWN))
    name = top.text("model")
    if name is None and "model" not in top:
        top.fault("model", 'is missing: name a model (see `tolevo list`), or model = "table"')
    configuration = _model(table, name, faults) if name else None
    columns = read_columns(top, name == TABLE)
    of_table = _effects_of_table(top, columns, faults) if name == TABLE else ()
    settings = _settings(top.section("settings"))
    free = _free(top, configuration)
    library = _library(top.section("effects"))
    noise = _noise(top.section("noise"))
    validation = top.section("validation")
    blocks = validation.text("blocks") or "auto"
    validation.finish()
    data = top.section("data")
    drop = bool(data.flag("drop_bad_rows"))
    data.finish()
    run = _run(top, path.parent)
    top.finish()
    raise_all(faults)
    model = build_model(configuration) if configuration is not None else None
    active = tuple(configuration.settings.effects) if configuration else of_table
    plan = GapPlan(
        model_name=str(name),
        model=model,
        seed=_seed(table),
        parameters=dict(configuration.settings.parameters) if configuration else {},
        given=dict(table.get("parameters", {})) if configuration else {},
        free=free,
        library=tuple(name for name in library if name not in _names(active)),
        noise=noise,
        blocks=blocks,
        columns=columns,
        drop_bad_rows=drop,
        settings=settings,
        run=run,
        rebuild=_builder(configuration),
        active=active,
        counterparts=counterparts if run else None,
        tables=_model_tables(configuration) or resolved_effects(active),
    )
    return _with_text(plan, table)


def _seed(table: Mapping[str, Any]) -> int:
    return int(table.get("seed", 0))


def _model(table: Mapping[str, Any], name: str, faults: list[Fault]) -> Configuration | None:
    """The part of the configuration that `simulate` would take; None for a table."""
    if name == TABLE:
        part = Section(table, "", faults)
        part.integer("seed", Range(low=0))
        for key in ("parameters", "variables"):
            if key in part:
                part.fault(key, 'belongs to a model; model = "table" has none')
        return None
    try:
        return read_table({key: table[key] for key in OF_THE_MODEL if key in table}, [])
    except InputError as error:
        faults += error.faults
        return None


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
    }
    given: dict[str, Any] = {
        one.name: section.integer(one.name, ranges[one.name])
        if isinstance(one.default, int)
        else section.number(one.name, "", ranges[one.name])
        for one in fields(GapSettings)
        if one.name in ranges
    }
    given["empirical"] = section.flag("empirical")
    section.finish()
    found: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    return GapSettings(**found)


def _free(top: Section, configuration: Configuration | None) -> dict[str, float]:
    """`[free]`: tolerance by parameter; without the table the model's own list."""
    section = top.section("free")
    kind = registry.load("models", configuration.model_name) if configuration else None
    if "free" not in top:
        return dict(kind.free) if kind is not None else {}
    known = _freeable(kind) if kind is not None else {}
    found: dict[str, float | None] = {}
    for key, value in _flat(top.take("free")).items():
        if key not in known:
            why = "is not a parameter of the model" if kind else 'model = "table" has no parameters'
            section.fault(key, f"{why}{nearest(key, known)}")
            continue
        found[key] = section.as_number(key, value, known[key], POSITIVE)
    return {key: value for key, value in found.items() if value is not None}


def _flat(table: Any, place: str = "") -> dict[str, Any]:
    """Values by dotted key."""
    found: dict[str, Any] = {}
    for key, value in table.items() if isinstance(table, dict) else ():
        at = f"{place}{key}"
        found |= _flat(value, f"{at}.") if isinstance(value, dict) else {at: value}
    return found


def _freeable(kind: Any) -> dict[str, str]:
    """Unit by name of every parameter that is a number, those of tables by dotted name."""
    found: dict[str, str] = {}
    for one in kind.parameters:
        if isinstance(one.default, Mapping):
            found |= {f"{one.name}.{name}": unit_of(name) for name in one.choices}
        elif isinstance(one.default, float):
            found[one.name] = one.unit
    return found


def unit_of(name: str) -> str:
    """The unit that a name ends with."""
    from ..units import split_unit

    return split_unit(name)[1]


def _library(section: Section) -> tuple[str, ...]:
    """Names of the effects that are considered."""
    known = registry.names("effects")
    given = section.take("consider")
    never = section.names("never") if "never" in section else []
    section.finish()
    wanted = known
    if given is not None and given != "all":
        wanted = _named(section, "consider", [given] if isinstance(given, str) else given, known)
    unwanted = _named(section, "never", never or [], known)
    return tuple(name for name in wanted if name not in unwanted)


def _named(section: Section, key: str, given: Any, known: list[str]) -> list[str]:
    """The effects that names of effects and families stand for."""
    if not isinstance(given, list) or not all(isinstance(one, str) for one in given):
        section.fault(key, f'must be "all" or a list of names and families, got {shown(given)}')
        return []
    families = {name: registry.load("effects", name).family for name in known} if given else {}
    found: list[str] = []
    for one in given:
        members = [one] if one in known else [n for n, family in families.items() if family == one]
        if not members:
            valid = [*known, *families.values()]
            section.fault(key, f'"{one}" is no effect and no family{nearest(one, valid)}')
        found += [name for name in members if name not in found]
    return found


def _noise(section: Section) -> dict[str, float]:
    """`[noise]`: a known standard deviation per output; the names are checked with the data."""
    found = {name: section.number(name, "", POSITIVE) for name in section.given()}
    return {name: value for name, value in found.items() if value is not None}


def _run(top: Section, folder: Path) -> dict[str, Any]:
    """The raw tables of the configuration whose allocation is to be repeated."""
    given = top.text("run")
    if given is None:
        return {}
    faults: list[Fault] = []
    path = folder / given
    table = load(path, faults)
    if table is None:
        top.fault("run", "; ".join(f"{one.place} {one.message}" for one in faults))
        return {}
    try:
        if read(path).problem is None:
            top.fault("run", f"{path} names no problem: there is no allocation to repeat")
    except InputError as error:
        for fault in error.faults:
            top.fault(f"run: {fault.place}", fault.message)
    return table


def counterparts(text: str) -> dict[str, str]:
    """What each effect of a configuration with a problem does there; empty where it does nothing.

    Raises InputError where the text is no such configuration.
    """
    problem = read_table(tomllib.loads(text), []).problem
    if problem is None:
        return {}
    pairs = zip(problem.settings.effects, problem.counterparts(), strict=True)
    return {one.effect.name: does for one, does in pairs}


def _effects_of_table(
    top: Section, columns: Mapping[str, ColumnRole], faults: list[Fault]
) -> tuple[Active, ...]:
    """Effects that are added to the prediction of a table; none where its columns are at fault."""
    if faults:
        return ()
    return read_effects(top, table_model(columns), TABLE)


def _names(active: Sequence[Active]) -> set[str]:
    """Effects that are in the model already."""
    return {one.effect.name for one in active}


def _builder(configuration: Configuration | None) -> Any:
    """A function from parameters to the model; None for a table."""
    if configuration is None:
        return None
    from .simulated import rebuilt

    return lambda parameters: rebuilt(configuration, parameters)


def _model_tables(configuration: Configuration | None) -> dict[str, Any]:
    """The tables of the model as the configuration resolves them."""
    if configuration is None:
        return {}
    return dict(configuration.resolved)


def _with_text(plan: GapPlan, table: Mapping[str, Any]) -> GapPlan:
    """The plan with the TOML text that repeats it: as given, with the settings complete."""
    from dataclasses import replace

    given = {key: value for key, value in table.items() if key != "settings"}
    text = tomli_w.dumps({**given, "seed": plan.seed, "settings": asdict(plan.settings)})
    return replace(plan, configuration=text)


__all__ = ["ColumnRole", "read_gap"]
