"""Options of the commands, in groups that commands take as single arguments."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

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


Kept = Annotated[str, typer.Option(help="A database that machines share (postgresql://...).")]


@dataclass(frozen=True)
class Shared:
    """Options of commands whose runs several machines may do."""

    store: Kept = ""


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
        from .configuration.execution import Usual

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
    store: Kept = ""


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


def grouped(command: Callable[..., Any]) -> Callable[..., Any]:
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
