import json
import re
from base64 import b64encode
from dataclasses import dataclass, replace
from hashlib import sha256

import numpy as np
import pandas as pd
import pytest

from tests.page.html import parsed
from tolevo.page import page
from tolevo.page.document import shown, table
from tolevo.page.explorer import thin_points
from tolevo.page.figures import front_figure, population_figure, torque_figure, turn_figure
from tolevo.page_data import table_files
from tolevo.records import Axis, RunResult, optional

EVIL = '<script>alert("x")</script>'


@pytest.fixture
def result() -> RunResult:
    references = pd.DataFrame(
        {
            "label": ["document B", "single-objective GA"],
            "feasible": [False, True],
            "violated_limits": ["interference_probability", ""],
            "cost": [12.5, 11.0],
            "backlash_arcmin": [1.4, 1.0],
            "cost_saving_percent": [7.25, 0.5],
            "relaxed_cost_saving_percent": [8.75, float("nan")],
        }
    )
    return RunResult(
        title="Backlash",
        front=pd.DataFrame({"knee": [False, True], "cost": [12.0, 10.0], "backlash_arcmin": [1.0, 1.23456789]}),
        references=references,
        convergence=pd.DataFrame(
            {
                "generation": [1, 2],
                "evaluations": [100, 200],
                "seconds": [0.1, 0.2],
                "hypervolume": [0.5, 0.6],
                "hypervolume_ratio": [None, None],
                "feasible_fraction": [0.2, 0.9],
            }
        ),
        summary={
            "status": "done",
            "seed": 0,
            "versions": {"numpy": "2.0"},
            "ideal": {"cost": 5.0, "backlash_arcmin": 0.2},
            "assumptions": [{"name": "a_0", "value": 36.0, "unit": "mm", "reason": "A", "set_by": "default"}],
        },
        objectives=(Axis("cost", ""), Axis("backlash_arcmin", "arcmin")),
        notes=("No reference dominates a point.",),
        configuration='problem = "rv_backlash"\n',
    )


def test_every_text_is_escaped(result: RunResult) -> None:
    evil = replace(
        result,
        title=EVIL,
        notes=(EVIL,),
        configuration=f'# {EVIL}\nx = "</pre>"\n',
        references=result.references.assign(label=[EVIL, '"><img src=x>']),
        front=result.front.assign(**{EVIL: EVIL}),
        summary={"status": EVIL, EVIL: {"x": EVIL}, "assumptions": [{"name": EVIL}]},
        objectives=(Axis("cost", EVIL), Axis("backlash_arcmin", '--><img src=x>"')),
    )
    tags = [tag for tag, _ in parsed(page(evil)).seen]
    assert "img" not in tags
    assert tags.count("script") == 2  # the data and our own
    assert EVIL not in page(evil)


def test_only_the_scripts_of_the_page_may_run(result: RunResult) -> None:
    text = page(result)
    scripts = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    hashes = [b64encode(sha256(one.encode()).digest()).decode() for one in scripts]
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert policy is not None
    allowed = dict(part.strip().split(" ", 1) for part in policy[1].split(";"))
    assert allowed["script-src"] == " ".join(f"'sha256-{one}'" for one in hashes)
    assert allowed["default-src"] == "'none'"
    assert allowed["img-src"] == "data:"


def test_the_data_end_in_no_text(result: RunResult) -> None:
    evil = replace(result, references=result.references.assign(label=["</script>", "<!--"]))
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page(evil))
    assert found is not None
    assert "<" not in found[1]
    labels = [one["label"] for one in json.loads(found[1])["references"]]
    assert labels == ["</script>", "<!--"]


def test_points_are_thinned_by_the_stated_rule() -> None:
    front = pd.DataFrame({"cost": np.arange(1000.0)[::-1], "error": np.arange(1000.0)})
    rows = thin_points(front, ["cost", "error"], [3, 500], 100)
    assert len(rows) <= 102
    assert {0, 999, 3, 500} <= set(rows.tolist())
    assert np.all(np.diff(front["cost"].iloc[rows]) > 0.0)
    assert np.max(-np.diff(rows)) <= 11


