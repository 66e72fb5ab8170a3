"""Opens the store of a study: a new one, that of an interrupted study, or a damaged file."""

from __future__ import annotations

import hashlib
import tomllib
from itertools import count
from pathlib import Path

from ....errors import Fault, InputError, raise_all, refuse
from ....section import differences as changes
from ....section import flat
from ...store.backend import DAMAGE, Backend, Foreign, Newer, reason
from ...store.faults import not_ours
from ...store.sqlite_file import SqliteFile
from ...store.tables import STUDY, TABLE
from ..plan import StudyPlan
from .database import Database
from .names import CONFIGURATION
from .rows import Row, is_intact

IDENTITY, POINTS, SEAL = STUDY, "points", "sha256"
"""What a database stores of its study: the resolved configuration, a hash of the design, and the
digest of both.
"""
SEALED = 2
"""Version of the tables from which on there is such a digest."""
GROWS = "seeds"
"""The only key of the runs that may differ in the command that resumes a study, upwards."""
HYPOTHESES = "reading"
"""The key of what is only tested on the runs."""
SHOWN = 12
"""Lost runs that are named one by one."""


class Unopened(Exception):
    """A database that may be sound cannot be opened: its path, the cause, and the remedy."""


def opened(plan: StudyPlan, backend: Backend, alone: bool, prefix: str = "") -> tuple[Database, tuple[str, ...]]:
    """The open store of a study, and what the user should know of it.

    Where this process is `alone`, claims of earlier ones whose names begin with `prefix` are
    dropped. Raises InputError where it belongs to another study, was written by a newer version,
    or where nothing of it can be read, Unopened where the disk is full, no server answers, or it
    cannot be written for another reason.
    """
    try:
        database, notes = _sound(backend, plan, prefix)
    except (Newer, Foreign) as error:
        raise refuse(backend.display_name, not_ours(error, backend)) from None
    except DAMAGE as error:
        if why := backend.hindrance(error):
            raise Unopened(backend.display_name, *why) from error
        if not isinstance(backend, SqliteFile):
            raise _unreadable(backend, reason(error)) from error
        database, notes = _recovered(backend, plan, reason(error))
    try:
        while not _taken(database, plan):
            pass  # another process has just written which study it belongs to
        if alone:
            database.drop_claims(prefix)
    except DAMAGE as error:
        database.close()
        raise _unreadable(backend, reason(error)) from error
    except BaseException:
        database.close()
        raise
    return database, notes


def _unreadable(backend: Backend, why: str) -> InputError:
    return refuse(backend.display_name, f"cannot be read: {why}; {backend.restart}")


def _sound(backend: Backend, plan: StudyPlan, prefix: str) -> tuple[Database, tuple[str, ...]]:
    """The database where its pages are sound; rows that were changed are forgotten, and named."""
    database = _database(backend, plan, prefix)
    try:
        wrong = database.damaged()
        if wrong:
            database.forget(wrong)
    except BaseException:
        database.close()
        raise
    runs = _runs_text(wrong, plan)
    return database, ((f"{runs} of {backend.display_name} had been changed and are done again",) if wrong else ())


def _database(backend: Backend, plan: StudyPlan, prefix: str = "") -> Database:
    return Database(backend, len(plan.points), plan.settings.responses, prefix)


def identity_faults(database: Database, plan: StudyPlan) -> list[Fault]:
    """What is wrong with taking the database for this study. Raises InputError where it says
    nothing that can be read.
    """
    new, old, backend = plan.settings.configuration, database.meta(IDENTITY), database.backend
    if database.meta(TABLE):
        raise refuse(backend.display_name, f"holds a computed table; {backend.alternative}")
    if not _seal_fits(database):
        raise _unreadable(backend, "the identity of its study is damaged")
    if old and old != new:
        try:
            faults = differences(old, new, backend.restart)
        except tomllib.TOMLDecodeError as error:
            raise _unreadable(backend, f"its configuration is damaged ({error})") from None
        if faults:
            return faults
    if database.meta(POINTS) not in ("", _points(plan)):
        text = "its points are not those of the study to resume: the table, or the version of what "
        return [Fault("design", f"{text}draws them, has changed; {backend.restart}")]
    return []


