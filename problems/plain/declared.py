"""What a plain pymoo problem declares: x1, x2, ... with their bounds, f1, ..., g1, ..., h1, ..."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.problem import Problem
from pymoo.core.variable import Binary, Choice, Integer, Real

from ...arrays import Array
from ...declarations import Kind, Output, Parameter, Variable
from ...errors import Fault
from ..declaration import Declaration
from ..settings import Bound

MISSED = Parameter(
    "equality_tolerance", 1e-4, "", "how far an equality constraint may be missed", assumed=True, low=0.0, open_low=True
)


def declaration_of(problem: Problem) -> Declaration:
    """Variables, outputs and objectives; a tolerance where there are equality constraints."""
    parameters = (MISSED,) if problem.n_eq_constr else ()
    return Declaration(variables_of(problem), outputs_of(problem), parameters, objectives=names_of(problem)["F"])


def variables_of(problem: Problem) -> tuple[Variable, ...]:
    """One variable per column: those that the problem declares as `variables`, those of pymoo's
    mixed `vars` by their names, else x1, x2, ...
    """
    declared: tuple[Variable, ...] = getattr(problem, "variables", ())
    if declared:
        return tuple(declared)
    if mixed := mixed_variables(problem):
        return tuple(_mixed(str(name), variable) for name, variable in mixed.items())
    whole = problem.vtype in (int, bool, Integer)
    return tuple(
        Variable(f"x{at}", "", Kind.NOMINAL, low, high, f"variable {at}", integer=whole)
        for at, (low, high) in enumerate(zip(*_bounds(problem), strict=True), 1)
    )


def mixed_variables(problem: Problem) -> Mapping[Any, Any]:
    """Pymoo's mixed `vars` by name, empty where a problem has a plain vector of variables."""
    variables: Mapping[Any, Any] = getattr(problem, "vars", None) or {}
    return variables


def _mixed(name: str, variable: Any) -> Variable:
    """A variable of pymoo's mixed `vars`; options of a choice are 0, 1, ... with their texts as labels."""
    if isinstance(variable, Choice):
        labels = tuple(map(str, variable.options))
        return Variable(name, "", Kind.CHOICE, 0, len(labels) - 1, f"choice {name}", integer=True, labels=labels)
    low, high = (0.0, 1.0) if isinstance(variable, Binary) else map(float, variable.bounds)
    return Variable(name, "", Kind.NOMINAL, low, high, f"variable {name}", integer=not isinstance(variable, Real))


def mixed_designs(problem: Problem, designs: Array) -> NDArray[Any]:
    """Designs (n, variables) as a problem with mixed `vars` takes them: a dictionary each."""
    columns: dict[str, list[Any]] = {}
    for (name, variable), column in zip(mixed_variables(problem).items(), designs.T, strict=True):
        if isinstance(variable, Choice):
            columns[name] = [variable.options[int(at)] for at in column]
        else:
            kind = bool if isinstance(variable, Binary) else int if isinstance(variable, Integer) else float
            columns[name] = [kind(value) for value in column.tolist()]
    rows = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    return np.array(rows, dtype=object)


def outputs_of(problem: Problem) -> tuple[Output, ...]:
    """Objectives, inequality and equality constraints: as declared, else f1, ..., g1, ..., h1."""
    declared: tuple[Output, ...] = getattr(problem, "outputs", ())
    names = names_of(problem)
    meanings = {name: f"objective {name[1:]}" for name in names["F"]}
    meanings |= {name: f"constraint {name[1:]}: at most 0" for name in names["G"]}
    meanings |= {name: f"constraint {name[1:]}: equal to 0" for name in names["H"]}
    return tuple(declared) or tuple(Output(n, "", text) for n, text in meanings.items())


def names_of(problem: Problem) -> dict[str, tuple[str, ...]]:
    """Names of the objectives F, and of the constraints G (inequalities) and H (equalities)."""
    counts = {"F": int(problem.n_obj), "G": int(problem.n_ieq_constr), "H": int(problem.n_eq_constr)}
    usual = [f"{kind.lower()}{at}" for kind, count in counts.items() for at in range(1, count + 1)]
    declared: tuple[Output, ...] = getattr(problem, "outputs", ())
    names = iter([output.name for output in declared] or usual)
    return {kind: tuple(islice(names, count)) for kind, count in counts.items()}


def limits_of(problem: Problem, missed: float) -> Mapping[str, Bound]:
    """The constraints as limits: g <= 0, and h = 0 but for `missed`."""
    names = names_of(problem)
    return dict.fromkeys(names["G"], Bound(high=0.0)) | dict.fromkeys(names["H"], Bound(-missed, missed))


def faults_of(problem: Problem) -> list[Fault]:
    """What keeps a pymoo problem from being run, at the key `problem`."""
    mixed = mixed_variables(problem)
    messages = _mixed_faults(mixed)
    bounds = np.zeros((2, 0)) if mixed else np.array(_bounds(problem))
    if not (np.all(np.isfinite(bounds)) and np.all(bounds[0] < bounds[1])):
        messages.append("needs finite bounds xl < xu of every variable")
    for name, count in (
        ("variables", problem.n_var),
        ("outputs", problem.n_obj + problem.n_ieq_constr + problem.n_eq_constr),
    ):
        if (declared := getattr(problem, name, ())) and len(declared) != count:
            messages.append(f"declares {len(declared)} {name}, but has {count}")
    if problem.n_obj < 1:
        messages.append("has no objective")
    return [Fault("problem", f"{type(problem).__name__} {text}") for text in messages]


def _mixed_faults(variables: Mapping[Any, Any]) -> list[str]:
    """What keeps pymoo's mixed `vars` from being searched."""
    messages = []
    for name, variable in variables.items():
        if not isinstance(variable, Real | Integer | Binary | Choice):
            messages.append(
                f"has the variable {name} of the kind {type(variable).__name__}: state Real or another of pymoo's"
            )
        elif isinstance(variable, Choice):
            texts = list(map(str, variable.options))
            if len(set(texts)) < max(2, len(texts)) or "" in texts:
                messages.append(f"has the choice {name} with the options {texts}: state two or more that differ")
        elif isinstance(variable, Real | Integer):
            ends = [np.nan if end is None else float(end) for end in variable.bounds]
            if not (np.all(np.isfinite(ends)) and ends[0] < ends[1]):
                messages.append(f"needs finite bounds of the variable {name}, the lower below the upper")
    return messages


def _bounds(problem: Problem) -> tuple[list[float], list[float]]:
    """Lower and upper bounds (variables,); NaN where there are none."""
    missing = np.full(int(problem.n_var), np.nan)
    low, high = (missing if end is None else np.broadcast_to(end, missing.shape) for end in (problem.xl, problem.xu))
    return np.asarray(low, dtype=float).tolist(), np.asarray(high, dtype=float).tolist()
