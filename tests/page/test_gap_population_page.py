"""Tables of units and of inputs on the page of a gap analysis, of records written by hand."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from tests.page.html import parsed
from tests.page.test_gap_page import result as of_page
from tolevo.commands.gap.page import attribution_table, gap_page, population_table
from tolevo.commands.gap.records import Attribution, GapResult, InputChange, PopulationLine
from tolevo.page_data import dump_result, load_result

NAN = float("nan")
result = of_page


@pytest.fixture
def of_units(result: GapResult) -> GapResult:
    mean = PopulationLine("before", "y<", "location", "mean", "um", 0.7, 0.9, 0.2, 0.15, 0.25, 0.11,
                          0.14, "differs")  # fmt: skip
    shape = replace(mean, aspect="shape", statistic="distance of shapes", low=NAN, high=NAN,
                    verdict="no difference detected; one of 0.3 would have been")  # fmt: skip
    stands = InputChange("pin<", 1.51, 1.3, 1.7, "um", 1.01, 0.4, parts=3, readings=1200)
    out = InputChange("runout", 5.9, 5.0, 6.6, "um", 5.9, 40.0, "it needs 5.9 of its tolerance")
    found = Attribution("process_mean_shift", "y<", "shift", ("pin<",), "attributed", (stands, out),
                        "shift of pin< alone explains the batch")  # fmt: skip
    return replace(result, population=(mean, shape), attribution=(found,))


def test_page_has_both_tables_and_escapes_them(of_units: GapResult) -> None:
    text = gap_page(of_units)
    parsed(text)
    for expected in ("distance of shapes", "no difference detected; one of 0.3", "0.25",
                     "Inputs that may cause it",
                     "it needs 5.9 of its tolerance", "1.51", "1200", "y&lt;",
                     "shift of pin&lt; alone"):  # fmt: skip
        assert expected in text, expected
    assert "pin<" not in text


def test_lines_that_differ_are_marked(of_units: GapResult) -> None:
    table = population_table(of_units)
    assert table.count("class=mark") == 1
    assert table.index("class=mark") < table.index("location") < table.index("distance of shapes")
    assert attribution_table(of_units).count("class=mark") == 1


def test_page_without_units_has_no_section_of_them(result: GapResult) -> None:
    assert population_table(result) == attribution_table(result) == ""
    assert "Inputs that may cause it" not in gap_page(result)
    assert "<p>None" not in gap_page(replace(result, effects=(), rivals=(), shapes=(), where=()))


def test_both_come_back_from_the_stored_page(of_units: GapResult) -> None:
    found, bad = load_result(GapResult, json.loads(dump_result(of_units)))
    assert bad == []
    assert found.attribution == of_units.attribution
    assert found.population[0] == of_units.population[0]
