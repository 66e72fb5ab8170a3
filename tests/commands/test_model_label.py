"""Numbers of one of several models name it, wherever they appear."""

from __future__ import annotations

import io
import json
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from openpyxl import load_workbook

from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.settings import Budget
from tolevo.commands.report import report
from tolevo.commands.run.plan import RunOutcome, RunPlan
from tolevo.commands.run.run import run
from tolevo.configuration.reader import read_table
from tolevo.page.page import page
from tolevo.problems.pose_accuracy import PoseAccuracy
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Settings

pytestmark = pytest.mark.usefixtures("unrendered")

STATEMENT = "document B's closed form"
CHOSEN = "; by contact this allocation keeps 1 arcmin in "


class Silent(RvBacklash):
    """The problem that no other model is asked about."""

    def finer_verdicts(self, designs: NDArray[np.float64]) -> tuple[str, ...]:
        return ()


class Judged(RvBacklash):
    """The problem with another model's word on every design: its cost stands in for a share."""

    def finer_verdicts(self, designs: NDArray[np.float64]) -> tuple[str, ...]:
        return tuple(f"by contact this allocation keeps 1 arcmin in {cost:.3f} %" for cost in self.cost_of(designs))


def outcome(kind: type[RvBacklash], folder: Path) -> RunOutcome:
    problem = kind(Settings(parameters={"reading": "printed"}))
    plan = RunPlan(problem, NSGA2(population=20), Budget(generations=5), 3, False, "# none\n", "t")
    return run(plan, folder)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    return outcome(Silent, tmp_path_factory.mktemp("label") / "plain")


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    return outcome(Judged, tmp_path_factory.mktemp("label") / "judged")


def test_summary_and_terminal_name_the_model(plain: RunOutcome) -> None:
    summary = json.loads((plain.folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["model"] == "document"
    assert summary["model_statement"] == STATEMENT
    assert all(one["model"] == STATEMENT for one in summary["choices"].values())
    assert plain.lines[1] == f"model: {STATEMENT}"


def test_page_names_it_before_the_front(plain: RunOutcome) -> None:
    text = (plain.folder / "report.html").read_text(encoding="utf-8")
    said = text.index("All numbers on this page are by document B&#x27;s closed form.")
    assert said < text.index('id="work"')
    again = report([plain.folder], plain.folder / "again.html")
    assert "closed form.</strong>" in again.path.read_text(encoding="utf-8")


def test_every_row_of_the_allocation_names_it(plain: RunOutcome) -> None:
    table = pd.read_csv(plain.folder / "allocation.csv")
    assert set(table["model"]) == {STATEMENT}
    book = load_workbook(io.BytesIO((plain.folder / "allocation.xlsx").read_bytes()))
    head, first = list(book["Allocation"].values)[:2]
    assert dict(zip(head, first, strict=True))["model"] == STATEMENT


def test_verdict_of_contact_stands_beside_every_choice(judged: RunOutcome) -> None:
    """Of the chosen design on terminal, page and summary, of the rounded one in the allocation."""
    choices = pd.read_csv(judged.folder / "choices.csv")
    for one in choices.to_dict("records"):
        assert one["model"] == f"{STATEMENT}{CHOSEN}{one['cost']:.3f} %"
        assert f"{one['choice']}: {one['model']}" in judged.lines
    table = pd.read_csv(judged.folder / "allocation.csv").set_index("point")
    for point, rounded in choices.groupby("point")["rounded_cost"].first().items():
        (said,) = set(table.loc[[point], "model"])
        assert said == f"{STATEMENT}{CHOSEN}{rounded:.3f} %"
    text = page(judged.result)
    assert text.count("by contact this allocation keeps") >= 2 * len(choices)


def test_check_names_it() -> None:
    from tolevo.configuration.description import describe

    text = describe(read_table(tomllib.loads('problem = "rv_backlash"'), []))
    assert f"# Model\n#   {STATEMENT}\n" in text


def test_problems_with_one_model_say_nothing() -> None:
    problem = PoseAccuracy()
    designs = problem.complete(np.atleast_2d(problem.xl))
    assert problem.declaration.model_name == problem.declaration.model_statement == ""
    assert problem.model_labels(designs) == ("",)
