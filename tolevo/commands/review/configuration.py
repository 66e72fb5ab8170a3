"""`tolevo review`: the problem of a run, reopened with parts that were made to its drawing."""

from __future__ import annotations

import copy
import hashlib
import itertools
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from ... import tables
from ...configuration.cost_files import MeasuredFile, join_characteristics, opened_parts
from ...configuration.parameters import BOUNDS
from ...configuration.reader import read_table
from ...configuration.source import Table, load
from ...errors import Fault, InputError, UnknownKey, nearest, raise_all
from ...execution import pinned
from ...files import content, read_own_csv
from ...problems.promise import WithPromise
from ...problems.settings import ASSURED, PLUG_IN, PROMISED, YIELD
from ...problems.stack import Stack
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Kind
from ...units import split_unit
from ..run.tolerances import nominal_and_mid
from .review import Reopened, review

REPLACED = ("distribution", "cp", "cpk", "shift", "measured")
"""Keys of a part that are replaced by the measurements of parts that were made."""
ALLOCATION = ("point", "variable", "rounded")
GAP = "gap.json"
YIELDS = (YIELD, "ring_yield_percent")
"""Outputs whose limit means a promise."""


def reopen_run(run: Path, parts: Sequence[Path], since: Sequence[Path], options: tables.ReadOptions) -> Reopened:
    """The problem of the run in a directory with the parts of some files; raises InputError with
    every fault. A directory among them is the result of `tolevo gap` on the units themselves.
    """
    faults: list[Fault] = []
    table, allocated = _run(run, faults)
    units = [path for path in parts if path.is_dir()]
    files = [path for path in parts if not path.is_dir()]
    attributed = "; ".join(_attribution_phrase(path, faults) for path in units)
    if not files:
        faults.append(Fault("PARTS", "names no file of measured parts"))
    if table is None:
        raise InputError(faults)
    _add_promise(table, faults)
    before = _problem(table, faults)
    if before is None:
        raise InputError(faults)
    design = _design(before, allocated)
    owners = written_owners(table, _owners(table, before, design))
    sizes = {label: (size, owner.unit) for owner in owners if (size := owner.nominal) for label in owner.names}
    options = replace(options, sizes=sizes)
    notes: list[str] = []
    now = _replace_samples(table, owners, _open_files(files, options, faults), faults, notes)
    earlier = _replace_samples(table, owners, _open_files(since, options, faults), faults, notes) if since else None
    raise_all(faults)
    shifting = {owner.name for owner in owners if owner.shifts}
    present, reset = _problem(_with_sample_means(now[0], shifting), faults), _problem(now[0], faults)
    previous = _problem(_with_sample_means(earlier[0], shifting), faults) if earlier else None
    raise_all(faults)
    assert present is not None
    assert reset is not None
    again = tuple(name for name in now[1] if earlier and name in earlier[1])
    within_reach = None if reset.out_of_reach() else reset
    notes = list(dict.fromkeys(notes))
    return Reopened(before, design, present, within_reach, now[1], previous, attributed, again, tuple(notes))


@pinned()
def review_text(run: Path, parts: Sequence[Path], since: Sequence[Path], options: tables.ReadOptions) -> str:
    """The text of `tolevo review`: sentences and the table of the parts. Raises InputError with
    every fault.
    """
    opened = reopen_run(run, parts, since, options)
    result = review(opened)
    table = result.parts.dropna(axis="columns", how="all").to_string(index=False, float_format="%.4g", na_rep="-")
    return "\n".join([*(f"note: {note}" for note in opened.notes), *result.lines, "", table])


