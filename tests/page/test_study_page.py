from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from tests.page.html import parsed
from tolevo.commands.study.page import figures, study_page
from tolevo.page.drawing import as_png, as_svg
from tolevo.page_data import dump_result, load_result
from tolevo.records import Recommendation, Response, StudyResult, Varied, Verdict

EVIL = '<script>alert("x")</script>'
NAN = float("nan")


@pytest.fixture(scope="module")
def result() -> StudyResult:
    """Two keys one at a time, three settings, two seeds, one failed run."""
    design = pd.DataFrame({"algorithm.population": [80, 20, 80], "algorithm.kind": ["a", "a", "b"]})
    table = design.loc[np.repeat([0, 1, 2], 2)].reset_index(drop=True)
    table.insert(0, "point", np.repeat([0, 1, 2], 2))
    table["replicate"], table["seed"] = [0, 1] * 3, [7, 8] * 3
    table["status"] = ["done"] * 5 + ["failed"]
    table["reason"] = [""] * 5 + [f"ValueError: {EVIL}"]
    table["gap_percent"] = [1.0, 2.0, 5.0, 6.0, 1.5, NAN]
    medians = pd.DataFrame({
        "response": "gap_percent", "point": [0, 1, 2], "median": [1.5, 5.5, 1.5],
        "low": [1.0, 5.0, NAN], "high": [2.0, 6.0, NAN], "level": 0.95, "n": [2, 2, 1],
        "failed": [0, 0, 1], "reached": [2, 2, 1],
    })  # fmt: skip
    courses = pd.DataFrame({
        "key": "algorithm.population", "level": [80, 80, 20, 20], "generation": [1, 2, 1, 2],
        "median": [9.0, 3.0, 9.5, 6.0], "low": [8.0, 2.5, 9.0, 5.0], "high": [9.9, 4.0, 9.9, 7.0],
        "level_of_interval": 0.95, "n": 2, "optimum": 2.0,
    })  # fmt: skip
    sensitivity = pd.DataFrame({
        "response": "gap_percent", "key": ["algorithm.population", "algorithm.kind", ""],
        "statistic": ["anova_share", "anova_share", "noise_share"], "value": [0.8, 0.0, 0.2],
        "low": [0.6, -0.1, 0.1], "high": [0.9, 0.1, 0.3], "level": 0.95, "n": 2,
        "distinct": [True, False, True],
    })  # fmt: skip
    tests = pd.DataFrame({
        "response": "gap_percent", "key": "algorithm.population", "kind": "wilcoxon", "a": [20],
        "b": [80], "n": 2, "p": 0.5, "p_holm": 0.5, "significant": False,
        "reason": f"2 seeds that differ {EVIL}",
    })  # fmt: skip
    return StudyResult(
        title=f"study {EVIL}", kind="one_at_a_time", design=design, table=table,
        responses=(Response("gap_percent", False, 0.0),),
        varied=(Varied("algorithm.population", 80), Varied("algorithm.kind", "a", True)),
        medians=medians, sensitivity=sensitivity, tests=tests, courses=courses, course_of="cost",
        recommendations=(
            Recommendation("gap_percent", 0, {}, False, (NAN, NAN, NAN), f"keep {EVIL}"),
        ),
        verdicts=(
            Verdict("Figure 9", "algorithm.population", (80, 20), "gap_percent", "holds",
                    f"it holds {EVIL}"),
            Verdict("Figure 10", "algorithm.kind", ("a", "b"), "gap_percent", "undecided",
                    "no course of this"),
        ),
        notes=(f"a note {EVIL}",), configuration=f"# {EVIL}",
    )  # fmt: skip


def test_page_is_whole_escaped_and_loads_nothing(result: StudyResult) -> None:
    text = study_page(result)
    tags = parsed(text)
    assert [tag for tag, _ in tags.seen].count("script") == 2  # the data and our own
    assert text.count("&lt;script&gt;") >= 6  # title, note, reading, recommendation, test, failure
    assert not any("src" in attrs for _, attrs in tags.seen)
    assert all((attrs.get("href") or "#").startswith("#") for _, attrs in tags.seen)
    identifiers = [attrs["id"] for _, attrs in tags.seen if "id" in attrs]
    assert len(identifiers) == len(set(identifiers))
    drawings = [attrs for tag, attrs in tags.seen if tag == "svg"]
    assert len(drawings) == 3 and all(one.get("aria-label") for one in drawings)


