"""The drawing that a batch is simulated by: `run` and `built_to` read, checked and put together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ... import registry, tables
from ...configuration.configuration import TABLE, Configuration
from ...configuration.parameters import read_parameters, read_variable, resolved_effects
from ...configuration.plugins import ModelClass
from ...configuration.reader import read
from ...configuration.resolved import resolved_variables
from ...directory import kind_of, standing
from ...errors import Fault, nearest, raise_all, refuse
from ...files import is_file, is_folder
from ...models.effects.measurements import Active, target_of
from ...models.input_reading import written
from ...models.inputs import Distribution, Uniform
from ...problems.settings import Settings, VariableSetting
from ...section import Kind, Range, Section, Value, Variable, shown
from .records import Dimension, Drawing, DrawnZone

if TYPE_CHECKING:
    import pandas as pd

ALLOCATION, FRONT, CONFIG = "allocation.csv", "front.csv", "config.toml"
CHOICE = ("choice", "point", "variable", "rounded")
"""Columns by which the allocation of a run is recognised."""
FORMS = 'a run\'s allocation.csv, a table of designs, or { run = "runs/x", point = "knee" }'


@dataclass(frozen=True)
class Built:
    """Values by variable, where they come from, and the run whose directory holds them."""

    values: Mapping[str, float] = field(default_factory=dict)
    source: str = ""
    run: Configuration | None = None


def read_built(top: Section, folder: Path, variables: Iterable[Variable]) -> Built | None:
    """The allocation that `built_to` names, None where there is none or it is at fault."""
    stated = top.take("built_to")
    if stated is None:
        return None
    inner = top.of("built_to", stated if isinstance(stated, dict) else {"file": stated})
    key = "run" if "run" in inner else "file"
    name, point = inner.text(key), inner.take("point")
    if key == "run" and "file" in inner:
        inner.fault("file", "is given in addition to run: leave out one of the two")
        inner.take("file")
    inner.finish()
    if name is None:
        if not isinstance(stated, str | dict) or key not in inner:
            top.fault("built_to", f"must name {FORMS}, got {shown(stated)}")
        return None
    place = inner.place(key) if isinstance(stated, dict) else "built_to"
    known = {variable.name: variable for variable in variables}
    return top.attempt(
        lambda: _allocation(folder / name, name, point, known),
        lambda fault: (place, f"{fault.place} {fault.message}".lstrip()),
    )


def _allocation(path: Path, name: str, point: Any, variables: Mapping[str, Variable]) -> Built:
    """The values, and the run that they come from. Raises InputError."""
    home = path if is_folder(path) else path.parent
    run = _run_of(home)
    if is_folder(path):
        if run is None:
            raise refuse("", f"{name} is not the directory of a run; name {FORMS}")
        path = home / (FRONT if isinstance(point, int) else ALLOCATION)
    frame = tables.open_or_raise(path, path.name, tables.NO_OPTIONS).cells
    if set(CHOICE) <= set(frame):
        values, origin = _values_of_choice(frame, path.name, point)
    else:
        values, origin = _values_of_design(frame, path.name, point, path.name == FRONT and run is not None)
    _check(values, path.name, variables)
    return Built({k: float(v) for k, v in values.items()}, f"{name}, {origin}", run)


def _run_of(folder: Path) -> Configuration | None:
    """The configuration of the run that a directory holds. Raises InputError where it is bad."""
    if kind_of(folder) != "run" or not is_file(folder / CONFIG):
        return None
    raise_all(standing(folder).faults)
    configuration = read(folder / CONFIG)
    return configuration if configuration.problem is not None else None


def _values_of_choice(frame: pd.DataFrame, place: str, point: Any) -> tuple[dict[str, Any], str]:
    """The rounded values of one chosen point of `allocation.csv`."""
    by = {(str(label), str(at)): part for (label, at), part in frame.groupby(["choice", "point"], sort=False)}
    names = ", ".join(label for label, _ in by)
    if point is None and len(by) > 1:
        raise refuse(
            "",
            f"{place} holds {len(by)} chosen points ({names}): say which, as "
            f'built_to = {{ run = "...", point = "{next(iter(by))[0].split()[0]}" }}',
        )
    chosen = [
        part
        for (label, at), part in by.items()
        if point is None or str(point) in (label, at) or str(point) in label.split()
    ]
    if len(chosen) != 1:
        words = [word for label, _ in by for word in label.split()]
        raise refuse("", f"point {shown(point)} is not in {place}{nearest(str(point), words)}: it holds {names}")
    label_of_point = str(chosen[0]["choice"].iloc[0]) if point is None else str(point)
    return dict(zip(chosen[0]["variable"], chosen[0]["rounded"], strict=True)), f"point {label_of_point}"


def _values_of_design(frame: pd.DataFrame, place: str, point: Any, front: bool) -> tuple[dict[str, Any], str]:
    """One row of a table of designs. Rows are counted from 1, those of a front from 0."""
    first = 0 if front else 1
    if point is None and len(frame) > 1:
        last = first + len(frame) - 1
        raise refuse(
            "",
            f'{place} holds {len(frame)} designs: say which, as built_to = {{ file = "...'
            f'", point = {first} }} ({first} to {last})',
        )
    at = 0 if point is None else point
    if point is not None:
        if isinstance(point, bool) or not isinstance(point, int):
            raise refuse("", f"point must be the number of a row of {place}, got {shown(point)}")
        at = point - first
        if not 0 <= at < len(frame):
            raise refuse("", f"point {point} is not in {place}: it has rows {first} to {first + len(frame) - 1}")
    return {str(name): value for name, value in frame.iloc[at].items()}, f"row {at + first}"


def _check(values: dict[str, Any], place: str, variables: Mapping[str, Variable]) -> None:
    """Values as numbers within what they may be; other columns of a table are left out."""
    known = [name for name in values if name in variables]
    if not known:
        raise refuse(
            "", f"{place} is an allocation of another problem: it has none of {', '.join(list(variables)[:6])}, ..."
        )
    faults = []
    for name in values if "cost" not in values else ():
        if name not in variables:
            text = f"column {name} is not a variable{nearest(name, variables)}"
            faults.append(Fault("", f"{place}: {text}; is it an allocation of another problem?"))
    for name in known:
        variable = variables[name]
        try:
            complaint = Range(variable.valid_low, variable.valid_high).complaint(float(values[name]))
        except ValueError:
            complaint = f"must be a number, got {shown(values[name])}"
        if complaint:
            faults.append(Fault("", f"{place}: {name} {complaint}"))
    raise_all(faults)
    for name in [n for n in values if n not in known]:
        del values[name]


RELATIVE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Stated:
    """What the gap configuration itself states about the units."""

    parameters: Mapping[str, Value]
    variables: Mapping[str, VariableSetting]
    effects: tuple[Active, ...]


@dataclass(frozen=True)
class Run:
    """The run whose drawing the units are built to, and its name in faults and on pages."""

    name: str
    configuration: Configuration


def check_pair(top: Section, run: Run, built: Built) -> None:
    """Faults where the allocation is of another run, or is not what the run fixes."""
    configuration, built_run = run.configuration, built.run
    if built_run is not None and built_run is not configuration:
        if built_run.problem_name != configuration.problem_name:
            text = f'is an allocation of another problem: "{built_run.problem_name}"'
            top.fault("built_to", f'{text}, and {run.name} is of "{configuration.problem_name}"')
            return
        for name, value in built_run.settings.parameters.items():
            wanted = configuration.settings.parameters.get(name, value)
            if not _values_equal(value, wanted):
                text = f"was made for {name} = {shown(value)}, and {run.name} has {shown(wanted)}"
                top.fault("built_to", f"{text}: name the run that the units were made for")
    problem = configuration.problem
    for name, value in built.values.items():
        fixed = None if problem is None else problem.fixed.get(name)
        if fixed is not None and not _values_equal(value, float(fixed)):
            top.fault("built_to", f"has {name} = {value:g}, and {run.name} fixes it at {fixed:g}")
    if problem is not None and built.values:
        missing = [v.name for v in problem.variables if v.name not in built.values and v.name not in problem.fixed]
        if missing:
            top.fault("built_to", f"has no {', '.join(missing)}, which {run.name} searches")


def check_omitted(top: Section, run: Run, omitted: Sequence[str]) -> None:
    """Faults where the run's units follow what those of the simulation do not: a gap would be taken for an effect."""
    for name in omitted:
        if value := run.configuration.settings.parameters.get(name):
            place = name if run.name == OWN_CONFIGURATION else "run"
            section = top.section("parameters") if run.name == OWN_CONFIGURATION else top
            text = "which the units that are simulated here do not follow: leave it out, or name a run without it"
            section.fault(place, f"{run.name} states {name} = {shown(value)}, {text}")


