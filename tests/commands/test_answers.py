"""The sentences with which a page and the terminal begin."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import tolevo
from tolevo.cli import app
from tolevo.commands.run.answers import Sentences
from tolevo.commands.run.changes import advice
from tolevo.commands.run.promise import sentence
from tolevo.page import page
from tolevo.page.figures import orders
from tolevo.problems.limits import Limit
from tolevo.problems.settings import ASSURANCE
from tolevo.records import RunResult

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


def test_without_tolerances_and_costs_nothing_is_said_of_either(tmp_path: Path) -> None:
    """Tooth modification: two nominal values are searched, and nothing has a price."""
    path = tmp_path / "c.toml"
    text = 'problem = "tooth_modification"\nseed = 5\n[algorithm]\nname = "nsga2"\npopulation = 12\ngenerations = 3\n'
    path.write_text(text, encoding="utf-8")
    told = CliRunner().invoke(app, ["run", str(path), "--out", str(tmp_path / "r"), "--quiet"])
    assert told.exit_code == 0, told.stderr
    assert "; 2 variables searched." in told.stdout
    assert "tolerances searched" not in told.stdout
    assert "would save" not in told.stdout


def test_a_least_cost_lies_above_or_below_a_published_one() -> None:
    """With cost alone there is nothing that could be equal; with a second objective there is."""
    one: Any = SimpleNamespace(names=["cost"])
    told = Sentences._gains(one, {"cost_saving_percent": 12.0}, "")
    assert told == "the least cost that was found is 12 % lower"
    told = Sentences._gains(one, {"relaxed_cost_saving_percent": -24.6}, "relaxed_")
    assert told == "the least cost that was found is 24.6 % higher"
    force: Any = SimpleNamespace(names=["peak_mesh_force_N"])
    told = Sentences._gains(force, {"peak_mesh_force_N_gain_percent": 3.0}, "")
    assert told == "the least peak mesh force that was found is 3 % lower"
    two: Any = SimpleNamespace(names=["cost", "backlash_arcmin"])
    told = Sentences._gains(two, {"cost_saving_percent": 12.0}, "")
    assert told == "there is an allocation that costs 12 % less at equal backlash"
    told = Sentences._gains(two, {"cost_saving_percent": -3.0, "backlash_arcmin_gain_percent": 5.0}, "")
    assert told == "there is a backlash that is 5 % less at the same cost; the least cost that was found is 3 % more " \
        "at equal backlash"  # fmt: skip
    without: Any = SimpleNamespace(names=["backlash_arcmin", "peak_mesh_force_N"])
    told = Sentences._gains(without, {"backlash_arcmin_gain_percent": -387.0}, "")
    assert told == "the least backlash that was found is 387 % more at equal peak mesh force"


def test_a_published_allocation_that_breaks_a_limit_is_told_with_digits_that_show_it() -> None:
    """3.11843 breaks 3.118: with four digits both read alike."""
    limit = Limit("kc_sum_std_mrad", -np.inf, 3.118, 1.0, "mrad")
    one: Any = SimpleNamespace(names=["cost"], row=lambda _: "cost 14.54", _limit=lambda _: limit, _gains=lambda *_: "")
    row = {"label": "document A", "violated_limits": "kc_sum_std_mrad", "kc_sum_std_mrad": 3.11843}
    assert Sentences._comparison(one, row) == (
        "The published allocation (document A) has cost 14.54, but breaks the limits (kc sum std 3.1184 instead of at "
        "most 3.118 mrad): it cannot be compared."
    )


CASES = Path(__file__).parents[1] / "cases"


def tried(config: Path | dict[str, Any]) -> tuple[RunResult, pd.DataFrame]:
    """A run, and what `evaluate` says of every step that it tried, beside what the run says."""
    result = tolevo.run(config).record
    assert result.changes is not None
    records = {record["name"]: record for record in result.tolerances}
    designs = []
    for step in result.changes.to_dict("records"):
        design = {axis.name: result.front.iloc[step["point"]][axis.name] for axis in result.variables}
        labels = records[step["variable"]]["labels"]
        design[step["variable"]] = labels[int(step["value"])] if labels else step["value"]
        if labels:  # the tolerance of a grade, else the nearest that the process holds
            part = step["variable"].removesuffix("_process")
            grades = dict(records[f"{part}_t"]["grades"])
            ends = ENDS.get(step["to"]) or (grades[step["to"]],) * 2
            design[f"{part}_t"] = min(max(design[f"{part}_t"], ends[0]), ends[1])
        designs.append(design)
    evaluated = tolevo.evaluate(config, pd.DataFrame(designs))
    base = result.front["cost"].to_numpy()[result.changes["point"]]
    told = result.changes.assign(feasible=evaluated["feasible"], by_evaluate=evaluated["cost"] - base)
    return result, told


ENDS = {"turned": (0.03, 0.10), "die cast": (0.10, 0.25)}
"""Ranges of the processes of the cases."""


def advised(result: RunResult, told: pd.DataFrame) -> int:
    """How many times a step is advised first; each keeps all limits and saves what is said."""
    assert result.choices is not None
    assert list(told["feasible"]) == list(told["breaks"] == "")
    np.testing.assert_allclose(told["by_evaluate"], told["cost_change"], atol=1e-9)
    count = 0
    for choice in result.choices.to_dict("records"):
        steps = told[told["point"] == choice["point"]]
        found = re.match(r"Loosen first: (.*?), to (.*?): saves ([\d.]+)", choice["loosen_first"])
        if found is None:
            assert choice["loosen_first"].startswith("No ")
            assert not np.any(steps["feasible"] & (steps["by_evaluate"] < -1e-6))
            continue
        own = steps[(steps["to"] == found[2]) & steps["variable"].str.startswith(found[1].replace(" ", "_"))]
        assert own["feasible"].all()
        assert float(found[3]) == pytest.approx(-own["by_evaluate"].iloc[0], rel=0.01)
        count += 1
    return count


def random_stack(seed: int) -> dict[str, Any]:
    """Three or four parts, grades among them, within limits of several kinds."""
    rng = np.random.default_rng(seed)
    parts: list[dict[str, Any]] = []
    for at in range(int(rng.integers(3, 5))):
        part: dict[str, Any] = {"name": f"p{at}", "nominal": float(rng.choice([12.0, 35.0, 112.0])), "unit": "mm"}
        if at == 1:
            part |= {"grade": ["IT6", "IT9"], "price": {"IT6": 12.0, "IT7": 7.0, "IT8": 4.5, "IT9": 4.0}}
        else:
            cost = {"model": "reciprocal", "a": 1.0, "b": float(rng.uniform(0.05, 0.4))}
            part |= {"t_min": 0.005, "t_max": 0.2, "cost": cost}
        parts.append(part)
    nominal = sum((-1) ** at * part["nominal"] for at, part in enumerate(parts))
    formula = " + ".join(f"{(-1) ** at} * {part['name']}" for at, part in enumerate(parts))
    limits = [{"variation": 0.12}, {"yield_percent": 99.0}, {"worst_case": 0.2}, {}][seed % 4]
    return {
        "problem": "stack",
        "objectives": {"minimise": ["cost", "variation"] if seed % 4 == 3 else ["cost"]},
        "limits": limits,
        "requirement": {"unit": "mm", "formula": formula, "lower": nominal - 0.12, "upper": nominal + 0.12},
        "part": parts,
        "algorithm": {"name": "exact", "points": 12}
        if seed < 4
        else {"name": "ga", "generations": 8, "population": 20},
    }


@pytest.mark.parametrize("seed", range(6))
def test_every_step_is_tried_against_all_limits(seed: int) -> None:
    advised(*tried(random_stack(seed)))


@pytest.mark.parametrize("name", ["m_each_rss", "end_play_yield_sign"])
def test_nothing_is_loosened_where_every_step_breaks_a_limit(name: str, tmp_path: Path) -> None:
    """The advice to loosen the cap to IT14, and the shaft to IT11, broke a limit."""
    folder = Path(shutil.copytree(CASES / "loosen_first", tmp_path / "case"))
    with (folder / f"{name}.toml").open("a", encoding="utf-8") as file:
        file.write('\n[rounding]\nsteps = "grades"\n')
    result, told = tried(folder / f"{name}.toml")
    assert advised(result, told) == 0
    assert "No tolerance can be loosened by itself: every step breaks a limit" in result.answers["loosen"]
    expected = {
        "m_each_rss": "cap, to IT14: air gap variation 0.2417 instead of at most 0.23 mm",
        "end_play_yield_sign": "shaft, to IT11: yield 99.29 instead of at least 99.73 percent",
    }
    assert expected[name] in result.answers["loosen"]


@pytest.mark.parametrize("seed", range(3))
def test_it_is_told_that_steps_begin_at_values_that_the_drawing_does_not_have(seed: int) -> None:
    result, _ = tried(random_stack(seed))
    assert result.choices is not None
    assert result.allocation is not None
    first = result.choices.iloc[0]
    drawn = result.allocation[result.allocation["point"] == first["point"]]
    pairs = zip(drawn["rounded"], (first[name] for name in drawn["variable"]), strict=True)
    moved = any(a != b if isinstance(b, str) else not np.isclose(float(a), b, 1e-9, 0.0) for a, b in pairs)
    assert ("These steps begin at the values before rounding." in first["loosen_first"]) == moved


def test_a_lower_limit_is_lowered_and_what_it_saves_is_solved_again() -> None:
    """By the closed form: (least cost at 99.73 %) - (least cost at 99.703 %), by a run of each."""
    path = CASES / "loosen_first" / "end_play_yield_sign.toml"
    text = tolevo.run(path).record.answers["limits"]
    found = re.search(r"lowering it to ([\d.]+) percent would save ([\d.]+) EUR \(solved again\)", text)
    assert found is not None
    costs = [tolevo.run(tomllib.loads(path.read_text()) | {"limits": {"yield_percent": limit}}).front["cost"][0]
             for limit in (99.73, float(found[1]))]  # fmt: skip
    assert float(found[2]) == pytest.approx(costs[0] - costs[1], rel=0.01)
    assert costs[0] > costs[1]


def test_grades_enter_with_their_prices_and_sizes_with_all_digits() -> None:
    """IT8 costs 2.50 more than IT9 and IT10 1.00 less, by the list of prices; 112 +-0.0xx."""
    result, told = tried(CASES / "graded_price_zero" / "graded.toml")
    assert result.choices is not None
    assert advised(result, told) == len(result.choices)
    knee = told[(told["point"] == result.choices["point"].iloc[0]) & (told["variable"] == "pin_process")]
    assert dict(zip(knee["to"], knee["cost_change"], strict=True)) == pytest.approx({"IT8": 2.5, "IT10": -1.0})
    order = orders(result)[0].drawn
    bore = order[order["tolerance"] == "bore_t"].iloc[0]
    t = round(1000.0 * float(bore["value"]))  # a size of the drawing has all of its digits
    assert 20 < t < 60
    assert (bore["upper limit"], bore["lower limit"]) == (f"112.0{t}", f"111.9{100 - t}")
    assert ">112.027<" in page(result)
    assert ">111.973<" in page(result)


def test_the_price_of_all_units_is_not_known() -> None:
    """At a yield of 100 % no tolerance changes it: 1.32e+11 was a division by rounding."""
    result = tolevo.run(CASES / "price" / "clip.toml").record
    assert result.prices is not None
    assert not np.any(result.prices["price"] > result.front["cost"][0])
    assert "what loosening it would save is not known" in result.answers["limits"]
    assert "published" not in result.answers


def test_limits_kept_with_a_margin_may_cost_all_the_same() -> None:
    """IT8 and IT8 have 0.039 of at most 0.045 mm: IT9 of either saves 0.5 and breaks the limit."""
    parts = [{"name": name, "nominal": 40.0, "unit": "mm", "sensitivity": 1.0, "grade": ["IT7", "IT9"],
              "price": {"IT7": 3.0, "IT8": 1.0, "IT9": 0.5}} for name in ("a", "b")]  # fmt: skip
    base = {"problem": "stack", "objectives": {"minimise": ["cost"]}, "part": parts,
            "requirement": {"unit": "mm", "nominal": 0.0, "method": "worst_case"}}  # fmt: skip
    answers = tolevo.run(base | {"limits": {"variation": 0.045}}).record.answers
    assert "without them the least cost would be 1 lower" in answers["limits"]
    assert "every step breaks a limit (a, to IT9: variation 0.0505 instead of at most 0.045 mm" in answers["loosen"]
    answers = tolevo.run(base | {"limits": {"variation": 0.2}}).record.answers
    assert "and none adds to the cost: nothing in the ranges is cheaper" in answers["limits"]


def test_what_a_search_missed_is_no_price_of_a_limit() -> None:
    """No design reaches a variation of 0.5 mm; at 0.39 the least cost is 10.26 in place of 10 (closed form)."""
    parts = [{"name": name, "nominal": 10.0, "unit": "mm", "sensitivity": 1.0, "t_min": 0.01, "t_max": 0.2,
              "cost": {"model": "reciprocal", "a": 0.0, "b": 1.0}} for name in ("a", "b")]  # fmt: skip
    base = {"problem": "stack", "seed": 0, "objectives": {"minimise": ["cost"]}, "part": parts,
            "requirement": {"unit": "mm", "nominal": 0.0, "method": "worst_case"},
            "algorithm": {"name": "ga", "evaluations": 60, "population": 20}}  # fmt: skip
    far = tolevo.run(base | {"limits": {"variation": 0.5}}).record.answers["limits"]
    assert "and none adds to the cost" in far
    near = tolevo.run(base | {"limits": {"variation": 0.39}}).record.answers["limits"]
    assert (lower := re.search(r"without them the least cost would be ([\d.]+) lower", near))
    assert float(lower[1]) == pytest.approx(4.0 / 0.39 - 10.0, rel=0.01)


def test_a_limit_on_the_cost_is_a_limit() -> None:
    """The least variation for a budget of 12: nothing else is limited, and the budget is used up."""
    parts = [{"name": name, "nominal": 10.0, "unit": "mm", "sensitivity": 1.0, "t_min": 0.01, "t_max": 0.2,
              "cost": {"model": "reciprocal", "a": 0.0, "b": 1.0}} for name in ("a", "b")]  # fmt: skip
    base = {"problem": "stack", "seed": 0, "objectives": {"minimise": ["variation"]}, "part": parts,
            "requirement": {"unit": "mm", "nominal": 0.0, "method": "worst_case"}}  # fmt: skip
    answer = tolevo.run(base | {"limits": {"cost": 12.0}}).record.answers["limits"]
    assert answer.endswith("the limit of cost at most 12 binds.")


def test_what_a_reader_cannot_tell_is_no_advice() -> None:
    """Savings below a millionth of the cost, and changes that a quantile is not known to."""
    priced: Any = SimpleNamespace(priced="cost", objectives=("cost", "backlash_arcmin"), outputs=(), limits=(),
                                  settings=SimpleNamespace(money=SimpleNamespace(currency="")))  # fmt: skip
    at = {"cost": 10.0, "backlash_arcmin": 1.0}
    rows = [{"variable": name, "to": "2 um", "cost_change": -saved, "breaks": "", "broken": "", "untried": 0,
             "change_backlash_arcmin": moved}
            for name, saved, moved in (("pin_um", 1e-8, 0.0), ("hole_um", 0.1, -1e-6))]  # fmt: skip
    assert advice(priced, pd.DataFrame(rows[:1]), at).endswith("saves a millionth of the cost.")
    assert advice(priced, pd.DataFrame(rows), at) == "Loosen first: hole, to 2 um: saves 0.1."
    rows[1]["change_backlash_arcmin"] = 0.002
    assert advice(priced, pd.DataFrame(rows), at) == "Loosen first: hole, to 2 um: saves 0.1; backlash rises by 0.002."
    blocked = [{**rows[1], "variable": f"part{i}_um", "breaks": "gap", "broken": "gap 2"} for i in range(9)]
    assert advice(priced, pd.DataFrame(blocked), at).endswith("; 1 more breaks a limit).")


def test_a_limit_that_is_met_exactly_and_holds_nothing_back_is_told_so() -> None:
    """g5 is min(dr_rp - dr_p, 0), which is 0 for every profile that opens: no step of the least cost breaks it."""
    table = {"problem": "rv_backlash", "references": "none", "objectives": {"minimise": ["cost"]},
             "limits": {"backlash_arcmin": 1.3, "interference_probability": 0.2},
             "algorithm": {"name": "exact", "points": 2}}  # fmt: skip
    told = tolevo.run(table).record.answers["limits"]
    idle = "The limit of conjugate clearance min at least 0 mm is met exactly, and no small step of what is searched"
    assert f"{idle} breaks it." in told
    assert "the limit of backlash at most 1.3 arcmin binds" in told
    assert "not known" not in told
    steps = tolevo.run(table).record.changes
    assert steps is not None
    grade = steps[(steps["variable"] == "involute_grade") & (steps["breaks"] != "")]
    assert set(grade["breaks"]) == {"backlash_arcmin"}  # interference does not depend on the gears


def test_a_sampled_value_near_its_limit_is_not_told_to_bind() -> None:
    """0.034 of 128 units, with a standard error of 0.016, is no limit of 0.05 that is used up."""
    limit = Limit("share", -np.inf, 0.05, 1.0, "")
    for margin, words in ((0.016, "share 0.034 lies within 2 standard errors of its limit, at most 0.05"),
                          (0.0, "the limit of share at most 0.05 binds")):  # fmt: skip
        front = pd.DataFrame(
            {"share": [0.05 - margin], "margin_share": [margin], "share_error": [0.016], "cost": [1.0]}
        )
        problem: Any = SimpleNamespace(
            limits=(limit,), priced="cost", interval=lambda name: (-np.inf, np.inf), outputs=(), objectives=("cost",)
        )
        told: Any = Sentences.__new__(Sentences)
        told.problem, told.priced, told.point, told.names, told.units = problem, "cost", 0, ["cost"], {"share": ""}
        told.result = SimpleNamespace(front=front)
        told._cost_of, told._moves = lambda limit: "", lambda limit: True
        assert f"At this allocation {words}" in told.of_limits()


def test_no_promise_is_told_to_be_certain() -> None:
    told = [
        sentence(
            {ASSURANCE: percent, "assured_withheld": (), "statement": "plug_in"},
            "95 %",
            pd.DataFrame({"statement": [], "cost": []}),
            "",
        )
        for percent in (99.97, 90.14, 0.01)
    ]
    assert [text.partition("probability of ")[2].split(".")[0] for text in told] == [
        "more than 99",
        "90",
        "less than 0",
    ]
