"""Pages of the site with what problems, models and effects declare about themselves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from tolevo import registry
from tolevo.models.effects.effect import FAMILIES, Effect, EffectParameter, Target
from tolevo.models.effects.measurements import target_from, target_of
from tolevo.models.gear import RV_40E
from tolevo.models.manipulator.maps import ROWS
from tolevo.section import Output
from tolevo.testing import COLUMNS

NAMES = """# Variables, outputs and parameters

This page is generated from the declarations of the problems, models and
calculations (of `tolevo reproduce`). Variables are searched
between the stated ends unless `[variables.NAME]` says otherwise; the last column is the value of the
document, about a mid-limit that is not 0 where one is stated. Parameters are keys of `[parameters]`.
"Assumed" means that no document prints the value. Every output may be an objective or a limit, and
an output that is computed from a sample or a lattice has its numerical error in a column with the
same name and the ending `_error`.
"""
EFFECTS = """# The library of effects

This page is generated from the effects. [Effects](effects.md) describes the symbols, where an effect
acts, and what it changes in a problem. A parameter without a stated range may have either sign.
"""
Y = Output("reading_y", "y", "")
"""An output whose unit is called y, as the names of parameters have it."""


def of_the_project(group: str) -> list[str]:
    """The names in a group of plugins that belong to the project."""
    return [one["name"] for one in registry.listing()[group] if one["origin"].startswith("tolevo ")]


def names_page() -> str:
    """Variables, outputs, columns and parameters of all problems, models and calculations, as Markdown."""
    parts = [NAMES]
    for group, title in (("problems", "Problem"), ("models", "Model")):
        for name in of_the_project(group):
            kind = registry.load(group, name)
            parts += [f"## {title} `{name}`\n", *_declared(kind.declaration if group == "problems" else kind)]
    for name in of_the_project("calculations"):
        kind = registry.load("calculations", name)
        parts += [f"## Calculation `{name}`\n", f"{_text(kind.about)} ({_text(kind.reference)})\n", *_declared(kind)]
    rows = [f"| `{name}_{unit}` | {_text(meaning)} |" for name, unit, meaning in ROWS]
    parts += ["## Elementary errors of the manipulator\n", *_table("error | is", rows)]
    return "\n".join(parts)


def _declared(kind: Any) -> Iterable[str]:
    variables, columns, outputs, parameters = (
        members if isinstance(members := getattr(kind, name, ()), tuple) else ()
        for name in ("variables", "columns", "outputs", "parameters")
    )
    yield from _table("variable | unit | is | of | searched in | document", map(_variable, variables))
    yield from _table("column | unit | is", (_row(one.name, one.unit, _text(one.meaning)) for one in columns))
    stated = [one for one in outputs if not getattr(one, "error_of", "")]
    yield from _table("output | unit | is", (_row(one.name, one.unit, _text(one.meaning)) for one in stated))
    yield from _table("parameter | default | unit | is | from", map(_parameter, parameters))


def _variable(one: Any) -> str:
    printed = "" if one.document is None else f"{one.document:g}" + (f" about {one.mid:g}" if one.mid else "")
    remark = f" ({one.assumed})" if one.assumed else ""
    return _row(one.name, one.unit, str(one.kind), _text(one.meaning) + remark, f"{one.low:g} .. {one.high:g}", printed)


def _parameter(one: Any) -> str:
    reason = one.source.removeprefix("assumed").removeprefix(": ")
    source = f"assumed: {reason}".removesuffix(": ") if one.assumed else one.source
    return _row(one.name, _default(one.default), one.unit, _text(one.meaning), _text(source))


def _default(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    text = ", ".join(map(_default, value)) if isinstance(value, tuple) else str(value)
    return text if len(text) < 60 else "see `tolevo check`"


def effects_page() -> str:
    """Every effect of the project by family: cause, formula, parameters, needs, rivals, source."""
    effects = {name: registry.load("effects", name)() for name in of_the_project("effects")}
    parts = [EFFECTS]
    for family in FAMILIES:
        rows = [_effect(one) for one in effects.values() if one.family == family]
        head = "name | cause | what is added | parameters | needs | easily mistaken for"
        parts += [f"## {family}\n", *_table(head, rows)]
    sources = [f"- `{name}`: {one.reference}" for name, one in effects.items()]
    return "\n".join([*parts, "## Sources\n", *sources, ""])


def _effect(effect: Effect) -> str:
    numbers = "; ".join(_number(one) for one in effect.parameters(_target(effect)))
    if effect.name == "lot_offset":
        numbers = "`offset_<lot>_y` c of the lot of that label"
    rivals = ", ".join(f"`{one}`" for one in effect.mistaken_for) or "-"
    needs = ", ".join(effect.needs) or "-"
    return _row(effect.name, effect.cause.removesuffix("."), _text(effect.formula), numbers, needs, rivals)


def _target(effect: Effect) -> Target:
    """Where the effect acts: a table with every role, or the model that has a place for it."""
    if effect.family in ("manipulator", "assembly"):
        name = {"manipulator": "manipulator_pose"}.get(effect.family, effect.family)
        return target_of(registry.load("models", name), name)
    return replace(target_from("table", (Y,), COLUMNS), population=effect.family == "population", gear=RV_40E)


def _number(one: EffectParameter) -> str:
    ends = "" if one.linear and one.low < 0.0 else f", {one.low:g} .. {one.high:g}"
    listed = ", ".join(f"{choice:g}" for choice in one.choices)
    bounds = f", one of {listed}" if listed else ends.replace("0 .. inf", "at least 0")
    return f"`{one.name}` {one.meaning}{bounds}"


def _text(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _row(name: str, *cells: str) -> str:
    return f"| {' | '.join((f'`{name}`', *cells))} |"


def _table(head: str, rows: Iterable[str]) -> list[str]:
    lines = list(rows)
    return [f"| {head} |", "|" + "---|" * (head.count("|") + 1), *lines, ""] if lines else []
