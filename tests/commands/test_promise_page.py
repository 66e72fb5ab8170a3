"""The worked example of docs/promise.md: a promise, its drawing, and what production says of it."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tolevo.cli import app

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "promise.md"
pytestmark = pytest.mark.source_tree


def test_the_commands_of_the_page_say_what_it_says(tmp_path: Path) -> None:
    text = PAGE.read_text(encoding="utf-8")
    commands = [shlex.split(line)[1:] for line in text.splitlines() if line.startswith("tolevo ")]
    assert [words[0] for words in commands] == ["run", "review"]
    said = []
    for words in commands:
        places = {"docs/": ROOT, "runs/": tmp_path}
        moved = [str(places[one[:5]] / one) if one[:5] in places else one for one in words]
        done = CliRunner().invoke(app, moved)
        assert done.exit_code == 0, done.output
        said.append(done.output)
    promised = next(line for line in said[0].splitlines() if line.startswith("Promised: "))
    assert f'"{promised}"' in " ".join(text.split())
    for file in ("promise.csv", "next_parts.csv", "capability.csv"):
        assert (tmp_path / "runs" / "promise" / file).is_file()
    assert "tighten" in said[1]
    assert "loosen" in said[1]
