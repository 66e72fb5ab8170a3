"""`[reducers]`: the reducers of a machine, by configuration, by a finished run, or by a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import tables
from ..directory import incompleteness
from ..errors import Fault, InputError
from ..files import is_file, is_folder, read_own_csv
from ..section import POSITIVE, Section
from .plugins import ProblemClass
from .source import load

if TYPE_CHECKING:
    from ..problems.nested_reducers import Nested

NESTED_TABLES = ("problem", "parameters", "variables", "costs", "propagation", "objectives", "limits")
"""The tables of a run configuration that mean its reducer."""
POINTS = ("rms_arcmin", "cost")
"""Columns of a table of prices."""
EXPECTED = (
    "name a configuration of rv_backlash, the directory of a finished run of rv_backlash or rv_reducer, a table "
    "(.csv) with the columns rms_arcmin and cost, or write either as a table here"
)


def fill_reducers(top: Section, problem_class: ProblemClass | None, folder: Path) -> Section:
    """The configuration with the reducers in the place of `[reducers]`, for a problem that nests
    them; a faulty one is left as it is written.
    """
    if problem_class is None:
        return top
    if rows := problem_class.declaration.reducers_in:
        return _fill_row_reducers(top, rows, folder)
    keys = problem_class.declaration.reducers
    if not keys or "reducers" not in top:
        return top
    reducers = read_reducers(top, keys, folder)
    return top if reducers is None else top.having("reducers", reducers)


def _fill_row_reducers(top: Section, key: str, folder: Path) -> Section:
    """The same for a problem whose `[[joint]]` or other tables each name a reducer (`run`)."""
    known: dict[str, Nested] = {}
    rows = []
    for at, row in enumerate(top.tables(key)):
        stated = row.get("reducer")
        if isinstance(stated, Mapping) and "run" in stated:
            reducer = read_reducer(top.item(key, at).section("reducer"), "run", folder)
            if reducer is not None:
                reducer = known.setdefault(reducer.key, reducer)
            row = {**row, "reducer": {**stated, "run": reducer or stated["run"]}}
        rows.append(row)
    return top.having(key, rows) if rows else top


def read_reducers(top: Section, keys: Sequence[str], folder: Path) -> tuple[Nested, ...] | None:
    """The reducers of `keys`, None if one of them is faulty."""
    section = top.section("reducers")
    reducers: list[Nested] = []
    for key in keys:
        if key not in section:
            section.fault(key, f"is missing: {EXPECTED}")
        elif (reducer := read_reducer(section, key, folder)) is not None:
            reducers.append(reducer)
    section.finish()
    first = {reducer.key: reducer for reducer in reversed(reducers)}
    return tuple(first[reducer.key] for reducer in reducers) if len(reducers) == len(keys) else None


def read_reducer(section: Section, key: str, folder: Path) -> Nested | None:
    """One reducer, written at `key` of a section; every fault at its place."""
    value = section.take(key)
    if isinstance(value, Mapping):
        if "problem" in value:
            return _reducer_by_tables(section, key, dict(value), f"{value['problem']} of this configuration", folder)
        return _reducer_by_points(section.section(key))
    if not isinstance(value, str):
        section.fault(key, f"must be a string or a table: {EXPECTED}")
        return None
    path = folder / value
    if is_folder(path):
        return _reducer_by_run(section, key, path, value)
    if path.suffix == ".csv":
        return _reducer_by_file(section, key, path, value)
    faults: list[Fault] = []
    table = load(path, faults)
    if table is None:
        section.fault(key, "; ".join(f"{fault.place} {fault.message}" for fault in faults))
        return None
    return _reducer_by_tables(section, key, table, value, path.parent)


def _reducer_by_tables(section: Section, key: str, table: dict[str, Any], source: str, folder: Path) -> Nested | None:
    """A reducer by the tables of a run configuration, whose files are looked for in `folder`."""
    from ..problems.nested_reducers import Nested, block_of
    from ..problems.rv_backlash import RvBacklash
    from .reader import read_tables

    name = table.get("problem")
    if name == "rv_reducer":
        section.fault(
            key,
            f"{source} is a configuration of rv_reducer, whose front takes a run: "
            "run it, and name the directory of the finished run",
        )
        return None
    if name != "rv_backlash":
        stated = f'the problem "{name}", which is not a reducer' if name else "no problem"
        section.fault(key, f"{source} has {stated}: {EXPECTED}")
        return None
    configuration = section.attempt(
        lambda: read_tables(table, folder, []), lambda fault: (f"{key}: {fault.place}", fault.message)
    )
    if configuration is None:
        return None
    problem = configuration.problem
    assert isinstance(problem, RvBacklash)
    block = block_of(problem)
    if isinstance(block, str):
        section.fault(key, f"{source} cannot be nested: {block}")
        return None
    return Nested(source, {name: configuration.resolved[name] for name in NESTED_TABLES}, problem)


def _reducer_by_run(section: Section, key: str, folder: Path, source: str) -> Nested | None:
    """A reducer by the directory of a finished run."""
    if faults := incompleteness(folder):
        section.fault(key, "; ".join(map(str, faults)))
        return None
    table, front = load(folder / "config.toml", []), folder / "front.csv"
    if table is None or not front.is_file():
        section.fault(key, f"{source} holds no finished run of a reducer (config.toml, front.csv)")
        return None
    if table.get("problem") != "rv_reducer":
        return _reducer_by_tables(section, key, table, f"the run {source}", folder)
    frame = read_own_csv(front)
    parts = ["backlash_rms_arcmin_mean", "backlash_rms_arcmin_std", "cost"]
    if missing := [name for name in parts if name not in frame]:
        section.fault(key, f"{source}/front.csv lacks {', '.join(missing)}")
        return None
    mean, std = (frame[name].to_numpy(dtype=float) for name in parts[:2])
    rms = (mean**2 + std**2) ** 0.5
    return _check_points(section, key, rms.tolist(), frame["cost"].tolist(), f"the run {source}")


def _reducer_by_file(section: Section, key: str, path: Path, source: str) -> Nested | None:
    if not is_file(path):
        section.fault(key, f"{source} does not exist")
        return None
    try:
        frame = tables.open_or_raise(path, source, tables.NO_OPTIONS).frame
        rms, cost = (frame[name].to_numpy(dtype=float).tolist() for name in POINTS)
    except (InputError, KeyError, ValueError) as error:
        section.fault(key, f"{source} must have numbers in the columns rms_arcmin and cost: {error}")
        return None
    return _check_points(section, key, rms, cost, source)


def _reducer_by_points(section: Section) -> Nested | None:
    """A reducer by a table of prices in the configuration."""
    columns = [section.numbers(name) for name in POINTS]
    for name in POINTS:
        if name not in section:
            section.fault(name, "is missing: a table of prices needs rms_arcmin and cost")
    source = section.text("source") or "a table of prices"
    section.finish()
    if columns[0] is None or columns[1] is None:
        return None
    return _check_points(section, "", list(columns[0]), list(columns[1]), source)


def _check_points(section: Section, key: str, rms: list[float], cost: list[float], source: str) -> Nested | None:
    """Checked points of cost over rms backlash."""
    text = ""
    if len(rms) != len(cost) or len(rms) < 3:
        text = f"needs at least three points, as many rms_arcmin as cost, got {len(rms)}, {len(cost)}"
    elif any(POSITIVE.complaint(value) for value in rms):
        text = "rms_arcmin must be above 0"
    elif any(value < 0.0 for value in cost):
        text = "cost must not be negative"
    elif min(zip(rms, cost, strict=True))[1] <= min((-error, price) for error, price in zip(rms, cost, strict=True))[1]:
        text = "cost must fall as rms_arcmin grows"
    if text:
        section.fault(key, f"{source}: {text}")
        return None
    from ..problems.nested_reducers import Nested

    return Nested(source, {"rms_arcmin": rms, "cost": cost, "source": source}, None, (tuple(rms), tuple(cost)))
