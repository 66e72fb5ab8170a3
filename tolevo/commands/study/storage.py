"""The store of a study: one row per run as soon as it ends."""

from __future__ import annotations

import hashlib
import json
import secrets
import struct
import tomllib
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import count
from math import isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import Connection, Select, delete, func, select

from ...algorithms.archive import CURVE, Box
from ...errors import Fault, InputError, raise_all, refuse
from ...files import loads, read_record, sealed_record, unsealed_record, write_record
from ...section import differences as changes
from ...section import flat
from ...store.address import read_address
from ...store.backend import DAMAGE, Backend, Foreign, Newer, reason
from ...store.faults import not_ours
from ...store.sqlite_file import SqliteFile
from ...store.store import Store
from ...store.tables import RUNS, STUDY, TABLE, YARDSTICKS
from .plan import RESPONSES, StudyPlan, Yardstick
from .trial import RunRecord

# A run as a row of the database, with a checksum, and back.


COLUMNS = ("point", "replicate", "seed", "status", "reason", "evaluations", "cpu_s", *RESPONSES, "curve")
"""Columns of a run in addition to its number and its checksum."""
Row = tuple[Any, ...]


def row_of(number: int, run: RunRecord, wanted: tuple[str, ...]) -> Row:
    """The row of a run: number, `COLUMNS`, checksum. What is not a number is NULL."""
    values = [_null(run.responses[name]) if name in wanted else None for name in RESPONSES]
    curve = zlib.compress(np.ascontiguousarray(run.curve, dtype="<f8").tobytes(), 1)
    reason = run.reason.encode("utf-8", "replace").decode().replace("\0", "\ufffd")
    identity = (number, run.point, run.replicate, run.seed, run.status, reason)
    row = (*identity, run.evaluations, _null(run.cpu_s), *values, curve)
    return (*row, checksum(row))


def is_intact(row: Row) -> bool:
    """Whether a row is as it was written."""
    try:
        return len(row) == len(COLUMNS) + 2 and bool(row[-1] == checksum(row[:-1]))
    except (TypeError, ValueError, struct.error):
        return False


def record_of(row: Row) -> RunRecord:
    """The run of a row that is intact."""
    _, point, replicate, seed, status, reason, evaluations, cpu_s, *values, compressed, _ = row
    responses = {name: _number(value) for name, value in zip(RESPONSES, values, strict=True)}
    curve = np.frombuffer(zlib.decompress(compressed), dtype="<f8").reshape(-1, len(CURVE))
    return RunRecord(point, replicate, seed, status, reason, evaluations, _number(cpu_s), responses, curve)


def checksum(row: Row) -> int:
    """CRC-32 of the values of a row, exact to the bit."""
    total = 0
    for value in row:
        if isinstance(value, float):
            part = b"f" + struct.pack("<d", value)
        elif isinstance(value, int):
            part = b"i" + str(value).encode()
        elif isinstance(value, str):
            part = b"s" + value.encode()
        else:
            part = b"n" if value is None else b"b" + bytes(value)
        total = zlib.crc32(part + b"\0", total)
    return total


def _null(value: float) -> float | None:
    return None if isnan(value) else float(value)


def _number(value: float | None) -> float:
    return nan if value is None else float(value)


# Runs, claims and yardsticks of one study.


NAMES = ("number", *COLUMNS, "checksum")
ALL = select(*(RUNS.c[name] for name in NAMES))
WINDOW = 1000
"""Runs that are looked up at once."""


