"""What a plain pymoo problem declares: x1, x2, ... with their bounds, f1, ..., g1, ..., h1, ..."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice

import numpy as np
from pymoo.core.problem import Problem
from pymoo.core.variable import Integer

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
    """One variable per column: those that the problem declares as `variables`, else x1, x2, ..."""
    declared: tuple[Variable, ...] = getattr(problem, "variables", ())
    if declared:
        return tuple(declared)
    whole = problem.vtype in (int, bool, Integer)
    return tuple(
        Variable(f"x{at}", "", Kind.NOMINAL, low, high, f"variable {at}", integer=whole)
        for at, (low, high) in enumerate(zip(*_bounds(problem), strict=True), 1)
    )


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
    bounds = np.array(_bounds(problem))
    messages = []
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


def _bounds(problem: Problem) -> tuple[list[float], list[float]]:
    """Lower and upper bounds (variables,); NaN where there are none."""
    missing = np.full(int(problem.n_var), np.nan)
    low, high = (missing if end is None else np.broadcast_to(end, missing.shape) for end in (problem.xl, problem.xu))
    return np.asarray(low, dtype=float).tolist(), np.asarray(high, dtype=float).tolist()
