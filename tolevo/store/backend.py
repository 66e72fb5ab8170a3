"""What differs between the databases that a store may lie in."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from sqlalchemy import ColumnElement, Connection, Engine, Table
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import DBAPIError, SQLAlchemyError

WRITING = "tolevo_writing"
"""Execution option of connections that are going to write."""
DAMAGE = (SQLAlchemyError, UnicodeDecodeError)
"""What a damaged database may raise: of a broken name SQLite's own message cannot be decoded."""


class Newer(Exception):
    """The tables are those of a newer version, whose number is the argument."""


class Foreign(Exception):
    """There are tables of another program."""


class Backend(ABC):
    """A database: how it is reached, marked and checked, and what its errors mean."""

    display_name: str
    """The database as messages name it; no password is in it."""
    engine: Engine
    clock: ClassVar[ColumnElement[float]]
    """Seconds since 1970 by the clock of the database."""
    restart: ClassVar[str]
    """How to start again there."""
    alternative: ClassVar[str]
    """What to name instead of a database that is in use for something else."""

    @abstractmethod
    def version(self, connection: Connection) -> int:
        """Version of the tables, 0 where there is none. Raises Newer, Foreign."""

    @abstractmethod
    def mark(self, connection: Connection, version: int) -> None:
        """Write the version of the tables."""

    @abstractmethod
    def insert(self, table: Table) -> sqlite.Insert | postgresql.Insert:
        """An insertion that may say what happens to rows that are there already."""

    @abstractmethod
    def lock(self, connection: Connection) -> None:
        """Prevent other processes from changing tables before this transaction has ended."""

    @abstractmethod
    def hindrance(self, error: BaseException) -> tuple[str, str] | None:
        """Why a sound database cannot be opened or written, and the remedy; None for damage."""

    def explained(self, error: BaseException) -> tuple[str, str]:
        """Why the database cannot be used, and the remedy."""
        return self.hindrance(error) or (reason(error), "mend that")

    def transient(self, error: DBAPIError) -> bool:
        """Whether the same transaction may succeed in a moment."""
        return False

    def check(self, connection: Connection, version: int) -> None:  # noqa: B027
        """Raises DatabaseError where the tables or their pages are damaged."""

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()


def reason(error: BaseException) -> str:
    """The message of a database, without the statement."""
    cause: Any = getattr(error, "orig", None) or error
    return str(cause).strip().partition("\n")[0]
