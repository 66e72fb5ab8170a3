"""Commands whose standard streams are closed, or have no reader, go on and end as they would."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.small_jobs import STACK
from tolevo.interrupts import warn_in_a_line

RUN = STACK.replace("seed = 1", 'references = "none"')
COMMAND = (sys.executable, "-m", "tolevo")
CLOSED = 'exec "$@" >&- 2>&- <&-'
"""A shell that starts its arguments without any standard stream."""


@pytest.fixture
def unread() -> Iterator[int]:
    """The end for writing of a pipe that nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    yield writer
    os.close(writer)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with all of its streams."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "c.toml").write_text(RUN, encoding="utf-8")
    subprocess.run([*COMMAND, "run", "c.toml", "--out", "out"], cwd=folder, check=True)
    return folder


def same(out: Path, whole: Path) -> None:
    for name in ("front.csv", "report.html"):
        assert (out / name).is_file()
    assert (out / "front.csv").read_bytes() == (whole / "out" / "front.csv").read_bytes()


def test_text_without_a_reader_is_no_error(unread: int) -> None:
    ended = subprocess.run([*COMMAND, "list"], stdout=unread, stderr=subprocess.PIPE, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_run_whose_progress_nobody_reads_goes_on(whole: Path, unread: int, tmp_path: Path) -> None:
    command = [*COMMAND, "run", str(whole / "c.toml"), "--out", str(tmp_path / "out")]
    ended = subprocess.run(command, stdout=unread, stderr=unread)
    assert ended.returncode == 0
    same(tmp_path / "out", whole)


def test_a_run_without_standard_streams_goes_on(whole: Path, tmp_path: Path) -> None:
    command = [*COMMAND, "run", str(whole / "c.toml"), "--out", str(tmp_path / "out")]
    ended = subprocess.run(["sh", "-c", CLOSED, "sh", *command])
    assert ended.returncode == 0
    same(tmp_path / "out", whole)


def test_a_full_disk_behind_stdout_is_an_error() -> None:
    with open("/dev/full", "w") as full:
        ended = subprocess.run([*COMMAND, "list"], stdout=full, stderr=subprocess.PIPE, text=True)
    assert ended.returncode != 0
    assert "No space left on device" in ended.stderr


def test_warnings_of_libraries_about_their_numbers_are_not_printed(capsys: pytest.CaptureFixture[str]) -> None:
    from scipy.linalg import LinAlgWarning
    from scipy.optimize import OptimizeWarning

    for category in (RuntimeWarning, LinAlgWarning, OptimizeWarning):
        warn_in_a_line("noise", category)
    warn_in_a_line("torque beyond", UserWarning)
    assert capsys.readouterr().err == "warning: torque beyond\n"