def _run(run: Path, faults: list[Fault]) -> tuple[Table | None, dict[str, Any]]:
    """The resolved tables of a run and the rounded design of its first choice, as the files have it."""
    if not run.is_dir():
        missing = "is a file" if run.exists() else "does not exist"
        faults.append(Fault(str(run), f"{missing}: name the directory of a run"))
        return None, {}
    table = load(run / "config.toml", faults)
    try:
        allocation = read_own_csv(run / "allocation.csv")
        front = read_own_csv(run / "front.csv")
    except (OSError, ValueError):
        faults.append(Fault(str(run), "has no allocation.csv: it is not a complete run with a choice"))
        return table, {}
    if allocation.empty or not set(ALLOCATION) <= set(allocation):
        faults.append(Fault(str(run), "has an allocation.csv without an allocation"))
        return table, {}
    point = int(allocation["point"].iloc[0])
    chosen = allocation[allocation["point"] == point]
    searched = front.iloc[point].to_dict() if point < len(front) else {}
    rounded = zip(chosen["variable"], chosen["rounded"], strict=True)
    return table, {str(name): value for name, value in (*searched.items(), *rounded) if not pd.isna(value)}


def _design(problem: ToleranceProblem, allocated: Mapping[str, Any]) -> dict[str, float]:
    """A design by variable, a process or grade as the place of its name among the choices."""
    design = {}
    for variable in problem.variables:
        value, labels = allocated.get(variable.name), list(map(str, variable.labels))
        if str(value) in labels:
            design[variable.name] = float(labels.index(str(value)))
        elif (number := tables.number_in(str(value))) == number:
            design[variable.name] = number
    return design


def _add_promise(table: Table, faults: list[Fault]) -> None:
    """Give a run without a promise the yield of its limits as its promise."""
    if "promise" in table:
        table["limits"] = _remove_promise(table.get("limits", {}))
        return
    limits = table.get("limits", {})
    limit = next((limits.pop(name) for name in YIELDS if name in limits), None)
    yield_percent = limit.get("min") if isinstance(limit, dict) else limit
    if yield_percent is None:
        faults.append(Fault("RUN", "promises no yield: it has neither [promise] nor a limit on yield_percent"))
        return
    table["promise"] = {YIELD: yield_percent, "statement": ASSURED}


def _remove_promise(limits: Table) -> Table:
    """Limits without those that a promise sets, of every requirement."""
    return {
        name: _remove_promise(bound) if isinstance(bound, dict) else bound
        for name, bound in limits.items()
        if name not in (*YIELDS, PROMISED)
    }


@dataclass(frozen=True)
class Owner:
    """A part of a stack or a variable that is measured: its table, unit and half-width.

    `follows` means that its scatter follows the tolerance, `shifts` that its mean may be that of
    the sample, `chosen` that it is made on machines or processes to choose from. `written` is the
    characteristic of its limits, mid +- t, that `tolevo template qdas` writes.
    """

    name: str
    unit: str
    table: Table
    t: float
    follows: bool = True
    shifts: bool = True
    chosen: bool = False

    mid: float = 0.0
    natural: str = ""
    size: float | None = None
    written: tables.Characteristic | None = None

    @property
    def nominal(self) -> float:
        """Its nominal size, 0 where none is stated."""
        stated = self.table.get("nominal", self.size)
        return float(stated) if isinstance(stated, int | float) else 0.0

    @property
    def names(self) -> set[str]:
        """Names under which files may hold its measurements."""
        known = self.table.get("measured") or {}
        labels = self.name, self.table.get("characteristic"), known.get("characteristic")
        return {str(name) for name in (*labels, split_unit(self.name)[0]) if name}

    def anew(self, measured: Table) -> Table:
        """Its table with the values of measured parts."""
        replaced = REPLACED if self.follows else (*REPLACED, *BOUNDS)
        kept = {key: value for key, value in self.table.items() if key not in replaced}
        return kept | {"measured": measured}


def _owners(table: Table, problem: ToleranceProblem, design: dict[str, float]) -> list[Owner]:
    """The parts of a stack, or the variables of which parts can be measured."""
    if isinstance(problem, Stack):
        return [
            Owner(
                str(part["name"]),
                part["unit"],
                part,
                design.get(f"{part['name']}_t", float(part.get("tolerance") or 0.0)),
                chosen=bool({"machine", "process", "grade"} & set(part)),
                mid=known.mid,
                natural={-1: "lower", 1: "upper"}.get(known.natural, ""),
            )
            for part, known in zip(table["part"], problem.definition.parts, strict=True)
        ]
    stated, owners = table.get("variables", {}), []
    for v in problem.variables:
        follows = v.random and v.kind is Kind.HALF_WIDTH
        if follows or v.kind is Kind.STANDARD_DEVIATION:
            table_of_variable = stated.get(v.name, {})
            mid = problem.settings.variables[v.name].mid
            t = problem.fixed.get(v.name, design.get(v.name, 0.0))
            shifts, chosen = mid is not None, "machine" in table_of_variable
            size, _ = nominal_and_mid(problem, v)
            owners.append(Owner(v.name, v.unit, table_of_variable, t, follows, shifts, chosen, mid or 0.0, size=size))
    return owners


