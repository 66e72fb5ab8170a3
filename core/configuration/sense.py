"""`[sense]`: outputs whose positive measurement means the opposite of the convention."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..declarations import Output
from ..errors import nearest
from ..section import Section, shown

SENSE = "sense"
EITHER = (-1, 1)


def read_sense(top: Section, outputs: Iterable[Output]) -> dict[str, int]:
    """The sense that is given of each output; names of no output are faults."""
    section, known = top.section(SENSE), [output.name for output in outputs]
    senses = {name: sign_of(section, name) for name in section.all_keys()}
    for name in senses:
        if name not in known:
            why = "is no output of the model" if known else "has no model that it belongs to"
            listed = f"; outputs: {', '.join(known)}" if known else ""
            section.fault(name, f"{why}{nearest(name, known)}{listed}")
    return {name: sense for name, sense in senses.items() if sense is not None and name in known}


def sign_of(section: Section, key: str) -> int | None:
    """A sense: 1, or -1 for what counts the other way round."""
    value = section.take(key)
    if value is None:
        return None
    if isinstance(value, bool) or value not in EITHER:
        section.fault(key, f"must be 1 (as docs/conventions.md draws it) or -1 (the opposite), got {shown(value)}")
        return None
    return int(value)


def resolved_sense(sense: Mapping[str, int]) -> dict[str, Mapping[str, int]]:
    """The `[sense]` table, none where every output is as the convention has it."""
    turned = {name: sign for name, sign in sense.items() if sign < 0}
    return {SENSE: turned} if turned else {}
