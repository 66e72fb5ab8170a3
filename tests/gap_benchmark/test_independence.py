"""Records, scores and baselines are made where the project cannot be imported."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.source_tree
ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("tolevo", "models", "problems", "algorithms", "configs")
BLOCKED = f"""
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {ROOMS!r}:
            raise ImportError(f"{{name}} is out of reach")

sys.meta_path.insert(0, Blocked())
"""
EVERYTHING = """
from benchmarks.gap.generator.records import BENCH_GROUPS, record
from benchmarks.gap.namers.baselines import BASELINES
from benchmarks.gap.scoring.breakdown import misses, of_single
from benchmarks.gap.scoring.scorer import Scored, figures, verdict
from benchmarks.gap.scoring.told import told

asked = [record(group, 3) for group in BENCH_GROUPS]
told_of = [tuple(told(truth, each) for each in truth.hidden) for _, truth in asked]
for name, namer in BASELINES.items():
    said = [verdict(namer(one)) for one, _ in asked]
    found = [Scored(one[1], *rest) for one, *rest in zip(asked, told_of, said, strict=True)]
    assert any(one.count for one in figures(found))
    assert of_single(found) and misses(found)
    sys.stdout.write(name + chr(10))
"""
DOOR = "import benchmarks.gap.namers.workflow"


def without_the_project(code: str) -> subprocess.CompletedProcess[str]:
    where = dict(os.environ, PYTHONPATH=str(ROOT), OMP_NUM_THREADS="1")
    return subprocess.run(
        [sys.executable, "-c", BLOCKED + code],
        cwd=ROOT, env=where, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


def test_records_scores_and_baselines_need_nothing_of_it() -> None:
    done = without_the_project(EVERYTHING)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 5


def test_the_one_door_to_it_is_shut_there() -> None:
    """Otherwise the test above would show nothing."""
    done = without_the_project(DOOR)
    assert done.returncode != 0
    assert "tolevo is out of reach" in done.stderr
