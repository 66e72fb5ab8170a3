"""A table of a configuration: returns checked values and collects the faults."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .errors import Fault, InputError, UnknownKey, nearest
from .units import split_unit, to_unit, unit_hint

# How large a count may be: what it would take is estimated before anything is computed.
#
# A count declares its `Need` where its range is declared: `Parameter(need=...)` of a model, problem
# or calculation, `field(metadata={"need": ...})` of an algorithm or a design, `Section.integer`.
# A count without a `Need` is taken for numbers that are stored (`PLAIN`). The budgets do not depend
# on the machine, so that a configuration is accepted everywhere or nowhere; `--force` lifts them.


MEMORY = 8.0 * 2**30
"""Bytes that one count may take."""
TIME = 30.0 * 86_400.0
"""Seconds that one count may take on one core."""
_MAX_COUNT = 10**100
"""Larger counts are replaced by this number: it exceeds every budget, and is still a float."""
_TIMES = (("years", 365.25 * 86_400.0), ("days", 86_400.0), ("hours", 3600.0), ("s", 1.0))
_SIZES = (("TiB", 2.0**40), ("GiB", 2.0**30), ("MiB", 2.0**20), ("KiB", 2.0**10))
_FORCED: ContextVar[bool] = ContextVar("forced", default=False)


@dataclass(frozen=True, slots=True)
class Need:
    """What a count takes: bytes and seconds per item, and bytes per pair where all items are
    compared with all others.

    `of` is what is counted ("individual"). The numbers are measured, and rather too low: a count
    that is refused is really too large.
    """

    of: str
    bytes: float = 0.0
    seconds: float = 0.0
    bytes_per_pair: float = 0.0

    def memory(self, count: int) -> float:
        """Bytes that the count takes."""
        number = float(min(count, _MAX_COUNT))
        return number * self.bytes + number * number * self.bytes_per_pair

    def time(self, count: int) -> float:
        """Seconds that the count takes."""
        return float(min(count, _MAX_COUNT)) * self.seconds

    @property
    def most(self) -> int:
        """The largest count within both budgets, rounded down to two digits."""
        ends = [MEMORY / self.bytes] if self.bytes else []
        if self.bytes_per_pair:
            half = 0.5 * self.bytes / self.bytes_per_pair
            ends.append(math.sqrt(half * half + MEMORY / self.bytes_per_pair) - half)
        ends += [TIME / self.seconds] if self.seconds else []
        least = int(min(ends, default=_MAX_COUNT))
        step: int = 10 ** max(len(str(least)) - 2, 0)
        return least // step * step


PLAIN = Need("number", bytes=8.0)
"""For a count that declares nothing: a number is stored per item."""
INDIVIDUALS = Need("individual", bytes=2.5e3, seconds=2e-5)
"""For a population: pymoo stores an object per individual."""
PAIRED = Need("individual", bytes=2.5e3, seconds=2e-5, bytes_per_pair=15.0)
"""For a population whose members are compared pairwise, as reference directions are."""
GENERATIONS = Need("generation", bytes=400.0, seconds=1e-3)
EVALUATIONS = Need("evaluation", seconds=2e-5)
POINTS = Need("point", bytes=1.5e3, seconds=1e-3)
"""For a front: a row of every variable and output."""
SAMPLES = Need("sample", bytes=120.0, seconds=1e-6)
"""Units that are drawn, with a dozen inputs per unit."""
SETTINGS = Need("setting", bytes=2e4, seconds=0.05)
"""For a study: a setting is read as a run configuration, and runs once at least."""
RUNS = Need("run", bytes=1e4, seconds=0.05)
"""For a study: the course of every run is stored."""
BLOCK_ROWS = Need("row", bytes=1e3, seconds=1e-6)
"""For a block of a table: a worker holds all of them, with every column."""
PER_CORE = 16
"""Processes that may be asked for per core of the machine."""
PROCESS = 2.0e8
"""Bytes of a process with the package loaded."""


@contextmanager
def force_counts(force: bool = True) -> Iterator[None]:
    """Within it no count is refused for its size, if `force` is true."""
    token = _FORCED.set(force or _FORCED.get())
    try:
        yield
    finally:
        _FORCED.reset(token)


def is_forced() -> bool:
    """Whether counts are accepted whatever their size."""
    return _FORCED.get()


def too_many(count: int, need: Need, per: int = 1, product: str = "") -> str:
    """What is wrong with a count; empty where it is within the budgets, or asked for.

    Each of them may be `per` of what `need` says, which `product` then names ("seeds x settings").
    """
    total, most = count * per, need.most // max(per, 1)
    if total <= need.most or is_forced():
        return ""
    taken = []
    if need.memory(total) > MEMORY:
        taken.append(f"{size(need.memory(total))} of memory ({size(MEMORY)} at most)")
    if need.time(total) > TIME:
        taken.append(f"{duration(need.time(total))} of computing ({duration(TIME)} at most)")
    number = shown_number(count)
    if product:
        number += f" would be {shown_number(total)} {need.of}s ({product}), which"
    cost = " and ".join(taken) or size(need.memory(total))
    remedy = f"give at most {most}" if most else "give fewer of both"
    return f"{number} would need about {cost}: {remedy}, or add --force"


def too_many_workers(count: int) -> str:
    """What is wrong with a number of processes; empty where nothing is, or if it is asked for."""
    cores = os.cpu_count() or 1
    if count <= PER_CORE * cores or is_forced():
        return ""
    text = f"{count} processes would need about {size(count * PROCESS)} of memory, and the cores are"
    return f"{text} {cores}: give at most {PER_CORE * cores}, or add --force"


def shown_number(count: int) -> str:
    """A count as text; one of many digits by its power of ten."""
    return str(count) if count < 10**18 else f"about 1e{int(math.log10(count))}"


def size(number: float) -> str:
    """Bytes in a unit that fits."""
    return _scaled(number, _SIZES)


def duration(seconds: float) -> str:
    """A time in a unit that fits."""
    return _scaled(seconds, _TIMES)


def _scaled(number: float, units: tuple[tuple[str, float], ...]) -> str:
    """A number in the largest unit that it reaches, or the smallest one."""
    name, unit = next((entry for entry in units if number >= entry[1]), units[-1])
    return f"{number / unit:.3g} {name}"


Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Range:
    """The numbers from `low` to `high`, without an end that is open."""

    low: float = -inf
    high: float = inf
    open_low: bool = False
    open_high: bool = False

    def complaint(self, value: float) -> str:
        """What is wrong with `value`, empty where nothing is."""
        above = value > self.low or (value == self.low and not self.open_low)
        below = value < self.high or (value == self.high and not self.open_high)
        return "" if above and below else f"must {self}, got {int(value) if value == int(value) else value}"

    def __str__(self) -> str:
        if math.isfinite(self.low) and math.isfinite(self.high):
            left, right = "(" if self.open_low else "[", ")" if self.open_high else "]"
            return f"lie in {left}{self.low:.10g}, {self.high:.10g}{right}"
        if math.isfinite(self.low):
            return f"be {'above' if self.open_low else 'at least'} {self.low:.10g}"
        return f"be {'below' if self.open_high else 'at most'} {self.high:.10g}"


ANY = Range()
MAX_FAULTS = 1000
"""Faults of a configuration that are reported."""
MAX_NAMES_COMPARED = 100
"""Unknown keys for which the nearest valid one is looked for."""
SHOWN = 100
"""Characters of a value that a message repeats."""
POSITIVE = Range(low=0.0, open_low=True)


def shown(value: object) -> str:
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    text = f'"{value[:SHOWN]}"' if isinstance(value, str) else str(value[:SHOWN] if isinstance(value, list) else value)
    return text if len(text) <= SHOWN + 2 else f"{text[:SHOWN]}..."


class Section:
    """A table and its place; what is missing or faulty is returned as None.

    A key that was never read is unknown: `finish` reports it.
    """

    def __init__(self, table: Mapping[str, Any], place: str, faults: list[Fault]) -> None:
        self._table = table
        self._place = place
        self._faults = faults
        self._known: dict[str, None] = {}

    def __contains__(self, key: str) -> bool:
        return key in self._table

    def all_keys(self) -> tuple[str, ...]:
        """Every key that the table has."""
        return tuple(self._table)

    def place(self, key: str = "") -> str:
        """Where `key` of this table stands, as faults name it."""
        return ".".join(part for part in (self._place, key) if part)

    @property
    def faults(self) -> list[Fault]:
        """The faults of the whole configuration until now."""
        return self._faults

    def fault(self, key: str, message: str, kind: type[Fault] = Fault) -> None:
        """Report a fault of `key`, or of the table where the key is empty; no more than `MAX_FAULTS`."""
        fault = kind(self.place(key) or "configuration", message)
        if len(self._faults) < MAX_FAULTS and fault not in self._faults:  # a table may be read twice
            self._faults.append(fault)

    def take(self, key: str) -> Any:
        """The value as the file states it, or None."""
        self._known[key] = None
        return self._table.get(key)

    def accept(self, keys: Iterable[str]) -> None:
        """Accept keys that are not read here."""
        self._known |= dict.fromkeys(keys)

    def finish(self) -> None:
        """Report every key that was not read, with the nearest key that would be valid."""
        unknown = [key for key in self._table if key not in self._known]
        for at, key in enumerate(unknown):
            close = nearest(key, self._known) if at < MAX_NAMES_COMPARED else ""
            self.fault(key, f"is not a known key{close}", UnknownKey)

    def number(self, key: str, unit: str = "", within: Range = ANY) -> float | None:
        """A finite number in `unit`; where there is a unit, also a string that states its unit."""
        value = self.take(key)
        return None if value is None else self.as_number(key, value, unit, within)

    def as_number(self, key: str, value: Any, unit: str, within: Range = ANY, scale_only: bool = False) -> float | None:
        """`value` as a finite number in `unit`, any fault reported at `key`; `scale_only` as
        `to_unit` takes it.
        """
        if isinstance(value, str) and unit:
            try:
                number = to_unit(value, unit, scale_only)
            except ValueError as error:
                self.fault(key, str(error))
                return None
        elif isinstance(value, bool) or not isinstance(value, int | float):
            wanted = f"a number or a string with a unit of {unit}" if unit else "a number"
            self.fault(key, f"must be {wanted}, got {shown(value)}")
            return None
        else:
            number = value if abs(value) < 1e300 else inf
        if not math.isfinite(number):
            self.fault(key, f"must be finite, got {shown(value)}")
            return None
        if complaint := within.complaint(number):
            self.fault(key, complaint + unit_hint(number, unit, within.low, within.high))
            return None
        return float(number)

    def quantity(self, name: str, unit: str, within: Range = ANY) -> float | None:
        """`number` of `eccentricity_mm`, which may also be written `eccentricity = "1.3 mm"`."""
        stem = split_unit(name)[0]
        if stem == name or stem not in self._table:
            return self.number(name, unit, within)
        if name in self._table:
            self.fault(name, f"is given twice: as {name} and as {stem}")
            return None
        self._known[name] = None
        value = self.take(stem)
        if not isinstance(value, str):
            self.fault(stem, f'needs a unit: write {stem} = "... {unit}", or {name}')
            return None
        return self.as_number(stem, value, unit, within)

    def integer(self, key: str, within: Range = ANY, need: Need | None = PLAIN) -> int | None:
        """A whole number; more than `need` allows is a fault (None: it is not a count)."""
        value = self.take(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int):
            self.fault(key, f"must be a whole number, got {shown(value)}")
            return None
        if not abs(value) < 1e300:
            self.fault(key, "must be below 1e300")
            return None
        complaint = within.complaint(value) or (too_many(value, need) if need else "")
        if complaint:
            self.fault(key, complaint)
            return None
        return value

    def flag(self, key: str) -> bool | None:
        """A truth value."""
        value = self.take(key)
        if value is None or isinstance(value, bool):
            return value
        self.fault(key, f"must be true or false, got {shown(value)}")
        return None

    def text(self, key: str, choices: Iterable[str] = ()) -> str | None:
        """A string, one of `choices` where there are any."""
        value, valid = self.take(key), tuple(choices)
        if value is None:
            return None
        if not isinstance(value, str):
            self.fault(key, f"must be a string, got {shown(value)}")
            return None
        if valid and value not in valid:
            self.fault(key, f'must be one of {", ".join(valid)}, got "{value}"{nearest(value, valid)}')
            return None
        return value

    def names(self, key: str) -> list[str] | None:
        """A list of strings, at least one and no more than `MAX_FAULTS`."""
        value = self.take(key)
        if value is None:
            return None
        if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
            self.fault(key, f"must be a list of strings, got {shown(value)}")
            return None
        if not value:
            self.fault(key, "must name at least one")
            return None
        if len(value) > MAX_FAULTS:
            self.fault(key, f"has {len(value)} names, {MAX_FAULTS} at most")
            return None
        return value

    def numbers(self, key: str) -> tuple[float, ...] | None:
        """A list of finite numbers."""
        value = self.take(key)
        if value is None:
            return None
        if not isinstance(value, list):
            self.fault(key, f"must be a list of numbers, got {shown(value)}")
            return None
        checked = [self.as_number(f"{key}[{i}]", entry, "") for i, entry in enumerate(value)]
        return tuple(number for number in checked if number is not None) if None not in checked else None

    def section(self, key: str) -> Section:
        """The table at `key`, empty where there is none."""
        value = self.take(key)
        if value is not None and not isinstance(value, dict):
            self.fault(key, f"must be a table, got {shown(value)}")
        return Section(value if isinstance(value, dict) else {}, self.place(key), self._faults)

    def named_items(self, key: str, read: Callable[[Section, str], Item | None]) -> tuple[Item, ...] | None:
        """What `read` makes of each table of a list, with its name; None after a fault.

        Every table needs a different name, and there must be at least one table.
        """
        names: list[str] = []
        items: list[Item | None] = []
        for section in self.items(key):
            name = section.text("name")
            if not name:
                section.fault("name", f"is missing: name the {key}")
            elif name in names:
                section.fault("name", f'"{name}" is named twice')
            names.append(name or "")
            items.append(read(section, name or ""))
            section.finish()
        if not items and isinstance(self.take(key), list):
            self.fault(key, f"must list at least one {key}")
        whole = tuple(item for item in items if item is not None)
        return whole if items and len(whole) == len(items) else None

    def collecting(self, key: str, faults: list[Fault]) -> Section:
        """The table at `key`, whose faults go to a list of their own."""
        value = self.section(key)
        return Section(value._table, value._place, faults)

    def of(self, key: str, table: Mapping[str, Any]) -> Section:
        """A table that belongs to `key`, however it is written."""
        return Section(table, self.place(key), self._faults)

    def having(self, key: str, value: Any) -> Section:
        """The same table with a value that stands elsewhere in the configuration."""
        extended = Section({**self._table, key: value}, self._place, self._faults)
        extended._known = self._known
        return extended

    def tables(self, key: str) -> list[Mapping[str, Any]]:
        """The tables of an array `[[key]]`, empty where there is none."""
        value = self.take(key)
        if value is None:
            return []
        if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
            self.fault(key, f"must be a list of tables: write [[{key}]]")
            return []
        return value

    def item(self, key: str, at: int, faults: list[Fault] | None = None) -> Section:
        """The table at place `at` (from 0) of `[[key]]`; its faults may go to a list."""
        return Section(self.tables(key)[at], f"{self.place(key)}[{at}]", self._faults if faults is None else faults)

    def items(self, key: str) -> list[Section]:
        """Every table of `[[key]]`."""
        return [self.item(key, at) for at in range(len(self.tables(key)))]

    def attempt(
        self, compute: Callable[[], Item], placed: Callable[[Fault], tuple[str, str]] = attrgetter("place", "message")
    ) -> Item | None:
        """What `compute` returns; None where it raises InputError, whose faults are then reported
        in this table, with the key and the message that `placed` gives.
        """
        try:
            return compute()
        except InputError as error:
            for fault in error.faults:
                self.fault(*placed(fault))
        return None


CHANGED = 80
"""Characters of a changed value in a message at most."""


def flat(table: Mapping[str, Any], place: str = "") -> dict[str, Any]:
    """Values of nested tables by dotted key."""
    values: dict[str, Any] = {}
    for key, value in table.items():
        at = f"{place}{key}"
        values |= flat(value, f"{at}.") if isinstance(value, dict) else {at: value}
    return values


ROUNDING = 1e-12
"""Relative difference up to which numbers of two configurations are equal."""


def differences(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    """The values, before and after, of each key of nested tables that differs, as a message shows them.

    A table in a list has its place, such as part[1].cost.b; where a name is added or removed the
    list is one value.
    """
    old, new = flat(_tables_by_place(before, after)), flat(_tables_by_place(after, before))
    keys = dict.fromkeys([*new, *old])
    return {key: (_shown(old, key), _shown(new, key)) for key in keys if not _equal(old.get(key), new.get(key))}


def _equal(one: Any, other: Any) -> bool:
    """Whether two values are equal but for the rounding of another processor: some ranges are computed."""
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_equal, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return one == other or math.isclose(one, other, rel_tol=ROUNDING)
    return bool(one == other)


def _tables_by_place(table: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """A table in which lists of tables that are as long in the other one are tables by place."""
    placed: dict[str, Any] = {}
    for key, value in table.items():
        counterpart: Any = other.get(key)
        if isinstance(value, dict) and isinstance(counterpart, dict):
            placed[key] = _tables_by_place(value, counterpart)
        elif _tables(value) and _tables(counterpart) and len(value) == len(counterpart):
            pairs = zip(value, counterpart, strict=True)
            placed |= {f"{key}[{at}]": _tables_by_place(own, another) for at, (own, another) in enumerate(pairs)}
        else:
            placed[key] = value
    return placed


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, dict) for item in value)


def _shown(values: Mapping[str, Any], key: str) -> str:
    """A value as a message shows it, long ones by their beginning."""
    text = f'"{values[key]}"' if isinstance(values.get(key), str) else str(values.get(key, "unset"))
    return text if len(text) <= CHANGED else f"{text[: CHANGED - 4]} ..."


# What a model or problem declares about itself: parameters, design variables, outputs.


Scalar = float | int | str | bool
Value = Scalar | tuple[float, ...] | Mapping[str, float]
"""A list has a fixed length; a table holds numbers by name."""


def number(value: Value) -> float:
    """The number that a scalar is. Raises TypeError where the value is a list or a table."""
    if isinstance(value, tuple | Mapping):
        raise TypeError(f"expected a number, got {value!r}")
    return float(value)


class Kind(StrEnum):
    """What the number of a design variable means."""

    HALF_WIDTH = "half-width t of the zone mid +- t"
    STANDARD_DEVIATION = "standard deviation"
    FULL_CLEARANCE = "full clearance c of the zone [0, c]"
    GRADE = "tolerance grade"
    NOMINAL = "nominal value"
    CHOICE = "choice"


TOLERANCES = frozenset({Kind.HALF_WIDTH, Kind.STANDARD_DEVIATION, Kind.FULL_CLEARANCE, Kind.GRADE})
"""The kinds that are tolerances: a narrower one is tighter and more expensive."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A named input of a physical model.

    `assumed` marks a default that no document prints; it is reported as an assumption. The default
    gives the type: a list keeps its length (an empty one takes any), the names in a table are
    `choices`, each with its unit.
    `need` is what an item takes where the parameter is a count: of units, positions, points.
    """

    name: str
    default: Value
    unit: str
    meaning: str
    source: str = ""
    assumed: bool = False
    low: float = -inf
    high: float = inf
    open_low: bool = False
    choices: tuple[str, ...] = ()
    need: Need | None = None
    readings: Mapping[str, Value] = field(default_factory=dict)
    """Other defaults, by the value of the parameter `reading`."""


READING = "reading"
"""Name of the parameter (an interpretation of a document) that sets several others together."""


def completed(parameters: Iterable[Parameter], stated: Mapping[str, Value]) -> dict[str, Value]:
    """Every parameter: as stated, else its default in the stated or the default interpretation."""
    declared = {parameter.name: parameter for parameter in parameters}
    reading = stated.get(READING, declared[READING].default if READING in declared else None)
    return {
        name: parameter.readings.get(str(reading), parameter.default) for name, parameter in declared.items()
    } | dict(stated)


@dataclass(frozen=True, slots=True)
class Variable:
    """A design variable: its search range in `unit`, and the document's own choice.

    `labels` name the values 0, 1, ... of a choice: tables hold the name, designs the number.
    """

    name: str
    unit: str
    kind: Kind
    low: float
    high: float
    meaning: str
    document: float | None = None
    mid: float | None = None
    integer: bool = False
    valid_low: float = -inf
    valid_high: float = inf
    assumed: str = ""
    random: bool = False
    labels: tuple[str, ...] = ()

    @property
    def tolerance(self) -> bool:
        """Whether the variable is a tolerance rather than a nominal value."""
        return self.kind in TOLERANCES


@dataclass(frozen=True, slots=True)
class Output:
    """A named output of a model or problem.

    `scale` normalises a limit whose bound is 0. `larger_is_better` makes a bare number in
    `[limits]` a lower limit. `error_of` names the output whose numerical error this output states.
    """

    name: str
    unit: str
    meaning: str
    scale: float = 1.0
    larger_is_better: bool = False
    low: float = -inf
    high: float = inf
    error_of: str = ""


@dataclass(frozen=True, slots=True)
class Assumption:
    """A default that no document prints, as `tolevo check` and `summary.json` name it."""

    name: str
    value: Value
    unit: str
    reason: str
    set_by: str = "default"


# Types of numpy arrays in annotations.


Array = NDArray[np.float64]
Single = NDArray[np.float32]
Complex = NDArray[np.complex128]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


# Names with a dot, `gap.variation`, as keys: quoted, or in a table of their own.


class Nested:
    """A section in which `gap.variation` may be `"gap.variation"`, or `variation` of `[gap]`; so at any depth."""

    def __init__(self, section: Section, names: Sequence[str]) -> None:
        self._section = section
        inner: dict[str, list[str]] = {}
        for head, dot, rest in (name.partition(".") for name in names):
            inner.setdefault(head, []).extend([rest] if dot else [])
        self._tables = {
            head: Nested(section.section(head), rests)
            for head, rests in inner.items()
            if rests and head in section and (head not in names or isinstance(section.take(head), Mapping))
        }

    def find(self, name: str) -> tuple[Section, str]:
        """The section in which a name is a key, and the key."""
        head, _, rest = name.partition(".")
        if not rest or head not in self._tables:
            return self._section, name
        table, key = self._tables[head].find(rest)
        if name in self._section and key in table:
            self._section.take(name)
            self._section.fault(name, f'is given twice: as "{name}" and in [{head}]')
        return (self._section, name) if name in self._section else (table, key)

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
