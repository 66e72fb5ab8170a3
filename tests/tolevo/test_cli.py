"""The command line: exit statuses, what goes where, and that faults write nothing."""

import json
import os
import signal
import subprocess
import sys
import time
import tomllib
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.small_jobs import tolevo
from tolevo.algorithms.run import Progress
from tolevo.cli import describe, fraction
from tolevo.errors import RunError

CONFIG = """
problem = "rv_backlash"
[limits]
interference_probability = 0.05
[algorithm]
name = "nsga2"
population = 8
generations = 2
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "c.toml"
    path.write_text(CONFIG, encoding="utf-8")
    return path


def fake_run(monkeypatch: pytest.MonkeyPatch, status: str) -> list[Any]:
    plans: list[Any] = []

    def run(plan: Any, out: Path, workers: int, progress: Any, resume: bool, overwrite: bool) -> Any:
        plans.append(SimpleNamespace(plan=plan, workers=workers, progress=progress, resume=resume))
        if progress is not None:
            progress(Progress(1, 2, 8, None, 0.5, 0.5, 0.25, 1.0))
        out.mkdir(parents=True, exist_ok=True)
        (out / "report.html").write_text("page", encoding="utf-8")
        return SimpleNamespace(status=status, lines=("a summary",), result=None)

    monkeypatch.setattr("tolevo.commands.run.run.run", run)
    return plans


@pytest.mark.parametrize(("status", "code"), [("done", 0), ("no_feasible_point", 1), ("interrupted", 130)])
def test_run_returns_what_became_of_it(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: str, code: int
) -> None:
    calls = fake_run(monkeypatch, status)
    result = tolevo("run", config, "--out", tmp_path / "o", "--workers", 2, "--set", "seed=7")
    assert result.exit_code == code
    assert result.stdout.splitlines()[-1] == f"page: {tmp_path / 'o' / 'report.html'}"
    assert "generation 1/2, evaluations 8, hypervolume 0.2500, 0 s left" in result.stderr
    assert calls[0].plan.seed == 7
    assert calls[0].workers.workers == 2
    assert tomllib.loads(calls[0].plan.configuration)["seed"] == 7


def test_quiet_keeps_stderr_empty(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = fake_run(monkeypatch, "done")
    result = tolevo("run", config, "--out", tmp_path / "o", "--quiet")
    assert (result.exit_code, result.stderr) == (0, "")
    assert calls[0].progress is None


def test_a_run_that_fails_or_is_interrupted(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for error, code in ((RunError("lost"), 1), (KeyboardInterrupt(), 130), (OSError("full"), 1)):

        def run(*_: object, error: BaseException = error) -> None:
            raise error

        monkeypatch.setattr("tolevo.commands.run.run.run", run)
        result = tolevo("run", config, "--out", tmp_path / "o")
        assert result.exit_code == code
        assert "Traceback" not in result.output


def test_every_fault_is_on_its_own_line_and_nothing_is_written(config: Path, tmp_path: Path) -> None:
    full = tmp_path / "full"
    full.mkdir()
    (full / "kept.txt").write_text("kept", encoding="utf-8")
    bad = ("--set", "algorithm.mutation.probability=1.3", "--set", "sed=1")
    result = tolevo("run", config, "--out", full, "--workers", 0, *bad)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.splitlines() == [
        "algorithm.mutation.probability: must lie in [0, 1], got 1.3",
        "sed: is not a known key (did you mean `seed`?)",
        f"--out: {full} is not empty; name another directory, or add --overwrite or --resume",
        "--workers: must be at least 1, got 0",
    ]
    assert [path.name for path in full.iterdir()] == ["kept.txt"]


def test_overwrite_accepts_a_directory_that_is_not_empty(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_run(monkeypatch, "done")
    assert tolevo("run", config, "--out", tmp_path, "--overwrite").exit_code == 0


def test_an_output_below_a_file_is_refused(config: Path) -> None:
    result = tolevo("run", config, "--out", config / "o")
    assert result.exit_code == 2
    assert result.stderr.startswith("--out: cannot be written")


def test_an_impossible_limit_is_found_before_the_run(config: Path, tmp_path: Path) -> None:
    limit = ("--set", "limits.backlash_arcmin=0.001")
    result = tolevo("run", config, "--out", tmp_path / "o", *limit)
    assert result.exit_code == 2
    assert result.stderr.startswith("limits.backlash_arcmin: ")
    assert not (tmp_path / "o").exists()


def test_a_model_alone_cannot_be_run(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text('model = "rv_batch"\n', encoding="utf-8")
    result = tolevo("run", path, "--out", tmp_path / "o")
    assert result.exit_code == 2
    assert result.stderr == "problem: is missing: a model alone can only be simulated\n"


def test_check_prints_a_configuration_that_checks_the_same(config: Path, tmp_path: Path) -> None:
    once = tolevo("check", config)
    assert once.exit_code == 0
    path = tmp_path / "resolved.toml"
    path.write_text(once.stdout, encoding="utf-8")
    again = tolevo("check", path)
    assert tomllib.loads(again.stdout) == tomllib.loads(once.stdout)


def test_check_says_what_each_variable_is(config: Path) -> None:
    text = tolevo("check", config, "--set", "variables.stagger_arcmin.value=0.1").stdout
    assert "# Assumptions" in text
    assert "crank_bearing_um: 0.5 to 20 um; full clearance c of the zone [0, c]" in text
    assert "stagger_arcmin: fixed at 0.1 arcmin; nominal value" in text
    assert "half-width t of the zone mid +- t" in text
    assert "# Warnings" not in text


@pytest.mark.parametrize("name", ["rv40e_backlash", "rv40e_least_cost"])
def test_shipped_configurations_are_valid(name: str) -> None:
    from importlib.resources import files

    result = tolevo("check", files("tolevo.configs") / f"{name}.toml")
    assert (result.exit_code, result.stderr) == (0, "")


@pytest.mark.parametrize("command", ["evaluate", "simulate"])
def test_files_that_cannot_be_read_or_written(config: Path, tmp_path: Path, command: str) -> None:
    missing = tmp_path / "none.csv"
    result = tolevo(command, config, missing, "--out", tmp_path / "no" / "o.csv", "--set", "sed=1")
    assert result.exit_code == 2
    assert result.stderr.splitlines() == [
        "sed: is not a known key (did you mean `seed`?)",
        f"--out: the directory {tmp_path / 'no'} does not exist",
        f"{missing}: does not exist",
    ]
    result = tolevo(command, config, config, "--out", config)
    assert "would replace its own input" in result.stderr


def test_only_tables_that_can_be_written(config: Path, tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("unit\n1\n", encoding="utf-8")
    out = tmp_path / "o.xlsx"
    result = tolevo("simulate", config, tmp_path / "u.csv", "--out", out)
    assert result.exit_code == 2
    assert "--out: o.xlsx is neither .csv nor .parquet" in result.stderr
    assert not out.exists()


def test_warnings_of_a_model_are_lines(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text('model = "rv_lost_motion"\n', encoding="utf-8")
    (tmp_path / "t.csv").write_text("torque_Nm\n5000\n", encoding="utf-8")
    words = ["simulate", str(tmp_path / "m.toml"), str(tmp_path / "t.csv"), "--quiet", "--out"]
    command = [sys.executable, "-m", "tolevo", *words, str(tmp_path / "o.csv")]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stderr.splitlines() == ["warning: torque 5000 N m is beyond the momentary torque 2058 N m"]


def test_list_names_what_is_installed() -> None:
    groups = json.loads(tolevo("list", "--json").stdout)
    assert "rv_backlash" in json.dumps(groups)
    names = [one["name"] for one in groups["elementary_errors"]]
    assert len(names) == 63 and "rod_length_1a_um" in names
    assert "nsga2" in tolevo("list").stdout
    assert "arm_length_1_um  length of the arm [manipulator]" in tolevo("list").stdout


def test_progress_without_a_budget() -> None:
    open_end = Progress(3, None, 24, None, 1.0, None, 0.5, 1.0)
    assert fraction(open_end) is None
    assert describe(open_end) == "generation 3, evaluations 24, hypervolume 0.5000"
    assert fraction(Progress(3, None, 24, None, 1.0, 3.0, 0.5, 1.0)) == 0.25
    assert fraction(Progress(3, 4, 24, 100, 1.0, None, 0.5, 1.0)) == 0.75


def test_a_polite_kill_ends_like_an_interrupt(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "o"
    command = [sys.executable, "-m", "tolevo", "run", str(config), "--out", str(out)]
    command += ["--set", "algorithm.generations=100000", "--set", "references=none"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, env=os.environ.copy()) as process:
        assert process.stderr is not None
        process.stderr.readline()  # the first progress line: the search is under way
        time.sleep(0.5)
        process.send_signal(signal.SIGTERM)
        errors = process.stderr.read().decode()
    assert process.returncode == 130, errors
    assert "Traceback" not in errors


def cpu_of(process: int) -> float:
    """CPU seconds of a process."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="CPU time of a process is read from /proc")
