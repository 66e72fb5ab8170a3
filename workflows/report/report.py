"""`tolevo report`: the page of one directory, or of several runs side by side."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from ...claim_records import ClaimsResult
from ...directory import BUSY, seal_of, standing
from ...directory.lock import Held, acquire
from ...errors import Fault, InputError, raise_all, refuse
from ...files import write_bytes, write_text
from ...gap_records import GapResult
from ...records import RunResult, StudyResult
from ...reports.comparison import comparison_page
from ...reports.comparison.figure import comparison_figure
from ...reports.document import renewed
from ...reports.drawing import as_png, as_svg
from ...reports.figures import figures as run_figures
from ...reports.page import page
from ...reports.unfinished import unfinished_page
from .. import page_data
from .comparison import compared
from .stored import Stored
from .stored_run import stored_run
from .unfinished import facts, tables

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
        return _single(folders[0], out, figures)
    return _several(folders, out or Path(COMPARISON), figures)


def _draw(drawn: Mapping[str, Figure], folder: Path | None) -> None:
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in drawn.items():
            write_bytes(folder / f"{name}.png", as_png(figure))
            write_bytes(folder / f"{name}.svg", as_svg(figure))


def _single(folder: Path, out: Path | None, figures: Path | None, renew: bool = False) -> Report:
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
        _write(stored, out, renewed(text) if renew else text)
        return Report(out or folder / PAGE, remarks, unfinished=True)
    _, build, draw = _pages()[kind]
    text, going = build(result, remarks), stored.unfinished
    _write(stored, out, renewed(text) if renew and going else text)
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
            built = _single(folder, out, None, renew=True)
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
    result, bad = page_data.loaded(pages[kind].record, content)
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
    from ...reports.claims import claims_page
    from ...reports.claims import figures as claims_figures
    from ...reports.gap import page as gap
    from ...reports.study import figures, study_page

    return {
        "run": Page(RunResult, page, run_figures),
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
        return [Fault(str(folder), "holds no result of run, study, gap or reproduce")]
    more = "nothing can be shown of it"
    if kind != "run":
        more += f"; run `tolevo {kind}` on it again, with --resume"
    split = [remark.split(": ", 1) for remark in remarks]
    return [*(Fault(f"{folder}/{name}", why) for name, why in split), Fault(str(folder), more)]


def _several(folders: Sequence[Path], out: Path, figures: Path | None) -> Report:
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
    comparison, sentences = compared(runs)
    if comparison is None:
        text = "fewer than two runs remain that can be compared"
        split = [remark.split(": ", 1) for remark in (*remarks, *sentences)]
        raise_all([*(Fault(place, why) for place, why in split), Fault("report", text)])
    assert comparison is not None
    for stored in held:
        _check_unchanged(stored)
    write_text(out, comparison_page(comparison, tuple(remarks)))
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
