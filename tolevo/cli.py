"""The command line: each command calls the function of its name in the Python interface."""

from __future__ import annotations

import atexit
import json
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, get_type_hints

import typer

from . import registry
from .arguments import template_faults
from .errors import TolevoError, raise_all
from .files import cause, write_bytes, write_text
from .interrupts import INTERRUPTED, current, keep_standard_streams, listen, warn_in_a_line
from .results import Finished
from .section import force_counts

if TYPE_CHECKING:
    from .algorithms.run import Progress
    from .blocks import BlockProgress
    from .commands.gap.plan import GapProgress
    from .commands.reproduce.claims import ClaimsProgress
    from .commands.study.plan import StudyProgress

# How a command ends: exit status, and errors as lines without a traceback.


@contextmanager
def exit_status() -> Iterator[None]:
    """Errors as lines on stderr and an exit status, without a traceback for expected errors."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = warn_in_a_line
            yield
    except KeyboardInterrupt:
        _exit_interrupted()
    except BaseException as error:
        if (interrupts := current()) is not None and interrupts.requested:
            _exit_interrupted()  # an error of what was interrupted
        _exit_with_error(error)


def _exit_interrupted() -> NoReturn:
    interrupts = current()
    if interrupts is None:
        typer.echo("interrupted: nothing more is written", err=True)
    else:
        interrupts.say()
    raise typer.Exit(INTERRUPTED) from None


def _exit_with_error(error: BaseException) -> NoReturn:
    """Raise Exit with the message of an expected error, and any other as it is."""
    if isinstance(error, TolevoError):
        typer.echo(str(error), err=True)
        raise typer.Exit(error.exit_status) from None
    if isinstance(error, OSError):
        typer.echo(f"failed: {_message(error)}", err=True)
        raise typer.Exit(1) from None
    raise error


def _message(error: OSError) -> str:
    """The message of an error of the system for the file that was to be written."""
    why = cause(error)
    if why is None or not error.filename:
        return str(error)
    return f"{error.filename} cannot be written: {why[0]}; what was there is kept; {why[1]}"


# Options of the commands, in groups that commands take as single arguments.


WORKERS = min(4, os.cpu_count() or 1)
"""Default of --workers."""


@dataclass(frozen=True)
class MessageOptions:
    """Options of every command that prints messages in addition to its result."""

    quiet: Annotated[bool, typer.Option("--quiet", help="Print only errors to stderr.")] = False

    def report(self, line: str) -> None:
        """A line that the user should read, on stderr."""
        if not self.quiet:
            typer.echo(line, err=True)


@dataclass(frozen=True)
class Asked(MessageOptions):
    """Options of every command that reads a configuration."""

    set_: Annotated[list[str], typer.Option("--set", help="key=value; may be repeated.")] = field(default_factory=list)
    force: Annotated[bool, typer.Option("--force", help="Accept counts of any size.")] = False

    def arguments(self) -> dict[str, Any]:
        """As the functions of the Python interface take them."""
        return {"settings": self.set_, "tell": self.report}


@dataclass(frozen=True)
class Into:
    """Options of commands that write a directory."""

    out: Annotated[Path, typer.Option("--out", help="Where the results go.")]
    resume: Annotated[bool, typer.Option("--resume", help="Compute what is missing in OUT.")] = False
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what OUT holds.")] = False
    workers: Annotated[
        int | None, typer.Option(help="Processes; no result depends on it.", show_default=str(WORKERS))
    ] = None

    dask: Annotated[str, typer.Option(help="A Dask scheduler (tcp://host:port) instead.")] = ""

    def arguments(self) -> dict[str, Any]:
        """As the functions of the Python interface take them."""
        from .configuration.search import Usual

        return asdict(self) | {"workers": Usual(WORKERS) if self.workers is None else self.workers}


@dataclass(frozen=True)
class Blocks:
    """Options of commands that compute a table, which may be a long one."""

    workers: Annotated[int | None, typer.Option(help="Processes; no result depends on it.", show_default="1")] = None
    dask: Annotated[str, typer.Option(help="A Dask scheduler (tcp://host:port) instead.")] = ""
    block_rows: Annotated[int | None, typer.Option(help="Rows of a block.", show_default="of 250 blocks, or fewer")] = (
        None
    )
    partitioned: Annotated[
        bool, typer.Option("--partitioned", help="OUT is a directory, a Parquet file per block.")
    ] = False
    resume: Annotated[bool, typer.Option("--resume", help="Compute what is missing.")] = False
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace earlier blocks, or another file.")] = False


@dataclass(frozen=True)
class Dialect:
    """Options of commands that read a table."""

    encoding: Annotated[str | None, typer.Option(help="Of the table.", show_default="detected, or asked for")] = None
    delimiter: Annotated[
        str | None, typer.Option(help="comma, semicolon, tab, pipe or space.", show_default="detected")
    ] = None
    decimal: Annotated[
        str | None, typer.Option(help='Decimal sign of the table: "." or ",".', show_default="detected")
    ] = None
    shape: Annotated[str | None, typer.Option(help="wide, long or transposed.", show_default="detected")] = None


def expand_option_groups(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command whose arguments that are groups are options of their own, as typer wants them."""
    groups: dict[str, Any] = {}
    parameters: list[Parameter] = []
    for parameter in signature(command, eval_str=True).parameters.values():
        if is_dataclass(parameter.annotation):
            groups[parameter.name] = parameter.annotation
            parameters += _options(parameter.annotation)
        else:
            parameters.append(parameter.replace(kind=Parameter.KEYWORD_ONLY))

    def taken_apart(**options: Any) -> Any:
        built = {
            name: kind(**{option.name: options.pop(option.name) for option in fields(kind)})
            for name, kind in groups.items()
        }
        return command(**options, **built)

    taken_apart.__name__, taken_apart.__doc__ = command.__name__, command.__doc__
    taken_apart.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    taken_apart.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return taken_apart


