"""Every command by every signal at seeded moments: what is left is whole or known as unfinished,
and gone on with to the same bytes. `TOLEVO_TRIALS` is how many of each command.
"""

from __future__ import annotations

import os
import random
import signal
from pathlib import Path

import pytest

from tests.killing import SIGNALS, WITHOUT_PRIVILEGES, Job, content, jobs, killed, start
from tests.small_jobs import tolevo
from tolevo.directory import standing

pytestmark = pytest.mark.long
TRIALS = int(os.environ.get("TOLEVO_TRIALS", "2"))
QUICK = ("run", "evaluate", "reproduce", "template")
LONG = ("gap", "study", "report")
NAMES = [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in LONG)]
ENDED = {0, 130}
PROMPT = 2.0
"""CPU seconds within which a command ends after a signal that it hears."""


class Known:
    """The jobs, in a folder with spaces in its name, each measured when it is asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.jobs = folder, jobs(folder)

    def __getitem__(self, name: str) -> Job:
        job, folder = self.jobs[name], self.folder / name
        if not job.whole:
            folder.mkdir()
            job.measure(folder)
        return job


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Known:
    return Known(tmp_path_factory.mktemp("kills of all commands"))


def all_kills(name: str, job: Job, folder: Path, trials: int) -> None:
    rng = random.Random(f"25 {name}")
    for trial in range(trials):
        number, share = SIGNALS[trial % len(SIGNALS)], rng.random()
        writing = bool(trial % 2) and job.steps > 0
        out = folder / f"o {trial}"
        out.parent.mkdir(exist_ok=True)
        if job.file:
            out.mkdir()
        end = killed(job, out, folder / "s", number, share, writing)
        assert "Traceback" not in end.errors, (trial, end)
        if number == signal.SIGKILL:
            assert end.code in (0, -signal.SIGKILL), (trial, end)
        else:
            assert end.code in ENDED, (trial, end)
            assert end.after < PROMPT, (trial, end)
        checked(job, out, trial)


def checked(job: Job, out: Path, trial: int) -> None:
    """What a kill left claims no more than it is, and is gone on with to the whole result."""
    if job.file:
        left = content(out).get(job.file)
        assert left in (None, job.whole.get(job.file)), f"{trial}: half a file"
        if left is not None and not job.again:  # a whole file, which a template does not replace
            return
    elif out.exists():
        here = standing(out)
        assert (here.holders, here.faults) == ("", ()), trial
        if here.complete:
            assert same(job, out), trial
    again = tolevo(*job.at(out), *job.again)
    assert again.exit_code == 0, (trial, again.output)
    assert same(job, out), trial


def same(job: Job, out: Path) -> bool:
    """Whether all files that do not depend on the clock are those of an unbroken result."""
    files = content(out)
    return all(files.get(name) == own for name, own in job.whole.items())


@pytest.mark.parametrize("name", NAMES)
def test_killed_at_some_moments(name: str, known: Known, tmp_path: Path) -> None:
    all_kills(name, known[name], tmp_path, TRIALS)


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", [*QUICK, *LONG])
def test_killed_at_fifty_moments(name: str, known: Known, tmp_path: Path) -> None:
    all_kills(name, known[name], tmp_path, 50)


CLOCK = """
import itertools, time
_real, _fall = time.time, itertools.count()
time.time = lambda: _real() - 3600.0 * next(_fall)
"""
CONDITIONS = {
    "clock set back": CLOCK,
    "one core": "os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})",
    "LANG=C": "import locale; os.environ['LC_ALL'] = os.environ['LANG'] = 'C'; locale.setlocale(locale.LC_ALL, 'C')",
    "no terminal": "os.setsid()",
}


@pytest.mark.parametrize("name", NAMES)
def test_clock_core_and_language_change_nothing(name: str, known: Known, tmp_path: Path) -> None:
    """All at once: an hour back at every look at the clock, one core, LANG=C, no terminal."""
    job, out = known[name], tmp_path / "out"
    if job.file:
        out.mkdir()
    process = start(job.at(out), tmp_path / "s", "\n".join(CONDITIONS.values()))
    process.join()
    assert process.exitcode == 0, (tmp_path / "s.err").read_text()
    assert same(job, out)


@pytest.mark.parametrize("name", NAMES)
def test_a_directory_that_may_not_be_written(name: str, known: Known, tmp_path: Path) -> None:
    job, locked = known[name], tmp_path / "locked"
    locked.mkdir(mode=0o555)
    place = locked if job.file else locked / "out"
    process = start(job.at(place), tmp_path / "s", WITHOUT_PRIVILEGES)
    process.join()
    errors = (tmp_path / "s.err").read_text()
    assert process.exitcode in (1, 2), errors
    assert "Traceback" not in errors
    assert "locked" in errors
    assert not list(locked.iterdir())
