"""The Python interface: what the commands do, as functions that return their results.

Each takes a configuration as a path, a dictionary or what `read` returns, and tables as paths or
pandas frames. Nothing is written unless `out` is given. `tell` is called with each line that the
user should read, as soon as it is known: how a table was read ("read: ..."), "note: ...",
"model: ..." and "warning: ...". Bad input raises `ConfigurationError` with every fault
(`.faults`), as the commands print them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from os import PathLike, fspath
from os.path import exists, getsize
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from . import tables
from .arguments import choice_faults, file_faults, page_faults, page_next_to, source_faults, start_faults, watch_faults
from .errors import Fault, InputError, raise_all, refuse
from .execution import pinned
from .files import unwritable
from .results import Analysis, Gap, Reproduction, Run, Scratch, Study

if TYPE_CHECKING:
    import pandas as pd
    from pymoo.core.problem import Problem

    from .algorithms.run import Progress
    from .algorithms.settings import AlgorithmSettings
    from .asking import Search
    from .blocks import BlockProgress, Target
    from .commands.ask import Standing
    from .commands.certify import Certificate
    from .commands.gap.plan import GapProgress
    from .commands.report import Report
    from .commands.reproduce.claims import ClaimsProgress
    from .commands.study.plan import StudyProgress
    from .configuration.configuration import Configuration
    from .execution import Execution
    from .problems.tolerance_problem import ToleranceProblem

# Arguments of the functions of the Python interface, and how they are passed on.


AnyPath: TypeAlias = str | PathLike[str]
Raw: TypeAlias = "AnyPath | Mapping[str, Any] | ToleranceProblem | Problem"
"""A configuration: a path, a dictionary with the keys of the file, which may have objects in the
place of problem and algorithm, or a problem alone: of this suite, or of pymoo itself."""
Source: TypeAlias = "Raw | Configuration"
"""A configuration, or what `read` returns."""
Frame: TypeAlias = "AnyPath | pd.DataFrame"
"""A table: a path, or a frame whose columns bear the names that the file would have."""
Starts: TypeAlias = "Frame | Sequence[AnyPath]"
"""Designs to start from: a table, the directory of a run, or several paths of these."""
READ = "read"
NOTES = "notes"
"""Key in `attrs` of returned frames: how the table was read, and notes for the user."""
Tell = Callable[[str], None]
Result = TypeVar("Result")
Given = TypeVar("Given")


def collected(compute: Callable[[], Result], faults: Sequence[Fault]) -> Result:
    """The result of `compute`; its faults are raised together with the earlier `faults`."""
    try:
        return compute()
    except InputError as error:
        raise InputError([*error.faults, *faults]) from None


def executing(
    source: Source | Mapping[str, object],
    settings: Sequence[str],
    workers: int | None,
    dask: str,
    faults: list[Fault],
    block_rows: int | None = None,
) -> Execution:
    """Where a command computes: by its options and, where they state nothing, by its configuration;
    faults are added to `faults`.
    """
    from .configuration.configuration import Configuration
    from .configuration.search import read_execution
    from .execution import Execution

    options = Execution(workers, dask, block_rows)
    configuration = {} if isinstance(source, Configuration) else raw(source)
    execution, execution_faults = read_execution(configuration, settings, options)
    faults += execution_faults
    return execution


def start_faults_of(out: AnyPath | None, workers: int | None, resume: bool, overwrite: bool) -> list[Fault]:
    """What keeps a command from starting with these arguments."""
    if out is not None:
        return start_faults(Path(out), workers, resume, overwrite)
    faults = choice_faults(workers, resume, overwrite)
    if resume:
        faults.append(Fault("--resume", "needs the directory of the result that it continues: out"))
    return faults


def table_faults_of(
    out: AnyPath | None, source: Frame, partitioned: bool, resume: bool, overwrite: bool
) -> list[Fault]:
    """What keeps a table from being read, or its result, a file or a directory of blocks, from
    being written.
    """
    from .blocks import Target, folder_faults

    faults = choice_faults(None, resume, overwrite)
    read = Path(source) if isinstance(source, str | PathLike) else None
    if out is None:
        options = {"--resume": resume, "--overwrite": overwrite, "--partitioned": partitioned}
        text = "needs a file or directory to write to: out"
        return faults + [Fault(name, text) for name, is_set in options.items() if is_set]
    target = Target(Path(out), partitioned)
    if partitioned:
        faults += unwritable(target.path, "--out") + source_faults(target.path, read)
    else:
        faults += file_faults(target.path, read)
    if any(fault.place == "--out" for fault in faults):
        return faults
    return faults + (unwritable(target.blocks, "--out") or folder_faults(target.blocks, resume, overwrite))


def folder_for(out: AnyPath | None) -> tuple[Path, Scratch | None]:
    """The directory of the files: the user's, or a temporary directory, removed with the result."""
    if out is not None:
        return Path(fspath(out)), None
    scratch = Scratch()
    return scratch.path / "result", scratch


