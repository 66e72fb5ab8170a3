"""The page of a gap analysis, of records written by hand."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.blanks import blanks
from tests.page.html import parsed
from tolevo.commands.gap.page import figures, gap_page
from tolevo.commands.gap.records import (
    FoundEffect,
    FoundParameter,
    GapResult,
    Gate,
    Measurement,
    NextMeasurement,
    OutputGate,
    Recalibrated,
    Region,
    Rival,
    Sensitivity,
    Separation,
    Shape,
    Step,
)
from tolevo.page.drawing import as_png, as_svg
from tolevo.page_data import dump_result, load_result
from tolevo.records import Axis

EVIL = '<script>alert("x")</script>'


def readings(n: int = 150) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    torque = rng.uniform(-400.0, 400.0, n)
    noise = rng.normal(size=n)
    before = 4.0 * np.clip(torque / 60.0, -1.0, 1.0) + noise
    return pd.DataFrame(
        {
            "torque_Nm": torque,
            "output_angle_deg": rng.uniform(0.0, 360.0, n),
            "direction": rng.choice([-1.0, 1.0], n),
            "lot": rng.choice(["A", "$B$"], n),
            "te_arcsec_outlier": np.arange(n) % 100 == 0,
            "te_arcsec": before,
            "te_arcsec_predicted": 0.0 * noise,
            "te_arcsec_corrected": before - noise,
            "te_arcsec_before": before,
            "te_arcsec_after": noise,
        }
    )


def spectrum() -> pd.DataFrame:
    order = np.arange(0.25, 60.0, 0.25)
    before = np.where(order == 33.5, 2.0, 0.1)
    return pd.DataFrame({"output": "te_arcsec", "order": order, "before": before,
                         "after": np.full(len(order), 0.1), "threshold": 0.4})  # fmt: skip


@pytest.fixture(scope="module")
def result() -> GapResult:
    parameter = FoundParameter("half_width_arcsec", 4.0, 3.8, 4.2, "arcsec", "half of the band")
    return GapResult(
        title="Gap of rv_transmission",
        verdict="ambiguous",
        outputs=(Axis("te_arcsec", "arcsec"),),
        inputs=(Axis("torque_Nm", "Nm"), Axis("output_angle_deg", "deg"), Axis("direction", ""),
                Axis("lot", "")),
        gate=Gate((OutputGate("te_arcsec", "arcsec", 1.0, "estimated", 4.1, 99.0, 12.0, True),),
                  (Recalibrated("K", "Nm/arcmin", 108.0, 109.0, 5.0),)),
        where=(Region("te_arcsec", "torque_Nm", "interval", "Nm", -60.0, 60.0, share=0.8),),
        scores=(),
        steps=(
            Step(0, "start", "", (), True, "the recalibrated model", held_out=4.1),
            Step(1, "add", "bearing_clearance", ("bearing_clearance",), True, "best", 90.0, 12.0,
                 1.01, 9.0, 0.5),
            Step(2, "reject", "drift", ("bearing_clearance",), False, "not significant", 3.0, 12.0,
                 1.02, -0.1, 0.2),
        ),
        effects=(FoundEffect("bearing_clearance", "load", "Rolling elements.", (parameter,), 90.0,
                             12.0, 9.0, 0.5, frequency=0.96, in_problem=False,
                             counterpart="no counterpart in rv_backlash"),),
        rivals=(Rival(("lost_motion",), ("bearing_clearance",), 4.0,
                      Measurement("measure at 5 to 40 N m", {"torque_Nm": (5.0, 40.0)}, 1.2, 17)),),
        shapes=(Shape("te_arcsec", "load", "torque_Nm", 0.2, "arcsec", "a little is left"),),
        noise_floor={"te_arcsec": 1.0, "total": 1.0},
        gap_before={"te_arcsec": 4.1, "total": 4.1},
        gap_after={"te_arcsec": 1.01, "total": 1.01},
        residuals=readings(),
        spectrum=spectrum(),
        units=pd.DataFrame(),
        summary={"verdict": "ambiguous", "seed": 0},
        notes=("Noise was estimated.",),
        configuration='model = "rv_transmission"\n',
        corrected="[[effect]]\n",
    )  # fmt: skip


def test_page_says_what_was_found(result: GapResult) -> None:
    text = gap_page(result)
    for expected in ("half_width_arcsec", "3.8", "4.2", "lost_motion", "measure at 5 to 40 N m",
                     "96 %", "no counterpart", "Noise was estimated", "a little is left",
                     "not significant", "4.1", "1.01", "109"):  # fmt: skip
        assert expected in text, expected


def test_page_is_whole_and_needs_no_network(result: GapResult) -> None:
    text = gap_page(result)
    tree = parsed(text)
    assert not re.search(r"(src|href)=\"(?!#)", text.replace("xlink:", ""))
    assert {tag for tag, _ in tree.seen} & {"script", "link", "img", "iframe"} == set()
    drawings = [attributes for tag, attributes in tree.seen if tag == "svg"]
    assert len(drawings) == 3
    assert all(one.get("role") == "img" and one.get("aria-label") for one in drawings)
    names = [one["id"] for _, one in tree.seen if "id" in one]
    assert len(names) == len(set(names))


def test_texts_of_the_user_are_escaped(result: GapResult) -> None:
    evil = replace(
        result, title=EVIL, notes=(EVIL,), configuration=EVIL, corrected=EVIL, verdict=EVIL,
        inputs=(Axis(EVIL, EVIL),), outputs=(Axis("te_arcsec", EVIL),), summary={EVIL: EVIL},
        residuals=result.residuals.rename(columns={"lot": EVIL}),
        where=(replace(result.where[0], variable=EVIL, unit=EVIL),),
        steps=(replace(result.steps[1], name=EVIL, reason=EVIL),),
        effects=(replace(result.effects[0], name=EVIL, cause=EVIL, at_bound=(EVIL,)),),
        rivals=(replace(result.rivals[0], names=(EVIL,)),),
    )  # fmt: skip
    text = gap_page(evil)
    assert "<script>" not in text
    assert "&lt;script&gt;" in text
    parsed(text)


def test_nothing_found_is_a_page_too(result: GapResult) -> None:
    nothing = pd.DataFrame()
    empty = replace(
        result, verdict="no_gap", inputs=(), where=(), steps=(), effects=(), rivals=(), shapes=(),
        residuals=nothing, spectrum=nothing, notes=(), gate=Gate(()), gap_after={},
    )  # fmt: skip
    assert figures(empty) == {}
    text = gap_page(empty)
    assert "No gap" in text
    parsed(text)


def test_figures_show_before_and_after(result: GapResult) -> None:
    drawn = figures(result)
    assert set(drawn) == {"residuals_te_arcsec", "spectrum_te_arcsec", "path"}
    panels = drawn["residuals_te_arcsec"].axes
    assert len(panels) == 12  # before, after, and what was taken away
    sizes = [np.std(np.asarray(axes.lines[1].get_ydata(), dtype=float)) for axes in panels[:2]]
    assert sizes[0] > 3.0 * sizes[1]
    assert "4.1" in panels[0].get_title() and "1.01" in panels[1].get_title()
    located = [axes for axes in panels if axes.patches]
    assert located == panels[:3]
    left, right = np.asarray(located[0].patches[0].get_window_extent().intervalx)
    edges = located[0].transData.transform([(-60.0, 0.0), (60.0, 0.0)])[:, 0]
    np.testing.assert_allclose([left, right], edges, atol=0.5)


def test_labels_of_the_user_are_no_formulas(result: GapResult) -> None:
    by_lot = figures(result)["residuals_te_arcsec"].axes[9]
    ticks = by_lot.get_xticklabels()
    assert {text.get_text() for text in ticks} == {"A", "$B$"}
    assert not any(text.get_parse_math() for text in ticks)


def test_files_of_figures_stay_in_their_folder(result: GapResult) -> None:
    renamed = result.residuals.rename(columns=lambda name: name.replace("te_arcsec", "../te"))
    drawn = figures(replace(result, outputs=(Axis("../te", ""),), residuals=renamed))
    assert "residuals__te" in drawn


def test_peaks_above_the_noise_bear_their_order(result: GapResult) -> None:
    before, after = figures(result)["spectrum_te_arcsec"].axes
    assert [text.get_text() for text in before.texts] == ["33.5"]
    assert [text.get_text() for text in after.texts] == []


def test_outliers_are_marked_and_do_not_set_the_scale(result: GapResult) -> None:
    wild = result.residuals.copy()
    wild.loc[[0, 100], "te_arcsec_before"] = [5000.0, -5000.0]
    drawn = figures(replace(result, residuals=wild))["residuals_te_arcsec"]
    left = drawn.axes[0]
    assert left.get_ylim()[1] < 20.0
    marked = next(line for line in left.lines if str(line.get_label()).startswith("outlier"))
    np.testing.assert_allclose(np.asarray(marked.get_ydata()), np.array(left.get_ylim())[::-1])
    named = {text.get_text() for text in drawn.legends[0].get_texts()}
    assert {"before", "after", "located here", "mean of neighbours"} <= named


def test_means_of_neighbours_show_what_is_left(result: GapResult) -> None:
    """The saturated spring of the record before, nothing after."""
    panels = figures(result)["residuals_te_arcsec"].axes[:2]
    ends = []
    for axes in panels:
        line = next(one for one in axes.lines if one.get_label() == "mean of neighbours")
        ends.append(np.asarray(line.get_ydata(), dtype=float)[[0, -1]])
    np.testing.assert_allclose(ends[0], [-4.0, 4.0], atol=1.2)
    np.testing.assert_allclose(ends[1], [0.0, 0.0], atol=1.2)


def test_a_population_is_drawn_as_distributions(result: GapResult) -> None:
    share = (np.arange(50) + 0.5) / 50
    spread = pd.DataFrame({"output": "te_arcsec", "share": share, "measured": share**2,
                           "before": share, "after": share**2 + 0.01})  # fmt: skip
    drawn = figures(replace(result, units=spread))
    assert "distribution_te_arcsec" in drawn
    lines = drawn["distribution_te_arcsec"].axes[0].lines
    assert len({line.get_linestyle() for line in lines}) == 3
    np.testing.assert_array_equal(np.asarray(lines[0].get_xdata()), share**2)
    assert drawn["residuals_te_arcsec"].axes[0].get_title() == "before"
    assert "distribution_te_arcsec" not in figures(result)


def test_a_located_order_is_hatched(result: GapResult) -> None:
    wave = Region("te_arcsec", "output_angle_deg", "order", "", order=33.5, share=0.5)
    for axes in figures(replace(result, where=(wave,)))["spectrum_te_arcsec"].axes:
        (patch,) = axes.patches
        assert patch.get_hatch()
        left, right = patch.get_extents().transformed(axes.transData.inverted()).intervalx
        assert left < 33.5 < right


def test_a_long_record_is_thinned(result: GapResult) -> None:
    long = replace(result, residuals=readings(20_000))
    points = figures(long)["residuals_te_arcsec"].axes[0].lines[1].get_xdata()
    assert 300 < len(np.asarray(points)) <= 600


def test_same_bytes_every_time(result: GapResult) -> None:
    for figure, again in zip(figures(result).values(), figures(result).values(), strict=True):
        assert as_svg(figure) == as_svg(again)
        assert as_png(figure)[:4] == b"\x89PNG"


def test_the_page_is_built_again_from_what_is_stored(result: GapResult) -> None:
    again, bad = load_result(GapResult, json.loads(dump_result(result)))
    assert bad == []
    assert gap_page(again) == gap_page(result)


def test_what_is_missing_in_the_stored_page_is_named(result: GapResult) -> None:
    content = json.loads(dump_result(result))
    del content["fields"]["notes"]
    content["fields"]["title"] = 3
    again, bad = load_result(GapResult, content)
    assert sorted(bad) == ["notes", "title"]
    assert again.notes == ()


@blanks()
def test_the_next_measurement(result: GapResult) -> None:
    """Its tables, its points beside those of the record, and both again from what is stored."""
    pair = Separation(("lost_motion",), ("bearing_clearance",), 1.5, 33.25, 0.97, 0.61, 0.88, 23,
                      f"30 readings {EVIL}")  # fmt: skip
    seen = Sensitivity("drift", "rate", "arcsec/s", 0.02, 0.1, 0.9, 0.2, 0.05, 0.015)
    planned = NextMeasurement("30 readings", 30, (pair,), (seen,), (), ("torque_Nm", "direction"),
                              "next_measurement.csv")  # fmt: skip
    points = pd.DataFrame({"torque_Nm": [400.0] * 20 + [-400.0] * 10, "direction": [1.0] * 30})
    whole = replace(result, next_measurement=planned, next_points=points)
    again, bad = load_result(GapResult, json.loads(dump_result(whole)))
    assert bad == []
    assert again.next_measurement == planned
    assert gap_page(again) == gap_page(whole)
    part = gap_page(whole).split("<h2>The next measurement</h2>")[1].split("<h2>")[0]
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", part)
    for cell in ("33.2", "0.97", "0.61", "0.88", "23", "drift", "0.02", "0.015"):
        assert any(one.startswith(cell) for one in cells), cell
    assert "<script>alert" not in gap_page(whole)
    (axes,) = figures(whole)["next_measurement"].axes
    assert axes.get_xlabel() == "torque [Nm]"
    places = np.asarray(axes.collections[0].get_offsets(), dtype=float)
    np.testing.assert_allclose(places, np.array([[-400.0, 1.0], [400.0, 1.0]]))
    assert "next_measurement" not in figures(result)
