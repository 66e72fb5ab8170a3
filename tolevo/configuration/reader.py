"""Reads a configuration: all sections are checked before any fault is raised."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

from .. import registry
from ..algorithms.settings import AlgorithmSettings
from ..commands.run.choice import ALL, RULES, ChoiceSettings, Step
from ..commands.run.tolerances import coarse_steps, rounding_faults
from ..errors import Fault, InputError, raise_all, refuse
from ..problems.cost_columns import column_faults, factor_faults, read_cost_columns, read_robust, with_columns
from ..problems.declaration import ConfiguredProblem, Declaration
from ..problems.settings import METHODS, Bound, PropagationSetting, Settings, VariableSetting, unit_slips
from ..problems.tolerance_problem import ToleranceProblem
from ..section import POSITIVE, SAMPLES, Kind, Nested, Output, Range, Section, Value, Variable, completed
from .columns import read_design_columns, read_model_columns
from .configuration import START, TABLE, Configuration, read_table_model, table_model
from .cost_files import fill_files
from .costs import check_ends, narrow_setting, read_costs, read_money, unknown
from .parameters import mid_parameter, read_effects, read_parameters, read_unresolved, read_variable
from .plugins import (
    ModelClass,
    foreign_model_message,
    load_named,
    model_belongs,
    problem_of,
    read_labels,
    read_record,
    read_sense,
    read_zero,
)
from .reducers import fill_reducers
from .resolved import complete_tables, resolved_limits, resolved_measurement, resolved_variables
from .search import read_search, resolved_algorithm
from .source import Source, Table, folder_of, located, override_source, replace_algorithm

# `[objectives]`, `[limits]` and `[propagation]`.


INSIDE = Range(0.0, 1.0, open_low=True, open_high=True)


def read_objectives(section: Section, outputs: Sequence[Output], what: str = "an output") -> tuple[str, ...]:
    """The outputs to minimise, empty where the problem's own are meant."""
    names = section.names("minimise") or []
    section.finish()
    by_name = {output.name: output for output in outputs}
    valid = [o.name for o in outputs if not o.larger_is_better and not o.error_of]
    for at, name in enumerate(names):
        if name in names[:at]:
            section.fault("minimise", f'"{name}" is named twice')
        elif name not in by_name:
            section.fault("minimise", unknown(name, valid, what))
        elif by_name[name].larger_is_better:
            section.fault("minimise", f'"{name}" is better when larger: limit it instead')
        elif by_name[name].error_of:
            text = f'"{name}" is the error of {by_name[name].error_of}, not a property of the design'
            section.fault("minimise", text)
    return tuple(names)


def read_limits(section: Section, outputs: Sequence[Output], variables: Sequence[Variable]) -> dict[str, Bound]:
    """Limits by output (or variable); they take the place of the problem's own."""
    numeric = [v for v in variables if not v.labels]
    places = Nested(section, [*(o.name for o in outputs), *(v.name for v in numeric)])
    for output in outputs:
        table, key = places.find(output.name)
        if output.error_of and key in table:
            table.take(key)
            table.fault(key, f"is the error of {output.error_of} and cannot be limited")
    limitable = [output for output in outputs if not output.error_of]
    limits = {o.name: _limit(*places.find(o.name), o.unit, Range(o.low, o.high), o.larger_is_better) for o in limitable}
    limits |= {v.name: _limit(section, v.name, v.unit, Range(), False) for v in numeric}
    places.finish()
    return {name: bound for name, bound in limits.items() if bound is not None}


def _limit(section: Section, name: str, unit: str, within: Range, lower: bool) -> Bound | None:
    value = section.take(name)
    if value is None:
        return None
    if not isinstance(value, dict):
        number = section.as_number(name, value, unit, within)
        if number is None:
            return None
        return Bound(low=number) if lower else Bound(high=number)
    table = section.section(name)
    low, high = (table.number(key, unit, within) for key in ("min", "max"))
    table.finish()
    if not value.keys() & {"min", "max"}:
        section.fault(name, "needs min, max or both")
        return None
    if low is not None and high is not None and low > high:
        table.fault("min", f"must not be above max ({high:g}), got {low:g}")
        return None
    return Bound(-inf if low is None else low, inf if high is None else high)


