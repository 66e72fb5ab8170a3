"""Records that outlive processes, in tables that machines may share."""

from __future__ import annotations

import os
import secrets
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import TypeVar

from sqlalchemy import ColumnElement, Connection, Table, bindparam, delete, func, or_, select, update
from sqlalchemy.exc import DBAPIError

from ..errors import StorageError
from ..execution import Closing
from .backend import DAMAGE, WRITING, Backend
from .migrations import migrate
from .tables import CLAIMS, FORMAT, META, METADATA

LEASE_S = 60.0
"""Seconds for which a claim is valid; a living process renews it."""
RENEWED_S = 15.0
"""Seconds between two renewals."""
PATIENCE_S = 300.0
"""Seconds for which a server that does not answer is tried again."""
PAUSES_S = (0.05, 0.2, 0.5, 1.0)
"""Seconds before each further try; the last of them from then on."""
Result = TypeVar("Result")


class Store(Closing):
    """The open tables in a database; `prefix` begins the name under which this process claims.

    Missing tables are created; those of an older version stay as they are until `migrate`. A store
    that is going to be written waits for a server that restarts; one that is only read (`reading`)
    answers at once or not at all. Raises Newer, Foreign, and errors of SQLAlchemy where they cannot
    be opened.
    """

    def __init__(self, backend: Backend, prefix: str = "", reading: bool = False) -> None:
        self.backend = backend
        self.owner = f"{prefix}{os.getpid()}-{secrets.token_hex(4)}"
        self._held: set[int] = set()
        self._ended = threading.Event()
        self._renewal: threading.Thread | None = None
        try:
            self.format = self._stored_format() if reading else self._repeated(self._stored_format)
            if not self.format and not reading:
                self._repeated(lambda: self._in_transaction(self._make))
        except BaseException:
            backend.close()
            raise

    def _stored_format(self) -> int:
        """The version of the stored tables."""
        with self.backend.engine.connect() as connection:
            return self.backend.version(connection)

    def _make(self, connection: Connection) -> None:
        """Create the tables, where no other process has done so meanwhile."""
        self.backend.lock(connection)
        self.format = self.backend.version(connection)
        if not self.format:
            METADATA.create_all(connection)
            self.backend.mark(connection, FORMAT)
            self.format = FORMAT

    def migrate(self) -> None:
        """Bring the tables up to this version."""

        def step(connection: Connection) -> None:
            self.backend.lock(connection)
            migrate(connection, self.backend.version(connection))
            self.backend.mark(connection, FORMAT)

        if self.format != FORMAT:
            self.write(step)
            self.format = FORMAT

    def close(self) -> None:
        """Release all claims and close the database."""
        self._ended.set()
        if self._renewal is not None:
            self._renewal.join()
        with suppress(*DAMAGE):  # the claims of a process that has ended expire
            if self._held:
                self._in_transaction(lambda connection: connection.execute(delete(CLAIMS).where(self._mine)))
        self.backend.close()

    # transactions

    def read(self, work: Callable[[Connection], Result]) -> Result:
        """The result of `work` in one transaction, which reads one state of the tables."""
        return self._repeated(lambda: self._in_transaction(work, writing=False))

    def write(self, work: Callable[[Connection], Result]) -> Result:
        """Do `work` in one transaction, whole or not at all; it may be done again.

        Raises StorageError where it cannot be written; what is there stays.
        """
        try:
            return self._repeated(lambda: self._in_transaction(work))
        except DBAPIError as error:
            why, remedy = self.backend.explained(error)
            message = f"cannot be written: {why}; {remedy}, then run the same command with --resume"
            raise StorageError(f"{self.backend.display_name} {message}") from error

    def _in_transaction(self, work: Callable[[Connection], Result], writing: bool = True) -> Result:
        engine = self.backend.engine.execution_options(**{WRITING: writing})
        with engine.begin() as connection:
            return work(connection)

    def _repeated(self, work: Callable[[], Result]) -> Result:
        """The result of `work`, repeated as long as the error may pass."""
        begin, attempt = time.monotonic(), 0
        while True:
            try:
                return work()
            except DBAPIError as error:
                late = time.monotonic() > begin + PATIENCE_S
                if late or not self.backend.transient(error):
                    raise
            time.sleep(PAUSES_S[min(attempt, len(PAUSES_S) - 1)])
            attempt += 1

    # what the tables belong to

    def meta(self, key: str) -> str:
        """What the store belongs to, by `key`; empty for a new store."""
        statement = select(META.c.value).where(META.c.key == key)
        return self.read(lambda connection: str(connection.execute(statement).scalar() or ""))

    def set_meta(self, values: Mapping[str, str], key: str = "", before: str = "") -> bool:
        """Write what the store belongs to, where `key` still has the value `before`.

        Returns whether it had: another process may have been quicker.
        """
        row = self.backend.insert(META)
        rows = [{"key": name, "value": value} for name, value in values.items()]
        statement = row.on_conflict_do_update(index_elements=[META.c.key], set_={"value": row.excluded.value})

        def work(connection: Connection) -> bool:
            self.backend.lock(connection)
            current = connection.execute(select(META.c.value).where(META.c.key == key)).scalar()
            if str(current or "") != before:
                return False
            connection.execute(statement, rows)
            return True

        return self.write(work)

    # claims

    @property
    def _mine(self) -> ColumnElement[bool]:
        return CLAIMS.c.owner == self.owner

    def claim(self, numbers: Iterable[int], table: Table) -> list[int]:
        """Claim the numbers that `table` does not have and no process is at work on; returns them.

        A claim that was not renewed in time may be taken over.
        """
        wanted = sorted(set(numbers) - self._held)
        taken = self.write(lambda connection: self._claimed(connection, wanted, table)) if wanted else []
        self._held.update(taken)
        if taken and self._renewal is None:
            self._renewal = threading.Thread(target=self._renew, daemon=True)
            self._renewal.start()
        return taken

    def _claimed(self, connection: Connection, wanted: list[int], table: Table) -> list[int]:
        now, row = self.backend.clock, self.backend.insert(CLAIMS)
        values = {"number": bindparam("number"), "owner": self.owner, "expires": now + LEASE_S}
        statement = row.values(values).on_conflict_do_update(
            index_elements=[CLAIMS.c.number],
            set_={"owner": row.excluded.owner, "expires": row.excluded.expires},
            where=or_(~self._live, self._mine),
        )  # in the order of numbers, so that no two processes wait for each other
        rows = [{"number": number} for number in wanted]
        taken = {n for (n,) in connection.execute(statement.returning(CLAIMS.c.number), rows)}
        # queried after the claim: its previous owner has written by now what has ended
        ended = self.present(connection, table, taken)
        self.finished(connection, ended)
        return sorted(taken - ended)

    @property
    def _live(self) -> ColumnElement[bool]:
        """Whether a claim is valid: not expired, and no longer than a claim can be."""
        return CLAIMS.c.expires.between(self.backend.clock, self.backend.clock + 2.0 * LEASE_S)

    def present(self, connection: Connection, table: Table, numbers: Iterable[int]) -> set[int]:
        """Those of some numbers that a table has."""
        key = next(iter(table.primary_key.columns))
        statement = select(key).where(key.in_(sorted(numbers)))
        return {n for (n,) in connection.execute(statement)}

    def claimed(self, numbers: Iterable[int]) -> set[int]:
        """Those of some numbers that a process is at work on."""
        statement = select(CLAIMS.c.number).where(CLAIMS.c.number.in_(sorted(numbers)), self._live)
        return self.read(lambda connection: {n for (n,) in connection.execute(statement)})

    def finished(self, connection: Connection, numbers: Iterable[int]) -> None:
        """Drop the claims, of any process, on what is written in the same transaction."""
        rows = [{"claimed": number} for number in sorted(numbers)]
        if rows:
            connection.execute(delete(CLAIMS).where(CLAIMS.c.number == bindparam("claimed")), rows)

    def let_go(self, numbers: Iterable[int]) -> None:
        """Forget the claims of this process on some numbers."""
        self._held.difference_update(numbers)

    def drop_claims(self, prefix: str = "") -> None:
        """Drop the claims of owners whose names begin so, none of which is at work any more."""
        owned = CLAIMS.c.owner.startswith(prefix, autoescape=True)
        if self.read(lambda connection: connection.execute(select(func.count()).where(owned)).scalar()):
            self.write(lambda connection: connection.execute(delete(CLAIMS).where(owned)))

    def _renew(self) -> None:
        """Renew the claims of this process until the store is closed."""
        statement = update(CLAIMS).where(self._mine).values(expires=self.backend.clock + LEASE_S)
        while not self._ended.wait(RENEWED_S):
            if self._held:
                with suppress(*DAMAGE):  # it is tried again, and what has expired may be taken
                    self._in_transaction(lambda connection: connection.execute(statement))
