"""`[zero]`: the offset of an instrument where the model predicts zero, by output."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..declarations import Output
from ..errors import nearest
from ..section import Section

ZERO = "zero"


def read_zero(top: Section, outputs: Iterable[Output]) -> dict[str, float]:
    """The zeros that are given, in the unit of their output; names of no output are faults."""
    section, known = top.section(ZERO), {output.name: output.unit for output in outputs}
    zeros = {name: section.number(name, unit) for name, unit in known.items() if name in section}
    for name in section.all_keys():
        if name not in known:
            why = "is no output of the model" if known else "has no model that it belongs to"
            section.fault(name, f"{why}{nearest(name, known)}")
    return {name: value for name, value in zeros.items() if value is not None}


def resolved_zero(zero: Mapping[str, float]) -> dict[str, Mapping[str, float]]:
    """The `[zero]` table, none where there is no zero."""
    return {ZERO: dict(zero)} if zero else {}
