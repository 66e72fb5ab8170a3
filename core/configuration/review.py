"""`tolevo review`: the problem of a run, reopened with parts that were made to its drawing."""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import tables
from ..csv_text import read_own_csv
from ..errors import Fault, InputError, nearest, raise_all
from ..problems.promise import ASSURED, PLUG_IN, PROMISED, YIELD
from ..problems.stack import Stack
from .measured_files import SUFFIXES, measured_in, together
from .reader import read_table
from .source import Table, load

REPLACED = ("distribution", "cp", "cpk", "shift", "measured")
"""Keys of a part whose process is told by parts that were made."""
ALLOCATION = ("point", "variable", "rounded")
GAP = "gap.json"


@dataclass(frozen=True)
class Reopened:
    """The stack of a run, the full design its drawing has, and the same stack as production says.

    `now` takes the means of the parts as they are found, `reset` as the run's configuration does,
    None where no allocation keeps the promise then;
    `since` is by earlier parts, where there are any. `made` are the parts with new values.
    `attributed` says what an analysis of the units' own measurement found.
    """

    before: Stack
    design: dict[str, float]
    now: Stack
    reset: Stack | None
    made: tuple[str, ...]
    since: Stack | None = None
    attributed: str = ""


def reopened(
    run: Path, parts: Sequence[Path], since: Sequence[Path], options: tables.ReadOptions
) -> Reopened:
    """The problem of the run in a directory with the parts of some files; raises InputError with
    every fault. A directory among them is the result of `tolevo gap` on the units themselves.
    """
    faults: list[Fault] = []
    table, design = _run(run, faults)
    units = [path for path in parts if path.is_dir()]
    files = [path for path in parts if not path.is_dir()]
    attributed = "; ".join(_attributed(path, faults) for path in units)
    if not files:
        faults.append(Fault("PARTS", "names no file of measured parts"))
    if table is None:
        raise InputError(faults)
    _with_promise(table, faults)
    now = _anew(table, design, files, options, faults)
    earlier = _anew(table, design, since, options, faults) if since else None
    raise_all(faults)
    assert now is not None
    found = [_stack(one, faults) for one in (
        table, _means_found(now), now, *([_means_found(earlier)] if earlier else []))]  # fmt: skip
    raise_all(faults)
    before, as_found = found[0], found[1]
    assert before is not None
    assert as_found is not None
    made = tuple(str(one["name"]) for one, old in zip(now["part"], table["part"], strict=True)
                 if one is not old)  # fmt: skip
    return Reopened(before, design, as_found, found[2], made,
                    found[3] if earlier else None, attributed)  # fmt: skip


def _run(run: Path, faults: list[Fault]) -> tuple[Table | None, dict[str, float]]:
    """The resolved tables of a run and the rounded design of its first choice."""
    table = load(run / "config.toml", faults)
    if table is not None and table.get("problem") != "stack":
        text = "is the run of another problem: the promise of a stack can be reviewed"
        faults.append(Fault(str(run), text))
        return None, {}
    try:
        found = read_own_csv(run / "allocation.csv")
    except (OSError, ValueError):
        text = "has no allocation.csv: it is no complete run with a choice"
        faults.append(Fault(str(run), text))
        return table, {}
    if found.empty or not set(ALLOCATION) <= set(found):
        faults.append(Fault(str(run), "has an allocation.csv without an allocation"))
        return table, {}
    own = found[found["point"] == found["point"].iloc[0]]
    return table, {name: value for name, value in zip(own["variable"], own["rounded"], strict=True)
                   if str(name).endswith("_t")}  # fmt: skip


def _with_promise(table: Table, faults: list[Fault]) -> None:
    """Have a run without a promise promise the yield that it was limited to."""
    if "promise" in table:
        table["limits"] = _without_promise(table.get("limits", {}))
        return
    limit = table.get("limits", {}).pop(YIELD, None)
    share = limit.get("min") if isinstance(limit, dict) else limit
    if share is None:
        text = "promises nothing: it has neither [promise] nor a limit on yield_percent"
        faults.append(Fault("RUN", text))
        return
    table["promise"] = {YIELD: share, "statement": ASSURED}


def _without_promise(limits: Table) -> Table:
    """Limits without those that a promise sets, of each requirement."""
    return {name: _without_promise(own) if isinstance(own, dict) else own
            for name, own in limits.items() if name not in (YIELD, PROMISED)}  # fmt: skip


