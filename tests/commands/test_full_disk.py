"""A disk that is full, read-only or over its quota: what is said, what is kept, how it goes on."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from typer.testing import Result

from tests.small_jobs import STACK as CONFIG
from tests.small_jobs import output_of, tolevo
from tolevo.directory import standing

STUDY = """
run = "c.toml"
seeds = 40
response = ["hypervolume"]
[design]
kind = "factorial"
[vary]
"algorithm.population" = [8, 10]
"""
WORDS = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EROFS: "the file system is read-only",
}
SIZE = 400
"""Size [kB] of the small disk."""


def run(config: Path, out: Path, *more: object) -> Result:
    return tolevo("run", config, "--out", out, "--quiet", "--workers", 1, *more)


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("full")
    (folder / "c.toml").write_text(CONFIG, encoding="utf-8")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return folder / "c.toml"


@pytest.fixture(scope="module")
def whole(config: Path) -> Path:
    ended = run(config, config.parent / "whole")
    assert ended.exit_code == 0, ended.stderr
    return config.parent / "whole"


Fill = Callable[[int, int], None]


@pytest.fixture
def fill(monkeypatch: pytest.MonkeyPatch) -> Fill:
    """Let the file after so many more fail with that error, and all that follow."""

    def failing(number: int, after: int) -> None:
        sync, count = os.fsync, [after]

        def full(handle: int) -> None:
            count[0] -= 1
            if count[0] < 0:
                raise OSError(number, os.strerror(number))
            sync(handle)

        monkeypatch.setattr(os, "fsync", full)

    return failing


@pytest.mark.parametrize("number", WORDS)
def test_before_the_run_nothing_is_changed(config: Path, whole: Path, tmp_path: Path, fill: Fill, number: int) -> None:
    """Neither is a directory left behind, nor an old result touched: status 2."""
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    before = {path: path.read_bytes() for path in out.iterdir()}
    fill(number, 0)
    for place in (out, tmp_path / "new" / "deep"):
        refused = run(config, place, "--overwrite")
        assert refused.exit_code == 2
        assert refused.stderr.startswith("--out: cannot be written (")
        assert f": {WORDS[number]}): nothing was changed; " in refused.stderr
        assert "name another directory" in refused.stderr
        assert "Errno" not in refused.stderr
    assert {path: path.read_bytes() for path in out.iterdir()} == before
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("number", "after", "name", "kept"),
    [
        (errno.ENOSPC, 2, "checkpoint.npz", "nothing had been saved before"),
        (errno.EDQUOT, 4, "checkpoint.npz", "the search as it was saved last is kept in {out}"),
        (errno.EROFS, 9, "convergence.csv", "the search as it was saved last is kept in {out}"),
    ],
)
def test_in_mid_run_it_says_what_is_kept_and_goes_on(
    config: Path,
    whole: Path,
    tmp_path: Path,
    fill: Fill,
    monkeypatch: pytest.MonkeyPatch,
    number: int,
    after: int,
    name: str,
    kept: str,
) -> None:
    """First state, a later state, a file of the result: the path, what is kept, and --resume."""
    out = tmp_path / "out"
    fill(number, after)
    failed = run(config, out)
    assert failed.exit_code == 1
    (line,) = failed.stderr.splitlines()
    assert line.startswith(f"{out / name} cannot be written: {WORDS[number]}; ")
    assert kept.format(out=out) in line
    assert line.endswith("then run the same command with --resume")
    assert standing(out).unfinished is not None
    assert not [path for path in out.iterdir() if path.name.startswith(".")]
    monkeypatch.undo()
    again = run(config, out, "--resume")
    assert again.exit_code == 0, again.stderr
    assert (out / "front.csv").read_bytes() == (whole / "front.csv").read_bytes()
    assert standing(out).complete


def test_a_single_file_says_its_path_and_keeps_what_was_there(config: Path, tmp_path: Path, fill: Fill) -> None:
    designs, out = tmp_path / "d.csv", tmp_path / "out.csv"
    designs.write_text("a_t\n0.1\n", encoding="utf-8")
    out.write_text("older", encoding="utf-8")
    fill(errno.ENOSPC, 0)
    failed = tolevo("evaluate", config, designs, "--out", out, "--overwrite")
    assert failed.exit_code == 1
    assert f"failed: {out} cannot be written: the disk is full; what was there is kept" in (failed.stderr)
    assert out.read_text(encoding="utf-8") == "older"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d.csv", "out.csv"]


def test_leftovers_of_a_single_file_go_at_the_next_start(config: Path, tmp_path: Path) -> None:
    designs, out = tmp_path / "d.csv", tmp_path / "out.csv"
    designs.write_text("a_t\n0.1\n", encoding="utf-8")
    (tmp_path / ".out.csv.0123abcd.part").write_text("half a", encoding="utf-8")
    (tmp_path / ".other.csv.0123abcd.part").write_text("not ours", encoding="utf-8")
    assert tolevo("evaluate", config, designs, "--out", out).exit_code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        ".other.csv.0123abcd.part", "d.csv", "out.csv",
    ]  # fmt: skip


@pytest.mark.parametrize("mask", [0o002, 0o077])
def test_every_file_of_a_run_and_a_study_keeps_the_umask(config: Path, tmp_path: Path, mask: int) -> None:
    before = os.umask(mask)
    try:
        assert run(config, tmp_path / "run").exit_code == 0
        words = ("study", config.parent / "study.toml", "--out", tmp_path / "study", "--workers", 1)
        output_of(*words, "--quiet", "--set", "seeds=2")
    finally:
        os.umask(before)
    modes = {path.stat().st_mode & 0o777 for name in ("run", "study") for path in (tmp_path / name).iterdir()}
    assert modes == {0o666 & ~mask}


# ---------------------------------------------------------------- a disk that is really full


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A small disk of its own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}k", "tmpfs", str(folder)]
    if os.geteuid() or subprocess.run(words, capture_output=True).returncode:
        pytest.skip("only root may mount a small disk")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def stuffed(disk: Path, left: int) -> Path:
    """Fill the disk but for so many kB."""
    free = os.statvfs(disk)
    size = free.f_bavail * free.f_bsize - left * 1024
    path = disk / f"stuffing-{left}"
    path.write_bytes(b"\0" * max(size, 0))
    return path


def test_a_full_disk_damages_no_study(config: Path, disk: Path, tmp_path: Path) -> None:
    """In the middle, at a new start, and at --resume: nothing is called damaged."""
    out, words = disk / "study", ("study", config.parent / "study.toml", "--quiet", "--workers", 1)
    stuffed(disk, 150)
    failed = tolevo(*words, "--out", out)
    assert failed.exit_code == 1
    assert "cannot be written" in failed.stderr
    assert f"of 80 runs have ended and are saved in {out}" in failed.stderr
    assert "--resume" in failed.stderr
    stuffing = stuffed(disk, 0)
    for more in (("--out", out, "--resume"), ("--out", disk / "new")):
        refused = tolevo(*words, *more)
        assert refused.exit_code == 2, refused.output
        assert "damaged" not in refused.stderr
        assert "--overwrite" not in refused.stderr
        assert "full" in refused.stderr
    stuffing.unlink()
    subprocess.run(["mount", "-o", "remount,size=40m", str(disk)], check=True)
    output_of(*words, "--out", out, "--resume")
    assert tolevo(*words, "--out", tmp_path / "whole").exit_code == 0
    assert (out / "study.csv").read_bytes() == (tmp_path / "whole" / "study.csv").read_bytes()


def test_a_full_disk_in_mid_run(config: Path, whole: Path, disk: Path) -> None:
    out = disk / "run"
    stuffing = stuffed(disk, 100)
    failed = run(config, out)
    assert failed.exit_code == 1
    assert f"{out}/" in failed.stderr
    assert "cannot be written: the disk is full; the search as it was saved last is kept" in (failed.stderr)
    assert "Errno" not in failed.stderr
    stuffing.unlink()
    subprocess.run(["mount", "-o", "remount,size=40m", str(disk)], check=True)
    assert run(config, out, "--resume").exit_code == 0
    assert (out / "front.csv").read_bytes() == (whole / "front.csv").read_bytes()


def test_a_read_only_disk(config: Path, whole: Path, disk: Path) -> None:
    subprocess.run(["mount", "-o", "remount,size=40m", str(disk)], check=True)
    shutil.copytree(whole, disk / "run")
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
    for more in (("--overwrite",), ("--resume",)):
        refused = run(config, disk / "run", *more)
        assert refused.exit_code == 2
        assert "the file system is read-only" in refused.stderr
    refused = tolevo("report", disk / "run")
    assert refused.exit_code == 2
    assert "the file system is read-only" in refused.stderr
    output_of("report", disk / "run", "--out", whole.parent / "x.html")
