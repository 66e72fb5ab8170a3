"""Reads a configuration: all sections are checked before any fault is raised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..algorithms.settings import AlgorithmSettings
from ..declarations import Value, completed
from ..errors import Fault, InputError, raise_all, refuse
from ..problems.declaration import Declaration
from ..problems.interfaces import Checks
from ..problems.settings import Settings, VariableSetting
from ..problems.slips import unit_slips
from ..problems.tolerance_problem import ToleranceProblem
from ..section import Range, Section
from ..workflows.choice.settings import ChoiceSettings
from ..workflows.choice.steps import rounding_faults
from .cells import with_poses
from .choice import read_choice, resolved_choice
from .configuration import Configuration
from .costs import check_ends, narrowed, read_costs
from .effects import read_effects
from .goals import read_limits, read_objectives, read_propagation
from .labels import read_labels
from .measured_files import with_files
from .model_columns import read_design_columns, read_model_columns
from .money import read_money
from .objects import with_choices
from .parameters import read_parameters
from .plugins import ModelClass, belongs, load_named, problem_of, stranger
from .reducers import with_reducers
from .resolved import complete_tables, resolved_measurement, resolved_variables
from .search import read_search, resolved_algorithm
from .senses import read_sense, read_zero
from .source import Source, Table, folder_of, overridden
from .table import TABLE, read_table_model
from .unresolved import read_unresolved
from .variables import mid_parameter, read_variable

REFERENCES = ("documents", "ga", "none")
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
)


def read(
    source: Source, overrides: Sequence[str] = (), algorithm: AlgorithmSettings | None = None, seed: int | None = None
) -> Configuration:
    """The configuration in a TOML file or dictionary, with `key=value` overrides applied.

    An `algorithm` and a `seed` take the place of its own. Raises InputError with every fault.
    """
    faults: list[Fault] = []
    return read_tables(with_choices(overridden(source, overrides, faults), algorithm, seed), folder_of(source), faults)


def read_tables(table: Table, folder: Path, faults: list[Fault]) -> Configuration:
    """`read_table` with the contents of the files that the tables name, relative to `folder`."""
    filled = with_files(table, folder, faults)
    return read_table(filled.table, faults, filled.notes, folder)


def read_table(
    table: Table, faults: list[Fault], notes: Sequence[str] = (), folder: Path = Path(), reachable: bool = True
) -> Configuration:
    """The configuration in the tables of a file; raises InputError with `faults` and its own.

    `notes` come from its files; files of other configurations are looked for in `folder`.
    Limits may be out of reach where they need not be `reachable`.
    """
    top = Section(table, "", faults)
    if "problem" in top or "model" not in top:
        return _read_problem(top, faults, notes, folder, reachable)
    return _read_model(top, faults)


def _seed(top: Section) -> int:
    seed = top.integer("seed", Range(low=0), None)
    return 0 if seed is None else seed


def _read_problem(
    top: Section, faults: list[Fault], notes: Sequence[str], folder: Path, reachable: bool
) -> Configuration:
    """A configuration with a problem."""
    if "problem" not in top and "claim" in top:
        raise refuse("claim", "makes this a file of claims: give it to `tolevo reproduce`, which checks it as well")
    if "problem" not in top:
        top.fault("problem", 'is missing: name a problem (see `tolevo list`), or model = "..."')
    problem_class = problem_of(top)
    top = with_poses(with_reducers(top, problem_class, folder), problem_class, folder)
    configured = problem_class.configured(top) if problem_class else None
    declared = configured.declaration if configured else Declaration()
    model = load_named(top, "model", "models", declared.model)
    model_name = top.take("model") or declared.model
    references = top.text("references", REFERENCES) or "documents"
    seed, labels = _seed(top), read_labels(top)
    effects = read_effects(top, model, model_name)
    read_unresolved(top, model, model_name)  # they act on measurements: an allocation has none
    outputs = model.outputs if model else ()
    zero, sense = read_zero(top, outputs), read_sense(top, outputs)
    if problem_class and model and not belongs(top.take("problem"), problem_class.declaration.model, model_name, model):
        top.fault("model", stranger(top.take("problem"), model_name, model))
    if configured is None:  # its sections cannot be checked
        tables = problem_class.declaration.tables if problem_class else ()
        top.accept(("parameters", "variables", "columns", *tables, *PROBLEM_ONLY))
        top.finish()
        raise InputError(faults)
    columns = read_design_columns(top, declared.variables)
    settings = replace(
        _settings(top, declared, model, notes),
        seed=seed,
        effects=effects,
        zero=zero,
        sense=sense,
        labels=labels,
        columns=columns,
    )
    objectives = settings.objectives or declared.objectives
    search = read_search(top.section("algorithm"), len(objectives), declared.algorithm)
    choice = read_choice(top, objectives, declared.outputs, declared.variables)
    top.finish()
    raise_all(faults)
    problem = configured(settings)
    _check_as_a_whole(problem, choice, search["algorithm_name"], reachable)
    assert search["algorithm"] is not None
    resolved = {
        **complete_tables(problem, top.take("problem"), model_name),
        "references": references,
        "algorithm": resolved_algorithm(*search.values()),
        **resolved_choice(choice),
    }
    return Configuration(
        model_name=model_name,
        settings=problem.settings,
        references=references,
        problem_name=top.take("problem"),
        problem=problem,
        choice=choice,
        resolved=resolved,
        **search,
    )


def _check_as_a_whole(problem: ToleranceProblem, choice: ChoiceSettings, algorithm: str, reachable: bool) -> None:
    """Raise InputError with every fault of a problem whose sections are valid."""
    beyond = [] if reachable else Checks.of(problem).out_of_reach()
    wrong = [fault for fault in problem.faults() if fault not in beyond]
    raise_all([*wrong, *(unit_slips(problem) if wrong else ()), *rounding_faults(problem, choice)])
    from ..workflows.run.contradictions import contradictions  # imports the exact solver

    raise_all(contradictions(problem, algorithm) if reachable else [])


def _settings(top: Section, declared: Declaration, model: ModelClass | None, notes: Sequence[str]) -> Settings:
    """The settings of a problem; parameters that only its model knows are accepted as well."""
    of_model = model.parameters if model else ()
    known = {p.name: p for p in (*of_model, *declared.parameters)}
    parameters = read_parameters(top.section("parameters"), known.values())
    variables = _variables(top.section("variables"), declared, parameters)
    costs = read_costs(top.section("costs"), declared.costs)
    unpriced = declared.unpriced(parameters)
    money, costs = read_money(top, costs, {name: c for name, c in declared.costs.items() if name not in unpriced})
    curves = dict(declared.costs) | costs
    messages = list(notes)
    for variable in declared.variables:
        name, curve = variable.name, curves.get(variable.name)
        narrower, note = narrowed(variable, variables.get(name), curve)
        if narrower is not None and note:
            variables[name] = narrower
            messages.append(note)
        check_ends(top.section("variables").section(name), variable, variables.get(name), curve)
    return Settings(
        parameters=parameters,
        variables=variables,
        costs=costs,
        propagation=read_propagation(top.section("propagation")),
        objectives=read_objectives(top.section("objectives"), declared.outputs),
        limits=read_limits(top.section("limits"), declared.outputs, declared.variables),
        money=money,
        notes=tuple(messages),
    )


def _variables(section: Section, declared: Declaration, parameters: dict[str, Value]) -> dict[str, VariableSetting]:
    """Settings of the variables; a mid-limit is put into `parameters` as well, if it is one."""
    settings = {}
    for v in declared.variables:
        table = section.section(v.name)
        table.accept(("machine",) if v.name in declared.machined else ())
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
    zero, sense = read_zero(top, outputs), read_sense(top, outputs)
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
    complete = {v.name: _at_document(v, variables.get(v.name, VariableSetting())) for v in kind.variables}
    settings = Settings(
        parameters=completed(kind.parameters, parameters),
        variables=complete,
        seed=seed,
        effects=effects,
        zero=zero,
        sense=sense,
        labels=labels,
        columns=columns,
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


def _at_document(variable: Any, setting: VariableSetting) -> VariableSetting:
    """The setting with the document's value and mid-limit where none is given."""
    value = variable.document if setting.value is None else setting.value
    return replace(setting, value=value, low=None, high=None, mid=variable.mid if setting.mid is None else setting.mid)
