"""`tolevo mcp`: the commands as tools of a server of the Model Context Protocol, over stdin and stdout.

Results are small, with units, bounds and assumptions; faults are structured. Without a directory
nothing is read or written but what a call holds itself. With one, files are read and written in it
alone: every path is checked before a call is answered, and an audit hook of the interpreter refuses
every other file but what the packages read of their own, every connection and every process
afterwards, whoever asks for it.
"""

from __future__ import annotations

import json
import os
import sys
import tomllib
from collections.abc import Callable, Mapping
from ctypes import c_ulong, py_object, pythonapi
from dataclasses import asdict
from errno import EACCES
from inspect import Parameter, signature
from mimetypes import knownfiles
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock, Timer, get_ident
from typing import Annotated, Any

import numpy as np
import pandas as pd
from mcp.server import MCPServer
from mcp.server.mcpserver.exceptions import ToolError
from mcp_types import CallToolResult, TextContent
from pydantic import Field

from . import api, registry
from .configuration.configuration import Configuration
from .errors import Fault, InputError, TolevoError, nearest, refuse

ROWS = 12
"""Rows of a table in an answer, by default."""
BLOCKED = ("socket.connect", "socket.bind", "socket.getaddrinfo", "socket.sendto", "subprocess.Popen", "os.system",
           "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "os.forkpty")  # fmt: skip
"""Events of the interpreter that need the network or another process."""
CHANGES = ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod",
           "shutil.rmtree", "shutil.move", "shutil.copyfile")  # fmt: skip
"""Events that change files: their first arguments are paths."""
READABLE = ("/proc", "/sys", "/dev", "/etc/localtime", "/usr/share/zoneinfo", "/usr/share/fonts",
            "/usr/local/share/fonts", *map(str, knownfiles))  # fmt: skip
"""What the packages of figures and workbooks read of the system: fonts, and the kinds of files."""
OUTSIDE = "lies outside of the directory of this server"
NO_DIRECTORY = "this server reads and writes no files: start it with --directory DIR, or give the content itself"

Toml = Annotated[str, Field(description="A configuration (TOML), its whole text. Give this or file.")]
File = Annotated[str, Field(description="A configuration by its name in the directory of the server.")]
Out = Annotated[str, Field(description="Directory of the results, in that of the server; empty: nothing is written.")]
Rows = Annotated[int, Field(description="Rows of the front in the answer, evenly spread.", ge=1, le=200)]
Seconds = Annotated[float, Field(description="The answer is given up after so many seconds.", ge=1.0, le=86_400.0)]
TIME_LIMIT_S = 600.0
"""Time limit of a call, by default."""
Designs = Annotated[list[dict[str, float | str]], Field(description="Designs, one object each: variable to value.")]


class Guard:
    """What the server may touch: its directory, if it has one, and a scratch directory."""

    def __init__(self, directory: Path | None, scratch: Path) -> None:
        self.root = None if directory is None else directory.resolve()
        self.scratch = scratch.resolve()
        self.own = self.root or self.scratch
        """Where the paths in a configuration that is given as text begin."""
        package = Path(__file__).resolve().parent
        own = (Path(sys.prefix), Path(sys.base_prefix), package, package.parent)
        self._read = tuple(str(path.resolve()) for path in own) + READABLE
        self._write = tuple(str(path) for path in (self.root, self.scratch, "/dev/null") if path is not None)

    def path(self, name: str, place: str) -> Path:
        """The path of a name in the directory. Raises InputError where it is not inside."""
        if self.root is None:
            raise refuse(place, NO_DIRECTORY)
        if "\0" in name:
            raise refuse(place, "must be the name of a file")
        path = (self.root / name).resolve()
        if not path.is_relative_to(self.root):
            raise refuse(place, f"{name} {OUTSIDE}")
        return path

    def faults(self, value: Any, folder: Path, place: str = "") -> list[Fault]:
        """A fault for each text in the tables of a configuration in `folder` that names a file out of reach."""
        if isinstance(value, Mapping):
            inside = [(f"{place}.{key}".lstrip("."), inner) for key, inner in value.items()]
            return [fault for name, inner in inside for fault in self.faults(inner, folder, name)]
        if isinstance(value, list):
            return [f for at, inner in enumerate(value) for f in self.faults(inner, folder, f"{place}[{at}]")]
        if not isinstance(value, str) or len(value) > 4096 or "\n" in value:
            return []
        if place in ("problem", "model", "algorithm.name") and ":" in value:
            return [Fault(place, f"{value} is a class of a file: this server knows registered names alone")]
        named = Path(value)
        if named.is_absolute() or value.startswith("~") or ".." in named.parts:
            return [Fault(place, f"{value} {OUTSIDE}")]
        if os.path.lexists(folder / named) and not (folder / named).resolve().is_relative_to(self.own):
            return [Fault(place, f"{value} {OUTSIDE}")]
        return []

    def audit(self, event: str, arguments: tuple[Any, ...]) -> None:
        """The hook: raises PermissionError where an event is out of reach."""
        if event in BLOCKED:
            raise PermissionError(f"{event}: this server uses no network and starts no process")
        if event == "open":
            path, mode, flags = arguments
            writes = bool(flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND))
            self._allow(path, writes or any(letter in (mode or "") for letter in "wax+"))
        elif event in CHANGES:
            for path in arguments[:2]:
                self._allow(path, True)
        elif event in ("os.listdir", "os.scandir"):
            self._allow(arguments[0], False)

    def _allow(self, path: Any, writes: bool) -> None:
        if not isinstance(path, str | bytes | os.PathLike):
            return  # a handle that is open already
        whole = str(os.path.realpath(os.fsdecode(path)))
        caches = "__pycache__" in whole and writes  # compiled code of the packages themselves
        allowed: tuple[str, ...] = self._write if writes and not caches else (*self._write, *self._read)
        if not any(whole == root or whole.startswith(root + os.sep) for root in allowed):
            raise PermissionError(EACCES, OUTSIDE, os.fsdecode(path))


