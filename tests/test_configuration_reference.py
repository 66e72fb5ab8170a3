"""The reference of the configuration has every key that the code reads, and its meaning."""

from __future__ import annotations

from functools import cache

import pytest

pytest.importorskip("tools.configuration_keys", reason="the tools are not shipped")
pytestmark = pytest.mark.source_tree

from tools.configuration_keys import Key, all_keys, in_the_code, pattern  # noqa: E402
from tools.configuration_page import configuration_page, meanings  # noqa: E402

NO_KEYS = {
    "algorithms": "the registry's name in a fault",
    "nested": "a parameter of robots",
    "over_constraint": "a parameter of reducers",
    "planet_coupling": "a parameter of reducers",
    "per_drive": "a parameter of robots",
}
"""What looks like a key in the code and is none of a table."""
keys = cache(all_keys)
page = cache(configuration_page)


def test_no_key_of_the_code_is_missing() -> None:
    known = {part.replace("[]", "") for path in keys() for part in path.split(".")}
    missing = {key: where for key, where in in_the_code().items() if key not in known}
    assert missing.keys() - NO_KEYS == set(), missing


def test_every_key_has_its_meaning_and_no_meaning_is_left() -> None:
    texts = meanings()
    assert sorted(set(keys()) - set(texts)) == []
    assert sorted(set(texts) - set(keys())) == []
    assert [path for path, text in texts.items() if not text.endswith(".")] == []


def test_every_key_stands_on_the_page_with_its_type() -> None:
    rows = [key for key in keys().values() if f"| `{key.name}` | " in page()]
    assert len(rows) > 200
    assert "| `coverage` | number, must lie in (0, 1) |" in page()
    assert "| `t_min` | number in the unit of its owner, must be above 0 |" in page()


@pytest.mark.parametrize(
    ("place", "path"),
    [
        ("part[3].machine[0].inspection.u", "machine[].inspection.u"),
        ("variables.pitch_um.measured.gauge.df", "measured.gauge.df"),
        ("claim[2] (slope).reading[1].terms.x.design.pitch_um", "claim[].reading[].design.NAME"),
        ("vary.algorithm.crossover.probability.low", "vary.NAME.low"),
        ("limits.gap.variation.max", "limits.NAME.max"),
        ("joint[4].alpha_mrad.cost.a", "costs.NAME.a"),
        ("costs.assumed", "costs.assumed"),
        ("cost[0].curves.b.a", "costs.NAME.a"),
        ("cost[1].curves.b.lathe.setup", "cost[].curves.NAME.MACHINE.setup"),
    ],
)
def test_places_by_what_they_are(place: str, path: str) -> None:
    assert pattern(place) == path
    assert Key(path).name == path.rpartition(".")[2]
