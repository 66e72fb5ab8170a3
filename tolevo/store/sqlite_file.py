"""A store in an SQLite file: processes of one machine, nothing to be set up."""

from __future__ import annotations

import errno
import os
import sqlite3
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Table, create_engine, event, literal_column
from sqlalchemy.dialects import sqlite
from sqlalchemy.exc import DatabaseError
from sqlalchemy.pool import QueuePool
from sqlalchemy.types import Double

from ..files import REASONS
from .backend import WRITING, Backend, Foreign, Newer
from .migrations import NAMES
from .tables import FORMAT

APPLICATION = 0x746C7374
"""SQLite's mark of the program that owns a file."""
BUSY_S = 60.0
"""Seconds to wait for another process's transaction."""
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


class SqliteFile(Backend):
    """The file at `path`, with a write-ahead log; created where it is missing and is written."""

    clock = literal_column("((julianday('now') - 2440587.5) * 86400.0)", Double())
    restart = "start again with --overwrite"
    alternative = "name another directory"

    def __init__(self, path: Path, reading: bool = False) -> None:
        self.path = path
        self.display_name = str(path)
        self._reading = reading
        self.engine = create_engine("sqlite://", creator=self._connect, poolclass=QueuePool)
        event.listen(self.engine, "begin", _begin)

    def _connect(self) -> sqlite3.Connection:
        if self._reading:
            connection = sqlite3.connect(
                f"file:{self.path}?mode=ro", uri=True, isolation_level=None, check_same_thread=False
            )
            connection.execute("PRAGMA writable_schema = ON")  # a file cut short is read all the same
            return connection
        # SQLite would not keep to the umask
        os.close(os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666))
        connection = sqlite3.connect(self.path, timeout=BUSY_S, isolation_level=None, check_same_thread=False)
        try:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = NORMAL")
        except BaseException:
            connection.close()
            raise
        return connection

    def version(self, connection: Connection) -> int:
        application = _query_integer(connection, "PRAGMA application_id")
        version = _query_integer(connection, "PRAGMA user_version")
        if application == APPLICATION and version > FORMAT:
            raise Newer(version)
        tables = _query_integer(connection, "SELECT COUNT(*) FROM sqlite_schema")
        if tables and application != APPLICATION:
            raise Foreign
        return version if tables else 0

    def mark(self, connection: Connection, version: int) -> None:
        connection.exec_driver_sql(f"PRAGMA application_id = {APPLICATION}")
        connection.exec_driver_sql(f"PRAGMA user_version = {version}")

    def insert(self, table: Table) -> sqlite.Insert:
        return sqlite.insert(table)

    def lock(self, connection: Connection) -> None:
        """Nothing: one process at a time writes into a file."""

    def check(self, connection: Connection, version: int) -> None:
        if connection.exec_driver_sql("PRAGMA integrity_check(1)").fetchone() != ("ok",):
            raise _damaged("pages are damaged")
        if _columns(connection) != _expected(version):
            raise _damaged("its tables are not those of a study")

    def hindrance(self, error: BaseException) -> tuple[str, str] | None:
        cause = getattr(error, "orig", None) or error
        code = getattr(cause, "sqlite_errorcode", 0)
        return None if code == sqlite3.SQLITE_IOERR_SHORT_READ else HINDRANCES.get(code & 0xFF)


def _begin(connection: Connection) -> None:
    writing = connection.get_execution_options().get(WRITING)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")


def _query_integer(connection: Connection, text: str) -> int:
    return int(connection.exec_driver_sql(text).scalar_one())


def _damaged(text: str) -> DatabaseError:
    return DatabaseError(None, None, sqlite3.DatabaseError(text))


def _columns(connection: Connection) -> set[tuple[Any, ...]]:
    """Tables with their columns: name, type, place in the primary key."""
    names = connection.exec_driver_sql("SELECT type, name FROM sqlite_schema").fetchall()
    columns: set[tuple[Any, ...]] = set()
    for kind, name in names:
        if kind != "table":
            columns |= set() if str(name).startswith("sqlite_autoindex_") else {(kind, name)}
            continue
        quoted = str(name).replace('"', '""')
        for row in connection.exec_driver_sql(f'PRAGMA table_info("{quoted}")').fetchall():
            columns.add((name, row[1], row[2], bool(row[5])))
    return columns


def _expected(version: int) -> set[tuple[Any, ...]]:
    """The same for sound tables of a version."""
    dialect = sqlite.dialect()
    return {
        (table.name, column.name, column.type.compile(dialect), column.primary_key)
        for table in NAMES[version]
        for column in table.columns
    }
