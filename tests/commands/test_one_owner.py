"""`run` by whole processes: started twice on one directory, and killed at every step of its files.

`TOLEVO_TRIALS=50` does fifty of each; by default there are a few.
"""

from __future__ import annotations

import importlib
import json
import multiprocessing
import os
import shutil
import signal
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest

from tests.small_jobs import TWO_PARTS as CONFIG
from tests.small_jobs import output_of, tolevo
from tolevo.algorithms.checkpoint import Checkpoint
from tolevo.directory import LOCK, MANIFEST, UNFINISHED, holders, standing
from tolevo.directory import own_folder as owned

TRIALS = int(os.environ.get("TOLEVO_TRIALS", "3"))
NEW = ("--set", "seed=2")
"""What the run that replaces the old one is told, so that no file of one equals the other's."""
RESULT = ("front.csv", "front.json", "choices.csv", "allocation.csv", "config.toml")
"""Files in which nothing depends on the clock."""
COMMAND = """
import sys
sys.stderr, sys.stdout = (open(name, "w") for name in {streams!r})
sys.argv = ["tolevo", *{words!r}]
{before}
from tolevo.cli import main
main()
"""
AT_STEP = """
import os, pathlib, signal
from tolevo import journal
from tolevo.algorithms.checkpoint import Checkpoint
Checkpoint.due = lambda self: True  # every generation is saved
journal.MIN_RECORDED_SECONDS = 0.0  # and every recalled step, however long it took: their number is the same each time
left = {step}
def counted(action):
    def acted(*arguments, **more):
        global left
        left -= 1
        open({count!r}, "w").write(str({step} - left))
        if left < 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return action(*arguments, **more)
    return acted
os.replace = counted(os.replace)
pathlib.Path.unlink = counted(pathlib.Path.unlink)
"""
"""Killed before the step of that number: each moves a file to its place, or removes one."""


TOGETHER = """
import pathlib, time
from tolevo.directory import ownership
taken = ownership._take_folder
def together(*arguments):
    pathlib.Path({own!r}).touch()
    until = time.monotonic() + 60.0
    while not pathlib.Path({other!r}).exists() and time.monotonic() < until:
        time.sleep(0.001)
    return taken(*arguments)
ownership._take_folder = together
"""
"""Begun only when the other one is about to take the directory as well."""


@dataclass(frozen=True)
class Place:
    """The configuration, a complete result of it and one of the new run."""

    config: Path
    old: Path
    new: Path

    def is_one(self, out: Path, of: Path) -> bool:
        """Whether `out` has the result files of that directory, byte for byte."""
        return all((out / n).read_bytes() == (of / n).read_bytes() for n in RESULT)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    folder = tmp_path_factory.mktemp("owner")
    found = Place(folder / "c.toml", folder / "old", folder / "new")
    found.config.write_text(CONFIG, encoding="utf-8")
    for out, more in ((found.old, ()), (found.new, NEW)):
        output_of("run", found.config, "--out", out, "--quiet", "--workers", 1, *more)
    return found


