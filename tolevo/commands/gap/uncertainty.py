"""The uncertainty of the parameters: a block bootstrap of the whole selection."""

from __future__ import annotations

import hashlib
import json
import secrets
import time
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ...algorithms.checkpoint import Checkpoint
from ...directory import MANIFEST, Ownership
from ...errors import Fault, RunError, raise_all, refuse
from ...execution import Execution, Lost, executor_of
from ...files import digest_of, loads, seal_record, unseal_record, write_text
from ...journal import Section, recording_suspended
from ...section import Array, differences, flat
from .analysis import Analysis
from .data import GapData
from .fit import Fit, is_term
from .plan import GapPlan, GapProgress, Report, ignore_progress
from .selection import Search, select

# What an analysis resumes from, by its identity: the steps of its search, and the replicates of its
# bootstrap, kept in files as they end.

FILE = "replicates.jsonl"
STEPS = "steps.npz"
CONFIGURATION = "config.toml"
RESULT_FILE = "gap.json"
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
    """The effects that replicates identified, by number, and the steps before; kept where there is a `path`."""

    def __init__(
        self, path: Path | None = None, identity: Identity | None = None, retire: Callable[[], None] = lambda: None
    ) -> None:
        self.path = path
        self.identity = identity
        self.ended: dict[int, Replicate] = {}
        self._retire = retire
        self._steps = None if path is None or identity is None else Checkpoint(path.with_name(STEPS), _name(identity))
        self._allow_steps(False)

    def _allow_steps(self, allowed: bool) -> None:
        if self._steps is not None:
            self._steps.open = allowed

    def section(self, name: str) -> Section | None:
        """The steps of a part of the analysis, None where nothing is kept."""
        return None if self._steps is None else self._steps.section(name)

    def close(self) -> None:
        """Keep no more steps: the result is complete."""
        self._allow_steps(False)

    def save_steps(self) -> None:
        """Keep the steps so far, once the analysis has begun."""
        if self._steps is not None and self._steps.open:
            self._steps.write()

    def recall_steps(self, old: Identity) -> None:
        """Continue from the steps of the same analysis, `old` but for its budget, where they were kept."""
        if self._steps is None or self.identity is None or not self._steps.path.is_file():
            return
        steps = Checkpoint.read(self._steps.path)
        if steps.identity == _name(old):
            self._steps, steps.identity = steps, _name(self.identity)
            self._allow_steps(False)

    def begin(self) -> None:
        """Retire an older result, then write the identity and the replicates that are known."""
        if self.path is None or self.identity is None:
            return
        self._retire()
        self._allow_steps(True)
        write_text(self.path.with_name(CONFIGURATION), self.identity.configuration)
        head = json.dumps(seal_record(asdict(self.identity)))
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
        return json.dumps(seal_record(record, of=_name(self.identity))) + "\n"


def open_replicates(place: Ownership, identity: Identity, resume: bool) -> Replicates:
    """The replicates of an analysis into a directory: none, or with `resume` those that it holds.

    Raises InputError where it holds another analysis, or none.
    """
    folder = place.folder
    keep = (CONFIGURATION, FILE, STEPS) if resume else (CONFIGURATION,)
    new = Replicates(folder / FILE, identity, lambda: place.begin(keep))
    if not resume or place.blank:
        return new
    if not (folder / FILE).is_file():
        raise refuse("--resume", f"{folder} holds no {FILE} of an analysis; name another directory, or --overwrite")
    old, new.ended = _read(folder / FILE)
    raise_all(_faults(old, identity))
    new.recall_steps(old)
    return new


def is_complete(place: Ownership, identity: Identity) -> bool:
    """Whether a directory holds this analysis, complete; earlier versions had no manifest."""
    files = (place.folder / FILE, place.folder / RESULT_FILE)
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
        identity = Identity(**unseal_record(loads(first)))
        name, replicates = _name(identity), dict[int, Replicate]()
        for number, line in enumerate(lines[:-1], start=2):
            place = f"{path}, line {number}"
            row = unseal_record(loads(line), of=name)
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


PHASE = "bootstrap"
CHUNK = 4
"""Largest number of replicates that a process computes together."""