def read_propagation(section: Section) -> PropagationSetting:
    """How spread is propagated."""
    default = PropagationSetting()
    method = section.text("method", METHODS)
    coverage = section.number("coverage", within=INSIDE)
    samples = section.integer("samples", Range(2, 2**26), SAMPLES)
    section.finish()
    return PropagationSetting(
        default.method if method is None else method,
        default.coverage if coverage is None else coverage,
        default.samples if samples is None else samples,
    )


# `[choice]` and `[rounding]`: how a point of the front is chosen, and what can be ordered.


def read_choice(
    top: Section, objectives: Sequence[str], outputs: Sequence[Output], variables: Sequence[Variable]
) -> ChoiceSettings:
    """The settings of both tables; every fault is reported."""
    section = top.section("choice")
    weights = _weights(section.section("weights"), objectives)
    limits = read_limits(section.section("limits"), outputs, variables)
    budget = section.number("budget", within=POSITIVE)
    roughness = section.number("roughness_share", within=Range(low=0.0, high=1.0, open_low=True))
    section.finish()
    return ChoiceSettings(weights, limits, budget, _steps(top.section("rounding"), variables), roughness)


def _weights(section: Section, objectives: Sequence[str]) -> dict[str, float]:
    numbers = {name: section.number(name, within=Range(low=0.0)) for name in objectives}
    for name in section.all_keys():
        if name not in numbers:
            section.take(name)
            section.fault(name, unknown(name, list(objectives), "an objective of this run"))
    section.finish()
    weights = {name: value for name, value in numbers.items() if value is not None}
    if weights and not sum(weights.values()) > 0.0:
        section.fault("", "must not all be zero")
    return weights


def _steps(section: Section, variables: Sequence[Variable]) -> dict[str, Step]:
    steps = {v.name: _step(section, v.name, v) for v in variables if v.kind is not Kind.CHOICE and not v.integer}
    for v in variables:
        if v.name not in steps and v.name in section:
            section.take(v.name)
            section.fault(v.name, f"is a {v.kind}: it is not rounded")
    rounded = [v for v in variables if v.name in steps and v.tolerance and v.name not in section]
    if ALL in section and ALL not in steps and rounded:
        steps[ALL] = _step(section, ALL, rounded[0])
    section.finish()
    return {name: step for name, step in steps.items() if step is not None}


def _step(section: Section, key: str, variable: Variable) -> Step | None:
    value = section.take(key)
    if isinstance(value, str) and value in RULES:
        if variable.tolerance:
            return RULES[value]
        section.fault(key, "is not a tolerance: give a step or a list of values")
        return None
    if isinstance(value, list):
        numbers = section.numbers(key)
        least = min(numbers or [one for one in value if isinstance(one, (int, float))], default=inf)
        if not value:
            section.fault(key, "must hold at least one value")
        elif variable.tolerance and least <= 0.0:
            section.fault(key, f"must hold values above 0, got {least:g}")
        else:
            return numbers
        return None
    if isinstance(value, str) and not any(letter.isdigit() for letter in value):
        section.fault(key, f'must be one of {", ".join(RULES)}, a step or a list of values, got "{value}"')
        return None
    return section.number(key, variable.unit, POSITIVE)


def resolved_choice(settings: ChoiceSettings) -> dict[str, Any]:
    """The tables that state these settings; what was not given is left out."""
    numbers = {"budget": settings.budget, "roughness_share": settings.roughness_share}
    tables: Mapping[str, Any] = {"weights": dict(settings.weights), "limits": resolved_limits(settings.limits)}
    choice = {name: table for name, table in tables.items() if table}
    choice |= {name: number for name, number in numbers.items() if number is not None}
    steps = {name: list(step) if isinstance(step, tuple) else step for name, step in settings.steps.items()}
    return {name: table for name, table in (("choice", choice), ("rounding", steps)) if table}


