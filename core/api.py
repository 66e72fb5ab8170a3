"""The Python interface: what the commands do, as functions that return their results.

Each takes a configuration as a path, a dictionary or what `read` returns, and tables as paths or
pandas frames. Nothing is written unless `out` is given. `tell` is called with each line that the
user should read, as soon as it is known: how a table was read ("read: ..."), "note: ...",
"model: ..." and "warning: ...". Bad input raises `ConfigurationError` with every fault
(`.faults`), as the commands print them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from . import tables
from .api_arguments import (
    READ,
    AnyPath,
    Frame,
    Raw,
    Source,
    Tell,
    at_hand,
    collected,
    executing,
    folder_for,
    opened,
    raw,
    readable,
    report_lines,
    start_faults_of,
)
from .arguments import page_faults, page_next_to, watch_faults
from .configuration import Configuration
from .configuration import read as read_raw
from .errors import Fault, raise_all, refuse
from .problems.interfaces import Checks
from .results import Gap, Reproduction, Run, Study
from .tabled import evaluate as evaluate
from .tabled import simulate as simulate

if TYPE_CHECKING:
    from .algorithms.search import Progress
    from .algorithms.settings import AlgorithmSettings
    from .workflows.asking import Search
    from .workflows.gap.progress import GapProgress
    from .workflows.report import Report
    from .workflows.reproduce.plan import ClaimsProgress
    from .workflows.study.plan import StudyProgress


def read(
    source: Source, settings: Sequence[str] = (), *, algorithm: AlgorithmSettings | None = None, seed: int | None = None
) -> Configuration:
    """The configuration of a problem or model, checked and completed.

    `settings` are "key=value" as `--set` takes them. An `algorithm` (such as
    `tolevo.algorithms.NSGA2(population=40)`) and a `seed` take the place of those in the source,
    whose budget stays. Raises ConfigurationError with every fault.
    """
    if not isinstance(source, Configuration):
        return read_raw(raw(source), settings, algorithm, seed)
    if settings:
        raise refuse(
            "--set", "cannot change a complete configuration: change its source, or the settings with which it is read"
        )
    return source if algorithm is None and seed is None else read_raw(source.tables(), (), algorithm, seed)


def check(source: Source, settings: Sequence[str] = ()) -> str:
    """The resolved configuration of any command as TOML with comments, as `tolevo check` prints it.

    Raises ConfigurationError with every fault, those of `[execution]` included: a scheduler or a
    store that it names is looked at, and nothing is written there.
    """
    from .configuration.checked import checked
    from .configuration.description import describe

    faults: list[Fault] = []
    source = at_hand(source)
    executing(source, settings, None, "", faults, store="")
    text = collected(
        lambda: (
            describe(read(source, settings)) if isinstance(source, Configuration) else checked(raw(source), settings)
        ),
        faults,
    )
    raise_all(faults)
    return text


def run(
    source: Source,
    out: AnyPath | None = None,
    *,
    algorithm: AlgorithmSettings | None = None,
    seed: int | None = None,
    settings: Sequence[str] = (),
    workers: int | None = None,
    dask: str = "",
    progress: Callable[[Progress], None] | None = None,
    tell: Tell | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> Run:
    """Run one optimisation: from a configuration or a problem to a Pareto front (`.front`).

    `algorithm` and `seed` take the place of those in the configuration. `progress` is called after
    every generation. The result does not depend on `workers`. With `resume`, `out` may hold the
    same run, which is then continued. Raises ConfigurationError with every fault.
    """
    from .workflows.run import run as running
    from .workflows.run.reach import searchable

    faults = start_faults_of(out, workers, resume, overwrite)
    source = at_hand(source)
    where = executing(source, settings, workers, dask, faults)
    plan = collected(lambda: _with_problem(read(source, settings, algorithm=algorithm, seed=seed)), faults).plan()
    collected(lambda: searchable(plan.problem, plan.algorithm), faults)
    raise_all(faults)
    report_lines(tell, "warning", Checks.of(plan.problem).cautions())
    folder, scratch = folder_for(out)
    done = running(plan, folder, where, progress, resume, overwrite or out is None)
    return Run(done.status, done.lines, done.result, folder, scratch)


def search(
    source: Source,
    algorithm: AlgorithmSettings | None = None,
    *,
    seed: int | None = None,
    start: Frame | None = None,
    settings: Sequence[str] = (),
) -> Search:
    """A search in the caller's loop: `ask` for designs, `tell` their outputs, take the `result`.

    `start` are designs, one per row, that the first generation begins with (the first of them, if
    they are more than it holds); a front or an allocation can be given as it stands. They lie in the
    ranges that are searched. The algorithm is that of the configuration where none is given. Raises
    ConfigurationError with every fault.
    """
    from .workflows.asking import Search, askable

    configuration = _with_problem(read(source, settings, algorithm=algorithm, seed=seed))
    raise_all(askable(configuration.algorithm_name, configuration.algorithm))
    problem, designs = configuration.problem, None
    assert problem is not None
    assert configuration.algorithm is not None
    if start is not None:
        from .workflows.evaluate import designs_in

        table, place = readable(start, tables.NO_OPTIONS)
        designs = designs_in(problem, table, "start" if place == "frame" else place, searched=True)
    return Search(problem, configuration.algorithm, configuration.seed, configuration.engine, designs)


def study(
    source: Raw,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int | None = None,
    dask: str = "",
    store: str = "",
    progress: Callable[[StudyProgress], None] | None = None,
    tell: Tell | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> Study:
    """Many optimisations over settings and seeds, and what the settings do.

    They run in `workers` processes (one where none are named), or on the Dask scheduler at `dask`.
    With the address of a `store` that machines share, several machines may work on it, each with
    its own `out`. Raises ConfigurationError with every fault.
    """
    from .configuration.study import read_study
    from .registry import needed
    from .workflows.execution import executor_of
    from .workflows.study import study as studying
    from .workflows.study.storage.site import other_study

    faults = start_faults_of(out, workers, resume, overwrite, shared=True) + needed("study")
    tables_given = raw(at_hand(source))
    where = executing(tables_given, settings, workers, dask, faults, store=store)
    plan = collected(lambda: read_study(tables_given, settings), faults)
    if where.store and not any(fault.place == where.store_place for fault in faults):
        faults += other_study(plan, where.store, where.store_place)
    raise_all(faults)
    report_lines(tell, "warning", plan.warnings)
    folder, scratch = folder_for(out)
    done = studying(plan, folder, executor_of(where), progress, resume, overwrite or out is None, where.store)
    return Study(done.status, done.lines, done.data, folder, scratch)


def gap(
    source: Raw,
    data: Frame,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int | None = None,
    dask: str = "",
    progress: Callable[[GapProgress], None] | None = None,
    tell: Tell | None = None,
    resume: bool = False,
    overwrite: bool = False,
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> Gap:
    """Where model and measurement disagree, which effect is missing, and the corrected model.

    Raises ConfigurationError with every fault of the configuration and of the data.
    """
    from .registry import needed

    raise_all(needed("gap"))
    from .configuration.gap import gap_plan
    from .workflows.gap.gap import gap as closing
    from .workflows.gap.read import checked_table

    faults = start_faults_of(out, workers, resume, overwrite)
    tables_given = raw(at_hand(source))
    where = executing(tables_given, settings, workers, dask, faults)
    plan, plan_faults = gap_plan(tables_given, settings)
    table, form_faults, place = opened(data, tables.ReadOptions(encoding, delimiter, decimal))
    file = None if isinstance(data, pd.DataFrame) else Path(data)
    measurements, data_faults = checked_table(plan, table, form_faults, place, file)
    raise_all([*plan_faults, *faults, *data_faults])
    assert plan is not None
    assert measurements is not None
    report_lines(tell, READ, measurements.understood)
    folder, scratch = folder_for(out)
    done = closing(plan, measurements, folder, where, progress, resume, overwrite or out is None)
    return Gap(done.status, done.lines, done.result, folder, scratch)


def reproduce(
    claims: Sequence[AnyPath] = (),
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int | None = None,
    dask: str = "",
    progress: Callable[[ClaimsProgress], None] | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> Reproduction:
    """Recompute every figure that documents print, by default those that the package ships.

    Raises ConfigurationError with every fault of every file.
    """
    from .configuration.claims import read_claims
    from .workflows.execution import executor_of
    from .workflows.reproduce.reproduce import reproduce as comparing

    faults = start_faults_of(out, workers, resume, overwrite)
    where = executing({}, (), workers, dask, faults)
    plan = collected(lambda: read_claims([Path(path) for path in claims], settings), faults)
    raise_all(faults)
    folder, scratch = folder_for(out)
    done = comparing(plan, folder, executor_of(where), progress, resume, overwrite or out is None)
    return Reproduction(done.status, done.lines, done.result, folder, scratch)


def report(
    folders: AnyPath | Sequence[AnyPath],
    out: AnyPath | None = None,
    figures: AnyPath | None = None,
    *,
    watch: bool = False,
    tell: Tell | None = None,
) -> Report:
    """Build the page of a result again, or compare several runs; says where it is.

    With `watch` the page of one directory is renewed until its result is complete; without `out`
    the page lies next to the directory. Raises ConfigurationError where nothing can be built.
    """
    from .workflows.report import report as built

    sources = [folders] if isinstance(folders, str | PathLike) else list(folders)
    paths = [Path(folder) for folder in sources]
    target, drawn = (None if path is None else Path(path) for path in (out, figures))
    if watch:
        return _watched(paths, target, drawn, tell)
    raise_all(page_faults(paths, target, drawn))
    page = built(paths, target, drawn)
    report_lines(tell, "warning", page.remarks)
    return page


def _watched(folders: list[Path], out: Path | None, figures: Path | None, tell: Tell | None) -> Report:
    """`report` again and again; the path of the page is reported when it first exists."""
    from .workflows.report import watch

    page, shown_before = out or page_next_to(folders[0]), set[Path]()
    raise_all([*watch_faults(folders, figures), *page_faults(folders[:1], page)])

    def shown(built_page: Report) -> None:
        if built_page.path not in shown_before:
            report_lines(tell, "page", [f"{built_page.path}, renewed every 5 s; Ctrl-C ends it"])
        shown_before.add(built_page.path)

    return watch(folders[0], page, shown)


def _with_problem(configuration: Configuration) -> Configuration:
    if configuration.problem is None:
        raise refuse("problem", "is missing: a model alone can only be simulated")
    return configuration
