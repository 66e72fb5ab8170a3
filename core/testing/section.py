"""The contract of a section of the page of a run."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from typing import ClassVar

from ..page_section import SECTIONS, PageSection
from ..records import RunResult

VOID = frozenset(
    ["area", "br", "col", "hr", "img", "input", "link", "meta", "source", "wbr", "path", "circle", "line", "rect"]
)


@cache
def example() -> RunResult:
    """The result of a small run: two parts, cost against variation."""
    from ..api import run

    cost = {"model": "reciprocal", "a": 1.0, "b": 0.1}
    parts = [
        {"name": name, "nominal": 10.0, "unit": "mm", "sensitivity": 1.0, "t_min": 0.01, "t_max": 0.1, "cost": cost}
        for name in ("pin", "bore")
    ]
    finished = run(
        {
            "problem": "stack",
            "objectives": {"minimise": ["cost", "variation"]},
            "requirement": {"name": "play", "unit": "mm", "nominal": 20.0},
            "part": parts,
            "algorithm": {"name": "exact", "points": 20},
        }
    )
    assert isinstance(finished.record, RunResult)
    return finished.record


class _Tags(HTMLParser):
    """Tags that are open at the end, and those that were closed without having been opened."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.wrong: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in VOID:
            return
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)


class PageContract:
    """What every `PageSection` must keep, on the result of a small run and on one without points.

    `result` may be another result, one for which the section has something to show.
    """

    section_type: ClassVar[type[PageSection]]

    def result(self) -> RunResult:
        """The result for which the section is not empty."""
        return example()

    def test_is_registered_and_has_a_title(self) -> None:
        assert SECTIONS[SECTIONS.name_of(self.section_type)] is self.section_type
        assert self.section_type.title.strip()

    def test_is_well_formed(self) -> None:
        body = self.section_type().body(self.result())
        assert body
        tags = _Tags()
        tags.feed(body)
        assert (tags.open, tags.wrong) == ([], [])

    def test_loads_nothing_and_runs_nothing(self) -> None:
        body = self.section_type().body(self.result())
        assert re.search(r"<script|<iframe|(src|href)=[\"']?(https?:)?//|\son\w+=", body) is None

    def test_same_result_same_text(self) -> None:
        section = self.section_type()
        assert section.body(self.result()) == section.body(self.result())

    def test_a_result_without_points_is_no_fault(self) -> None:
        whole = self.result()
        none = replace(whole, front=whole.front[:0], references=whole.references[:0])
        assert isinstance(self.section_type().body(none), str)
