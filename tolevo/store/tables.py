"""The tables of a store, whatever database it is."""

from __future__ import annotations

from sqlalchemy import REAL, BigInteger, Column, Integer, LargeBinary, MetaData, Table, Text, UniqueConstraint
from sqlalchemy.dialects.postgresql import DOUBLE_PRECISION
from sqlalchemy.types import TypeEngine

from ..commands.study.plan import RESPONSES

FORMAT = 3
"""Version of the tables; a newer one is refused, an older one is brought up to it."""
STUDY, TABLE = "configuration", "about"
"""Keys of `meta` for what a store belongs to: a study, or a computed table."""
METADATA = MetaData()
WHOLE = BigInteger().with_variant(Integer(), "sqlite")
NUMBER: TypeEngine[float] = REAL().with_variant(DOUBLE_PRECISION(), "postgresql")

META = Table("meta", METADATA, Column("key", Text, primary_key=True), Column("value", Text, nullable=False))
RUNS = Table(
    "runs",
    METADATA,
    Column("number", WHOLE, primary_key=True, autoincrement=False),
    Column("point", WHOLE, nullable=False),
    Column("replicate", WHOLE, nullable=False),
    Column("seed", WHOLE, nullable=False),
    Column("status", Text, nullable=False),
    Column("reason", Text, nullable=False),
    Column("evaluations", WHOLE),
    Column("cpu_s", NUMBER),
    *(Column(name, NUMBER) for name in RESPONSES),
    Column("curve", LargeBinary),
    Column("checksum", WHOLE),
    UniqueConstraint("point", "replicate"),
)
CLAIMS = Table(
    "claims",
    METADATA,
    Column("number", WHOLE, primary_key=True, autoincrement=False),
    Column("owner", Text, nullable=False),
    Column("expires", NUMBER, nullable=False),
)
"""What processes are at work on: a run or a block by its number, a reference by a negative number.

`expires` [s] is a time of the database's own clock, since 1970.
"""
YARDSTICKS = Table(
    "yardsticks",
    METADATA,
    Column("problem", WHOLE, primary_key=True, autoincrement=False),
    Column("value", LargeBinary, nullable=False),
)
BLOCKS = Table(
    "blocks",
    METADATA,
    Column("number", WHOLE, primary_key=True, autoincrement=False),
    Column("content", LargeBinary, nullable=False),
    Column("digest", Text, nullable=False),
)
"""Rows of a computed table, as Parquet."""
