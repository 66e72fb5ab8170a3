"""The command line: each command calls the function of its name in the Python interface."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from .arguments import template_faults
from .counts import forced
from .ending import exit_status
from .errors import raise_all
from .files import write_text
from .interrupts import INTERRUPTED, current, listen
from .options import Asked, Blocks, Dialect, Into, MessageOptions, Shared, grouped
from .results import Finished
from .streams import keep_standard_streams

GARBAGE = 200_000
"""New objects between two searches for cycles: imports make many objects and no garbage."""
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
    were interrupted.
    """
    interrupts = listen()
    gc.set_threshold(GARBAGE)
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


def command(name: str) -> Callable[[Callable[..., Finished | None]], Callable[..., Any]]:
    """Make a function a command: it prints its summary, if any, and ends with an exit status."""

    def registered(function: Callable[..., Finished | None]) -> Callable[..., Any]:
        whole = grouped(function)

        def ending(**options: Any) -> None:
            with exit_status(), forced(options.get("force", False)):
                finished = whole(**options)
            if finished is not None:
                raise typer.Exit(_ended(finished))

        ending.__dict__.update(vars(whole))
        ending.__annotations__, ending.__doc__ = whole.__annotations__, whole.__doc__
        return app.command(name)(ending)

    return registered


def _called(name: str, asked: Asked, *arguments: Any, **options: Any) -> Finished:
    """What a function of the Python interface returns, its progress shown on the terminal."""
    from . import api
    from .progress import shown

    with shown(name, asked.quiet) as progress:
        finished: Finished = getattr(api, name)(*arguments, **options, progress=progress)
        return finished


def _ended(finished: Finished) -> int:
    """Print how a command ended, and where its page is; returns the exit status."""
    if finished.status == "interrupted" and (interrupts := current()) is not None:
        interrupts.say(finished.lines[0])
        return INTERRUPTED
    for line in finished.lines:
        typer.echo(line, err=finished.status != "done")
    page = finished.folder / "report.html"
    if page.is_file():
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
    return _called("run", asked, config, **into.arguments(), **asked.arguments())


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
    return _called("gap", asked, config, data, **into.arguments(), **asked.arguments(), **asdict(dialect))


@command("study")
def study(config: Config, *, into: Into, shared: Shared, asked: Asked) -> Finished:
    """Run many optimisations over settings and seeds, and report what the settings do."""
    return _called("study", asked, config, **into.arguments(), **asked.arguments(), **asdict(shared))


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
    return _called("reproduce", asked, claims or (), **into.arguments(), settings=asked.set_)


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
    _called("evaluate", asked, config, designs, out, **options, quality=quality, frame=False)
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
    _called("simulate", asked, config, inputs, out, **options, frame=False)
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
    kind: Annotated[str, typer.Argument(help="designs, units, stack, gap or costs.")],
    out: Annotated[Path | None, typer.Option("--out", help="The file.", show_default="the terminal")] = None,
    config: Annotated[Path | None, typer.Option(help="Whose designs, costs or units.")] = None,
) -> None:
    """Write a filled-in table or configuration of the form that a command reads."""
    from .configuration.template import written

    text = written(kind, config)
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
    from .configuration.review import reviewed
    from .tables import ReadOptions

    typer.echo(reviewed(folder, parts, since or (), ReadOptions(**asdict(dialect))))


@command("list")
def list_(json_: Annotated[bool, typer.Option("--json", help="As JSON.")] = False) -> None:
    """List models, problems, algorithms, effects and calculations, including those of plugins."""
    from .listing import listed

    typer.echo(listed(json_))
