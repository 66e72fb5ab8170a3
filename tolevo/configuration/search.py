"""`[algorithm]`: the algorithm with its settings, and when it ends."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass, replace
from math import inf
from typing import TYPE_CHECKING, Any, get_type_hints

from .. import registry
from ..algorithms.settings import CROSSOVERS, ENGINES, MUTATIONS, REFUSED, AlgorithmSettings, Budget
from ..arguments import choice_faults
from ..errors import Fault
from ..section import BLOCK_ROWS, EVALUATIONS, GENERATIONS, PLAIN, POINTS, POSITIVE, Range, Section, too_many
from .plugins import load_named
from .source import EXECUTION, Source, parsed_tables

if TYPE_CHECKING:
    from ..execution import Execution

MAX_DEFAULT_OBJECTIVES = 2
"""Objectives up to which a problem's own algorithm is the default."""
DEFAULT_GENERATIONS = 200
"""Budget of a run whose configuration states none."""


def read_search(section: Section, objectives: int, default: str) -> dict[str, Any]:
    """`[algorithm]`: what a `Configuration` holds of it."""
    budget = read_budget(section)
    name, algorithm = read_algorithm(section, objectives, default)
    check_size(section, algorithm, budget)
    engine = read_engine(section, name, algorithm)
    return {"algorithm_name": name, "algorithm": algorithm, "engine": engine, "budget": budget}


def read_algorithm(section: Section, objectives: int, default: str = "") -> tuple[str, AlgorithmSettings | None]:
    """Name and instance of the algorithm; by default see `default_algorithm`."""
    name = default_algorithm(section.all_keys(), objectives, default)
    kind = None if _is_refused(section) else load_named(section, "name", "algorithms", name)
    name = section.take("name") or name
    section.accept(["engine"])
    if kind is None or "points" not in {field.name for field in fields(kind)}:
        section.integer("points", Range(low=2), POINTS)  # of the exact front, whichever algorithm runs
    section.accept(field.name for field in fields(Budget))
    if kind is None:  # the settings of an unknown algorithm cannot be checked
        return name, None
    if not kind.many_objectives and objectives != 1:
        section.fault("name", f"{name} takes exactly one objective, [objectives] minimise names {objectives}")
    elif kind.many_objectives and not kind.one_objective and objectives == 1:
        section.fault("name", f"{name} needs two or more objectives, got 1: use ga")
    algorithm = settings_of(section, kind)
    for fault in algorithm.faults(objectives):
        section.fault(fault.place, fault.message)
    return name, algorithm


def default_algorithm(stated: Iterable[str], objectives: int, problem_default: str) -> str:
    """The problem's own algorithm, where it has one for so many objectives; else NSGA-II or the GA.

    NSGA-II or the GA are also chosen where the `stated` keys of `[algorithm]` are theirs alone.
    """
    evolution = "ga" if objectives == 1 else "nsga2"
    if not problem_default or objectives > MAX_DEFAULT_OBJECTIVES:
        return evolution
    keys, evolution_keys = (_keys(name) for name in (problem_default, evolution))
    relevant = set(stated) & (evolution_keys | {"generations", "engine"})
    return problem_default if relevant <= keys else evolution


def _keys(name: str) -> set[str]:
    """The settings of an algorithm."""
    return {field.name for field in fields(registry.load("algorithms", name))}


def _is_refused(section: Section) -> bool:
    """Whether the name is one of pymoo's that are not offered, with a fault that says why."""
    name = section.take("name")
    if not isinstance(name, str) or name not in REFUSED or name in registry.names("algorithms"):
        return False
    reason, instead = REFUSED[name]
    section.fault("name", f"{name} of pymoo is not offered: {reason}; use {instead}")
    return True


def settings_of(section: Section, kind: type[Any]) -> Any:
    """An instance of the dataclass `kind` whose fields are the keys of `section`."""
    hints, values = get_type_hints(kind), {}
    for field in fields(kind):
        if is_dataclass(hints[field.name]):
            values[field.name] = settings_of(section.section(field.name), hints[field.name])
            continue
        within = Range(field.metadata.get("low", -inf), field.metadata.get("high", inf))
        if hints[field.name] is bool:
            value: Any = section.flag(field.name)
        elif hints[field.name] is int:
            value = section.integer(field.name, within, field.metadata.get("need", PLAIN))
        elif hints[field.name] is str:
            value = section.text(field.name, field.metadata.get("choices", ()))
        else:
            value = section.number(field.name, within=within)
        if value is not None:
            values[field.name] = value
    section.finish()
    return kind(**values)


