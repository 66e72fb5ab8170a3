"""Every key of a configuration, as the code that reads configurations asks for it.

The shipped configurations and the samples of `tools/sample_configurations.py` are read while each
question of the reader is recorded: its key, its table, its type, its unit, its range. A key that is
in the code and was never asked for is found by a test (tests/test_configuration_reference.py).
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache, wraps
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import tomli_w

from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.reproduce.configuration import read_claims, shipped_claims
from tolevo.commands.study.configuration import read_study
from tolevo.configuration.reader import read
from tolevo.configuration.search import read_execution
from tolevo.configuration.source import is_gap, is_study
from tolevo.errors import InputError
from tolevo.execution import Execution
from tolevo.section import ANY, Range, Section

from .sample_configurations import CLAIMS, SAMPLES

ROOT = Path(__file__).resolve().parent.parent
NAME = "NAME"
"""Stands for a name that the user gives or chooses, such as that of a variable."""
OF_NAMES = frozenset(
    [
        "amount",
        "at",
        "choice.limits",
        "choice.weights",
        "columns",
        "condition[].limits",
        "cost[].curves",
        "cost[].weights",
        "costs",
        "design.at",
        "effect[].bounds",
        "effect[].parameters",
        "free",
        "grouping",
        "limits",
        "loop[].unknown",
        "noise",
        "orders",
        "parameters",
        "price",
        "range",
        "record",
        "reducers",
        "robust.factors",
        "rounding",
        "sense",
        "sensitivity",
        "terms",
        "variables",
        "weights",
        "zero",
    ]
)
"""Tables whose keys are such names."""
PLAIN = frozenset({"costs.assumed", "costs.scale_assumed", "rounding.steps"})
"""Keys that stand beside such names."""
SHARED = (
    (r"^(?:part\[\](?:\.process\[\])?|feature\[\]|joint\[\]\.ERROR)\.cost(?=\.|$)", f"costs.{NAME}"),
    (r"^(cost\[\]\.curves\.\w+)\.(?!(?:model|cost_at|[abckmt])$)\w+", r"\1.MACHINE"),
    (r"^cost\[\]\.curves\.\w+(?=\.(?!MACHINE))", f"costs.{NAME}"),
    (r"^joint\[\]\.\w+_(?:mrad|um)(?=\.|$)", "joint[].ERROR"),
    (r"^joint\[\]\.ERROR\.cost(?=\.|$)", f"costs.{NAME}"),
    (r"^(?:part\[\]|variables\.NAME)\.(?=machine\[\]|machine$)", ""),
    (r"^(?:part\[\]|variables\.NAME|machine\[\])\.(?=measured(?:\.|$))", ""),
    (r"^(?:part\[\]|part\[\]\.process\[\]|machine\[\])\.(?=setup(?:\.|$))", ""),
    (r"^part\[\]\.process\[\]\.(?=inspection(?:\.|$))", "part[]."),
    (r"^condition\[\]\.(?=effect(?:\[\]|$)|parameters(?:\.|$))", ""),
    (r"^requirement(?=\.)", "requirement[]"),
    (r"(?<=limits\.NAME)(?:\.(?!min$|max$)[^.]+)+", ""),
    (r"(?<=weights\.NAME)\..*", ""),
    (r"^(claim\[\]\.reading\[\])\.terms\.NAME\.(?!unit$|value$)", r"\1."),
    (r"(?<=reading\[\]\.)(design|variables|costs|limits|at)\.\w+.*", r"\1.NAME"),
)
"""Tables that several others hold, or that are written in two ways, and the one that stands for
them."""
OUTSIDE = {
    "built_to.run": "text",
    "cell.joints_deg": "list of lists of numbers",
    **dict.fromkeys(("costs.decimal", "costs.delimiter", "costs.encoding", "costs.file", "costs.shape"), "text"),
    "free.NAME": "number or text with a unit",
    "measured.characteristic": "text",
    "measured.decimal": "text",
    "measured.delimiter": "text",
    "measured.encoding": "text",
    "measured.shape": "text",
    **dict.fromkeys((f"measured.gauge.{key}" for key in ("file", "characteristic", "encoding", "shape")), "text"),
    "measured.gauge.reference": "number in the unit of its owner",
    "measured.file": "text or list of texts",
    "noise.NAME": "number or text with a unit",
    **dict.fromkeys((f"part[].costs.{key}" for key in ("decimal", "delimiter", "encoding", "file", "shape")), "text"),
    "vary.NAME": "list or table",
}
"""Keys that are read before sections are made, or by whatever name they bear, and their types."""
QUESTIONS = ("number", "quantity", "integer", "flag", "text", "names", "numbers", "section",
             "tables", "named_items", "item", "items", "collecting", "take")  # fmt: skip
"""The methods of a section that ask for a key."""


READERS: dict[str, Callable[[Any], object]] = {
    "study": lambda source: read_study(source, (), 2),
    "gap": read_gap,
    "run": read,
}
ALIKE = ("pin_co2", "robot_arm_puma560", "robot_arm_ur5", "rv20e_like", "rv80e_like")
"""Shipped configurations with the keys of another one, which take their time, or whose keys are names of processes."""


@dataclass(slots=True)
class Key:
    """What the code asks of one key: `types` in words, and the units in which it is a number."""

    path: str
    files: set[str] = field(default_factory=set)
    types: set[str] = field(default_factory=set)
    units: set[str] = field(default_factory=set)
    ranges: set[str] = field(default_factory=set)
    choices: tuple[str, ...] = ()

    @property
    def table(self) -> str:
        """The table that the key stands in, empty for the top of the file."""
        return self.path.rpartition(".")[0]

    @property
    def name(self) -> str:
        """The key itself."""
        return self.path.rpartition(".")[2]


def pattern(place: str) -> str:
    """A place with NAME for what the user names, and without the numbers of tables."""
    place = re.sub(r"\[\d+\](?: \([^)]*\))?", "[]", place)
    if place.startswith("vary."):
        end = re.search(r"\.(low|high|levels|log|integer)$", place)
        return f"vary.{NAME}{end[0] if end else ''}"
    parts: list[str] = []
    for part in place.split("."):
        table = ".".join(parts)
        named = table in OF_NAMES or (bool(parts) and parts[-1] in OF_NAMES)
        parts.append(NAME if named and f"{table}.{part}" not in PLAIN else part)
    found = ".".join(part for part in parts if part)
    for several, one in SHARED:
        found = re.sub(several, one, found)
    return found


def _shown(within: Range) -> str:
    return "" if within == ANY else str(within)


def _of_number(unit: str = "", within: Range = ANY) -> dict[str, Any]:
    return {"types": "number", "units": unit, "ranges": _shown(within)}


ANSWERS: dict[str, Callable[..., dict[str, Any]]] = {
    "number": _of_number,
    "quantity": _of_number,
    "integer": lambda within=ANY, need=None: {"types": "whole number", "ranges": _shown(within)},
    "flag": lambda: {"types": "true or false"},
    "text": lambda choices=(): {"types": "text", "choices": tuple(choices)},
    "names": lambda: {"types": "list of texts"},
    "numbers": lambda: {"types": "list of numbers"},
    "section": lambda: {"types": "table"},
    "tables": lambda: {"types": "tables"},
    "take": dict,
}
"""What a question says of its key, by the method that asks it."""


@contextmanager
def recorded(keys: dict[str, Key], file: Callable[[], str]) -> Iterator[None]:
    """Record every question that sections are asked meanwhile; `file` names what is being read."""
    own = {name: getattr(Section, name) for name in ANSWERS}

    def asking(name: str) -> Callable[..., Any]:
        @wraps(own[name])
        def asked(section: Section, key: str, *args: Any, **given: Any) -> Any:
            if key:
                _note(keys, pattern(section.place(key)), file(), ANSWERS[name](*args, **given))
            return own[name](section, key, *args, **given)

        return asked

    try:
        for name in ANSWERS:
            setattr(Section, name, asking(name))
        yield
    finally:
        for name, method in own.items():
            setattr(Section, name, method)


def _note(keys: dict[str, Key], path: str, file: str, answer: dict[str, Any]) -> None:
    key = keys.setdefault(path, Key(path))
    key.files.add(file)
    if answer.get("choices"):
        key.choices = tuple(dict.fromkeys((*key.choices, *answer["choices"])))
    for name in ("types", "units", "ranges"):
        if answer.get(name):
            getattr(key, name).add(answer[name])


@cache
def all_keys() -> dict[str, Key]:
    """Every key by its path, in the order of the alphabet."""
    found: dict[str, Key] = {}
    now = ""
    with recorded(found, lambda: now):
        sources: list[Path | dict[str, Any]] = [*_shipped(), *SAMPLES]
        for source in sources:
            now = "study" if is_study(source) else "gap" if is_gap(source) else "run"
            with suppress(InputError):  # samples may contradict themselves
                READERS[now](source)
        now = "run"
        read_execution({}, (), Execution())  # a table that is taken out before the others
        now = "claims"
        with TemporaryDirectory() as place:
            paper = Path(place) / "paper.toml"
            paper.write_text(tomli_w.dumps(CLAIMS), encoding="utf-8")
            with suppress(InputError):
                read_claims((*shipped_claims(), paper))
    for path, kind in OUTSIDE.items():
        found.setdefault(path, Key(path)).types.add(kind)
    return {path: found[path] for path in sorted(found)}


def _shipped() -> list[Path]:
    files = [*(ROOT / "configs").glob("*.toml"), *(ROOT / "docs").rglob("*.toml")]
    left = ("claims_", "pyproject", *ALIKE)
    return sorted(one for one in files if not one.name.startswith(left))


def in_the_code() -> dict[str, str]:
    """Every key that production code asks a section for by its name, with one place of it."""
    found: dict[str, str] = {}
    for files in (
        "tolevo/configuration/*.py",
        "tolevo/commands/*/*configuration.py",
        "models/**/*.py",
        "problems/**/*.py",
    ):
        for file in sorted(ROOT.glob(files)):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if key := _asked(node):
                    found.setdefault(key, f"{file.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}")
    return found


def _asked(node: ast.AST) -> str:
    """The key of a question with a literal one, else nothing."""
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.args):
        return ""
    first = node.args[0]
    literal = isinstance(first, ast.Constant) and isinstance(first.value, str)
    return str(first.value) if literal and node.func.attr in QUESTIONS else ""  # type: ignore[attr-defined]