def _taken(database: Database, plan: StudyPlan) -> bool:
    """Whether the database, brought up to this version, says that it belongs to this study.

    Raises InputError where it belongs to another.
    """
    old = database.meta(IDENTITY)
    raise_all(identity_faults(database, plan))
    database.migrate()
    new, points = plan.settings.configuration, _points(plan)
    if (old, database.meta(POINTS)) == (new, points) and database.meta(SEAL):
        return True
    return database.set_meta({IDENTITY: new, POINTS: points, SEAL: _digest(new, points)}, IDENTITY, old)


def _points(plan: StudyPlan) -> str:
    return hashlib.sha256(plan.design.to_csv(index=False).encode()).hexdigest()


def _seal_fits(database: Database) -> bool:
    """Whether what the database stores of its study is as it was written."""
    identity, points, seal = (database.meta(key) for key in (IDENTITY, POINTS, SEAL))
    if database.format < SEALED and not seal:
        return True
    return seal == (_digest(identity, points) if identity or points else "")


def _digest(identity: str, points: str) -> str:
    return hashlib.sha256(f"{identity}\n{points}".encode()).hexdigest()


def differences(before: str, after: str, restart: str = SqliteFile.restart) -> list[Fault]:
    """What makes a configuration (TOML) that of another study than one before."""
    tables = [tomllib.loads(text) for text in (before, after)]
    old, new = map(flat, tables)
    faults = []
    for key, (was, now) in changes(*tables).items():
        if key == HYPOTHESES or (key == GROWS and new[key] > old[key]):
            continue
        hint = "it may only grow" if key == GROWS else "only seeds may grow"
        faults.append(Fault(key, f"is {now}, but the study to resume has {was}: {hint}; undo the change, or {restart}"))
    return faults


def _recovered(backend: SqliteFile, plan: StudyPlan, error: str) -> tuple[Database, tuple[str, ...]]:
    """A new database with every row of a damaged one that can be read and is as it was written."""
    path = backend.path
    identity, rows, holes = _salvaged(path, plan)
    if not rows:
        raise refuse(str(path), f"is damaged ({error}) and none of its runs can be read: {backend.restart}")
    identity = identity or _stored_configuration(path)
    aside = _put_aside(path)
    database = _database(SqliteFile(path), plan)
    if identity:
        database.set_meta({IDENTITY: identity, SEAL: _digest(identity, "")})
    database.insert(rows)
    again = f"; {_runs_text(holes, plan)} could not be read and are done again" if holes else ""
    return database, (
        f"{path} was damaged ({error}): {len(rows)} runs in it are whole{again}; the "
        f"damaged file is kept as {aside.name}",
    )


def _salvaged(path: Path, plan: StudyPlan) -> tuple[str, list[Row], list[int]]:
    """Configuration, whole rows and unreadable numbers of a damaged database.

    Every number is looked up by itself, so that a damaged page hides its own rows only.
    """
    identity = ""
    rows: list[Row] = []
    holes: list[int] = []
    try:
        database = Database(SqliteFile(path, reading=True), len(plan.points), (), reading=True)
    except (*DAMAGE, Newer, Foreign):
        return identity, rows, list(range(plan.total))
    with database:
        try:
            known = [database.meta(key) for key in (IDENTITY, POINTS)]
            if database.meta(SEAL) == _digest(*known):
                identity = known[0]
        except (*DAMAGE, ValueError):
            pass  # the configuration in the same directory is the same
        for number in range(plan.total):
            try:
                row = database.row(number)
            except DAMAGE:
                row = ()
            if row is not None and is_intact(row):
                rows.append(row)
            elif row is not None:
                holes.append(number)
    return identity, rows, holes


def _stored_configuration(path: Path) -> str:
    try:
        return (path.parent / CONFIGURATION).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _put_aside(path: Path) -> Path:
    """Rename a damaged database, with its log."""
    aside = next(name for k in count(1) if not (name := path.with_name(f"{path.name}.damaged-{k}")).exists())
    path.rename(aside)
    for tail in ("-wal", "-shm"):
        log = path.with_name(path.name + tail)
        if log.exists():
            log.rename(aside.with_name(aside.name + tail))
    return aside


def _runs_text(numbers: list[int], plan: StudyPlan) -> str:
    """Runs by point and replicate, the first few of them."""
    points = len(plan.points)
    some = [f"point {n % points} replicate {n // points}" for n in numbers[:SHOWN]]
    more = f" and {len(numbers) - SHOWN} more" if len(numbers) > SHOWN else ""
    return f"{len(numbers)} runs ({', '.join(some)}{more})"
