"""A plain pymoo problem as a problem of this suite."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.problem import Problem
from pymoo.core.variable import Binary, Choice, Integer, Real

from ..errors import Fault, raise_all, refuse
from ..section import Array, Kind, Output, Parameter, Section, Variable, number
from .declaration import ConfiguredProblem, Declaration
from .settings import Bound, Settings
from .tolerance_problem import ToleranceProblem

__all__ = ["PlainKind", "PlainProblem", "plain_kind"]

# What a plain pymoo problem declares: x1, x2, ... with their bounds, f1, ..., g1, ..., h1, ...


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
        return tuple(_mixed_variable(str(name), variable) for name, variable in mixed.items())
    whole = problem.vtype in (int, bool, Integer)
    return tuple(
        Variable(f"x{at}", "", Kind.NOMINAL, low, high, f"variable {at}", integer=whole)
        for at, (low, high) in enumerate(zip(*_bounds(problem), strict=True), 1)
    )


def mixed_variables(problem: Problem) -> Mapping[Any, Any]:
    """Pymoo's mixed `vars` by name, empty where a problem has a plain vector of variables."""
    variables: Mapping[Any, Any] = getattr(problem, "vars", None) or {}
    return variables


def _mixed_variable(name: str, variable: Any) -> Variable:
    """A variable of pymoo's mixed `vars`; options of a choice are 0, 1, ... with their texts as labels."""
    if isinstance(variable, Choice):
        labels = tuple(map(str, variable.options))
        return Variable(name, "", Kind.CHOICE, 0, len(labels) - 1, f"choice {name}", integer=True, labels=labels)
    low, high = (0.0, 1.0) if isinstance(variable, Binary) else map(float, variable.bounds)
    return Variable(name, "", Kind.NOMINAL, low, high, f"variable {name}", integer=not isinstance(variable, Real))


def designs_as_dictionaries(problem: Problem, designs: Array) -> NDArray[Any]:
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


# A plain pymoo problem with names, limits and settings.


SPREAD = 6
"""Binary logarithm of the designs whose objectives span the box of the hypervolume."""


class PlainProblem(ToleranceProblem):
    """A pymoo `Problem` as it is: its objectives are minimised, its constraints are limits.

    Names and units are x1, ..., f1, ..., g1, ..., h1, ... without units unless the problem declares
    `variables` and `outputs` (tuples of `Variable` and `Output`). It needs no cost. Nothing is
    proven of it.
    """

    def __init__(self, pymoo_problem: Problem, settings: Settings | None = None) -> None:
        self.pymoo_problem = pymoo_problem
        self.declaration = declaration_of(pymoo_problem)
        self._known: dict[tuple[float, ...], Array] = {}
        super().__init__(settings)

    def _completed(self, given: Settings) -> Settings:
        missed = number(given.parameters.get(MISSED.name, MISSED.default))
        limits = dict(limits_of(self.pymoo_problem, missed)) | dict(given.limits)
        return super()._completed(replace(given, limits=limits))

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        names = [name for group in names_of(self.pymoo_problem).values() for name in group]
        if not all(variable.integer for variable in self.variables):
            return dict(zip(names, self._evaluated(designs).T, strict=True))
        keys = list(map(tuple, designs.tolist()))  # designs of whole numbers come again and again
        new = [key for key in dict.fromkeys(keys) if key not in self._known]
        if new:
            self._known.update(zip(new, self._evaluated(np.array(new)), strict=True))
        values = np.array([self._known[key] for key in keys]).reshape(len(keys), len(names))
        return dict(zip(names, values.T, strict=True))

    def _evaluated(self, designs: Array) -> Array:
        """Objectives and constraints (n, all) of designs (n, variables), by pymoo's problem."""
        x = designs_as_dictionaries(self.pymoo_problem, designs) if mixed_variables(self.pymoo_problem) else designs
        values = self.pymoo_problem.evaluate(x, return_as_dictionary=True)
        used = [key for key, names in names_of(self.pymoo_problem).items() if names]
        return np.concatenate([np.asarray(values[key], dtype=float).reshape(len(x), -1) for key in used], axis=1)

    def _corners(self) -> Array:
        """The corners, and designs between them: extremes need not lie at the corners."""
        from scipy.stats import qmc  # takes long to import

        inside = qmc.Sobol(len(self.free), scramble=False).random_base2(SPREAD)
        between = self.complete(self.xl + inside * (self.xu - self.xl))
        return np.concatenate([super()._corners(), between])

    def relaxed(self, limits: Mapping[str, Bound]) -> PlainProblem:
        """The same problem with some limits replaced."""
        return PlainProblem(self.pymoo_problem, replace(self.given, limits={**self.given.limits, **limits}))

    def without_effects(self) -> PlainProblem:
        """The same problem: effects have no place in it."""
        return PlainProblem(self.pymoo_problem, replace(self.given, effects=()))


# What a configuration that names a plain pymoo problem declares.


@dataclass(frozen=True, eq=False)
class PlainKind:
    """A pymoo problem in the place of a class of problems."""

    pymoo_problem: Problem

    @property
    def declaration(self) -> Declaration:
        """Variables, outputs and objectives as the problem declares them."""
        return declaration_of(self.pymoo_problem)

    def configured(self, top: Section) -> ConfiguredProblem:
        """The problem: it reads no further table."""
        return ConfiguredProblem(self.declaration, partial(PlainProblem, self.pymoo_problem))


def plain_kind(given: Any) -> PlainKind:
    """The kind of a pymoo problem, or of a class of them that is made without arguments.

    Raises InputError, at `problem`, where it is none or cannot be run.
    """
    name = given.__name__ if isinstance(given, type) else type(given).__name__
    if isinstance(given, type) and issubclass(given, Problem):
        try:
            given = given()
        except Exception as error:  # code of a foreign class
            text = f"{name} cannot be made without arguments ({type(error).__name__}: {error}): give an object"
            raise refuse("problem", text) from error
    if not isinstance(given, Problem):
        raise refuse("problem", f"{name} is no problem: it must be a ToleranceProblem or a pymoo Problem")
    raise_all(faults_of(given))
    return PlainKind(given)
