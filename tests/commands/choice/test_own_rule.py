"""Choice rules: ours and that of docs/plugins.md keep the contract; one that fails is named."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import tolevo
from tolevo.commands.run.choice import FIRST, choose_rows
from tolevo.commands.run.choice import RULE_KINDS as RULES
from tolevo.registry import names
from tolevo.testing import RuleContract, front

PAGE = Path(__file__).parents[3] / "docs" / "plugins.md"
CONTRACT = [name for name in dir(RuleContract) if name.startswith("test_")]
BROKEN = """

class Broken(own.ChoiceRule):
    meaning = "nothing"

    def row(self, points):
        return points.nonsense


class Beyond(own.ChoiceRule):
    meaning = "a row that is not there"

    def row(self, points):
        return 10**6
"""
ENTRIES = """[tolevo.rules]
middle = own_rules:Middle
broken = own_rules:Broken
beyond = own_rules:Beyond
absent = own_rules_absent:Absent
no_rule = pathlib:Path
"""


@pytest.mark.parametrize("name", FIRST)
@pytest.mark.parametrize("test", CONTRACT)
def test_our_own_keep_the_contract(name: str, test: str) -> None:
    class Kept(RuleContract):
        rule_type = RULES[name]

    getattr(Kept(), test)()


def test_every_rule_of_ours_has_its_place_in_the_order() -> None:
    assert sorted(FIRST) == names("rules")


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    section = PAGE.read_text(encoding="utf-8").split("## A choice rule")[1]
    block = re.findall(r"```python[^\n]*\n(.*?)```", section, re.DOTALL)[0]
    text = "from tolevo import plugins as own\n\n\n" + block + BROKEN
    (tmp_path / "own_rules.py").write_text(text, encoding="utf-8")
    info = tmp_path / "own_rules-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own-rules\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRIES)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("own_rules", None)


@pytest.mark.source_tree
@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("test", CONTRACT)
def test_that_of_the_page_keeps_the_contract(test: str) -> None:
    class Kept(RuleContract):
        rule_type = RULES["middle"]

    getattr(Kept(), test)()


@pytest.mark.source_tree
@pytest.mark.usefixtures("installed")
def test_one_that_fails_is_named_and_stops_nothing() -> None:
    notes: list[str] = []
    found = choose_rows(front(2), notes)
    assert {"knee", "topsis", "middle"} <= set(found)
    assert {"broken", "beyond", "absent", "no_rule"}.isdisjoint(found)
    for name, reason in (
        ("broken", "no attribute 'nonsense'"),
        ("beyond", "chose row 1000000 of a front of 60 points"),
        ("absent", "No module named 'own_rules_absent'"),
        ("no_rule", "must be a subclass"),
    ):
        assert any(f'"{name}" of own-rules 1.0' in note and reason in note for note in notes), notes
    assert len(notes) == 4


@pytest.mark.source_tree
@pytest.mark.usefixtures("installed")
def test_a_run_has_the_choice_and_the_notes() -> None:
    path = "configs/stack_clutch.toml" if Path("configs").is_dir() else _clutch()
    result = tolevo.run(path, settings=["algorithm.generations=10"])
    assert result.choices is not None
    assert "middle" in set(result.choices["choice"])
    notes = result.summary["notes"]
    assert sum("the choice rule" in note for note in notes) == 4


def _clutch() -> str:
    return str(PAGE.parents[1] / "configs" / "stack_clutch.toml")
