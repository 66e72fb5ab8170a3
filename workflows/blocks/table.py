"""Blocks in a store that machines share."""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import asdict
from typing import Any

from sqlalchemy import Connection, delete, select

from ...errors import Fault, RunError, raise_all, refuse
from ...sealed import loads, sealed_record, unsealed_record
from ..store.address import read_address
from ..store.backend import DAMAGE, Backend, reason
from ..store.postgresql import PostgreSQL
from ..store.store import Store
from ..store.tables import BLOCKS, STUDY, TABLE
from .store import About, BlockStore


class BlockTable(BlockStore):
    """The blocks of a table, of which each machine computes those that no other has begun.

    Whole blocks that are there already are kept, damaged ones are computed again. Raises
    InputError, which names `place`, where the store holds anything else.
    """

    def __init__(self, backend: Backend, about: About, place: str = "--store") -> None:
        self._store = Store(backend)
        self.completed = set()
        try:
            self._store.migrate()
            self.about = self._agreed(about, place)
            self.refresh()
            if damaged := [number for number in self.completed if not self._is_intact(number)]:
                dropped = delete(BLOCKS).where(BLOCKS.c.number.in_(damaged))
                self._store.write(lambda connection: connection.execute(dropped))
                self.completed.difference_update(damaged)
        except BaseException:
            self._store.close()
            raise

    @property
    def _database_name(self) -> str:
        return self._store.backend.display_name

    def claim(self, number: int) -> bool:
        return self._store.claim([number], BLOCKS) == [number]

    def keep(self, number: int, content: bytes) -> None:
        digest = hashlib.sha256(content).hexdigest()
        row = self._store.backend.insert(BLOCKS).on_conflict_do_nothing()

        def work(connection: Connection) -> None:
            connection.execute(row.values(number=number, content=content, digest=digest))
            self._store.finished(connection, [number])

        self._store.write(work)
        self._store.let_go([number])
        self.completed.add(number)

    def refresh(self) -> None:
        statement = select(BLOCKS.c.number).where(BLOCKS.c.number < self.about.total)
        self.completed = {number for (number,) in self._read(lambda connection: connection.execute(statement).all())}

    def block(self, number: int) -> io.BytesIO:
        statement = select(BLOCKS.c.content).where(BLOCKS.c.number == number)
        return io.BytesIO(bytes(self._read(lambda connection: connection.execute(statement).scalar_one())))

    def saved(self) -> str:
        return f"{self._count(self._database_name)}; run the same command again to continue"

    def close(self) -> None:
        self._store.close()

    def _read(self, work: Any) -> Any:
        try:
            return self._store.read(work)
        except DAMAGE as error:
            raise RunError(f"{self._database_name} cannot be read: {reason(error)}") from error

    def _is_intact(self, number: int) -> bool:
        statement = select(BLOCKS.c.digest).where(BLOCKS.c.number == number)
        digest = self._read(lambda connection: connection.execute(statement).scalar_one())
        return bool(hashlib.sha256(self.block(number).getvalue()).hexdigest() == digest)

    def _agreed(self, about: About, place: str) -> About:
        """The identity of the blocks: those that are there decide how many rows a block has."""
        identity = json.dumps(sealed_record(asdict(about)))
        while not self._store.meta(TABLE):
            if self._store.meta(STUDY):
                raise refuse(place, f"{self._database_name} holds a study; {self._store.backend.alternative}")
            self._store.set_meta({TABLE: identity}, TABLE, "")
        try:
            stored = unsealed_record(loads(self._store.meta(TABLE)))
        except ValueError as error:
            raise refuse(place, f"{self._database_name} cannot be read: {error}") from error
        raise_all(
            Fault(place, f"{self._database_name} belongs to {other}; {self._store.backend.alternative}")
            for other in about.differences(stored)
        )
        return about.with_blocks_of(stored)


def block_table(address: str, about: About, place: str) -> BlockTable:
    """The blocks at the address of a store."""
    backend = PostgreSQL(read_address(address))
    try:
        return BlockTable(backend, about, place)
    except DAMAGE as error:
        cause, remedy = backend.explained(error)
        raise refuse(place, f"{backend.display_name}: {cause}; {remedy}") from error
