"""The example plugin, installed apart: its contracts, its run, its effect in measured data."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parent.parent / "docs"
EXAMPLE = DOCS / "example_plugin"
LINES = 120
"""A plugin of five kinds is no longer than this, its metadata included."""


@pytest.mark.source_tree
def test_the_example_is_installed_and_keeps_its_contracts(tmp_path: Path) -> None:
    source, site = tmp_path / "source", tmp_path / "site"
    shutil.copytree(EXAMPLE, source)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--no-build-isolation", "--target", site, source], check=True)
    given = {**os.environ, "PYTHONPATH": str(site)}
    pytest_ = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    done = subprocess.run([*pytest_, "test_planetary.py"], cwd=source, env=given, check=False,
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"3[4-9] passed", done.stdout), done.stdout


@pytest.mark.source_tree
def test_the_page_quotes_the_example_and_is_short() -> None:
    module = (EXAMPLE / "tolevo_planetary.py").read_text(encoding="utf-8")
    metadata = (EXAMPLE / "pyproject.toml").read_text(encoding="utf-8")
    tests = (EXAMPLE / "test_planetary.py").read_text(encoding="utf-8")
    assert len(module.splitlines()) + len(metadata.splitlines()) <= LINES
    text = (DOCS / "plugins.md").read_text(encoding="utf-8")
    beside = r"## A study design.*?\n## Contracts"  # designs, rules and sections: tested apart
    text = re.sub(beside, "## Contracts", text, flags=re.DOTALL)
    sources = {"python": module + tests, "toml": metadata}
    blocks = re.findall(r"```(\w+)[^\n]*\n(.*?)```", text, re.DOTALL)
    parts = [(kind, part) for kind, block in blocks if kind in sources
             for part in re.split(r"\n\n\n", block.strip())]  # fmt: skip
    quoted = [(kind, part) for kind, part in parts if not part.startswith(("from", "import"))]
    assert len(quoted) == 9
    assert [part for kind, part in quoted if part not in sources[kind]] == []
