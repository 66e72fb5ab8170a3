"""The Python interface: what the commands do, as functions that return what they found.

Each takes a configuration as a path, a dictionary or what `read` returns, and tables as paths or
pandas frames. Nothing is written unless `out` is given. Bad input raises `ConfigurationError` with
every fault (`.faults`), as the commands print them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import pandas as pd

from . import tables
from .arguments import file_faults, page_faults, start_faults
from .configuration import Configuration
from .configuration import read as read_file
from .configuration.reader import read_tables
from .errors import Fault, InputError, raise_all
from .results import Gap, Reproduction, Run, Scratch, Study

if TYPE_CHECKING:
    from .algorithms.search import Progress
    from .workflows.gap.progress import Tell
    from .workflows.report import Report
    from .workflows.reproduce.plan import ClaimsProgress
    from .workflows.study.plan import StudyProgress

AnyPath = str | PathLike[str]
Source = AnyPath | Mapping[str, Any] | Configuration
"""A configuration: a path, a dictionary with the keys of the file, or what `read` returns."""
Frame = AnyPath | pd.DataFrame
"""A table: a path, or a frame whose columns bear the names that the file would have."""
NOTES = "notes"
"""Key in `attrs` of returned frames: what was understood, and what the user should know."""
Found = TypeVar("Found")


def read(source: Source, settings: Sequence[str] = ()) -> Configuration:
    """The configuration of a problem or model, checked and completed.

    `settings` are "key=value" as `--set` takes them; they apply to paths. Raises ConfigurationError
    with every fault.
    """
    if isinstance(source, Configuration):
        return source
    if isinstance(source, Mapping):
        return read_tables(dict(source), Path(), [])
    return read_file(Path(source), settings)


def check(source: Source, settings: Sequence[str] = ()) -> str:
    """The resolved configuration of any command as TOML with comments, as `tolevo check` prints it.

    Raises ConfigurationError with every fault.
    """
    from .configuration.checked import checked
    from .configuration.description import describe

    if isinstance(source, Configuration | Mapping):
        return describe(read(source))
    return checked(Path(source), settings)


def run(
    source: Source,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int = 1,
    progress: Callable[[Progress], None] | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> Run:
    """One optimisation: from a configuration to a Pareto front (`.front`).

    `progress` is called after every generation. The result does not depend on `workers`. With
    `resume`, `out` may hold the same run, which is gone on with. Raises ConfigurationError with
    every fault.
    """
    from .workflows.run import run as running
    from .workflows.run.reach import searchable

    faults = _start_faults(out, workers, resume, overwrite)
    configuration = _collected(lambda: _with_problem(read(source, settings)), faults)
    plan = configuration.plan()
    _collected(lambda: searchable(plan.problem), faults)
    raise_all(faults)
    folder, kept = _folder(out)
    done = running(plan, folder, workers, progress, resume, overwrite or out is None)
    return Run(done.status, done.lines, done.result, folder, kept)


def study(
    source: AnyPath,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int = 1,
    dask: str = "",
    progress: Callable[[StudyProgress], None] | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> Study:
    """Many optimisations over settings and seeds, and what the settings do.

    Raises ConfigurationError with every fault.
    """
    from .configuration.study import read_study
    from .workflows.study import executor_of
    from .workflows.study import study as studying

    faults = _start_faults(out, workers, resume, overwrite, shared=True)
    plan = _collected(lambda: read_study(Path(source), settings), faults)
    raise_all(faults)
    folder, kept = _folder(out)
    executor = executor_of(workers, dask)
    done = studying(plan, folder, executor, progress, resume, overwrite or out is None)
    return Study(done.status, done.lines, done.data, folder, kept)


def gap(
    source: AnyPath,
    data: Frame,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int = 1,
    progress: Tell | None = None,
    resume: bool = False,
    overwrite: bool = False,
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> Gap:
    """Where model and measurement disagree, the missing effect by its name, the corrected model.

    Raises ConfigurationError with every fault of the configuration and of the data.
    """
    from .registry import needed

    raise_all(needed("gap"))
    from .configuration.gap import gap_plan
    from .workflows.gap.gap import gap as closing
    from .workflows.gap.read import checked_table

    faults = _start_faults(out, workers, resume, overwrite)
    plan, found = gap_plan(Path(source), settings)
    table, wrong, place = _opened(data, tables.ReadOptions(encoding, delimiter, decimal))
    readings, more = checked_table(plan, table, wrong, place)
    raise_all([*found, *faults, *more])
    assert plan is not None
    assert readings is not None
    folder, kept = _folder(out)
    done = closing(plan, readings, folder, workers, progress, resume, overwrite or out is None)
    return Gap(done.status, done.lines, done.result, folder, kept)


def reproduce(
    claims: Sequence[AnyPath] = (),
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int = 1,
    progress: Callable[[ClaimsProgress], None] | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> Reproduction:
    """Every figure that documents print, computed again; those of the package where none is named.

    Raises ConfigurationError with every fault of every file.
    """
    from .configuration.claims import read_claims
    from .workflows.reproduce.reproduce import reproduce as comparing
    from .workflows.study.execution import executor_of

    faults = _start_faults(out, workers, resume, overwrite)
    plan = _collected(lambda: read_claims([Path(one) for one in claims], settings), faults)
    raise_all(faults)
    folder, kept = _folder(out)
    executor = executor_of(workers)
    done = comparing(plan, folder, executor, progress, resume, overwrite or out is None)
    return Reproduction(done.status, done.lines, done.result, folder, kept)


def evaluate(
    source: Source,
    designs: Frame,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> pd.DataFrame:
    """Every variable, output and limit margin of a problem at designs, one per row.

    A front or an allocation can be given as it stands: columns that are no variable are left out
    and named in `.attrs["notes"]`. Raises ConfigurationError with every fault.
    """
    from .workflows.evaluate import evaluated

    faults = _file_faults(out, designs)
    configuration = _collected(lambda: _with_problem(read(source, settings)), faults)
    raise_all(faults)
    assert configuration.problem is not None
    table, wrong, place = _opened(designs, tables.ReadOptions(encoding, delimiter, decimal))
    raise_all(wrong)
    assert table is not None
    return _noted(partial(evaluated, configuration.problem, table, place), out)


def simulate(
    source: Source,
    inputs: Frame,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> pd.DataFrame:
    """A model's predictions beside its inputs, one operating point per row.

    Raises ConfigurationError with every fault.
    """
    from .configuration.simulated import build_model
    from .workflows.simulate import simulated

    faults = _file_faults(out, inputs)
    configuration = _collected(lambda: read(source, settings), faults)
    raise_all(faults)
    model, given = build_model(configuration), configuration.settings
    table, wrong, place = _opened(inputs, tables.ReadOptions(encoding, delimiter, decimal))
    raise_all(wrong)
    assert table is not None

    def predicted(tell: tables.Tell) -> pd.DataFrame:
        return simulated(
            model, table, place, configuration.seed, configuration.model_name, given.effects,
            given.zero, given.columns, tell, tell,
        )  # fmt: skip

    return _noted(predicted, out)


def report(
    folders: AnyPath | Sequence[AnyPath],
    out: AnyPath | None = None,
    figures: AnyPath | None = None,
) -> Report:
    """Build the page of a result again, or compare several runs; says where it is.

    Raises ConfigurationError where nothing can be built.
    """
    from .workflows.report import report as built

    several = [folders] if isinstance(folders, str | PathLike) else list(folders)
    paths = [Path(one) for one in several]
    target, drawn = (None if one is None else Path(one) for one in (out, figures))
    raise_all(page_faults(paths, target, drawn))
    return built(paths, target, drawn)


def _with_problem(configuration: Configuration) -> Configuration:
    if configuration.problem is None:
        raise_all([Fault("problem", "is missing: a model alone can only be simulated")])
    return configuration


def _collected(found: Callable[[], Found], faults: Sequence[Fault]) -> Found:
    """What `found` returns; its faults are raised together with those found before."""
    try:
        return found()
    except InputError as error:
        raise InputError([*error.faults, *faults]) from None


def _start_faults(
    out: AnyPath | None, workers: int, resume: bool, overwrite: bool, shared: bool = False
) -> list[Fault]:
    if out is None:
        return [Fault("--resume", "needs the directory that holds what is to be gone on with: out")
                ] if resume else []  # fmt: skip
    return start_faults(Path(out), workers, resume, overwrite, shared)


def _file_faults(out: AnyPath | None, source: Frame) -> list[Fault]:
    if out is None:
        return []
    return file_faults(Path(out), None if isinstance(source, pd.DataFrame) else Path(source))


def _folder(out: AnyPath | None) -> tuple[Path, Scratch | None]:
    """Where the files go: the user's directory, or one that goes with the result."""
    if out is not None:
        return Path(fspath(out)), None
    kept = Scratch()
    return kept.path / "result", kept


def _opened(
    source: Frame, options: tables.ReadOptions
) -> tuple[tables.Table | None, list[Fault], str]:
    """A table, the faults of its form, and how they name it."""
    if isinstance(source, pd.DataFrame):
        return *tables.table_of(source, "frame"), "frame"
    path = Path(source)
    return *tables.opened(path, path.name, options), path.name


def _noted(compute: Callable[[tables.Tell], pd.DataFrame], out: AnyPath | None) -> pd.DataFrame:
    notes: list[str] = []
    found = compute(notes.extend)
    found.attrs[NOTES] = tuple(notes)
    if out is not None:
        tables.write(found, Path(out))
    return found
