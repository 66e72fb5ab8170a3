"""What each command writes into its directory, the marks of complete and unfinished results, and the state of
a directory by them.
"""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from importlib.metadata import version
from itertools import chain
from os.path import lexists
from pathlib import Path

from ..errors import Fault
from ..files import PART, file_obstacle, is_file, is_folder, read_record, write_record
from ..records import AnalysisResult, ClaimsTables, GapTables, RunResult, StudyResult, tables_of
from .lock import LOCK, holders


@dataclass(frozen=True, slots=True)
class Kind:
    """The files of one command, as patterns relative to its directory.

    `marks` show that a directory holds such a result, `state` is what an interrupted one resumes
    from, `files` are all of the result but `pages`, which `report` builds again. `saved` says in
    words what the state is.
    """

    marks: tuple[str, ...]
    state: tuple[str, ...]
    files: tuple[str, ...]
    pages: tuple[str, ...]
    saved: str


def _figure_files(*stems: str) -> tuple[str, ...]:
    return tuple(f"{stem}.{ending}" for stem in stems for ending in ("png", "svg"))


def _tables(result: type) -> tuple[str, ...]:
    """The files of the tables that a result declares."""
    return tuple(table.file for table in tables_of(result).values())


PAGE, XLSX = "report.html", "stack.xlsx"
KINDS: Mapping[str, Kind] = {
    "analyse": Kind(
        marks=("histograms.csv",),
        state=(),
        files=("config.toml", *_tables(AnalysisResult), "page.json", "summary.json", XLSX),
        pages=(PAGE,),
        saved="nothing",
    ),
    "gap": Kind(
        marks=("gap.json", "residuals.parquet", "corrected.toml"),
        state=("replicates.jsonl", "steps.npz"),
        files=(
            "replicates.jsonl",
            "steps.npz",
            "config.toml",
            "corrected.toml",
            *_tables(GapTables),
            "summary.txt",
            "page.json",
            "gap.json",
        ),
        pages=(
            PAGE,
            *_figure_files("residuals_*", "spectrum_*", "distribution_*", "remainder_*", "path", "next_measurement"),
        ),
        saved="the search as it was saved last, and every replicate that had ended",
    ),
    "study": Kind(
        marks=("study.json", "study.csv", "study.sqlite", "medians.csv"),
        state=("study.sqlite", "study.sqlite-wal", "study.sqlite-shm", "store.json"),
        files=(
            "study.sqlite",
            "store.json",  # of 0.2.0: its runs are in a database elsewhere
            "config.toml",
            "curves.parquet",
            *_tables(StudyResult),
            "leaders.csv",
            "page.json",
            "study.json",
        ),
        pages=(PAGE, *_figure_files("course_*", "response_*", "sensitivity")),
        saved="every run that had ended",
    ),
    "reproduce": Kind(
        marks=("claims.csv", "claims.json"),
        state=("checked/*.json",),
        files=("checked/*.json", *_tables(ClaimsTables), "claims.json", "tables/*.csv", "page.json"),
        pages=(PAGE, *_figure_files("figures/*")),
        saved="every claim that had been checked",
    ),
    "run": Kind(
        marks=("summary.json", "front.csv", "front.parquet", "convergence.csv"),
        state=("checkpoint.npz", "side_*.npz"),
        files=(
            "checkpoint.npz",
            "side_*.npz",
            "config.toml",
            *_tables(RunResult),
            "front.parquet",
            "front.json",
            "tolerances.json",
            "drawing.html",
            "reducers.npz",
            "allocation.xlsx",
            XLSX,
            "nearest_miss.csv",
            "failed.csv",
            "summary.json",
        ),
        pages=(PAGE, *_figure_files("front")),
        saved="the search as it was saved last",
    ),
}
"""By command, the most specific first: a directory may hold more than one result."""


def present_files(folder: Path, patterns: Iterable[str]) -> list[str]:
    """Names of the files in a directory that fit one of the patterns, in their order."""
    matches = (sorted(folder.glob(pattern)) for pattern in patterns)
    files = (path for path in chain.from_iterable(matches) if path.is_file() or path.is_symlink())
    return list(dict.fromkeys(path.relative_to(folder).as_posix() for path in files))


def kinds_in(folder: Path) -> list[str]:
    """Commands whose results or states a directory holds, by their characteristic files."""
    return [name for name, kind in KINDS.items() if present_files(folder, (*kind.marks, *kind.state))]


def kind_of(folder: Path) -> str:
    """The command whose result a directory holds, empty where it holds none."""
    return next((name for name, kind in KINDS.items() if present_files(folder, kind.marks)), "")