def _options(group: Any) -> list[Parameter]:
    """The fields of a group as parameters."""
    hints = get_type_hints(group, include_extras=True)
    parameters = []
    for option in fields(group):
        default = option.default_factory() if option.default_factory is not MISSING else option.default
        default = Parameter.empty if default is MISSING else default
        kind = Parameter.KEYWORD_ONLY
        parameters.append(Parameter(option.name, kind, default=default, annotation=hints[option.name]))
    return parameters


STATUS = {"done": 0, "no_feasible_point": 1, "interrupted": INTERRUPTED}

app = typer.Typer(
    help="Tolerance allocation for mechanisms.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
Config = Annotated[Path, typer.Argument(help="Configuration (TOML).", show_default=False)]
Table = Annotated[Path, typer.Option("--out", help="The table that is written.")]


def main() -> None:
    """Entry point of the `tolevo` command; SIGTERM and SIGHUP end it as Ctrl-C does.

    An interrupted command ends without the end of the interpreter, which waits for libraries that
    were interrupted. One that has ended is no longer interrupted: the end of the interpreter takes 0.2 s
    and would restore what a signal does by default.
    """
    interrupts = listen()
    keep_standard_streams()
    try:
        app()
    finally:
        if interrupts.requested:
            interrupts.say()
            atexit._run_exitfuncs()
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
            os._exit(INTERRUPTED)
        interrupts.end()


def command(name: str) -> Callable[[Callable[..., Finished | None]], Callable[..., Any]]:
    """Make a function a command: it prints its summary, if any, and ends with an exit status."""

    def registered(function: Callable[..., Finished | None]) -> Callable[..., Any]:
        whole = expand_option_groups(function)

        def ending(**options: Any) -> None:
            with exit_status(), force_counts(options.get("force", False)):
                finished = whole(**options)
            if finished is not None:
                raise typer.Exit(_print_ending(finished))

        ending.__dict__.update(vars(whole))
        ending.__annotations__, ending.__doc__ = whole.__annotations__, whole.__doc__
        return app.command(name)(ending)

    return registered


def _call_with_progress(name: str, asked: Asked, *arguments: Any, **options: Any) -> Finished:
    """What a function of the Python interface returns, its progress shown on the terminal."""
    from . import api

    with progress_reporter(name, asked.quiet) as progress:
        finished: Finished = getattr(api, name)(*arguments, **options, progress=progress)
        return finished


def _print_ending(finished: Finished) -> int:
    """Print how a command ended, and where its page is; returns the exit status."""
    if finished.status == "interrupted" and (interrupts := current()) is not None:
        interrupts.say(finished.lines[0])
        return INTERRUPTED
    for line in finished.lines:
        typer.echo(line, err=finished.status != "done")
    page = finished.folder / "report.html"
    if page.is_file() and finished.scratch is None:
        typer.echo(f"page: {page}")
    return STATUS[finished.status]


@app.callback(invoke_without_command=True)
def _root(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        from . import __version__

        typer.echo(f"tolevo {__version__}")
        raise typer.Exit


@command("run")
def run(config: Config, *, into: Into, asked: Asked) -> Finished:
    """Run one optimisation: from a configuration to a Pareto front."""
    return _call_with_progress("run", asked, config, **into.arguments(), **asked.arguments())


@command("analyse")
def analyse(
    config: Config,
    *,
    out: Annotated[Path | None, typer.Option("--out", help="Where tables and page go.", show_default="none")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what OUT holds.")] = False,
    asked: Asked,
) -> Finished:
    """Analyse a stack as it stands: worst case, statistics, yield, contributions; no search."""
    from .api import analyse

    return analyse(config, out, overwrite=overwrite, **asked.arguments())


@command("ask")
def ask(
    config: Config,
    *,
    out: Annotated[Path, typer.Option("--out", help="The directory of the search; it may hold it already.")],
    asked: Asked,
) -> None:
    """Write the next designs of a search, to be evaluated elsewhere; `tell` takes their results."""
    from .api import ask

    for line in ask(config, out, **asked.arguments()).lines:
        typer.echo(line)


@command("tell")
def tell(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The directory of `ask`.")],
    results: Annotated[Path, typer.Argument(help="Table with id and outputs, any order, some rows alone.")],
    *,
    dialect: Dialect,
    messages: MessageOptions,
) -> None:
    """Take results of designs that `ask` wrote; each is on disk when the command ends."""
    from .api import tell

    for line in tell(folder, results, tell=messages.report, **asdict(dialect)).lines:
        typer.echo(line)


@command("gap")
def gap(
    config: Config,
    data: Annotated[Path, typer.Argument(help="Measurement table (CSV or Parquet).")],
    *,
    into: Into,
    dialect: Dialect,
    asked: Asked,
) -> Finished:
    """Find where model and measurement disagree, name the missing effect, correct the model."""
    return _call_with_progress("gap", asked, config, data, **into.arguments(), **asked.arguments(), **asdict(dialect))


@command("study")
def study(config: Config, *, into: Into, asked: Asked) -> Finished:
    """Run many optimisations over settings and seeds, and report what the settings do."""
    return _call_with_progress("study", asked, config, **into.arguments(), **asked.arguments())


@command("reproduce")
def reproduce(
    *,
    into: Into,
    claims: Annotated[
        list[Path] | None, typer.Argument(help="Files of claims (TOML).", show_default="those of the documents")
    ] = None,
    asked: Asked,
) -> Finished:
    """Recompute every figure that documents print, and report which of them hold."""
    return _call_with_progress("reproduce", asked, claims or (), **into.arguments(), settings=asked.set_)


@command("evaluate")
def evaluate(
    config: Config,
    designs: Annotated[Path, typer.Argument(help="Designs, one per row (CSV).")],
    *,
    out: Table,
    quality: Annotated[
        str, typer.Option(help="reported, or search: as coarsely as a search sees designs.")
    ] = "reported",
    blocks: Blocks,
    dialect: Dialect,
    asked: Asked,
) -> None:
    """Evaluate a configuration's problem at given designs."""
    options = asked.arguments() | asdict(dialect) | asdict(blocks)
    _call_with_progress("evaluate", asked, config, designs, out, **options, quality=quality, frame=False)
    typer.echo(f"written: {out}")


@command("simulate")
def simulate(
    config: Config,
    inputs: Annotated[Path, typer.Argument(help="Operating points, one per row.")],
    *,
    out: Table,
    blocks: Blocks,
    dialect: Dialect,
    asked: Asked,
) -> None:
    """Predict a configuration's model at given operating points."""
    options = asked.arguments() | asdict(dialect) | asdict(blocks)
    _call_with_progress("simulate", asked, config, inputs, out, **options, frame=False)
    typer.echo(f"written: {out}")


@command("report")
def report(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Results of run, study, gap.")],
    *,
    out: Annotated[Path | None, typer.Option("--out", help="The page.", show_default="DIR/report.html")] = None,
    figures: Annotated[Path | None, typer.Option(help="A folder for figures, PNG and SVG.")] = None,
    watch: Annotated[bool, typer.Option("--watch", help="Renew the page until the result is complete.")] = False,
    messages: MessageOptions,
) -> None:
    """Build the page of a result again, or compare several runs."""
    from .api import report

    typer.echo(f"page: {report(folders, out, figures, watch=watch, tell=messages.report).path}")


@command("check")
def check(config: Config, *, asked: Asked) -> None:
    """Validate a configuration and print all its values; the output is itself a configuration."""
    from .api import check

    text = check(config, asked.set_)
    if not asked.quiet:
        typer.echo(text)


@command("template")
def template(
    kind: Annotated[str, typer.Argument(help="designs, units, stack, gap, costs or qdas.")],
    out: Annotated[Path | None, typer.Option("--out", help="The file.", show_default="the terminal")] = None,
    config: Annotated[Path | None, typer.Option(help="Whose designs, costs or units.")] = None,
    run: Annotated[Path | None, typer.Option("--run", help="Whose limits, for qdas.")] = None,
) -> None:
    """Write a filled-in table or configuration of the form that a command reads."""
    from .commands.template import stack_workbook, written

    if kind == "stack" and out is not None and out.suffix.lower() == ".xlsx":
        raise_all(template_faults(out))
        write_bytes(out, stack_workbook(config))
        typer.echo(f"written: {out}")
        return
    text = written(kind, config, run)
    if out is None:
        typer.echo(text, nl=False)
        return
    raise_all(template_faults(out))
    write_text(out, text)
    typer.echo(f"written: {out}")


@command("review")
def review(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Result of a run of a stack.")],
    parts: Annotated[list[Path], typer.Argument(help="Measured parts (table or Q-DAS), a result of gap.")],
    *,
    since: Annotated[list[Path] | None, typer.Option("--since", help="Earlier parts; may be repeated.")] = None,
    dialect: Dialect,
) -> None:
    """Test the promise of a run against parts that were made to its drawing."""
    from .commands.review.configuration import review_text as reviewed
    from .tables import ReadOptions

    typer.echo(reviewed(folder, parts, since or (), ReadOptions(**asdict(dialect))))


@command("mcp")
def mcp(
    directory: Annotated[
        Path | None,
        typer.Option("--directory", help="Files are read and written in it alone.", show_default="none: read-only"),
    ] = None,
) -> None:
    """Serve the commands as tools of the Model Context Protocol, over stdin and stdout."""
    raise_all(registry.needed("mcp"))
    from .agents import serve

    serve(directory)


@command("list")
def list_(json_: Annotated[bool, typer.Option("--json", help="As JSON.")] = False) -> None:
    """List models, problems, algorithms, effects and calculations, including those of plugins."""
    typer.echo(list_as_text(json_))


# `tolevo list`: what is installed, as text or as JSON.


def list_as_text(as_json: bool = False) -> str:
    """Models, problems, algorithms, effects, calculations, and the elementary errors."""
    from .models.manipulator.maps import SOURCES

    groups = registry.listing() | {
        "elementary_errors": [
            {"name": error.name, "description": error.meaning, "origin": "manipulator"} for error in SOURCES
        ]
    }
    if as_json:
        return json.dumps(groups, indent=2)
    lines = []
    for group, entries in groups.items():
        lines.append(f"{group}:" if entries else f"{group}: none")
        for entry in entries:
            family = f"{entry['family']}: " if "family" in entry else ""
            text = f"{family}{entry['description']} [{entry['origin']}]"
            lines.append(f"  {entry['name']:<16} {text}")
    return "\n".join(lines)


# Progress on stderr: a bar on a terminal, sparse lines otherwise.


LINE_EVERY = 10.0
"""Seconds between two lines where stderr is not a terminal."""


def describe(progress: Progress) -> str:
    """Generation, evaluations, hypervolume and remaining time in one line."""
    step = f"generation {_count_of_total(progress.generation, progress.generations)}"
    evaluations = f"evaluations {_count_of_total(progress.evaluations, progress.evaluations_total)}"
    return f"{progress.phase or step}, {evaluations}, hypervolume {progress.hypervolume:.4f}{_remaining(progress)}"


def fraction(progress: Progress) -> float | None:
    """Fraction that is done, of the whole or of the budget; None where both are open."""
    if progress.share is not None:
        return progress.share
    pairs = ((progress.generation, progress.generations), (progress.evaluations, progress.evaluations_total))
    fractions = [done / total for done, total in pairs if total]
    if not fractions and progress.remaining is not None:
        fractions = [progress.seconds / max(progress.seconds + progress.remaining, 1e-9)]
    return min(1.0, max(fractions)) if fractions else None


def describe_study(progress: StudyProgress) -> str:
    """Runs done, running and failed, and the remaining time in one line."""
    text = f"runs {progress.done}/{progress.total} done, {progress.running} running, {progress.failed} failed"
    return text + _remaining(progress) + (f", {progress.note}" if progress.note else "")


def study_fraction(progress: StudyProgress) -> float | None:
    """Fraction of the runs that have ended."""
    return (progress.done + progress.failed) / progress.total if progress.total else None


def ended_share(progress: GapProgress | ClaimsProgress | BlockProgress) -> float | None:
    """Fraction of the parts that have ended; None where there are none."""
    return progress.done / progress.total if progress.total else None


def describe_gap(progress: GapProgress) -> str:
    """What is being done, replicates that have ended, and the remaining time in one line."""
    counted = f" {progress.done}/{progress.total}" if progress.total else ""
    return f"{progress.phase}{counted}{_remaining(progress)}"


def describe_claims(progress: ClaimsProgress) -> str:
    """Claims checked, the remaining time, and the claim that was checked last."""
    text = f"claims {progress.done}/{progress.total} checked, {progress.seconds:.0f} s"
    if progress.remaining is not None:
        text += f", some {progress.remaining:.0f} s left"
    elif progress.done < progress.total:
        text += ", all of them take some minutes"
    return f"{text}, {progress.note}" if progress.note else text


def describe_blocks(progress: BlockProgress) -> str:
    """Blocks that have ended, and the remaining time in one line."""
    return f"blocks {progress.done}/{progress.total}{_remaining(progress)}"


def _remaining(progress: Progress | StudyProgress | GapProgress | BlockProgress) -> str:
    return "" if progress.remaining is None else f", {progress.remaining:.0f} s left"


@dataclass(frozen=True)
class Display:
    """How the states of a command are shown: a line, the fraction that is done (None where it is
    not known), and a phase whose first state is always shown. A command of a single part shows
    nothing where it `counts_parts`: the part ends before a line would be read.
    """

    text: Callable[[Any], str]
    share: Callable[[Any], float | None] = ended_share
    phase: Callable[[Any], str] = lambda progress: ""
    counts_parts: bool = False


BLOCKS = Display(describe_blocks, counts_parts=True)
DISPLAYS: Mapping[str, Display] = {
    "run": Display(describe, fraction),
    "study": Display(describe_study, study_fraction),
    "gap": Display(describe_gap, phase=lambda progress: progress.phase),
    "reproduce": Display(describe_claims),
    "evaluate": BLOCKS,
    "simulate": BLOCKS,
}
"""By command."""


@contextmanager
def progress_reporter(command: str, quiet: bool) -> Iterator[Callable[[Any], None] | None]:
    """A function to call with every state of a command, None where nothing is to be shown."""
    display = DISPLAYS[command]
    if quiet:
        yield None
        return
    with _bar(display) if sys.stderr.isatty() else nullcontext(_lines(display)) as update:
        yield (lambda progress: update(progress) if progress.total > 1 else None) if display.counts_parts else update


def _count_of_total(done: int, total: int | None) -> str:
    return f"{done}" if total is None else f"{done}/{total}"


def _lines(display: Display) -> Callable[[Any], None]:
    """Prints the first report of each phase, and then one every `LINE_EVERY` seconds."""
    due, shown_last = 0.0, None

    def update(progress: Any) -> None:
        nonlocal due, shown_last
        phase = display.phase(progress)
        if time.monotonic() >= due or phase != shown_last:
            due, shown_last = time.monotonic() + LINE_EVERY, phase
            print(display.text(progress), file=sys.stderr, flush=True)

    return update


@contextmanager
def _bar(display: Display) -> Iterator[Callable[[Any], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(), TextColumn("{task.description}"))
    bar = Bar(*columns, console=Console(stderr=True), transient=True)
    task = bar.add_task("starting", total=None)

    def update(progress: Any) -> None:
        bar.start()  # with the first report: earlier messages stand above the bar
        completed = display.share(progress)
        total = None if completed is None else 1.0
        bar.update(task, total=total, completed=completed, description=display.text(progress))

    try:
        yield update
    finally:
        bar.stop()
