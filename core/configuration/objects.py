"""Objects in the place of names: a problem or an algorithm in a dictionary of a configuration."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import tomli_w

from .. import registry
from ..algorithms.settings import AlgorithmSettings, Budget
from ..problems.plain import PlainProblem
from ..problems.tolerance_problem import ToleranceProblem
from .merging import merge
from .named import Named
from .resolved import complete_tables

KEPT = (*(field.name for field in fields(Budget)), "engine")
"""Keys of `[algorithm]` that are not of the algorithm."""


def with_names(tables: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with names and settings in the place of objects.

    A problem of this suite becomes the tables that describe it, which the other given tables
    override; any other object becomes a name that keeps the object. An algorithm becomes its table.
    """
    described, problem = dict(tables), tables.get("problem")
    if isinstance(problem, PlainProblem):
        described["problem"] = Named.of(problem.pymoo_problem)
    elif isinstance(problem, ToleranceProblem):
        stated = {key: value for key, value in described.items() if key != "problem"}
        merge(described := _described(problem), stated, whole=True)
    elif problem is not None and not isinstance(problem, str):
        described["problem"] = Named.of(problem)
    if isinstance(algorithm := described.get("algorithm"), AlgorithmSettings):
        described["algorithm"] = algorithm_table(algorithm)
    return described


def algorithm_table(algorithm: AlgorithmSettings) -> dict[str, Any]:
    """The `[algorithm]` table of an algorithm's settings."""
    settings: dict[str, Any] = asdict(algorithm)  # type: ignore[call-overload]
    return {"name": registry.name_of("algorithms", type(algorithm)), **settings}


def _described(problem: ToleranceProblem) -> dict[str, Any]:
    """The tables that make a problem again, as a file has them."""
    name = registry.name_of("problems", type(problem))
    return tomllib.loads(tomli_w.dumps(complete_tables(problem, name, problem.declaration.model)))


def with_choices(table: dict[str, Any], algorithm: AlgorithmSettings | None, seed: int | None) -> dict[str, Any]:
    """The tables with another algorithm and seed, where they are given; budget and engine stay."""
    chosen: dict[str, Any] = {} if seed is None else {"seed": seed}
    if algorithm is not None:
        stated = table.get("algorithm", {})
        kept = {key: stated[key] for key in KEPT if isinstance(stated, dict) and key in stated}
        chosen["algorithm"] = algorithm_table(algorithm) | kept
    return table | chosen
