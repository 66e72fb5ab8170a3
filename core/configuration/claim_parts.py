"""Parts common to all methods to recompute a claim: names, tables of configurations, units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import nearest
from ..section import Section
from ..units import converted
from ..workflows.reproduce.recipes import ByCalculation, ByModel, ByProblem, Constant, Derivative, Recipe
from .configuration import Configuration
from .reader import read_table


def names_of(section: Section, key: str, count: int, known: Mapping[str, Any]) -> tuple[str, ...]:
    """A name, or as many names as the claim prints; all must be in `known`, if given."""
    value = section.take(key)
    names = [value] if isinstance(value, str) else section.names(key)
    if names is None:
        if value is None:
            section.fault(key, "is missing: name the quantity that is compared with the printed value")
        return ()
    if count and len(names) != count:
        section.fault(key, f"must name {count} as `printed` does, got {len(names)}")
    for name in names:
        if known and name not in known:
            section.fault(key, f'"{name}" is not computed{nearest(name, known)}; known: {", ".join(known)}')
    return tuple(names)


def configured(section: Section, keys: tuple[str, ...]) -> Configuration | None:
    """The configuration in some keys of an interpretation; its faults are placed in the latter."""
    table = {key: section.take(key) for key in keys if key in section}
    return section.attempt(lambda: read_table(table, []))


def convertible(section: Section, recipe: Recipe, unit: str) -> None:
    """Report values whose unit, as far as it is known, cannot be stated in that of the claim."""
    for recipe_unit in units_of(recipe):
        try:
            converted(1.0, "" if recipe_unit == "1" else recipe_unit, "" if unit == "1" else unit)
        except ValueError as error:
            section.fault("", f"{recipe.by}: {error}")


def units_of(recipe: Recipe) -> tuple[str, ...]:
    """Units of the values of a recipe, those that are known before it computes."""
    match recipe:
        case Derivative():
            per = recipe.recipe.unit_of(recipe.name) or "1"
            return tuple(unit if per == "1" else f"({unit})/({per})" for unit in units_of(recipe.recipe))
        case Constant():
            return (recipe.unit,)
        case ByCalculation():
            known = {output.name: output.unit for output in recipe.kind.outputs}
            return tuple(known[name] or "1" for name in recipe.quantities if name in known)
        case ByModel():
            outputs = {output.name: output.unit for output in recipe.kind.outputs}
            return tuple(recipe.statistic.unit(outputs[name]) or "1" for name in recipe.outputs if name in outputs)
        case ByProblem():
            units = {output.name: output.unit for output in recipe.problem.outputs}
            return tuple(units[name] or "1" for name in recipe.outputs if name in units)
        case _:
            return ()