def folders(folder: Path) -> list[Path]:
    """The directory, and those below it that commands write into."""
    patterns = chain.from_iterable((*kind.files, *kind.pages) for kind in KINDS.values())
    parents = {str(Path(pattern).parent) for pattern in patterns}
    return [folder / parent for parent in sorted(parents) if (folder / parent).is_dir()]


def fits(name: str, patterns: Iterable[str]) -> bool:
    """Whether a name fits one of the patterns."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def is_output_file(name: str) -> bool:
    """Whether some command writes a file of that name."""
    return any(
        fnmatchcase(name, Path(pattern).name) for kind in KINDS.values() for pattern in (*kind.files, *kind.pages)
    )


# leftovers of killed processes: files that were being written

OLDER = re.compile(r"\.(?P<name>.+)\.[a-z0-9_]{8}")
"""As earlier versions named them."""


def is_part(name: str, known: Callable[[str], bool]) -> bool:
    """Whether a file or folder is the beginning of one that is `known`."""
    match = PART.fullmatch(name) or OLDER.fullmatch(name)
    return match is not None and known(match["name"])


def sweep(folders: Iterable[Path], known: Callable[[str], bool]) -> None:
    """Remove the leftovers in directories that no other process writes into."""
    for folder in folders:
        for path in folder.iterdir():
            if not is_part(path.name, known):
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)


# The marks of results: a manifest, with the SHA-256 of every file but pages and figures, of a complete one;
# another mark of one that is being made or was interrupted.


MANIFEST = "manifest.json"
UNFINISHED = "unfinished.json"
FORMAT = 1
ANEW = "restore the original file, or start again with --overwrite"
AS_IT_IS = "to show the files as they are, remove manifest.json"


@dataclass(frozen=True, slots=True)
class Manifest:
    """What a complete result is made of: the command, how it ended, and files with digests."""

    command: str
    status: str
    files: dict[str, str]


def write_manifest(folder: Path, command: str, status: str) -> None:
    """Mark what `command` has written as complete; the same files give the same bytes."""
    names = present_files(folder, KINDS[command].files)
    record = {
        "command": command,
        "status": status,
        "format": FORMAT,
        "version": version("tolevo"),
        "files": {name: digest(folder / name) for name in names},
    }
    write_record(folder / MANIFEST, record)


def read_manifest(folder: Path) -> Manifest | None:
    """The manifest of a directory, None where there is none. Raises ValueError where damaged."""
    record = read_record(folder / MANIFEST)
    if record is None:
        return None
    try:
        if record["format"] > FORMAT:
            raise ValueError(f"tolevo {record['version']} wrote it, which is newer: update tolevo")
        command = str(record["command"])
        if command not in KINDS:
            raise KeyError(command)
        return Manifest(command, str(record["status"]), dict(record["files"]))
    except (KeyError, TypeError) as error:
        raise ValueError(f"it is not the manifest of a result ({error!r})") from error


def foreign_file_faults(folder: Path, manifest: Manifest, apart: Iterable[str] = ()) -> list[Fault]:
    """A fault for every file that does not belong to the result, except those in `apart`."""
    faults = []
    for name in present_files(folder, KINDS[manifest.command].files):
        text = ""
        if name not in manifest.files:
            text = f"does not belong to this result ({MANIFEST} does not list it): move it away"
        elif name not in apart and digest(folder / name) != manifest.files[name]:
            text = f"is not the file that this result was completed with (by {MANIFEST}): {ANEW}"
        if text and name not in apart:
            faults.append(Fault(f"{folder}/{name}", f"{text}; {AS_IT_IS}"))
    return faults


def digest(path: Path) -> str:
    """SHA-256 of a file, empty where it cannot be read."""
    if not is_file(path):
        return ""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


@dataclass(frozen=True, slots=True)
class Unfinished:
    """Which command began, under which token; `retiring` names files of an older result that it
    was removing.
    """

    command: str
    token: str
    retiring: tuple[str, ...] = ()


def write_unfinished(folder: Path, command: str, token: str, retiring: Sequence[str] = ()) -> Unfinished:
    """Mark a directory as one in which `command` has begun."""
    write_record(folder / UNFINISHED, {"command": command, "token": token, "retiring": list(retiring)})
    return Unfinished(command, token, tuple(retiring))


def read_unfinished(folder: Path) -> Unfinished | None:
    """The mark, None where there is none. Raises ValueError for a damaged one."""
    record = read_record(folder / UNFINISHED)
    if record is None:
        return None
    try:
        names = tuple(name for name in map(str, record["retiring"]) if _is_in_folder(name))
        return Unfinished(str(record["command"]), str(record["token"]), names)
    except (KeyError, TypeError) as error:
        raise ValueError(f"it is not the mark of a result ({error!r})") from error


def _is_in_folder(name: str) -> bool:
    """Whether it is the name of a result in the directory itself; other files are not removed."""
    path = Path(name)
    return not path.is_absolute() and ".." not in path.parts and is_output_file(path.name)


# The state of a directory: complete, unfinished, inconsistent, or without a mark.


OWNERS = ".at-work-"
"""Beginning of the names of files by which processes that share a directory say that they live."""


@dataclass(frozen=True, slots=True)
class Standing:
    """The state of a directory.

    `command` is the command whose result it holds, empty where that is not known. A complete result
    has a manifest, an unfinished result has another mark; a directory with neither holds a result
    of an older version, or none. `faults` state which files do not belong together or cannot be
    read; such a directory may not be used. `missing` are files of a complete result that do not
    exist any more, `holders` the processes that work in it.
    """

    command: str = ""
    manifest: Manifest | None = None
    unfinished: Unfinished | None = None
    faults: tuple[Fault, ...] = ()
    missing: tuple[str, ...] = ()
    holders: str = ""
    seal: bytes = field(default=b"", repr=False)
    """The marks as bytes: equal as long as no command has begun or ended."""

    @property
    def complete(self) -> bool:
        """Whether it is a complete set of files that belong together."""
        return self.manifest is not None and not self.faults and not self.missing


def standing(folder: Path, apart: Iterable[str] = ()) -> Standing:
    """The state of a directory; the files in `apart` check themselves and are not tested."""
    if strange := irregular_file_faults(folder):
        return Standing(faults=tuple(strange))
    busy, seal = holders(folder), seal_of(folder)
    faults: list[Fault] = []
    manifest = unfinished = None
    try:
        manifest = read_manifest(folder)
    except ValueError as error:
        faults.append(Fault(f"{folder}/{MANIFEST}", f"cannot be read: {error}; {ANEW}; {AS_IT_IS}"))
    if manifest is None and not faults:
        try:
            unfinished = read_unfinished(folder)
        except ValueError as error:
            faults.append(Fault(f"{folder}/{UNFINISHED}", f"cannot be read: {error}; start again with --overwrite"))
    mark = manifest or unfinished
    missing: tuple[str, ...] = ()
    if manifest is not None:
        faults += foreign_file_faults(folder, manifest, tuple(apart))
        there = set(present_files(folder, KINDS[manifest.command].files))
        missing = tuple(name for name in manifest.files if name not in there)
    command = mark.command if mark is not None else kind_of(folder)
    return Standing(command, manifest, unfinished, tuple(faults), missing, busy, seal)


def irregular_file_faults(folder: Path) -> list[Fault]:
    """A fault for every name of a result in a directory that is a device, a pipe, or another thing
    than a file.
    """
    marks, faults = (LOCK, MANIFEST, UNFINISHED), list[Fault]()
    for path in sorted(path for place in folders(folder) for path in place.iterdir()):
        named = path.name in marks or is_output_file(path.name)
        if named and not is_file(path) and lexists(path) and (why := file_obstacle(path)):  # it may just have ended
            text = f"{why.partition(';')[0]}, no file of a result; move it away, or name another directory"
            faults.append(Fault(str(path), text))
    return faults


def incompleteness(folder: Path) -> tuple[Fault, ...]:
    """Why a result must not be read: it is unfinished, or its files do not belong together."""
    here = standing(folder)
    if here.unfinished is None:
        return here.faults
    remedy = f"{here.holders} is at work on it: wait for it to end" if here.holders else ""
    remedy = remedy or "complete it by the same command with --resume"
    text = f"this result of `tolevo {here.command}` is unfinished: {remedy}, or name another directory"
    return (*here.faults, Fault(str(folder), text))


def seal_of(folder: Path) -> bytes:
    """The marks of a directory as bytes."""
    marks = []
    for name in (MANIFEST, UNFINISHED):
        try:
            marks.append((folder / name).read_bytes())
        except OSError:
            marks.append(b"")
    return b"\0".join(marks)


def is_occupied(folder: Path) -> bool:
    """Whether a directory holds anything, the traces of killed processes aside."""
    return is_folder(folder) and any(not is_trace(path.name) for path in folder.iterdir())


def is_trace(name: str) -> bool:
    """Whether a file is nothing but the lock or the leftover of a process."""
    return name == LOCK or name.startswith(OWNERS) or is_part(name, is_output_file)
