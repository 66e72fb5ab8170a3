"""`tolevo reproduce`: every claim recomputed, its verdict, files."""

from __future__ import annotations

import hashlib
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import TypeAdapter

from ... import page_data
from ...directory import Ownership, own_folder
from ...errors import Fault, InputError, RunError, raise_all, refuse
from ...execution import Executor, Lost
from ...files import csv_text, read_record, write_bytes, write_record, write_text
from ...page.drawing import as_png, as_svg
from ...page_data import as_json, records
from .claims import Checked, Claim, ClaimsProgress, ClaimTask, ReproduceOutcome, ReproducePlan, Verdict, Word, check
from .page import claims_page, figures
from .records import ClaimsResult, ComputedTable

# From checked claims to the table of verdicts.


Pairs = Sequence[tuple[ClaimTask, Checked]]


def assemble_result(plan: ReproducePlan, pairs: Pairs) -> ClaimsResult:
    """The result of all claims."""
    documents = tuple(source.file.document for source in plan.sources)
    table = pd.DataFrame([row(documents[task.document].name, task.claim, checked) for task, checked in pairs])
    counts = pd.crosstab(table["document"], table["verdict"])
    counts = counts.reindex(index=[document.name for document in documents], columns=list(map(str, Word)), fill_value=0)
    counts = counts.rename_axis(columns=None)
    return ClaimsResult(table=table, counts=counts, documents=documents, tables=tables_of(pairs))


def row(document: str, claim: Claim, checked: Checked) -> dict[str, Any]:
    """A row of `claims.csv`; several numbers of one claim are a list."""
    verdict = checked.verdict
    shown = verdict.outcome
    return {
        "document": document,
        "id": claim.id,
        "place": claim.place,
        "quantity": claim.quantity,
        "printed": list(claim.printed),
        "printed_as": claim.printed_as,
        "unit": claim.unit,
        "relation": claim.relation,
        "tolerance": claim.tolerance,
        "tolerance_reason": claim.tolerance_reason,
        "computed": list(shown.computed) if shown else [],
        "standard_error": list(shown.standard_error) if shown else [],
        "deviation": list(shown.deviation) if shown else [],
        "verdict": str(verdict.word),
        "reading": shown.states if shown else "",
        "reason": verdict.reason,
        "ambiguous": claim.ambiguous,
        "lost": claim.lost,
        "recomputed_by": shown.by if shown else "",
        "readings": [
            {
                "reading": outcome.states,
                "recomputed_by": outcome.by,
                "computed": list(outcome.computed),
                "standard_error": list(outcome.standard_error),
                "deviation": list(outcome.deviation),
                "holds": outcome.holds,
            }
            for outcome in verdict.outcomes
        ],
    }


def tables_of(pairs: Pairs) -> dict[str, ComputedTable]:
    """Every different table by the stem of its file; equal names are distinguished by the claim."""
    tables: dict[str, ComputedTable] = {}
    for task, checked in pairs:
        for name, table in checked.tables.items():
            same_name = [earlier for stem, earlier in tables.items() if stem.split(".")[0] == name]
            if not any(_are_equal_tables(table, earlier) for earlier in same_name):
                tables[f"{name}.{task.claim.id}" if name in tables else name] = table
    return tables


def _are_equal_tables(a: ComputedTable, b: ComputedTable) -> bool:
    return a.columns == b.columns and all(
        np.array_equal(first, second) for first, second in zip(a.values, b.values, strict=True)
    )


def lines(result: ClaimsResult) -> tuple[str, ...]:
    """The summary that the terminal shows."""
    messages = [f"done: {len(result.table)} claims of {len(result.documents)} documents"]
    for name, counts in result.counts.iterrows():
        verdicts = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
        messages.append(f"{name}: {verdicts}")
    return tuple(messages)


# Checked claims on disk, each whole or not at all, so that a reproduction can be resumed.


STORAGE_TABLES = TypeAdapter(dict[str, ComputedTable])
VERDICT = TypeAdapter(Verdict)
FOLDER = "checked"
"""Folder below the output directory."""


def keep(folder: Path, task: ClaimTask, checked: Checked) -> None:
    """Write a checked claim."""
    (folder / FOLDER).mkdir(exist_ok=True)
    tables = STORAGE_TABLES.dump_python(dict(checked.tables), mode="json")
    write_record(_path(folder, task), {"key": task.key, "verdict": asdict(checked.verdict), "tables": tables})


def read_checked(folder: Path, task: ClaimTask) -> Checked | None:
    """A claim that was checked before, None where it is not there or the claim has changed.

    Raises InputError where the file is not as it was written.
    """
    path = _path(folder, task)
    try:
        record = read_record(path)
        if record is None or record["key"] != task.key:
            return None
        return Checked(VERDICT.validate_python(record["verdict"]), STORAGE_TABLES.validate_python(record["tables"]))
    except (ValueError, KeyError, TypeError) as error:
        raise refuse(str(path), f"cannot be read: {error}; remove it, or start again with --overwrite") from error


def read_kept_claims(folder: Path, tasks: Iterable[ClaimTask]) -> dict[str, Checked]:
    """Every claim that was checked before, by its key. Raises InputError with all damaged ones."""
    checked_claims, faults = dict[str, Checked](), list[Fault]()
    for task in tasks:
        try:
            checked = read_checked(folder, task)
        except InputError as error:
            faults += error.faults
            continue
        if checked is not None:
            checked_claims[task.key] = checked
    raise_all(faults)
    return checked_claims