def test_page_tells_readings_recommendation_tests_and_failures(result: StudyResult) -> None:
    text = study_page(result)
    course, reading = text.index("<figure>"), text.index("it holds")
    assert course < reading < text.index("<h2>Responses</h2>")
    assert "<h2>Interpretations</h2>" in text and "no course of this" in text
    failed = text[text.index("<h2>Failed runs</h2>") :]
    assert failed.count("<tr") == 2 and "ValueError" in failed
    marked = text[text.index("<h2>Sensitivities</h2>") : text.index("<h2>Tests</h2>")]
    assert marked.count("<tr class=mark") == 2
    bare = replace(result, sensitivity=result.sensitivity[:0], tests=result.tests[:0],
                   courses=result.courses[:0], notes=())  # fmt: skip
    text = study_page(bare)
    assert "compares no levels side by side" in text
    assert "<p>None.</p>" not in text  # sections without content are not there


def drawn(result: StudyResult, name: str) -> Figure:
    return next(one.figure for one in figures(result) if one.name == name)


def test_figures_have_names_of_their_own_and_the_same_bytes(result: StudyResult) -> None:
    first, second = figures(result), figures(result)
    names = ["course_population", "response_gap_percent", "sensitivity"]
    assert [one.name for one in first] == names
    for one, other in zip(first, second, strict=True):
        assert as_svg(one.figure) == as_svg(other.figure)
        assert as_png(one.figure)[:4] == b"\x89PNG"


def test_course_has_a_band_and_a_median_per_level_and_the_optimum(result: StudyResult) -> None:
    axes = drawn(result, "course_population").axes[0]
    lines = {str(line.get_label()): line.get_ydata() for line in axes.lines}
    np.testing.assert_array_equal(lines["population 80"], [9.0, 3.0])
    np.testing.assert_array_equal(lines["population 20"], [9.5, 6.0])
    np.testing.assert_array_equal(lines["exact optimum"], [2.0, 2.0])
    assert len(axes.collections) == 2
    assert axes.get_ylabel() == "cost"


def test_response_shows_the_runs_of_settings_that_leave_the_other_keys_alone(result: StudyResult) -> None:
    size, kind = drawn(result, "response_gap_percent").axes
    runs = size.lines[0]
    np.testing.assert_array_equal(runs.get_xdata(), [80, 80, 20, 20])
    np.testing.assert_array_equal(runs.get_ydata(), [1.0, 2.0, 5.0, 6.0])
    assert [text.get_text() for text in kind.get_xticklabels()] == ["a", "b"]
    assert size.lines[-1].get_ydata() == [0.0, 0.0]  # the best there can be


def test_sensitivities_stand_with_their_intervals(result: StudyResult) -> None:
    axes = drawn(result, "sensitivity").axes[0]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["population", "kind", "noise"]
    share: Any = axes.containers[0]
    np.testing.assert_allclose(share.lines[0].get_xdata().tolist(), [0.8, 0.0])
    ends = [one[:, 0].tolist() for one in share.lines[2][0].get_segments()]
    np.testing.assert_allclose(ends, [[0.6, 0.9], [-0.1, 0.1]])


def test_the_page_is_built_again_from_what_is_stored(result: StudyResult) -> None:
    again, bad = load_result(StudyResult, json.loads(dump_result(result)))
    assert bad == []
    assert study_page(again) == study_page(result)


def test_what_is_missing_in_the_stored_page_is_named(result: StudyResult) -> None:
    content = json.loads(dump_result(result))
    del content["fields"]["notes"]
    content["fields"]["title"] = 3
    again, bad = load_result(StudyResult, content)
    assert sorted(bad) == ["notes", "title"]
    assert again.notes == ()
