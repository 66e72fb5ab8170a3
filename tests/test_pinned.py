"""The key figures of every model and example are those of the newest file in tests/pinned/."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

pytest.importorskip("tools.pin", reason="the tools are not shipped")
pytestmark = pytest.mark.source_tree

from tools.pin import ROOT, Figures, computed, moved, newest  # noqa: E402


def stored(path: Path) -> tuple[Figures, dict[str, list[float]]]:
    found = tomllib.loads(path.read_text("utf-8"))
    return found["figures"], found.get("moved", {})


def test_no_figure_moves_unseen() -> None:
    old, new = stored(newest())[0], computed()
    text = "\n".join(f"{name}: {a:.10g} -> {b:.10g}" for name, (a, b) in moved(old, new).items())
    assert not text, f"run `python -m tools.pin`, and say why in CHANGELOG.md:\n{text}"
    assert {call: set(values) for call, values in old.items()} == {call: set(values) for call, values in new.items()}, (
        "figures were added or have gone: run `python -m tools.pin`"
    )


def test_the_reason_of_what_moved_is_in_the_changelog() -> None:
    """In the newest section: the name of the figure and of what it belongs to."""
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    newest_section = re.split(r"^## ", text, flags=re.MULTILINE)[1]
    for name in stored(newest())[1]:
        figure = name.rpartition(": ")[2].partition("[")[0]
        assert f"`{figure}`" in newest_section, f"{name} moved: say why in CHANGELOG.md"


def test_a_moved_figure_is_seen() -> None:
    old = {"call": {"cost": 2.0, "gone": 1.0, "same": 3.0}}
    new = {"call": {"cost": 2.0001, "same": 3.0 * (1.0 + 1e-8)}, "other": {"cost": 1.0}}
    assert moved(old, new) == {"call: cost": [2.0, 2.0001]}