REFERENCES = ("documents", "ga", "none")
OF_CONDITIONS = ("condition[", "limits.", "objectives.", "promise")
"""Places of faults that leave the unit itself as it is."""
PROBLEM_ONLY = (
    "references",
    "costs",
    "propagation",
    "objectives",
    "limits",
    "algorithm",
    "choice",
    "rounding",
    "currency",
    "cost",
    "robust",
    START,
)


def read(
    source: Source,
    overrides: Sequence[str] = (),
    algorithm: AlgorithmSettings | None = None,
    seed: int | None = None,
    reachable: bool = True,
    start: Any = None,
) -> Configuration:
    """The configuration in a TOML file, workbook or dictionary, with `key=value` overrides applied.

    An `algorithm`, a `seed` and designs to `start` from take the place of its own. Limits may be out of
    reach where they need not be `reachable`. Raises InputError with every fault.
    """
    faults: list[Fault] = []
    tables = replace_algorithm(override_source(source, overrides, faults), algorithm, seed)
    tables |= {} if start is None else {START: start}
    try:
        return read_tables(tables, folder_of(source), faults, reachable)
    except InputError as error:
        raise located(error, source) from None


def read_tables(table: Table, folder: Path, faults: list[Fault], reachable: bool = True) -> Configuration:
    """`read_table` with the contents of the files that the tables name, relative to `folder`."""
    filled = fill_files(table, folder, faults)
    return read_table(filled.table, faults, filled.notes, folder, reachable)


def read_table(
    table: Table, faults: list[Fault], notes: Sequence[str] = (), folder: Path = Path(), reachable: bool = True
) -> Configuration:
    """The configuration in the tables of a file; raises InputError with `faults` and its own.

    `notes` come from its files; files of other configurations are looked for in `folder`.
    Limits may be out of reach where they need not be `reachable`.
    """
    top = Section(table, "", faults)
    if "problem" in top or "model" not in top:
        try:
            return _read_problem(top, faults, notes, folder, reachable)
        except InputError as error:
            if "condition" not in top:
                raise
            from .conditions import as_written

            raise InputError(list(dict.fromkeys(as_written(fault, top) for fault in error.faults))) from None
    return _read_model(top, faults)


def _seed(top: Section) -> int:
    seed = top.integer("seed", Range(low=0), None)
    return 0 if seed is None else seed


def _single_thread(sampled: bool) -> AbstractContextManager[object]:
    """One thread of linear algebra: tables of a sampled problem that are computed here are used by every search."""
    if not sampled:
        return nullcontext()
    from ..execution import pinned  # not for problems that compute nothing yet

    return pinned()


