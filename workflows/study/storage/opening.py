"""Opens the database of a study: a new one, that of a broken study, or what is whole of it."""

from __future__ import annotations

import hashlib
import sqlite3
import tomllib
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any

from ....errors import Fault, raise_all, refuse
from ....section import flat
from ..plan import StudyPlan
from .database import APPLICATION, DATABASE, FORMAT, NAMES, Database
from .rows import Row, whole

CONFIGURATION = "config.toml"
IDENTITY, POINTS = "configuration", "points"
"""What a database says of its study: the resolved configuration, and a hash of the design."""
GROWS = "seeds"
"""The one key of the runs that may differ between a study and what goes on with it, upwards."""
SAID = "reading"
"""What is only tested on the runs."""
SHOWN = 12
"""Lost runs that are named one by one."""


def opened(plan: StudyPlan, folder: Path) -> tuple[Database, tuple[str, ...]]:
    """The database of a study in `folder`, and what the user should know of it.

    Raises InputError where it belongs to another study, was written by a newer version, or where
    nothing of it can be read.
    """
    path = folder / DATABASE
    folder.mkdir(parents=True, exist_ok=True)
    notes: tuple[str, ...] = ()
    if path.exists() and path.stat().st_size:
        _check_format(path)
    try:
        database = _database(path, plan)
    except sqlite3.DatabaseError as error:
        database, notes = _recovered(path, plan, str(error))
    else:
        try:
            wrong = database.damaged()
        except sqlite3.DatabaseError as error:
            database.close()
            database, notes = _recovered(path, plan, str(error))
        else:
            if wrong:
                database.forget(wrong)
                notes = (f"{_named(wrong, plan)} of {path} had been changed and are done again",)
    try:
        _check_identity(database, plan)
    except BaseException:
        database.close()
        raise
    return database, notes


def _database(path: Path, plan: StudyPlan) -> Database:
    return Database(path, len(plan.points), plan.settings.responses)


def _check_format(path: Path) -> None:
    """Raises InputError for a database that is none of a study, or a newer one."""
    try:
        connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
        try:
            application = connection.execute("PRAGMA application_id").fetchone()[0]
            version = connection.execute("PRAGMA user_version").fetchone()[0]
            tables = connection.execute("SELECT COUNT(*) FROM sqlite_schema").fetchone()[0]
        finally:
            connection.close()
    except sqlite3.DatabaseError:  # damaged: what is whole of it is looked for
        return
    if application == APPLICATION and version > FORMAT:
        text = f"was written by a newer version of tolevo (format {version}, this one reads up to "
        raise refuse(str(path), f"{text}{FORMAT}): update tolevo, or name another directory")
    if tables and application != APPLICATION:
        raise refuse(str(path), "is no database of a study; name another directory")


def _check_identity(database: Database, plan: StudyPlan) -> None:
    """Takes the database for this study; raises InputError where it belongs to another."""
    new, old = plan.settings.configuration, database.meta(IDENTITY)
    if old and old != new:
        raise_all(_differences(flat(tomllib.loads(old)), flat(tomllib.loads(new))))
    points = hashlib.sha256(plan.design.to_csv(index=False).encode()).hexdigest()
    if database.meta(POINTS) not in ("", points):
        text = "its points are not those of the study to resume: the table, or the version of what "
        raise refuse("design", f"{text}draws them, has changed; start again with --overwrite")
    database.set_meta({IDENTITY: new, POINTS: points})


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Fault]:
    found = []
    for key in dict.fromkeys([*new, *old]):
        was, now = old.get(key, "unset"), new.get(key, "unset")
        if was == now or key == SAID or (key == GROWS and now > was):
            continue
        hint = "it may only grow" if key == GROWS else "only seeds may grow"
        text = f"is {now}, but the study to resume has {was}: {hint}; undo the change, or start "
        found.append(Fault(key, f"{text}again with --overwrite"))
    return found


def _recovered(path: Path, plan: StudyPlan, error: str) -> tuple[Database, tuple[str, ...]]:
    """A new database with every row of a damaged one that can be read and is as it was written."""
    identity, rows, holes = _salvaged(path, plan)
    if not rows:
        raise refuse(str(path), f"is damaged ({error}) and none of its runs can be read: start "
                     "again with --overwrite")  # fmt: skip
    identity = identity or _configuration_beside(path)
    aside = _put_aside(path)
    database = _database(path, plan)
    if identity:
        database.set_meta({IDENTITY: identity})
    database.insert(rows)
    again = f"; {_named(holes, plan)} could not be read and are done again" if holes else ""
    return database, (f"{path} was damaged ({error}): {len(rows)} runs in it are whole{again}; the "
                      f"damaged file is kept as {aside.name}",)  # fmt: skip


def _salvaged(path: Path, plan: StudyPlan) -> tuple[str, list[Row], list[int]]:
    """Configuration, whole rows and unreadable numbers of a damaged database.

    Every number is looked up by itself, so that a damaged page hides its own rows only.
    """
    identity = ""
    rows: list[Row] = []
    holes: list[int] = []
    connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    try:
        connection.execute("PRAGMA writable_schema = ON")  # else a file cut short is refused whole
        try:
            text = f"SELECT value FROM meta WHERE key = '{IDENTITY}'"
            identity = str(connection.execute(text).fetchone()[0])
        except (sqlite3.DatabaseError, TypeError):
            pass  # the configuration beside it says the same
        for number in range(plan.total):
            try:
                text = f"SELECT {NAMES} FROM runs WHERE number = ?"
                row = connection.execute(text, (number,)).fetchone()
            except (sqlite3.DatabaseError, UnicodeDecodeError):
                holes.append(number)
                continue
            if row is None:
                continue
            if whole(row):
                rows.append(row)
            else:
                holes.append(number)
    finally:
        connection.close()
    return identity, rows, holes


def _configuration_beside(path: Path) -> str:
    try:
        return (path.parent / CONFIGURATION).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _put_aside(path: Path) -> Path:
    """Move a damaged database to a name of its own, with its log."""
    aside = next(
        name for k in count(1) if not (name := path.with_name(f"{path.name}.damaged-{k}")).exists()
    )
    path.rename(aside)
    for tail in ("-wal", "-shm"):
        log = path.with_name(path.name + tail)
        if log.exists():
            log.rename(aside.with_name(aside.name + tail))
    return aside


def _named(numbers: list[int], plan: StudyPlan) -> str:
    """Runs by point and replicate, the first few of them."""
    points = len(plan.points)
    some = [f"point {n % points} replicate {n // points}" for n in numbers[:SHOWN]]
    more = f" and {len(numbers) - SHOWN} more" if len(numbers) > SHOWN else ""
    return f"{len(numbers)} runs ({', '.join(some)}{more})"
