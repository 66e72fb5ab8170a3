"""`[vary]`: the keys of the run configuration that a study varies, and over what."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import deepcopy
from typing import Any

from ..counts import SETTINGS
from ..errors import nearest
from ..section import Range, Section, flat, shown
from ..workflows.study.records import Factor, Level
from .merging import merge
from .source import Table

RANGE_KEYS = ("low", "high", "levels", "log", "integer")
SEED = "seed"


def read_factors(section: Section, table: Table, base: Mapping[str, Any]) -> tuple[Factor, ...]:
    """The factors of `[vary]`; `base` holds the values of the resolved run by dotted key.

    Keys may be quoted ("algorithm.population") or written as tables; both mean the same.
    """
    factors = []
    for key, value in _entries(table).items():
        section.accept([key.split(".")[0], key])
        if key == SEED or key.startswith("run."):
            hint = "replicates differ by their seeds: set seeds" if key == SEED else "leave out `run.`"
            section.fault(key, f"cannot be varied: {hint}")
        elif key not in base:
            known = ", ".join(_neighbours(key, base))
            text = f"is not a setting of this run that has a value{nearest(key, base)}"
            section.fault(key, f"{text}; settings of the same table: {known}" if known else text)
        else:
            factors.append(_factor(section, key, value, base[key]))
    section.finish()
    if not factors and not table:
        section.fault("", "is empty: name at least one key of the run configuration")
    return tuple(factor for factor in factors if factor is not None)


def _entries(table: Table) -> dict[str, Any]:
    """Levels or ranges by dotted key."""
    entries: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict) and not value.keys() & set(RANGE_KEYS):
            entries |= {f"{key}.{rest}": levels for rest, levels in _entries(value).items()}
        else:
            entries[key] = value
    return entries


def _neighbours(key: str, base: Mapping[str, Any]) -> list[str]:
    """Keys of the run in the same table."""
    place = key.rpartition(".")[0]
    return [neighbour for neighbour in base if neighbour.rpartition(".")[0] == place and neighbour != SEED]


def _factor(section: Section, key: str, value: Any, base_value: Any) -> Factor | None:
    """A factor from its levels or range; `base_value` is the value in the run configuration."""
    if isinstance(value, list):
        return _levels(section, key, value, base_value)
    if isinstance(value, dict):
        return _range(section, key, value, isinstance(base_value, int) and not isinstance(base_value, bool))
    section.fault(key, f"must be a list of values or a table with low and high, got {shown(value)}")
    return None


def _levels(section: Section, key: str, value: list[Any], base_value: Any) -> Factor | None:
    kinds = {str: (str, "a name"), int: (int, "a whole number")}
    kind, wanted = kinds.get(type(base_value), ((int, float), "a number"))
    if not value:
        section.fault(key, "names no values")
    known = set[Any]()
    for at, level in enumerate(value):
        if not isinstance(level, kind) or isinstance(level, bool):
            section.fault(f"{key}[{at}]", f"must be {wanted}, got {shown(level)}")
            return None
        if level in known:
            section.fault(key, f"names {shown(level)} twice")
            return None
        known.add(level)
    levels = tuple(float(level) if isinstance(base_value, float) else level for level in value)
    return Factor(key, levels, integer=isinstance(base_value, int)) if levels else None


def _range(section: Section, key: str, value: Table, whole: bool) -> Factor | None:
    limits = section.of(key, value)
    low, high = limits.number("low"), limits.number("high")
    count = limits.integer("levels", Range(low=2), SETTINGS)
    log, integer = limits.flag("log") or False, limits.flag("integer")
    limits.finish()
    if low is None or high is None:
        if "low" not in value or "high" not in value:
            section.fault(key, "needs low and high")
        return None
    if low >= high:
        section.fault(key, f"low must be below high, got low = {low:g} and high = {high:g}")
        return None
    if log and low <= 0.0:
        section.fault(key, f"a logarithmic range must begin above 0, got low = {low:g}")
        return None
    integer = whole if integer is None else integer
    if integer and (low != int(low) or high != int(high)):
        section.fault(key, f"is a whole number, got low = {low:g} and high = {high:g}")
        return None
    return Factor(key, (), low, high, log, integer, count)


def variable_table(run: Table, keys: Iterable[str], resolved: Mapping[str, Any]) -> Table:
    """The run's tables, those resolved whose short forms the keys lead through.

    `limits.yaw_mrad.max` is a key of the resolved run, where the file may say `yaw_mrad = 0.2`.
    """
    tables = deepcopy(run)
    for key in keys:
        if not merge(deepcopy(tables), _nested(key, 0.0)):
            top = key.split(".")[0]
            tables[top] = deepcopy(resolved[top])
    return tables


def with_values(table: Table, values: Mapping[str, Level]) -> Table:
    """A copy of the run's tables with other values of some keys (dotted)."""
    copy = deepcopy(table)
    for key, value in values.items():
        merge(copy, _nested(key, value))
    return copy


def _nested(key: str, value: Any) -> Table:
    for name in reversed(key.split(".")):
        value = {name: value}
    nested: Table = value
    return nested


def base_values(run: Table, resolved: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers and names of a run by dotted key, as its file and as its resolved form have them."""
    written = {k: float(v) if isinstance(v, int) else v for k, v in _scalar_entries(run).items()}
    return written | _scalar_entries(resolved)


def _scalar_entries(table: Mapping[str, Any]) -> dict[str, Any]:
    """Values that can be varied: no truth values, no lists."""
    return {
        key: value
        for key, value in flat(table).items()
        if isinstance(value, int | float | str) and not isinstance(value, bool)
    }