def _path(folder: Path, task: ClaimTask) -> Path:
    return folder / FOLDER / f"{task.document}_{task.number}.json"


# The files of a reproduction. Each appears whole or not at all.


TABLES, FIGURES = "tables", "figures"


def write(result: ClaimsResult, folder: Path) -> None:
    """Verdicts as CSV and JSON, the tables and figures of the calculations, and the page."""
    page_data.write_tables(replace(result, table=flatten_claims(result.table)), folder)
    write_text(folder / "claims.json", as_json(claims_record(result)))
    for stem, table in result.tables.items():
        (folder / TABLES).mkdir(exist_ok=True)
        write_text(folder / TABLES / f"{stem}.csv", csv_text(frame_of(table)))
    for drawing in figures(result):
        (folder / FIGURES).mkdir(exist_ok=True)
        write_bytes(folder / FIGURES / f"{drawing.name}.png", as_png(drawing.figure))
        write_bytes(folder / FIGURES / f"{drawing.name}.svg", as_svg(drawing.figure))
    write_text(folder / page_data.NAME, page_data.dump_result(result))
    write_text(folder / "report.html", claims_page(result))


def flatten_claims(table: pd.DataFrame) -> pd.DataFrame:
    """The table without interpretations that are not shown; several numbers are joined by `; `."""
    flat_table = table.drop(columns="readings")
    for name in ("printed", "computed", "standard_error", "deviation"):
        flat_table[name] = ["; ".join(map(repr, values)) for values in flat_table[name]]
    return flat_table


def claims_record(result: ClaimsResult) -> dict[str, Any]:
    """`claims.json`."""
    claims = records(result.table)
    return {
        "documents": [
            {
                "document": document.name,
                "title": document.title,
                "reference": document.reference,
                "verdicts": {str(word): int(count) for word, count in row.items()},
                "claims": [claim for claim in claims if claim["document"] == document.name],
            }
            for document, (_, row) in zip(result.documents, result.counts.iterrows(), strict=True)
        ]
    }


def frame_of(table: ComputedTable) -> pd.DataFrame:
    """A table of a calculation, units in its names where they have one."""
    return pd.DataFrame(dict(zip((column.name for column in table.columns), table.values, strict=True)))


GO_ON = "run the same command with --resume to continue"
Report = Callable[[ClaimsProgress], None]


def reproduce(
    plan: ReproducePlan,
    out: Path,
    executor: Executor,
    progress: Report | None = None,
    resume: bool = False,
    overwrite: bool = True,
) -> ReproduceOutcome:
    """Check every claim of `plan` that `out` does not have, then write the files.

    The files do not depend on the executor or on breaks. Claims checked before an interrupt are
    kept. Raises RunError or ModelError where a claim cannot be computed, InputError where `out`
    holds something else that --resume cannot continue, or has another owner.
    """
    with own_folder(out, "reproduce", resume, overwrite) as place:
        return _reproduce(plan, place, executor, progress, resume)


def _reproduce(
    plan: ReproducePlan, place: Ownership, executor: Executor, progress: Report | None, resume: bool
) -> ReproduceOutcome:
    tasks, out = tuple(tasks_of(plan)), place.folder
    if resume and not place.blank and not (place.folder / FOLDER).is_dir():
        raise refuse("--resume", f"{out} holds no claims: name the directory of a reproduction")
    known = read_kept_claims(out, tasks) if resume else {}
    begin = len(known)
    place.begin(keep=[_path(out, task).relative_to(out).as_posix() for task in tasks if task.key in known])
    try:
        _finish(tasks, known, out, executor, progress)
    except KeyboardInterrupt:
        saved = f"interrupted: {len(known)} of {len(tasks)} claims are checked and saved in {out}; {GO_ON}"
        return ReproduceOutcome("interrupted", out, (saved,), None)
    result = assemble_result(plan, [(task, known[task.key]) for task in tasks])
    write(result, out)
    place.complete()
    resumed_note = (f"{begin} claims had been checked before",) if begin else ()
    return ReproduceOutcome("done", out, (*lines(result), *resumed_note), result)


def tasks_of(plan: ReproducePlan) -> Iterable[ClaimTask]:
    """One task per claim, in the order of the files."""
    for document, source in enumerate(plan.sources):
        for number, claim in enumerate(source.file.claims):
            parts = (version("tolevo"), source.tables, str(source.file.seed), claim.id)
            key = hashlib.sha256("\n".join(parts).encode()).hexdigest()
            yield ClaimTask(key, document, number, claim, source.file.seed)


def _finish(
    tasks: tuple[ClaimTask, ...], known: dict[str, Checked], out: Path, executor: Executor, progress: Report | None
) -> None:
    """Check what is not known yet, and keep each claim as soon as it is checked."""
    remaining = deque(task for task in tasks if task.key not in known)
    start, before = time.monotonic(), len(known)

    def report(note: str = "") -> None:
        if progress is not None:
            seconds = time.monotonic() - start
            progress(ClaimsProgress(len(known), len(tasks), seconds, note, before))

    report()
    with executor:
        for task, outcome in executor.completed(check, lambda: remaining.popleft() if remaining else None):
            if isinstance(outcome, Lost):
                raise RunError(f"claim {task.claim.id}: {outcome.reason}; {GO_ON}")
            known[task.key] = outcome
            keep(out, task, outcome)
            report(task.claim.id)
