"""The command line: `tolevo run | study | gap | reproduce | evaluate | simulate | report | ...`."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn, TypeVar

import typer

from .arguments import file_faults, page_faults, start_faults, template_faults
from .counts import forced
from .ending import INTERRUPTED, exit_status
from .errors import Fault, InputError, raise_all
from .files import write_text
from .tables import ReadOptions

if TYPE_CHECKING:
    from .configuration import Configuration
    from .workflows.gap import GapPlan
    from .workflows.gap.data import GapData
    from .workflows.gap.gap import GapOutcome
    from .workflows.reproduce.plan import ReproduceOutcome, ReproducePlan
    from .workflows.run import RunOutcome
    from .workflows.study import StudyOutcome, StudyPlan

    Outcome = RunOutcome | GapOutcome | StudyOutcome | ReproduceOutcome

WORKERS = min(4, os.cpu_count() or 1)
"""Default of --workers."""
STATUS = {"done": 0, "no_feasible_point": 1, "interrupted": INTERRUPTED}

app = typer.Typer(
    help="Tolerance allocation for mechanisms.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
Result = TypeVar("Result")
Config = Annotated[Path, typer.Argument(help="Configuration (TOML).", show_default=False)]
Out = Annotated[Path, typer.Option("--out", help="Where the results go.", show_default=False)]
Set = Annotated[list[str], typer.Option("--set", help="key=value; may be repeated.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Nothing on stderr but errors.")]
Encoding = Annotated[
    str | None, typer.Option(help="Of the table.", show_default="detected, or asked for")
]
Delimiter = Annotated[
    str | None,
    typer.Option(help="comma, semicolon, tab, pipe or space.", show_default="detected"),
]
Decimal = Annotated[
    str | None, typer.Option(help='Decimal sign of the table: "." or ",".', show_default="detected")
]
Force = Annotated[bool, typer.Option("--force", help="Refuse no count for its size.")]


def main() -> None:
    """Entry point of the `tolevo` command."""
    signal.signal(signal.SIGTERM, _terminated)
    app()


def _terminated(number: int, frame: object) -> NoReturn:
    """A polite kill ends a run as Ctrl-C does."""
    raise KeyboardInterrupt


@app.callback(invoke_without_command=True)
def _root(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
          ) -> None:  # fmt: skip
    if version:
        from . import __version__

        typer.echo(f"tolevo {__version__}")
        raise typer.Exit


@app.command()
def run(
    config: Config,
    out: Out,
    workers: Annotated[int, typer.Option(help="Processes; no result depends on it.")] = WORKERS,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a broken run.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what OUT holds.")] = False,
    set_: Set = [],  # noqa: B006
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Run one optimisation: from a configuration to a Pareto front."""
    with exit_status(), forced(force):
        faults = start_faults(out, workers, resume, overwrite)
        configuration = _collected(lambda: _search_of(config, set_), faults)
        raise_all(faults)
        status = _run(configuration, out, workers, quiet, resume, overwrite)
    raise typer.Exit(status)