def check_stated(top: Section, stated: Stated, run: Run, built: Built, of_the_bench: Iterable[str]) -> None:
    """Faults where this configuration contradicts the run or the allocation."""
    run_settings = run.configuration.settings
    section = top.section("parameters")
    for name, value in stated.parameters.items():
        wanted = run_settings.parameters.get(name, value)
        if name not in of_the_bench and not _values_equal(value, wanted):
            section.fault(
                name,
                f"is {shown(value)} here and {shown(wanted)} in {run.name}: the units are those of the run; leave it "
                "out here, or name the run of the units that were measured",
            )
    check_values(top, stated.variables, built, run_settings.variables, run.name)
    values = {active.effect.name: dict(active.values) for active in run_settings.effects}
    for at, active in enumerate(stated.effects):
        if values.get(active.effect.name, dict(active.values)) != dict(active.values):
            top.fault(f"effect[{at}]", f"{active.effect.name} has other numbers in {run.name}: leave one of them out")


def check_values(
    top: Section,
    stated: Mapping[str, VariableSetting],
    built: Built,
    run_variables: Mapping[str, VariableSetting],
    run: str = "",
) -> None:
    """Faults where value, mid-limit or distribution of a variable contradict the run or the
    allocation.
    """
    for name, setting in stated.items():
        section = top.section("variables").section(name)
        run_setting = run_variables.get(name, VariableSetting())
        wanted, place = built.values.get(name), built.source
        if wanted is None:
            wanted, place = run_setting.value, run
        if setting.value is not None and wanted is not None and not _values_equal(setting.value, wanted):
            section.fault("value", f"is {setting.value:g} here and {wanted:g} in {place}: leave it out here")
        if setting.mid is not None and run_setting.mid is not None and not _values_equal(setting.mid, run_setting.mid):
            section.fault("mid", f"is {setting.mid:g} here and {run_setting.mid:g} in {run}: leave it out here")
        if name in run_variables and setting.distribution not in (None, run_setting.distribution or Uniform()):
            section.fault("distribution", f"is different in {run}: leave it out here")


