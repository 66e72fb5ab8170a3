"""The store of a study: its runs, each written as it ends, in one SQLite file of its directory.

The process that owns the directory is the only one that writes. A transaction in a write-ahead log
is there whole or not at all, whenever the process is killed.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import sqlite3
import struct
import tomllib
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from itertools import count
from math import isnan, nan
from pathlib import Path
from typing import Any

import numpy as np

from ...algorithms.archive import CURVE, Box
from ...errors import Fault, InputError, StorageError, raise_all, refuse
from ...execution import Closing
from ...files import REASONS, loads, seal_record, unseal_record
from ...section import differences as changes
from ...section import flat
from .plan import RESPONSES, StudyPlan, Yardstick
from .trial import RunRecord

DATABASE = "study.sqlite"
CONFIGURATION = "config.toml"
ELSEWHERE = "store.json"
"""Says, in a directory of tolevo 0.2.0, that the runs are in a PostgreSQL database."""
RESTART = "start again with --overwrite"
FORMAT = 4
"""Version of the tables; a newer one is refused. 3 and earlier ones had further tables, which are left alone."""
SEALED = 2
"""Version of the tables from which on there is a digest of what the store belongs to."""
APPLICATION = 0x746C7374
"""SQLite's mark of the program that owns a file."""
DAMAGE = (sqlite3.Error, UnicodeDecodeError)
"""What a damaged database may raise."""
HINDRANCES = {
    sqlite3.SQLITE_FULL: REASONS[errno.ENOSPC],
    sqlite3.SQLITE_IOERR: ("the disk reports an error, or is full", "make room or mend the disk"),
    sqlite3.SQLITE_READONLY: REASONS[errno.EROFS],
    sqlite3.SQLITE_CANTOPEN: ("it cannot be opened or made", "see to the permissions"),
    sqlite3.SQLITE_PERM: REASONS[errno.EACCES],
    sqlite3.SQLITE_BUSY: ("another process holds it", "wait for that"),
    sqlite3.SQLITE_LOCKED: ("another process holds it", "wait for that"),
    sqlite3.SQLITE_NOMEM: ("there is not enough memory", "make room"),
}
"""Errors that do not concern the content of a database: why, and what helps."""
COLUMNS = {
    "number": "INTEGER PRIMARY KEY",
    "point": "INTEGER NOT NULL",
    "replicate": "INTEGER NOT NULL",
    "seed": "INTEGER NOT NULL",
    "status": "TEXT NOT NULL",
    "reason": "TEXT NOT NULL",
    "evaluations": "INTEGER",
    "cpu_s": "REAL",
    **dict.fromkeys(RESPONSES, "REAL"),
    "curve": "BLOB",
    "checksum": "INTEGER",
}
"""Columns of a run: a row has its values in this order. What is not a number is NULL."""
TABLES = {
    "meta": {"key": "TEXT PRIMARY KEY", "value": "TEXT NOT NULL"},
    "runs": COLUMNS,
    "yardsticks": {"problem": "INTEGER PRIMARY KEY", "value": "BLOB NOT NULL"},
}
RUNS = f"SELECT {', '.join(COLUMNS)} FROM runs"
IDENTITY, POINTS, SEAL = "configuration", "points", "sha256"
"""What a store says of its study: the resolved configuration, a hash of the design, and the digest
of both.
"""
GROWS = "seeds"
"""The only key of the runs that may differ in the command that resumes a study, upwards."""
HYPOTHESES = "reading"
"""The key of what is only tested on the runs."""
SHOWN = 12
"""Lost runs that are named one by one."""
Row = tuple[Any, ...]


class Unusable(Exception):
    """A store that another program, or a newer version, has written; the text says which."""


class Unopened(Exception):
    """A store that may be sound cannot be opened: its path, the cause, and the remedy."""


