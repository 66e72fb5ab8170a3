"""Q-DAS files (AQDEF)."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from ..errors import Fault, InputError, raise_all, refuse
from ..units import shorten_text
from .header import known_unit
from .record import Columns, Dialect, ReadOptions, Specification, Table
from .shapes import specification
from .signs import moment, number_in
from .text import content_of, decode_text

# Lines of a Q-DAS file: keys of parts, characteristics and values, and compact lines of values.
#
# `K2002/3 Radius` sets the name of the characteristic 3, `/0` of all, no index means 1. A
# characteristic belongs to the part whose keys stand last above it. In a compact line the
# characteristics stand in the order of their numbers.


BETWEEN, WITHIN = "\x0f", "\x14"
"""Separators of a compact line: between characteristics, within one."""
COMPACT = ("K0001", "K0002", "K0004", "K0005", "K0006", "K0007", "K0008", "K0010", "K0011", "K0012")
COUNTS = ("K0020", "K0021", "", *COMPACT[1:])
"""What stands in a compact line of a characteristic of values, and of one of counts."""
GROUPS = {"K0053": "order", "K0007": "cavity", "K0008": "operator", "K0010": "machine", "K0012": "gauge"}
"""What values are grouped by; 0 stands for none."""
ATTRIBUTIVE = ("1", "5", "6")
FIRST = ("K0001", "K0021")
"""Keys that begin a value."""
MAX_VALUES = 2_000_000
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
            if len(self._begun) > MAX_VALUES:
                self.fault(at, f"the file has more than {MAX_VALUES:,} values: split it")
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
        elif key.startswith(("K1", "K2")):
            self._description_key(at, key, index, value)
        elif key.startswith("K00"):
            self._value_key(at, key, index, value, int(match[3]) if match[3] else None)

    def _description_key(self, at: int, key: str, index: int, value: str) -> None:
        """A key of a part (K1...) or of a characteristic (K2...); of the index 0 it is one of all."""
        of_part = key.startswith("K1")
        if index == 0:
            (self.common_parts if of_part else self.common)[key] = value
            return
        if of_part:
            self._part, keys = index, self.parts.setdefault(index, {})
        else:
            keys = self.characteristics.setdefault(index, Raw(self._part)).keys
        if keys.setdefault(key, value) != value:
            what = "part" if of_part else "characteristic"
            self.fault(at, f'{key} of {what} {index} is "{keys[key]}" above, here "{value}"')

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
        self._append(raw, index, {key: value}, at)

    def _append(self, raw: Raw, index: int, value: dict[str, str], at: int) -> None:
        raw.values.append(self._above | raw.pending | value)
        raw.lines.append(at)
        self._begun.append(index)

    def _compact(self, at: int, line: str) -> None:
        cells = line.split(BETWEEN)
        if len(self._order) != len(self.characteristics):
            self._order = sorted(self.characteristics)
        if len(cells) > len(self._order):
            self.fault(at, f"{len(cells)} characteristics in a line, {len(self._order)} are described above")
            return
        for index, cell in zip(self._order, cells, strict=False):
            raw = self.characteristics[index]
            keys = COUNTS if raw.attributive else COMPACT
            fields = cell.split(WITHIN)
            if len(fields) > len(keys):
                self.fault(at, f"{len(fields)} fields of a value, {len(keys)} are known")
                continue
            value = {key: text.strip() for key, text in zip(keys, fields, strict=False) if key}
            value["K0006"] = value.get("K0006", "").removeprefix("#")
            self._append(raw, index, {key: text for key, text in value.items() if text}, at)


# What a Q-DAS file holds: characteristics of parts, with limits and values.


@dataclass(slots=True)
class Characteristic:
    """One characteristic of one part.

    `values` are in `unit`, None where a value is missing or its attribute says that it is not
    valid; `attributes` (K0002), `times` (K0004), `batches` (K0006) and `groups` by cavity, machine,
    operator, gauge and order (K0007 and others) belong to them. `lower`
    and `upper` are limits, None where there is none. `attributive` characteristics count: their
    values are the numbers of faults in samples of `sizes`.
    """

    part: str = ""
    part_number: str = ""
    name: str = ""
    number: str = ""
    nominal: float | None = None
    lower: float | None = None
    upper: float | None = None
    unit: str = ""
    attributive: bool = False
    values: list[float | None] = field(default_factory=list)
    attributes: list[int] = field(default_factory=list)
    times: list[datetime | None] = field(default_factory=list)
    batches: list[str] = field(default_factory=list)
    sizes: list[int | None] = field(default_factory=list)
    keys: dict[str, str] = field(default_factory=dict)
    groups: dict[str, list[str]] = field(default_factory=dict)

    @property
    def specification(self) -> Specification:
        """Nominal size and limits, and which of them is one of nature (K2120, K2121)."""
        natural = next(
            (side for side, key in (("lower", "K2120"), ("upper", "K2121")) if self.keys.get(key) == "2"), ""
        )
        return Specification(self.nominal, self.lower, self.upper, natural)

    @property
    def denied(self) -> list[str]:
        """The limits that it states and denies at once: they are not used."""
        stated = (("lower", "K2120", ("K2110", "K2112")), ("upper", "K2121", ("K2111", "K2113")))
        return [
            f"{key} = {self.keys[key]} is not used: {denial} = 0 states that there is no {side} limit"
            for side, denial, keys in stated
            for key in keys
            if self.keys.get(denial) == "0" and self.keys.get(key, "").strip()
        ]

    @property
    def study(self) -> tuple[list[str], list[str]] | None:
        """The part and the operator of each value of a gauge study of type 2 or 3 (K2202), whose values are
        in the order of operators (K2220), parts (K2205), trials (K2221); None of other files.

        Raises ValueError where these are not as many as there are values.
        """
        if (kind := self.keys.get("K2202")) not in ("2", "3"):
            return None
        counts = [self.keys.get(key, "") for key in ("K2220", "K2205", "K2221")]
        o, p, r = (int(text) if text.isdecimal() and len(text) < 7 else 0 for text in counts)
        if o * p * r != len(self.values):
            text = f"{o} operators (K2220), {p} parts (K2205) and {r} trials (K2221)"
            raise ValueError(f"is a gauge study of type {kind} (K2202) of {text}, and has {len(self.values)} values")
        rows = [(part, operator) for operator in range(1, o + 1) for part in range(1, p + 1) for _ in range(r)]
        return [str(part) for part, _ in rows], [str(operator) for _, operator in rows]

    @property
    def label(self) -> str:
        """What the characteristic is called."""
        return self.name or self.number


def aqdef_text(characteristics: Sequence[Characteristic]) -> str:
    """The text of a .dfq file that describes characteristics with their limits, without values."""
    lines, numbers = [f"K0100 {len(characteristics)}"], list(dict.fromkeys(c.part_number for c in characteristics))
    described: set[str] = set()
    for at, c in sorted(enumerate(characteristics, 1), key=lambda pair: numbers.index(pair[1].part_number)):
        if c.part_number not in described:
            described.add(c.part_number)
            part = numbers.index(c.part_number) + 1
            lines += [f"K1001/{part} {c.part_number}", f"K1002/{part} {c.part}"]
        natural = c.specification.natural
        stated = {
            "K2001": c.number,
            "K2002": c.name,
            "K2004": "0",
            "K2101": c.nominal,
            "K2110": c.lower,
            "K2111": c.upper,
            "K2120": "2" if natural == "lower" else "1",
            "K2121": "2" if natural == "upper" else "1",
            "K2142": c.unit,
        }
        lines += [f"{key}/{at} {value}" for key, value in stated.items() if value not in ("", None)]
    return "\n".join(lines) + "\n"


# `read_aqdef`: characteristics of a Q-DAS file (AQDEF), in key and in compact form.


PARTNERS = {".dfd": ".dfx", ".dfx": ".dfd"}
INVALID = (255, 256)
"""Attributes (K0002) of values that are not valid."""
LIMIT_KEYS = {"nominal": "K2101", "usl": "K2111", "lsl": "K2110", "upper": "K2113", "lower": "K2112"}
"""Keys of nominal size, limits and deviations."""
MAX_NUMBER_CHARACTERS = 60
"""Characters of a whole number at most, and of a cell that a fault repeats."""


def read_aqdef(path: str | Path, encoding: str | None = None, times: bool = True) -> list[Characteristic]:
    """The characteristics of a .dfq file, or of a .dfd with its .dfx: `part`, `name`, `nominal`, `lower`, `upper`,
    `unit`, `values`, `attributes` (K0002), `times` (K0004), `batches` (K0006) and `groups` of each.

    Raises InputError with every fault; those of its times (K0004) only where `times` are needed.
    """
    measured, faults, of_times = characteristics(Path(path), Path(path).name, encoding)
    raise_all(faults + (of_times if times else []))
    return measured


def characteristics(
    path: Path, place: str, encoding: str | None = None
) -> tuple[list[Characteristic], list[Fault], list[Fault]]:
    """`read_aqdef` that returns the faults, and those of the times apart."""
    content = Content(place)
    try:
        for file in _files(path, place):
            content.place = place if file == path else file.name
            text, _ = decode_text(content_of(file, content.place), content.place, encoding, _SEPARATORS)
            content.read(text.split("\n"))
    except InputError as error:
        return [], list(error.faults), []
    content.place = place
    _check(content)
    measured = [_characteristic(content, index) for index in sorted(content.characteristics)]
    _repeated_characteristic(measured, content)
    return measured, content.faults, content.time_faults


_SEPARATORS = "\x0f\x14\x1a"


def _files(path: Path, place: str) -> list[Path]:
    """The descriptions, then the values."""
    partner = PARTNERS.get(path.suffix.lower())
    if partner is None:
        return [path]
    siblings = path.parent.iterdir() if path.parent.is_dir() else []
    second = next((p for p in siblings if p.stem == path.stem and p.suffix.lower() == partner), None)
    if second is None and path.exists():
        raise refuse(place, f"needs {path.stem}{partner} next to it")
    return sorted([path] if second is None else [path, second], key=lambda file: file.suffix.lower())


def _check(content: Content) -> None:
    """Counts and parts that do not agree."""
    described = len(content.characteristics)
    if not described:
        content.faults.append(Fault(content.place, "describes no characteristic (keys K2...)"))
    if content.count is not None and content.count != described:
        text = f"K0100 announces {content.count} characteristics, {described} are described"
        content.faults.append(Fault(content.place, text))
    used = {raw.part for raw in content.characteristics.values()}
    for index in sorted(set(content.parts) - used) if len(content.parts) > 1 else ():
        text = f"part {index} has no characteristic: those of a part stand below its keys K1..., before the next part"
        content.faults.append(Fault(content.place, text))


def _characteristic(content: Content, index: int) -> Characteristic:
    raw = content.characteristics[index]
    keys = content.common | raw.keys
    part = content.common_parts | content.parts.get(raw.part, {})
    place = f"{content.place}: characteristic {index} ({keys.get('K2002', '')})"
    numbers = {}
    for role, key in LIMIT_KEYS.items():
        value = _number(keys.get(key, ""), f"{place}: {key}", content.faults)
        no_such_limit = keys.get("K2120" if role in ("lsl", "lower") else "K2121") == "0" and role != "nominal"
        if value is not None and not no_such_limit:
            numbers[role] = value
    stated, wrong = specification(numbers, place, deviations=True)
    content.faults += wrong
    characteristic = Characteristic(
        part=part.get("K1002") or part.get("K1001", ""),
        part_number=part.get("K1001", ""),
        name=keys.get("K2002", ""),
        number=keys.get("K2001", ""),
        nominal=stated.nominal,
        lower=stated.lower,
        upper=stated.upper,
        unit=keys.get("K2142", ""),
        attributive=keys.get("K2004") in ATTRIBUTIVE,
        keys=keys,
    )
    _fill(characteristic, raw, content, place)
    return characteristic


def _fill(characteristic: Characteristic, raw: Raw, content: Content, place: str) -> None:
    """Fill in the values with their attributes, sizes, batches and times."""
    formats: dict[str, int] = {}
    for key, kind in GROUPS.items():
        if len(names := {value.get(key, "0") for value in raw.values}) > 1 or not names <= {"0", ""}:
            characteristic.groups[kind] = [value.get(key, "0") for value in raw.values]
    for line, value in zip(raw.lines, raw.values, strict=True):
        where = f"{content.place}: row {line}"
        key = "K0021" if characteristic.attributive else "K0001"
        number = _number(value.get(key, ""), f"{where}: {key}", content.faults)
        attribute = _read_integer(value.get("K0002", ""), f"{where}: K0002", content.faults) or 0
        characteristic.values.append(None if attribute in INVALID else number)
        characteristic.attributes.append(attribute)
        characteristic.sizes.append(_read_integer(value.get("K0020", ""), f"{where}: K0020", content.faults))
        characteristic.batches.append(value.get("K0006", ""))
        characteristic.times.append(None)
        if text := value.get("K0004", ""):
            try:
                characteristic.times[-1], _, form = moment(text)
                formats.setdefault(form, line)
            except ValueError as error:
                content.time_faults.append(Fault(f"{where}: K0004", str(error)))
    if len(formats) > 1:
        listed = " and ".join(f"{form} (row {line})" for form, line in formats.items())
        content.time_faults.append(Fault(f"{place}: K0004", f"times in two formats: {listed}"))


def _repeated_characteristic(described: list[Characteristic], content: Content) -> None:
    """A characteristic of one part that is described twice."""
    first_index: dict[tuple[str, str, str, str], int] = {}
    for index, characteristic in zip(sorted(content.characteristics), described, strict=True):
        key = (characteristic.part_number, characteristic.part, characteristic.number, characteristic.name)
        if any(key[2:]) and key in first_index:
            text = f"characteristic {index} ({characteristic.label}) is described twice: as {first_index[key]} as well"
            content.faults.append(Fault(content.place, text))
        first_index.setdefault(key, index)


def _number(text: str, place: str, faults: list[Fault]) -> float | None:
    """A number of a Q-DAS file, whose comma or point is decimal: the format groups no thousands."""
    number = number_in(text.replace(",", ".")) if text else None
    if number is None or math.isfinite(number):
        return number
    faults.append(Fault(place, f'must be a number, got "{shorten_text(text)}"'))
    return None


def _read_integer(text: str, place: str, faults: list[Fault]) -> int | None:
    if not text:
        return None
    if not text.isdecimal() or len(text) > MAX_NUMBER_CHARACTERS:
        faults.append(Fault(place, f'must be a whole number, got "{shorten_text(text)}"'))
        return None
    return int(text)


# A Q-DAS file as a table: a column per characteristic, a row per measured part.


def table_of_aqdef(path: Path, place: str, options: ReadOptions) -> tuple[Table | None, list[Fault]]:
    """The values of a file, those of one row measured one after the other on one part.

    Values that are not valid are empty cells. A column is named after its characteristic; where two
    have the same name after its part as well, and in one part after its number, or else its
    place in the file. `time` and `batch` are those of the first characteristic; times that cannot be
    read are left out with a note.
    """
    measured, faults, of_times = characteristics(path, place, options.encoding)
    if not measured:
        return None, faults
    names = names_of_characteristics(measured)
    rows = max(len(characteristic.values) for characteristic in measured)
    if not rows:
        faults.append(Fault(place, "holds no values"))
    named = dict(zip(names, measured, strict=True))
    columns: dict[str, list[Any]] = {name: ["" if v is None else v for v in c.values] for name, c in named.items()}
    first = measured[0]
    times = [] if of_times else [t.isoformat(" ") if t else "" for t in first.times]
    for name, texts in (("time", times), ("batch", first.batches)):
        if any(texts):
            columns.setdefault(name, [*texts])
    for cells_of_column in columns.values():
        cells_of_column += [""] * (rows - len(cells_of_column))
    units = {name: unit for name, characteristic in named.items() if (unit := known_unit(characteristic.unit))}
    notes = tuple(f"times are not used: {fault}" for fault in of_times[:1]) + tuple(
        f"{name}: {characteristic.values.count(None)} values are missing or not valid"
        for name, characteristic in named.items()
        if None in characteristic.values
    )
    notes += tuple(f"{name}: {text}" for name, characteristic in named.items() for text in characteristic.denied)
    cells, headers = Columns(columns, range(1, rows + 1)), {name: name for name in columns}
    stated = {name: c.specification for name, c in named.items()}
    return Table(cells, Dialect("aqdef", header=0), units, notes, tuple(names), headers, {}, stated), faults


def names_of_characteristics(measured: list[Characteristic]) -> list[str]:
    """A name for each characteristic, as short as it is the only one."""
    forms = [
        (c.label, f"{c.part} {c.label}", f"{c.part} {c.label} {c.number}", f"{c.part} {c.label} #{at}")
        for at, c in enumerate(measured, start=1)
    ]
    counts = [Counter(form) for form in zip(*forms, strict=True)]
    names = [next(name for name, count in zip(form, counts, strict=True) if count[name] == 1) for form in forms]
    return names if len(set(names)) == len(names) else [form[-1] for form in forms]