def test_no_network(result: RunResult) -> None:
    text = page(result)
    for tag, attributes in parsed(text).seen:
        assert tag not in {"link", "iframe", "img"}
        assert "src" not in attributes
        for name in ("href", "xlink:href"):
            assert (attributes.get(name) or "#").startswith("#")
    addresses = re.findall(r"""(\S+)=["']https?://([^"']*)""", text)
    assert {name.partition(":")[0] for name, _ in addresses} <= {"xmlns"}
    assert len(addresses) == text.count("http://") + text.count("https://")
    assert "@import" not in text


def test_identifiers_are_unique(result: RunResult) -> None:
    tree = parsed(page(result))
    names = [attributes["id"] for _, attributes in tree.seen if "id" in attributes]
    assert len(names) == len(set(names))
    targets = {a["xlink:href"] for _, a in tree.seen if "xlink:href" in a}
    assert targets <= {f"#{name}" for name in names}


def test_all_references_are_named_with_what_they_break(result: RunResult) -> None:
    text = page(result)
    for expected in ("document B", "single-objective GA", "interference_probability", "8.75"):
        assert f">{expected}</td>" in text


def test_notes_assumptions_configuration_and_points_are_there(result: RunResult) -> None:
    text = page(result)
    assert "<li>No reference dominates a point.</li>" in text
    assert ">a_0</td>" in text
    assert "problem = &quot;rv_backlash&quot;" in text
    assert ">1.235</td>" in text
    assert text.count("class=mark") == 1
    assert "numpy 2.0" in text
    assert "prefers-color-scheme: dark" in text


def test_same_text_every_time(result: RunResult) -> None:
    assert page(result) == page(result)


def test_nothing_found(result: RunResult) -> None:
    nothing = pd.DataFrame()
    empty = replace(result, front=nothing, references=nothing, convergence=nothing, summary={}, notes=())
    assert "None." in page(empty)
    parsed(page(empty))


def test_the_only_point_is_not_in_the_plural(result: RunResult) -> None:
    assert "All 2 points." in page(result)
    alone = page(replace(result, front=result.front.iloc[:1]))
    assert "The only point." in alone and "1 points" not in alone


def test_references_alone(result: RunResult) -> None:
    assert "document B" in page(replace(result, front=result.front.iloc[:0]))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "yes"),
        (float("nan"), ""),
        (None, ""),
        (1.23456, "1.235"),
        (123456.7, "123457"),
        (100000, "100000"),
        (float("inf"), "inf"),
        (0.0, "0"),
        ("<", "<"),
    ],
)
def test_numbers_are_rounded_for_reading(value: object, text: str) -> None:
    assert shown(value) == text


def test_table_escapes_headings_and_cells() -> None:
    assert "&lt;b&gt;" in table(pd.DataFrame({"<b>": ["<i>"]}))
    assert "&lt;i&gt;" in table(pd.DataFrame({"<b>": ["<i>"]}))


def test_fronts_of_other_algorithms_are_drawn_beside(result: RunResult) -> None:
    other = pd.DataFrame({"cost": [14.0, 9.0], "backlash_arcmin": [1.1, 1.5]})
    both = replace(result, overlays={EVIL: other, "empty": other.iloc[:0]})
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page(both))
    assert found is not None
    assert json.loads(found[1])["overlays"] == [{"label": f"{EVIL}, 2 points", "aims": [[9.0, 14.0], [1.5, 1.1]]}]
    lines = {line.get_label(): line for line in front_figure(both).axes[0].get_lines()}
    assert np.asarray(lines[f"{EVIL}, 2 points"].get_xdata()).tolist() == [9.0, 14.0]
    assert not any(str(label).startswith("empty") for label in lines)
    assert EVIL not in page(both)