class Database(Store):
    """The open store of a study of `points` points.

    A run's number is replicate * points + point, so that more replicates change no number. A run
    is claimed before it is begun, so that no other process begins it; the claim ends with the
    process, or a while after its machine did. Raises RunError where nothing can be written; what
    is in it stays.
    """

    def __init__(
        self, backend: Backend, points: int, responses: tuple[str, ...], prefix: str = "", reading: bool = False
    ) -> None:
        super().__init__(backend, prefix, reading)
        self.points = points
        self.responses = responses

    # what has been done

    def count(self, total: int) -> tuple[int, int]:
        """Runs done and failed of the first `total` numbers."""
        failed = func.count().filter(RUNS.c.status == "failed")
        statement = select(func.count(), failed).where(RUNS.c.number < total)
        ended, wrong = self.read(lambda connection: connection.execute(statement).one())
        return ended - wrong, wrong

    def missing(self, total: int) -> list[int]:
        """Numbers of the runs that have not ended, by point and replicate."""
        ended = self.read(lambda connection: {n for (n,) in connection.execute(select(RUNS.c.number))})
        open_numbers = (number for number in range(total) if number not in ended)
        return sorted(open_numbers, key=lambda number: (number % self.points, number // self.points))

    def free(self, numbers: Sequence[int]) -> list[int]:
        """The numbers, from the first free one on, that no process has done or is at work on."""
        for at in range(0, len(numbers), WINDOW):
            some = numbers[at : at + WINDOW]
            taken = self.claimed(some) | self.read(partial(self.present, table=RUNS, numbers=some))
            unclaimed = [number for number in some if number not in taken]
            if unclaimed:
                return [*unclaimed, *numbers[at + WINDOW :]]
        return []

    def damaged(self) -> list[int]:
        """Numbers of the rows whose checksum is wrong. Raises DatabaseError where it is damaged."""

        def look(connection: Connection) -> list[int]:
            self.backend.check(connection, self.format)
            rows = connection.execute(ALL).yield_per(WINDOW)
            return [row[0] for row in map(tuple, rows) if not is_intact(row)]

        return self.read(look)

    def runs(self, total: int) -> list[RunRecord]:
        """The runs that have ended, by point and replicate."""
        return sorted(self._records(ALL.where(RUNS.c.number < total)), key=lambda run: (run.point, run.replicate))

    def of_point(self, point: int, total: int) -> list[RunRecord]:
        """The runs of one setting that have ended, by replicate."""
        numbers, records = range(point, total, self.points), list[RunRecord]()
        for at in range(0, len(numbers), WINDOW):
            some = RUNS.c.number.in_(list(numbers[at : at + WINDOW]))
            records += self._records(ALL.where(some))
        return sorted(records, key=lambda run: run.replicate)

    def _records(self, statement: Select[Any]) -> list[RunRecord]:
        rows = self.read(lambda connection: [tuple(row) for row in connection.execute(statement)])
        return [record_of(row) for row in rows]

    def row(self, number: int) -> Row | None:
        """The row of a run as it is, None where there is none."""
        statement = ALL.where(RUNS.c.number == number)
        stored = self.read(lambda connection: connection.execute(statement).one_or_none())
        return None if stored is None else tuple(stored)

    # what is to be done

    def claim_runs(self, numbers: Iterable[int]) -> list[int]:
        """Claim the runs that have not ended and that no living process has begun; returns them."""
        return self.claim(numbers, RUNS)

    def record(self, runs: Iterable[RunRecord]) -> int:
        """Write the runs that have ended; one that is there already stays as it is.

        Returns how many are new.
        """
        return self.insert([row_of(run.replicate * self.points + run.point, run, self.responses) for run in runs])

    def insert(self, rows: Sequence[Row]) -> int:
        """Write rows, those of another database as well; returns how many are new."""
        numbers = [row[0] for row in rows]
        values: list[dict[str, Any]] = [dict(zip(NAMES, row, strict=True)) for row in sorted(rows)]
        statement = self.backend.insert(RUNS).on_conflict_do_nothing()

        def work(connection: Connection) -> int:
            stored = self.present(connection, RUNS, numbers)
            if values:
                connection.execute(statement, values)
            self.finished(connection, numbers)
            return len(set(numbers) - stored)

        added = self.write(work)
        self.let_go(numbers)
        return added

    def forget(self, numbers: Iterable[int]) -> None:
        """Drop rows, so that the runs are done again."""
        statement = delete(RUNS).where(RUNS.c.number.in_(list(numbers)))
        self.write(lambda connection: connection.execute(statement))

    # yardsticks

    def yardsticks(self) -> dict[int, Yardstick]:
        """The yardsticks of the problems, by their number in the plan.

        One that is not as it was written is left out, and computed again.
        """
        statement = select(YARDSTICKS.c.problem, YARDSTICKS.c.value)
        rows = self.read(lambda connection: connection.execute(statement).all())
        measures = {number: _yardstick(value, number) for number, value in rows}
        return {number: measure for number, measure in measures.items() if measure is not None}

    def claim_yardstick(self, problem: int) -> bool:
        """Whether no other process computes the yardstick of a problem: then this one may."""
        return self.claim([_of(problem)], RUNS) != []

    def keep_yardstick(self, problem: int, yardstick: Yardstick) -> None:
        """Keep the yardstick of a problem."""
        record = asdict(yardstick.box) | {"value": yardstick.value, "bound": yardstick.bound}
        value = json.dumps(sealed_record(record, of=str(problem))).encode()
        row = self.backend.insert(YARDSTICKS).values(problem=problem, value=value)
        statement = row.on_conflict_do_update(index_elements=[YARDSTICKS.c.problem], set_={"value": row.excluded.value})

        def work(connection: Connection) -> None:
            connection.execute(statement)
            self.finished(connection, [_of(problem)])

        self.write(work)
        self.let_go([_of(problem)])


def _of(problem: int) -> int:
    """The number under which the yardstick of a problem is claimed."""
    return -1 - problem


def _yardstick(content: bytes | str, problem: int) -> Yardstick | None:
    try:
        record = unsealed_record(loads(content), of=str(problem))
    except (TypeError, ValueError):
        return None
    return Yardstick(Box(tuple(record["ideal"]), tuple(record["nadir"])), record["value"], record["bound"])


# Names of the files in which a study stores its runs.


DATABASE = "study.sqlite"
PLACE = "store.json"
"""Says that the runs are in a store that machines share, and where that is."""
CONFIGURATION = "config.toml"


# Opens the store of a study: a new one, that of an interrupted study, or a damaged file.


IDENTITY, POINTS, SEAL = STUDY, "points", "sha256"
"""What a database stores of its study: the resolved configuration, a hash of the design, and the
digest of both.
"""
SEALED = 2
"""Version of the tables from which on there is such a digest."""
GROWS = "seeds"
"""The only key of the runs that may differ in the command that resumes a study, upwards."""
HYPOTHESES = "reading"
"""The key of what is only tested on the runs."""
SHOWN = 12
"""Lost runs that are named one by one."""


class Unopened(Exception):
    """A database that may be sound cannot be opened: its path, the cause, and the remedy."""


def opened(plan: StudyPlan, backend: Backend, alone: bool, prefix: str = "") -> tuple[Database, tuple[str, ...]]:
    """The open store of a study, and what the user should know of it.

    Where this process is `alone`, claims of earlier ones whose names begin with `prefix` are
    dropped. Raises InputError where it belongs to another study, was written by a newer version,
    or where nothing of it can be read, Unopened where the disk is full, no server answers, or it
    cannot be written for another reason.
    """
    try:
        database, notes = _sound(backend, plan, prefix)
    except (Newer, Foreign) as error:
        raise refuse(backend.display_name, not_ours(error, backend)) from None
    except DAMAGE as error:
        if why := backend.hindrance(error):
            raise Unopened(backend.display_name, *why) from error
        if not isinstance(backend, SqliteFile):
            raise _unreadable(backend, reason(error)) from error
        database, notes = _recovered(backend, plan, reason(error))
    try:
        while not _taken(database, plan):
            pass  # another process has just written which study it belongs to
        if alone:
            database.drop_claims(prefix)
    except DAMAGE as error:
        database.close()
        raise _unreadable(backend, reason(error)) from error
    except BaseException:
        database.close()
        raise
    return database, notes


def _unreadable(backend: Backend, why: str) -> InputError:
    return refuse(backend.display_name, f"cannot be read: {why}; {backend.restart}")


def _sound(backend: Backend, plan: StudyPlan, prefix: str) -> tuple[Database, tuple[str, ...]]:
    """The database where its pages are sound; rows that were changed are forgotten, and named."""
    database = _database(backend, plan, prefix)
    try:
        wrong = database.damaged()
        if wrong:
            database.forget(wrong)
    except BaseException:
        database.close()
        raise
    runs = _runs_text(wrong, plan)
    return database, ((f"{runs} of {backend.display_name} had been changed and are done again",) if wrong else ())


def _database(backend: Backend, plan: StudyPlan, prefix: str = "") -> Database:
    return Database(backend, len(plan.points), plan.settings.responses, prefix)


def identity_faults(database: Database, plan: StudyPlan) -> list[Fault]:
    """What is wrong with taking the database for this study. Raises InputError where it says
    nothing that can be read.
    """
    new, old, backend = plan.settings.configuration, database.meta(IDENTITY), database.backend
    if database.meta(TABLE):
        raise refuse(backend.display_name, f"holds a computed table; {backend.alternative}")
    if not _seal_fits(database):
        raise _unreadable(backend, "the identity of its study is damaged")
    if old and old != new:
        try:
            faults = differences(old, new, backend.restart)
        except tomllib.TOMLDecodeError as error:
            raise _unreadable(backend, f"its configuration is damaged ({error})") from None
        if faults:
            return faults
    if database.meta(POINTS) not in ("", _points(plan)):
        text = "its points are not those of the study to resume: the table, or the version of what "
        return [Fault("design", f"{text}draws them, has changed; {backend.restart}")]
    return []


def _taken(database: Database, plan: StudyPlan) -> bool:
    """Whether the database, brought up to this version, says that it belongs to this study.

    Raises InputError where it belongs to another.
    """
    old = database.meta(IDENTITY)
    raise_all(identity_faults(database, plan))
    database.migrate()
    new, points = plan.settings.configuration, _points(plan)
    if (old, database.meta(POINTS)) == (new, points) and database.meta(SEAL):
        return True
    return database.set_meta({IDENTITY: new, POINTS: points, SEAL: _digest(new, points)}, IDENTITY, old)


def _points(plan: StudyPlan) -> str:
    return hashlib.sha256(plan.design.to_csv(index=False).encode()).hexdigest()


def _seal_fits(database: Database) -> bool:
    """Whether what the database stores of its study is as it was written."""
    identity, points, seal = (database.meta(key) for key in (IDENTITY, POINTS, SEAL))
    if database.format < SEALED and not seal:
        return True
    return seal == (_digest(identity, points) if identity or points else "")


def _digest(identity: str, points: str) -> str:
    return hashlib.sha256(f"{identity}\n{points}".encode()).hexdigest()


def differences(before: str, after: str, restart: str = SqliteFile.restart) -> list[Fault]:
    """What makes a configuration (TOML) that of another study than one before."""
    tables = [tomllib.loads(text) for text in (before, after)]
    old, new = map(flat, tables)
    faults = []
    for key, (was, now) in changes(*tables).items():
        if key == HYPOTHESES or (key == GROWS and new[key] > old[key]):
            continue
        hint = "it may only grow" if key == GROWS else "only seeds may grow"
        faults.append(Fault(key, f"is {now}, but the study to resume has {was}: {hint}; undo the change, or {restart}"))
    return faults


def _recovered(backend: SqliteFile, plan: StudyPlan, error: str) -> tuple[Database, tuple[str, ...]]:
    """A new database with every row of a damaged one that can be read and is as it was written."""
    path = backend.path
    identity, rows, holes = _salvaged(path, plan)
    if not rows:
        raise refuse(str(path), f"is damaged ({error}) and none of its runs can be read: {backend.restart}")
    identity = identity or _stored_configuration(path)
    aside = _put_aside(path)
    database = _database(SqliteFile(path), plan)
    if identity:
        database.set_meta({IDENTITY: identity, SEAL: _digest(identity, "")})
    database.insert(rows)
    again = f"; {_runs_text(holes, plan)} could not be read and are done again" if holes else ""
    return database, (
        f"{path} was damaged ({error}): {len(rows)} runs in it are whole{again}; the "
        f"damaged file is kept as {aside.name}",
    )


def _salvaged(path: Path, plan: StudyPlan) -> tuple[str, list[Row], list[int]]:
    """Configuration, whole rows and unreadable numbers of a damaged database.

    Every number is looked up by itself, so that a damaged page hides its own rows only.
    """
    identity = ""
    rows: list[Row] = []
    holes: list[int] = []
    try:
        database = Database(SqliteFile(path, reading=True), len(plan.points), (), reading=True)
    except (*DAMAGE, Newer, Foreign):
        return identity, rows, list(range(plan.total))
    with database:
        try:
            known = [database.meta(key) for key in (IDENTITY, POINTS)]
            if database.meta(SEAL) == _digest(*known):
                identity = known[0]
        except (*DAMAGE, ValueError):
            pass  # the configuration in the same directory is the same
        for number in range(plan.total):
            try:
                row = database.row(number)
            except DAMAGE:
                row = ()
            if row is not None and is_intact(row):
                rows.append(row)
            elif row is not None:
                holes.append(number)
    return identity, rows, holes


def _stored_configuration(path: Path) -> str:
    try:
        return (path.parent / CONFIGURATION).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _put_aside(path: Path) -> Path:
    """Rename a damaged database, with its log."""
    aside = next(name for k in count(1) if not (name := path.with_name(f"{path.name}.damaged-{k}")).exists())
    path.rename(aside)
    for tail in ("-wal", "-shm"):
        log = path.with_name(path.name + tail)
        if log.exists():
            log.rename(aside.with_name(aside.name + tail))
    return aside


def _runs_text(numbers: list[int], plan: StudyPlan) -> str:
    """Runs by point and replicate, the first few of them."""
    points = len(plan.points)
    some = [f"point {n % points} replicate {n // points}" for n in numbers[:SHOWN]]
    more = f" and {len(numbers) - SHOWN} more" if len(numbers) > SHOWN else ""
    return f"{len(numbers)} runs ({', '.join(some)}{more})"


# Where the runs of a study are stored: in a file of its directory, or in a shared store.


STORE, TOKEN = "store", "directory"
ANOTHER = "name another directory, or give --overwrite"


@dataclass(frozen=True, slots=True)
class Site:
    """The directory of a study and, where its runs are in a shared store, the address of that."""

    folder: Path
    address: str = ""

    @property
    def location(self) -> str:
        """Where the runs are, as messages state it."""
        return read_address(self.address).shown if self.address else str(self.folder)

    def begin(self) -> None:
        """Write to the directory where the runs are, and a token that marks its claims.

        It tells a resumed study which claims belong to processes that are gone.
        """
        if self.address:
            write_record(self.folder / PLACE, {STORE: self.location, TOKEN: secrets.token_hex(8)})

    def check(self) -> None:
        """Raises InputError where the directory does not hold a study that is kept there."""
        placed, file = _placed(self.folder), (self.folder / DATABASE).is_file()
        if placed is None and not file:
            text = f"{self.folder} holds no {DATABASE} of a study; name another directory, or --overwrite"
            raise refuse("--resume", text)
        if placed is None and self.address:
            text = f"the runs of {self.folder} are in its {DATABASE}: leave out --store, or"
            raise refuse("--store", f"{text} {ANOTHER}")
        if placed is not None and placed[STORE] != (self.location if self.address else ""):
            text = f"the runs of {self.folder} are in {placed[STORE]}: name that, or"
            raise refuse("--store", f"{text} {ANOTHER}")

    def backend(self, reading: bool = False) -> Backend:
        """The database."""
        if self.address:
            from ...store.postgresql import PostgreSQL

            return PostgreSQL(read_address(self.address))
        from ...store.sqlite_file import SqliteFile

        return SqliteFile(self.folder / DATABASE, reading)

    @property
    def prefix(self) -> str:
        """Beginning of the names under which processes of this directory claim runs."""
        placed = _placed(self.folder)
        return f"{placed[TOKEN]}-" if placed is not None else ""


def site_of(folder: Path) -> Site:
    """Where the runs of a study that was begun in a directory are."""
    try:
        placed = _placed(folder)
    except InputError:
        placed = None
    return Site(folder, "" if placed is None else placed[STORE])


def other_study(plan: StudyPlan, address: str, place: str) -> list[Fault]:
    """A fault for each key in which the study of a store is another one; nothing is written."""
    from ...store.backend import DAMAGE, reason

    backend = Site(Path(), address).backend()
    try:
        with Database(backend, len(plan.points), (), reading=True) as database:
            faults = identity_faults(database, plan) if database.format else []
    except DAMAGE as error:
        return [Fault(place, f"{backend.display_name} cannot be read: {reason(error)}")]
    except InputError as error:
        return [Fault(place, str(fault)) for fault in error.faults]
    head = f"{backend.display_name} belongs to another configuration"
    return [Fault(place, f"{head}: {fault.place} {fault.message}") for fault in faults]


def _placed(folder: Path) -> dict[str, str] | None:
    """The record in a directory of where its runs are."""
    try:
        record = read_record(folder / PLACE)
    except ValueError as error:
        text = f"cannot be read: {error}; start again with --overwrite"
        raise refuse(f"{folder}/{PLACE}", text) from error
    return None if record is None else {key: str(record[key]) for key in (STORE, TOKEN)}