def at_hand(source: Given) -> Given | Path | Mapping[str, Any]:
    """The configuration, read at once where it comes through a pipe: that can be read but once."""
    from .configuration.source import at_hand as once_read

    return once_read(Path(source)) if isinstance(source, str | PathLike) else source


def raw(source: Raw) -> Path | Mapping[str, Any]:
    """A path or the tables of a configuration."""
    if isinstance(source, str | PathLike):
        return Path(source)
    return source if isinstance(source, Mapping) else {"problem": source}


def opened(source: Frame, options: tables.ReadOptions) -> tuple[tables.Table | None, list[Fault], str]:
    """A table, the faults of its form, and how they name it."""
    if not isinstance(source, str | PathLike):
        return *tables.table_of(source, "frame"), "frame"
    path = Path(source)
    return *tables.open_table(path, path.name, options), path.name


def readable(source: Frame, options: tables.ReadOptions) -> tuple[tables.Table, str]:
    """A table and how faults name it; raises those of its form."""
    table, faults, place = opened(source, options)
    raise_all(faults)
    assert table is not None
    return table, place


def report_lines(tell: Tell | None, kind: str, lines: Iterable[str]) -> None:
    """Call `tell` with each line, marked by its kind."""
    if tell is not None:
        for line in lines:
            tell(f"{kind}: {line}")


# The Python interface of tables that are computed row by row: `evaluate` and `simulate`.


@pinned()
def evaluate(
    source: Source,
    designs: Frame,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    quality: str = "reported",
    workers: int | None = None,
    dask: str = "",
    block_rows: int | None = None,
    partitioned: bool = False,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[BlockProgress], None] | None = None,
    frame: bool = True,
    tell: Tell | None = None,
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    shape: str | None = None,
) -> pd.DataFrame:
    """Every variable, output and limit margin of a problem at designs, one per row.

    A front or an allocation can be given as it stands: columns that are no variable are left out
    and named in `.attrs["notes"]`. With `quality` "search" outputs are as coarse as a search sees
    them, and empty where it does not look. Blocks of `block_rows` rows run in `workers` processes
    or on the Dask scheduler at `dask`; no byte depends on it. `out` is a file, or a directory with
    a Parquet file per block (`partitioned`); `resume` computes what is missing of it. Without
    `frame` an empty frame is returned, for results too large to be held. Raises ConfigurationError
    with every fault.
    """
    from .commands.evaluate import QUALITIES, designs_in, evaluation

    faults = table_faults_of(out, designs, partitioned, resume, overwrite)
    if quality not in QUALITIES:
        faults.append(Fault("--quality", f'must be one of {", ".join(QUALITIES)}, got "{quality}"'))
    source = at_hand(source)
    where = executing(source, settings, workers, dask, faults, block_rows)
    configuration = collected(lambda: read(source, settings), faults)
    problem, notes = configuration.problem, list[str]()
    if problem is None:
        faults.append(Fault("problem", "is missing: a model alone can only be simulated"))
    raise_all(faults)
    assert problem is not None
    report_lines(tell, "note", problem.effect_notes())
    statement = problem.declaration.model_statement
    report_lines(tell, "model", [statement] if statement else ())
    table, place = readable(designs, tables.ReadOptions(encoding, delimiter, decimal, shape))
    full = designs_in(problem, table, place, notes.extend)
    report_lines(tell, READ, notes)
    computing = evaluation(problem, full, configuration.toml(), quality)
    target = _target(out, partitioned, resume, overwrite, ["feasible"])
    return _computed(computing, where, target, progress, frame, notes)


