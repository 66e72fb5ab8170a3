"""`run --resume`: a broken run ends as an unbroken one, and what it refuses."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner, Result

import tolevo
from tests.small_jobs import PART_A, PART_B, REQUIREMENT, written
from tolevo.algorithms.checkpoint import Checkpoint
from tolevo.algorithms.exact import choices
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.search import SearchResult, search
from tolevo.algorithms.settings import Budget
from tolevo.cli import app
from tolevo.commands.run.front import CHECKPOINT
from tolevo.commands.run.references import SideSearch, documents, side_searches
from tolevo.commands.run.run import Sides
from tolevo.journal import Section, recording_steps
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.stack import Stack
from tolevo.section import differences

pytestmark = pytest.mark.usefixtures("unrendered")

SEARCH = """
seed = 4
[algorithm]
name = "nsga2"
population = 20
generations = 12
"""
CONFIG = f"""
problem = "stack"
references = "none"
{SEARCH}
{REQUIREMENT}{PART_A}{PART_B}"""
DRIVE = f"""
problem = "rv_backlash"
references = "none"
{SEARCH}
[variables]
dr_rp_mm = {{ low = -0.05, high = -0.03 }}
dr_p_mm = {{ low = -0.09, high = -0.06 }}
[limits]
interference_probability = 0.5
[propagation]
method = "moments"
"""
"""A problem with allocations of the documents, and so with searches beside its own."""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = written(tmp_path / "c.toml", CONFIG)
    return path


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    path = written(tmp_path / "d.toml", DRIVE)
    return path


def run(config: Path, out: Path, *arguments: object) -> Result:
    command = ["run", config, "--out", out, "--quiet", "--workers", 1, *arguments]
    return CliRunner().invoke(app, [str(argument) for argument in command])


def command_of(config: Path, out: Path, *arguments: object) -> list[str]:
    words = [sys.executable, "-m", "tolevo", "run", config, "--out", out, "--quiet", *arguments]
    return [str(word) for word in words]


def killed(config: Path, out: Path, *arguments: object) -> None:
    """Start a run and kill it, without a warning, after its first generations were saved."""
    checkpoint = out / CHECKPOINT
    with subprocess.Popen(command_of(config, out, *arguments), env=os.environ.copy()) as process:
        until = time.monotonic() + 30.0
        while process.poll() is None and time.monotonic() < until:
            if checkpoint.exists() and Checkpoint.read(checkpoint).saved() is not None:
                state = Checkpoint.read(checkpoint).saved() or {}
                if len(state["run.history"]) > 1:
                    break
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL


def test_a_killed_run_resumes_to_the_same_front(config: Path, tmp_path: Path) -> None:
    """Killed after a state was saved; resumed with the budget of the whole run."""
    size = ("--set", "algorithm.population=40")
    endless = ("--set", "algorithm.generations=1000000")
    killed(config, tmp_path / "broken", *size, *endless)
    state = Checkpoint.read(tmp_path / "broken" / CHECKPOINT).saved() or {}
    budget = ("--set", f"algorithm.generations={len(state['run.history']) + 5}")
    again = run(config, tmp_path / "broken", *size, *budget, "--resume")
    assert again.exit_code == 0, again.output
    assert run(config, tmp_path / "whole", *size, *budget).exit_code == 0
    fronts = [(tmp_path / name / "front.csv").read_bytes() for name in ("broken", "whole")]
    assert fronts[0] == fronts[1]
    seconds = pd.read_csv(tmp_path / "broken" / "convergence.csv")["seconds"]
    assert seconds.is_monotonic_increasing


@pytest.mark.parametrize("engine", ["pymoo", "array"])
def test_a_larger_budget_goes_on(config: Path, tmp_path: Path, engine: str) -> None:
    how = ("--set", f"algorithm.engine={engine}")
    more = (*how, "--set", "algorithm.generations=20")
    out = tmp_path / "o"
    assert run(config, out, *how).exit_code == 0
    assert run(config, out, *more, "--resume").exit_code == 0
    assert run(config, tmp_path / "whole", *more).exit_code == 0
    for name in ("front.csv", "config.toml"):
        assert (out / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert json.loads((out / "summary.json").read_text())["evaluations"] == 400
    before = (out / "front.csv").read_bytes()
    assert run(config, out, *more, "--resume").exit_code == 0  # there is nothing left to do
    assert (out / "front.csv").read_bytes() == before


def test_another_run_is_not_resumed(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "o"
    assert run(config, out).exit_code == 0
    files = {path.name: path.stat().st_mtime_ns for path in out.iterdir()}
    other = ("--set", "seed=5", "--set", "algorithm.population=21")
    found = run(config, out, *other, "--set", "algorithm.generations=3", "--resume")
    assert found.exit_code == 2
    assert found.stderr.splitlines() == [
        "seed: is 5, but the run to resume has 4: only the budget may differ; undo the change, or "
        "start again with --overwrite",
        "algorithm.population: is 21, but the run to resume has 20: only the budget may differ; "
        "undo the change, or start again with --overwrite",
        "algorithm.generations: is 3, but the run to resume has already used 12: a budget may only grow",
    ]
    assert {path.name: path.stat().st_mtime_ns for path in out.iterdir()} == files


def test_what_cannot_be_resumed(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "o"
    out.mkdir()
    (out / "other.txt").write_text("kept", encoding="utf-8")
    found = run(config, out, "--resume")
    assert found.exit_code == 2
    assert found.stderr.startswith(f"--resume: {out} holds no checkpoint.npz")
    both = run(config, out, "--resume", "--overwrite")
    assert both.exit_code == 2
    assert both.stderr.startswith("--resume: continues what --overwrite would replace")
    (out / CHECKPOINT).write_bytes(b"broken")
    assert run(config, out, "--resume").exit_code == 2
    assert {path.name for path in out.iterdir()} == {"other.txt", CHECKPOINT}


def test_resume_of_nothing_is_a_start(config: Path, tmp_path: Path) -> None:
    assert run(config, tmp_path / "o", "--resume").exit_code == 0
    assert (tmp_path / "o" / "front.csv").is_file()


@pytest.mark.slow
def test_finished_side_searches_are_not_repeated(drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, references = tmp_path / "o", ("--set", "references=documents")
    assert run(drive, out, *references).exit_code == 0
    before = (out / "references.csv").read_bytes()

    def again(self: Any) -> None:
        raise AssertionError(f"{self.label} is searched again")

    monkeypatch.setattr("tolevo.commands.run.references.SideSearch.front", again)
    assert run(drive, out, *references, "--resume").exit_code == 0
    assert (out / "references.csv").read_bytes() == before
    monkeypatch.undo()
    more = (*references, "--set", "algorithm.generations=14")
    labels = set(Checkpoint.read(out / CHECKPOINT).tables)
    assert run(drive, out, *more, "--resume").exit_code == 0  # those with the old budget are
    kept = set(Checkpoint.read(out / CHECKPOINT).tables)
    assert len(kept) == len(labels) > len(kept & labels) == 1  # made anew, the GA's stays


ALTERNATIVES = """
problem = "stack"
seed = 1
[objectives]
minimise = ["cost", "gap.variation"]
[limits]
play.variation = 0.2
[[requirement]]
name = "gap"
unit = "mm"
formula = "a - b - c"
method = "worst_case"
[[requirement]]
name = "play"
unit = "mm"
formula = "a - b"
method = "rss"
[[part]]
name = "a"
nominal = 20.0
[[part.process]]
name = "turned"
t_min = 0.05
t_max = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.2 }
[[part.process]]
name = "ground"
t_min = 0.01
t_max = 0.06
cost = { model = "reciprocal", a = 4.0, b = 0.05 }
[[part]]
name = "b"
nominal = 15.0
t_min = 0.01
t_max = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.1 }
[[part]]
name = "c"
nominal = 4.0
t_min = 0.01
t_max = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.3 }
[algorithm]
name = "exact"
points = 8
"""


def test_exact_goes_on_from_what_it_has_solved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was solved before an interrupt is not solved again; there are points from the start."""
    solved: list[bytes] = []
    solve = choices._least_cost

    def counted(form: Any, limits: Any, near: Any) -> Any:
        solved.append(limits.tobytes())
        return solve(form, limits, near)

    def searched(section: Section, report: Any = None) -> SearchResult:
        assert problem is not None
        with recording_steps(section):
            return search(problem, Exact(points=8), Budget(), 0, report)

    monkeypatch.setattr(choices, "_least_cost", counted)
    monkeypatch.setattr("tolevo.journal.MIN_RECORDED_SECONDS", 0.0)  # however fast the processor is
    config = written(tmp_path / "c.toml", ALTERNATIVES)
    problem = tolevo.read(config).problem
    whole = searched(Section())
    count = len(solved)
    assert count > 20
    states: list[Any] = []

    def stop(state: Any) -> None:
        states.append(state)
        if len(states) == 9:
            raise KeyboardInterrupt

    section, stored = Section(), Section()
    cut = searched(section, stop)
    assert cut.interrupted
    assert len(cut.x) > 4
    stored.restore(section.state())
    again = searched(stored)
    assert len(solved) <= 2 * count + 1
    np.testing.assert_array_equal(again.chosen, whole.chosen)
    np.testing.assert_array_equal(again.f, whole.f)
    solved.clear()
    np.testing.assert_array_equal(searched(stored).chosen, whole.chosen)
    assert not solved


