"""A study design of one's own, as docs/plugins.md writes it, is installed, checked and run."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import tolevo
from tolevo.testing import DesignContract

pytestmark = [pytest.mark.source_tree, pytest.mark.usefixtures("unrendered")]
PAGE = Path(__file__).parents[3] / "docs" / "plugins.md"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    section = PAGE.read_text(encoding="utf-8").split("## A study design")[1]
    block = re.findall(r"```python[^\n]*\n(.*?)```", section, re.DOTALL)[0]
    head = "from dataclasses import dataclass, field\nfrom tolevo import plugins as own\n"
    (tmp_path / "own_halton.py").write_text(head + block, encoding="utf-8")
    info = tmp_path / "own_halton-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own-halton\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[tolevo.designs]\nhalton = own_halton:Halton\n")
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("installed")
def test_it_keeps_the_contract() -> None:
    from own_halton import Halton  # type: ignore[import-not-found]

    class Kept(DesignContract):
        design = Halton(32)

    contract = Kept()
    tests = [name for name in dir(contract) if name.startswith("test_")]
    assert len(tests) == 5
    for name in tests:
        getattr(contract, name)()
    del sys.modules["own_halton"]


@pytest.mark.usefixtures("installed")
def test_a_study_runs_with_it() -> None:
    found = tolevo.study({
        "run": {"problem": "pymoo.problems.multi:ZDT1", "algorithm": {"generations": 2}},
        "seeds": 2,
        "response": "hypervolume",
        "design": {"kind": "halton", "samples": 8},
        "vary": {"algorithm.population": {"low": 8, "high": 16, "integer": True}},
    })  # fmt: skip
    assert found.status == "done"
    assert found.record is not None
    assert len(found.record.table) == 16
    del sys.modules["own_halton"]