@pinned()
def simulate(
    source: Source,
    inputs: Frame,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    workers: int | None = None,
    dask: str = "",
    block_rows: int | None = None,
    partitioned: bool = False,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[BlockProgress], None] | None = None,
    frame: bool = True,
    tell: Tell | None = None,
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    shape: str | None = None,
) -> pd.DataFrame:
    """A model's inputs and predictions, one operating point per row.

    Options as those of `evaluate`. Long Parquet files, and directories of such files, are read in
    batches. Raises ConfigurationError with every fault.
    """
    from .commands.simulate import OUTSIDE, Simulation, inputs_in, rows_of, streamed
    from .configuration.reader import build_model

    faults = table_faults_of(out, inputs, partitioned, resume, overwrite)
    source = at_hand(source)
    where = executing(source, settings, workers, dask, faults, block_rows)
    configuration = collected(lambda: read(source, settings), faults)
    raise_all(faults)
    model_settings = configuration.settings
    simulation = Simulation(
        build_model(configuration),
        configuration.seed,
        configuration.model_name,
        (*model_settings.effects, *model_settings.terms),
        dict(model_settings.zero),
        dict(model_settings.record),
    )
    understood, notes, index = list[str](), list[str](), None
    rows: Any = None
    if isinstance(inputs, str | PathLike):
        rows = streamed(simulation, Path(inputs), model_settings.columns, understood.extend, notes.extend)
    if rows is not None:
        columns = list(rows.names.values())
    else:
        table, place = readable(inputs, tables.ReadOptions(encoding, delimiter, decimal, shape))
        points = inputs_in(simulation, table, place, model_settings.columns, understood.extend, notes.extend)
        rows, columns, index = rows_of(points), list(map(str, points)), points.index
    report_lines(tell, READ, understood)
    report_lines(tell, "note", notes)
    computing = simulation.computed(rows, columns, configuration.toml())
    outputs = [output.name for output in simulation.model.outputs]
    target = _target(out, partitioned, resume, overwrite, outputs, [OUTSIDE])
    predictions = _computed(computing, where, target, progress, frame, [*understood, *notes])
    return predictions.set_axis(index) if index is not None and frame else predictions


def _target(out: AnyPath | None, partitioned: bool, resume: bool, overwrite: bool, *last: list[str]) -> Target | None:
    """Where the table goes. Raises InputError where that is a file whose columns do not end with
    one of `last`, as those of the command do, and that is not to be replaced.
    """
    from .blocks import Target

    if out is None:
        return None
    target = Target(Path(out), partitioned, resume, overwrite)
    if not partitioned and not overwrite and exists(out) and getsize(out):
        names = tables.columns_of(target.path)
        if not any(names[-len(ending) :] == ending for ending in last):
            raise refuse("--out", f"{out} holds something else: name another file, or add --overwrite")
    return target


def _computed(
    computing: Any,
    where: Any,
    target: Target | None,
    progress: Callable[[BlockProgress], None] | None,
    frame: bool,
    notes: Sequence[str],
) -> pd.DataFrame:
    """The table, by blocks; no other process is started for a single block."""
    from .blocks import computed
    from .execution import executor_of

    if not where.dask:
        where = replace(where, workers=min(where.workers or 1, computing.about(where.block_rows).total))
    done = computed(computing, executor_of(where), target, where.block_rows, progress, frame)
    done.attrs[NOTES] = tuple(notes)
    return done


def read(
    source: Source,
    settings: Sequence[str] = (),
    *,
    algorithm: AlgorithmSettings | None = None,
    seed: int | None = None,
    start: Starts | None = None,
) -> Configuration:
    """The configuration of a problem or model, checked and completed.

    `settings` are "key=value" as `--set` takes them. An `algorithm` (such as
    `tolevo.algorithms.NSGA2(population=40)`) and a `seed` take the place of those in the source,
    whose budget stays, as do the designs to `start` from. Raises ConfigurationError with every fault.
    """
    from .configuration.configuration import Configuration
    from .configuration.reader import read as read_raw

    if not isinstance(source, Configuration):
        return read_raw(raw(source), settings, algorithm, seed, start=stated(start))
    if settings:
        raise refuse(
            "--set", "cannot change a complete configuration: change its source, or the settings with which it is read"
        )
    if algorithm is None and seed is None and start is None:
        return source
    return read_raw(source.tables(), (), algorithm, seed, start=stated(start))


def stated(start: Starts | None) -> Any:
    """The value of the key `start`; paths are relative to the working directory."""
    if isinstance(start, str | PathLike):
        return str(Path(start).absolute())
    return [str(Path(path).absolute()) for path in start] if isinstance(start, Sequence) else start


