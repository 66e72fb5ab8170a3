"""Pages in a real browser: clicks, keys, what is asked, copying, widths, no network, axe-core."""

from __future__ import annotations

import csv
import io
import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
import pytest

from tests.page.test_claims_page import result as claims
from tests.page.test_gap_page import result as gap
from tests.page.test_study_page import result as study
from tests.small_jobs import HOUSING_AND_SHAFT
from tolevo.commands.comparison_page import comparison_page
from tolevo.commands.gap.page import gap_page
from tolevo.commands.reproduce.page import claims_page
from tolevo.commands.run.decide import decide
from tolevo.commands.study.page import study_page
from tolevo.configuration.reader import read
from tolevo.page import page
from tolevo.page.sheet import drawing_page
from tolevo.problems.tolerance_problem import designs_of
from tolevo.records import Axis, Compared, Comparison, Response, RunResult, StudyResult, Varied

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(
    CHROMIUM is None and not os.environ.get("CI"), reason="no chromium here: apt-get install chromium"
)
__all__ = ["claims", "gap", "study"]
EVIL = "<script>alert(1)</script>"
MOST_BYTES = 1_500_000
MOST_SECONDS = 1.0
MOST_CLICK = 0.1
SCROLLED = "document.documentElement.scrollWidth"
OPENED = "document.querySelectorAll('details').forEach((d) => d.open = true)"
SCHEMES: tuple[Literal["light"], Literal["dark"]] = ("light", "dark")


class Watched:
    """A page of a browser that remembers what it should not have done."""

    def __init__(self, browser: Browser, path: Path, width: int = 1280, dark: bool = False) -> None:
        context = browser.new_context(
            viewport={"width": width, "height": 900},
            color_scheme="dark" if dark else "light",
            permissions=["clipboard-read", "clipboard-write"],
        )
        self.page: Page = context.new_page()
        self.wrong: list[str] = []
        self.page.on("console", lambda message: self.wrong.append(message.text))
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("dialog", lambda dialog: self.wrong.append(dialog.message))
        self.page.on("request", lambda request: self._requested(request.url, path))
        self.session = context.new_cdp_session(self.page)
        self.session.send("Performance.enable", {"timeDomain": "threadTicks"})
        self.page.goto(path.as_uri())

    def _requested(self, url: str, path: Path) -> None:
        if url != path.as_uri() and not url.startswith("data:"):
            self.wrong.append(f"requested {url}")

    @property
    def seconds(self) -> float:
        """Time [s] that opening took the page's own thread: what it takes on an idle machine."""
        metrics = self.session.send("Performance.getMetrics")["metrics"]
        return {one["name"]: float(one["value"]) for one in metrics}["TaskDuration"]

    @property
    def headline(self) -> str:
        return self.page.locator("#headline").inner_text()


def result(points: int = 41, third: bool = False) -> RunResult:
    """A front cost = 1/error of two tolerances; the knee is the row in the middle."""
    error = np.geomspace(4.0, 0.25, points)
    front = pd.DataFrame({"a_um": error, EVIL: 2.0 * error, "cost": 1.0 / error, "error_um": error,
                          "bound": 0.9 / error, "gap_percent": 100 / 9, "knee": False})  # fmt: skip
    objectives = [Axis("cost", ""), Axis("error_um", "um")]
    if third:
        front["effort"] = np.abs(np.sin(np.arange(points)))
        objectives.append(Axis("effort", ""))
    references = pd.DataFrame({"label": ["document", EVIL], "feasible": [True, False],
                               "violated_limits": ["", EVIL], "cost": [2.0, 3.0],
                               "error_um": [2.0, 1.0], "effort": [0.5, 0.5], "a_um": [2.5, 1.0],
                               EVIL: [2.0, 1.0]})  # fmt: skip
    middle = points // 2
    choices = pd.DataFrame({"choice": ["knee", "nash"], "meaning": ["m", EVIL],
                            "point": [middle, middle + 1]})  # fmt: skip
    allocation = pd.DataFrame({"point": [middle, middle], "variable": ["a_um", EVIL],
                               "rounded": [1.25, 2.5]})  # fmt: skip
    contributions = pd.DataFrame({"point": range(points), "output": "error_um",
                                  "explained": "error_um", "along": error, "a_um": 25.0,
                                  EVIL: 75.0})  # fmt: skip
    exact = front[["cost", "error_um"]] * 0.99
    return RunResult(
        f"Run of {EVIL}", front, references, pd.DataFrame(),
        {"ideal": {"cost": 0.1, "error_um": 0.1, "effort": 0.0}}, tuple(objectives),
        (Axis("a_um", "um", "first"), Axis(EVIL, "um", EVIL)), (EVIL,), (), f"# {EVIL}\n",
        choices=choices, allocation=allocation, contributions=contributions, exact_front=exact,
    )  # fmt: skip