def _anew(
    table: Table,
    design: dict[str, float],
    files: Sequence[Path],
    options: tables.ReadOptions,
    faults: list[Fault],
) -> Table | None:
    """The tables with the values of the files in the place of what was known of the parts."""
    found = copy.copy(table)
    found["part"] = [_part(part, design, files, options, faults) for part in table["part"]]
    if not faults and all(one is old for one, old in zip(found["part"], table["part"],
                                                        strict=True)):  # fmt: skip
        names = ", ".join(str(part["name"]) for part in table["part"])
        faults.append(Fault("PARTS", f"hold no characteristic of the run: name columns or "
                            f"characteristics like its parts ({names})"))  # fmt: skip
    return found


def _part(
    part: Table,
    design: dict[str, float],
    files: Sequence[Path],
    options: tables.ReadOptions,
    faults: list[Fault],
) -> Table:
    known = part.get("measured") or {}
    wanted = {str(name) for name in (part["name"], part.get("characteristic"),
                                     known.get("characteristic")) if name}  # fmt: skip
    place = f"PARTS ({part['name']})"
    found, names = [], []
    for path in files:
        one = _values(path, wanted, options, faults)
        if one is not None:
            found.append(one)
            names.append(path.name)
    if not found:
        return part
    own: dict[str, Any] = together(found, names, place, faults)
    if any(key in part for key in ("machine", "process")):
        text = "has machines or processes to choose from: state what the parts say in them"
        faults.append(Fault(place, text))
        return part
    t = design.get(f"{part['name']}_t", float(part.get("tolerance") or 0.0))
    stated = own.pop("made_to", None)
    if stated is not None and abs(stated - t) > 1e-6 * t and own.get("unit") == part["unit"]:
        faults.append(Fault(place, f"were made to {stated:g} {part['unit']}, the run's drawing has "
                            f"{t:g} {part['unit']}: another revision?"))  # fmt: skip
    own |= {key: known[key] for key in ("gauge", "mean") if key in known}
    own |= {"made_to": f"{t!r} {part['unit']}"}
    return {key: value for key, value in part.items() if key not in REPLACED} | {"measured": own}


def _values(
    path: Path, wanted: set[str], options: tables.ReadOptions, faults: list[Fault]
) -> dict[str, Any] | None:
    """The values of the first wanted characteristic of a file, None where it has none."""
    try:
        names = _names(path, options)
        name = next((one for one in names if one in wanted), None)
        return None if name is None else measured_in(path, name, options)
    except InputError as error:
        for fault in error.faults:
            if fault not in faults:
                faults.append(fault)
        return None


def _names(path: Path, options: tables.ReadOptions) -> list[str]:
    if path.suffix.lower() in SUFFIXES:
        known = tables.read_aqdef(path, options.encoding)
        return [name for one in known for name in (one.number, one.name, one.label) if name]
    found = tables.opened_whole(path, path.name, options)
    return [*found.numeric, *(found.headers.get(name, name) for name in found.numeric)]


def _means_found(table: Table) -> Table:
    """The tables with the means of all samples as they are found, whether or not that is enough."""
    found = table | {"promise": table["promise"] | {"statement": PLUG_IN}}
    found["part"] = [
        part | {"measured": part["measured"] | {"mean": "as_found"}} if "measured" in part else part
        for part in table["part"]
    ]
    return found


def _stack(table: Table, faults: list[Fault]) -> Stack | None:
    """The problem of some tables; None where it has faults, or limits that nothing keeps."""
    try:
        problem = read_table(copy.deepcopy(table), []).problem
    except InputError as error:
        faults += [one for one in error.faults
                   if one not in faults and not one.place.startswith("limits.")]  # fmt: skip
        return None
    assert isinstance(problem, Stack)
    return problem


def _attributed(folder: Path, faults: list[Fault]) -> str:
    """What `gap.json` in a directory says in one phrase."""
    try:
        found = json.loads((folder / GAP).read_text(encoding="utf-8"))
        names = [str(one["name"]) for one in found.get("effects") or ()]
        return f"{found['verdict']}" + (f": {', '.join(names)}" if names else "")
    except (OSError, ValueError, KeyError, TypeError):
        near = nearest(GAP, [path.name for path in folder.glob("*.json")])
        faults.append(Fault(str(folder), f"is no result of `tolevo gap`: it has no {GAP}{near}"))
        return ""