def serve(directory: Path | None = None) -> None:
    """Answer calls until stdin ends. Raises InputError where the directory does not exist."""
    if directory is not None and not directory.is_dir():
        raise refuse("--directory", f"{directory} is not a directory")
    with TemporaryDirectory(prefix="tolevo-") as name:
        os.environ["MPLCONFIGDIR"] = os.environ["TMPDIR"] = name
        import tempfile

        tempfile.tempdir = name
        guard = Guard(directory, Path(name))
        os.chdir(guard.own)
        server = Server(Tools(guard))
        sys.addaudithook(guard.audit)
        server.run()


class Server(MCPServer[Any]):
    """A server whose tools take no argument that they do not know."""

    def __init__(self, tools: Tools) -> None:
        text = "Tolerance allocation: check a configuration first, then analyse or run it. Faults say what to mend."
        super().__init__("tolevo", instructions=text, log_level="ERROR")
        self._functions = {name.strip("_"): getattr(tools, name) for name in TOOLS}
        for name, function in self._functions.items():
            self.add_tool(function, name=name)

    async def call_tool(self, name: str, arguments: dict[str, Any], context: Any = None) -> Any:
        """The answer of a tool; wrong arguments are structured faults, as those of its configuration."""
        if name not in self._functions:
            return _refused(refuse("name", f"{name} is no tool{nearest(name, self._functions)}"))
        known = next(tool.input_schema["properties"] for tool in await self.list_tools() if tool.name == name)
        if unknown := [key for key in arguments if key not in known]:
            faults = [Fault(key, f"is no argument of {name}{nearest(key, known)}") for key in unknown]
            return _refused(InputError(faults))
        try:
            return await super().call_tool(name, arguments, context)
        except ToolError as error:
            cause = error.__cause__
            if cause is None or not hasattr(cause, "errors"):
                raise
            found = [Fault(".".join(map(str, e["loc"])), str(e["msg"])) for e in cause.errors()]
            return _refused(InputError(found))


def answering(tool: Callable[..., dict[str, Any]]) -> Callable[..., CallToolResult]:
    """A tool whose result and faults are both structured, and as text, within a time limit."""
    from functools import wraps

    @wraps(tool)
    def answer(tools: Tools, *arguments: Any, time_limit_s: float = TIME_LIMIT_S, **options: Any) -> CallToolResult:
        try:
            with TimeLimit(time_limit_s):
                return _result(tool(tools, *arguments, **options), False)
        except InputError as error:
            fault = error
        except OSError as error:
            fault = refuse(str(error.filename or ""), error.strerror or str(error))
        except TolevoError as error:
            fault = refuse("", str(error))
        except OutOfTime:
            fault = refuse("time_limit_s", f"no answer within {time_limit_s:g} s: allow more, or ask for less")
        except Exception as error:  # a defect of a model or of this suite: said, never a traceback
            fault = refuse("", f"the computation failed: {type(error).__name__}: {error}")
        return _refused(InputError([Fault(*map(tools.relative, (f.place, f.message))) for f in fault.faults]))

    answer.__annotations__ = {**tool.__annotations__, "time_limit_s": Seconds, "return": CallToolResult}
    more = Parameter("time_limit_s", Parameter.KEYWORD_ONLY, default=TIME_LIMIT_S, annotation=Seconds)
    stated = signature(tool, eval_str=True)
    whole = stated.replace(parameters=[*stated.parameters.values(), more], return_annotation=CallToolResult)
    answer.__signature__ = whole  # type: ignore[attr-defined]
    return answer