def check(source: Source, settings: Sequence[str] = ()) -> str:
    """The resolved configuration of any command as TOML with comments, as `tolevo check` prints it.

    Raises ConfigurationError with every fault, those of `[execution]` included: a scheduler that it
    names is asked for an answer.
    """
    from .configuration.configuration import Configuration
    from .configuration.description import checked, describe

    faults: list[Fault] = []
    source = at_hand(source)
    executing(source, settings, None, "", faults)
    text = collected(
        lambda: (
            describe(read(source, settings)) if isinstance(source, Configuration) else checked(raw(source), settings)
        ),
        faults,
    )
    raise_all(faults)
    return text


@pinned()
def analyse(
    source: Source,
    out: AnyPath | None = None,
    *,
    settings: Sequence[str] = (),
    tell: Tell | None = None,
    overwrite: bool = False,
) -> Analysis:
    """Every requirement of a stack at the tolerances that its parts have, without a search.

    `.requirements` has a row for each requirement (nominal, worst case, mean +- 3 standard
    deviations, capability, yield), `.contributions` one for each part of it. Parts that are to be
    searched are analysed at the `tolerance` beside their range, else at their loosest, and limits need
    not be attainable. Raises
    ConfigurationError with every fault.
    """
    from .commands.analyse.analyse import analysis_of, lines_of, workbook_with_analysis, write_analysis
    from .configuration.configuration import Configuration
    from .configuration.reader import read as read_raw
    from .configuration.source import workbook_of

    faults = start_faults_of(out, None, False, overwrite)
    source = at_hand(source)

    def configuration() -> Configuration:
        if isinstance(source, Configuration):
            return read(source, settings)
        return read_raw(raw(source), settings, reachable=False)

    found = collected(configuration, faults)
    raise_all(faults)
    result = analysis_of(found)
    report_lines(tell, "warning", result.summary["warnings"])
    folder, scratch = folder_for(out)
    workbook = workbook_with_analysis(found, workbook_of(source))
    write_analysis(result, folder, overwrite or out is None, workbook)
    return Analysis("done", lines_of(result), result, folder, scratch)


