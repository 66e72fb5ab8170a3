"""A store in PostgreSQL: processes of any number of machines."""

from __future__ import annotations

import zlib
from typing import Any

import psycopg
from sqlalchemy import Connection, Table, create_engine, inspect, literal_column, select, text
from sqlalchemy.dialects import postgresql
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.types import Double

from .address import Address
from .backend import Backend, Foreign, Newer
from .tables import FORMAT, META, METADATA

PATIENCE = 8
"""Seconds that a server has to answer."""
LOCKED_MS = 5000
"""Milliseconds that a statement waits for a lock; the transaction is then done again."""
IDLE_MS = 60_000
"""Milliseconds after which the server ends a transaction whose machine is silent."""
OPTIONS = f"-c lock_timeout={LOCKED_MS} -c idle_in_transaction_session_timeout={IDLE_MS}"
AGAIN = ("40001", "40P01", "55P03", "57P01", "57P02", "57P03")
"""SQLSTATE of transactions that may be done again: conflicts, locks, a server that restarts."""
VERSION = "format"
"""Key of the version of the tables in the table `meta`."""


class PostgreSQL(Backend):
    """The schema of an address; it is created where it is missing."""

    clock = literal_column("CAST(EXTRACT(EPOCH FROM clock_timestamp()) AS double precision)", Double())
    restart = alternative = "name another schema of that database (?schema=NAME)"

    def __init__(self, address: Address) -> None:
        self.display_name = address.shown
        self._address = address
        self.engine = create_engine("postgresql+psycopg://", creator=self._connect)

    def _connect(self) -> psycopg.Connection[tuple[Any, ...]]:
        return psycopg.connect(
            self._address.url,
            connect_timeout=PATIENCE,
            options=f"{OPTIONS} -c search_path={self._address.schema}",
            application_name="tolevo",
            keepalives_idle=10,  # a connection to a machine that is gone is given up in 30 s
            keepalives_interval=5,
            keepalives_count=4,
        )

    def version(self, connection: Connection) -> int:
        look, schema = inspect(connection), self._address.schema
        if not look.get_table_names(schema):
            return 0
        columns = look.get_columns(META.name, schema) if look.has_table(META.name, schema) else []
        if {column["name"] for column in columns} != {column.name for column in META.columns}:
            raise Foreign
        stored = connection.execute(select(META.c.value).where(META.c.key == VERSION)).scalar()
        if stored is None or not str(stored).isdecimal():
            raise Foreign
        if int(stored) > FORMAT:
            raise Newer(int(stored))
        return int(stored)

    def mark(self, connection: Connection, version: int) -> None:
        row = self.insert(META).values(key=VERSION, value=str(version))
        connection.execute(row.on_conflict_do_update(index_elements=[META.c.key], set_={"value": row.excluded.value}))

    def insert(self, table: Table) -> postgresql.Insert:
        return postgresql.insert(table)

    def lock(self, connection: Connection) -> None:
        key = zlib.crc32(f"tolevo {self._address.schema}".encode())
        connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": key})
        connection.execute(text(f'CREATE SCHEMA IF NOT EXISTS "{self._address.schema}"'))

    def check(self, connection: Connection, version: int) -> None:
        existing = set(inspect(connection).get_table_names(self._address.schema))
        if missing := set(METADATA.tables) - existing:
            error = psycopg.DatabaseError(f"tables are missing: {', '.join(sorted(missing))}")
            raise DBAPIError(None, None, error)

    def transient(self, error: DBAPIError) -> bool:
        code = getattr(error.orig, "sqlstate", None)
        return error.connection_invalidated or code in AGAIN or (code is None and isinstance(error, OperationalError))

    def hindrance(self, error: BaseException) -> tuple[str, str] | None:
        cause = getattr(error, "orig", None) or error
        if isinstance(cause, psycopg.errors.InsufficientPrivilege):
            return "the user may not do that", "ask for the right to create and write there"
        if isinstance(cause, psycopg.errors.DiskFull):
            return "the disk of the server is full", "make room there"
        if isinstance(cause, psycopg.OperationalError):
            message = " ".join(str(cause).split()) or "no answer"
            return (f"it cannot be reached ({message})", "start the server, or mend address or password")
        return None
