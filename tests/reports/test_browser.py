"""Pages in a real browser: clicks, sliders, copying, two widths, no network, text stays text."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

from tolevo.records import Axis, Compared, Comparison, Response, RunResult, StudyResult, Varied
from tolevo.reports import page
from tolevo.reports.comparison import comparison_page
from tolevo.reports.study import study_page

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(
    CHROMIUM is None and not os.environ.get("CI"),
    reason="no chromium here: apt-get install chromium",
)
EVIL = "<script>alert(1)</script>"
MOST_BYTES = 6_000_000
MOST_SECONDS = 3.0


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    assert CHROMIUM is not None, "pages are tested in chromium: apt-get install chromium"
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield found
        found.close()


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
        return self.page.locator("#detail h3").inner_text()


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
                                  "explained": "error_um", "a_um": 25.0, EVIL: 75.0})  # fmt: skip
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


def test_list_sliders_and_keys_select_a_point(seen: Watched) -> None:
    assert seen.headline.startswith("Point 20 (knee): cost 1; error 1 um")
    seen.page.select_option("#named", "choice1")
    assert seen.headline.startswith("Point 21 (nash)")
    seen.page.focus("#along")
    seen.page.keyboard.press("Home")
    assert seen.headline.startswith("Point 0: cost 0.25; error 4 um")
    assert seen.page.locator("#named").input_value() == ""
    seen.page.locator(".worth").fill("100")
    assert seen.headline.startswith("Point 40: cost 4; error 0.25 um")
    seen.page.locator(".worth").fill("50")
    assert seen.headline.startswith("Point 20 (knee)")  # gains of both are equal there
    text = seen.page.locator("#detail").inner_text()
    assert "costs less than 0.9; this point lies 11.11 % above" in text
    assert "25.0 %" in text
    assert "75.0 %" in text
    assert seen.wrong == []


def test_a_click_on_a_point_shows_its_allocation(seen: Watched) -> None:
    place = seen.page.evaluate(
        """() => {
          const div = document.querySelector(".plot"), layout = div._fullLayout;
          const box = div.querySelector(".nsewdrag").getBoundingClientRect();
          const [x, y] = [div.data[0].x[30], div.data[0].y[30]];
          return [box.x + layout.xaxis.l2p(x), box.y + layout.yaxis.l2p(y)];
        }"""
    )
    seen.page.mouse.move(*place)
    seen.page.mouse.click(*place)
    seen.page.wait_for_selector("#detail h3:has-text('Point 30')")
    ring = seen.page.evaluate("document.querySelector('.plot').data.at(-1).y[0]")
    assert ring == pytest.approx(4.0 * (0.25 / 4.0) ** 0.75, rel=1e-4)
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
def test_three_objectives_fit_and_text_stays_text(
    browser: Browser, tmp_path: Path, width: int, dark: bool
) -> None:
    seen = Watched(browser, written(tmp_path, result(third=True)), width, dark)
    assert seen.page.evaluate("document.documentElement.scrollWidth") == width
    assert seen.page.locator(".plot").count() == 4  # three planes, parallel coordinates
    seen.page.locator(".worth").first.fill("80")
    rings = seen.page.evaluate(
        """() => [...document.querySelectorAll(".plot")].slice(0, 3)
          .map((div) => div.data.at(-1)).map((ring) => [ring.x[0], ring.y[0]])"""
    )
    (cost, error), (same, effort), (error_, effort_) = rings
    assert (cost, error, effort) == (same, error_, effort_)  # the planes are linked
    assert seen.page.locator("h1").inner_text() == f"Run of {EVIL}"
    assert EVIL in seen.page.locator("#detail").inner_text()
    assert EVIL in seen.page.locator(".plot").first.text_content()  # type: ignore[operator]
    ink, paper = seen.page.evaluate(
        """() => [getComputedStyle(document.body).color,
          document.querySelector(".plot")._fullLayout.font.color]"""
    )
    assert ink == ("rgb(228, 228, 228)" if dark else "rgb(27, 27, 27)")
    assert paper == ("#e4e4e4" if dark else "#1b1b1b")
    assert seen.wrong == []


def test_five_thousand_points_open_in_time(browser: Browser, tmp_path: Path) -> None:
    one = result(5000)
    more = {f"v{at}_um": np.random.default_rng(at).random(5000) for at in range(12)}
    wide = replace(one, front=one.front.assign(**more),
                   variables=(*one.variables, *(Axis(name, "um") for name in more)))  # fmt: skip
    path = written(tmp_path, wide)
    assert path.stat().st_size < MOST_BYTES
    seen = Watched(browser, path)
    assert 0.1 < seen.seconds < MOST_SECONDS
    assert seen.headline.startswith("Point 2500")
    assert "of 5000 points" in seen.page.locator("#explorer .hint").first.inner_text()
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
    study = StudyResult(
        "t", "factorial", design, table, (Response("gap_percent", False, 0.0),),
        tuple(Varied(key, 20) for key in keys), medians, pd.DataFrame(), pd.DataFrame(),
        courses, "hypervolume", (), (), (EVIL,),
    )  # fmt: skip
    path = tmp_path / "s.html"
    path.write_text(study_page(study), encoding="utf-8")
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
    names = seen.page.locator(".legendtext").all_text_contents()
    assert [name.replace(" ", "") for name in names] == ["a,41points", f"{EVIL},41points"]
    assert seen.page.evaluate("document.documentElement.scrollWidth") == 390
    assert seen.wrong == []
