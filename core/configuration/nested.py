"""Names with a dot, `gap.variation`, as keys: quoted, or in a table of their own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..section import Section


class Nested:
    """A section in which `gap.variation` may be `"gap.variation"`, or `variation` of `[gap]`."""

    def __init__(self, section: Section, names: Iterable[str]) -> None:
        self._section = section
        heads = dict.fromkeys(name.partition(".")[0] for name in names if "." in name)
        self._tables = {head: section.section(head) for head in heads if isinstance(section.take(head), Mapping)}

    def find(self, name: str) -> tuple[Section, str]:
        """The section in which a name is a key, and the key."""
        head, _, rest = name.partition(".")
        if not rest or head not in self._tables:
            return self._section, name
        if name in self._section and rest in self._tables[head]:
            self._section.take(name)
            self._section.fault(name, f'is given twice: as "{name}" and in [{head}]')
        return (self._section, name) if name in self._section else (self._tables[head], rest)

    def finish(self) -> None:
        """Report every key that was not asked for."""
        for table in self._tables.values():
            table.finish()
        self._section.finish()


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by dotted name as tables of tables."""
    nested_values: dict[str, Any] = {}
    for name, value in values.items():
        head, _, rest = name.partition(".")
        if rest:
            nested_values.setdefault(head, {})[rest] = value
        else:
            nested_values[name] = value
    return nested_values