def start(words: Sequence[object], streams: Path, before: str = "") -> BaseProcess:
    """The command in a process of its own that has the libraries already."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tolevo.cli", "tolevo.commands.run.run",
                                    "tolevo.problems.stack"])  # fmt: skip
    names = [f"{streams}.err", f"{streams}.out"]
    text = COMMAND.format(words=[str(word) for word in words], streams=names, before=before)
    process = context.Process(target=exec, args=(text, {"__name__": "command"}))
    process.start()
    return process


def run_words(place: Place, out: Path, *more: object) -> list[object]:
    return ["run", place.config, "--out", out, "--quiet", "--workers", 1, *more]


WAYS: tuple[tuple[str, ...], ...] = ((), ("--overwrite",), ("--resume",))


@pytest.mark.long
@pytest.mark.parametrize("trial", range(TRIALS))
def test_of_two_starts_on_one_directory_one_is_refused(place: Place, tmp_path: Path, trial: int) -> None:
    """At the same moment, in every way: one result of one piece, by one of them."""
    out, how = tmp_path / "out", WAYS[trial % len(WAYS)]
    if how:
        shutil.copytree(place.old, out)
    more = ("--set", "algorithm.generations=400") if how == ("--resume",) else NEW
    ready = [str(tmp_path / f"{at}.ready") for at in range(2)]
    processes = [
        start(
            run_words(place, out, *how, *more), tmp_path / str(at), TOGETHER.format(own=ready[at], other=ready[1 - at])
        )
        for at in range(2)
    ]
    for process in processes:
        process.join()
    said = [(tmp_path / f"{at}.err").read_text(encoding="utf-8") for at in range(2)]
    codes = sorted(process.exitcode or 0 for process in processes)
    assert codes == [0, 2], said
    refusal = next(text for text in said if text)
    assert "is in use by `tolevo run` (process " in refusal
    assert "Traceback" not in refusal
    assert standing(out).complete
    assert not {path.name for path in out.iterdir()} & {LOCK, UNFINISHED}
    if how != ("--resume",):
        assert place.is_one(out, place.new)


def steps(place: Place, folder: Path) -> int:
    """How many times an `--overwrite` moves or removes a file."""
    folder.mkdir()
    out = folder / "out"
    shutil.copytree(place.old, out)
    said = AT_STEP.format(step=10**6, count=str(folder / "count"))
    process = start(run_words(place, out, *NEW, "--overwrite"), folder / "s", said)
    process.join()
    assert process.exitcode == 0
    assert place.is_one(out, place.new)
    return int((folder / "count").read_text())


@pytest.mark.long
def test_killed_at_any_step_nothing_looks_whole_that_is_not(place: Place, tmp_path: Path) -> None:
    """`run --overwrite` by SIGKILL before one of its steps, evenly spread over all of them.

    The old result stays whole, or the directory is unfinished, shown as such, and `--resume` makes
    the new result of it.
    """
    count = steps(place, tmp_path / "count")
    assert count > 40  # what is retired, every generation, every file
    verdicts = []
    for trial in range(TRIALS):
        out = tmp_path / str(trial)
        shutil.copytree(place.old, out)
        step = trial * (count - 1) // max(TRIALS - 1, 1)
        before = AT_STEP.format(step=step, count=str(tmp_path / "done"))
        process = start(run_words(place, out, *NEW, "--overwrite"), tmp_path / "s", before)
        process.join()
        assert process.exitcode == -signal.SIGKILL
        verdicts.append(resumed(place, out))
        shutil.rmtree(out)
    assert verdicts[0] == "old"
    assert verdicts[-1] in ("unfinished", "new")
    assert "unfinished" in verdicts


@pytest.mark.long
@pytest.mark.parametrize("trial", range(TRIALS // 2))
def test_killed_at_any_moment(place: Place, tmp_path: Path, trial: int) -> None:
    """In the search, after so many hundredths of a second from its first state on."""
    out = tmp_path / "out"
    shutil.copytree(place.old, out)
    long = ("--set", "algorithm.generations=100000")
    process = start(run_words(place, out, *NEW, *long, "--overwrite"), tmp_path / "s")
    until = time.monotonic() + 60.0
    while not (standing(out).unfinished and generations(out)):
        assert time.monotonic() < until
        time.sleep(0.005)
    time.sleep(0.1 * trial)
    assert "`tolevo run` (process" in holders(out)
    process.kill()
    process.join()
    assert shown(place, out) == "unfinished"
    budget = ("--set", f"algorithm.generations={generations(out) + 3}")
    output_of(*run_words(place, out, *NEW, *budget, "--resume"))
    whole = tolevo(*run_words(place, tmp_path / "whole", *NEW, *budget))
    assert whole.exit_code == 0, whole.stderr
    assert place.is_one(out, tmp_path / "whole")
    assert standing(out).complete


def generations(out: Path) -> int:
    """How many generations of a search are saved."""
    path = out / "checkpoint.npz"
    state = Checkpoint.read(path).saved() if path.exists() else None
    return 0 if state is None else len(state["run.history"])


def shown(place: Place, out: Path) -> str:
    """What a killed overwrite left, by what `report` shows of it: "old", "new" or "unfinished"."""
    here = standing(out)
    assert (here.holders, here.faults) == ("", ())
    found = tolevo("report", out, "--out", out.with_suffix(".html"))
    assert found.exit_code == 0, found.stderr
    if here.complete:
        assert found.stderr == ""
        old = place.is_one(out, place.old)
        assert old or place.is_one(out, place.new)
        return "old" if old else "new"
    assert "manifest.json: is missing: this result of `tolevo run` is unfinished" in found.stderr
    assert "unfinished" in out.with_suffix(".html").read_text(encoding="utf-8")
    return "unfinished"


def resumed(place: Place, out: Path) -> str:
    """`shown`, and what is unfinished is gone on with, to the new result."""
    verdict, here = shown(place, out), standing(out)
    if here.unfinished is None:
        return verdict
    for name in RESULT[:-1]:  # nothing of the old result stands among the new
        if (out / name).exists() and not here.unfinished.retiring:
            assert (out / name).read_bytes() == (place.new / name).read_bytes()
    output_of(*run_words(place, out, *NEW, "--resume"))
    assert standing(out).complete
    assert place.is_one(out, place.new)
    return verdict


def test_report_writes_nothing_into_a_directory_in_use(place: Place, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(place.old, out)
    with owned(out, "run", resume=True):
        before = {path: path.stat().st_mtime_ns for path in out.iterdir()}
        refused = tolevo("report", out)
        elsewhere = tolevo("report", out, "--out", tmp_path / "x.html")
        drawn = tolevo("report", out, "--out", tmp_path / "x.html", "--figures", out)
        assert {path: path.stat().st_mtime_ns for path in out.iterdir()} == before
    assert refused.exit_code == 2
    assert f"report: {out} is in use by `tolevo run` (process {os.getpid()}" in refused.stderr
    assert drawn.exit_code == 2
    assert drawn.stderr.startswith(f"--figures: {out} is in use by")
    assert elsewhere.exit_code == 0
    assert f"is complete, but `tolevo run` (process {os.getpid()} on" in elsewhere.stderr
    assert tolevo("report", out).exit_code == 0


def test_a_set_of_two_pieces_is_refused_by_all_who_read_it(place: Place, tmp_path: Path) -> None:
    """A summary of another run, and what each reader says of it."""
    out = tmp_path / "out"
    shutil.copytree(place.old, out)
    shutil.copy(place.new / "summary.json", out)
    files = {path: path.read_bytes() for path in out.iterdir()}
    words = "is not the file that this result was completed with (by manifest.json)"
    (tmp_path / "gap.toml").write_text(f'model = "rv_batch"\nrun = "{out}/config.toml"\n[free]\n', encoding="utf-8")
    for command in (
        ("report", out),
        ("report", out, place.new),
        run_words(place, out, "--resume"),
        ("check", tmp_path / "gap.toml"),
    ):
        refused = tolevo(*command)
        assert refused.exit_code == 2, command
        assert f"{out}/summary.json" in refused.stderr
        assert words in refused.stderr
        assert "--overwrite" in refused.stderr
    assert {path: path.read_bytes() for path in out.iterdir()} == files
    (out / MANIFEST).unlink()  # the way out that the refusal names
    assert tolevo("report", out).exit_code == 0


def test_another_start_while_the_page_is_built(place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was read is not written where somebody has begun anew meanwhile."""
    module = importlib.import_module("tolevo.commands.report")
    out = tmp_path / "out"
    shutil.copytree(place.old, out)
    build = module.page

    def slow(*arguments: object) -> object:
        with owned(out, "run") as other:
            other.begin(keep=("config.toml",))
        return build(*arguments)

    monkeypatch.setattr(module, "page", slow)
    refused = tolevo("report", out)
    assert refused.exit_code == 2
    assert "was written to while it was read; run the command again" in refused.stderr
    assert not (out / "report.html").exists()


def test_an_interrupted_run_is_unfinished_and_goes_on(place: Place, tmp_path: Path) -> None:
    out, long = tmp_path / "out", ("--set", "algorithm.generations=100000")
    process = start(run_words(place, out, *NEW, *long), tmp_path / "s")
    while not (out / "checkpoint.npz").exists():
        time.sleep(0.01)
    stop = threading.Timer(0.2, os.kill, (process.pid, signal.SIGTERM))
    stop.start()
    process.join()
    assert process.exitcode == 130
    assert json.loads((out / "summary.json").read_text())["status"] == "interrupted"
    assert not standing(out).complete
    found = tolevo("report", out)
    assert found.exit_code == 0
    assert "is unfinished; run the same command with --resume" in found.stderr