@pinned()
def run(
    source: Source,
    out: AnyPath | None = None,
    *,
    algorithm: AlgorithmSettings | None = None,
    seed: int | None = None,
    start: Starts | None = None,
    settings: Sequence[str] = (),
    workers: int | None = None,
    dask: str = "",
    progress: Callable[[Progress], None] | None = None,
    tell: Tell | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> Run:
    """Run one optimisation: from a configuration or a problem to a Pareto front (`.front`).

    `algorithm` and `seed` take the place of those in the configuration, and so do the designs to
    `start` from: a table, the directory of a run, or several of them. `progress` is called after
    every generation. The result does not depend on `workers`. With `resume`, `out` may hold the
    same run, which is then continued. Raises ConfigurationError with every fault.
    """
    from .commands.run.proofs import searchable
    from .commands.run.run import run as running
    from .configuration.source import workbook_of

    faults = start_faults_of(out, workers, resume, overwrite)
    source = at_hand(source)
    where = executing(source, settings, workers, dask, faults)
    plan = collected(
        lambda: _with_problem(read(source, settings, algorithm=algorithm, seed=seed, start=start)), faults
    ).plan()
    collected(lambda: searchable(plan.problem, plan.algorithm), faults)
    raise_all(faults)
    plan = replace(plan, workbook=workbook_of(source))
    report_lines(tell, "warning", plan.problem.cautions())
    folder, scratch = folder_for(out)
    done = running(plan, folder, where, progress, resume, overwrite or out is None)
    return Run(done.status, done.lines, done.result, folder, scratch)


@pinned()
def search(
    source: Source,
    algorithm: AlgorithmSettings | None = None,
    *,
    seed: int | None = None,
    start: Starts | None = None,
    settings: Sequence[str] = (),
) -> Search:
    """A search in the caller's loop: `ask` for designs, `tell` their outputs, take the `result`.

    `start` are designs, one per row, that the first generation begins with (evenly spread over their
    rows, if they are more than it holds); a front, an allocation or the directory of a run can be given
    as it stands. They lie in the ranges that are searched. The algorithm is that of the configuration
    where none is given. Raises ConfigurationError with every fault.
    """
    from .asking import Search, askable

    configuration = _with_problem(read(source, settings, algorithm=algorithm, seed=seed, start=start))
    raise_all(askable(configuration.algorithm_name, configuration.algorithm))
    plan = configuration.plan()
    return Search(plan.problem, plan.algorithm, plan.seed, plan.engine, plan.start)


@pinned()
def certify(
    problem: Source, result: Any, *, seeds: int = 3, evaluations: int = 4000, seed: int = 0, forms: bool = True
) -> Certificate:
    """How far a result of any optimiser is from the optimum of a problem, and what is proven of that.

    `result` is what pymoo, pygmo (a population), Optuna (a study), VAMOS, Platypus or jMetalPy return, a
    run of this suite, a frame of designs or an array (points, variables). `problem` may be a plain
    `Problem` of pymoo: forms (linear, convex quadratic, separable, posynomial) are then fitted to
    its values and verified at others, with some hundreds of evaluations, unless `forms` is False. Another
    algorithm searches from `seeds` seeds, with so many `evaluations` each. Raises ConfigurationError
    with every fault.
    """
    from .commands.certify import certify as certifying

    faults = [
        Fault(name, f"must be a whole number of at least {least}, got {value}")
        for name, value, least in (("seeds", seeds, 1), ("evaluations", evaluations, 100), ("seed", seed, 0))
        if value != round(value) or value < least
    ]
    configuration = collected(lambda: _with_problem(read(problem)), faults)
    raise_all(faults)
    assert configuration.problem is not None
    return certifying(configuration.problem, result, seeds, evaluations, seed, forms)


@pinned()
def ask(
    source: Source, out: AnyPath, *, settings: Sequence[str] = (), start: Starts | None = None, tell: Tell | None = None
) -> Standing:
    """Write the next designs of a search (`designs.csv`) into the directory `out`; see `tell`.

    A directory that holds the search is continued: its budget may have grown. Returns the designs
    (`.designs`), the results so far (`.told`) and their front (`.front`). Raises ConfigurationError
    with every fault.
    """
    from .commands.ask import ask as asking

    faults = unwritable(Path(out), "--out")
    plan = collected(lambda: _with_problem(read(at_hand(source), settings, start=start)), faults)
    raise_all(faults)
    assert plan.problem is not None
    report_lines(tell, "warning", plan.problem.cautions())
    return asking(plan, Path(out))


@pinned()
def tell(
    folder: AnyPath,
    results: Frame,
    *,
    tell: Tell | None = None,
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    shape: str | None = None,
) -> Standing:
    """Take results of designs that `ask` wrote: rows with `id` and outputs, in any order, or some alone.

    An output that is "failed" or not finite marks an evaluation that failed. Every result is on disk
    when this returns, and the directory holds the designs that are open then. Raises
    ConfigurationError with every fault; nothing is written then.
    """
    from .commands.ask import no_search_faults
    from .commands.ask import tell as taking

    faults = no_search_faults(Path(folder))
    try:
        table, place = readable(results, tables.ReadOptions(encoding, delimiter, decimal, shape))
    except InputError as error:
        raise InputError([*faults, *error.faults]) from None
    raise_all(faults)
    found, notes = taking(Path(folder), table, place)
    report_lines(tell, "note", notes)
    return found


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
    from .commands.study.configuration import read_study
    from .commands.study.study import study as studying
    from .execution import executor_of
    from .registry import needed

    faults = start_faults_of(out, workers, resume, overwrite) + needed("study")
    tables_given = raw(at_hand(source))
    where = executing(tables_given, settings, workers, dask, faults)
    plan = collected(lambda: read_study(tables_given, settings), faults)
    raise_all(faults)
    report_lines(tell, "warning", plan.warnings)
    folder, scratch = folder_for(out)
    done = studying(plan, folder, executor_of(where), progress, resume, overwrite or out is None)
    return Study(done.status, done.lines, done.result, folder, scratch)


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
    shape: str | None = None,
) -> Gap:
    """Where model and measurement disagree, which effect is missing, and the corrected model.

    Raises ConfigurationError with every fault of the configuration and of the data.
    """
    from .registry import needed

    raise_all(needed("gap"))
    from .commands.gap.configuration import gap_plan
    from .commands.gap.gap import gap as closing
    from .commands.gap.read import checked_table

    faults = start_faults_of(out, workers, resume, overwrite)
    tables_given = raw(at_hand(source))
    where = executing(tables_given, settings, workers, dask, faults)
    plan, plan_faults = gap_plan(tables_given, settings)
    table, form_faults, place = opened(data, tables.ReadOptions(encoding, delimiter, decimal, shape))
    file = Path(data) if isinstance(data, str | PathLike) else None
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
    from .commands.reproduce.configuration import read_claims
    from .commands.reproduce.reproduce import reproduce as comparing
    from .execution import executor_of

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
    from .commands.report import report as built

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
    from .commands.report import watch

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