class OutOfTime(BaseException):
    """A call has used its time; no search takes it for an interrupt that ends with what it has."""


class TimeLimit:
    """Raises OutOfTime in the thread of a `with` block that lasts longer than so many seconds."""

    def __init__(self, seconds: float) -> None:
        self._over = False
        self._open, self._lock, self._thread = True, Lock(), get_ident()
        self._timer = Timer(seconds, self._end)
        self._timer.daemon = True

    def __enter__(self) -> None:
        self._timer.start()

    def __exit__(self, *error: object) -> None:
        self._timer.cancel()
        with self._lock:
            self._open = False
            if self._over:  # what was not raised yet is not raised later
                pythonapi.PyThreadState_SetAsyncExc(c_ulong(self._thread), None)

    def _end(self) -> None:
        with self._lock:
            if self._open:
                self._over = True
                pythonapi.PyThreadState_SetAsyncExc(c_ulong(self._thread), py_object(OutOfTime))


PLACES = {"--out": "out", "frame": "designs", "result": "designs", "data.csv": "data"}
"""Names of the commands and the Python interface, and the arguments of the tools that they are."""


def _refused(error: InputError) -> CallToolResult:
    """The faults, each at an argument of the tool or in a configuration."""
    faults = []
    for fault in error.faults:
        name, colon, rest = fault.place.partition(":")
        message = fault.message.replace(", or add --overwrite or --resume", "")
        faults.append({"place": PLACES.get(name, name) + colon + rest, "message": message})
    return _result({"faults": faults}, True)


def _result(content: dict[str, Any], wrong: bool) -> CallToolResult:
    plain = _plain(content)
    text = TextContent(type="text", text=json.dumps(plain))
    return CallToolResult(content=[text], structured_content=plain, is_error=wrong)


def _plain(value: Any) -> Any:
    """A value as JSON has it: what is not finite is null, numbers have nine digits."""
    if isinstance(value, pd.DataFrame):
        return [_plain(row) for row in value.to_dict("records")]
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(inner) for inner in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return float(f"{value:.9g}") if np.isfinite(value) else None
    return value if isinstance(value, str | int | bool) or value is None else str(value)


GAP = ("verdict", "gap_before", "gap_after", "noise_floor", "effects", "alternatives", "unresolved", "remainder",
       "where", "next_measurement")  # fmt: skip
"""Entries of `gap.json` in an answer."""
TOOLS = ("list_", "check", "analyse", "run", "evaluate", "gap", "certify")


