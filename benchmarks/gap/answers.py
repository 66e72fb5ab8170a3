"""The file of answers: one line each, of the code that gave it and of no other."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from benchmarks.gap.trial import NAMERS, WORKFLOW
from benchmarks.kept import kept as results

ROOT = Path(__file__).resolve().parents[2]
HERE = "benchmarks/gap"
RECORDS = (f"{HERE}/generator/*.py", f"{HERE}/scoring/*rival*.py", f"{HERE}/scoring/told.py")
"""What makes a record, and says what it can tell."""
MODELS = "models/**/*.py"
"""The simulation of some records."""
PROJECT = (MODELS, "tolevo/**/*.py", f"{HERE}/namers/workflow.py")
"""What the workflow's answers follow from."""

Key = tuple[str, str, int]
"""Namer, group and number of an answer."""
Asked = tuple[list[str], str, int]
"""Namers, and group and number of the record that they are shown."""


@lru_cache
def code_of(namer: str) -> str:
    """A digest of the code that a namer's answers follow from; one of somebody's own may be
    anywhere: of the records alone.
    """
    if namer == WORKFLOW:
        own: tuple[str, ...] = PROJECT
    else:
        own = (f"{HERE}/namers/*.py",) if namer in NAMERS else (MODELS,)
    files = {file for pattern in (*RECORDS, *own) for file in ROOT.glob(pattern)}
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.relative_to(ROOT).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def key(one: dict[str, Any]) -> Key:
    return one["namer"], one["group"], one["number"]


def kept(path: Path) -> dict[Key, dict[str, Any]]:
    """The answers that are there and of today's code; a line that was cut off is left out."""
    return {key(one): one for one in results(path) if one.get("code") == code_of(one["namer"])}


def as_text(answers: Iterable[dict[str, Any]]) -> str:
    return "".join(json.dumps(one | {"code": code_of(one["namer"])}) + "\n" for one in answers)


def missing(wanted: Sequence[Key], there: Mapping[Key, Any]) -> list[Asked]:
    """What is still to be asked, each record once, all groups at the same pace."""
    by: dict[tuple[str, int], list[str]] = {}
    for one in wanted:
        if one not in there:
            by.setdefault((one[1], one[2]), []).append(one[0])
    return [(namers, group, number) for (group, number), namers in sorted(by.items(), key=_pace)]


def _pace(one: tuple[tuple[str, int], list[str]]) -> int:
    return one[0][1]
