"""From a file or a dictionary, and the `--set` options of the command line, to raw tables."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import tomli_w

from .. import registry
from ..algorithms.settings import AlgorithmSettings, Budget
from ..errors import Fault, InputError, nearest, raise_all
from ..files import CONFIGURATION, content, is_pipe
from ..problems.plain import PlainProblem
from ..problems.tolerance_problem import ToleranceProblem
from ..section import is_forced
from .plugins import Named, merge, named_tables
from .resolved import complete_tables

# Objects in the place of names: a problem or an algorithm in a dictionary of a configuration.


BUDGET_AND_ENGINE_KEYS = (*(field.name for field in fields(Budget)), "engine")
"""Keys of `[algorithm]` that are not of the algorithm."""


def replace_objects(tables: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with names and settings in the place of objects.

    A problem of this suite becomes the tables that describe it, which the other given tables
    override; any other object becomes a name that keeps the object. An algorithm becomes its table.
    """
    described, problem = dict(tables), tables.get("problem")
    if isinstance(problem, PlainProblem):
        described["problem"] = Named.of(problem.pymoo_problem)
    elif isinstance(problem, ToleranceProblem):
        stated = {key: value for key, value in described.items() if key != "problem"}
        merge(described := _tables_of_problem(problem), stated, whole=True)
    elif problem is not None and not isinstance(problem, str):
        described["problem"] = Named.of(problem)
    if isinstance(algorithm := described.get("algorithm"), AlgorithmSettings):
        described["algorithm"] = algorithm_table(algorithm)
    return described


def algorithm_table(algorithm: AlgorithmSettings) -> dict[str, Any]:
    """The `[algorithm]` table of an algorithm's settings."""
    settings: dict[str, Any] = asdict(algorithm)  # type: ignore[call-overload]
    return {"name": registry.name_of("algorithms", type(algorithm)), **settings}


def _tables_of_problem(problem: ToleranceProblem) -> dict[str, Any]:
    """The tables that make a problem again, as a file has them."""
    name = registry.name_of("problems", type(problem))
    return tomllib.loads(tomli_w.dumps(complete_tables(problem, name, problem.declaration.model)))


def replace_algorithm(table: dict[str, Any], algorithm: AlgorithmSettings | None, seed: int | None) -> dict[str, Any]:
    """The tables with another algorithm and seed, where they are given; budget and engine stay."""
    chosen: dict[str, Any] = {} if seed is None else {"seed": seed}
    if algorithm is not None:
        stated = table.get("algorithm", {})
        kept = {key: stated[key] for key in BUDGET_AND_ENGINE_KEYS if isinstance(stated, dict) and key in stated}
        chosen["algorithm"] = algorithm_table(algorithm) | kept
    return table | chosen


Table = dict[str, Any]
Source = Path | Mapping[str, Any]
"""A TOML file, the workbook of a stack, or a dictionary with the keys of such a file."""


TABLES = 10_000
"""Tables of a file at most."""
DEPTH = 64
"""Parts of a dotted name at most."""
LIST = 2000
"""Tables of a list, keys of a table, and characters of a key, at most; a list of numbers or texts may be longer."""
TEXT = 32_767
"""Characters of a text at most, as in a cell of a workbook."""
SHOWN = 200
"""Characters of a text that a message repeats."""
ZIP = b"PK\x03\x04"
"""How a workbook begins, which is a ZIP file."""
EXECUTION = "execution"
"""The table of where a command computes, see `read_execution`."""


def folder_of(source: Source) -> Path:
    """The folder in which the files that a configuration names are looked for."""
    return source.parent if isinstance(source, Path) else Path()


def override_source(source: Source, overrides: Sequence[str], faults: list[Fault]) -> Table:
    """The tables of a configuration with `key=value` overrides; a bad one is added to `faults`.

    Raises InputError where a file cannot be read.
    """
    table = load(source, faults)
    if table is None:
        raise InputError(faults)
    override(table, overrides, faults)
    return table


def load(source: Source, faults: list[Fault]) -> Table | None:
    """The tables of a configuration, which may be changed, or None and the fault of its file.

    The table `[execution]`, of where to compute, is left out.
    """
    table = _load_source(source, faults)
    if table is not None:
        table.pop(EXECUTION, None)
    return table


def parsed_tables(source: Source, overrides: Sequence[str]) -> Table:
    """All tables of a configuration, with overrides; empty where it cannot be read."""
    table = _load_source(source, []) or {}
    _merge_settings(table, overrides, [])
    return table


def at_hand(source: Source) -> Source:
    """The configuration; one that comes through a pipe is read, as it can be read but once.

    Raises InputError where that is not possible.
    """
    if not isinstance(source, Path) or not is_pipe(source):
        return source
    faults: list[Fault] = []
    table = _load_source(source, faults)
    raise_all(faults)
    return table or {}


def _load_source(source: Source, faults: list[Fault]) -> Table | None:
    if not isinstance(source, Path):
        return deepcopy(replace_objects(source))
    place = str(source)
    try:
        read = content(source, CONFIGURATION, pipe=True)
        if read.startswith(ZIP):
            return _sheets(read, source.name, faults)
        text = read.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        message = f"is not UTF-8 (byte {error.start}): save it as UTF-8"
    except ValueError as error:
        message = str(error)
    else:
        if text.strip():
            return _parse_text(text, place, faults)
        message = "is empty: a configuration must state at least a problem or a model"
    faults.append(Fault(place, message))
    return None


