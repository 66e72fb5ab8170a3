"""A directory that a command owns: taken, the old result retired, the new result completed."""

from __future__ import annotations

import secrets
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import Fault, InputError, RunError, StorageError, TolevoError, raise_all, refuse
from ..files import cause, is_folder
from ..interrupts import keeps
from .lock import Held, Lock, acquire, holders
from .standing import (
    KINDS,
    MANIFEST,
    UNFINISHED,
    Standing,
    Unfinished,
    fits,
    folders,
    irregular_file_faults,
    is_occupied,
    is_output_file,
    kinds_in,
    present_files,
    read_unfinished,
    standing,
    sweep,
    write_manifest,
    write_unfinished,
)

BUSY = "is in use by {}: wait for it, end it, or name another directory"
OCCUPIED = "{} is not empty; name another directory, or add --overwrite or --resume"
CONFIGURATION, TOLD = "config.toml", "told.csv"
"""What a search of `tolevo ask` is of, and the results that `tolevo tell` took."""
ASKED = "{} holds a search of `tolevo ask`, which no other command continues or replaces; name another directory"
UNCHANGED = (
    "cannot be written ({}: {}): nothing was changed; {} and run the same command again, or name another directory"
)
GONE = "{} was removed while the command worked in it, and what it held is lost: run the same command again"


class Ownership:
    """What a command may do with the directory that it has taken.

    Nothing of what is there is changed before `begin`; where that is never called, the directory
    is left as it was.
    """

    def __init__(self, folder: Path, command: str, lock: Lock, made: Sequence[Path]) -> None:
        self.folder = folder
        self.command = command
        self.standing = Standing()
        self._lock = lock
        self._made = made
        self._token = ""
        self.begun = False

    @property
    def blank(self) -> bool:
        """Whether there is nothing to continue: it is empty, or this command was interrupted before
        it had saved anything.
        """
        if not is_occupied(self.folder):
            return True
        here = self.standing
        same_command = here.unfinished is not None and here.command == self.command
        return same_command and not present_files(self.folder, KINDS[self.command].state)

    def check(self, resume: bool, overwrite: bool, apart: Sequence[str] = ()) -> None:
        """Check what is there. Raises InputError where it cannot be continued or replaced."""
        if holds_search(self.folder):
            raise refuse("--out", ASKED.format(self.folder))
        if not resume:
            if not overwrite and is_occupied(self.folder):
                raise refuse("--out", OCCUPIED.format(self.folder))
            return
        here = self.standing = standing(self.folder, apart)
        raise_all(here.faults)
        marked = here.manifest or here.unfinished
        if marked is not None and here.command != self.command:
            text = f"{self.folder} holds the result of `tolevo {here.command}`; name another "
            raise refuse("--resume", f"{text}directory, or --overwrite")
        self._token = here.unfinished.token if here.unfinished is not None else ""
        if here.unfinished is not None and here.unfinished.retiring:
            self._retire(here.unfinished.retiring)
            self.standing = standing(self.folder, apart)

    def begin(self, keep: Sequence[str] = ()) -> None:
        """Retire what is there except the files `keep`, which the new result continues from.

        From here on the directory is that of an unfinished result.
        """
        sweep(folders(self.folder), is_output_file)
        old = [name for name in self._old() if not fits(name, keep)]
        self._token = secrets.token_hex(8)
        write_unfinished(self.folder, self.command, self._token, old)
        self.begun = True
        keeps(self._kept)
        self._retire(old)

    def _kept(self) -> str:
        """What an interrupt leaves, and how to go on."""
        kind = KINDS[self.command]
        kept = (
            f"{kind.saved} is kept in {self.folder}"
            if present_files(self.folder, kind.state)
            else "nothing had been saved"
        )
        return f"{kept}; run the same command with --resume to continue"

    def _old(self) -> list[str]:
        """Names of all files that commands have written here."""
        mark = _mark(self.folder)
        names = {*kinds_in(self.folder), self.command, mark.command if mark else ""}
        kinds = [kind for name, kind in KINDS.items() if name in names]
        patterns = [name for kind in kinds for name in (*kind.state, *kind.files, *kind.pages)]
        return list(dict.fromkeys([*present_files(self.folder, patterns), *(mark.retiring if mark else ())]))

    def _retire(self, names: Sequence[str]) -> None:
        """Remove files of an older result, the manifest first, so that no set looks complete."""
        (self.folder / MANIFEST).unlink(missing_ok=True)
        for name in names:
            (self.folder / name).unlink(missing_ok=True)
        if names:
            write_unfinished(self.folder, self.command, self._token)

    def complete(self, status: str = "done") -> None:
        """Mark what has been written as a complete set."""
        if not self._lock.holds():
            raise RunError(GONE.format(self.folder))
        write_manifest(self.folder, self.command, status)
        (self.folder / UNFINISHED).unlink(missing_ok=True)

    def release(self) -> None:
        """Release the directory; a directory that was made and not used is removed."""
        self._lock.release()
        if not self.begun:
            _remove_made_folders(self._made)

    def unwritten(self, path: object, reason: str, remedy: str) -> TolevoError:
        """The error where a file cannot be written: why, what is kept, and how to continue."""
        if not self.begun:
            return refuse("--out", UNCHANGED.format(path, reason, remedy))
        kind = KINDS[self.command]
        saved = present_files(self.folder, kind.state)
        kept = f"{kind.saved} is kept in {self.folder}" if saved else "nothing had been saved before"
        text = f"{path} cannot be written: {reason}; {kept}"
        return StorageError(f"{text}; {remedy}, then run the same command with --resume")