def _read_problem(
    top: Section, faults: list[Fault], notes: Sequence[str], folder: Path, reachable: bool
) -> Configuration:
    """A configuration with a problem."""
    if "problem" not in top and "claim" in top:
        raise refuse("claim", "makes this a file of claims: give it to `tolevo reproduce`, which checks it as well")
    if "problem" not in top:
        top.fault("problem", 'is missing: name a problem (see `tolevo list`), or model = "..."')
    problem_class = problem_of(top)
    top = fill_reducers(top, problem_class, folder)
    if problem_class and "cell" in problem_class.declaration.tables:
        from .cells import fill_poses

        top = fill_poses(top, folder)
    configured = problem_class.configured(top) if problem_class else None
    declared = configured.declaration if configured else Declaration()
    model = load_named(top, "model", "models", declared.model)
    model_name = top.take("model") or declared.model
    references = top.text("references", REFERENCES) or "documents"
    seed, labels = _seed(top), read_labels(top)
    effects = read_effects(top, model, model_name)
    terms = read_unresolved(top, model, model_name)  # they act on measurements: an allocation has none
    outputs = model.outputs if model else ()
    zero, sense, record = read_zero(top, outputs), read_sense(top, outputs), read_record(top)
    if (
        problem_class
        and model
        and not model_belongs(top.take("problem"), problem_class.declaration.model, model_name, model)
    ):
        top.fault("model", foreign_model_message(top.take("problem"), model_name, model))
    if configured is not None and "condition" in top and "condition" not in declared.tables:
        from .conditions import with_conditions  # few runs have any

        configured = with_conditions(configured, top, model, model_name)
        declared = configured.declaration
    if configured is None:  # its sections cannot be checked
        tables = problem_class.declaration.tables if problem_class else ()
        top.accept(("parameters", "variables", "columns", *tables, *PROBLEM_ONLY))
        top.finish()
        raise InputError(faults)
    columns = read_design_columns(top, declared.variables)
    cost_columns = read_cost_columns(top, declared)
    robust = read_robust(top, declared)
    declared = with_columns(declared, cost_columns)
    settings = replace(
        _settings(top, declared, model, notes, reachable),
        seed=seed,
        effects=effects,
        zero=zero,
        sense=sense,
        labels=labels,
        columns=columns,
        record=record,
        terms=terms,
        cost_columns=cost_columns,
        robust=robust,
    )
    objectives = settings.objectives or declared.objectives
    search = read_search(top.section("algorithm"), len(objectives), declared.algorithm)
    choice = read_choice(top, objectives, declared.outputs, declared.variables)
    opened = None
    if START in top:
        from .starts import open_start  # few configurations have one

        opened = open_start(top, folder)
    top.finish()
    if faults:  # those of the whole as far as they show without it
        ranges = {v.name: (v.low, v.high) for v in declared.variables if v.low < v.high}
        coarse = coarse_steps(ranges, declared.variables, choice)
        raise_all([*faults, *coarse, *_faults_beside_conditions(configured, settings, faults)])
    with _single_thread(declared.sampled):
        problem = configured(settings)
        _check_as_a_whole(problem, choice, search["algorithm_name"], reachable)
    assert search["algorithm"] is not None
    start = None
    if opened:
        from .starts import read_start

        start = read_start(problem, opened, search["budget"])
    resolved = {
        **complete_tables(problem, top.take("problem"), model_name),
        "references": references,
        "algorithm": resolved_algorithm(*search.values()),
        **resolved_choice(choice),
        **({START: start.table(problem)} if start and len(start.x) else {}),
    }
    return Configuration(
        model_name=model_name,
        settings=problem.settings,
        references=references,
        problem_name=top.take("problem"),
        problem=problem,
        choice=choice,
        start=start,
        resolved=resolved,
        **search,
    )


def _faults_beside_conditions(configured: ConfiguredProblem, settings: Settings, faults: list[Fault]) -> list[Fault]:
    """What else is wrong with a problem where nothing but conditions, limits and objectives of it is faulty."""
    if "operating" not in configured.read or not all(fault.place.startswith(OF_CONDITIONS) for fault in faults):
        return []
    with _single_thread(configured.declaration.sampled):
        wrong = configured(settings).faults()
    return [fault for fault in wrong if not fault.place.startswith("limits")]


def _check_as_a_whole(problem: ToleranceProblem, choice: ChoiceSettings, algorithm: str, reachable: bool) -> None:
    """Raise InputError with every fault of a problem whose sections are valid."""
    beyond = [] if reachable else problem.out_of_reach()
    wrong = [fault for fault in problem.faults() if fault not in beyond]
    wrong += [*column_faults(problem), *factor_faults(problem)]
    raise_all([*wrong, *(unit_slips(problem) if wrong else ()), *rounding_faults(problem, choice)])
    from ..commands.run.contradictions import contradictions  # imports the exact solver

    raise_all(contradictions(problem, algorithm) if reachable else [])