class Tools:
    """The tools of the server: each method is one, its arguments are what a client may give."""

    def __init__(self, guard: Guard) -> None:
        self._guard = guard

    def _tables(self, configuration: str, file: str) -> dict[str, Any] | Path:
        """The tables of a text, or the path of a file in the directory; every path that it names is inside."""
        if bool(configuration.strip()) == bool(file):
            raise refuse("configuration", "give its text, or file, the name of one in the directory of the server")
        path = self._guard.path(file, "file") if file else None
        try:
            text = configuration if path is None else path.read_text(encoding="utf-8")
            tables = tomllib.loads(text)
            found = self._guard.faults(tables, self._guard.own if path is None else path.parent)
        except (OSError, ValueError, RecursionError) as error:
            text = str(getattr(error, "strerror", None) or error)
            raise refuse("file" if file else "configuration", f"cannot be read: {text}") from None
        if found:
            raise InputError(found)
        return tables if path is None else path

    def relative(self, text: str) -> str:
        """A text without the place of the directory, and of what the server keeps for itself, on this machine."""
        for path in filter(None, (self._guard.root, self._guard.scratch)):
            text = text.replace(f"{path}{os.sep}", "").replace(str(path), ".")
        return text

    def _out(self, out: str) -> Path | None:
        return self._guard.path(out, "out") if out else None

    @answering
    def list_(self) -> dict[str, Any]:
        """Names of models, problems, algorithms and effects, with a line on each."""
        return {
            group: [{"name": entry["name"], "description": entry["description"]} for entry in entries]
            for group, entries in registry.listing().items()
        }

    @answering
    def check(self, configuration: Toml = "", file: File = "") -> dict[str, Any]:
        """Validate a configuration: all its values with units and assumptions, or every fault with its place."""
        return {"valid": True, "resolved": api.check(self._tables(configuration, file))}

    @answering
    def analyse(self, configuration: Toml = "", file: File = "", out: Out = "") -> dict[str, Any]:
        """Worst case, statistics, yield and contributions of a stack at its tolerances, without a search."""
        found = api.analyse(self._tables(configuration, file), self._out(out))
        return {
            "requirements": found.requirements,
            "contributions": found.contributions,
            "words": list(found.lines),
            "assumptions": found.summary["assumptions"],
        }

    @answering
    def run(self, configuration: Toml = "", file: File = "", out: Out = "", rows: Rows = ROWS) -> dict[str, Any]:
        """Optimise: the front with bounds and gaps, units, what is proven, and what is assumed."""
        read = api.read(self._tables(configuration, file))
        done = api.run(read, self._out(out), workers=1)
        problem, front = read.problem, done.front
        assert problem is not None
        limited = [limit.name for limit in problem.limits]
        names = [*problem.names, *problem.objectives, *limited, "bound", "gap_percent", "knee"]
        chosen = [name for name in dict.fromkeys(names) if name in front]
        at = np.unique(np.linspace(0, len(front) - 1, min(rows, len(front))).round().astype(int))
        # files in the scratch directory are gone when the answer is read
        kept = [line for line in done.lines if out or str(self._guard.scratch) not in line]
        return {
            "status": done.status,
            "points": len(front),
            "front": front.iloc[at][chosen],
            "words": kept,
            **_stated(read, front[chosen]),
            "assumptions": done.summary["assumptions"],
        }

    @answering
    def evaluate(self, designs: Designs, configuration: Toml = "", file: File = "") -> dict[str, Any]:
        """Every output and limit margin of a problem at given designs."""
        read = api.read(self._tables(configuration, file))
        found = api.evaluate(read, pd.DataFrame(designs))
        return {"designs": found, "words": list(found.attrs[api.NOTES]), **_stated(read, found)}

    @answering
    def gap(self, data: str, configuration: Toml = "", file: File = "", out: Out = "") -> dict[str, Any]:
        """Where model and measurement disagree; `data` is a table in the directory, or the text of a CSV table."""
        tables = self._tables(configuration, file)
        if "\n" in data:
            path = self._guard.scratch / "data.csv"
            path.write_text(data, encoding="utf-8")
        else:
            path = self._guard.path(data, "data")
        done = api.gap(tables, path, self._out(out), workers=1)
        found = done.record
        if found is None:
            return {"status": done.status, "words": list(done.lines)}
        from .commands.gap.gap import record

        whole = record(found)
        return {
            "status": done.status,
            **{key: whole[key] for key in GAP},
            "units": {axis.name: axis.unit for axis in (*found.outputs, *found.inputs) if axis.unit},
            "words": list(done.lines),
            "assumptions": whole["notes"],
        }

    @answering
    def certify(
        self,
        designs: Designs,
        configuration: Toml = "",
        file: File = "",
        seeds: Annotated[int, Field(ge=1, le=20)] = 3,
        evaluations: Annotated[int, Field(ge=100, le=100_000)] = 4000,
    ) -> dict[str, Any]:
        """How far designs are from the optimum: proven bound, best known, scatter, and what each says."""
        read = api.read(self._tables(configuration, file))
        found = api.certify(read, pd.DataFrame(designs), seeds=seeds, evaluations=evaluations)
        return {
            "points": found.points,
            "bounded": found.bounded,
            "scatter": found.scatter,
            "words": list(found.lines),
            **_stated(read, found.points),
        }


def _stated(configuration: Configuration, shown: pd.DataFrame) -> dict[str, Any]:
    """Units of the columns that are shown, and what the problem assumes."""
    problem = configuration.problem
    assert problem is not None
    units = {variable.name: variable.unit for variable in problem.variables}
    units |= {output.name: output.unit for output in problem.outputs}
    units = {name: unit for name, unit in units.items() if unit and name in shown}
    return {"units": units, "assumptions": [asdict(assumption) for assumption in problem.assumptions()]}
