"""The page of the site with every key of a configuration, from the code that reads it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any

from tolevo import registry

from .configuration_keys import NAME, Key, all_keys
from .declared_pages import of_the_project

TEXTS = Path(__file__).with_name("keys.toml")
FILES = {"run": "run", "gap": "gap", "study": "study", "claims": "reproduce"}
"""Commands by the kind of file."""
INTRODUCTION = f"""# Configuration

Configurations are TOML. This page is generated from the code that reads them: it has every key,
its type, its range and its choices. A key that is not here is a fault, and the fault names the
nearest one. `{NAME}` stands for a name of your own or of a variable, output or column. A number
with a unit may also be written as text with any unit of the same dimension, such as `"2 um"`
([units](units_and_counts.md)). `--set key=value` changes any key from the command line. `tolevo
check CONFIG` prints a configuration with all its defaults. Names of `[parameters]` and `[variables]`:
[variables, outputs and parameters](names.md).
"""


def meanings() -> dict[str, str]:
    """What each key means, by its path."""
    return tomllib.loads(TEXTS.read_text(encoding="utf-8"))


def configuration_page() -> str:
    """The page as Markdown."""
    keys, texts = all_keys(), meanings()
    tables = [path for path, key in keys.items() if _is_table(path, keys)]
    parts = [INTRODUCTION, "## Top of the file\n", *_rows(keys, texts, "", tables)]
    for table in tables:
        parts += [f"## `{heading(table, keys)}`\n", texts[table] + _read_by(keys[table]) + "\n",
                  *_rows(keys, texts, table, tables)]  # fmt: skip
    parts += _plugins()
    return "\n".join(parts)


def heading(path: str, keys: dict[str, Key]) -> str:
    """A table as TOML writes it."""
    plain = path.replace("[]", "")
    return f"[[{plain}]]" if f"{path}[]" in _tables_of(keys) else f"[{plain}]"


def _tables_of(keys: dict[str, Key]) -> set[str]:
    return {key.table for key in keys.values()}


def _is_table(path: str, keys: dict[str, Key]) -> bool:
    return bool(_tables_of(keys) & {path, f"{path}[]"})


def _rows(keys: dict[str, Key], texts: dict[str, str], table: str, tables: list[str]) -> list[str]:
    """The keys of one table; tables of its own have their own heading."""
    own = [key for path, key in keys.items() if key.table in ((table, f"{table}[]") if table else
           ("",)) and not (path in tables and "number" not in key.types)]  # fmt: skip
    if not own:
        return []
    lines = [f"| `{key.name}` | {_type(key)} | {texts[key.path]} |" for key in own]
    return ["| key | type | meaning |", "|---|---|---|", *lines, ""]


def _type(key: Key) -> str:
    """Type, unit, range and choices of a key."""
    units = sorted(key.units)
    words = " or ".join(sorted(key.types - {"table"})) or "text, number or table"
    if "number" in key.types and len(units) == 1:
        words += f" [{units[0]}]"
    elif len(units) > 1:
        words += " in the unit of its owner"
    if key.choices:
        return f"{words}: {', '.join(f'`{one}`' for one in sorted(key.choices))}"
    ranges = sorted(key.ranges)
    return f"{words}, must {ranges[0]}" if len(ranges) == 1 else words


def _read_by(key: Key) -> str:
    files = [FILES[one] for one in FILES if one in key.files]
    return f" Read by {', '.join(f'`{one}`' for one in files)}." if files and len(files) < 4 else ""


def _plugins() -> Iterable[str]:
    """Algorithms, cost curves, distributions and designs with their own keys."""
    titles = {"algorithms": "Algorithms", "curves": "Cost curves",
              "distributions": "Distributions", "designs": "Study designs"}  # fmt: skip
    for group, title in titles.items():
        yield f"## {title}\n"
        yield "| name | keys and defaults | what it is |\n|---|---|---|"
        for name in of_the_project(group):
            kind = registry.load(group, name)
            keys = ", ".join(_field(one) for one in fields(kind)) or "none"
            yield f"| `{name}` | {keys} | {registry.describe(group, name)} |"
        yield ""


def _field(one: Any) -> str:
    plain = isinstance(one.default, int | float | str)
    return f"`{one.name}`" + (f" = {one.default}" if plain else "")