@pytest.mark.parametrize("moment", [0.1, 0.4, 1.0, 1.6])
def test_an_interrupt_at_any_moment_ends_a_command_with_one_line(config: Path, tmp_path: Path, moment: float) -> None:
    """Also while libraries are loaded and before anything is written, with a process for side searches."""
    command = [sys.executable, "-m", "tolevo", "run", str(config), "--out", str(tmp_path / "o"), "--quiet"]
    command += ["--set", "algorithm.generations=100000", "--set", "references=none", "--workers", "2"]
    hears = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(command, stderr=subprocess.PIPE, start_new_session=True, preexec_fn=hears) as process:
        while (used := cpu_of(process.pid)) < moment:
            time.sleep(0.005)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        assert process.stderr is not None
        errors = process.stderr.read().decode()
        _, status, resources = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 130
    assert errors.startswith("interrupted: ")
    assert len(errors.splitlines()) == 1
    assert resources.ru_utime + resources.ru_stime - used < 2.0


WRITING = """
import os, signal
from tolevo.interrupts import listen
interrupts = listen()
interrupts.keeps(lambda: "kept")
with interrupts.writing(lambda: print("saved", flush=True)):
    os.kill(os.getpid(), signal.SIGINT)
    print("written", flush=True)
    {more}
print("ended", interrupts.requested, flush=True)
"""


@pytest.mark.parametrize(
    ("more", "lines", "status"),
    [
        ("", ["saved", "written", "ended False"], 0),
        ("os.kill(os.getpid(), signal.SIGINT)", ["saved", "written"], 130),
        ("while True: pass", ["saved", "written"], 130),
    ],
)
def test_an_interrupt_lets_the_files_of_a_complete_result_be_written(more: str, lines: list[str], status: int) -> None:
    """The first one alone, and for a limited time."""
    code = WRITING.format(more=more)
    hears = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, preexec_fn=hears, timeout=60)
    assert (done.stdout.splitlines(), done.returncode) == (lines, status)


LATE = """
import os, sys
sys.argv = ["tolevo", "list"]
from tolevo.__main__ import main
class Late:
    def __del__(self, kill=os.kill, own=os.getpid(), write=os.write):
        write(2, b"late")
        kill(own, {number:d})
late = Late()
main()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_command_that_has_ended_is_not_interrupted(number: signal.Signals) -> None:
    """While the interpreter ends it would restore what a signal does by default, and end by it."""
    ended = subprocess.run([sys.executable, "-c", LATE.format(number=number)], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "late")
