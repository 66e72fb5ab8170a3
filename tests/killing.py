"""Small jobs of every command, run as whole processes that are killed at a seeded moment.

A process that is forked from one with the libraries runs the command. A signal kills it after
some CPU time, or before it moves or removes its n-th file: the writing takes a few percent of the
time of a command, and is where a kill does harm.
"""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing.process import BaseProcess
from pathlib import Path

import numpy as np
import pandas as pd

from tests.small_jobs import CLAIMS as ONE_CLAIM
from tests.small_jobs import GAP, STACK, tolevo

SECRETS = {"manifest.json", "unfinished.json", "checkpoint.npz"}
"""Files with the names of processes, of computers or the time of day in them."""
COMMAND = """
import os, sys, time
sys.stderr, sys.stdout = (open(name, "w") for name in {streams!r})
sys.argv = ["tolevo", *{words!r}]
{before}
from tolevo.cli import main
leave = os._exit
def ended(status=0):
    open({cpu!r}, "w").write(str(time.process_time()))
    leave(status)
os._exit = ended  # an interrupted command ends so
try:
    main()
finally:
    open({cpu!r}, "w").write(str(time.process_time()))
"""
AT_TIME = """
import signal
signal.signal(signal.SIGPROF, lambda *_: os.kill(os.getpid(), {number}))
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.setitimer(signal.ITIMER_PROF, {after})
"""
AT_STEP = """
import pathlib, signal
left = {step}
signal.signal(signal.SIGINT, signal.default_int_handler)
def counted(action):
    def acted(*arguments, **more):
        global left
        left -= 1
        open({count!r}, "w").write(str({step} - left))
        if left == -1:
            os.kill(os.getpid(), {number})
        return action(*arguments, **more)
    return acted
os.replace = counted(os.replace)
pathlib.Path.unlink = counted(pathlib.Path.unlink)
"""
STUDY = """
run = "run.toml"
seeds = 6
response = ["hypervolume"]
[design]
kind = "factorial"
[vary]
"algorithm.population" = [8, 10]
"""
CLAIMS = (
    ONE_CLAIM
    + """
[[claim]]
id = "k2"
place = "page 2"
quantity = "k2"
printed = "0.5"
unit = "1"
[[claim.reading]]
formula = "32 / 64"
"""
)


@dataclass
class Job:
    """A command by the words before and after `--out PATH`, and how it goes on after a kill.

    `whole` are the files of a complete result in which nothing depends on the clock.
    """

    words: tuple[object, ...]
    more: tuple[object, ...] = ("--quiet", "--workers", 1)
    again: tuple[object, ...] = ("--resume",)
    file: str = ""
    whole: dict[str, bytes] = field(default_factory=dict)
    seconds: float = 0.0
    steps: int = 0

    def at(self, out: Path) -> tuple[object, ...]:
        """The words of the command with that result."""
        return (*self.words, "--out", out / self.file if self.file else out, *self.more)

    def measure(self, folder: Path) -> None:
        """Run it twice: what is the same in both is what a resumed result must have."""
        found = []
        for at in range(2):
            out = folder / f"whole{at}"
            (out if self.file else folder).mkdir(exist_ok=True)
            count = folder / "count"
            before = AT_STEP.format(step=10**9, count=str(count), number=0)
            process = start(self.at(out), folder / "whole", before)
            process.join()
            assert process.exitcode == 0, (folder / "whole.err").read_text()
            found.append(content(out))
            self.steps = int(count.read_text()) if count.exists() else 0
            self.seconds = float((folder / "whole.cpu").read_text())
        self.whole = {
            name: own for name, own in found[0].items()
            if found[1].get(name) == own and name not in SECRETS
        }  # fmt: skip
        assert self.whole, self.words


def content(out: Path) -> dict[str, bytes]:
    """All files of a result by their path in it."""
    return {str(path.relative_to(out)): path.read_bytes()
            for path in sorted(out.rglob("*")) if path.is_file()}  # fmt: skip