def read_engine(section: Section, name: str, algorithm: AlgorithmSettings | None) -> str:
    """What runs the algorithm: pymoo, or plain arrays where it has an engine on arrays."""
    engine = section.text("engine", ("pymoo", "array")) or "pymoo"
    if engine == "array" and algorithm is not None and not algorithm.array_engine:
        known = ", ".join(ENGINES)
        section.fault("engine", f'{name} has no array engine: choose one of {known}, or engine = "pymoo"')
    elif engine == "array":
        for key, supported in (("crossover", CROSSOVERS[0]), ("mutation", MUTATIONS[0])):
            operator = getattr(getattr(algorithm, key, None), "operator", supported)
            if operator != supported:
                section.fault(
                    f"{key}.operator",
                    f'the array engine has {supported} only, got "{operator}": use it, or engine = "pymoo"',
                )
    return engine


def read_budget(section: Section) -> Budget:
    """When the search ends."""
    whole = Range(low=1)
    budget = Budget(
        section.integer("generations", whole, GENERATIONS),
        section.integer("evaluations", whole, EVALUATIONS),
        section.number("time_limit_s", within=POSITIVE),
    )
    return Budget(generations=DEFAULT_GENERATIONS) if budget == Budget() else budget


def check_size(section: Section, algorithm: AlgorithmSettings | None, budget: Budget) -> None:
    """A fault where generations and population together are too many evaluations."""
    if not budget.generations or evaluations(algorithm, budget) == budget.evaluations:
        return
    population = getattr(algorithm, "population", 1)
    if complaint := too_many(budget.generations, EVALUATIONS, population, "generations x population"):
        section.fault("generations", complaint)


def evaluations(algorithm: AlgorithmSettings | None, budget: Budget) -> int:
    """Evaluations that a search may take at most, as far as its settings say."""
    by_generations = (budget.generations or 0) * getattr(algorithm, "population", 1)
    return min((limit for limit in (by_generations, budget.evaluations) if limit), default=0)


def resolved_algorithm(name: str, algorithm: AlgorithmSettings, engine: str, budget: Budget) -> dict[str, Any]:
    """The `[algorithm]` table that states all of this."""
    limits = {key: value for key, value in asdict(budget).items() if value is not None}
    table: dict[str, Any] = asdict(algorithm)  # type: ignore[call-overload]
    return {"name": name, "engine": engine} | limits | table


# `[execution]`: where a command computes; the results do not depend on it.
#
# The table is taken out before anything else is read, so that neither the resolved configuration nor
# its hash contains it.


GONE = (
    "is no key any more: machines no longer share a database; leave it out, and name a Dask scheduler by "
    "execution.dask or --dask, whose workers may be on any machines"
)


class Usual(int):
    """A command's default number of processes, which a configuration may override."""


def read_execution(source: Source, overrides: Sequence[str], options: Execution) -> tuple[Execution, list[Fault]]:
    """Where to compute: by the `options` or, where they state nothing, by the configuration.

    Returns every fault, including those of a Dask scheduler that does not answer. A configuration
    that cannot be read at all is reported by its own reader.
    """
    from ..execution import unreachable

    faults: list[Fault] = []
    tables = parsed_tables(source, overrides)
    section = Section(tables, "", faults).section(EXECUTION)
    dask = section.text("dask") or ""
    workers = section.integer("workers", Range(low=1), None)
    block_rows = section.integer("block_rows", Range(low=1), BLOCK_ROWS)
    if isinstance(stated := tables.get(EXECUTION), Mapping) and "store" in stated:
        section.accept(["store"])
        section.fault("store", GONE)
    section.finish()
    if dask and workers is not None:
        section.fault("dask", "is a scheduler with its own workers; leave out workers")
    workers_faults = choice_faults(workers, False, False, section.place("workers"))
    faults += [fault for fault in workers_faults if fault not in faults] + _option_faults(options)
    execution = options
    if not options.dask and (options.workers is None or isinstance(options.workers, Usual)):
        if dask:
            execution = replace(execution, workers=None, dask=dask, dask_place=section.place("dask"))
        elif workers is not None:
            execution = replace(execution, workers=workers)
    if options.dask and isinstance(options.workers, Usual):
        execution = replace(execution, workers=None)
    if execution.block_rows is None and block_rows is not None:
        execution = replace(execution, block_rows=block_rows)
    faults += unreachable(execution)
    return execution, faults


def _option_faults(options: Execution) -> list[Fault]:
    """What is wrong with options."""
    faults = []
    if options.block_rows is not None and options.block_rows < 1:
        faults.append(Fault("--block-rows", f"must be at least 1, got {options.block_rows}"))
    if options.dask and options.workers is not None and not isinstance(options.workers, Usual):
        faults.append(Fault("--dask", "is a scheduler with its own workers; leave out --workers"))
    return faults