@dataclass(frozen=True)
class Spread:
    """The effects that the replicates of a bootstrap identified, with their parameters."""

    replicates: tuple[Replicate, ...]
    level: float

    def frequency(self, name: str) -> float:
        """Fraction of the replicates that identify an effect."""
        return float(np.mean([name in replicate for replicate in self.replicates]))

    def interval(self, owner: str, name: str, linear: tuple[float, float]) -> tuple[float, float]:
        """Percentiles of a parameter over the replicates with it; `linear` for fewer than 20."""
        values = [replicate[owner][name] for replicate in self.replicates if owner in replicate]
        if len(values) < 20 or not np.all(np.isfinite(linear)):
            return linear
        tail = 0.5 * (1.0 - self.level)
        low, high = np.quantile(values, [tail, 1.0 - tail])
        return float(low), float(high)


@dataclass(frozen=True)
class Chunk:
    """The numbers of replicates that are computed together, for the analysis called `name`."""

    numbers: tuple[int, ...]
    name: str

    @property
    def key(self) -> str:
        """A unique name, wherever it runs."""
        return f"{self.name}-{self.numbers[0]}-{self.numbers[-1]}"

    @property
    def called(self) -> str:
        """The chunk in words."""
        return f"replicates {self.numbers[0]} to {self.numbers[-1]}"


def bootstrap(
    analysis: Analysis, fit: Fit, replicates: Replicates, workers: Execution | int = 1, report: Report = ignore_progress
) -> Spread:
    """The selection repeated on records with the residuals of `fit`, drawn in blocks.

    Replicates that have ended are not repeated. Raises RunError where processes are lost.
    """
    plan = analysis.setup.plan
    count = plan.settings.bootstrap
    missing = replicates.missing(count)
    task = partial(_replicates, analysis.search, fit, plan.seed)
    begin, ended_before = time.monotonic(), len(replicates.ended)
    report(GapProgress(PHASE, count - len(missing), count))
    with executor_of(workers) as executor:
        size = max(1, min(CHUNK, len(missing) // (4 * max(1, executor.workers))))
        name = secrets.token_hex(8)
        chunks = iter([Chunk(tuple(missing[at : at + size]), name) for at in range(0, len(missing), size)])
        for chunk, outcome in executor.completed(task, lambda: next(chunks, None)):
            if isinstance(outcome, Lost):
                raise RunError(
                    f"{chunk.called}: {outcome.reason}; finished replicates are kept in "
                    f"{replicates.path}, continue with --resume"
                )
            replicates.add(outcome)
            done, remaining = len(replicates.ended) - ended_before, len(replicates.missing(count))
            report(GapProgress(PHASE, count - remaining, count, (time.monotonic() - begin) * remaining / done))
    return Spread(tuple(replicates.ended[number] for number in range(count)), plan.settings.interval)


def _replicates(search: Search, fit: Fit, seed: int, chunk: Chunk) -> dict[int, Replicate]:
    with recording_suspended():  # which are missing differs
        return {number: _replicate(search, fit, seed, number) for number in chunk.numbers}


def _replicate(search: Search, fit: Fit, seed: int, number: int) -> Replicate:
    rng = np.random.default_rng([seed, 4, number])
    again = replace(search, fitter=search.fitter.of_record(_draw_record(search, fit, rng)))
    selected = select(again, quick=True).fit
    # the generic terms are in every replicate, as in the answer
    if fit.terms:
        selected = again.fitter.refined([*selected.members, *fit.terms])
    return {
        member.name: member.candidate.values(member.shape, coefficients)
        for member, coefficients in zip(selected.members, selected.coefficients, strict=True)
        if not is_term(member)
    }


def _draw_record(search: Search, fit: Fit, rng: np.random.Generator) -> Array:
    """A whitened record: the prediction of the fit, and its residuals redrawn in stretches."""
    space, y = search.fitter.space, search.fitter.y
    n = space.rows_per_output
    length = max(1, round(n ** (1.0 / 3.0)))
    starts = rng.integers(0, n, int(np.ceil(n / length)))
    rows = ((starts[:, None] + np.arange(length)).ravel() % n)[:n]
    parts = [fit.residual[k * n : (k + 1) * n] for k in range(len(space.noises))]
    inflated = np.sqrt(n / max(n - len(fit.free) - sum(map(len, fit.coefficients)), 1))
    noise = np.concatenate([(part - part.mean())[rows] * inflated for part in parts])
    return np.asarray(y - fit.residual + np.pad(noise, (0, space.prior)))
