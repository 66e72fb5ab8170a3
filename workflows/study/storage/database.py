"""Runs, claims and yardsticks of one study in SQLite."""

from __future__ import annotations

import errno
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from ....algorithms.course import Box
from ....errors import RunError
from ....files import REASONS
from ....sealed import loads, sealed_record, unsealed_record
from ..records import RESPONSES
from ..trial import RunRecord
from ..yardstick import Yardstick
from .owners import Owner, alive
from .rows import COLUMNS, Row, record_of, row_of, whole

DATABASE = "study.sqlite"
APPLICATION = 0x746C7374
"""SQLite's mark of whose file it is."""
FORMAT = 2
"""Version of the tables; a newer one is refused."""
BUSY_S = 60.0
"""Seconds to wait for another process's transaction."""
SCHEMA = f"""
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE runs (
  number INTEGER PRIMARY KEY, point INTEGER NOT NULL, replicate INTEGER NOT NULL,
  seed INTEGER NOT NULL, status TEXT NOT NULL, reason TEXT NOT NULL, evaluations INTEGER,
  cpu_s REAL, {", ".join(f"{name} REAL" for name in RESPONSES)}, curve BLOB, checksum INTEGER,
  UNIQUE (point, replicate));
CREATE TABLE claims (number INTEGER PRIMARY KEY, owner TEXT NOT NULL);
CREATE TABLE yardsticks (problem INTEGER PRIMARY KEY, value TEXT NOT NULL);
PRAGMA application_id = {APPLICATION};
PRAGMA user_version = {FORMAT};
"""
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
"""Errors that say nothing of what a database holds: why, and what helps."""
NAMES = ", ".join(("number", *COLUMNS, "checksum"))
PLACES = ", ".join("?" * (len(COLUMNS) + 2))


