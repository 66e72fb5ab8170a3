"""What a plain pymoo problem declares: x1, x2, ... with their bounds, f1, ..., g1, ..., h1, ..."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pymoo.core.problem import Problem
from pymoo.core.variable import Integer

from ...declarations import Kind, Output, Parameter, Variable
from ...errors import Fault
from ..settings import Bound

MISSED = Parameter(
    "equality_tolerance",
    1e-4,
    "",
    "how far an equality constraint may be missed",
    assumed=True,
    low=0.0,
    open_low=True,
)


def parameters_of(own: Problem) -> tuple[Parameter, ...]:
    """The tolerance of equality constraints, where there are any."""
    return (MISSED,) if own.n_eq_constr else ()


def variables_of(own: Problem) -> tuple[Variable, ...]:
    """One variable per column: those that the problem declares as `variables`, else x1, x2, ..."""
    declared: tuple[Variable, ...] = getattr(own, "variables", ())
    if declared:
        return tuple(declared)
    whole = own.vtype in (int, bool, Integer)
    return tuple(
        Variable(f"x{at}", "", Kind.NOMINAL, low, high, f"variable {at}", integer=whole)
        for at, (low, high) in enumerate(zip(*_bounds(own), strict=True), 1)
    )


def outputs_of(own: Problem) -> tuple[Output, ...]:
    """Objectives, inequality and equality constraints: as declared, else f1, ..., g1, ..., h1."""
    declared: tuple[Output, ...] = getattr(own, "outputs", ())
    meanings = {name: f"objective {name[1:]}" for name in objectives_of(own)}
    meanings |= {name: f"constraint {name[1:]}: at most 0" for name in inequalities_of(own)}
    meanings |= {name: f"constraint {name[1:]}: equal to 0" for name in equalities_of(own)}
    return tuple(declared) or tuple(Output(n, "", text) for n, text in meanings.items())


def objectives_of(own: Problem) -> tuple[str, ...]:
    """Names of the objectives, in the order of F."""
    return _names(own, "f", 0, int(own.n_obj))


def inequalities_of(own: Problem) -> tuple[str, ...]:
    """Names of the inequality constraints, in the order of G."""
    return _names(own, "g", int(own.n_obj), int(own.n_ieq_constr))


def equalities_of(own: Problem) -> tuple[str, ...]:
    """Names of the equality constraints, in the order of H."""
    return _names(own, "h", int(own.n_obj) + int(own.n_ieq_constr), int(own.n_eq_constr))


def limits_of(own: Problem, missed: float) -> Mapping[str, Bound]:
    """What the constraints say: g <= 0, and h = 0 but for `missed`."""
    return {name: Bound(high=0.0) for name in inequalities_of(own)} | {
        name: Bound(-missed, missed) for name in equalities_of(own)
    }


def faults_of(own: Problem) -> list[Fault]:
    """What keeps a pymoo problem from being run, at the key `problem`."""
    bounds = np.array(_bounds(own))
    found = []
    if not (np.all(np.isfinite(bounds)) and np.all(bounds[0] < bounds[1])):
        found.append("needs finite bounds xl < xu of every variable")
    for name, count in (
        ("variables", own.n_var),
        ("outputs", own.n_obj + own.n_ieq_constr + own.n_eq_constr),
    ):
        if (declared := getattr(own, name, ())) and len(declared) != count:
            found.append(f"declares {len(declared)} {name}, but has {count}")
    if own.n_obj < 1:
        found.append("has no objective")
    return [Fault("problem", f"{type(own).__name__} {text}") for text in found]


def _names(own: Problem, letter: str, start: int, count: int) -> tuple[str, ...]:
    declared: tuple[Output, ...] = getattr(own, "outputs", ())
    if declared:
        return tuple(one.name for one in declared[start : start + count])
    return tuple(f"{letter}{at}" for at in range(1, count + 1))


def _bounds(own: Problem) -> tuple[list[float], list[float]]:
    """Lower and upper bounds (variables,); NaN where there are none."""
    missing = np.full(int(own.n_var), np.nan)
    low, high = (
        missing if end is None else np.broadcast_to(end, missing.shape) for end in (own.xl, own.xu)
    )
    return np.asarray(low, dtype=float).tolist(), np.asarray(high, dtype=float).tolist()
