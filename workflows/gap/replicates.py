"""The replicates of a bootstrap, kept in a file as they end, and the identity of their analysis."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

from ...directory import MANIFEST, Ownership
from ...errors import Fault, raise_all, refuse
from ...files import write_text
from ...sealed import digest_of, loads, sealed_record, unsealed_record
from ...section import differences, flat
from .data import GapData
from .plan import GapPlan

FILE = "replicates.jsonl"
CONFIGURATION = "config.toml"
WHOLE = "gap.json"
"""Written last: the analysis has ended where it exists."""
BUDGET = "settings.bootstrap"
"""The key whose value may grow when an analysis is resumed."""
Replicate = Mapping[str, Mapping[str, float]]
"""The effects that a replicate identifies, with their parameters."""


@dataclass(frozen=True, slots=True)
class Identity:
    """The identity of an analysis: its configuration (TOML), the SHA-256 of its data, a version."""

    configuration: str
    data: str
    version: str


def identity_of(plan: GapPlan, data: GapData) -> Identity:
    """The identity of this analysis; its drawing, perhaps of another file, is part of the digest."""
    digest = data.digest
    if plan.drawing:
        digest = hashlib.sha256(f"{digest} {plan.drawing}".encode()).hexdigest()
    return Identity(plan.configuration, digest, version("tolevo"))


class Replicates:
    """The effects that replicates identified, by number; kept in `path` where there is one."""

    def __init__(
        self, path: Path | None = None, identity: Identity | None = None, retire: Callable[[], None] = lambda: None
    ) -> None:
        self.path = path
        self.identity = identity
        self.ended: dict[int, Replicate] = {}
        self._retire = retire

    def begin(self) -> None:
        """Retire an older result, then write the identity and the replicates that are known."""
        if self.path is None or self.identity is None:
            return
        self._retire()
        write_text(self.path.with_name(CONFIGURATION), self.identity.configuration)
        head = json.dumps(sealed_record(asdict(self.identity)))
        lines = [self._line(number, replicate) for number, replicate in sorted(self.ended.items())]
        write_text(self.path, "".join([f"{head}\n", *lines]))

    def add(self, replicates: Mapping[int, Replicate]) -> None:
        """Add replicates that have ended."""
        self.ended |= replicates
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as file:
                file.write("".join(self._line(number, replicate) for number, replicate in replicates.items()))

    def missing(self, count: int) -> list[int]:
        """The numbers below `count` of replicates that have not ended."""
        return [number for number in range(count) if number not in self.ended]

    def _line(self, number: int, replicate: Replicate) -> str:
        """The line of a replicate with its digest, by which it belongs to this analysis alone."""
        assert self.identity is not None
        record = {"number": number, "effects": replicate}
        return json.dumps(sealed_record(record, of=_name(self.identity))) + "\n"


def opened(place: Ownership, identity: Identity, resume: bool) -> Replicates:
    """The replicates of an analysis into a directory: none, or with `resume` those that it holds.

    Raises InputError where it holds another analysis, or none.
    """
    folder = place.folder
    keep = (CONFIGURATION, FILE) if resume else (CONFIGURATION,)
    new = Replicates(folder / FILE, identity, lambda: place.begin(keep))
    if not resume or place.blank:
        return new
    if not (folder / FILE).is_file():
        text = f"{folder} holds no {FILE} of an analysis; name another directory, or --overwrite"
        raise refuse("--resume", text)
    old, new.ended = _read(folder / FILE)
    raise_all(_faults(old, identity))
    return new


def is_complete(place: Ownership, identity: Identity) -> bool:
    """Whether a directory holds this analysis, complete; earlier versions had no manifest."""
    files = (place.folder / FILE, place.folder / WHOLE)
    if place.standing.unfinished is not None or not all(file.is_file() for file in files):
        return False
    if (place.folder / MANIFEST).exists() and not place.standing.complete:
        return False
    return _read(files[0])[0] == identity


def _name(identity: Identity) -> str:
    return digest_of(asdict(identity))


def _read(path: Path) -> tuple[Identity, dict[int, Replicate]]:
    """The identity, and the replicates of all whole lines; the last line may have been cut."""
    place = str(path)
    try:
        first, *lines = path.read_bytes().decode("utf-8").split("\n")
        identity = Identity(**unsealed_record(loads(first)))
        name, replicates = _name(identity), dict[int, Replicate]()
        for number, line in enumerate(lines[:-1], start=2):
            place = f"{path}, line {number}"
            row = unsealed_record(loads(line), of=name)
            replicates[int(row["number"])] = row["effects"]
    except (ValueError, TypeError, KeyError, OSError) as error:
        raise refuse(place, f"cannot be read: {error}; start again with --overwrite") from None
    return identity, replicates


def _faults(old: Identity, new: Identity) -> list[Fault]:
    """Differences between this analysis and the one to be resumed, as faults."""
    undo = "undo the change, or start again with --overwrite"
    tables = [tomllib.loads(identity.configuration) for identity in (old, new)]
    faults = [
        Fault(key, f"is {now}, but the analysis to resume has {was}; {undo}")
        for key, (was, now) in differences(*tables).items()
        if key != BUDGET
    ]
    was, now = map(flat, tables)
    if now[BUDGET] < was[BUDGET]:
        faults.append(
            Fault(BUDGET, f"is {now[BUDGET]}, but the analysis to resume had {was[BUDGET]}: it may only grow; {undo}")
        )
    if old.data != new.data:
        faults.append(Fault("data", f"are not those of the analysis to resume; {undo}"))
    if old.version != new.version:
        text = f"version {new.version} cannot resume an analysis of {old.version}; start again with --overwrite"
        faults.append(Fault("tolevo", text))
    return faults
