"""What the functions of the Python interface return: tables, and files only on request."""

from __future__ import annotations

import shutil
import weakref
from base64 import b64encode
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any, ClassVar

from .arguments import directory_faults
from .directory import own_folder
from .directory.standing import MANIFEST, UNFINISHED
from .errors import raise_all

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from .commands.gap.records import GapResult
    from .commands.reproduce.records import ClaimsResult
    from .commands.study.plan import StudyData
    from .records import AnalysisResult, RunResult

FIGURE = "front.svg"


class Scratch:
    """A temporary directory, which is removed with this object."""

    def __init__(self) -> None:
        self.path = Path(mkdtemp(prefix="tolevo-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


@dataclass(frozen=True, eq=False)
class Finished:
    """How a command ended, its results, and its files.

    `status` is "done", "interrupted" or "no_feasible_point", `lines` the summary as the command
    prints it, `record` all results. With `out` given, `folder` is that directory; otherwise it is a
    temporary one that is removed with this object, and nothing is in a directory of the user's
    before `write`.
    """

    status: str
    lines: tuple[str, ...]
    record: Any
    folder: Path
    scratch: Scratch | None = field(default=None, repr=False)
    command: ClassVar[str] = ""

    def write(self, out: str | Path, overwrite: bool = False) -> Path:
        """Write every file that the command writes into the directory `out`, and return it.

        Raises ConfigurationError where it holds something and `overwrite` is not given, or where it
        cannot be written.
        """
        target = Path(out)
        raise_all(directory_faults(target, overwrite))
        with own_folder(target, self.command, False, overwrite) as place:
            place.begin()
            for path in sorted(self.folder.iterdir()):
                if path.name not in (MANIFEST, UNFINISHED):
                    shutil.copy2(path, target / path.name)
            if self.status != "interrupted":
                place.complete(self.status)
        return target

    @property
    def page(self) -> str:
        """The page (HTML), empty where there is none."""
        path = self.folder / "report.html"
        return path.read_text(encoding="utf-8") if path.is_file() else ""

    def __str__(self) -> str:
        return "\n".join(self.lines)

    def _repr_html_(self) -> str:
        """The summary and, where there is one, the figure: what a notebook shows."""
        text = f"<pre>{escape(str(self))}</pre>"
        figure = self.folder / FIGURE
        if not figure.is_file():
            return text
        data = b64encode(figure.read_bytes()).decode()
        return f'{text}<img alt="Pareto front" src="data:image/svg+xml;base64,{data}">'


@dataclass(frozen=True, eq=False)
class Run(Finished):
    """A finished optimisation: the tables of its files, as frames."""

    record: RunResult
    command = "run"

    @property
    def front(self) -> pd.DataFrame:
        """One row per Pareto point: variables, objectives, outputs, bound and gap."""
        return self.record.front

    @property
    def references(self) -> pd.DataFrame:
        """The allocations of the documents and the single-objective optima, in the same columns."""
        return self.record.references

    @property
    def convergence(self) -> pd.DataFrame:
        """Hypervolume and feasible fraction by generation."""
        return self.record.convergence

    @property
    def choices(self) -> pd.DataFrame | None:
        """The point that each rule chooses, and what rounding it costs."""
        return self.record.choices

    @property
    def allocation(self) -> pd.DataFrame | None:
        """The chosen points as a drawing needs them: limits, deviations, grades."""
        return self.record.allocation

    @property
    def contributions(self) -> pd.DataFrame | None:
        """What each tolerance contributes at the chosen points."""
        return self.record.contributions

    @property
    def summary(self) -> Mapping[str, Any]:
        """What `summary.json` holds."""
        return self.record.summary


@dataclass(frozen=True, eq=False)
class Analysis(Finished):
    """A finished analysis of a stack: the tables of its files, as frames."""

    record: AnalysisResult
    command = "analyse"

    @property
    def requirements(self) -> pd.DataFrame:
        """One row per requirement: nominal, ends, spread, capability, yield."""
        return self.record.requirements

    @property
    def contributions(self) -> pd.DataFrame:
        """One row per requirement and part: sensitivity and shares."""
        return self.record.contributions

    @property
    def summary(self) -> Mapping[str, Any]:
        """What `summary.json` holds."""
        return self.record.summary


@dataclass(frozen=True, eq=False)
class Study(Finished):
    """A finished study; `record` is None where it had ended before, or was interrupted."""

    record: StudyData | None
    command = "study"


@dataclass(frozen=True, eq=False)
class Gap(Finished):
    """A finished gap analysis; `record` is None where it was interrupted."""

    record: GapResult | None
    command = "gap"


@dataclass(frozen=True, eq=False)
class Reproduction(Finished):
    """A finished comparison with printed figures."""

    record: ClaimsResult | None
    command = "reproduce"
