"""`[zero]` and `[sense]`: the offset and the sign of the measurements of an output."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from ..declarations import Output
from ..errors import nearest
from ..section import Section, shown

ZERO, SENSE = "zero", "sense"
EITHER = (-1, 1)


def read_zero(top: Section, outputs: Iterable[Output]) -> dict[str, float]:
    """The offset of an instrument where the model predicts zero, in the unit of its output; names
    of no output are faults.
    """
    section, known = top.section(ZERO), {output.name: output.unit for output in outputs}
    zeros = {name: section.number(name, unit) for name, unit in known.items() if name in section}
    _check_names(section, known, "")
    return {name: value for name, value in zeros.items() if value is not None}


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
