"""Results of a benchmark in a file, a line of JSON each, by which an interrupted run goes on."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any


def kept(path: Path) -> Iterator[dict[str, Any]]:
    """The results in a file, none where there is no file; a line that was cut off is left out."""
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            yield json.loads(line)
        except json.JSONDecodeError:
            continue


def keep(path: Path, result: Mapping[str, Any]) -> None:
    """Add a result to a file."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(dict(result)) + "\n")
