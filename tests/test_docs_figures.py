"""Every figure of the pages that has a mark is the one that its run gives."""

from __future__ import annotations

import re

import pytest

pytest.importorskip("tools.docs_figures", reason="the tools are not shipped")
pytestmark = pytest.mark.source_tree

from tools.docs_figures import MARK, PAGES, SLOW, SOURCES, rewritten  # noqa: E402

MARKED = [(page, found["source"]) for page in PAGES for found in MARK.finditer(page.read_text(encoding="utf-8"))]


@pytest.mark.parametrize(
    "source", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in SOURCES]
)
def test_the_figures_of_a_source_are_those_of_its_run(source: str) -> None:
    pages = {page for page, marked in MARKED if marked == source}
    assert pages
    for page in pages:
        text = page.read_text(encoding="utf-8")
        changed = [
            f"{page.name}: {old} is {new}"
            for old, new in zip(text.splitlines(), rewritten(text, {source: SOURCES[source]}).splitlines(), strict=True)
            if old != new
        ]
        assert not changed, "run `python -m tools.docs_figures`"


def test_every_mark_is_read() -> None:
    marks = sum(len(re.findall("<!-- ?=", page.read_text(encoding="utf-8"))) for page in PAGES)
    assert marks == len(MARKED) > 10
    assert {source for _, source in MARKED} <= set(SOURCES)


def test_a_stale_figure_is_written_anew_with_its_digits_and_sign() -> None:
    sources = {"run": lambda: {"a b": 11.84, "c": 1.0552}}  # the second is right within its last digit
    text = "cost +8.5 %<!--=run:a_b--> at 1.100'<!-- =run c -->, of 3<!--=other:c-->, 1.06<!--=run:c-->"
    new = "cost +11.8 %<!--=run:a_b--> at 1.055'<!-- =run c -->, of 3<!--=other:c-->, 1.06<!--=run:c-->"
    assert rewritten(text, sources) == new
