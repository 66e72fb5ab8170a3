"""The replicates of a bootstrap, kept in a file as they end, and whose they are."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ...errors import Fault, raise_all, refuse
from ...files import write_text
from ...section import flat
from .data import GapData
from .plan import GapPlan

FILE = "replicates.jsonl"
WHOLE = "gap.json"
"""Written last: where it is, the analysis has ended."""
BUDGET = "settings.bootstrap"
"""The key that may differ between an analysis and what goes on with it: it may grow."""
Replicate = Mapping[str, Mapping[str, float]]
"""Effects that a replicate names, with their parameters."""


@dataclass(frozen=True, slots=True)
class Identity:
    """What an analysis is of: its configuration (TOML), the SHA-256 of its data, the version."""

    configuration: str
    data: str
    version: str


def identity_of(plan: GapPlan, data: GapData) -> Identity:
    """Of this analysis."""
    return Identity(plan.configuration, data.digest, version("tolevo"))


class Replicates:
    """What replicates named, by number; kept in `path` where there is one."""

    def __init__(self, path: Path | None = None, identity: Identity | None = None) -> None:
        self.path = path
        self.identity = identity
        self.found: dict[int, Replicate] = {}

    def begin(self) -> None:
        """Write whose they are, and those that are known already; an older ending is removed."""
        if self.path is None or self.identity is None:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        (self.path.parent / WHOLE).unlink(missing_ok=True)
        lines = [json.dumps(asdict(self.identity))]
        lines += [_line(number, one) for number, one in sorted(self.found.items())]
        write_text(self.path, "".join(f"{line}\n" for line in lines))

    def keep(self, found: Mapping[int, Replicate]) -> None:
        """Add some that have ended."""
        self.found |= found
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as file:
                file.write("".join(f"{_line(at, one)}\n" for at, one in found.items()))
                file.flush()

    def missing(self, count: int) -> list[int]:
        """Numbers of those that have not ended, out of so many."""
        return [number for number in range(count) if number not in self.found]


def opened(folder: Path, identity: Identity, resume: bool) -> Replicates:
    """Those of an analysis into `folder`: none, or with `resume` those that it holds.

    Raises InputError where what it holds is not the same analysis, or none.
    """
    new = Replicates(folder / FILE, identity)
    if not resume or not folder.is_dir() or not any(folder.iterdir()):
        return new
    if not (folder / FILE).is_file():
        text = f"{folder} holds no {FILE} of an analysis; name another directory, or --overwrite"
        raise refuse("--resume", text)
    old, new.found = _read(folder / FILE)
    raise_all(_faults(old, identity))
    return new


def is_whole(folder: Path, identity: Identity) -> bool:
    """Whether `folder` holds this analysis, ended."""
    files = (folder / FILE, folder / WHOLE)
    return all(one.is_file() for one in files) and _read(files[0])[0] == identity


def _line(number: int, one: Replicate) -> str:
    return json.dumps({"number": number, "effects": one})


def _read(path: Path) -> tuple[Identity, dict[int, Replicate]]:
    """Whose they are, and all whole lines; the last one may have been cut."""
    lines = path.read_text(encoding="utf-8").split("\n")
    try:
        identity = Identity(**json.loads(lines[0]))
        rows = [json.loads(line) for line in lines[1:-1]]
        return identity, {int(row["number"]): row["effects"] for row in rows}
    except (ValueError, TypeError, KeyError) as error:
        text = f"{path} is damaged ({error}); start again with --overwrite"
        raise refuse("--resume", text) from None


def _faults(old: Identity, new: Identity) -> list[Fault]:
    """What makes this another analysis than that to be gone on with."""
    undo = "undo the change, or start again with --overwrite"
    was, now = (flat(tomllib.loads(one.configuration)) for one in (old, new))
    found = [
        Fault(key, f"is {_shown(now, key)}, but the analysis to resume has {_shown(was, key)}; "
              f"{undo}")
        for key in dict.fromkeys([*now, *was])
        if key != BUDGET and now.get(key) != was.get(key)
    ]  # fmt: skip
    if now[BUDGET] < was[BUDGET]:
        found.append(Fault(BUDGET, f"is {now[BUDGET]}, but the analysis to resume had "
                           f"{was[BUDGET]}: it may only grow; {undo}"))  # fmt: skip
    if old.data != new.data:
        found.append(Fault("data", f"are not those of the analysis to resume; {undo}"))
    if old.version != new.version:
        text = f"{new.version} goes on with no analysis of {old.version}; start again with"
        found.append(Fault("tolevo", f"{text} --overwrite"))
    return found


def _shown(values: Mapping[str, Any], key: str) -> str:
    return f'"{values[key]}"' if isinstance(values.get(key), str) else str(values.get(key, "unset"))