class Database(Closing):
    """The open store of a study of `points` points.

    A run's number is replicate * points + point, so that more replicates change no number. Missing
    tables are created unless it is only read (`reading`). Raises Unusable, or `DAMAGE`, where it
    cannot be opened, StorageError where nothing can be written; what is in it stays.
    """

    def __init__(self, path: Path, points: int = 0, responses: tuple[str, ...] = (), reading: bool = False) -> None:
        self.path = path
        self.points = points
        self.responses = responses
        self._connection = _connected(path, reading)
        try:
            self.format = self._version()
            if not self.format and not reading:
                with self._transaction():
                    self._make()
        except BaseException:
            self._connection.close()
            raise

    def _version(self) -> int:
        """The version of the tables, 0 where there is none."""
        application, version = self._value("PRAGMA application_id"), self._value("PRAGMA user_version")
        if application == APPLICATION and version > FORMAT:
            raise Unusable(
                f"was written by a newer version of tolevo (format {version}, this one reads up to {FORMAT}): "
                "update tolevo, or name another directory"
            )
        tables = self._value("SELECT COUNT(*) FROM sqlite_schema")
        if tables and application != APPLICATION:
            raise Unusable("is not the database of a study; name another directory")
        return int(version) if tables else 0

    def _make(self) -> None:
        for table, columns in TABLES.items():
            unique = ", UNIQUE (point, replicate)" if table == "runs" else ""
            named = ", ".join(f"{name} {kind}" for name, kind in columns.items())
            self._connection.execute(f"CREATE TABLE {table} ({named}{unique})")
        self._connection.execute(f"PRAGMA application_id = {APPLICATION}")
        self._connection.execute(f"PRAGMA user_version = {FORMAT}")
        self.format = FORMAT

    def close(self) -> None:
        self._connection.close()

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        """What is executed here is written whole or not at all."""
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            with suppress(sqlite3.Error):  # a full disk has ended the transaction already
                self._connection.execute("ROLLBACK")
            raise

    def _write(self, statement: str, rows: Sequence[Sequence[Any]]) -> None:
        """Execute a statement for each row, for all of them or for none."""
        try:
            with self._transaction():
                self._connection.executemany(statement, rows)
        except sqlite3.Error as error:
            why, remedy = hindrance(error) or (reason(error), "mend that")
            text = f"cannot be written: {why}; {remedy}, then run the same command with --resume"
            raise StorageError(f"{self.path} {text}") from error

    def _rows(self, statement: str, *values: object) -> list[Row]:
        return self._connection.execute(statement, values).fetchall()

    def _value(self, statement: str, *values: object) -> Any:
        row = self._connection.execute(statement, values).fetchone()
        return None if row is None else row[0]

    # what it belongs to

    def meta(self, key: str) -> str:
        """What the store says of its study, by `key`; empty for a new store."""
        return str(self._value("SELECT value FROM meta WHERE key = ?", key) or "")

    def set_meta(self, values: Mapping[str, str]) -> None:
        """Write what the store belongs to."""
        self._write("INSERT OR REPLACE INTO meta VALUES (?, ?)", list(values.items()))

    # runs

    def count(self, total: int) -> tuple[int, int]:
        """Runs done and failed of the first `total` numbers."""
        statement = "SELECT COUNT(*), COUNT(*) FILTER (WHERE status = 'failed') FROM runs WHERE number < ?"
        ((ended, failed),) = self._rows(statement, total)
        return ended - failed, failed

    def missing(self, total: int) -> list[int]:
        """Numbers of the runs that have not ended, by point and replicate."""
        ended = {number for (number,) in self._rows("SELECT number FROM runs")}
        open_numbers = (number for number in range(total) if number not in ended)
        return sorted(open_numbers, key=lambda number: (number % self.points, number // self.points))

    def damaged(self) -> list[int]:
        """Numbers of the rows whose checksum is wrong. Raises DatabaseError where pages or tables are damaged."""
        if self._value("PRAGMA integrity_check(1)") != "ok":
            raise sqlite3.DatabaseError("pages are damaged")
        for table, columns in TABLES.items():
            if columns.keys() - {row[1] for row in self._rows(f"PRAGMA table_info({table})")}:
                raise sqlite3.DatabaseError("its tables are not those of a study")
        return [row[0] for row in self._connection.execute(RUNS) if not is_intact(row)]

    def runs(self, total: int) -> list[RunRecord]:
        """The runs that have ended, by point and replicate."""
        return [record_of(row) for row in self._rows(f"{RUNS} WHERE number < ? ORDER BY point, replicate", total)]

    def of_point(self, point: int, total: int) -> list[RunRecord]:
        """The runs of one setting that have ended, by replicate."""
        chosen = f"{RUNS} WHERE point = ? AND number < ? ORDER BY replicate"
        return [record_of(row) for row in self._rows(chosen, point, total)]

    def row(self, number: int) -> Row | None:
        """The row of a run as it is, None where there is none."""
        row: Row | None = self._connection.execute(f"{RUNS} WHERE number = ?", (number,)).fetchone()
        return row

    def responses_by_point(self) -> list[Row]:
        """Point and responses, in the order of `RESPONSES`, of every run that has ended."""
        return self._rows(f"SELECT point, {', '.join(RESPONSES)} FROM runs")

    def record(self, runs: Iterable[RunRecord]) -> None:
        """Write the runs that have ended; one that is there already stays as it is."""
        self.insert([row_of(run.replicate * self.points + run.point, run, self.responses) for run in runs])

    def insert(self, rows: Sequence[Row]) -> None:
        """Write rows, those of another store as well."""
        self._write(f"INSERT OR IGNORE INTO runs ({', '.join(COLUMNS)}) VALUES ({', '.join('?' * len(COLUMNS))})", rows)

    def forget(self, numbers: Iterable[int]) -> None:
        """Drop rows, so that the runs are done again."""
        self._write("DELETE FROM runs WHERE number = ?", [(number,) for number in numbers])

    # yardsticks

    def yardsticks(self) -> dict[int, Yardstick]:
        """The yardsticks of the problems, by their number in the plan.

        One that is not as it was written is left out, and computed again.
        """
        rows = self._rows("SELECT problem, value FROM yardsticks")
        measures = {number: _yardstick(value, number) for number, value in rows}
        return {number: measure for number, measure in measures.items() if measure is not None}

    def keep_yardstick(self, problem: int, yardstick: Yardstick) -> None:
        """Keep the yardstick of a problem."""
        record = asdict(yardstick.box) | {"value": yardstick.value, "bound": yardstick.bound}
        value = json.dumps(seal_record(record, of=str(problem))).encode()
        self._write("INSERT OR REPLACE INTO yardsticks VALUES (?, ?)", [(problem, value)])


def _connected(path: Path, reading: bool) -> sqlite3.Connection:
    if reading:
        connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True, isolation_level=None)
        connection.execute("PRAGMA writable_schema = ON")  # a file cut short is read all the same
        return connection
    os.close(os.open(path, os.O_RDWR | os.O_CREAT, 0o666))  # SQLite would not keep to the umask
    connection = sqlite3.connect(path, isolation_level=None)
    try:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")
    except BaseException:
        connection.close()
        raise
    return connection


def reason(error: BaseException) -> str:
    """The first line of a message."""
    return str(error).strip().partition("\n")[0]


def hindrance(error: BaseException) -> tuple[str, str] | None:
    """Why a sound store cannot be opened or written, and the remedy; None for damage."""
    code = getattr(error, "sqlite_errorcode", 0)
    return None if code == sqlite3.SQLITE_IOERR_SHORT_READ else HINDRANCES.get(code & 0xFF)


def _yardstick(content: bytes | str, problem: int) -> Yardstick | None:
    try:
        record = unseal_record(loads(content), of=str(problem))
    except (TypeError, ValueError):
        return None
    return Yardstick(Box(tuple(record["ideal"]), tuple(record["nadir"])), record["value"], record["bound"])


# a run as a row, and back


def row_of(number: int, run: RunRecord, wanted: tuple[str, ...]) -> Row:
    """The row of a run, with a checksum."""
    values = [_null(run.responses[name]) if name in wanted else None for name in RESPONSES]
    curve = zlib.compress(np.ascontiguousarray(run.curve, dtype="<f8").tobytes(), 1)
    reason = run.reason.encode("utf-8", "replace").decode().replace("\0", "\ufffd")
    identity = (number, run.point, run.replicate, run.seed, run.status, reason)
    row = (*identity, run.evaluations, _null(run.cpu_s), *values, curve)
    return (*row, checksum(row))


def is_intact(row: Row) -> bool:
    """Whether a row is as it was written."""
    try:
        return len(row) == len(COLUMNS) and bool(row[-1] == checksum(row[:-1]))
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


# opening: a new store, that of an interrupted study, or a damaged file


def check_resumable(folder: Path) -> None:
    """Raises InputError where a directory does not hold the store of a study."""
    if (folder / DATABASE).is_file():
        return
    if (folder / ELSEWHERE).is_file():
        raise refuse(
            "--resume",
            f"the runs of {folder} are in a PostgreSQL database (see {ELSEWHERE}): continue it with tolevo 0.2.0 "
            "(pip install 'tolevo[postgres]==0.2.0'), name another directory, or give --overwrite",
        )
    raise refuse("--resume", f"{folder} holds no {DATABASE} of a study; name another directory, or --overwrite")


def open_study_store(plan: StudyPlan, path: Path) -> tuple[Database, tuple[str, ...]]:
    """The open store of a study, and what the user should know of it.

    Raises InputError where it belongs to another study, was written by a newer version, or where
    nothing of it can be read, Unopened where the disk is full or it cannot be written for another
    reason.
    """
    try:
        database, notes = _sound_database(path, plan)
    except Unusable as error:
        raise refuse(str(path), str(error)) from None
    except DAMAGE as error:
        if why := hindrance(error):
            raise Unopened(str(path), *why) from error
        database, notes = _recover_database(path, plan, reason(error))
    try:
        _take(database, plan)
    except DAMAGE as error:
        database.close()
        raise _unreadable_fault(path, reason(error)) from error
    except BaseException:
        database.close()
        raise
    return database, notes


def _unreadable_fault(path: Path, why: str) -> InputError:
    return refuse(str(path), f"cannot be read: {why}; {RESTART}")


def _sound_database(path: Path, plan: StudyPlan) -> tuple[Database, tuple[str, ...]]:
    """The store where its pages are sound; rows that were changed are forgotten, and named."""
    database = _database(path, plan)
    try:
        wrong = database.damaged()
        if wrong:
            database.forget(wrong)
    except BaseException:
        database.close()
        raise
    return database, ((f"{_runs_text(wrong, plan)} of {path} had been changed and are done again",) if wrong else ())


def _database(path: Path, plan: StudyPlan) -> Database:
    return Database(path, len(plan.points), plan.settings.responses)


def _take(database: Database, plan: StudyPlan) -> None:
    """Have the store say that it belongs to this study. Raises InputError where it belongs to another."""
    new, points = plan.settings.configuration, _points(plan)
    old, drawn, seal = (database.meta(key) for key in (IDENTITY, POINTS, SEAL))
    if not (seal == (_digest(old, drawn) if old or drawn else "") or (database.format < SEALED and not seal)):
        raise _unreadable_fault(database.path, "the identity of its study is damaged")
    if old and old != new:
        try:
            raise_all(differences(old, new))
        except tomllib.TOMLDecodeError as error:
            raise _unreadable_fault(database.path, f"its configuration is damaged ({error})") from None
    if drawn not in ("", points):
        text = "its points are not those of the study to resume: the table, or the version of what "
        raise refuse("design", f"{text}draws them, has changed; {RESTART}")
    if (old, drawn) != (new, points) or not seal:
        database.set_meta({IDENTITY: new, POINTS: points, SEAL: _digest(new, points)})


def _points(plan: StudyPlan) -> str:
    return hashlib.sha256(plan.design.to_csv(index=False).encode()).hexdigest()


def _digest(identity: str, points: str) -> str:
    return hashlib.sha256(f"{identity}\n{points}".encode()).hexdigest()


def differences(before: str, after: str) -> list[Fault]:
    """What makes a configuration (TOML) that of another study than one before."""
    tables = [tomllib.loads(text) for text in (before, after)]
    old, new = map(flat, tables)
    faults = []
    for key, (was, now) in changes(*tables).items():
        if key == HYPOTHESES or (key == GROWS and new[key] > old[key]):
            continue
        hint = "it may only grow" if key == GROWS else "only seeds may grow"
        faults.append(Fault(key, f"is {now}, but the study to resume has {was}: {hint}; undo the change, or {RESTART}"))
    return faults


def _recover_database(path: Path, plan: StudyPlan, error: str) -> tuple[Database, tuple[str, ...]]:
    """A new store with every row of a damaged one that can be read and is as it was written."""
    identity, rows, holes = _salvage_rows(path, plan)
    if not rows:
        raise refuse(str(path), f"is damaged ({error}) and none of its runs can be read: {RESTART}")
    with suppress(OSError, UnicodeDecodeError):  # the configuration in the same directory is the same
        identity = identity or (path.parent / CONFIGURATION).read_text(encoding="utf-8")
    aside = _put_aside(path)
    database = _database(path, plan)
    if identity:
        database.set_meta({IDENTITY: identity, SEAL: _digest(identity, "")})
    database.insert(rows)
    again = f"; {_runs_text(holes, plan)} could not be read and are done again" if holes else ""
    return database, (
        f"{path} was damaged ({error}): {len(rows)} runs in it are whole{again}; the "
        f"damaged file is kept as {aside.name}",
    )


def _salvage_rows(path: Path, plan: StudyPlan) -> tuple[str, list[Row], list[int]]:
    """Configuration, whole rows and unreadable numbers of a damaged store.

    Every number is looked up by itself, so that a damaged page hides its own rows only.
    """
    identity = ""
    rows: list[Row] = []
    holes: list[int] = []
    try:
        database = Database(path, len(plan.points), reading=True)
    except (*DAMAGE, Unusable):
        return identity, rows, list(range(plan.total))
    with database:
        with suppress(*DAMAGE, ValueError):
            known = [database.meta(key) for key in (IDENTITY, POINTS)]
            if database.meta(SEAL) == _digest(*known):
                identity = known[0]
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


def _put_aside(path: Path) -> Path:
    """Rename a damaged store, with its log."""
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
