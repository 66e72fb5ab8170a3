"""Faults of the command line's own arguments."""

from __future__ import annotations

from collections.abc import Sequence
from os.path import exists, lexists, samefile
from pathlib import Path

from .directory import ASKED, OCCUPIED, busy_faults, holds_search, is_occupied
from .errors import Fault
from .files import is_folder, unwritable
from .section import too_many_workers

TABLES = (".csv", ".txt", ".parquet", ".pq", "")
"""Endings of tables that can be written."""


def start_faults(out: Path, workers: int | None, resume: bool, overwrite: bool) -> list[Fault]:
    """Faults in the arguments of a command that writes a directory."""
    faults = directory_faults(out, overwrite or resume)
    return faults + choice_faults(workers, resume, overwrite)


def directory_faults(out: Path, replace: bool) -> list[Fault]:
    """A directory that cannot be written, that others work in, or
    that holds something and is not to be used.
    """
    faults = unwritable(out, "--out") or busy_faults(out, "--out")
    if not faults and holds_search(out):
        return [Fault("--out", ASKED.format(out))]
    if not faults and not replace and is_occupied(out):
        faults.append(Fault("--out", OCCUPIED.format(out)))
    return faults


def choice_faults(workers: int | None, resume: bool, overwrite: bool, place: str = "--workers") -> list[Fault]:
    """Options that contradict each other; `place` is where the number of workers is stated."""
    faults = []
    if workers is not None and workers < 1:
        faults.append(Fault(place, f"must be at least 1, got {workers}"))
    if workers is not None and (complaint := too_many_workers(workers)):
        faults.append(Fault(place, complaint))
    if resume and overwrite:
        faults.append(Fault("--resume", "continues what --overwrite would replace; give only one of them"))
    return faults


def file_faults(out: Path, source: Path | None) -> list[Fault]:
    """An output table that cannot be written, or an input file that does not exist."""
    faults = unwritable(out, "--out", file=True)
    if not faults and out.suffix.lower() not in TABLES:
        faults.append(Fault("--out", f"{out.name} is neither .csv nor .parquet; no other table can be written"))
    return faults + source_faults(out, source)


def source_faults(out: Path, source: Path | None) -> list[Fault]:
    """An input file that does not exist, or that the output would replace."""
    if source is None:
        return []
    if not exists(source):
        return [Fault(str(source), "does not exist")]
    replaced = exists(out) and samefile(out, source)
    return [Fault("--out", f"would replace its own input {source}; name another path")] if replaced else []


def template_faults(out: Path) -> list[Fault]:
    """A file that cannot be written, or exists already: it may be the user's own work."""
    if faults := unwritable(out, "--out", file=True):
        return faults
    return [Fault("--out", f"{out} exists; name another file, or remove it")] if exists(out) else []


def page_faults(folders: Sequence[Path], out: Path | None, figures: Path | None = None) -> list[Fault]:
    """Directories that do not exist, or a page or figures that cannot be written."""
    faults = _page_faults(folders, out)
    return (
        faults if figures is None else faults + (busy_faults(figures, "--figures") or unwritable(figures, "--figures"))
    )


def watch_faults(folders: Sequence[Path], figures: Path | None) -> list[Fault]:
    """Options that cannot be combined with a page that is renewed."""
    faults = []
    if len(folders) != 1:
        faults.append(Fault("--watch", f"takes one directory, got {len(folders)}"))
    if figures is not None:
        faults.append(Fault("--figures", "are drawn when the result is complete; leave out --watch"))
    return faults


def page_next_to(folder: Path) -> Path:
    """The path of the page of a directory that other processes work in: next to the directory."""
    return folder.resolve().with_suffix(".html")


def _page_faults(folders: Sequence[Path], out: Path | None) -> list[Fault]:
    faults = [
        Fault(str(folder), "is not a directory" if lexists(folder) else "does not exist")
        for folder in folders
        if not is_folder(folder)
    ]
    if len(folders) > 1 and len(faults) < len(folders):
        faults = []  # existing directories are compared, missing ones are reported
    if out is None and len(folders) == 1:
        return faults or busy_faults(folders[0], "report") or unwritable(folders[0] / "report.html", "--out", file=True)
    if out is None:
        return faults or unwritable(Path("comparison.html"), "--out", file=True)
    faults += unwritable(out, "--out", file=True)
    if not faults and out.suffix.lower() not in (".html", ".htm"):
        faults.append(Fault("--out", f"{out.name} must end with .html: it is a page"))
    return faults
