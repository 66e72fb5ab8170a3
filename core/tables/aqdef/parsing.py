"""Lines of a Q-DAS file: keys of parts, characteristics and values, and compact lines of values.

`K2002/3 Radius` sets the name of the characteristic 3, `/0` of all, no index means 1. A
characteristic belongs to the part whose keys stand last above it. In a compact line the
characteristics stand in the order of their numbers.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from ...errors import Fault

BETWEEN, WITHIN = "\x0f", "\x14"
"""Separators of a compact line: between characteristics, within one."""
COMPACT = ("K0001", "K0002", "K0004", "K0005", "K0006", "K0007", "K0008", "K0010", "K0011", "K0012")
COUNTS = ("K0020", "K0021", "", *COMPACT[1:])
"""What stands in a compact line of a characteristic of values, and of one of counts."""
ATTRIBUTIVE = ("1", "5", "6")
FIRST = ("K0001", "K0021")
"""Keys that begin a value."""
MOST = 2_000_000
"""Values that are read of a file."""
_KEY = re.compile(r"(K\d{4})(?:/(\d{0,9})(?:/(\d{1,9}))?)?(?:[ \t]+(.*))?")


@dataclass(slots=True)
class Raw:
    """A characteristic as text: its keys, the index of its part, and the keys of each value."""

    part: int = 1
    keys: dict[str, str] = field(default_factory=dict)
    values: list[dict[str, str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    pending: dict[str, str] = field(default_factory=dict)
    """What stands before the values that it belongs to."""

    @property
    def attributive(self) -> bool:
        """Whether it counts."""
        return self.keys.get("K2004", "0") in ATTRIBUTIVE


@dataclass(slots=True)
class Content:
    """What the lines of a file hold, and what is wrong with them."""

    place: str
    parts: dict[int, dict[str, str]] = field(default_factory=dict)
    characteristics: dict[int, Raw] = field(default_factory=dict)
    common: dict[str, str] = field(default_factory=dict)
    common_parts: dict[str, str] = field(default_factory=dict)
    count: int | None = None
    faults: list[Fault] = field(default_factory=list)
    time_faults: list[Fault] = field(default_factory=list)
    _part: int = 1
    _above: dict[str, str] = field(default_factory=dict)
    _begun: list[int] = field(default_factory=list)
    _applied: dict[str, tuple[int, str]] = field(default_factory=dict)
    _order: list[int] = field(default_factory=list)

    def fault(self, line: int, text: str) -> None:
        """Take note of a fault in a line."""
        self.faults.append(Fault(f"{self.place}: row {line}", text))

    def read(self, lines: list[str]) -> None:
        """Read the lines of a file."""
        for at, line in enumerate(lines, 1):
            stripped = line.strip(" \r\n\t\x1a")
            if stripped.startswith("K"):
                self._key(at, stripped)
            elif stripped:
                self._compact(at, line.rstrip("\r\n\x1a"))
            if len(self._begun) > MOST:
                self.fault(at, f"the file has more than {MOST:,} values: split it")
                return

    def _key(self, at: int, line: str) -> None:
        match = _KEY.fullmatch(line)
        if match is None:
            self.fault(at, f'"{line[:40]}" is not a key of a Q-DAS file')
            return
        key, value = match[1], (match[4] or "").strip()
        index = int(match[2]) if match[2] else 1
        if key == "K0100":
            self.count = int(value) if value.isdecimal() else None
        elif key.startswith("K1"):
            self._part_key(at, key, index, value)
        elif key.startswith("K2"):
            self._characteristic_key(at, key, index, value)
        elif key.startswith("K00"):
            self._value_key(at, key, index, value, int(match[3]) if match[3] else None)

    def _part_key(self, at: int, key: str, index: int, value: str) -> None:
        if index == 0:
            self.common_parts[key] = value
            return
        self._part = index
        keys = self.parts.setdefault(index, {})
        if keys.setdefault(key, value) != value:
            self.fault(at, f'{key} of part {index} is "{keys[key]}" above, here "{value}"')

    def _characteristic_key(self, at: int, key: str, index: int, value: str) -> None:
        if index == 0:
            self.common[key] = value
            return
        raw = self.characteristics.setdefault(index, Raw(self._part))
        if raw.keys.setdefault(key, value) != value:
            self.fault(at, f'{key} of characteristic {index} is "{raw.keys[key]}" above, here "{value}"')

    def _value_key(self, at: int, key: str, index: int, value: str, number: int | None) -> None:
        if index == 0:
            if key in FIRST:
                for known_index in self.characteristics:
                    self._value_key(at, key, known_index, value, number)
                return
            if not self._begun:  # K0004/0 above the values of a part
                self._above[key] = ""
            if key in self._above:
                self._above[key] = value
                return
            begun, before = self._applied.get(key, (0, value))
            if begun == len(self._begun) and before != value:
                self.fault(at, f"{key}/0 is given twice for one value")
            for known_index in dict.fromkeys(self._begun[begun:]):
                self._value_key(at, key, known_index, value, number)
            self._applied[key] = len(self._begun), value
            return
        raw = self.characteristics.get(index)
        if raw is None:
            self.fault(at, f"{key}/{index}: characteristic {index} is not described above")
        elif key in raw.pending:
            raw.pending[key] = value
        elif number is not None and number != len(raw.values) + (key in FIRST):
            self.fault(at, f"value {number} of characteristic {index} is out of order")
        elif key in FIRST or (key == "K0020" and raw.attributive):
            self._begin(raw, index, key, value, at)
        elif not raw.values:
            raw.pending[key] = value
        elif key in self._above:
            raw.values[-1][key] = value  # that of the value instead of that of all
        elif raw.values[-1].setdefault(key, value) != value:
            self.fault(at, f"{key}/{index} is given twice for one value")

    def _begin(self, raw: Raw, index: int, key: str, value: str, at: int) -> None:
        """A new value; the size of a sample and its count belong together."""
        last = raw.values[-1] if raw.values else None
        pair = {"K0020": "K0021", "K0021": "K0020"}.get(key)
        if pair and last is not None and pair in last and key not in last:
            last[key] = value
            return
        raw.values.append(self._above | raw.pending | {key: value})
        self._begun.append(index)
        raw.lines.append(at)

    def _compact(self, at: int, line: str) -> None:
        cells = line.split(BETWEEN)
        if len(self._order) != len(self.characteristics):
            self._order = sorted(self.characteristics)
        indices = self._order
        if len(cells) > len(indices):
            self.fault(at, f"{len(cells)} characteristics in a line, {len(indices)} are described above")
            return
        for index, cell in zip(indices, cells, strict=False):
            raw = self.characteristics[index]
            keys = COUNTS if raw.attributive else COMPACT
            fields = cell.split(WITHIN)
            if len(fields) > len(keys):
                self.fault(at, f"{len(fields)} fields of a value, {len(keys)} are known")
                continue
            value = {key: text.strip() for key, text in zip(keys, fields, strict=False) if key}
            value["K0006"] = value.get("K0006", "").removeprefix("#")
            raw.values.append(self._above | raw.pending | {key: text for key, text in value.items() if text})
            self._begun.append(index)
            raw.lines.append(at)
