"""Names in a configuration that stand for plugins or objects, merging of tables, labels of the mechanism, and
the `[zero]` and `[sense]` of measured outputs.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from functools import partial
from typing import Any

from .. import registry
from ..errors import nearest
from ..models.measurable import MeasurableModel
from ..problems.plain import PlainKind, plain_kind
from ..problems.settings import Labels
from ..problems.tolerance_problem import ToleranceProblem
from ..section import Output, Section, shown


class Named(str):
    """The name of an object, as configurations write it, and the object itself."""

    original: Any
    __slots__ = ("original",)

    @classmethod
    def of(cls, original: Any) -> Named:
        """An object, named by the path of its class."""
        kind = original if isinstance(original, type) else type(original)
        named = cls(f"{kind.__module__}:{kind.__qualname__}")
        named.original = original
        return named

    def __deepcopy__(self, memo: dict[int, Any]) -> Named:
        return self


# Merging of tables: `--set`, and keys given in addition to an object, change a configuration.


INSTEAD = {"value": ("low", "high"), **dict.fromkeys(("low", "high"), ("value",)), "tolerance": ("t_min", "t_max")}
"""Keys that are removed when another is set: a fixed value replaces a range, and the reverse."""


def merge(table: dict[str, Any], over: Mapping[str, Any], whole: bool = False) -> bool:
    """Put the values of `over` into `table`, tables into tables.

    A table of a list is that of its name, part.NAME.key; so is a single one, requirement.NAME.key.
    False where a table meets a value, or a list has none of that name; if `whole`, it takes the place
    of that value.
    """
    for key, value in over.items():
        inner = table.get(key)
        meets = isinstance(value, dict) and bool(value) and key in table
        if meets and not whole and (named := named_tables(inner)).keys() & value.keys():
            known = all(name in named and isinstance(own, dict) for name, own in value.items())
            if not (known and all(merge(named[name], own) for name, own in value.items())):
                return False
            continue
        if meets and isinstance(inner, dict):
            if not merge(inner, value, whole):
                return False
            continue
        if meets and not whole:
            return False
        for replaced in INSTEAD.get(key, ()):
            table.pop(replaced, None)
        table[key] = value
    return True


def named_tables(value: object) -> dict[str, dict[str, Any]]:
    """The tables of a list, or a single one, by the text of their `name`."""
    tables = value if isinstance(value, list) else [value]
    return {t["name"]: t for t in tables if isinstance(t, dict) and isinstance(t.get("name"), str)}


# Names in a configuration that stand for registered models, problems, algorithms, effects, and
# the problems that a model belongs to.


ModelClass = type[MeasurableModel]
ProblemClass = type[ToleranceProblem] | PlainKind


def load_named(section: Section, key: str, group: str, default: str = "") -> Any:
    """The class that `key` names in the registry `group`, or the object given in its place.

    None, and a fault, where there is neither.
    """
    name = section.text(key)
    if name is None:
        if key in section or not default:
            return None
        name = default
    if isinstance(name, Named):
        return name.original
    return section.attempt(partial(registry.load, group, name), lambda fault: (key, fault.message))


def problem_of(top: Section) -> ProblemClass | None:
    """The class that `problem` names: of this suite, or a wrapper of a plain pymoo problem."""
    loaded = load_named(top, "problem", "problems")
    if loaded is None:
        return None
    if isinstance(loaded, type) and issubclass(loaded, ToleranceProblem):
        return loaded
    return top.attempt(partial(plain_kind, loaded), lambda fault: ("problem", fault.message))


def model_belongs(problem: str, problem_model: str, model: str, measured: ModelClass) -> bool:
    """Whether a correction of the model named `model` applies to `problem`, whose own model is
    `problem_model`.
    """
    return problem_model == model or problem in measured.corrects


def foreign_model_message(problem: str, model: str, measured: ModelClass) -> str:
    """The message for a problem that a model does not belong to."""
    corrected = " or ".join(f'"{name}"' for name in measured.corrects)
    reason = f"it corrects {corrected}" if corrected else "it corrects none (`simulate` takes it)"
    return f'the model {model} does not belong to the problem "{problem}": {reason}'


# Reads `name`, `description` and `drawing` of the mechanism that a configuration is about.


KEYS = ("name", "description", "drawing")


def read_labels(top: Section) -> Labels:
    """Labels of the mechanism; empty where the configuration states none."""
    return Labels(*(top.text(key) or "" for key in KEYS))


# `[zero]` and `[sense]`: the offset and the sign of the measurements of an output.


ZERO, SENSE, RECORD = "zero", "sense", "record"
EITHER = (-1, 1)


def read_zero(top: Section, outputs: Iterable[Output]) -> dict[str, float]:
    """The offset of an instrument where the model predicts zero, in the unit of its output; names
    of no output are faults.
    """
    section, known = top.section(ZERO), {output.name: output.unit for output in outputs}
    zeros = {name: section.number(name, unit) for name, unit in known.items() if name in section}
    _check_names(section, known, "")
    return {name: value for name, value in zeros.items() if value is not None}


def read_record(top: Section) -> dict[str, tuple[float, float]]:
    """The least and largest value of each input in the measurements that the effects were found in."""
    section, ranges = top.section(RECORD), dict[str, tuple[float, float]]()
    for name in section.all_keys():
        ends = section.take(name)
        if isinstance(ends, list) and len(ends) == 2 and all(type(end) in (int, float) for end in ends):
            ranges[name] = float(min(ends)), float(max(ends))
        else:
            section.fault(name, f"must be its least and largest value, as [10.0, 300.0], got {shown(ends)}")
    return ranges


def read_sense(top: Section, outputs: Iterable[Output]) -> dict[str, int]:
    """The sense that is given of each output, -1 where a positive measurement means the opposite of
    the convention; names of no output are faults.
    """
    section, known = top.section(SENSE), [output.name for output in outputs]
    senses = {name: sign_of(section, name) for name in section.all_keys()}
    _check_names(section, known, f"; outputs: {', '.join(known)}" if known else "")
    return {name: sense for name, sense in senses.items() if sense is not None and name in known}


def _check_names(section: Section, known: Collection[str], listed: str) -> None:
    why = "is not an output of the model" if known else "has no model that it belongs to"
    for name in section.all_keys():
        if name not in known:
            section.fault(name, f"{why}{nearest(name, known)}{listed}")


def sign_of(section: Section, key: str) -> int | None:
    """A sense: 1, or -1 for an opposite sign."""
    value = section.take(key)
    if value is None:
        return None
    if isinstance(value, bool) or value not in EITHER:
        section.fault(key, f"must be 1 (as docs/conventions.md draws it) or -1 (the opposite), got {shown(value)}")
        return None
    return int(value)


def resolved_zero(zero: Mapping[str, float]) -> dict[str, Mapping[str, float]]:
    """The `[zero]` table, none where there is no zero."""
    return {ZERO: dict(zero)} if zero else {}


def resolved_sense(sense: Mapping[str, int]) -> dict[str, Mapping[str, int]]:
    """The `[sense]` table, none where every output is as the convention has it."""
    turned = {name: sign for name, sign in sense.items() if sign < 0}
    return {SENSE: turned} if turned else {}