def _sheets(read: bytes, place: str, faults: list[Fault]) -> Table | None:
    """The tables of a workbook, as far as its cells can be read. Raises InputError where it is none."""
    from .workbook import read_sheets

    sheets, before = read_sheets(read, place), len(faults)
    _measure(sheets.tables, "", faults)
    faults += sheets.faults
    return deepcopy(sheets.tables) if len(faults) - len(sheets.faults) == before else None


def workbook_of(source: object) -> bytes:
    """The bytes of a configuration that is a workbook, empty where it is something else."""
    try:
        read = content(source, CONFIGURATION) if isinstance(source, Path) else b""
    except ValueError:
        return b""
    return read if read.startswith(ZIP) else b""


def located(error: InputError, source: Source) -> InputError:
    """The error with the cells of its faults, where the configuration is a workbook."""
    if not isinstance(source, Path) or not (read := workbook_of(source)):
        return error
    from .workbook import located as in_cells

    return in_cells(error, read, source.name)


def _parse_text(text: str, place: str, faults: list[Fault]) -> Table | None:
    if complaint := _parse_effort_fault(text):
        faults.append(Fault(place, complaint))
        return None
    table, before = deepcopy(_tables(text)), len(faults)
    if isinstance(table, str):
        faults.append(Fault(place, f"is not valid TOML: {table}"))
        return None
    _measure(table, "", faults)
    return table if len(faults) == before else None


@lru_cache(maxsize=2)
def _tables(text: str) -> Table | str:
    """The tables of a text, which a command reads several times, or what is wrong with it."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of thousands of digits is no TOML error
        reason = str(error)
        return reason if len(reason) <= SHOWN else f"{reason[:SHOWN]}..."


def _parse_effort_fault(text: str) -> str:
    """Why a text would take long to parse: too many tables, or names of too many parts."""
    if is_forced():
        return ""
    if (count := text.count("[[") + text.count("{")) > TABLES:
        return f"has about {count} tables, {TABLES} are the most that are read: leave some out, or add --force"
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") <= DEPTH:
            continue
        names = [line] if line.lstrip().startswith("[") else line.split("=")[:-1]
        if any(name.count(".") > DEPTH and "," not in name for name in names):
            return f"line {number}: a name has more than {DEPTH} parts, which is the most that is read"
    return ""


def _measure(value: Any, place: str, faults: list[Fault]) -> None:
    """A fault for every text and every list of tables or texts that is too long."""
    if isinstance(value, str) and len(value) > TEXT:
        text = f"has {len(value)} characters, {TEXT} are the most that are read: shorten it, or add --force"
    elif isinstance(value, list) and len(value) > LIST and any(isinstance(entry, dict | list) for entry in value):
        text = f"has {len(value)} entries, {LIST} are the most that are read: leave some out, or add --force"
    elif isinstance(value, dict) and len(value) > LIST:
        text = f"has {len(value)} keys, {LIST} are the most that are read: leave some out, or add --force"
    elif isinstance(value, dict) and any(len(key) > LIST for key in value):
        text = f"has a key of more than {LIST} characters, which is the most that is read: shorten it"
    else:
        entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        for key, entry in entries:
            if isinstance(entry, str | dict | list):
                name = f"[{key}]" if isinstance(value, list) else f".{str(key)[:SHOWN]}" if place else str(key)[:SHOWN]
                _measure(entry, f"{place}{name}", faults)
        return
    if not is_forced():
        faults.append(Fault(place or "configuration", text))


def override(table: Table, settings: Sequence[str], faults: list[Fault]) -> None:
    """Apply `key=value` settings to `table`; a value that is not TOML is taken as a string.

    Settings of `[execution]`, of where to compute, are left out.
    """
    _merge_settings(table, settings, faults)
    table.pop(EXECUTION, None)


def _merge_settings(table: Table, settings: Sequence[str], faults: list[Fault]) -> None:
    for setting in settings:
        key, sign, value = setting.partition("=")
        parsed = _setting(key.strip(), value.strip()) if sign else None
        if parsed is None:
            faults.append(Fault("--set", f'must be key=value, got "{setting}"'))
        elif not merge(table, parsed):
            faults.append(Fault(f"--set {key.strip()}", _obstacle(table, parsed)))


def _obstacle(table: Table, over: Mapping[str, Any]) -> str:
    """Why a value cannot be put into tables."""
    key, value = next(iter(over.items()))
    inner = table.get(key)
    if isinstance(value, dict) and isinstance(inner, list) and (named := named_tables(inner)):
        name = next(iter(value))
        if name not in named:
            return f'"{name}" is not the name of a [[{key}]]{nearest(name, named)}; there are {", ".join(named)}'
        inner, value = named[name], value[name]
    if isinstance(value, dict) and isinstance(inner, dict):
        return _obstacle(inner, value)
    return "leads through a value that is not a table"


def _setting(key: str, value: str) -> Table | None:
    quoted = '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    for text in (value, quoted):
        try:
            return tomllib.loads(f"{key} = {text}") if "\n" not in key else None
        except (ValueError, RecursionError):
            continue
    return None


# What a configuration is of: a run, a study or a gap analysis.


GAP_ONLY = ("built_to", "free", "effects", "noise", "validation", "data", "settings", "next_measurement")
"""Tables that only the configuration of a gap analysis has."""


def is_gap(source: Source) -> bool:
    """Whether a configuration has a table that only that of a gap analysis has."""
    table = load(source, [])
    return table is not None and "model" in table and not table.keys().isdisjoint(GAP_ONLY)


def is_study(source: Source) -> bool:
    """Whether a configuration is that of a study."""
    table = load(source, [])
    return table is not None and "run" in table and "vary" in table