def _settings(
    top: Section, declared: Declaration, model: ModelClass | None, notes: Sequence[str], reachable: bool
) -> Settings:
    """The settings of a problem; parameters that only its model knows are accepted as well."""
    of_model = model.parameters if model else ()
    known = {p.name: p for p in (*of_model, *declared.parameters)}
    parameters = read_parameters(top.section("parameters"), known.values())
    variables = _variables(top.section("variables"), declared, parameters)
    costs = read_costs(top.section("costs"), declared.costs, declared.priceable)
    unpriced = declared.unpriced(parameters)
    money, costs = read_money(top, costs, {name: c for name, c in declared.costs.items() if name not in unpriced})
    curves = dict(declared.costs) | costs
    messages = list(notes)
    for variable in declared.variables:
        name, curve = variable.name, curves.get(variable.name)
        narrower, note = narrow_setting(variable, variables.get(name), curve)
        if narrower is not None and note:
            variables[name] = narrower
            messages.append(note)
        check_ends(top.section("variables").section(name), variable, variables.get(name), curve)
    return Settings(
        parameters=parameters,
        variables=variables,
        costs=costs,
        propagation=read_propagation(top.section("propagation")),
        **_objectives_and_limits(top, declared, reachable),
        money=money,
        notes=tuple(messages),
    )


def _objectives_and_limits(top: Section, declared: Declaration, reachable: bool) -> dict[str, Any]:
    """`objectives` and `limits` of a run, with `minimise` and `limits` of each condition among them."""
    objectives = read_objectives(top.section("objectives"), declared.outputs)
    limits = read_limits(top.section("limits"), declared.outputs, declared.variables)
    sections: dict[str, Section] = {}
    common = {output.name for output in declared.outputs} | {variable.name for variable in declared.variables}
    for section in top.items("condition") if declared.conditions else ():
        name = section.take("name")
        if name not in declared.conditions or name in sections:
            continue  # a fault of its own
        sections[name] = section
        prefix = f"{name}."
        own = [replace(o, name=o.name[len(prefix) :]) for o in declared.outputs if o.name.startswith(prefix)]
        section.accept(section.all_keys())
        more = tuple(prefix + name for name in read_objectives(section, own, "an output of a condition"))
        objectives = (objectives or declared.objectives) + more if more else objectives
        table = section.section("limits")
        for key in sorted(common.intersection(table.all_keys()).difference(o.name for o in own)):
            table.take(key)
            table.fault(key, "is the same in all conditions: limit it in the run's own [limits]")
        for name, bound in read_limits(table, own, ()).items():
            if prefix + name in limits:
                section.fault(f"limits.{name}", f"is given twice: here and as limits.{prefix}{name}")
            limits[prefix + name] = bound
    if sections:
        from .conditions import read_as_a_whole

        limits = read_as_a_whole(top, sections, declared, objectives, limits, reachable)
    return {"objectives": objectives, "limits": limits}


def _variables(section: Section, declared: Declaration, parameters: dict[str, Value]) -> dict[str, VariableSetting]:
    """Settings of the variables; a mid-limit is put into `parameters` as well, if it is one."""
    settings = {}
    for v in declared.variables:
        table = section.section(v.name)
        # a part of a stack, for which no curve is declared, has its machines in a table of its own
        table.accept(("machine",) if v.name in declared.machines and v.name in declared.costs else ())
        if (setting := read_variable(table, v, parameters)) is not None:
            settings[v.name] = setting
    section.finish()
    names = {p.name for p in declared.parameters}
    for name, setting in settings.items():
        if setting.mid is not None and mid_parameter(name) in names:
            parameters[mid_parameter(name)] = setting.mid
    return settings


