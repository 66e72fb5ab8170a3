"""Models, problems, algorithms and effects, found by entry points; ours are plugins like any other.

Groups: `tolevo.models`, `tolevo.problems`, `tolevo.algorithms`, `tolevo.effects`. Names and origins
are read from metadata; a plugin is imported only when it is used.
"""

from __future__ import annotations

import ast
import importlib.util
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from .errors import nearest, refuse

GROUPS = ("models", "problems", "algorithms", "effects")


def entries(group: str) -> dict[str, EntryPoint]:
    """The entry points of a group, by name; ours win over a plugin of the same name."""
    found = sorted(entry_points(group=f"tolevo.{group}"), key=lambda e: _owner(e) == "tolevo")
    return {entry.name: entry for entry in found}


def names(group: str) -> list[str]:
    """Names of a group, sorted."""
    return sorted(entries(group))


def load(group: str, name: str) -> Any:
    """The class behind a name.

    Raises InputError where the name is unknown or its plugin cannot be imported.
    """
    known = entries(group)
    if name not in known:
        listed = ", ".join(sorted(known)) or "none"
        raise refuse(group, f"`{name}` is not installed{nearest(name, known)}; there are: {listed}")
    try:
        return known[name].load()
    except (ImportError, AttributeError) as error:
        raise refuse(group, f"`{name}` of {origin(known[name])} cannot be used: {error}") from error


def _owner(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "unknown"


def origin(entry: EntryPoint) -> str:
    """Distribution and version that an entry point comes from."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else "unknown"


def describe(entry: EntryPoint) -> str:
    """First line of the class's docstring, read from its source without importing the plugin."""
    path = _source(entry.module)
    if path is None:
        return ""
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except (OSError, SyntaxError, UnicodeDecodeError):
        return ""
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == entry.attr:
            return _first_line(node)
    return _first_line(tree)


def _first_line(node: ast.Module | ast.ClassDef | ast.FunctionDef) -> str:
    return (ast.get_docstring(node) or "").partition("\n")[0]


def _source(module: str) -> Path | None:
    """Source file of a dotted module: only our own packages may be imported on the way."""
    top, *rest = module.split(".")
    try:
        spec = importlib.util.find_spec(module if top == "tolevo" else top)
    except (ImportError, ValueError):
        return None
    if spec is None or spec.origin is None:
        return None
    path = Path(spec.origin)
    if top == "tolevo" or not rest:
        return path
    below = path.parent.joinpath(*rest)
    options = (below.with_suffix(".py"), below / "__init__.py")
    return next((option for option in options if option.is_file()), None)


def listing() -> dict[str, list[dict[str, str]]]:
    """Everything installed, by group: name, description, origin."""
    return {
        group: [
            {"name": name, "description": describe(entry), "origin": origin(entry)}
            for name, entry in sorted(entries(group).items())
        ]
        for group in GROUPS
    }