class Database:
    """The open database of a study of `points` points, in the file `path`.

    A run's number is replicate * points + point, so that more replicates change no number. A run
    is claimed before it is begun, so that no other process begins it; the claim ends with the
    process. Raises RunError where the file cannot be written; what is in it stays.
    """

    def __init__(self, path: Path, points: int, responses: tuple[str, ...]) -> None:
        self.path = path
        self.points = points
        self.responses = responses
        self._owner = Owner(path.parent)
        try:
            self._connection = connect(path)
            self.format = int(self._connection.execute("PRAGMA user_version").fetchone()[0])
        except BaseException:
            self._owner.close()
            raise

    def close(self) -> None:
        """Let go of all claims and of the file."""
        try:
            with self._writing() as cursor:
                cursor.execute("DELETE FROM claims WHERE owner = ?", (self._owner.name,))
        except RunError:  # a claim of a process that is gone counts for nothing
            pass
        finally:
            self._connection.close()
            self._owner.close()

    def __enter__(self) -> Database:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def meta(self, key: str) -> str:
        """What the database says of the study it belongs to, empty for a new one."""
        found = self._connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return str(found[0]) if found else ""

    def set_meta(self, values: Mapping[str, str]) -> None:
        """Say what study the database belongs to."""
        with self._writing() as cursor:
            cursor.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", values.items())
            if self.format != FORMAT:
                cursor.execute(f"PRAGMA user_version = {FORMAT}")
        self.format = FORMAT

    # what has been done

    def count(self, total: int) -> tuple[int, int]:
        """Runs done and failed of the first `total` numbers."""
        text = "SELECT COUNT(*), SUM(status = 'failed') FROM runs WHERE number < ?"
        ended, failed = self._connection.execute(text, (total,)).fetchone()
        return ended - (failed or 0), failed or 0

    def missing(self, total: int) -> list[int]:
        """Numbers of the runs that have not ended, by point and replicate."""
        ended = {n for (n,) in self._connection.execute("SELECT number FROM runs")}
        left = (number for number in range(total) if number not in ended)
        return sorted(left, key=lambda number: (number % self.points, number // self.points))

    def damaged(self) -> list[int]:
        """Numbers of the rows whose checksum is wrong. Raises DatabaseError where it is damaged."""
        if self._connection.execute("PRAGMA integrity_check(1)").fetchone() != ("ok",):
            raise sqlite3.DatabaseError("pages are damaged")
        if _tables(self._connection) != _own_tables():
            raise sqlite3.DatabaseError("its tables are not those of a study")
        rows = self._connection.execute(f"SELECT {NAMES} FROM runs")
        return [row[0] for row in rows if not whole(row)]

    def runs(self, total: int) -> Iterator[RunRecord]:
        """The runs that have ended, by point and replicate."""
        text = f"SELECT {NAMES} FROM runs WHERE number < ? ORDER BY +point, +replicate"
        yield from map(record_of, self._connection.execute(text, (total,)))

    # what is to be done

    def drop_claims(self) -> None:
        """Drop all claims, where nobody else is at work."""
        if self._connection.execute("SELECT COUNT(*) FROM claims").fetchone()[0]:
            with self._writing() as cursor:
                cursor.execute("DELETE FROM claims")

    def claim(self, numbers: Iterable[int]) -> list[int]:
        """Those of the runs that nobody has done and no living process has begun: now ours."""
        with self._writing() as cursor:
            self._drop_dead(cursor)
            taken = []
            for number in numbers:
                ended = cursor.execute("SELECT 1 FROM runs WHERE number = ?", (number,)).fetchone()
                if ended is None:
                    text = "INSERT OR IGNORE INTO claims VALUES (?, ?)"
                    cursor.execute(text, (number, self._owner.name))
                    taken += [number] * cursor.rowcount
            return taken

    def record(self, runs: Iterable[RunRecord]) -> int:
        """Write the runs that have ended; one that is there already stays as it is.

        Returns how many are new.
        """
        rows = [row_of(self._number(run), run, self.responses) for run in runs]
        with self._writing() as cursor:
            before = self._connection.total_changes
            cursor.executemany(f"INSERT OR IGNORE INTO runs ({NAMES}) VALUES ({PLACES})", rows)
            added = self._connection.total_changes - before
            cursor.executemany("DELETE FROM claims WHERE number = ?", [(row[0],) for row in rows])
        return added

    def insert(self, rows: Iterable[Row]) -> None:
        """Take in rows of another database."""
        with self._writing() as cursor:
            cursor.executemany(f"INSERT OR IGNORE INTO runs ({NAMES}) VALUES ({PLACES})", rows)

    def forget(self, numbers: Iterable[int]) -> None:
        """Drop rows, so that the runs are done again."""
        with self._writing() as cursor:
            cursor.executemany("DELETE FROM runs WHERE number = ?", [(n,) for n in numbers])

    # yardsticks

    def yardsticks(self) -> dict[int, Yardstick]:
        """What has been found of the problems, by their number in the plan.

        What is not as it was written is left out, and found again.
        """
        text = "SELECT problem, CAST(value AS BLOB) FROM yardsticks"
        rows = self._connection.execute(text).fetchall()
        found = {number: _yardstick(text, number) for number, text in rows}
        return {number: one for number, one in found.items() if one is not None}

    def keep_yardstick(self, problem: int, found: Yardstick) -> None:
        """Keep what has been found of a problem."""
        record = {"ideal": found.box.ideal, "nadir": found.box.nadir, "value": found.value,
                  "bound": found.bound}  # fmt: skip
        text = json.dumps(sealed_record(record, of=str(problem)))
        with self._writing() as cursor:
            cursor.execute("INSERT OR REPLACE INTO yardsticks VALUES (?, ?)", (problem, text))

    def _number(self, run: RunRecord) -> int:
        return run.replicate * self.points + run.point

    def _drop_dead(self, cursor: sqlite3.Cursor) -> None:
        """Drop the claims of processes that are gone."""
        for (name,) in cursor.execute("SELECT DISTINCT owner FROM claims").fetchall():
            if name != self._owner.name and not alive(self.path.parent, name):
                cursor.execute("DELETE FROM claims WHERE owner = ?", (name,))

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Cursor]:
        """One transaction, whole or not at all."""
        cursor = self._connection.cursor()
        try:
            cursor.execute("BEGIN IMMEDIATE")
            yield cursor
            cursor.execute("COMMIT")
        except sqlite3.Error as error:
            reason, remedy = hindrance(error) or (str(error), "mend that")
            text = f"{self.path} cannot be written: {reason}; {remedy}, then run the same command "
            raise RunError(f"{text}with --resume") from error
        finally:
            if self._connection.in_transaction:
                self._connection.rollback()


def connect(path: Path) -> sqlite3.Connection:
    """A connection with the write-ahead log on; the tables are made where the file is new.

    Raises sqlite3.DatabaseError where the file is none of ours, or damaged.
    """
    os.close(os.open(path, os.O_RDWR | os.O_CREAT, 0o666))  # SQLite would not keep to the umask
    connection = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
    try:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")
        connection.execute("BEGIN IMMEDIATE")
        if not connection.execute("SELECT COUNT(*) FROM sqlite_schema").fetchone()[0]:
            for statement in SCHEMA.split(";"):
                connection.execute(statement)
        connection.execute("COMMIT")
    except sqlite3.Error:
        connection.close()
        raise
    return connection


def _yardstick(text: bytes, problem: int) -> Yardstick | None:
    try:
        found = unsealed_record(loads(text), of=str(problem))
    except (TypeError, ValueError):
        return None
    box = Box(tuple(found["ideal"]), tuple(found["nadir"]))
    return Yardstick(box, found["value"], found["bound"])


def _own_tables() -> set[tuple[str, ...]]:
    """The tables of a new database."""
    connection = sqlite3.connect(":memory:")
    try:
        connection.executescript(SCHEMA)
        return _tables(connection)
    finally:
        connection.close()


def _tables(connection: sqlite3.Connection) -> set[tuple[str, ...]]:
    """What a database says of its tables, whatever the white space."""
    rows = connection.execute("SELECT type, name, tbl_name, sql FROM sqlite_schema")
    return {tuple(" ".join(str(value).split()) for value in row) for row in rows}


def hindrance(error: Exception) -> tuple[str, str] | None:
    """Why a sound database cannot be opened or written, and what helps; None for a damaged one."""
    code = getattr(error, "sqlite_errorcode", 0)
    return None if code == sqlite3.SQLITE_IOERR_SHORT_READ else HINDRANCES.get(code & 0xFF)
