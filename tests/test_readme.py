"""The README does what it says: its mechanism, its Python, its configurations."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import tolevo

ROOT = Path(__file__).resolve().parent.parent
pytestmark = pytest.mark.source_tree


def blocks(kind: str) -> list[str]:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.findall(rf"```{kind}[^\n]*\n(.*?)```", text, re.DOTALL)


def test_the_mechanism_of_the_readme_comes_out_as_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (written,), (code,) = blocks("toml"), blocks("python")
    lines = len([line for line in written.splitlines() if line.strip()])
    assert f"in {lines} lines" in text
    (tmp_path / "end_play.toml").write_text(written, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(code, names)
    result = names["result"]
    assert isinstance(result, tolevo.Run)
    assert result.allocation is not None
    cost, said = result.front["cost"].iloc[0], re.search(r"least cost is ([\d.]+) EUR", text)
    assert said is not None
    assert f"{cost:.2f}" == said[1]
    assert 0.0 <= result.front["gap_percent"].iloc[0] <= 0.03
    assert "percent binds: loosening it by 0.027 percent would save about" in (
        result.summary["answers"]["limits"])  # fmt: skip
    notations = result.allocation.set_index("variable")["notation"]
    for part in ("housing", "shaft", "spacer"):
        assert str(notations[f"{part}_t"]).partition(" (")[0].removesuffix(" mm") in text


def test_every_configuration_that_the_readme_names_is_shipped() -> None:
    commands = "\n".join(blocks("console"))
    named = re.findall(r"(configs/\w+\.toml|docs/\S+)", commands)
    assert len(named) >= 6
    assert [name for name in named if not (ROOT / name).exists()] == []
