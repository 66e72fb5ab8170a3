"""Opens the database of a study: a new one, that of a broken study, or what is whole of it."""

from __future__ import annotations

import hashlib
import sqlite3
import tomllib
from itertools import count
from pathlib import Path

from ....errors import Fault, raise_all, refuse
from ....section import flat
from ..plan import StudyPlan
from .database import APPLICATION, DATABASE, FORMAT, NAMES, Database, hindrance
from .rows import Row, whole

CONFIGURATION = "config.toml"
IDENTITY, POINTS, SEAL = "configuration", "points", "sha256"
"""What a database says of its study: the resolved configuration, a hash of the design, and the
digest of both.
"""
SEALED = 2
"""Version of the tables from which on there is such a digest."""
GROWS = "seeds"
"""The one key of the runs that may differ between a study and what goes on with it, upwards."""
SAID = "reading"
"""What is only tested on the runs."""
DAMAGE = (sqlite3.Error, UnicodeDecodeError)
"""What a damaged database may raise: of a broken name SQLite's own message cannot be decoded."""
SHOWN = 12
"""Lost runs that are named one by one."""


class Unopened(Exception):
    """A database that may be sound cannot be opened: its path, why, and what helps."""


def opened(plan: StudyPlan, folder: Path, alone: bool) -> tuple[Database, tuple[str, ...]]:
    """The database of a study in `folder`, and what the user should know of it.

    Claims of earlier processes are dropped where this one is `alone`. Raises InputError where it
    belongs to another study, was written by a newer version, or where nothing of it can be read,
    Unopened where the disk is full, or cannot be written for another reason.
    """
    path = folder / DATABASE
    if path.exists() and path.stat().st_size:
        _check_format(path)
    try:
        database, notes = _sound(path, plan)
    except DAMAGE as error:
        if why := hindrance(error):
            raise Unopened(path, *why) from error
        database, notes = _recovered(path, plan, str(error))
    try:
        _check_identity(database, plan)
        if alone:
            database.drop_claims()
    except DAMAGE as error:
        database.close()
        raise refuse(str(path), f"cannot be read: {error}; start again with --overwrite") from error
    except BaseException:
        database.close()
        raise
    return database, notes


def _sound(path: Path, plan: StudyPlan) -> tuple[Database, tuple[str, ...]]:
    """The database where its pages are sound; rows that were changed are forgotten, and named."""
    database = _database(path, plan)
    try:
        wrong = database.damaged()
        if wrong:
            database.forget(wrong)
    except BaseException:
        database.close()
        raise
    return database, (
        (f"{_named(wrong, plan)} of {path} had been changed and are done again",) if wrong else ()
    )


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
    except DAMAGE as error:  # damaged: what is whole of it is looked for
        if why := hindrance(error):
            raise Unopened(path, *why) from error
        return
    if application == APPLICATION and version > FORMAT:
        text = f"was written by a newer version of tolevo (format {version}, this one reads up to "
        raise refuse(str(path), f"{text}{FORMAT}): update tolevo, or name another directory")
    if tables and application != APPLICATION:
        raise refuse(str(path), "is no database of a study; name another directory")


def _check_identity(database: Database, plan: StudyPlan) -> None:
    """Takes the database for this study; raises InputError where it belongs to another."""
    new, old = plan.settings.configuration, database.meta(IDENTITY)
    if database.meta(SEAL) not in ("" if database.format < SEALED else None, _seal(database)):
        text = "cannot be read: what it says of its study is damaged; start again with --overwrite"
        raise refuse(str(database.path), text)
    if old and old != new:
        try:
            faults = differences(old, new)
        except tomllib.TOMLDecodeError as error:
            text = f"cannot be read: its configuration is damaged ({error})"
            raise refuse(str(database.path), f"{text}; start again with --overwrite") from None
        raise_all(faults)
    points = hashlib.sha256(plan.design.to_csv(index=False).encode()).hexdigest()
    if database.meta(POINTS) not in ("", points):
        text = "its points are not those of the study to resume: the table, or the version of what "
        raise refuse("design", f"{text}draws them, has changed; start again with --overwrite")
    if (old, database.meta(POINTS), database.format) != (new, points, FORMAT):
        database.set_meta({IDENTITY: new, POINTS: points, SEAL: _digest(new, points)})


def _seal(database: Database) -> str:
    """The digest that fits what the database says of its study; empty where it says nothing."""
    identity, points = database.meta(IDENTITY), database.meta(POINTS)
    return _digest(identity, points) if identity or points else ""


def _digest(identity: str, points: str) -> str:
    return hashlib.sha256(f"{identity}\n{points}".encode()).hexdigest()


def differences(before: str, after: str) -> list[Fault]:
    """What makes a configuration (TOML) that of another study than one before."""
    old, new = (flat(tomllib.loads(text)) for text in (before, after))
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
        database.set_meta({IDENTITY: identity, SEAL: _digest(identity, "")})
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
            known = dict(connection.execute("SELECT key, value FROM meta").fetchall())
            if known.get(SEAL) == _digest(known[IDENTITY], known[POINTS]):
                identity = known[IDENTITY]
        except (*DAMAGE, TypeError, KeyError):
            pass  # the configuration beside it says the same
        for number in range(plan.total):
            try:
                text = f"SELECT {NAMES} FROM runs WHERE number = ?"
                row = connection.execute(text, (number,)).fetchone()
            except DAMAGE:
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