def test_units_are_shown_as_they_are_in_the_tables(result: RunResult) -> None:
    turn = pd.DataFrame({"turn_deg": [90.0, 180.0, 270.0], "backlash_arcmin": [0.4, 0.9, 0.6],
                         "measured": [True, False, True]})  # fmt: skip
    population = pd.DataFrame({"backlash_max_arcmin": [0.2, 0.6, 1.0],
                               "share_within_percent": [0.0, 70.0, 100.0],
                               "share_percent": [0.0, 70.0, 30.0]})  # fmt: skip
    units = {"words": [EVIL], "quantile": 0.95, "limit": 1.0, "coverage_percent": 99.73,
             "point": 1, "chosen": "the knee", "cost": 10.0}  # fmt: skip
    cost = pd.DataFrame({"assumption": ["as it is", EVIL], "value": ["", "0.5"],
                         "cost": [10.0, float("nan")], "change_percent": [0.0, float("nan")],
                         "remark": ["", "none found"]})  # fmt: skip
    curve = pd.DataFrame({"torque_Nm": [-400.0, -12.0, 12.0, 400.0], "rotation_median_arcmin": [-3.0, -0.5, 0.5, 3.0],
                          "rotation_high_arcmin": [-4.0, -0.75, 0.75, 4.0],
                          "lost_motion": [False, True, True, False]})  # fmt: skip
    shown_units = replace(
        result, unit_turn=turn, population=population, assumptions_cost=cost, torque_rotation=curve,
        summary={**result.summary, "units": units, "validity": [EVIL]},
    )  # fmt: skip
    text = page(shown_units)
    assert EVIL not in text
    assert "Shown for the knee (point 1 of front.csv): cost 10." in text
    assert "none found" in text
    lines = {one.get_label(): one for one in turn_figure(shown_units).axes[0].get_lines()}
    assert lines["largest of them"].get_ydata() == [0.6, 0.6]
    assert np.asarray(lines["2 positions"].get_xdata()).tolist() == [90.0, 270.0]
    curves = {one.get_label(): one for one in torque_figure(shown_units).axes[0].get_lines()}
    assert {"unit of median lost motion: 1 arcmin", "unit of 99.73 % lost motion: 1.5 arcmin"} <= curves.keys()
    assert "<h2>Torque and rotation</h2>" in text
    marks = [line for axes in population_figure(shown_units).axes for line in axes.get_lines()]
    drawn = {line.get_label(): line.get_xdata() for line in marks}
    assert np.asarray(drawn["99.73 % of the units: 0.95 arcmin"]).tolist() == [0.95, 0.95]
    assert np.asarray(drawn["limit: 1 arcmin"]).tolist() == [1.0, 1.0]


@dataclass(frozen=True, slots=True)
class WithOwnTable(RunResult):
    own: pd.DataFrame | None = optional("own.csv", heading="Own", text="Costs by <rank>.", marked=("rank", 2))


def test_a_declared_table_is_written_and_drawn_without_more_being_said(result: RunResult) -> None:
    values = {name: getattr(result, name) for name in RunResult.__dataclass_fields__}
    own = pd.DataFrame({"rank": [1, 2], "mass_kg": [3.0, EVIL]})
    text = page(WithOwnTable(**values, own=own))
    shown_part = text.partition("<h2>Own</h2>")[2].partition("</section>")[0]
    assert "Costs by &lt;rank&gt;." in shown_part and "mass [kg]" in shown_part and EVIL not in shown_part
    assert [row.startswith("<tr class=mark>") for row in re.findall(r"<tr.*", shown_part)[1:]] == [False, True]
    assert table_files(WithOwnTable(**values, own=own.head(1)))["own.csv"].startswith(b"rank,mass_kg\n1,")
    assert "own.csv" not in table_files(WithOwnTable(**values))
    assert "<h2>Own</h2>" not in page(WithOwnTable(**values))
