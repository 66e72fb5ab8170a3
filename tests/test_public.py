"""What is public is what the page says, and a replaced name still works, with a warning."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import tolevo
from tolevo import algorithms, plugins, testing
from tolevo.lazy import Renamed, lazily
from tolevo.page.document import TERMS
from tolevo.registry import BASES

PAGE = Path(__file__).resolve().parent.parent / "docs" / "public.md"


@pytest.mark.source_tree
def test_the_page_lists_every_public_name_and_no_other() -> None:
    table = PAGE.read_text(encoding="utf-8").split("| name | is |")[1].split("\n\n")[0]
    first = [line.split("|")[1] for line in table.splitlines()[2:]]
    assert sorted(re.findall(r"`(\w+)`", " ".join(first))) == sorted(tolevo.__all__)


@pytest.mark.parametrize("package", [tolevo, algorithms, plugins, testing])
def test_every_public_name_is_there(package: object) -> None:
    names = package.__all__  # type: ignore[attr-defined]
    assert [name for name in names if not hasattr(package, name)] == []
    assert len(set(names)) == len(names)


@pytest.mark.source_tree
def test_every_group_of_plugins_is_named_where_plugins_are_explained() -> None:
    text = (PAGE.parent / "plugins.md").read_text(encoding="utf-8")
    assert [group for group in BASES if f"`tolevo.{group}`" not in text] == []


@pytest.mark.source_tree
def test_the_glossary_explains_every_term_of_the_pages() -> None:
    text = (PAGE.parent / "glossary.md").read_text(encoding="utf-8")
    explained = {line.removeprefix("### ").lower() for line in text.splitlines() if line[:4] == "### "}
    wanted = {term.lower() for term in TERMS} | {
        "nadir", "pseudo-weights", "stagger", "document a", "document b", "document m",
    }  # fmt: skip
    assert sorted(wanted - explained) == []


def test_a_replaced_name_warns_and_works() -> None:
    get = lazily("tolevo", {"read": ".api"}, {"load": Renamed("read", "0.4")})
    with pytest.warns(DeprecationWarning, match=r"tolevo\.load is now tolevo\.read.* version 0\.4"):
        assert get("load") is tolevo.read
    with pytest.raises(AttributeError, match="no attribute 'other'"):
        get("other")