def _values_equal(first: Value, second: Value) -> bool:
    """Whether two values are equal, numbers up to rounding."""
    if isinstance(first, int | float) and isinstance(second, int | float):
        return math.isclose(first, second, rel_tol=RELATIVE_TOLERANCE, abs_tol=1e-12)
    if isinstance(first, tuple | list) and isinstance(second, tuple | list):
        return len(first) == len(second) and all(map(_values_equal, first, second))
    return first == second


RUN = 'run = "CONFIG.toml" takes geometry, distributions and effects from a run configuration'
BUILT = (
    'built_to = "ALLOCATION.csv" (a run\'s allocation.csv, a table of designs, or a point of a '
    "run's directory) the zones that the units were made to"
)
DEFAULT = "the model's default"
OWN_CONFIGURATION = "this configuration"


def apply_drawing(
    top: Section, base: Configuration, run: Run | None, folder: Path
) -> tuple[Configuration, Drawing | None]:
    """`base` with the drawing of `run` and the allocation of `built_to`, and a record of both.

    A model whose units are made to no drawing is returned unchanged. Everything in the gap
    configuration that contradicts the run or the allocation is a fault.
    """
    kind = None if base.model_name == TABLE else registry.load("models", base.model_name)
    if kind is None or not kind.made_to_a_drawing:
        if "built_to" in top:
            top.take("built_to")
            top.fault("built_to", f"is for models of units made to a drawing, not {base.model_name}")
        return base, None
    if base.problem is not None:
        run = Run(OWN_CONFIGURATION, base)
    built = read_built(top, folder, _variables_of(kind, run)) or Built()
    if run is None and built.run is not None:
        run = Run(built.source.split(",")[0], built.run)
    stated = _own_settings(top, kind, base)
    if run is not None:
        check_omitted(top, run, kind.omits)
        check_pair(top, run, built)
        if base.problem is None:
            check_stated(top, stated, run, built, kind.of_the_bench)
        base = _apply_run(base, kind, stated, run.configuration)
    elif built.values:
        check_values(top, stated.variables, built, {})
    configuration = _apply_allocation(base, kind, built.values, "run" in top)
    return configuration, _drawing(configuration, kind, stated, run, built)