def _read_model(top: Section, faults: list[Fault]) -> Configuration:
    """A configuration with a model alone, as `simulate` takes it."""
    if top.take("model") == TABLE:
        return read_table_model(top, _seed(top), faults)
    kind = load_named(top, "model", "models")
    seed, labels = _seed(top), read_labels(top)
    for key in PROBLEM_ONLY:
        if top.take(key) is not None:
            top.fault(key, "needs a problem: a model alone takes seed, parameters and variables")
    name = top.take("model")
    effects = read_effects(top, kind, name) + read_unresolved(top, kind, name)
    outputs = kind.outputs if kind else ()
    zero, sense, record = read_zero(top, outputs), read_sense(top, outputs), read_record(top)
    if kind is None:
        top.accept(("parameters", "variables", "columns"))
        top.finish()
        raise InputError(faults)
    parameters = kind.written(top)
    parameters |= read_parameters(top.section("parameters"), kind.parameters)
    variables = _variables(top.section("variables"), Declaration(kind.variables, (), kind.parameters), parameters)
    columns = read_model_columns(top, kind)
    for variable, setting in variables.items():
        if setting.low is not None or setting.high is not None:
            top.section("variables").fault(variable, "a model needs a value, not a range")
    top.finish()
    raise_all(faults)
    complete = {v.name: _fill_document_values(v, variables.get(v.name, VariableSetting())) for v in kind.variables}
    settings = Settings(
        parameters=completed(kind.parameters, parameters),
        variables=complete,
        seed=seed,
        effects=effects,
        zero=zero,
        sense=sense,
        labels=labels,
        columns=columns,
        record=record,
    )
    resolved = {
        "model": name,
        **labels.stated(),
        "seed": seed,
        "parameters": dict(settings.parameters),
        "variables": resolved_variables(complete, kind.variables),
        **resolved_measurement(settings),
    }
    return Configuration(model_name=name, settings=settings, resolved=resolved)


def _fill_document_values(variable: Any, setting: VariableSetting) -> VariableSetting:
    """The setting with the document's value and mid-limit where none is given."""
    value = variable.document if setting.value is None else setting.value
    return replace(setting, value=value, low=None, high=None, mid=variable.mid if setting.mid is None else setting.mid)


# The measurable model that a configuration asks for.


def build_model(configuration: Configuration) -> Any:
    """The model at the configuration's parameters; searched variables keep the document's value."""
    if not configuration.model_name:
        raise refuse("model", 'is missing: name a model (see `tolevo list`), model = "..."')
    if configuration.model_name == TABLE:
        return table_model(configuration.settings.definition, configuration.settings.gear)
    return registry.load("models", configuration.model_name)(**arguments_of(configuration))


def arguments_of(configuration: Configuration) -> dict[str, Any]:
    """The arguments of the registered model of a configuration: parameters, designs, inputs."""
    kind = registry.load("models", configuration.model_name)
    stated = configuration.settings
    settings = {v.name: (v, stated.variables[v.name]) for v in kind.variables if v.name in stated.variables}
    designs = {
        name: variable.document if setting.value is None else setting.value
        for name, (variable, setting) in settings.items()
    }
    known = {parameter.name for parameter in kind.parameters}
    parameters = {name: value for name, value in stated.parameters.items() if name in known}
    for name, (_, setting) in settings.items():
        mid = mid_parameter(name)
        if setting.centre is not None and mid in known:
            parameters[mid] = setting.centre
    return {
        "parameters": parameters,
        "designs": {name: value for name, value in designs.items() if value is not None},
        "inputs": {name: s.distribution for name, (_, s) in settings.items() if s.distribution},
    }


def rebuild_model(configuration: Configuration, parameters: Mapping[str, Any]) -> Any:
    """The model with some of its parameters changed; those of tables have dotted names, and a
    mid-limit is that of its variable as well.
    """
    changed = dict(configuration.settings.parameters)
    variables = dict(configuration.settings.variables)
    for name in variables:
        if (mid := parameters.get(mid_parameter(name))) is not None:
            variables[name] = replace(variables[name], mid=float(mid))
    for name, value in parameters.items():
        table, dot, key = name.partition(".")
        if dot:
            known = changed.get(table)
            changed[table] = {**(known if isinstance(known, Mapping) else {}), key: value}
        else:
            changed[name] = value
    settings = replace(configuration.settings, parameters=changed, variables=variables)
    return build_model(replace(configuration, settings=settings))
