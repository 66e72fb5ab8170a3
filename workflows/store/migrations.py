"""Brings the tables of an older version up to this one, a step for each version."""

from __future__ import annotations

from collections.abc import Callable

from sqlalchemy import Column, Connection, Integer, LargeBinary, MetaData, Table, Text, cast
from sqlalchemy.schema import CreateTable, DropTable

from .tables import BLOCKS, CLAIMS, FORMAT, META, METADATA, RUNS, YARDSTICKS

OLD = MetaData()
_OLD_CLAIMS = Table("claims", OLD, Column("number", Integer, primary_key=True), Column("owner", Text))
_OLD_YARDSTICKS = Table("yardsticks", OLD, Column("problem", Integer, primary_key=True), Column("value", Text))
NAMES = {
    1: (META, RUNS, _OLD_CLAIMS, _OLD_YARDSTICKS),
    2: (META, RUNS, _OLD_CLAIMS, _OLD_YARDSTICKS),
    FORMAT: tuple(METADATA.sorted_tables),
}
"""Tables by version. Versions 1 and 2 were SQLite files of studies."""


def migrate(connection: Connection, version: int) -> None:
    """Take every step from `version` on, in the transaction of the connection."""
    for number in range(version, FORMAT):
        STEPS[number](connection)


def _sealed(connection: Connection) -> None:
    """From 1 to 2: a digest of what the store belongs to, which is written with that."""


def _leased(connection: Connection) -> None:
    """From 2 to 3: claims expire, references are bytes, tables may be computed by blocks.

    Claims of the version before belong to processes that are gone.
    """
    connection.execute(DropTable(_OLD_CLAIMS))
    connection.execute(CreateTable(CLAIMS))
    old = _OLD_YARDSTICKS
    rows = connection.execute(old.select().with_only_columns(old.c.problem, cast(old.c.value, LargeBinary))).all()
    connection.execute(DropTable(old))
    connection.execute(CreateTable(YARDSTICKS))
    if rows:
        values = [{"problem": problem, "value": value} for problem, value in rows]
        connection.execute(YARDSTICKS.insert(), values)
    connection.execute(CreateTable(BLOCKS))


STEPS: dict[int, Callable[[Connection], None]] = {1: _sealed, 2: _leased}
"""By the version that they begin from."""