def _variables_of(kind: ModelClass, run: Run | None) -> tuple[Variable, ...]:
    """Variables of the run's problem; without a run those of the model, or of its first problem."""
    if run is not None and run.configuration.problem is not None:
        return tuple(run.configuration.problem.variables)
    if kind.variables:
        return tuple(kind.variables)
    return tuple(registry.load("problems", kind.corrects[0]).declaration.variables)


def _own_settings(top: Section, kind: ModelClass, base: Configuration) -> Stated:
    """Parameters, variables and effects that are given here; their faults are reported already."""
    parameters = read_parameters(top.collecting("parameters", []), kind.parameters)
    section = top.collecting("variables", [])
    settings = {v.name: read_variable(section.section(v.name), v, {}) for v in kind.variables}
    variables = {name: setting for name, setting in settings.items() if setting is not None}
    return Stated(parameters, variables, base.settings.effects)


def _apply_run(base: Configuration, kind: ModelClass, stated: Stated, run: Configuration) -> Configuration:
    """The model at the run's drawing, with what this configuration adds to it."""
    if run is base:
        return base
    known = {parameter.name for parameter in kind.parameters}
    parameters = dict(base.settings.parameters)
    parameters |= {name: value for name, value in run.settings.parameters.items() if name in known}
    parameters |= stated.parameters
    variables = dict(base.settings.variables)
    for name in variables.keys() & run.settings.variables.keys():
        variables[name] = _merge_variable(variables[name], run.settings.variables[name], stated.variables.get(name))
    active_here = {active.effect.name for active in base.settings.effects}
    of_run = _effects_of(run.settings, kind, base.model_name)
    effects = (*(active for active in of_run if active.effect.name not in active_here), *base.settings.effects)
    return replace(base, settings=replace(base.settings, parameters=parameters, variables=variables, effects=effects))


def _effects_of(run: Settings, kind: ModelClass, model: str) -> Iterator[Active]:
    """A run's effects that have a place in the model, and its parameters that are effects there."""
    target = replace(target_of(kind, model), gear=kind.gear_of(run.parameters))
    yield from (active for active in run.effects if active.effect.applies(target))
    for quantity in kind.changeable:
        value = run.parameters.get(quantity.name, 0.0)
        if isinstance(value, int | float) and value:
            for name in registry.names("effects"):
                effect = registry.load("effects", name)()
                if effect.place(target) == quantity:
                    yield Active(effect, {quantity.name: float(value)})


def _merge_variable(base: VariableSetting, run: VariableSetting, stated: VariableSetting | None) -> VariableSetting:
    """A variable of the model: mid-limit and distribution of the run, its value where it is
    fixed, or the value that is given here.
    """
    value = base.value if run.value is None else run.value
    if stated is not None and stated.value is not None:
        value = stated.value
    mid = base.mid if run.mid is None else run.mid
    return replace(base, value=value, mid=mid, distribution=run.distribution, sample=run.sample)


def _apply_allocation(
    base: Configuration, kind: ModelClass, values: Mapping[str, float], of_a_run: bool
) -> Configuration:
    """The model at an allocation. `resolved` states all of it, except for the effects where a
    configuration `of_a_run` states them.
    """
    variables = dict(base.settings.variables)
    for name in variables.keys() & values.keys():
        variables[name] = replace(variables[name], value=values[name], low=None, high=None)
    settings = replace(base.settings, variables=variables)
    if base.problem is not None:
        return replace(base, settings=settings)
    resolved = dict(base.resolved) | {
        "parameters": dict(settings.parameters),
        "variables": resolved_variables(variables, kind.variables),
    }
    resolved |= {} if of_a_run else resolved_effects(settings.effects)
    return replace(base, settings=settings, resolved=resolved)


