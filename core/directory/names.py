"""What each command writes into its directory, by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import chain
from pathlib import Path


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


def _drawn(*stems: str) -> tuple[str, ...]:
    return tuple(f"{stem}.{ending}" for stem in stems for ending in ("png", "svg"))


PAGE = "report.html"
KINDS: Mapping[str, Kind] = {
    "gap": Kind(
        marks=("gap.json", "residuals.parquet", "corrected.toml"),
        state=("replicates.jsonl",),
        files=(
            "replicates.jsonl",
            "config.toml",
            "corrected.toml",
            "residuals.parquet",
            "next_measurement.csv",
            "summary.txt",
            "page.json",
            "gap.json",
        ),
        pages=(PAGE, *_drawn("residuals_*", "spectrum_*", "distribution_*", "path", "next_measurement")),
        saved="every replicate that had ended",
    ),
    "study": Kind(
        marks=("study.json", "study.csv", "study.sqlite", "medians.csv"),
        state=("study.sqlite", "study.sqlite-wal", "study.sqlite-shm", "store.json"),
        files=(
            "study.sqlite",
            "store.json",
            "config.toml",
            "curves.parquet",
            "study.csv",
            "sensitivity.csv",
            "tests.csv",
            "medians.csv",
            "leaders.csv",
            "page.json",
            "study.json",
        ),
        pages=(PAGE, *_drawn("course_*", "response_*", "sensitivity")),
        saved="every run that had ended",
    ),
    "reproduce": Kind(
        marks=("claims.csv", "claims.json"),
        state=("checked/*.json",),
        files=("checked/*.json", "claims.csv", "claims.json", "tables/*.csv", "page.json"),
        pages=(PAGE, *_drawn("figures/*")),
        saved="every claim that had been checked",
    ),
    "run": Kind(
        marks=("summary.json", "front.csv", "front.parquet", "convergence.csv"),
        state=("checkpoint.npz",),
        files=(
            "checkpoint.npz",
            "config.toml",
            "front.csv",
            "front.parquet",
            "front.json",
            "references.csv",
            "convergence.csv",
            "front_without_effects.csv",
            "allocation_moved.csv",
            "choices.csv",
            "choice_sensitivity.csv",
            "allocation.csv",
            "contributions.csv",
            "exact_front.csv",
            "overlays.csv",
            "unit_turn.csv",
            "population.csv",
            "assumptions_cost.csv",
            "requirements.csv",
            "drivers.csv",
            "prices.csv",
            "changes.csv",
            "relaxed.csv",
            "promise.csv",
            "next_parts.csv",
            "capability.csv",
            "tolerances.json",
            "drawing.html",
            "reducers.npz",
            "allocation.xlsx",
            "nearest_miss.csv",
            "failed.csv",
            "summary.json",
        ),
        pages=(PAGE, *_drawn("front")),
        saved="the search as it was saved last",
    ),
}
"""By command, the most specific first: a directory may hold more than one result."""


def present(folder: Path, patterns: Iterable[str]) -> list[str]:
    """Names of the files in a directory that fit one of the patterns, in their order."""
    matches = (sorted(folder.glob(pattern)) for pattern in patterns)
    files = (path for path in chain.from_iterable(matches) if path.is_file() or path.is_symlink())
    return list(dict.fromkeys(path.relative_to(folder).as_posix() for path in files))


def kinds_in(folder: Path) -> list[str]:
    """Commands whose results or states a directory holds, by their characteristic files."""
    return [name for name, kind in KINDS.items() if present(folder, (*kind.marks, *kind.state))]


def kind_of(folder: Path) -> str:
    """The command whose result a directory holds, empty where it holds none."""
    return next((name for name, kind in KINDS.items() if present(folder, kind.marks)), "")


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
