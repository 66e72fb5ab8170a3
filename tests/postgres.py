"""A PostgreSQL server of the tests' own, on a socket in a temporary directory."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psycopg
import pytest

BIN = sorted(Path("/usr/lib/postgresql").glob("*/bin"))
"""Where Debian's packages put it; it is not on the path."""
USER = "postgres"
WAITED_MS = 100
"""Milliseconds of waiting for a lock from which on the server's log says so."""


class Server:
    """The server; it does not run as root, so that root hands it to the user `postgres`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.log = folder / "log"
        self._as: dict[str, Any] = {}
        if os.geteuid() == 0:
            user = pwd.getpwnam(USER)
            os.chown(folder, user.pw_uid, user.pw_gid)
            self._as = {"user": user.pw_uid, "group": user.pw_gid, "extra_groups": []}
        words = [str(BIN[-1] / "initdb"), "-D", str(folder / "data"), "-U", USER, "-A", "trust",
                 "-N", "--locale=C", "-E", "UTF8"]  # fmt: skip
        subprocess.run(words, check=True, cwd=folder, capture_output=True, **self._as)
        self._process: subprocess.Popen[bytes] | None = None
        self.start()

    def start(self) -> None:
        words = [str(BIN[-1] / "postgres"), "-D", str(self.folder / "data"), "-k", str(self.folder),
                 "-c", "listen_addresses=", "-c", "log_lock_waits=on",
                 "-c", f"deadlock_timeout={WAITED_MS}ms", "-c", "shared_buffers=16MB"]  # fmt: skip
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(words, cwd=self.folder, stdout=log, stderr=log,
                                             **self._as)  # fmt: skip
        until = time.monotonic() + 60.0
        while True:
            try:
                psycopg.connect(self.url).close()
                return
            except psycopg.OperationalError:
                assert time.monotonic() < until, self.log.read_text()
                time.sleep(0.02)

    def kill(self) -> None:
        """SIGKILL to the server and all its children, as when the machine is switched off."""
        assert self._process is not None
        pids = [self._process.pid, *_children(self._process.pid)]
        for pid in pids:
            os.kill(pid, signal.SIGKILL)
        self._process.wait()
        for pid in pids[1:]:
            while Path(f"/proc/{pid}").exists():
                time.sleep(0.001)

    def stop(self) -> None:
        assert self._process is not None
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            self._process.wait(30.0)

    @property
    def url(self) -> str:
        return f"postgresql:///postgres?host={self.folder}&user={USER}"

    def store(self, schema: str) -> str:
        """The address of a schema of its own."""
        return f"{self.url}&schema={schema}"

    def ask(self, schema: str, statement: str) -> list[tuple[Any, ...]]:
        """What a statement comes to in a schema."""
        with psycopg.connect(self.url, options=f"-c search_path={schema}") as connection:
            cursor = connection.execute(statement.encode())
            return cursor.fetchall() if cursor.description else []


def _children(pid: int) -> list[int]:
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            if int(path.read_text().rpartition(")")[2].split()[1]) == pid:
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


@contextmanager
def server() -> Iterator[Server]:
    """A server; tests are skipped where none is installed, unless `CI` is set."""
    if not BIN:
        assert not os.environ.get("CI"), "PostgreSQL is not installed: apt-get install postgresql"
        pytest.skip("PostgreSQL is not installed")
    folder = Path(tempfile.mkdtemp(prefix="tolevo-pg-"))
    found = Server(folder)
    try:
        yield found
    finally:
        found.stop()
        shutil.rmtree(folder, ignore_errors=True)
