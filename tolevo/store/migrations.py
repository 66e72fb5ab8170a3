"""Brings the tables of an older version up to this one."""

from __future__ import annotations

from sqlalchemy import Column, Connection, Integer, LargeBinary, MetaData, Table, Text, cast
from sqlalchemy.schema import CreateTable, DropTable

from .tables import BLOCKS, CLAIMS, FORMAT, META, METADATA, RUNS, YARDSTICKS

OLD = MetaData()
_OLD_CLAIMS = Table("claims", OLD, Column("number", Integer, primary_key=True), Column("owner", Text))
_OLD_YARDSTICKS = Table("yardsticks", OLD, Column("problem", Integer, primary_key=True), Column("value", Text))
NAMES = dict.fromkeys((1, 2), (META, RUNS, _OLD_CLAIMS, _OLD_YARDSTICKS)) | {FORMAT: tuple(METADATA.sorted_tables)}
"""Tables by version. Versions 1 and 2 were SQLite files of studies."""


def migrate(connection: Connection, version: int) -> None:
    """Bring the tables of `version` up to `FORMAT`, in the transaction of the connection.

    2 added a digest of what the store belongs to, which is written with that. With 3 claims expire,
    references are bytes, and tables may be computed by blocks; claims of the versions before belong
    to processes that are gone.
    """
    if version == FORMAT:
        return
    connection.execute(DropTable(_OLD_CLAIMS))
    connection.execute(CreateTable(CLAIMS))
    old = _OLD_YARDSTICKS
    rows = connection.execute(old.select().with_only_columns(old.c.problem, cast(old.c.value, LargeBinary))).all()
    connection.execute(DropTable(old))
    connection.execute(CreateTable(YARDSTICKS))
    if rows:
        connection.execute(YARDSTICKS.insert(), [{"problem": problem, "value": value} for problem, value in rows])
    connection.execute(CreateTable(BLOCKS))