@contextmanager
def own_folder(
    folder: Path, command: str, resume: bool = False, overwrite: bool = True, apart: Sequence[str] = ()
) -> Iterator[Ownership]:
    """Hold the directory of a result for a `tolevo <command>`, made where there is none.

    With `resume` its result is continued. The files in `apart` check themselves. Raises InputError
    where another process holds it, where it is not empty and neither `resume` nor `overwrite` is
    given, or where its files do not belong together; RunError where a file cannot be written later
    on.
    """
    raise_all(irregular_file_faults(folder))
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        lock = _take_folder(folder, command)
    except OSError as error:
        _remove_made_folders(made)
        if (why := cause(error)) is None:
            raise
        raise refuse("--out", UNCHANGED.format(error.filename or folder, *why)) from error
    except InputError:
        _remove_made_folders(made)
        raise
    held = Ownership(folder, command, lock, made)
    try:
        held.check(resume, overwrite, apart)
        yield held
    except OSError as error:
        if not is_folder(folder):
            raise RunError(GONE.format(folder)) from None
        if (why := cause(error)) is None:
            raise
        raise held.unwritten(error.filename or folder, *why) from error
    finally:
        held.release()


def _take_folder(folder: Path, command: str) -> Lock:
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            return acquire(folder, command)
        except FileNotFoundError:  # its last owner had not needed it, and removed it
            continue
        except Held as holder:
            raise refuse("--out", f"{folder} {BUSY.format(holder)}") from None


def _mark(folder: Path) -> Unfinished | None:
    """The mark of an unfinished result, None where there is none or it is damaged."""
    with suppress(ValueError):
        return read_unfinished(folder)
    return None


def _remove_made_folders(made: Sequence[Path]) -> None:
    for path in made:
        with suppress(OSError):
            path.rmdir()


def holds_search(folder: Path) -> bool:
    """Whether a directory holds a search of `tolevo ask`, whose results no other command can repeat."""
    return (folder / CONFIGURATION).is_file() and (folder / TOLD).is_file()


def busy_faults(folder: Path, place: str) -> list[Fault]:
    """A fault where a process holds a directory."""
    if holder := holders(folder):
        return [Fault(place, f"{folder} {BUSY.format(holder)}")]
    return []
