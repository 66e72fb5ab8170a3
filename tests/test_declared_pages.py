"""The pages of the site that are made from declarations have every declared name."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

pytest.importorskip("tools.declared_pages", reason="the tools are not shipped")
pytestmark = pytest.mark.source_tree

from tolevo import registry  # noqa: E402
from tolevo.models.effects.effect import FAMILIES, Effect  # noqa: E402
from tolevo.models.manipulator.maps import ROWS  # noqa: E402
from tolevo.problems.rv_reducer import RvReducer  # noqa: E402
from tolevo.problems.rv_reducer.counterparts import COUNTERPARTS  # noqa: E402
from tools.declared_pages import effects_page, names_page  # noqa: E402

EFFECTS = Path(__file__).resolve().parent.parent / "docs" / "effects.md"
named, library = cache(names_page), cache(effects_page)


@pytest.mark.parametrize("group", ["problems", "models", "calculations"])
def test_every_declared_name_has_a_row_of_its_problem_or_model(group: str) -> None:
    for name in registry.names(group):
        kind = registry.load(group, name)
        declared = kind.declaration if group == "problems" else kind
        part = named().partition(f"## {group[:-1].capitalize()} `{name}`\n")[2].partition("\n## ")[0]
        members = [one for what in ("variables", "outputs", "parameters", "columns")
                   if isinstance(listed := getattr(declared, what, ()), tuple) for one in listed]  # fmt: skip
        missing = [one.name for one in members if f"| `{one.name}` |" not in part and not getattr(one, "error_of", "")]
        assert missing == [], name


def test_a_variable_has_its_range_and_the_value_of_the_document() -> None:
    part = named().partition("## Problem `rv_reducer`\n")[2].partition("\n## ")[0]
    for one in RvReducer.declaration.variables:
        (row,) = [line for line in part.splitlines() if line.startswith(f"| `{one.name}` |")]
        assert f"| {one.low:g} .. {one.high:g} | {one.document:g}" in row


def test_an_assumed_parameter_is_marked() -> None:
    part = named().partition("## Problem `rv_reducer`\n")[2].partition("\n## ")[0]
    for one in RvReducer.declaration.parameters:
        (row,) = [line for line in part.splitlines() if line.startswith(f"| `{one.name}` |")]
        assert ("| assumed" in row) == one.assumed, one.name


def test_every_elementary_error_of_the_manipulator_is_listed() -> None:
    assert [name for name, unit, _ in ROWS if f"| `{name}_{unit}` |" not in named()] == []


@pytest.mark.parametrize("name", registry.names("effects"))
def test_every_effect_is_listed_with_its_source_and_what_it_is_mistaken_for(name: str) -> None:
    effect: Effect = registry.load("effects", name)()
    (row,) = [line for line in library().splitlines() if line.startswith(f"| `{name}` |")]
    assert effect.cause.removesuffix(".") in row and effect.formula.replace("|", "\\|") in row
    assert [one for one in (*effect.needs, *effect.mistaken_for) if one not in row] == []
    assert f"- `{name}`: {effect.reference}" in library()


def test_effects_stand_under_their_family() -> None:
    for family in FAMILIES:
        part = library().partition(f"## {family}\n")[2].partition("\n#")[0]
        rows = [line.split("`")[1] for line in part.splitlines() if line.startswith("| `")]
        wanted = [one for one in registry.names("effects") if registry.load("effects", one).family == family]
        assert sorted(rows) == sorted(wanted)


@pytest.mark.parametrize("problem", ["rv_backlash", "rv_reducer"])
def test_every_counterpart_in_a_reducer_is_documented(problem: str) -> None:
    part = EFFECTS.read_text(encoding="utf-8").partition(f"| `{problem}` |")[2].partition("| `rv_")[0]
    assert [name for name in COUNTERPARTS if f"`{name}`" not in part] == []
