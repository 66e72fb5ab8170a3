"""`tolevo review`: the promise of a run by parts that were made to its drawing."""

from __future__ import annotations

import json
import re
from pathlib import Path
from shutil import copytree

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import tolevo
from tolevo.cli import app
from tolevo.configuration.reader import read
from tolevo.problems.tolerance_problem import designs_frame

pytestmark = pytest.mark.usefixtures("unrendered")

CONFIGURATION = """
problem = "stack"
[objectives]
minimise = ["cost"]
[promise]
yield_percent = 99.0
statement = "assured"
[requirement]
unit = "um"
nominal = 0.0
lower = -40.0
upper = 40.0
[algorithm]
name = "exact"
"""
PART = """
[[part]]
name = "{name}"
unit = "um"
sensitivity = 1.0
t_min = 8.0
t_max = 60.0
cost = {{ model = "reciprocal", a = 0.0, b = 1.0 }}
[part.measured]
values = {values}
made_to = 10.0
mean = "corrected"
"""


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a configuration and its run in o."""
    folder = tmp_path_factory.mktemp("run")
    rng = np.random.default_rng(6)
    parts = [PART.format(name=name, values=rng.normal(0.0, 10.0 / 3.0, 25).round(3).tolist())
             for name in ("ring", "pin", "cap")]  # fmt: skip
    (folder / "c.toml").write_text(CONFIGURATION + "".join(parts), encoding="utf-8")
    done = CliRunner().invoke(app, ["run", str(folder / "c.toml"), "--out", str(folder / "o"), "--quiet"])
    assert done.exit_code == 0, done.output
    return folder


def tolerances_of(first: Path) -> dict[str, float]:
    """Rounded tolerances of the run by part."""
    found = pd.read_csv(first / "o" / "allocation.csv")
    return {name[:-2]: float(t) for name, t in zip(found["variable"], found["rounded"], strict=True)}


def made(folder: Path, name: str, seed: int, tolerances: dict[str, float],
         scatter: dict[str, float], mean: float = 0.0, n: int = 50) -> str:  # fmt: skip
    """A table of parts whose standard deviations are shares `scatter` of a third of t."""
    rng = np.random.default_rng(seed)
    frame = pd.DataFrame({part: rng.normal(mean, scatter.get(part, 1.0) * t / 3.0, n)
                          for part, t in tolerances.items()})  # fmt: skip
    frame.round(4).to_csv(folder / name, index=False)
    return str(folder / name)


def reviewed(*arguments: str) -> str:
    done = CliRunner().invoke(app, ["review", *arguments])
    assert done.exit_code == 0, done.output
    return done.output


def test_a_part_that_scatters_more_is_tightened(first: Path, tmp_path: Path) -> None:
    t = tolerances_of(first)
    before = made(tmp_path, "first.csv", 1, t, {})
    parts = made(tmp_path, "now.csv", 2, t, {"pin": 2.2, "cap": 0.4})
    told = reviewed(str(first / "o"), parts, "--since", before)
    rows = {line.split()[0]: line.split() for line in told.splitlines() if "  um" in line
            or (" um " in line and line.split()[0] in t)}  # fmt: skip
    assert rows["pin"][-2] == "tighten"
    assert rows["cap"][-2] == "loosen"
    for own in rows.values():  # costs are 1/t
        old, new, saving = float(own[-4]), float(own[-3]), float(own[-1])
        assert saving == pytest.approx(1.0 / old - 1.0 / new, rel=2e-2, abs=1e-5)
    assert "pin scatters" in told
    assert "promised: at least 99 % of the units conform, with 95 % confidence" in told
    assert "the least cost that keeps the promise now is" in told


def test_a_new_allocation_keeps_the_promise_by_the_parts(first: Path, tmp_path: Path) -> None:
    """The saving is that of running the same problem with the new samples."""
    t = tolerances_of(first)
    parts = made(tmp_path, "now.csv", 3, t, dict.fromkeys(t, 0.5))
    told = reviewed(str(first / "o"), parts)
    found = pd.read_csv(parts)
    text = CONFIGURATION + "".join(
        PART.format(name=name, values=found[name].tolist()).replace("made_to = 10.0",
                                                                    f"made_to = {t[name]!r}")
        for name in t)  # fmt: skip
    (tmp_path / "again.toml").write_text(text, encoding="utf-8")
    done = CliRunner().invoke(app, ["run", str(tmp_path / "again.toml"), "--out",
                                    str(tmp_path / "p"), "--quiet"])  # fmt: skip
    assert done.exit_code == 0, done.output
    cost = float(pd.read_csv(tmp_path / "p" / "front.csv")["cost"].iloc[0])
    assert f"the least cost that keeps the promise now is {cost:.4g}" in told
    assert "a new allocation saves" in told


def test_a_promise_that_nothing_keeps_any_more_is_said(first: Path, tmp_path: Path) -> None:
    t = tolerances_of(first)
    parts = made(tmp_path, "now.csv", 4, t, dict.fromkeys(t, 6.0))
    told = reviewed(str(first / "o"), parts)
    assert "no allocation keeps the promise by the present parts" in told


def test_the_units_own_measurement_stands_beside(first: Path, tmp_path: Path) -> None:
    t = tolerances_of(first)
    parts = made(tmp_path, "now.csv", 5, t, {})
    (tmp_path / "g").mkdir()
    known = {"verdict": "named", "effects": [{"name": "thermal_drift"}]}
    (tmp_path / "g" / "gap.json").write_text(json.dumps(known), encoding="utf-8")
    told = reviewed(str(first / "o"), parts, str(tmp_path / "g"))
    assert "the units' own measurement: named: thermal_drift" in told


def test_faults(first: Path, tmp_path: Path) -> None:
    """Every one at once, status 2."""
    t = tolerances_of(first)
    other = made(tmp_path, "other.csv", 7, {"nut": 5.0}, {})
    (tmp_path / "empty").mkdir()
    run = str(first / "o")
    for arguments, words in (
        ((run, str(tmp_path / "none.csv"), str(tmp_path / "empty")),
         ("none.csv: does not exist", "is not a result of `tolevo gap`")),
        ((run, other), ("hold no characteristic of the run",)),
        ((str(tmp_path / "empty"), other), ("does not exist", "has no allocation.csv")),
        ((str(tmp_path / "none"), other), ("none: does not exist: name the directory of a run",)),
        ((other, other), ("other.csv: is a file: name the directory of a run",)),
    ):  # fmt: skip
        done = CliRunner().invoke(app, ["review", *arguments])
        assert done.exit_code == 2
        for word in words:
            assert word in done.output.replace("\n", " ")
    equal = tmp_path / "equal.csv"
    pd.DataFrame({name: [1.0] * 9 for name in t}).to_csv(equal, index=False)
    done = CliRunner().invoke(app, ["review", run, str(equal)])
    assert done.exit_code == 2
    assert done.output.count("9 equal values") == 3


@pytest.mark.parametrize("words", ["promises no yield"])
def test_a_run_without_a_promise_has_nothing_to_review(words: str, first: Path, tmp_path: Path) -> None:
    copytree(first / "o", tmp_path / "o")
    path = tmp_path / "o" / "config.toml"
    text = path.read_text(encoding="utf-8")
    start = text.index("[promise]")
    end = text.index("[", start + 1)
    text = text[:start] + text[end:]
    text = text.replace("promised_yield_percent", "variation").replace("min = 99.0", "max = 30.0")
    path.write_text(text, encoding="utf-8")
    done = CliRunner().invoke(app, ["review", str(tmp_path / "o"), str(first / "c.toml")])
    assert done.exit_code == 2
    assert words in done.output


REDUCER = """
problem = "rv_backlash"
[objectives]
minimise = ["cost"]
[promise]
yield_percent = 99.73
statement = "assured"
[limits]
interference_probability = 1e-6
[variables.pin_radius_um.measured]
values = {values}
made_to = 4.0
mean = "corrected"
"""


def test_sizes_of_a_reducer_come_back_by_number_by_name_or_as_deviations(tmp_path: Path) -> None:
    """The pin circle of the RV-40E has a radius of 64 mm: limits are written about it."""
    rng, run = np.random.default_rng(3), tmp_path / "o"
    run.mkdir()
    (run / "config.toml").write_text(
        REDUCER.format(values=rng.normal(0.0, 4.0 / 3.0, 20).round(4).tolist()), encoding="utf-8"
    )
    problem = read(run / "config.toml").problem
    assert problem is not None
    problem.frame(problem.complete(0.5 * (problem.xl + problem.xu)[None, :])).to_csv(run / "front.csv", index=False)
    allocation = pd.DataFrame({"point": 0, "variable": ["pin_circle_radius_um"], "rounded": [5.0]})
    allocation.to_csv(run / "allocation.csv", index=False)
    done = CliRunner().invoke(app, ["template", "qdas", "--run", str(run)])
    place = next(line[6:].split()[0] for line in done.output.splitlines() if line.endswith("pin_circle_radius_um"))
    mid = problem.settings.variables["pin_circle_radius_um"].mid
    assert mid is not None
    for key, value in (("K2101", 64000.0), ("K2110", 63995.0 + mid), ("K2111", 64005.0 + mid)):
        assert f"{key}/{place} {value}" in done.output
    sizes = (64000.0 + mid + rng.normal(0.0, 1.5, 40)).round(3)
    back = done.output.replace("pin_circle_radius_um", "A") + "".join(f"K0001/{place} {size}\n" for size in sizes)
    (tmp_path / "number.dfq").write_text(back, encoding="utf-8")
    for name, values in (("name", sizes), ("deviation", (sizes - 64000.0).round(3))):
        pd.DataFrame({"pin_circle_radius_um": values}).to_csv(tmp_path / f"{name}.csv", index=False)
    texts = [reviewed(str(run), str(tmp_path / file)) for file in ("number.dfq", "name.csv", "deviation.csv")]
    assert "pitch_um has no values: not measured" in texts[0]  # those of one characteristic alone came back
    assert texts[0][texts[0].index("promised:") :] == texts[1] == texts[2]


def test_a_run_of_another_problem_is_reviewed(tmp_path: Path) -> None:
    """Variables are found by name, with or without their unit; files are opened once."""
    rng, run = np.random.default_rng(3), tmp_path / "o"
    run.mkdir()
    text = REDUCER.format(values=rng.normal(0.0, 4.0 / 3.0, 20).round(4).tolist())
    (run / "config.toml").write_text(text, encoding="utf-8")
    problem = read(run / "config.toml").problem
    assert problem is not None
    found = problem.frame(problem.complete(0.5 * (problem.xl + problem.xu)[None, :]))
    found.to_csv(run / "front.csv", index=False)
    names = ["pin_radius_um", "pin_position_um"]
    pd.DataFrame({"point": 0, "variable": names, "rounded": [5.0, 4.0]}).to_csv(
        run / "allocation.csv", index=False)  # fmt: skip
    parts = pd.DataFrame({"pin_radius": rng.normal(0.0, 3.0, 40), "note": 1.0,
                          "pitch": rng.normal(0.0, 9.0, 40)}).round(4)  # fmt: skip
    parts.to_csv(tmp_path / "now.csv", index=False)
    parts.iloc[:, :1].multiply(0.4).to_csv(tmp_path / "first.csv", index=False)
    told = reviewed(str(run), str(tmp_path / "now.csv"), "--since", str(tmp_path / "first.csv"))
    assert "promised: at least 99.73 % of the units conform, with 95 % confidence" in told
    assert "pin_radius_um scatters 2.5 times as much as the earlier parts" in told
    assert "pitch_um scatters" not in told  # nothing is known of earlier ones
    assert "drawing breaks a limit: interference_probability is " in told
    assert " instead of at most 1e-06" in told
    row = next(line.split() for line in told.splitlines() if line.split()[:2] == ["pin_radius_um", "um"])
    assert row[2] == "40"
    assert float(row[4]) == pytest.approx(5.0 / (3.0 * parts["pin_radius"].std()), rel=1e-3)


ROBOT = """
problem = "pose_accuracy"
[objectives]
minimise = ["cost"]
[promise]
yield_percent = 99.73
statement = "assured"
[propagation]
samples = 4096
[variables.rod_length_1_um.measured]
values = {values}
mean = "corrected"
"""


def test_a_measured_standard_deviation_is_as_made(tmp_path: Path) -> None:
    """No drawing sets it: it is priced as made in the drawing's cost and in the new one, so that a
    drawing which keeps the promise is never told to be cheaper than what keeps it at least cost.
    """
    rng, run = np.random.default_rng(3), tmp_path / "o"
    run.mkdir()
    text = ROBOT.format(values=rng.normal(0.0, 1.0, 20).round(4).tolist())
    (run / "config.toml").write_text(text, encoding="utf-8")
    problem = read(run / "config.toml").problem
    assert problem is not None
    design = problem.starts()[1]
    designs_frame(problem, design[None, :]).to_csv(run / "front.csv", index=False)
    pd.DataFrame({"point": 0, "variable": problem.names, "rounded": design}).to_csv(
        run / "allocation.csv", index=False)  # fmt: skip
    own = dict(zip(problem.names, design, strict=True))["rod_length_2_um"]
    parts = pd.DataFrame({"rod_length_1": rng.normal(0.0, 1.0, 60),
                          "rod_length_2": rng.normal(0.0, 0.5 * own, 60)}).round(5)  # fmt: skip
    parts.to_csv(tmp_path / "now.csv", index=False)
    told = reviewed(str(run), str(tmp_path / "now.csv"))
    kept = re.search(r"by the present parts: .* probability of ([0-9.]+) %", told)
    costs = re.search(r"promise now is ([0-9.]+); the drawing costs ([0-9.]+)", told)
    assert kept is not None
    assert costs is not None
    assert float(kept.group(1)) > 95.0
    assert float(costs.group(1)) < float(costs.group(2))
    made = float(parts["rod_length_2"].std())
    drawn = sum(problem.settings.costs[name].cost(np.array([design[at]]))[0]
                for at, name in enumerate(problem.names))  # fmt: skip
    for name, std in (("rod_length_1_um", parts["rod_length_1"].std()), ("rod_length_2_um", made)):
        at = problem.names.index(name)
        drawn += 10.0 / float(std) - problem.settings.costs[name].cost(np.array([design[at]]))[0]
    assert float(costs.group(2)) == pytest.approx(drawn, rel=1e-3)
    row = next(line.split() for line in told.splitlines() if line.split()[:1] ==
               ["rod_length_2_um"])  # fmt: skip
    assert row[-3:-1] == ["as", "made"]
    assert float(row[-4]) == pytest.approx(made, rel=1e-3)


def test_the_drawing_of_a_run_with_processes_is_what_is_reviewed(tmp_path: Path) -> None:
    """Names of processes make a column of text: the rounded values were left out, and the cost was
    infinite. Prices of the drawing by the list: linear between its entries.
    """
    case, out = Path(__file__).parents[1] / "cases" / "review_inf", tmp_path / "o"
    done = CliRunner().invoke(app, ["run", str(case / "m_normal.toml"), "--out", str(out), "--quiet"])
    assert done.exit_code == 0, done.output
    told = reviewed(str(out), str(case / "neu.csv"))
    assert "inf" not in told.split("\n\n")[0]
    assert "nan" not in told
    drawn = pd.read_csv(out / "allocation.csv").set_index("variable")["rounded"]
    evaluated = tolevo.evaluate(case / "m_normal.toml", pd.DataFrame([drawn.to_dict()]))
    found = re.search(r"now is ([\d.]+) EUR; the drawing costs ([\d.]+) EUR: a new allocation costs ([\d.]+) EUR", told)
    assert found is not None
    assert float(found[2]) == pytest.approx(evaluated["cost"][0], rel=1e-3)
    assert float(found[3]) == pytest.approx(float(found[1]) - float(found[2]), abs=0.01)
    rows = {line.split()[0]: line.split() for line in told.split("\n\n")[1].splitlines()}
    for name in ("housing", "cover", "spacer", "shaft"):
        assert rows[name][rows["part"].index("tolerance")] == f"{float(drawn[f'{name}_t']):g}"
    assert np.isfinite([float(row[-1]) for name, row in rows.items() if name != "part"]).all()


def test_no_value_of_the_parts_is_lost_without_a_word(first: Path, tmp_path: Path) -> None:
    """Text is a fault at its row, a missing value is counted, a column that no part has is named."""
    values = [str(value) for value in np.random.default_rng(3).normal(0.0, 4.0, 20).round(2)]
    for cell, words in (("12 um", "row 5, column ring [um]: must be a finite number, or empty"), ("n.i.O.", "")):
        rows = [f"{value};{at * at}" for at, value in enumerate([*values[:3], cell, *values[4:]])]
        (tmp_path / "made.csv").write_text("\n".join(["ring [um];rring", *rows]), encoding="utf-8")
        done = CliRunner().invoke(app, ["review", str(first / "o"), str(tmp_path / "made.csv")])
        assert done.exit_code == (2 if words else 0), done.output
        assert words in done.output
    assert "note: made.csv: 1 of 20 values of ring are missing, and left out" in done.output
    assert "note: made.csv: not used: rring" in done.output
