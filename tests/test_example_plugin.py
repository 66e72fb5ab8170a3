"""The example plugin, installed apart: its contracts, its run, its effect in measured data."""

from __future__ import annotations

import ast
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
def test_the_page_shows_the_whole_example_and_it_is_short() -> None:
    module = (EXAMPLE / "tolevo_planetary.py").read_text(encoding="utf-8")
    metadata = (EXAMPLE / "pyproject.toml").read_text(encoding="utf-8")
    assert len(module.splitlines()) + len(metadata.splitlines()) <= LINES
    shown = re.findall(
        r'^--8<-- "docs/example_plugin/(.*):(\d+):(\d+)"$', (DOCS / "plugins.md").read_text("utf-8"), re.M
    )
    quoted = [(name, (EXAMPLE / name).read_text(encoding="utf-8").splitlines()[int(first) - 1 : int(last)])
              for name, first, last in shown]  # fmt: skip
    classes = [node.name for name, lines in quoted if name == "tolevo_planetary.py"
               for node in ast.parse("\n".join(lines)).body if isinstance(node, ast.ClassDef)]  # fmt: skip
    assert classes == re.findall(r"^class (\w+)", module, re.M)
    entries = ["\n".join(lines) for name, lines in quoted if name == "pyproject.toml"]
    assert [metadata.partition('tolevo_planetary"]\n\n')[2].strip()] == entries
    tests = ["\n".join(lines) for name, lines in quoted if name == "test_planetary.py"]
    assert [text.strip().partition("(")[0] for text in tests] == ["class TestStage", "class TestCurve"]
    assert all(lines[-1].strip() for _, lines in quoted)
