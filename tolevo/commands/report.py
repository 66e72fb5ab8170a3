"""`tolevo report`: pages built again from what directories hold."""

from __future__ import annotations

import hashlib
import json
import re
import time
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from .. import page_data
from ..algorithms.checkpoint import Checkpoint
from ..directory import BUSY, KINDS, MANIFEST, Standing, seal_of, standing
from ..directory.lock import Held, acquire
from ..directory.standing import fits, present_files
from ..errors import Fault, InputError, raise_all, refuse
from ..files import read_own_csv, read_record, write_bytes, write_text
from ..page.document import add_reload, unfinished_page
from ..page.drawing import as_png, as_svg
from ..page.page import figures as run_figures
from ..page.page import page
from ..records import FORMAT, AnalysisResult, Axis, Bars, RunResult, StudyResult, Table, tables_of
from ..units import split_unit
from .comparison import compare_runs
from .comparison_page import comparison_figure, comparison_page
from .gap.records import GapResult
from .reproduce.records import ClaimsResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Report", "report", "watch"]

# The saved part of a result that is being computed, or was interrupted.


COLUMNS = ["generation", "evaluations", "seconds", "hypervolume", "feasible_fraction"]
"""Columns of the history in the checkpoint of a run."""


def remark_of(here: Standing) -> str:
    """The remark on a directory that is not finished, or in use; empty for others."""
    if here.unfinished is None:
        return f"is complete, but {here.holders} is at work here" if here.holders else ""
    if here.holders:
        return f"is missing: this result is unfinished, {here.holders} is at work on it"
    return (
        f"is missing: this result of `tolevo {here.command}` is unfinished; run the same "
        "command with --resume to continue"
    )


def course(folder: Path) -> pd.DataFrame | None:
    """The convergence of a run as far as its search was saved, None where it was not."""
    from .run.front import CHECKPOINT

    path = folder / CHECKPOINT
    if not path.is_file():
        return None
    try:
        state = Checkpoint.read(path).saved()
    except InputError:
        return None
    return None if state is None else pd.DataFrame(state["run.history"], columns=COLUMNS)


def facts(folder: Path, here: Standing) -> tuple[str, ...]:
    """What has been saved, in sentences."""
    if here.unfinished is not None and here.unfinished.retiring:
        return ("An older result was being replaced; nothing of the new one was saved.",)
    if here.command == "study":
        runs = _runs(folder)
        return (f"{len(runs)} runs have ended." if len(runs) else "No run has ended.",)
    state = present_files(folder, KINDS[here.command].state) if here.command in KINDS else []
    if not state:
        return ("Nothing has been saved.",)
    if here.command == "gap":
        lines = (folder / state[0]).read_bytes().count(b"\n") - 1
        return (f"{max(lines, 0)} replicates have ended.",)
    if here.command == "reproduce":
        return (f"{len(state)} claims have been checked.",)
    return ("No generation has been saved.",)


def tables(folder: Path, here: Standing) -> dict[str, pd.DataFrame]:
    """The results so far, by title: responses of a study by setting, claims by verdict, effects in
    the replicates of a gap analysis.
    """
    if here.unfinished is not None and here.unfinished.retiring:
        return {}
    builders = {"study": _responses, "reproduce": _checked_claims, "gap": _replicates}
    return builders[here.command](folder) if here.command in builders else {}


def _responses(folder: Path) -> dict[str, pd.DataFrame]:
    """Median of every response over the runs that have ended, by point of the design."""
    from .study.plan import RESPONSES

    runs = _runs(folder)
    names = [name for name in RESPONSES if name in runs and runs[name].notna().any()]
    if runs.empty or not names:
        return {}
    medians = runs.groupby("point")[names].median()
    medians.insert(0, "runs ended", runs.groupby("point").size())
    return {"Medians so far, by point of the design": medians.reset_index()}


def _checked_claims(folder: Path) -> dict[str, pd.DataFrame]:
    """Claims that have been checked, with their verdicts."""
    rows = []
    for name in present_files(folder, KINDS["reproduce"].state):
        try:
            record = read_record(folder / name)
        except ValueError:
            continue
        verdict = record.get("verdict") if isinstance(record, dict) else None
        if isinstance(verdict, dict):
            stated = {"verdict": str(verdict.get("word", "")), "reason": str(verdict.get("reason", ""))}
            rows.append({"claim": Path(name).stem} | stated)
    return {"Claims checked so far": pd.DataFrame(rows)} if rows else {}


