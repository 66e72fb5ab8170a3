"""HTML as the tests of the pages read it."""

from __future__ import annotations

from html.parser import HTMLParser


class Tree(HTMLParser):
    """Tags with their attributes; every one that is opened must be closed."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in {"meta", "wbr"}:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def parsed(text: str) -> Tree:
    """The whole of a page."""
    tree = Tree()
    tree.feed(text)
    tree.close()
    assert tree.open == []
    return tree