def written_owners(table: Table, owners: Sequence[Owner]) -> list[Owner]:
    """The owners with the characteristics of their limits: numbers of the drawing, or their place.

    Parts without a drawing are of one that is named after their limits, so that another allocation
    has another one.
    """
    limits = [(o.name, round(o.nominal + o.mid - o.t, 12), round(o.nominal + o.mid + o.t, 12)) for o in owners]
    digest = hashlib.sha256(repr(limits).encode()).hexdigest()[:8]
    title = str(table.get("name") or "allocation")
    stated = {str(o.table.get("characteristic")) for o in owners}
    places = iter(number for at in itertools.count(1) if (number := str(at)) not in stated)
    anew = []
    for owner, (name, lower, upper) in zip(owners, limits, strict=True):
        number = str(owner.table.get("characteristic") or next(places))
        drawing = str(owner.table.get("drawing") or table.get("drawing") or digest)
        natural = {"K2120": "2"} if owner.natural == "lower" else {"K2121": "2"} if owner.natural else {}
        ends = owner.nominal, lower, upper, owner.unit
        anew.append(replace(owner, written=tables.Characteristic(title, drawing, name, number, *ends, keys=natural)))
    return anew


def drawing_text(run: Path) -> str:
    """The allocation of the run in a directory as a Q-DAS file. Raises InputError with every fault."""
    faults: list[Fault] = []
    table, allocated = _run(run, faults)
    problem = None if table is None else _problem(table, faults, promises=False)
    raise_all(faults)
    assert table is not None
    assert problem is not None
    owners = written_owners(table, _owners(table, problem, _design(problem, allocated)))
    return tables.aqdef_text([owner.written for owner in owners if owner.written is not None])


def _open_files(paths: Sequence[Path], options: tables.ReadOptions, faults: list[Fault]) -> list[MeasuredFile]:
    """The opened files."""
    opened = []
    for path in paths:
        try:
            opened.append(opened_parts(path, options))
        except InputError as error:
            faults += [fault for fault in error.faults if fault not in faults]
    return opened


def _replace_samples(
    table: Table, owners: Sequence[Owner], files: Sequence[MeasuredFile], faults: list[Fault], notes: list[str]
) -> tuple[Table, tuple[str, ...]]:
    """The tables with the values of the files in place of earlier ones, and whose are new."""
    measured = {owner.name: _measured_table(owner, files, faults, notes) for owner in owners}
    anew = {name: table_of_owner for name, table_of_owner in measured.items() if table_of_owner is not None}
    for file in files:
        meant = {name: [o.name for o in owners if _refers_to_owner(file, o, name)] for name in file.labels}
        for name, both in meant.items():
            if len(both) > 1:
                text = f"{name} is {' and '.join(both)}, by its name and by its number: correct one of them"
                faults.append(Fault(file.place, text))
        if unused := [name for name, owners_of_name in meant.items() if not owners_of_name]:
            notes.append(f"{file.place}: not used: {', '.join(unused)}")
    if not anew and not faults:
        names = ", ".join(owner.name for owner in owners)
        text = "hold no characteristic of the run: name columns or characteristics like its parts"
        faults.append(Fault("PARTS", f"{text} ({names})"))
    if "part" in table:
        return table | {"part": [anew.get(str(part["name"]), part) for part in table["part"]]}, tuple(anew)
    return table | {"variables": dict(table.get("variables", {})) | anew}, tuple(anew)


