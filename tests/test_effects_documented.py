"""The table of docs/effects.md is what the effects say of themselves."""

from dataclasses import replace
from pathlib import Path

import pytest

from tolevo import registry
from tolevo.models.effects.effect import FAMILIES, Effect, EffectParameter, Target
from tolevo.models.effects.measurements import target_from, target_of
from tolevo.models.gear import RV_40E
from tolevo.problems.rv_reducer.counterparts import COUNTERPARTS
from tolevo.section import Output
from tolevo.testing import COLUMNS

PAGE = Path(__file__).resolve().parent.parent / "docs" / "effects.md"
Y = Output("reading_y", "y", "")
"""An output whose unit is called y."""


def target(effect: Effect) -> Target:
    """Where the effect acts: a table with every role, or the model that has a place for it."""
    if effect.family in ("manipulator", "assembly"):
        name = {"manipulator": "manipulator_pose"}.get(effect.family, effect.family)
        return target_of(registry.load("models", name), name)
    table = target_from("table", (Y,), COLUMNS)
    return replace(table, population=effect.family == "population", gear=RV_40E)


def row(name: str) -> str:
    effect: Effect = registry.load("effects", name)()
    numbers = "; ".join(_number(one) for one in effect.parameters(target(effect)))
    if name == "lot_offset":
        numbers = "`offset_<lot>_y` c of the lot of that label"
    needs = ", ".join(effect.needs) or "-"
    rivals = ", ".join(f"`{one}`" for one in effect.mistaken_for) or "-"
    cause = effect.cause.removesuffix(".")
    cells = (f"`{name}`", cause, effect.formula.replace("|", "\\|"), numbers, needs, rivals)
    return f"| {' | '.join(cells)} |"


def _number(one: EffectParameter) -> str:
    ends = "" if one.linear and one.low < 0.0 else f", {one.low:g} .. {one.high:g}"
    listed = ", ".join(f"{choice:g}" for choice in one.choices)
    bounds = f", one of {listed}" if listed else ends.replace("0 .. inf", "at least 0")
    return f"`{one.name}` {one.meaning}{bounds}"


@pytest.mark.source_tree
@pytest.mark.parametrize("name", registry.names("effects"))
def test_every_effect_is_documented_as_it_is(name: str) -> None:
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    assert row(name) in lines
    assert f"- `{name}`: {registry.load('effects', name).reference}" in lines


@pytest.mark.source_tree
@pytest.mark.parametrize("problem", ["rv_backlash", "rv_reducer"])
def test_every_counterpart_in_a_reducer_is_documented(problem: str) -> None:
    part = PAGE.read_text(encoding="utf-8").partition(f"| `{problem}` |")[2].partition("| `rv_")[0]
    assert [name for name in COUNTERPARTS if f"`{name}`" not in part] == []


@pytest.mark.source_tree
def test_effects_stand_under_their_family() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for family in FAMILIES:
        part = text.partition(f"### {family}\n")[2].partition("\n#")[0]
        named = [line.split("`")[1] for line in part.splitlines() if line.startswith("| `")]
        expected = [
            one for one in registry.names("effects")
            if registry.load("effects", one).family == family
        ]  # fmt: skip
        assert sorted(named) == expected