def _replicates(folder: Path) -> dict[str, pd.DataFrame]:
    """Effects identified in the replicates of a bootstrap that have ended, and their estimates."""
    from .gap.uncertainty import FILE  # with the whole analysis

    values: dict[tuple[str, str], list[float]] = {}
    named: dict[str, int] = {}
    ended = 0
    path = folder / FILE
    for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else ():
        try:
            effects = json.loads(line)["effects"]
        except (ValueError, KeyError, TypeError):  # its first line, or an incomplete line
            continue
        ended += 1
        for effect, numbers in effects.items():
            named[effect] = named.get(effect, 0) + 1
            for parameter, value in numbers.items():
                values.setdefault((effect, parameter), []).append(float(value))
    rows = [
        {"effect": effect, "named in [%]": 100.0 * named[effect] / ended, "parameter": parameter}
        | dict(zip(("5 %", "median", "95 %"), np.quantile(estimates, (0.05, 0.5, 0.95)), strict=True))
        for (effect, parameter), estimates in values.items()
    ]
    title = f"Effects in the {ended} replicates so far; the answer follows when all have ended"
    return {title: pd.DataFrame(rows)} if rows else {}


def _runs(folder: Path) -> pd.DataFrame:
    """The runs of a study that have ended, with their responses; none where nothing can be read."""
    from .study.plan import RESPONSES
    from .study.storage import DAMAGE, DATABASE, Database, Unusable

    try:
        with Database(folder / DATABASE, reading=True) as database:
            rows = database.responses_by_point()
    except (*DAMAGE, Unusable):
        rows = []
    return pd.DataFrame(rows, columns=["point", *RESPONSES])


# The files of a result directory, read with a remark for everything that is wrong with them.


TEXT = ("violated_limits", "rounded_violated_limits", "grade", "unit", "meaning")
"""Columns of text that may be empty."""
SHOWN = 3
"""Bad cells of a column that are named; the rest is counted."""


