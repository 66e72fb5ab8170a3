"""What the units of a batch are simulated as: the drawing of `run`, built to `built_to`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from .. import registry
from ..declarations import Kind, Variable
from ..gap_drawing_records import Dimension, Drawing, DrawnZone
from ..models.effects.compose import Active
from ..models.effects.measurements import target_of
from ..models.inputs import Distribution, Uniform
from ..models.inputs.reading import written
from ..problems.settings import Settings, VariableSetting
from ..section import Section
from .configuration import Configuration
from .effects import resolved_effects
from .gap_built import Built, read_built
from .gap_contradictions import Run, Stated, check_pair, check_stated, check_values
from .parameters import read_parameters
from .plugins import ModelClass
from .resolved import resolved_variables
from .table import TABLE
from .variables import read_variable

RUN = 'run = "CONFIG.toml" takes geometry, distributions and effects from a run configuration'
BUILT = (
    'built_to = "ALLOCATION.csv" (a run\'s allocation.csv, a table of designs, or a point of a '
    "run's directory) the zones that the units were made to"
)
DEFAULT = "the model's default"
HERE = "this configuration"


def as_drawn(top: Section, base: Configuration, run: Run | None, folder: Path) -> tuple[Configuration, Drawing | None]:
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
        run = Run(HERE, base)
    built = read_built(top, folder, _variables_of(kind, run)) or Built()
    if run is None and built.run is not None:
        run = Run(built.source.split(",")[0], built.run)
    stated = _stated_here(top, kind, base)
    if run is not None:
        check_pair(top, run, built)
        if base.problem is None:
            check_stated(top, stated, run, built, kind.of_the_bench)
        base = _with_run(base, kind, stated, run.configuration)
    elif built.values:
        check_values(top, stated.variables, built, {})
    configuration = _with_values(base, kind, built.values, "run" in top)
    return configuration, _drawing(configuration, kind, stated, run, built)


def _variables_of(kind: ModelClass, run: Run | None) -> tuple[Variable, ...]:
    """Variables of the run's problem; without a run those of the model, or of its first problem."""
    if run is not None and run.configuration.problem is not None:
        return tuple(run.configuration.problem.variables)
    if kind.variables:
        return tuple(kind.variables)
    return tuple(registry.load("problems", kind.corrects[0]).declaration.variables)


def _stated_here(top: Section, kind: ModelClass, base: Configuration) -> Stated:
    """Parameters, variables and effects that are given here; their faults are reported already."""
    parameters = read_parameters(top.collecting("parameters", []), kind.parameters)
    section = top.collecting("variables", [])
    settings = {v.name: read_variable(section.section(v.name), v, {}) for v in kind.variables}
    variables = {name: setting for name, setting in settings.items() if setting is not None}
    return Stated(parameters, variables, base.settings.effects)


# -------------------------------------------------------------------- put together


def _with_run(base: Configuration, kind: ModelClass, stated: Stated, run: Configuration) -> Configuration:
    """The model at the run's drawing, with what this configuration adds to it."""
    if run is base:
        return base
    known = {parameter.name for parameter in kind.parameters}
    parameters = dict(base.settings.parameters)
    parameters |= {name: value for name, value in run.settings.parameters.items() if name in known}
    parameters |= stated.parameters
    variables = dict(base.settings.variables)
    for name in variables.keys() & run.settings.variables.keys():
        variables[name] = _merged(variables[name], run.settings.variables[name], stated.variables.get(name))
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


def _merged(base: VariableSetting, run: VariableSetting, stated: VariableSetting | None) -> VariableSetting:
    """A variable of the model: mid-limit and distribution of the run, its value where it is
    fixed, or the value that is given here.
    """
    value = base.value if run.value is None else run.value
    if stated is not None and stated.value is not None:
        value = stated.value
    mid = base.mid if run.mid is None else run.mid
    return replace(base, value=value, mid=mid, distribution=run.distribution, sample=run.sample)


def _with_values(base: Configuration, kind: ModelClass, values: Mapping[str, float], of_a_run: bool) -> Configuration:
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


# -------------------------------------------------------------------- the record of the drawing


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
        run.name if run else HERE if drawn_here else DEFAULT,
        _allocation_from(stated, run, built, zones),
        geometry,
        zones,
        tuple(active.effect.name for active in settings.effects),
        _assumed(stated, run, built, zones, drawn_here),
    )


def _allocation_from(stated: Stated, run: Run | None, built: Built, zones: tuple[DrawnZone, ...]) -> str:
    """Where the zones come from; zones that are missing in the allocation are listed."""
    if built.values:
        by_default = [zone.variable for zone in zones if zone.variable not in built.values]
        return f"{built.source} ({', '.join(by_default)}: {DEFAULT})" if by_default else built.source
    if any(setting.value is not None for setting in stated.variables.values()):
        return f"{HERE}, and {DEFAULT}"
    problem = run.configuration.problem if run else None
    return (
        f"{run.name} where it fixes them, and {DEFAULT}" if run and problem is not None and problem.fixed else DEFAULT
    )


def _assumed(stated: Stated, run: Run | None, built: Built, zones: tuple[DrawnZone, ...], drawn_here: bool) -> str:
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