@app.command()
def gap(
    config: Config,
    data: Annotated[Path, typer.Argument(help="Measurement table (CSV or Parquet).")],
    out: Out,
    workers: Annotated[int, typer.Option(help="Processes; no result depends on it.")] = WORKERS,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a broken run.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what OUT holds.")] = False,
    encoding: Encoding = None,
    delimiter: Delimiter = None,
    decimal: Decimal = None,
    set_: Set = [],  # noqa: B006
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Find where model and measurement disagree, name the missing effect, correct the model."""
    with exit_status(), forced(force):
        faults = start_faults(out, workers, resume, overwrite)
        options = ReadOptions(encoding, delimiter, decimal)
        plan, readings = _gap_input(config, data, set_, faults, options)
        _understood(readings.understood, quiet)
        status = _gap(plan, readings, out, workers, quiet, resume, overwrite)
    raise typer.Exit(status)


def _gap_input(
    config: Path, data: Path, settings: list[str], faults: list[Fault], options: ReadOptions
) -> tuple[GapPlan, GapData]:
    """The analysis and its data; the faults of both, and those found before, are raised at once.

    Its extra packages are asked for first.
    """
    from .registry import needed

    raise_all(needed("gap"))
    from .configuration.gap import gap_plan
    from .workflows.gap.read import checked

    plan, found = gap_plan(config, settings)
    readings, more = checked(plan, data, options)
    raise_all([*found, *faults, *more])
    assert plan is not None
    assert readings is not None
    return plan, readings


def _gap(
    plan: GapPlan, data: GapData, out: Path, workers: int, quiet: bool, resume: bool, replace: bool
) -> int:
    from .progress import shown_gap
    from .workflows.gap.gap import gap

    with shown_gap(quiet) as progress:
        outcome = gap(plan, data, out, workers, progress, resume, replace)
    return _ended(outcome, out)


def _run(
    configuration: Configuration, out: Path, workers: int, quiet: bool, resume: bool, replace: bool
) -> int:
    from .progress import shown
    from .workflows.run import run

    plan = configuration.plan()
    if not quiet:
        for warning in plan.problem.cautions():
            typer.echo(f"warning: {warning}", err=True)
    with shown(quiet) as progress:
        outcome = run(plan, out, workers, progress, resume, replace)
    return _ended(outcome, out)


@app.command()
def study(
    config: Config,
    out: Out,
    workers: Annotated[
        int | None, typer.Option(help="Processes; no result depends on it.", show_default="cores")
    ] = None,
    dask: Annotated[str, typer.Option(help="A Dask scheduler (tcp://host:port) instead.")] = "",
    resume: Annotated[bool, typer.Option("--resume", help="Do what is missing.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what OUT holds.")] = False,
    set_: Set = [],  # noqa: B006
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Run many optimisations over settings and seeds, and say what the settings do."""
    with exit_status(), forced(force):
        from .configuration.study import read_study

        faults = start_faults(out, workers, resume, overwrite, shared=True)
        if dask and workers is not None:
            faults.append(Fault("--dask", "has workers of its own; leave out --workers"))
        plan = _collected(lambda: read_study(config, set_), faults)
        raise_all(faults)
        status = _study(plan, out, workers or WORKERS, dask, quiet, resume, overwrite)
    raise typer.Exit(status)


def _study(
    plan: StudyPlan, out: Path, workers: int, dask: str, quiet: bool, resume: bool, replace: bool
) -> int:
    from .progress import shown_study
    from .workflows.study import executor_of, study

    executor = executor_of(workers, dask)
    if not quiet:
        for warning in plan.warnings:
            typer.echo(f"warning: {warning}", err=True)
    with shown_study(quiet) as progress:
        outcome = study(plan, out, executor, progress, resume, replace)
    return _ended(outcome, out)


@app.command()
def reproduce(
    out: Out,
    claims: Annotated[
        list[Path] | None,
        typer.Argument(help="Files of claims (TOML).", show_default="those of the documents"),
    ] = None,
    workers: Annotated[int, typer.Option(help="Processes; no result depends on it.")] = WORKERS,
    resume: Annotated[bool, typer.Option("--resume", help="Check what is missing.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what OUT holds.")] = False,
    set_: Set = [],  # noqa: B006
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Recompute every figure that documents print, and say which of them hold."""
    with exit_status(), forced(force):
        from .configuration.claims import read_claims

        faults = start_faults(out, workers, resume, overwrite)
        plan = _collected(lambda: read_claims(claims or (), set_), faults)
        raise_all(faults)
        status = _reproduce(plan, out, workers, quiet, resume, overwrite)
    raise typer.Exit(status)


def _reproduce(
    plan: ReproducePlan, out: Path, workers: int, quiet: bool, resume: bool, replace: bool
) -> int:
    from .progress import shown_claims
    from .workflows.reproduce.reproduce import reproduce
    from .workflows.study.execution import executor_of

    with shown_claims(quiet) as progress:
        outcome = reproduce(plan, out, executor_of(workers), progress, resume, replace)
    return _ended(outcome, out)


def _ended(outcome: Outcome, out: Path) -> int:
    """Say how a command ended, and where its page is; the exit status."""
    for line in outcome.lines:
        typer.echo(line, err=outcome.status != "done")
    page = out / "report.html"
    if page.is_file():
        typer.echo(f"page: {page}")
    return STATUS[outcome.status]


@app.command()
def evaluate(
    config: Config,
    designs: Annotated[Path, typer.Argument(help="Designs, one per row (CSV).")],
    out: Out,
    encoding: Encoding = None,
    delimiter: Delimiter = None,
    decimal: Decimal = None,
    set_: Set = [],  # noqa: B006
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Evaluate a configuration's problem at given designs."""
    with exit_status(), forced(force):
        faults = file_faults(out, designs)
        configuration = _collected(lambda: _problem_of(config, set_), faults)
        raise_all(faults)
        from .workflows.evaluate import evaluate

        assert configuration.problem is not None
        for note in () if quiet else configuration.problem.effect_notes():
            typer.echo(f"note: {note}", err=True)
        if not quiet and (statement := configuration.problem.model_statement):
            typer.echo(f"model: {statement}", err=True)
        options = ReadOptions(encoding, delimiter, decimal)
        evaluate(configuration.problem, designs, out, options, partial(_understood, quiet=quiet))
        typer.echo(f"written: {out}")


@app.command()
def simulate(
    config: Config,
    inputs: Annotated[Path, typer.Argument(help="Operating points, one per row.")],
    out: Out,
    encoding: Encoding = None,
    delimiter: Delimiter = None,
    decimal: Decimal = None,
    set_: Set = [],  # noqa: B006
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Predict a configuration's model at given operating points."""
    with exit_status(), forced(force):
        faults = file_faults(out, inputs)
        configuration = _collected(lambda: _read(config, set_), faults)
        raise_all(faults)
        from .configuration.simulated import build_model
        from .workflows.simulate import simulate

        name, effects = configuration.model_name, configuration.settings.effects
        model, seed = build_model(configuration), configuration.seed
        zero = configuration.settings.zero
        uses = configuration.settings.columns
        options, shown = (
            ReadOptions(encoding, delimiter, decimal),
            partial(_understood, quiet=quiet),
        )
        _, notes = simulate(model, inputs, out, seed, name, effects, zero, options, shown, uses)
        for note in () if quiet else notes:
            typer.echo(f"note: {note}", err=True)
        typer.echo(f"written: {out}")


@app.command()
def report(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Results of run, study, gap.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", help="The page.", show_default="DIR/report.html")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", help="A folder for figures, as PNG and SVG.")
    ] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Renew the page until the result is complete.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Build the page of a result again, or compare several runs."""
    with exit_status():
        if watch:
            _watch(folders, out, figures, quiet)
            return
        raise_all(page_faults(folders, out, figures))
        from .workflows.report import report as built

        found = built(folders, out, figures)
        for remark in () if quiet else found.remarks:
            typer.echo(f"warning: {remark}", err=True)
        typer.echo(f"page: {found.path}")


def _watch(folders: list[Path], out: Path | None, figures: Path | None, quiet: bool) -> None:
    """Renew the page of one directory, beside it where `out` says nothing else."""
    from .workflows.report import Report, watch

    faults = []
    if len(folders) != 1:
        faults.append(Fault("--watch", f"takes one directory, got {len(folders)}"))
    if figures is not None:
        faults.append(
            Fault("--figures", "are drawn when the result is complete; leave out --watch")
        )
    page = out or folders[0].resolve().with_suffix(".html")
    raise_all([*faults, *page_faults(folders[:1], page)])
    shown = set[Path]()

    def told(found: Report) -> None:
        if not quiet and found.path not in shown:
            typer.echo(f"page: {found.path}, renewed every 5 s; Ctrl-C ends it", err=True)
        shown.add(found.path)

    found = watch(folders[0], page, told)
    typer.echo(f"page: {found.path}")


@app.command()
def check(
    config: Config,
    set_: Set = [],  # noqa: B006
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Validate a configuration and print all it comes to; the output is itself one."""
    with exit_status(), forced(force):
        from .configuration.checked import checked

        text = checked(config, set_)
        if not quiet:
            typer.echo(text)


@app.command()
def template(
    kind: Annotated[str, typer.Argument(help="designs, units, stack, gap or costs.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="The file.", show_default="the terminal")
    ] = None,
    config: Annotated[
        Path | None, typer.Option("--config", help="Whose designs, costs or units.")
    ] = None,
) -> None:
    """Write the table or configuration that a command wants, filled in."""
    with exit_status():
        from .configuration.template import written

        text = written(kind, config)
        if out is None:
            typer.echo(text, nl=False)
            return
        raise_all(template_faults(out))
        write_text(out, text)
        typer.echo(f"written: {out}")


@app.command()
def review(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Result of a run of a stack.")],
    parts: Annotated[
        list[Path], typer.Argument(help="Measured parts (table or Q-DAS), a result of gap.")
    ],
    since: Annotated[
        list[Path] | None, typer.Option("--since", help="Earlier parts; may be repeated.")
    ] = None,
    encoding: Encoding = None,
    delimiter: Delimiter = None,
    decimal: Decimal = None,
) -> None:
    """Say what the promise of a run is worth by parts that were made to its drawing."""
    with exit_status():
        from .configuration.reviewed import reviewed

        options = ReadOptions(encoding, delimiter, decimal)
        typer.echo(reviewed(folder, parts, since or (), options))


@app.command("list")
def list_(json_: Annotated[bool, typer.Option("--json", help="As JSON.")] = False) -> None:
    """List models, problems, algorithms, effects and calculations, plugins included."""
    with exit_status():
        from .listing import listed

        typer.echo(listed(json_))


def _understood(lines: Iterable[str], quiet: bool) -> None:
    """What was understood of a table, before anything is made of it."""
    for line in () if quiet else lines:
        typer.echo(f"read: {line}", err=True)


def _read(config: Path, settings: list[str]) -> Configuration:
    from .configuration import read

    return read(config, settings)


def _problem_of(config: Path, settings: list[str]) -> Configuration:
    """A configuration that has a problem, not a model alone."""
    configuration = _read(config, settings)
    if configuration.problem is None:
        raise_all([Fault("problem", "is missing: a model alone can only be simulated")])
    return configuration


def _search_of(config: Path, settings: list[str]) -> Configuration:
    """A configuration that can be searched: its limits hold what they must, and are in reach."""
    from .workflows.run.reach import searchable

    configuration = _problem_of(config, settings)
    assert configuration.problem is not None
    searchable(configuration.problem)
    return configuration


def _collected(read: Callable[[], Result], faults: list[Fault]) -> Result:
    """The result of `read`; its faults are raised together with those found before."""
    try:
        return read()
    except InputError as error:
        raise InputError([*error.faults, *faults]) from None
