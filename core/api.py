"""The Python interface: what the commands do, as functions that return what they found.

Each takes a configuration as a path, a dictionary or what `read` returns, and tables as paths or
pandas frames. Nothing is written unless `out` is given. `tell` is called with each line that the
user should read, as soon as it is known: how a table was read ("read: ..."), "note: ...",
"model: ..." and "warning: ...". Bad input raises `ConfigurationError` with every fault
(`.faults`), as the commands print them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import pandas as pd

from . import tables
from .arguments import (
    beside,
    choice_faults,
    file_faults,
    page_faults,
    start_faults,
    watch_faults,
)
from .configuration import Configuration
from .configuration import read as read_raw
from .errors import Fault, InputError, raise_all
from .results import Gap, Reproduction, Run, Scratch, Study

if TYPE_CHECKING:
    from .algorithms.search import Progress
    from .workflows.gap.progress import GapProgress
    from .workflows.report import Report
    from .workflows.reproduce.plan import ClaimsProgress
    from .workflows.study.plan import StudyProgress

AnyPath = str | PathLike[str]
Source = AnyPath | Mapping[str, Any] | Configuration
"""A configuration: a path, a dictionary with the keys of the file, or what `read` returns."""
Raw = AnyPath | Mapping[str, Any]
"""A configuration: a path, or a dictionary with the keys of the file."""
Frame = AnyPath | pd.DataFrame
"""A table: a path, or a frame whose columns bear the names that the file would have."""
READ = "read"
NOTES = "notes"
"""Key in `attrs` of returned frames: what was understood, and what the user should know."""
Tell = Callable[[str], None]
Found = TypeVar("Found")


def read(source: Source, settings: Sequence[str] = ()) -> Configuration:
    """The configuration of a problem or model, checked and completed.

    `settings` are "key=value" as `--set` takes them. Raises ConfigurationError with every fault.
    """
    if not isinstance(source, Configuration):
        return read_raw(_raw(source), settings)
    if settings:
        place, remedy = "--set", "give what it was read from, or change it before it is read"
        raise_all([Fault(place, f"cannot change a configuration that is complete: {remedy}")])
    return source


def check(source: Source, settings: Sequence[str] = ()) -> str:
    """The resolved configuration of any command as TOML with comments, as `tolevo check` prints it.

    Raises ConfigurationError with every fault.
    """
    from .configuration.checked import checked
    from .configuration.description import describe

    if isinstance(source, Configuration):
        return describe(read(source, settings))
    return checked(_raw(source), settings)


def run(
    source: Source,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int = 1,
    progress: Callable[[Progress], None] | None = None,
    tell: Tell | None = None,
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
    _told(tell, "warning", plan.problem.cautions())
    folder, kept = _folder(out)
    done = running(plan, folder, workers, progress, resume, overwrite or out is None)
    return Run(done.status, done.lines, done.result, folder, kept)


def study(
    source: Raw,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int | None = None,
    dask: str = "",
    progress: Callable[[StudyProgress], None] | None = None,
    tell: Tell | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> Study:
    """Many optimisations over settings and seeds, and what the settings do.

    They run in `workers` processes (one where none are named), or on the Dask scheduler at `dask`.
    Raises ConfigurationError with every fault.
    """
    from .configuration.study import read_study
    from .workflows.study import executor_of
    from .workflows.study import study as studying

    faults = _start_faults(out, workers, resume, overwrite, shared=True)
    if dask and workers is not None:
        faults.append(Fault("--dask", "has workers of its own; leave out --workers"))
    plan = _collected(lambda: read_study(_raw(source), settings), faults)
    raise_all(faults)
    executor = executor_of(workers or 1, dask)
    _told(tell, "warning", plan.warnings)
    folder, kept = _folder(out)
    done = studying(plan, folder, executor, progress, resume, overwrite or out is None)
    return Study(done.status, done.lines, done.data, folder, kept)


def gap(
    source: Raw,
    data: Frame,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int = 1,
    progress: Callable[[GapProgress], None] | None = None,
    tell: Tell | None = None,
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
    plan, found = gap_plan(_raw(source), settings)
    table, wrong, place = _opened(data, tables.ReadOptions(encoding, delimiter, decimal))
    file = None if isinstance(data, pd.DataFrame) else Path(data)
    readings, more = checked_table(plan, table, wrong, place, file)
    raise_all([*found, *faults, *more])
    assert plan is not None
    assert readings is not None
    _told(tell, READ, readings.understood)
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
    tell: Tell | None = None,
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
    problem, notes = configuration.problem, list[str]()
    assert problem is not None
    _told(tell, "note", problem.effect_notes())
    _told(tell, "model", [problem.model_statement] if problem.model_statement else ())
    table, place = _readable(designs, tables.ReadOptions(encoding, delimiter, decimal))
    found = evaluated(problem, table, place, notes.extend)
    _told(tell, READ, notes)
    return _written(found, notes, out)


def simulate(
    source: Source,
    inputs: Frame,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    tell: Tell | None = None,
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
    table, place = _readable(inputs, tables.ReadOptions(encoding, delimiter, decimal))
    understood, notes = list[str](), list[str]()
    found = simulated(
        model,
        table,
        place,
        configuration.seed,
        configuration.model_name,
        given.effects,
        given.zero,
        given.columns,
        understood.extend,
        notes.extend,
    )
    _told(tell, READ, understood)
    _told(tell, "note", notes)
    return _written(found, [*understood, *notes], out)


def report(
    folders: AnyPath | Sequence[AnyPath],
    out: AnyPath | None = None,
    figures: AnyPath | None = None,
    *,
    watch: bool = False,
    tell: Tell | None = None,
) -> Report:
    """Build the page of a result again, or compare several runs; says where it is.

    With `watch` the page of one directory is renewed until its result is complete; it lies beside
    the directory where `out` says nothing else. Raises ConfigurationError where nothing can be
    built.
    """
    from .workflows.report import report as built

    several = [folders] if isinstance(folders, str | PathLike) else list(folders)
    paths = [Path(one) for one in several]
    target, drawn = (None if one is None else Path(one) for one in (out, figures))
    if watch:
        return _watched(paths, target, drawn, tell)
    raise_all(page_faults(paths, target, drawn))
    found = built(paths, target, drawn)
    _told(tell, "warning", found.remarks)
    return found


def _watched(
    folders: list[Path], out: Path | None, figures: Path | None, tell: Tell | None
) -> Report:
    """`report` again and again; where the page lies is told when it is first there."""
    from .workflows.report import watch

    page, told = out or beside(folders[0]), set[Path]()
    raise_all([*watch_faults(folders, figures), *page_faults(folders[:1], page)])

    def shown(found: Report) -> None:
        if found.path not in told:
            _told(tell, "page", [f"{found.path}, renewed every 5 s; Ctrl-C ends it"])
        told.add(found.path)

    return watch(folders[0], page, shown)


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
    out: AnyPath | None, workers: int | None, resume: bool, overwrite: bool, shared: bool = False
) -> list[Fault]:
    if out is not None:
        return start_faults(Path(out), workers, resume, overwrite, shared)
    faults = choice_faults(workers, resume, overwrite)
    if resume:
        text = "needs the directory that holds what is to be gone on with: out"
        faults.append(Fault("--resume", text))
    return faults


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


def _raw(source: Raw) -> Path | Mapping[str, Any]:
    return source if isinstance(source, Mapping) else Path(source)


def _opened(
    source: Frame, options: tables.ReadOptions
) -> tuple[tables.Table | None, list[Fault], str]:
    """A table, the faults of its form, and how they name it."""
    if isinstance(source, pd.DataFrame):
        return *tables.table_of(source, "frame"), "frame"
    path = Path(source)
    return *tables.opened(path, path.name, options), path.name


def _readable(source: Frame, options: tables.ReadOptions) -> tuple[tables.Table, str]:
    """A table and how faults name it; raises those of its form."""
    table, faults, place = _opened(source, options)
    raise_all(faults)
    assert table is not None
    return table, place


def _told(tell: Tell | None, kind: str, lines: Iterable[str]) -> None:
    if tell is not None:
        for line in lines:
            tell(f"{kind}: {line}")


def _written(found: pd.DataFrame, notes: Sequence[str], out: AnyPath | None) -> pd.DataFrame:
    """The frame, in a file as well where one is named, and then with its notes."""
    if out is not None:
        tables.write(found, Path(out))
    found.attrs[NOTES] = tuple(notes)
    return found