def test_a_changed_key_of_a_part_is_named_in_one_line(config: Path, tmp_path: Path) -> None:
    assert run(config, tmp_path / "o").exit_code == 0
    config.write_text(CONFIG.replace("b = 0.2 ", "b = 0.21 "), encoding="utf-8")
    refused = run(config, tmp_path / "o", "--resume")
    assert refused.exit_code == 2
    assert refused.stderr.splitlines() == [
        "part[1].cost.b: is 0.21, but the run to resume has 0.2: only the budget may differ; undo the change, or "
        "start again with --overwrite"
    ]


def test_last_digits_of_another_processor_are_no_change() -> None:
    """Ranges of a nested reducer are computed: a run may be resumed on another processor."""
    before = {"variables": {"a": {"low": 0.23226810667649536}}, "prices": [1.0, 2.5]}
    after = {"variables": {"a": {"low": 0.23226810667649528}}, "prices": [1.0, 2.5000000000000004]}
    assert differences(before, after) == {}
    assert list(differences(before, {**after, "prices": [1.0, 2.50001]})) == ["prices"]


def test_a_changed_model_is_not_resumed(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(config, tmp_path / "o").exit_code == 0
    sound = Stack._outputs
    monkeypatch.setattr(Stack, "_outputs", lambda *given: {name: 1.01 * value for name, value in sound(*given).items()})
    refused = run(config, tmp_path / "o", "--resume")
    assert refused.exit_code == 2
    assert refused.stderr.startswith("problem: gives other values than in the run to resume")


def test_the_ga_is_a_reference_where_it_is_asked_for(tmp_path: Path) -> None:
    """A stack has no published allocation, the drive has some."""
    for text, asked, count in ((ALTERNATIVES, "documents", 0), (ALTERNATIVES, "ga", 1), (DRIVE, "documents", 1)):
        config = written(tmp_path / "c.toml", text)
        plan = tolevo.read(config, [f"references={asked}"]).plan()
        searches = side_searches(plan, documents(plan.problem))
        assert sum("GA" in side.label for side in searches) == count


def _hears_interrupts() -> None:
    """A shell starts what it puts in the background with interrupts ignored, which is inherited."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_an_interrupt_is_prompt_and_says_how_to_go_on(drive: Path, tmp_path: Path) -> None:
    """Side searches in another process are ended, not waited for."""
    out, long = tmp_path / "o", ("--set", "algorithm.generations=1000000")
    references = ("--set", "references=documents", "--workers", 2)
    command = command_of(drive, out, *references, *long)
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, env=os.environ.copy(), preexec_fn=_hears_interrupts
    ) as process:
        try:
            until = time.monotonic() + 120.0
            while not (out / CHECKPOINT).exists() and time.monotonic() < until:
                time.sleep(0.05)
            time.sleep(2.0)  # the other process has begun
            start = time.monotonic()
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=60)
            taken = time.monotonic() - start
        finally:
            process.kill()
    assert process.returncode == 130
    assert "--resume" in errors.decode()
    assert "Traceback" not in errors.decode()
    assert taken < 20.0
    assert (out / "front.csv").is_file()


def test_side_searches_are_ended_not_waited_for(tmp_path: Path) -> None:
    endless = SideSearch("a", RvBacklash(), NSGA2(), Budget(generations=10**9), 0, relaxed=True)
    before = set(active_children())
    with Sides((endless,), 2, Checkpoint(tmp_path / CHECKPOINT, "")) as sides:
        until = time.monotonic() + 30.0
        while not (workers := set(active_children()) - before) and time.monotonic() < until:
            time.sleep(0.05)
        assert len(workers) == 1
        time.sleep(2.0)  # it has begun
        start = time.monotonic()
    assert time.monotonic() - start < 5.0
    assert not any(worker.is_alive() for worker in workers)
    assert sides.fronts() == {endless: None}


def test_overwrite_leaves_no_older_miss(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "o"
    hard = ("--set", "limits.variation=0.0224")  # the tightest parts give 0.02236
    assert run(config, out, *hard, "--set", "algorithm.generations=2").exit_code == 1
    assert (out / "nearest_miss.csv").is_file()
    assert run(config, out, "--overwrite").exit_code == 0
    assert not (out / "nearest_miss.csv").exists()
