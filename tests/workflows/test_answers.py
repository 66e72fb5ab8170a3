"""The sentences with which a page and the terminal begin."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.workflows.run.answers import Sentences

STACK = """
problem = "stack"
seed = 1
[objectives]
minimise = ["cost"]
[limits]
variation = 0.1
[requirement]
name = "gap"
unit = "mm"
method = "worst_case"
[[part]]
name = "a"
nominal = 20.0
unit = "mm"
sensitivity = 1.0
t_min = 0.001
t_max = 0.5
cost = { model = "reciprocal", a = 0.0, b = 0.4 }
[[part]]
name = "b"
nominal = 30.0
unit = "mm"
sensitivity = -1.0
t_min = 0.001
t_max = 0.5
cost = { model = "reciprocal", a = 0.0, b = 0.1 }
[algorithm]
name = "exact"
"""


def test_one_optimum_in_sentences(tmp_path: Path) -> None:
    """Least b_1/t_1 + b_2/t_2 at t_1 + t_2 = V is (sqrt b_1 + sqrt b_2)^2 / V: 9 at 0.1 mm, and
    0.9 / 0.11 at 0.11 mm, which saves 0.818.
    """
    path = tmp_path / "c.toml"
    path.write_text(STACK, encoding="utf-8")
    told = CliRunner().invoke(app, ["run", str(path), "--out", str(tmp_path / "r"), "--quiet"])
    assert told.exit_code == 0, told.stderr
    text = told.stdout
    assert "Least cost, with variation at most 0.1 mm; 2 tolerances searched." in text
    assert "Found: cost 9 (with variation 0.1 mm)." in text
    assert "binds: raising it to 0.11 mm would save 0.818 (solved again)" in text
    assert re.search(r"Proven: this is the least cost within the limits \(", text)
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    head = page[page.index("<header>") : page.index("</header>")]
    assert "Found: cost 9 (with variation 0.1 mm)." in head
    assert "published" not in head
    assert (tmp_path / "r" / "drawing.html").is_file()


def test_a_least_cost_lies_above_or_below_a_published_one() -> None:
    """With cost alone there is nothing that could be equal; with a second objective there is."""
    one: Any = SimpleNamespace(names=["cost"])
    told = Sentences._gains(one, {"cost_saving_percent": 12.0}, "")
    assert told == "the least cost that was found is 12 % lower"
    told = Sentences._gains(one, {"relaxed_cost_saving_percent": -24.6}, "relaxed_")
    assert told == "the least cost that was found is 24.6 % higher"
    two: Any = SimpleNamespace(names=["cost", "backlash_arcmin"])
    told = Sentences._gains(two, {"cost_saving_percent": 12.0}, "")
    assert told == "there is an allocation that costs 12 % less at equal backlash"