def _refers_to_owner(file: MeasuredFile, owner: Owner, name: str) -> bool:
    """Whether a characteristic of a file is that of an owner."""
    written = owner.written
    if written is not None and file.numbers.get((written.part_number, written.number)) == name:
        return True
    return any(label in owner.names for label, characteristic in file.names.items() if characteristic == name)


_CHOSEN = "has machines, processes or grades to choose from: state the measurements in them, or fix its tolerance"


def _measured_table(owner: Owner, files: Sequence[MeasuredFile], faults: list[Fault], notes: list[str]) -> Table | None:
    """The table of an owner with what the files hold of it; None where they hold nothing."""
    samples, names = [], []
    for file in files:
        for name in dict.fromkeys(name for name in file.names.values() if _refers_to_owner(file, owner, name)):
            try:
                if not (read := file.values(name))["values"]:
                    notes.append(f"{file.place}: {name} has no values: not measured")
                    continue
                samples.append(read)
                names.append(file.place)
            except InputError as error:
                faults += error.faults
    notes += [note for sample in samples for note in sample.pop("notes", ())]
    if not samples:
        return None
    place = f"PARTS ({owner.name})"
    sample: dict[str, Any] = join_characteristics(samples, names, place, faults)
    if owner.chosen:
        faults.append(Fault(place, _CHOSEN))
        return None
    stated, t, unit = sample.pop("made_to", None), owner.t, owner.unit
    if stated is not None and owner.follows and sample.get("unit") == unit and abs(stated - t) > 1e-6 * t:
        text = f"were made to {stated:g} {unit}, the run's drawing has {t:g} {unit}: another revision?"
        faults.append(Fault(place, text))
    known = owner.table.get("measured") or {}
    sample |= {key: known[key] for key in ("gauge", "mean") if key in known}
    sample |= {} if owner.shifts else {"mean": "corrected"}
    sample |= {"made_to": f"{t!r} {unit}"} if owner.follows else {}
    sample |= {"nominal": f"{owner.size!r} {unit}"} if owner.size and "nominal" not in sample else {}
    return owner.anew(sample)


def _with_sample_means(table: Table, shifting: Collection[str]) -> Table:
    """The tables with the mean of every sample as measured, even if the promise then fails."""

    def with_mean(name: str, owner_table: Any) -> Any:
        if name not in shifting or not isinstance(owner_table, dict) or "measured" not in owner_table:
            return owner_table
        return owner_table | {"measured": owner_table["measured"] | {"mean": "as_found"}}

    anew = table | {"promise": table["promise"] | {"statement": PLUG_IN}}
    if "part" in table:
        return anew | {"part": [with_mean(str(part["name"]), part) for part in table["part"]]}
    variables = table.get("variables", {})
    return anew | {"variables": {name: with_mean(name, owner_table) for name, owner_table in variables.items()}}


def _problem(table: Table, faults: list[Fault], promises: bool = True) -> ToleranceProblem | None:
    """The problem of some tables, in reach of its limits or not; None where it has faults."""
    try:
        problem = read_table(copy.deepcopy(table), [], reachable=False).problem
    except InputError as error:
        unknown = [fault for fault in error.faults if fault.place == "promise" and isinstance(fault, UnknownKey)]
        if unknown:
            faults.append(Fault("RUN", "is the run of a problem that makes no promises"))
        faults += [fault for fault in error.faults if fault not in (*faults, *unknown)]
        return None
    assert problem is not None
    assert not promises or isinstance(problem, (Stack, WithPromise))
    return problem


def _attribution_phrase(folder: Path, faults: list[Fault]) -> str:
    """What `gap.json` in a directory says in one phrase."""
    try:
        analysis = json.loads(content(folder / GAP))
        names = [str(effect["name"]) for effect in analysis.get("effects") or ()]
        return f"{analysis['verdict']}" + (f": {', '.join(names)}" if names else "")
    except (OSError, ValueError, KeyError, TypeError):
        near = nearest(GAP, [path.name for path in folder.glob("*.json")])
        faults.append(Fault(str(folder), f"is not a result of `tolevo gap`: it has no {GAP}{near}"))
        return ""