class Stored:
    """A directory; what is missing or wrong is returned as None and noted in `remarks`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.remarks: list[str] = []
        self.standing = standing(folder)
        if text := remark_of(self.standing):
            self.remark(MANIFEST, text)

    def remark(self, name: str, text: str) -> None:
        """Add a remark on a file."""
        self.remarks.append(f"{name}: {text}")

    @property
    def unfinished(self) -> bool:
        """Whether the result is being computed, or was interrupted."""
        return self.standing.unfinished is not None

    def missing(self) -> None:
        """Remark which files of a complete result are gone, unless that has been remarked."""
        kind = KINDS.get(self.standing.command)
        remarked = {remark.split(": ")[0] for remark in self.remarks}
        for name in self.standing.missing:
            if name not in remarked and kind is not None and not fits(name, kind.state):
                self.remark(name, "is missing")

    def text(self, name: str, needed: bool = True) -> str | None:
        """The text of a file."""
        try:
            return (self.folder / name).read_text(encoding="utf-8")
        except FileNotFoundError:
            if needed:
                self.remark(name, "is missing")
        except UnicodeDecodeError:
            self.remark(name, "is not UTF-8 text")
        except OSError as error:
            self.remark(name, f"cannot be read ({error.strerror})")
        return None

    def record(self, name: str) -> dict[str, Any]:
        """The object in a JSON file, empty where there is none."""
        text = self.text(name)
        if text is None:
            return {}
        try:
            content = json.loads(text)
        except ValueError as error:
            self.remark(name, f"is not JSON ({error}): was it edited by hand?")
            return {}
        if not isinstance(content, dict):
            self.remark(name, "holds no JSON object: was it edited by hand?")
            return {}
        return content

    def table(self, name: str, numeric: Iterable[str] = (), needed: bool = True) -> pd.DataFrame | None:
        """A CSV table; rows without a finite number in a column of `numeric` are left out."""
        if self.text(name, needed) is None:
            return None
        try:
            frame = read_own_csv(self.folder / name)
        except (ValueError, OSError) as error:  # pandas' own errors are ValueErrors
            self.remark(name, f"is not a table ({str(error).strip()}): was it edited by hand?")
            return None
        blank = {column: frame[column].astype(object).fillna("") for column in TEXT if column in frame}
        return self.numbered(frame.assign(**blank), name, numeric)

    def numbered(self, frame: pd.DataFrame, name: str, numeric: Iterable[str]) -> pd.DataFrame:
        """The table without rows that lack a number where there must be one."""
        valid = np.ones(len(frame), dtype=bool)
        typed = frame.copy()
        for column in numeric:
            if column not in frame:
                continue
            values = pd.to_numeric(frame[column], errors="coerce")
            good = np.isfinite(values.to_numpy(dtype=float))
            self._bad_cells(name, column, np.flatnonzero(~good))
            typed[column] = values
            valid &= good
        return typed[valid].reset_index(drop=True)

    def _bad_cells(self, name: str, column: str, rows: np.ndarray) -> None:
        if len(rows):
            named = ", ".join(str(row + 2) for row in rows[:SHOWN])
            more = f" and {len(rows) - SHOWN} more" if len(rows) > SHOWN else ""
            self.remark(name, f"line {named}{more}, column {column}: no finite number; left out")

    def edited(self, hashes: Mapping[str, Any]) -> None:
        """Remark which files are not as they were written, by their SHA-256."""
        for name, known in hashes.items():
            path = self.folder / Path(str(name)).name  # a missing file is remarked where it is read
            if path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() != known:
                self.remark(path.name, "was changed after it was written; shown as it is now")

    def newer(self, name: str, versions: Any, format_: Any, known: int) -> None:
        """Remark whether a newer version wrote this."""
        written = str(versions.get("tolevo", "")) if isinstance(versions, Mapping) else ""
        of_format = isinstance(format_, int) and format_ > known
        if of_format or _parts(written) > _parts(version("tolevo")):
            self.remark(
                name,
                f"was written by a newer version ({written or 'unknown'}, format {format_}; this is "
                f"{version('tolevo')}, format {known}): what it has beyond that is not shown; update tolevo",
            )


def _parts(text: str) -> tuple[int, ...]:
    """The numbers of a version: "0.10.1" is after "0.9"."""
    match = re.match(r"\d+(\.\d+)*", text)
    return tuple(int(part) for part in match[0].split(".")) if match else ()


# The result of a run from its directory.


SUMMARY = "summary.json"
TABLES = tables_of(RunResult)
OPTIONAL = tuple(held.name for held in fields(RunResult) if held.name in TABLES and held.default is None)
OBJECTS = ("versions", "ideal", "nadir", "axes", "files", "choices", "units", "assumptions_at", "answers", "mechanism")
LISTS = ("notes", "assumptions", "bars", "rounding", "validity")
KINDS_OF_RUN: dict[str, type] = (
    dict.fromkeys(OBJECTS, dict) | dict.fromkeys(LISTS, list) | {"title": str, "format": int}
)
"""Types of the entries of the summary, where the page depends on them."""
TOLERANCES = "tolerances.json"
NAMED = {"name", "unit", "kind", "low", "high", "free", "orderable", "grades", "costs"}
"""What a record of it must have."""


def stored_run(stored: Stored) -> RunResult | None:
    """The result as far as it is there; None where nothing of it can be shown."""
    summary = _valid_summary(stored.record(SUMMARY), stored)
    if stored.unfinished:
        summary.setdefault("status", "unfinished")
    stored.newer(SUMMARY, summary.get("versions"), summary.get("format"), FORMAT)
    stored.edited(summary.get("files") or {})
    configuration = stored.text("config.toml") or ""
    objectives, variables = _axes(summary, configuration)
    names = [axis.name for axis in objectives]
    front = _front(stored, names)
    missing = [name for name in names if name not in front]
    if len(front) and missing:
        stored.remark("front.csv", f"has no column {', '.join(missing)}")
    objectives = tuple(axis for axis in objectives if axis.name in front or front.empty)
    references = stored.table("references.csv", [axis.name for axis in objectives])
    convergence = _convergence(stored)
    if front.empty and _is_missing(references) and _is_missing(convergence):
        return None
    return RunResult(
        title=str(summary.get("title") or stored.folder.resolve().name),
        front=front,
        references=_table_with_columns(references, TABLES["references"], stored),
        convergence=_table_with_columns(convergence, TABLES["convergence"], stored),
        summary=summary,
        objectives=objectives,
        variables=tuple(axis for axis in variables if axis.name in front),
        notes=tuple(map(str, summary.get("notes") or ())),
        bars=_bars(summary),
        configuration=configuration,
        tolerances=_tolerances(stored),
        overlays=_overlays(stored, [axis.name for axis in objectives]),
        **_optional(stored, len(front)),
    )


def _tolerances(stored: Stored) -> tuple[Mapping[str, Any], ...]:
    """The records of `tolerances.json`, none where it is missing or not what a run writes."""
    if not (stored.folder / TOLERANCES).is_file():
        return ()
    try:
        records = json.loads(stored.text(TOLERANCES) or "")
    except ValueError:
        records = None
    if isinstance(records, list) and all(isinstance(record, dict) and record.keys() >= NAMED for record in records):
        return tuple(records)
    stored.remark(TOLERANCES, "is not what a run writes: was it edited by hand?")
    return ()


def _convergence(stored: Stored) -> pd.DataFrame | None:
    """`convergence.csv`; of an unfinished run what its search has saved."""
    if stored.unfinished and not (stored.folder / "convergence.csv").is_file():
        return course(stored.folder)
    return stored.table("convergence.csv", ("evaluations", "hypervolume"))


def _is_missing(table: pd.DataFrame | None) -> bool:
    return table is None or table.empty


def _table_with_columns(
    table: pd.DataFrame | None, declared: Table, stored: Stored, more: Sequence[str] = ()
) -> pd.DataFrame:
    """The table, empty where there is none or a column is missing that the page reads, with `more`."""
    return pd.DataFrame() if table is None or _lacks_column(table, declared, stored, more) else table


def _lacks_column(table: pd.DataFrame, declared: Table, stored: Stored, more: Sequence[str] = ()) -> bool:
    """Whether a table lacks a column that the page reads, which is remarked."""
    missing = [column for column in (*declared.columns, *more) if column not in table]
    if missing:
        stored.remark(declared.file, f"has no column {', '.join(missing)}; left out")
    return bool(missing)


def _front(stored: Stored, names: list[str]) -> pd.DataFrame:
    """`front.csv`, or where it cannot be read `front.parquet`."""
    front = stored.table("front.csv", names)
    path = stored.folder / "front.parquet"
    if front is None and path.is_file():
        try:
            table = pd.read_parquet(path)
        except (OSError, ValueError) as error:
            stored.remark(path.name, f"is not a Parquet file ({error})")
        else:
            stored.remark(path.name, "is shown in place of front.csv")
            return stored.numbered(table, path.name, names)
    return pd.DataFrame() if front is None else front


def _overlays(stored: Stored, names: list[str]) -> dict[str, pd.DataFrame]:
    """Fronts of other algorithms by label."""
    declared = TABLES["overlays"]
    overlays = _table_with_columns(stored.table(declared.file, names, needed=False), declared, stored, names)
    if overlays.empty:
        return {}
    groups = overlays.groupby(overlays["label"].astype(str), sort=False)
    return {str(label): front.drop(columns="label").reset_index(drop=True) for label, front in groups}


def _optional(stored: Stored, points: int) -> dict[str, pd.DataFrame | None]:
    tables: dict[str, pd.DataFrame | None] = {}
    for field in OPTIONAL:
        name = TABLES[field].file
        table = stored.table(name, needed=False)
        if table is not None and _lacks_column(table, TABLES[field], stored):
            table = None
        if table is not None and "point" in table:
            rows = pd.to_numeric(table["point"], errors="coerce")
            inside = rows.between(0, points - 1)
            if not inside.all():
                stored.remark(name, f"names points that front.csv does not have ({points} rows): these are left out")
            table = table[inside].assign(point=rows[inside].astype("int64"))
        tables[field] = table
    return tables


def _valid_summary(summary: dict[str, Any], stored: Stored) -> dict[str, Any]:
    """The summary without values of a type that a run does not write."""
    for name, kind in KINDS_OF_RUN.items():
        if name in summary and not isinstance(summary[name], kind):
            stored.remark(SUMMARY, f"{name} is not what a run writes: was it edited by hand?")
    return {name: value for name, value in summary.items() if isinstance(value, KINDS_OF_RUN.get(name, object))}


def _axes(summary: Mapping[str, Any], configuration: str) -> tuple[tuple[Axis, ...], tuple[Axis, ...]]:
    """Objectives and variables; of an older run the objectives by its configuration."""
    axes = summary.get("axes") or {}
    named_axes = [
        tuple(
            Axis(str(axis["name"]), str(axis.get("unit", "")), str(axis.get("meaning", "")))
            for axis in (axes.get(kind) or ())
            if isinstance(axis, dict) and "name" in axis
        )
        for kind in ("objectives", "variables")
    ]
    return named_axes[0] or _objectives_by_configuration(configuration), named_axes[1]


def _objectives_by_configuration(configuration: str) -> tuple[Axis, ...]:
    try:
        names = tomllib.loads(configuration)["objectives"]["minimise"]
    except (tomllib.TOMLDecodeError, KeyError, TypeError):
        return ()
    return tuple(Axis(str(name), split_unit(str(name))[1]) for name in names)


def _bars(summary: Mapping[str, Any]) -> tuple[Bars, ...]:
    """Charts of the problem; those that are not whole are left out."""
    charts = []
    for chart in summary.get("bars") or ():
        whole = isinstance(chart, dict) and {"title", "unit", "labels", "values"} <= chart.keys()
        if whole and len(chart["labels"]) == len(chart["values"]):
            charts.append(Bars(chart["title"], chart["unit"], tuple(chart["labels"]), tuple(chart["values"])))
    return tuple(charts)


# `tolevo report`: the page of one directory, or of several runs side by side.


PAGE = "report.html"
COMPARISON = "comparison.html"
RENEWED = 5.0
"""Seconds between two pages of a result that is being made."""


@dataclass(frozen=True, slots=True)
class Report:
    """A page that was written, and remarks on what is wrong with its files."""

    path: Path
    remarks: tuple[str, ...]
    unfinished: bool = False


def report(folders: Sequence[Path], out: Path | None = None, figures: Path | None = None) -> Report:
    """Build the page of one directory (by default its `report.html`), or compare several runs
    (by default `comparison.html` here).

    With `figures` those of the page are written there too, as PNG and SVG.

    The remarks state what is missing or wrong in a directory, and the rest is built; what is
    unfinished is shown as such. Raises InputError where nothing can be built, where a set of files
    is not of one piece, or where the page would go into a directory that another process works in.
    """
    if len(folders) == 1:
        return _build_page(folders[0], out, figures)
    return _compare_folders(folders, out or Path(COMPARISON), figures)


def _draw(drawn: Mapping[str, Figure], folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in drawn.items():
        write_bytes(folder / f"{name}.png", as_png(figure))
        write_bytes(folder / f"{name}.svg", as_svg(figure))


def _build_page(folder: Path, out: Path | None, figures: Path | None, renew: bool = False) -> Report:
    stored = Stored(folder)
    raise_all(stored.standing.faults)
    kind = stored.standing.command
    result = _result(stored, kind)
    if result is None and not stored.unfinished:
        raise_all(_faults(folder, kind, stored.remarks))
    stored.missing()
    remarks = tuple(stored.remarks)
    if result is None:
        sentences, frames = facts(folder, stored.standing), tables(folder, stored.standing)
        text = unfinished_page(folder.resolve().name, kind, sentences, remarks, frames)
        _write(stored, out, add_reload(text) if renew else text)
        return Report(out or folder / PAGE, remarks, unfinished=True)
    _, build, draw = _pages()[kind]
    text, going = build(result, remarks), stored.unfinished
    _write(stored, out, add_reload(text) if renew and going else text)
    if figures is not None:
        _draw(draw(result), figures)
    return Report(out or folder / PAGE, remarks, going)


def watch(folder: Path, out: Path, on_page: Callable[[Report], None] | None = None) -> Report:
    """Build the page of a directory every `RENEWED` seconds until its result is complete.

    The page `out` lies outside of the directory, for another process works in that; a browser loads
    it again by itself. `on_page` is called with every page. An interrupt ends it. Raises InputError
    as `report` does, but for what is written while it is read.
    """
    while True:
        try:
            built = _build_page(folder, out, None, renew=True)
        except InputError:
            if not standing(folder).holders:
                raise
        else:
            if on_page is not None:
                on_page(built)
            if not built.unfinished:
                return built
        time.sleep(RENEWED)


def _result(stored: Stored, kind: str) -> Any:
    """The result that a directory holds, as far as it is there; None where there is nothing."""
    mark = stored.standing.unfinished
    if mark is not None and mark.retiring:
        return None
    return stored_run(stored) if kind == "run" else _from_page_data(stored, kind)


def _write(stored: Stored, out: Path | None, text: str) -> None:
    """Write the page: into the directory itself only while no other process works there.

    Raises InputError where that is so, or where the result has changed since it was read.
    """
    folder = stored.folder
    if out is not None:
        _check_unchanged(stored)
        write_text(out, text)
        return
    try:
        lock = acquire(folder, "report")
    except Held as other:
        raise refuse("report", f"{folder} {BUSY.format(other)}; or name a page by --out") from None
    try:
        _check_unchanged(stored)
        write_text(folder / PAGE, text)
    finally:
        lock.release()


def _check_unchanged(stored: Stored) -> None:
    if seal_of(stored.folder) != stored.standing.seal:
        raise refuse("report", f"{stored.folder} was written to while it was read; run the command again")


def _from_page_data(stored: Stored, kind: str) -> Any:
    """The result of a directory that stores what its page is made of; None where it does not."""
    pages = _pages()
    if kind not in pages:
        return None
    content = stored.record(page_data.NAME)
    if not content:
        return None
    stored.newer(page_data.NAME, {"tolevo": content.get("version")}, content.get("format"), page_data.FORMAT)
    result, bad = page_data.load_result(pages[kind].record, content)
    if bad:
        stored.remark(page_data.NAME, f"{', '.join(bad)} missing or not what was written: left out")
    return result


class Page(NamedTuple):
    """What a kind of result is made of: its record, its page and its figures."""

    record: type[Any]
    build: Callable[[Any, tuple[str, ...]], str]
    draw: Callable[[Any], Mapping[str, Figure]]


def _pages() -> Mapping[str, Page]:
    """What builds the page of a result, by its kind."""
    from .analyse.page import analysis_page
    from .gap import page as gap
    from .reproduce.page import claims_page
    from .reproduce.page import figures as claims_figures
    from .study.page import figures, study_page

    return {
        "run": Page(RunResult, page, run_figures),
        "analyse": Page(AnalysisResult, lambda result, _: analysis_page(result), lambda _: {}),
        "gap": Page(GapResult, lambda result, _: gap.gap_page(result), gap.figures),
        "study": Page(
            StudyResult,
            lambda result, _: study_page(result),
            lambda result: {named.name: named.figure for named in figures(result)},
        ),
        "reproduce": Page(
            ClaimsResult,
            lambda result, _: claims_page(result),
            lambda result: {named.name: named.figure for named in claims_figures(result)},
        ),
    }


def _faults(folder: Path, kind: str, remarks: Sequence[str]) -> list[Fault]:
    """Why nothing can be built of a directory."""
    if not folder.is_dir():
        return [Fault(str(folder), "is not a directory" if folder.exists() else "does not exist")]
    if not kind:
        return [Fault(str(folder), "holds no result of run, analyse, study, gap or reproduce")]
    more = "nothing can be shown of it"
    if kind != "run":
        more += f"; run `tolevo {kind}` on it again, with --resume"
    split = [remark.split(": ", 1) for remark in remarks]
    return [*(Fault(f"{folder}/{name}", why) for name, why in split), Fault(str(folder), more)]


def _compare_folders(folders: Sequence[Path], out: Path, figures: Path | None) -> Report:
    runs: dict[str, RunResult] = {}
    remarks: list[str] = []
    held = [Stored(folder) for folder in folders]
    raise_all([fault for stored in held for fault in stored.standing.faults])
    for label, stored in zip(_labels(folders), held, strict=True):
        folder, kind = stored.folder, stored.standing.command
        result = _result(stored, kind) if kind == "run" else None
        stored.missing()
        remarks += [f"{folder}/{remark}" for remark in stored.remarks]
        if result is not None:
            runs[label] = result
        elif kind not in ("", "run"):
            remarks.append(f"{folder}: holds a {kind}; only runs are compared")
        else:
            remarks += [str(fault) for fault in _faults(folder, kind, [])]
    comparison, sentences = compare_runs(runs)
    if comparison is None:
        text = "fewer than two runs remain that can be compared"
        split = [remark.split(": ", 1) for remark in (*remarks, *sentences)]
        raise_all([*(Fault(place, why) for place, why in split), Fault("report", text)])
    assert comparison is not None
    for stored in held:
        _check_unchanged(stored)
    write_text(out, comparison_page(comparison, tuple(remarks)))
    if figures is not None:
        _draw({"fronts": comparison_figure(comparison)}, figures)
    return Report(out, (*remarks, *sentences))


def _labels(folders: Sequence[Path]) -> list[str]:
    """Names that distinguish the directories: the last parts of their paths, as many as needed."""
    parts = [folder.resolve().parts for folder in folders]
    for count in range(1, max(map(len, parts)) + 1):
        labels = ["/".join(path[-count:]) for path in parts]
        if len(set(labels)) == len(labels):
            return labels
    return [f"{'/'.join(path[-1:])} ({at})" for at, path in enumerate(parts, start=1)]
