"""Where the runs of a study are stored: in a file of its directory, or in a shared store."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ....errors import Fault, InputError, refuse
from ....sealed import read_record, write_record
from ...store.address import read_address
from .names import DATABASE, PLACE

if TYPE_CHECKING:
    from ...store.backend import Backend
    from ..plan import StudyPlan

STORE, TOKEN = "store", "directory"
ANOTHER = "name another directory, or give --overwrite"


@dataclass(frozen=True, slots=True)
class Site:
    """The directory of a study and, where its runs are in a shared store, the address of that."""

    folder: Path
    address: str = ""

    @property
    def location(self) -> str:
        """Where the runs are, as messages state it."""
        return read_address(self.address).shown if self.address else str(self.folder)

    def begin(self) -> None:
        """Write to the directory where the runs are, and a token that marks its claims.

        It tells a resumed study which claims belong to processes that are gone.
        """
        if self.address:
            write_record(self.folder / PLACE, {STORE: self.location, TOKEN: secrets.token_hex(8)})

    def check(self) -> None:
        """Raises InputError where the directory does not hold a study that is kept there."""
        placed, file = _placed(self.folder), (self.folder / DATABASE).is_file()
        if placed is None and not file:
            text = f"{self.folder} holds no {DATABASE} of a study; name another directory, or --overwrite"
            raise refuse("--resume", text)
        if placed is None and self.address:
            text = f"the runs of {self.folder} are in its {DATABASE}: leave out --store, or"
            raise refuse("--store", f"{text} {ANOTHER}")
        if placed is not None and placed[STORE] != (self.location if self.address else ""):
            text = f"the runs of {self.folder} are in {placed[STORE]}: name that, or"
            raise refuse("--store", f"{text} {ANOTHER}")

    def backend(self, reading: bool = False) -> Backend:
        """The database."""
        if self.address:
            from ...store.postgresql import PostgreSQL

            return PostgreSQL(read_address(self.address))
        from ...store.sqlite_file import SqliteFile

        return SqliteFile(self.folder / DATABASE, reading)

    @property
    def prefix(self) -> str:
        """Beginning of the names under which processes of this directory claim runs."""
        placed = _placed(self.folder)
        return f"{placed[TOKEN]}-" if placed is not None else ""


def site_of(folder: Path) -> Site:
    """Where the runs of a study that was begun in a directory are."""
    try:
        placed = _placed(folder)
    except InputError:
        placed = None
    return Site(folder, "" if placed is None else placed[STORE])


def other_study(plan: StudyPlan, address: str, place: str) -> list[Fault]:
    """A fault for each key in which the study of a store is another one; nothing is written."""
    from ...store.backend import DAMAGE, reason
    from .database import Database
    from .opening import identity_faults

    backend = Site(Path(), address).backend()
    try:
        with Database(backend, len(plan.points), (), reading=True) as database:
            faults = identity_faults(database, plan) if database.format else []
    except DAMAGE as error:
        return [Fault(place, f"{backend.display_name} cannot be read: {reason(error)}")]
    except InputError as error:
        return [Fault(place, str(fault)) for fault in error.faults]
    head = f"{backend.display_name} belongs to another configuration"
    return [Fault(place, f"{head}: {fault.place} {fault.message}") for fault in faults]


def _placed(folder: Path) -> dict[str, str] | None:
    """The record in a directory of where its runs are."""
    try:
        record = read_record(folder / PLACE)
    except ValueError as error:
        text = f"cannot be read: {error}; start again with --overwrite"
        raise refuse(f"{folder}/{PLACE}", text) from error
    return None if record is None else {key: str(record[key]) for key in (STORE, TOKEN)}