def start(words: Sequence[object], streams: Path, before: str = "") -> BaseProcess:
    """A command in a process that has the libraries already."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tolevo.cli", "tolevo.commands.run.run",
                                    "tolevo.problems.stack", "pandas"])  # fmt: skip
    names = [f"{streams}.err", f"{streams}.out"]
    text = COMMAND.format(words=[str(word) for word in words], streams=names, before=before, cpu=f"{streams}.cpu")
    process = context.Process(target=exec, args=(text, {"__name__": "command"}))
    process.start()
    return process


def jobs(folder: Path) -> dict[str, Job]:
    """A short job of every command that writes, with its inputs in `folder`."""
    texts = {"run.toml": STACK, "study.toml": STUDY, "gap.toml": GAP,
             "claims.toml": CLAIMS}  # fmt: skip
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    rng = np.random.default_rng(0)
    torque = rng.uniform(-400.0, 400.0, 90)
    measured = 0.25 * torque + rng.normal(0.0, 2.0, 90)
    pd.DataFrame({"torque": torque, "te": measured, "te_predicted": 0.2 * torque}).to_csv(
        folder / "data.csv", index=False
    )
    text = tolevo("template", "designs", "--config", folder / "run.toml").stdout
    (folder / "designs.csv").write_text(text + text.partition("\n")[2] * 60, encoding="utf-8")
    done = tolevo("run", folder / "run.toml", "--out", folder / "result", "--quiet",
                  "--workers", 1)  # fmt: skip
    assert done.exit_code == 0, done.output
    plain = {"more": (), "again": (), "file": "page.html"}
    return {
        "run": Job(("run", folder / "run.toml")),
        "gap": Job(("gap", folder / "gap.toml", folder / "data.csv")),
        "study": Job(("study", folder / "study.toml")),
        "reproduce": Job(("reproduce", folder / "claims.toml")),
        "evaluate": Job(("evaluate", folder / "run.toml", folder / "designs.csv"),
                        ("--quiet", "--block-rows", 16), file="o.csv"),
        "report": Job(("report", folder / "result"), **plain),  # type: ignore[arg-type]
        "template": Job(("template", "designs", "--config", folder / "run.toml"), (), (),
                        "t.csv"),
    }  # fmt: skip


SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


@dataclass(frozen=True)
class End:
    """How a killed command ended: exit status or signal, and its CPU seconds after the signal."""

    code: int
    after: float
    errors: str


def killed(job: Job, out: Path, streams: Path, number: signal.Signals, share: float, writing: bool) -> End:
    """Kill a job at a share of its CPU time, or of the files that it moves or removes."""
    moment = share * job.seconds
    if writing:
        step = int(share * job.steps)
        before = AT_STEP.format(step=step, count=f"{streams}.n", number=int(number))
    else:
        before = AT_TIME.format(number=int(number), after=max(moment, 1e-3))
    cpu = Path(f"{streams}.cpu")
    cpu.unlink(missing_ok=True)
    process = start(job.at(out), streams, before)
    process.join(120.0)
    assert process.exitcode is not None, "it waits for something"
    after = float(cpu.read_text()) - moment if cpu.exists() and not writing else 0.0
    return End(process.exitcode, after, Path(f"{streams}.err").read_text(encoding="utf-8"))


def waited(ready: Callable[[], bool], seconds: float = 60.0) -> None:
    """Wait until something holds."""
    until = time.monotonic() + seconds
    while not ready():
        assert time.monotonic() < until
        time.sleep(0.005)


WITHOUT_PRIVILEGES = """
import ctypes
head, nothing = (ctypes.c_uint32 * 2)(0x20080522, 0), (ctypes.c_uint32 * 6)()
assert ctypes.CDLL(None).capset(head, nothing) == 0
"""
"""For the superuser too, who may write everywhere, permissions of files hold (Linux)."""