def written(folder: Path, one: RunResult) -> Path:
    path = folder / "report.html"
    path.write_text(page(one), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def seen(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Watched:
    return Watched(browser, written(tmp_path_factory.mktemp("page"), result()))


def test_list_slider_and_keys_select_a_point(seen: Watched) -> None:
    assert seen.headline.startswith("Allocation 21 of 41 (knee): cost 1; error 1 um")
    seen.page.select_option("#named", "choice1")
    assert seen.headline.startswith("Allocation 22 of 41 (nash)")
    seen.page.focus("#along")
    seen.page.keyboard.press("Home")
    assert seen.headline.startswith("Allocation 1 of 41: cost 0.25; error 4 um")
    assert seen.page.locator("#named").input_value() == ""
    seen.page.select_option("#named", "choice0")
    text = seen.page.locator("#detail").inner_text()
    assert "nothing costs less than 0.9; this point lies 11.1 % above" in text
    assert "25 %" in text
    assert "75 %" in text
    assert seen.wrong == []


def _place(seen: Watched, row: int) -> list[float]:
    """Where a point of the front is on the screen."""
    found = seen.page.evaluate(
        """(row) => {
          const box = document.querySelector(".plot .chart").getBoundingClientRect();
          const [x, y] = tolevo.charts[0].view.where(tolevo.found.rows.indexOf(row));
          return [box.x + x, box.y + y];
        }""",
        row,
    )
    return list(map(float, found))


def test_a_click_and_a_drag_select_the_nearest_point(seen: Watched) -> None:
    seen.page.mouse.click(*_place(seen, 30))
    assert seen.headline.startswith("Allocation 31 of")
    seen.page.mouse.move(*_place(seen, 30))
    seen.page.mouse.down()
    seen.page.mouse.move(*_place(seen, 10), steps=4)
    seen.page.mouse.up()
    assert seen.headline.startswith("Allocation 11 of")
    assert seen.page.locator(".tip").inner_text().startswith("Allocation 11 of")
    assert seen.page.evaluate("tolevo.found.rows[tolevo.charts[0].view.ring]") == 10
    assert seen.wrong == []


def test_the_allocation_is_copied_as_csv(seen: Watched) -> None:
    seen.page.select_option("#named", "choice0")
    seen.page.click("#copy")
    seen.page.wait_for_selector("#said:has-text('copied')")
    text = seen.page.evaluate("navigator.clipboard.readText()")
    assert text.splitlines() == [
        "name,unit,value,rounded", "a_um,um,1,1.25", f"{EVIL},um,2,2.5", "cost,,1,",
        "error_um,um,1,",
    ]  # fmt: skip
    assert seen.wrong == []


@pytest.mark.parametrize(("width", "dark"), [(1280, True), (390, False)])
def test_three_objectives_fit_and_text_stays_text(browser: Browser, tmp_path: Path, width: int, dark: bool) -> None:
    seen = Watched(browser, written(tmp_path, result(third=True)), width, dark)
    assert seen.page.evaluate("document.documentElement.scrollWidth") == width
    assert seen.page.locator(".plot").count() == 4  # three planes, parallel coordinates
    seen.page.focus("#along")
    seen.page.keyboard.press("ArrowRight")
    assert len(set(seen.page.evaluate("tolevo.charts.map((one) => one.view.ring)"))) == 1
    assert seen.page.locator("h1").inner_text() == f"Run of {EVIL}"
    seen.page.click("#view-beside")
    seen.page.select_option("#against", "1")
    assert EVIL in seen.page.locator("#allocation").inner_text()
    ink = seen.page.evaluate("getComputedStyle(document.body).color")
    assert ink == ("rgb(230, 231, 233)" if dark else "rgb(27, 27, 27)")
    assert seen.wrong == []


def test_a_brush_on_an_axis_greys_what_lies_outside(browser: Browser, tmp_path: Path) -> None:
    seen = Watched(browser, written(tmp_path, result(third=True)))
    box = seen.page.locator("#parallel .chart").bounding_box()
    assert box is not None
    ends = seen.page.evaluate("""() => [3, 1].map((value) => tolevo.parallel.place("a_um", value))""")
    seen.page.mouse.move(box["x"] + ends[0][0], box["y"] + ends[0][1])
    seen.page.mouse.down()
    seen.page.mouse.move(box["x"] + ends[1][0], box["y"] + ends[1][1], steps=3)
    seen.page.mouse.up()
    kept = seen.page.evaluate("tolevo.found.values[0].filter((_, at) => tolevo.state.kept[at])")
    whole = np.geomspace(4.0, 0.25, 41)
    expected = whole[(whole >= 0.99) & (whole <= 3.01)]
    assert len(kept) == pytest.approx(len(expected), abs=1)
    assert f"{len(kept)} of 41 points" in seen.page.locator("#told").inner_text()
    assert seen.wrong == []


def test_five_thousand_points_open_in_time_and_answer_a_click(browser: Browser, tmp_path: Path) -> None:
    one = result(5000)
    more = {f"v{at}_um": np.random.default_rng(at).random(5000) for at in range(12)}
    wide = replace(one, front=one.front.assign(**more),
                   variables=(*one.variables, *(Axis(name, "um") for name in more)))  # fmt: skip
    path = written(tmp_path, wide)
    assert path.stat().st_size < MOST_BYTES
    seen = Watched(browser, path)
    assert 0.01 < seen.seconds < MOST_SECONDS
    assert seen.headline.startswith("Allocation 2501 of 5000")
    assert "of 5000 points" in seen.page.locator(".work .hint").first.inner_text()
    before = seen.seconds
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft"):
        seen.page.focus("#along")
        seen.page.keyboard.press(key)
    assert (seen.seconds - before) / 3 < MOST_CLICK
    assert seen.wrong == []


STACK = (
    HOUSING_AND_SHAFT.replace('"reciprocal", a = 2.0, b = 0.3', '"reciprocal_power", a = 2.0, b = 0.3, k = 0.8')
    + """
[[part]]
name = "ring"
nominal = 20.29
unit = "mm"
sensitivity = -1.0
t_min = 0.003
t_max = 0.25
cost = { model = "exponential", a = 1.0, b = 4.0, m = 20.0 }
[[part]]
name = "bearing"
nominal = 12.0
unit = "mm"
sensitivity = 0.5
tolerance = 0.02
"""
)


MACHINE = {
    "cost": 61.6,
    "poses": [[300.0, 0.0, 100.0], [650.0, 0.0, 100.0], [650.0, 0.0, 300.0]],
    "parts": [
        {"name": "arm 1", "kind": "link", "share": 9.0, "points": [[0, 0, 400], [300, 90, 400]]},
        {"name": f"rod {EVIL}", "kind": "link", "share": 0.0, "points": [[300, 90, 400], [450, 0, 200]]},
        {"name": "joint 1", "kind": "joint", "share": 61.0, "points": [[0, 0, 400]]},
        {"name": "joint 2", "kind": "joint", "share": 30.0, "points": [[300, 90, 400]]},
        {"name": "platform", "kind": "tool", "share": 0.0, "points": [[450, 0, 200], [470, 0, 180]]},
    ],
}


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Any:
    path = tmp_path_factory.mktemp("stack") / "c.toml"
    path.write_text(STACK, encoding="utf-8")
    return read(path).problem


@pytest.fixture(scope="module")
def real(problem: Any) -> RunResult:
    """The exact front of a stack of three parts and a bought one, by the conditions of an optimum:
    -C'(t) of every part is the price times the slope of the variation.
    """
    from tolevo.algorithms.exact.bounds import proof
    from tolevo.algorithms.exact.solver import closed_form, exact_vectors

    form = closed_form(problem)
    assert form is not None
    designs = problem.complete(exact_vectors(problem, form, 80))
    front = problem.frame(designs).sort_values("cost").drop(columns="feasible")
    front = front.reset_index(drop=True).assign(knee=False)
    values = {name: front[name].to_numpy() for name in problem.objectives}
    found = proof(problem, values, len(front))
    front = front.assign(bound=found.bound, gap_percent=found.gap_percent(values["cost"]))
    from tolevo.commands.run.choice import ChoiceSettings

    decided = decide(problem, front, ChoiceSettings())
    reference = problem.frame(np.array([[0.05, 0.05, 0.05, 0.02]]))
    reference.insert(0, "label", ["document B"])
    reference["violated_limits"] = ""
    axes = [Axis(one.name, one.unit, one.meaning) for one in problem.variables]
    return RunResult(
        "Gap of the bearing", front, reference, pd.DataFrame(),
        {"answers": {"asked": "Least cost against least variation.", "found": "Found: all.",
                     "proof": found.statement},
         "mechanism": problem.mechanism(), "machine": MACHINE},
        (Axis("cost", ""), Axis("variation", "mm")), tuple(axes), (), (), "",
        choices=decided.choices, allocation=decided.allocation, prices=decided.prices,
        contributions=decided.contributions, tolerances=decided.tolerances, changes=decided.changes,
    )  # fmt: skip


@pytest.fixture(scope="module")
def worked(browser: Browser, real: RunResult, tmp_path_factory: pytest.TempPathFactory) -> Watched:
    return Watched(browser, written(tmp_path_factory.mktemp("worked"), real), 1400)


def test_six_questions_are_answered_on_the_first_screen(worked: Watched, real: RunResult) -> None:
    """What to loosen first, what less costs, cheapest within, a capped grade, beside a document,
    what to write on the drawing.
    """
    tab = worked.page
    box = tab.locator("#work").bounding_box()
    assert box is not None
    assert box["y"] + box["height"] <= 900  # one screen, without scrolling
    assert tab.locator("#first").inner_text().startswith("Loosen first: ")
    slope = tab.locator("#slope").inner_text()
    assert "mm less variation costs about" in slope
    assert "by the multiplier of the proven optimum" in slope
    tab.fill("[data-aim=variation]", "0.1")
    cheapest = real.front[real.front["variation"] <= 0.1]["cost"].idxmin()
    assert worked.headline.startswith(f"Allocation {int(str(cheapest)) + 1} of")
    tab.fill("[data-aim=variation]", "")
    tab.fill("[data-grade]", "8")
    half = {"housing_t": 0.023, "shaft_t": 0.0195, "ring_t": 0.0165}  # half of IT8, ISO 286-1
    kept = np.all([real.front[name] >= least - 1e-12 for name, least in half.items()], axis=0)
    assert f"{kept.sum()} of {len(real.front)} points" in tab.locator("#told").inner_text()
    tab.fill("[data-grade]", "")
    tab.click("#view-beside")
    assert "document B" in tab.locator("#allocation").inner_text()
    tab.select_option("#named", "choice0")
    tab.click("#view-drawing")
    text = tab.locator("#allocation").inner_text()
    assert "verified by the full model" in text
    assert "55.29 \u00b1" in text
    tab.click("#view-matters")
    assert worked.wrong == []


def test_what_the_page_shows_agrees_with_the_model(worked: Watched, problem: Any, real: RunResult) -> None:
    """Single steps by evaluating the moved design; the price of a requirement by the slope of the
    front; nothing is advised of an allocation that was not tried.
    """
    worked.page.select_option("#named", "choice0")
    row = worked.page.evaluate("tolevo.found.rows[tolevo.state.at]")
    design = designs_of(problem, real.front.iloc[[row]])
    found = worked.page.evaluate(
        """() => {
          const at = tolevo.state.at, shaft = tolevo.found.tolerances.find((one) => one.name === "shaft_t");
          return { steps: tolevo.model.steps(shaft, at), price: tolevo.model.requirements(at)[0].price,
                   grades: shaft.grades };
        }"""
    )
    assert len(found["steps"]) == 2
    for step in found["steps"]:
        moved = design.copy()
        grade = dict(found["grades"]).get(step["to"])
        moved[0, problem.names.index("shaft_t")] = float(step["to"].removesuffix(" mm")) if grade is None else grade
        both = problem.outputs_of(np.vstack([design, moved]))
        np.testing.assert_allclose(step["cost"], np.diff(both["cost"])[0], rtol=1e-5)
        np.testing.assert_allclose(step["each"][0], np.diff(both["variation"])[0], rtol=1e-5)
    near = real.front.iloc[[row - 1, row + 1]]
    slope = -np.diff(near["cost"])[0] / np.diff(near["variation"])[0]
    assert found["price"] == pytest.approx(slope, rel=0.02)
    worked.page.click("#designs")
    worked.page.wait_for_selector("#said:has-text('copied')")
    (line,) = csv.DictReader(io.StringIO(worked.page.evaluate("navigator.clipboard.readText()")))
    assert real.allocation is not None
    rounded = real.allocation[real.allocation["point"] == row]["rounded"]
    assert [float(line[name]) for name in problem.names] == pytest.approx(list(rounded))
    worked.page.evaluate("document.getElementById('along').value = 3")
    worked.page.locator("#along").dispatch_event("input")
    assert "select one of them" in worked.page.locator("#first").inner_text()
    assert worked.wrong == []


def test_shares_of_all_parts_add_up_and_units_are_drawn(worked: Watched) -> None:
    sums = worked.page.evaluate(
        """tolevo.found.contributions[0].rows.map((_, row) =>
           tolevo.found.contributions[0].shares.reduce((sum, one) => sum + one[row], 0))"""
    )
    np.testing.assert_allclose(sums, 100.0, atol=0.01)
    worked.page.click("#units summary")
    text = worked.page.locator("#units-body").inner_text()
    assert "Cpk" in text
    assert "ppm outside" in text
    worked.page.click("#units summary")


def _violations(tab: Page) -> list[str]:
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(tab)
    return [f"{one['id']}: {one['nodes'][0]['html'][:200]} {one['nodes'][0]['failureSummary']}"
            for one in found.response["violations"]]  # fmt: skip


@pytest.mark.parametrize(
    ("width", "dark"),
    [
        (390, True),
        (1400, False),
        pytest.param(390, False, marks=pytest.mark.slow),
        pytest.param(1400, True, marks=pytest.mark.slow),
    ],
)
def test_axe_finds_nothing_wrong(browser: Browser, tmp_path: Path, real: RunResult, width: int, dark: bool) -> None:
    drawing = tmp_path / "drawing.html"
    drawing.write_text(drawing_page(real) or "", encoding="utf-8")
    for path in (written(tmp_path, real), drawing):
        seen = Watched(browser, path, width, dark)
        assert seen.page.evaluate(SCROLLED) == width
        if path != drawing:
            seen.page.evaluate(OPENED)
        found = _violations(seen.page)
        assert found == []
        assert seen.page.evaluate(SCROLLED) == width
        assert seen.wrong == []
        seen.page.set_viewport_size({"width": 820, "height": 900})
        assert seen.page.evaluate(SCROLLED) == 820


@pytest.fixture(scope="module")
def pages(gap: Any, study: Any, claims: Any) -> dict[str, str]:
    """Pages of the records that their own tests write by hand."""
    import tolevo

    sheet = tolevo.analyse(SHEET).page
    return {"gap": gap_page(gap), "study": study_page(study), "claims": claims_page(claims), "sheet": sheet}


@pytest.mark.parametrize("kind", ["gap", "study", "claims", "sheet"])
def test_axe_finds_nothing_wrong_on_other_pages(
    browser: Browser, tmp_path: Path, pages: dict[str, str], kind: str
) -> None:
    path = tmp_path / "p.html"
    path.write_text(pages[kind], encoding="utf-8")
    seen = Watched(browser, path, 1400)
    for width in (1400, 390):
        seen.page.set_viewport_size({"width": width, "height": 900})
        assert seen.page.evaluate(SCROLLED) == width
        seen.page.evaluate(OPENED)
        for scheme in SCHEMES:
            seen.page.emulate_media(color_scheme=scheme)
            assert _violations(seen.page) == []
    assert seen.wrong == []


def test_claims_are_filtered_by_their_verdict(browser: Browser, tmp_path: Path, pages: dict[str, str]) -> None:
    path = tmp_path / "p.html"
    path.write_text(pages["claims"], encoding="utf-8")
    seen = Watched(browser, path)
    rows = seen.page.locator("#detail tbody tr:visible")
    whole = rows.count()
    seen.page.select_option("#filter", "not reproduced")
    assert 0 < rows.count() < whole
    assert all("not reproduced" in text for text in rows.all_inner_texts())
    assert seen.wrong == []


def test_settings_of_a_study_are_filtered_and_compared(browser: Browser, tmp_path: Path, pages: dict[str, str]) -> None:
    path = tmp_path / "p.html"
    path.write_text(pages["study"], encoding="utf-8")
    seen = Watched(browser, path)
    rows = seen.page.locator("#settings .scroll tbody tr")
    whole = rows.count()
    select = seen.page.locator("#settings .asks select").first
    select.select_option(index=1)
    assert 0 < rows.count() < whole
    seen.page.select_option("#second-setting", str(whole - 1))
    assert "first setting" in seen.page.locator("#settings").inner_text().lower()
    assert seen.wrong == []


def test_a_study_of_two_thousand_runs_opens_in_time(browser: Browser, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    keys = ("algorithm.population", "algorithm.mutation.probability")
    levels = (np.repeat([20, 40, 60, 80], 10), np.tile(np.linspace(0, 1, 10), 4))
    design = pd.DataFrame(dict(zip(keys, levels, strict=True)))
    points = np.repeat(np.arange(40), 50)
    table = design.loc[points].reset_index(drop=True)
    table = table.assign(point=points, status="failed", reason=EVIL, gap_percent=rng.random(2000))
    medians = pd.DataFrame({"response": "gap_percent", "point": range(40), "median": 0.5,
                            "low": 0.4, "high": 0.6, "level": 0.95, "n": 50, "failed": 0,
                            "reached": 50})  # fmt: skip
    courses = pd.DataFrame({"key": "algorithm.population", "level": np.repeat(range(8), 400),
                            "generation": np.tile(range(400), 8), "median": rng.random(3200),
                            "low": 0.0, "high": 1.0, "optimum": 0.1, "level_of_interval": 0.95,
                            "n": 50})  # fmt: skip
    many = StudyResult(
        "t", "factorial", design, table, (Response("gap_percent", False, 0.0),),
        tuple(Varied(key, 20) for key in keys), medians, pd.DataFrame(), pd.DataFrame(),
        courses, "hypervolume", (), (), (EVIL,),
    )  # fmt: skip
    path = tmp_path / "s.html"
    path.write_text(study_page(many), encoding="utf-8")
    assert path.stat().st_size < MOST_BYTES
    seen = Watched(browser, path, 390)
    assert 0.001 < seen.seconds < MOST_SECONDS
    assert seen.page.evaluate("document.documentElement.scrollWidth") == 390
    assert seen.wrong == []


def test_several_runs_side_by_side(browser: Browser, tmp_path: Path) -> None:
    one = result()
    runs = tuple(Compared(label, one.front, one.references) for label in ("a", EVIL))
    table = pd.DataFrame({"run": ["a", EVIL], "hypervolume": [0.5, 0.6]})
    text = comparison_page(Comparison("t", one.objectives, runs, table, pd.DataFrame(), (EVIL,)))
    path = tmp_path / "c.html"
    path.write_text(text, encoding="utf-8")
    seen = Watched(browser, path, 390)
    names = seen.page.locator(".legend li").all_inner_texts()
    assert [name.strip() for name in names] == ["a, 41 points", f"{EVIL}, 41 points"]
    assert _violations(seen.page) == []
    assert seen.page.evaluate("document.documentElement.scrollWidth") == 390
    assert seen.wrong == []


SHEET = {
    "problem": "stack",
    "requirement": {"name": f"gap {EVIL}", "unit": "mm", "formula": "a - b - c", "lower": -0.1, "upper": 0.3},
    "part": [
        {"name": "a", "nominal": 20.0, "tolerance": 0.05},
        {"name": "b", "nominal": 12.0, "tolerance": 0.1},
        {"name": "c", "nominal": 7.9, "tolerance": 0.12},
    ],
}


@pytest.mark.parametrize("width", [1400, 390])
def test_what_if_of_a_sheet_follows_what_is_typed(browser: Browser, tmp_path: Path, width: int) -> None:
    import tolevo

    path = tmp_path / "sheet.html"
    path.write_text(tolevo.analyse(SHEET).page, encoding="utf-8")
    seen = Watched(browser, path, width)
    assert seen.page.evaluate(SCROLLED) == width
    assert seen.page.locator("#histograms svg.chart").count() == 1
    assert seen.page.locator("#histograms svg.chart").bounding_box()["y"] < (900 if width == 1400 else 2500)  # type: ignore[index]

    def typed(what: str, value: str) -> None:
        seen.page.get_by_label(what, exact=True).fill(value)

    def cells() -> list[str]:
        return [cell.replace("\u2212", "-") for cell in seen.page.locator("#whatif tbody td").all_inner_texts()]

    typed("half-width of c", "0,06")  # a decimal comma
    typed("mean shift of a", "0.02")
    typed("change of the nominal of b", "-0.05")
    typed("Cp of b", "2")
    mean = 0.1 + 0.02 + 0.05
    sigma = np.sqrt((0.05 / 3) ** 2 + (0.1 / 6) ** 2 + (0.06 / 3) ** 2)
    unit, shown_mean, worst, spread, cpk, _, _ = cells()
    assert unit == "mm"
    assert float(shown_mean) == pytest.approx(mean, abs=1e-5)
    assert [float(end) for end in worst.split(" to ")] == pytest.approx([0.15 - 0.21, 0.15 + 0.21], abs=1e-5)
    assert [float(end) for end in spread.split(" to ")] == pytest.approx([mean - 3 * sigma, mean + 3 * sigma], abs=1e-4)
    assert float(cpk) == pytest.approx((0.3 - mean) / (3 * sigma), abs=5e-3)
    typed("half-width of c", "wide")
    assert "half-width of c must be a number" in seen.page.locator("#whatif").inner_text()
    assert cells()[4] == cpk  # what is no number changes nothing
    seen.page.get_by_role("button", name="as analysed").click()
    assert float(cells()[1]) == pytest.approx(0.1, abs=1e-6)
    assert seen.page.evaluate("document.querySelectorAll('script:not([type])').length") == 1
    assert seen.wrong == []


PRICED = {
    "problem": "stack",
    "requirement": {"name": "gap", "unit": "mm", "formula": "a - b - c", "lower": 0.0, "upper": 0.2},
    "part": [
        {"name": name, "nominal": size, "t_min": 0.005, "t_max": 0.2, "tolerance": t,
         "cost": {"model": "reciprocal", "a": 1.0, "b": b}}
        for name, size, t, b in (("a", 20.0, 0.05, 0.1), ("b", 12.0, 0.04, 0.3), ("c", 7.9, 0.055, 0.02))
    ],
}  # fmt: skip


@pytest.mark.parametrize("width", [1400, 390])
def test_six_questions_are_answered_on_a_sheet(browser: Browser, tmp_path: Path, width: int) -> None:
    """What to loosen first, the price of 0.01 mm, a budget, the shift of a process, a capped grade, the drawing.

    Costs b/t have the closed form t = T b^(1/3) / sqrt(sum b^(2/3)) at a root sum square of T, and the least
    cost sum a + (sum b^(2/3))^(3/2) / T.
    """
    import tolevo

    path = tmp_path / "sheet.html"
    path.write_text(tolevo.analyse(PRICED).page, encoding="utf-8")
    seen = Watched(browser, path, width)
    b = np.array([0.1, 0.3, 0.02])
    size = np.sum(b ** (2 / 3)) ** 1.5

    def field(what: str) -> float:
        return float(seen.page.get_by_label(what, exact=True).input_value())

    def cells(table: str) -> list[str]:
        return [cell.replace("\u2212", "-") for cell in seen.page.locator(f"{table} tbody td").all_inner_texts()]

    # what to loosen first: the step that saves most and keeps 0.1 mm as root sum square
    first = seen.page.locator("#first").inner_text()
    now = np.array([0.05, 0.04, 0.055])
    steps = {"a": 0.055, "b": 0.042, "c": 0.06}
    saves = {name: b[at] * (1 / now[at] - 1 / t) for at, (name, t) in enumerate(steps.items())}
    best = max(saves, key=lambda name: saves[name])
    assert np.hypot(np.hypot(*np.delete(now, "abc".index(best))), steps[best]) < 0.1
    assert first.startswith(f"Loosen first: {best}, to {steps[best]:g} mm: saves {saves[best]:.3g}")
    # the price of 0.01 mm
    prices = seen.page.locator("section", has=seen.page.get_by_role("heading", name="Costs", exact=True))
    row = prices.locator("table").first.locator("tbody tr").first.locator("th, td").all_inner_texts()
    assert float(row[2]) == 0.01
    assert float(row[3]) == pytest.approx(size * (1 / 0.1 - 1 / 0.11), rel=1e-3)
    assert float(row[4]) == pytest.approx(size * (1 / 0.09 - 1 / 0.1), rel=1e-3)
    # a budget: the best allocation at no more than it
    seen.page.get_by_label("budget", exact=True).fill(f"{3.0 + size / 0.1 + 0.01:.4f}".replace(".", ","))
    t = 0.1 * b ** (1 / 3) / np.sqrt(np.sum(b ** (2 / 3)))
    assert [field(f"half-width of {name}") for name in "abc"] == pytest.approx(list(t), rel=1e-4)
    assert float(cells("#whatif")[4]) == pytest.approx(1.0, abs=5e-3)
    assert "reaches a least ratio of room to variation of 1 (gap)" in seen.page.locator("#whatif").inner_text()
    # the shift of a process: a tenth of the room takes a tenth of Cpk
    seen.page.get_by_label("mean shift of a", exact=True).fill("0,01")
    assert float(cells("#whatif")[4]) == pytest.approx(0.9, abs=5e-3)
    # a capped grade: half of IT8 of ISO 286-1, where that is wider
    seen.page.get_by_role("button", name="as analysed").click()
    seen.page.get_by_label("grade of a", exact=True).select_option("IT7")
    assert field("half-width of a") == pytest.approx(0.0105)
    seen.page.get_by_label("no grade finer than IT", exact=True).fill("8")
    assert field("half-width of a") == pytest.approx(0.0165)
    assert [field(f"half-width of {name}") for name in "bc"] == [0.04, 0.055]
    # what to write on the drawing
    tolerances = seen.page.locator("section", has=seen.page.get_by_role("heading", name="Tolerances", exact=True))
    assert "20 \u00b10.05 mm" in tolerances.inner_text()
    assert seen.page.evaluate(SCROLLED) == width
    assert seen.wrong == []
