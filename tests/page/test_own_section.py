"""Sections of the page by plugins: that of docs/plugins.md, and one that fails."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tolevo.page.page import page
from tolevo.records import SECTIONS
from tolevo.testing import PageContract, example

PAGE = Path(__file__).parents[2] / "docs" / "plugins.md"
CONTRACT = [name for name in dir(PageContract) if name.startswith("test_")]
BROKEN = """

class Broken(own.PageSection):
    title = "Broken"

    def body(self, result):
        return result.front["<nonsense>"]
"""
ENTRIES = "[tolevo.pages]\nextremes = own_pages:Extremes\nbroken = own_pages:Broken\n"
pytestmark = [pytest.mark.source_tree, pytest.mark.usefixtures("installed")]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    section = PAGE.read_text(encoding="utf-8").split("## A section of the page")[1]
    block = re.findall(r"```python[^\n]*\n(.*?)```", section, re.DOTALL)[0]
    text = "from tolevo import plugins as own\n\n\n" + block + BROKEN
    (tmp_path / "own_pages.py").write_text(text, encoding="utf-8")
    info = tmp_path / "own_pages-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own-pages\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRIES)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("own_pages", None)


@pytest.mark.parametrize("test", CONTRACT)
def test_that_of_the_page_keeps_the_contract(test: str) -> None:
    class Kept(PageContract):
        section_type = SECTIONS["extremes"]

    getattr(Kept(), test)()


def test_the_page_has_it_and_names_the_one_that_fails() -> None:
    text = page(example())
    assert "<h2>Cheapest and dearest point</h2>" in text
    assert "The costs of the front lie between" in text
    assert "The section &quot;broken&quot; of own-pages 1.0 is omitted: KeyError" in text
    assert "<nonsense>" not in text
    assert "<h2>Configuration</h2>" in text