def _drawing(configuration: Configuration, kind: ModelClass, stated: Stated, run: Run | None, built: Built) -> Drawing:
    settings = configuration.settings
    declared = {parameter.name: parameter for parameter in kind.parameters}
    geometry = tuple(
        Dimension(p.name, settings.parameters.get(p.name, p.default), p.unit, p.meaning)
        for p in (declared[name] for name in kind.geometry)
    )
    drawn_here = not stated.parameters.keys() <= set(kind.of_the_bench)  # parameters of the drawing, not of the bench
    zones = _zones(settings, kind, run, built)
    return Drawing(
        configuration.model_name,
        run.name if run else OWN_CONFIGURATION if drawn_here else DEFAULT,
        _allocation_from(stated, run, built, zones),
        geometry,
        zones,
        tuple(active.effect.name for active in settings.effects),
        _unstated_settings(stated, run, built, zones, drawn_here),
    )


def _allocation_from(stated: Stated, run: Run | None, built: Built, zones: tuple[DrawnZone, ...]) -> str:
    """Where the zones come from; zones that are missing in the allocation are listed."""
    if built.values:
        by_default = [zone.variable for zone in zones if zone.variable not in built.values]
        return f"{built.source} ({', '.join(by_default)}: {DEFAULT})" if by_default else built.source
    if any(setting.value is not None for setting in stated.variables.values()):
        return f"{OWN_CONFIGURATION}, and {DEFAULT}"
    problem = run.configuration.problem if run else None
    return (
        f"{run.name} where it fixes them, and {DEFAULT}" if run and problem is not None and problem.fixed else DEFAULT
    )


def _unstated_settings(
    stated: Stated, run: Run | None, built: Built, zones: tuple[DrawnZone, ...], drawn_here: bool
) -> str:
    """What the configuration does not state, and how to; empty where it states everything."""
    problem = None if run is None else run.configuration.problem
    whole = problem is not None and len(problem.fixed) == len(problem.variables)
    fixed_here = {name for name, setting in stated.variables.items() if setting.value is not None}
    if built.values or whole or (zones and all(zone.variable in fixed_here for zone in zones)):
        missing = [] if run else [RUN]
        what = "geometry and distributions"
    else:
        missing = [*([] if run else [RUN]), BUILT]
        what = "allocation" if run else "drawing"
    if not missing:
        return ""
    addition = " in addition to what [parameters] and [variables] state" if drawn_here or fixed_here else ""
    return f"answered for {DEFAULT} {what}{addition}: {'; '.join(missing)}"


def _zones(settings: Settings, kind: ModelClass, run: Run | None, built: Built) -> tuple[DrawnZone, ...]:
    """The zone of every variable of the model, or of the problem where the model has none."""
    drawn, variables = dict(settings.variables), tuple(kind.variables)
    if not variables and (run is not None or built.values):
        variables = _variables_of(kind, run)
        of_run = run.configuration.settings.variables if run else {}
        for variable in variables:
            setting = of_run.get(variable.name, VariableSetting(mid=variable.mid))
            drawn[variable.name] = replace(setting, value=built.values.get(variable.name, setting.value))
    return tuple(_zone(variable, drawn.get(variable.name, VariableSetting())) for variable in variables)


def _law(distribution: Distribution) -> str:
    """Name and parameters of a distribution; for measured parts, how many there are."""
    name, *values = written(distribution).items()
    parameters = [f"{key} {value:g}" for key, value in values if isinstance(value, int | float)]
    parameters += [f"{len(value)} {key}" for key, value in values if isinstance(value, list)]
    return " ".join([str(name[1]), *parameters])


def _zone(variable: Variable, setting: VariableSetting) -> DrawnZone:
    value = float((variable.document or 0.0) if setting.value is None else setting.value)
    low: float | None = None
    high: float | None = None
    if variable.kind is Kind.HALF_WIDTH:
        mid = setting.mid if setting.mid is not None else variable.mid or 0.0
        low, high = mid - value, mid + value
    elif variable.kind is Kind.FULL_CLEARANCE:
        low, high = 0.0, value
    law = _law(setting.distribution or Uniform()) if variable.random else ""
    return DrawnZone(variable.name, variable.unit, str(variable.kind), value, low, high, law)
