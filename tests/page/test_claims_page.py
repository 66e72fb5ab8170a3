"""Page and figures of claims, from a result made by hand."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tolevo import page_data
from tolevo.commands.reproduce.page import claims_page, figures, table_figure
from tolevo.commands.reproduce.records import Chart, ClaimsResult, ComputedTable, Document
from tolevo.page.drawing import as_svg
from tolevo.records import Axis

EVIL = "<script>alert('x')</script>"
HISTOGRAM = ComputedTable(
    "histogram",
    "Units by backlash",
    (Axis("backlash_arcmin", "arcmin"), Axis("units", "1")),
    (np.array([0.0, 0.5, 1.0, 1.5]), np.array([3.0, 5.0, 2.0, 0.0])),
    Chart("histogram", "backlash_arcmin", ("units",), {"limit $1": 1.0}),
)
LINES = ComputedTable(
    "sweep",
    EVIL,
    (Axis("x_mm", "mm"), Axis("a", "1"), Axis("b", "1"), Axis("name", "")),
    (np.arange(3.0), np.arange(3.0), np.arange(3.0) ** 2, np.array(["p", "q", "r"])),
    Chart("lines", "x_mm", ("a", "b")),
)


BARS = ComputedTable(
    "effects",
    "Effects",
    (Axis("source", ""), Axis("yaw_mrad", "mrad"), Axis("squareness_mrad", "mrad")),
    (np.array(["rod_length_1", "b"]), np.array([1.0, 2.0]), np.array([3.0, 0.5])),
    Chart("bars", "source", ("yaw_mrad", "squareness_mrad"), of="angle"),
)


def test_bars_have_names_labels_and_units() -> None:
    assert BARS.chart is not None
    (axes,) = table_figure(BARS, BARS.chart).axes
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ["rod length 1", "b"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("angle [mrad]", "source")
    assert [bar.get_width() for bar in axes.patches] == [1.0, 2.0, 3.0, 0.5]  # type: ignore[attr-defined]
    legend = axes.get_legend()
    assert legend is not None and [text.get_text() for text in legend.get_texts()] == ["yaw", "squareness"]


def row(name: str, verdict: str, **more: object) -> dict[str, object]:
    return {
        "document": "X", "id": name, "place": "page 1", "quantity": "length", "printed": [1.0, 2.0],
        "printed_as": "", "unit": "mm", "relation": "equal", "tolerance": 0.05,
        "tolerance_reason": "rounding", "computed": [1.0, 2.5], "standard_error": [0.0, 0.0],
        "deviation": [0.0, 0.5], "verdict": verdict, "reading": "", "reason": "because",
        "ambiguous": "", "lost": "", "recomputed_by": "formula", "readings": [], **more,
    }  # fmt: skip


@pytest.fixture(scope="module")
def result() -> ClaimsResult:
    rows = [
        row("good", "reproduced"),
        row("bad", "not reproduced", reason=EVIL, standard_error=[0.0, 0.125]),
        row("range", "reproduced", relation="within"),
        row("quoted", "reproduced", printed_as="about one"),
        row("gone", "cannot be checked", printed=[], computed=[], standard_error=[], deviation=[]),
    ]
    table = pd.DataFrame(rows)
    counts = pd.DataFrame({"reproduced": [3], "not reproduced": [1]}, index=["X"])
    tables = {"histogram.bad": HISTOGRAM, "sweep": LINES}
    return ClaimsResult(documents=(Document("X", EVIL, "a journal"),), table=table, counts=counts, tables=tables)


def test_what_comes_from_outside_is_escaped(result: ClaimsResult) -> None:
    page = claims_page(result)
    assert page.count("<script") == 1  # the filter by verdict
    assert page.count("&lt;script&gt;") >= 3  # title, reason, meaning of a table


def test_rows(result: ClaimsResult) -> None:
    page = claims_page(result)
    (marked,) = re.findall(r"<tr class=mark>(.*?)</tr>", page)
    cells = re.findall(r"<td[^>]*>(.*?)</td>", marked)
    assert cells[:8] == ["bad", "page 1", "length", "1, 2", "1, 2.5", "0, 0.125", "0, 0.5", "mm"]
    assert cells[8] == "0.05: rounding"
    assert re.search(r"<td[^>]*>1 to 2</td>", page)
    assert re.search(r"<td[^>]*>about one</td>", page)


def test_what_does_not_hold_stands_above_the_documents(result: ClaimsResult) -> None:
    page = claims_page(result)
    top = page[page.index("<h2>Not reproduced</h2>") : page.index("<h2>Document X")]
    (row_,) = re.findall(r"<tr><td[^>]*>(.*?)</tr>", top)
    cells = re.findall(r"(?:<td[^>]*>|^)(.*?)</td>", row_)
    assert cells[:5] == ["X", "bad", "1, 2", "1, 2.5", "mm"]
    assert "&lt;script&gt;" in cells[5]


def test_tables_of_claims_have_their_whole_height(result: ClaimsResult) -> None:
    page = claims_page(result)
    assert "[data-filter] .scroll { max-height: none; }" in page
    before, after = page.split('<div id="detail" data-filter="verdict">')
    assert "<h2>Document X" in after
    assert "<h2>Not reproduced" in before
    assert before.count("<table") == 2  # the counts, and what is not reproduced
    opened = after[: after.index("<h2>histogram")]  # tables of calculations stay in their boxes
    assert opened.count("</div>") == opened.count("<div") + 1


def test_page_needs_no_network_and_no_identifier_twice(result: ClaimsResult) -> None:
    page = claims_page(result)
    names = re.findall(r'\bid="([^"]+)"', page)
    assert len(names) == len(set(names)) > 0
    assert not re.findall(r'(?:src|href)="http', page)


def test_figures_are_the_same_bytes_every_time(result: ClaimsResult) -> None:
    first, second = ([as_svg(one.figure) for one in figures(result)] for _ in range(2))
    assert first == second
    assert [one.name for one in figures(result)] == ["histogram.bad", "sweep"]


def test_histogram_has_its_bins_and_its_limit(result: ClaimsResult) -> None:
    drawn = figures(result)[0]
    (axes,) = drawn.figure.axes
    bars = [(bar.get_x(), bar.get_width(), bar.get_height()) for bar in axes.patches]  # type: ignore[attr-defined]
    assert bars == [(0.0, 0.5, 3.0), (0.5, 0.5, 5.0), (1.0, 0.5, 2.0)]
    assert [line.get_xdata()[0] for line in axes.lines] == [1.0]  # type: ignore[index]
    assert drawn.caption == "Units by backlash. Dashed: limit $1."


def test_lines_are_named(result: ClaimsResult) -> None:
    (axes,) = figures(result)[1].figure.axes
    assert [line.get_label() for line in axes.lines] == ["a", "b"]
    assert axes.get_xlabel() == "x [mm]"


def test_the_page_is_built_again_from_what_is_stored(result: ClaimsResult) -> None:
    odd = np.array([np.nan, np.inf, -0.1])
    extra = replace(LINES, name="odd", values=(np.arange(3), odd, -odd, np.array(["", "a", "é"])))
    whole = replace(result, tables={**result.tables, "odd": extra})
    again, bad = page_data.load_result(ClaimsResult, json.loads(page_data.dump_result(whole)))
    assert not bad
    assert claims_page(again) == claims_page(whole)
    for one, other in zip(again.tables["odd"].values, extra.values, strict=True):
        np.testing.assert_array_equal(one, other)
        assert one.dtype == other.dtype
