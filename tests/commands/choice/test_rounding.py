"""Rounding against every combination of neighbours, and shares against closed forms."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.run.changes import round_design as rounded
from tolevo.commands.run.choice import ChoiceSettings
from tolevo.commands.run.decide import decide
from tolevo.commands.run.prices import contributions, slopes_of
from tolevo.commands.run.tolerances import R20, step_of, values_of
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.problems.pose_accuracy import PoseAccuracy
from tolevo.problems.settings import Bound, Settings
from tolevo.problems.tolerance_problem import ToleranceProblem

STACK = """
problem = "stack"
[requirement]
name = "gap"
unit = "mm"
lower = -0.4
upper = 0.4
[limits]
variation = 0.2
[[part]]
name = "a"
nominal = 55.29
unit = "mm"
sensitivity = 1.0
t_min = 0.01
t_max = 0.25
cost = { model = "reciprocal", a = 1.0, b = 0.75 }
[[part]]
name = "b"
nominal = 101.6
unit = "mm"
sensitivity = -2.0
t_min = 0.01
t_max = 0.25
cost = { model = "reciprocal", a = 1.0, b = 0.2 }
[[part]]
name = "c"
nominal = 2.0
unit = "mm"
sensitivity = 1.0
tolerance = 0.02
"""

Read = Callable[[str], Any]


@pytest.fixture
def parsed(tmp_path: Path) -> Read:
    def at(more: str) -> Any:
        path = tmp_path / "c.toml"
        path.write_text(STACK + more, encoding="utf-8")
        return read(path)

    return at


def tables(problem: ToleranceProblem, settings: ChoiceSettings) -> dict[str, np.ndarray]:
    return {
        v.name: np.array(sorted(values_of(problem, v, step)))
        for v in problem.free
        if (step := step_of(problem, v, settings)) is not None
    }


def test_grades_are_the_default_where_the_nominal_is_known(parsed: Read) -> None:
    """ISO 286-1: IT7 is 30 um above 50 up to 80 mm, 35 um above 80 up to 120 mm."""
    problem = parsed("").problem
    a, b = problem.free
    assert step_of(problem, a, ChoiceSettings()) == "IT"
    assert values_of(problem, a, "IT")[0.015] == "IT7"
    assert values_of(problem, b, "IT")[0.0175] == "IT7"


def test_preferred_numbers_cover_the_range() -> None:
    problem = PoseAccuracy()
    variable = problem.free[0]
    assert step_of(problem, variable, ChoiceSettings()) == "R20"
    values = values_of(problem, variable, "R20")
    low, high = problem.interval(variable.name)
    inside = [one for one in values if low <= one <= high]
    np.testing.assert_allclose(np.diff(np.log10(inside)), 0.05, atol=0.0085)
    assert {1.12, 9.0} <= set(R20)


@pytest.mark.parametrize("seed", range(4))
def test_nine_variables_are_rounded_as_well_as_by_trying_everything(seed: int) -> None:
    problem = PoseAccuracy(Settings(limits={"squareness_mrad": Bound(high=0.2)}))
    x = problem.xl + (problem.xu - problem.xl) * np.random.default_rng(seed).random(9) * 0.15
    design = problem.complete(x[None])[0]
    values = tables(problem, ChoiceSettings())
    new = rounded(problem, design, values)
    pairs = [
        sorted({every[every <= own].max(), every[every >= own].min()})
        for own, every in zip(design, values.values(), strict=True)
    ]
    every = np.array(list(itertools.product(*pairs)))
    every = np.clip(every, problem.xl, problem.xu)
    found = problem.outputs_of(every, errors=False)
    own = problem.outputs_of(design[None])["squareness_mrad"][0]
    kept = found["squareness_mrad"] <= min(own * (1.0 + 1e-9), 0.2)
    assert problem.cost_of(new[None])[0] <= 1.02 * found["cost"][kept].min()
    assert problem.outputs_of(new[None])["squareness_mrad"][0] <= own * (1.0 + 1e-9)


def test_a_limit_is_kept_where_a_neighbour_keeps_it(parsed: Read) -> None:
    """3 sigma is t: with 0.09 and 0.09 the variation is 0.2022, with 0.09 and 0.08 it is 0.1847."""
    more = "\n[rounding]\na_t = 0.01\nb_t = [0.08, 0.09]\n"
    configuration = parsed(more)
    problem = configuration.problem
    design = np.array([0.0889, 0.0889, 0.02])
    assert problem.outputs_of(design[None])["variation"][0] <= 0.2
    new = rounded(problem, design, tables(problem, configuration.choice))
    found = problem.outputs_of(new[None])
    assert found["variation"][0] <= 0.2
    assert new.tolist() == [pytest.approx(0.09), pytest.approx(0.08), 0.02]


def test_a_rounded_point_keeps_what_its_choice_asks_for(parsed: Read) -> None:
    more = "\n[choice]\nbudget = 20.0\n[rounding]\na_t = 0.05\nb_t = 0.05\n"
    configuration = parsed(more)
    problem = configuration.problem
    t = np.geomspace(0.02, 0.1, 60)
    front = problem.frame(np.stack([t, t, np.full(60, 0.02)], axis=1))
    found = decide(problem, front.assign(knee=False), configuration.choice)
    (row,) = found.choices[found.choices["choice"] == "best_for_budget"].to_dict("records")
    assert row["cost"] <= 20.0
    assert row["rounded_cost"] <= 20.0
    again = problem.frame(np.array([[*_rounded(found.allocation, int(row["point"])), 0.02]]))
    assert again["cost"][0] == pytest.approx(row["rounded_cost"])
    assert again["variation"][0] == pytest.approx(row["rounded_variation"])


def _rounded(allocation: pd.DataFrame, point: int) -> list[float]:
    own = allocation[allocation["point"] == point].set_index("variable")["rounded"]
    return [own["a_t"], own["b_t"]]


def test_limits_on_the_drawing_enclose_nominal_and_mid(parsed: Read) -> None:
    problem = parsed("").problem
    front = problem.frame(np.array([[0.05, 0.06, 0.02]])).assign(knee=False)
    found = decide(problem, front, ChoiceSettings(steps={"a_t": 0.02})).allocation
    rows = {row["variable"]: row for row in found.to_dict("records")}
    row = rows["a_t"]
    assert row["rounded"] in (0.04, 0.06)
    assert row["lower_limit"] == pytest.approx(55.29 - row["rounded"], abs=1e-12)
    assert row["upper_limit"] == pytest.approx(55.29 + row["rounded"], abs=1e-12)
    assert str(rows["b_t"]["grade"]).startswith("IT")
    assert rows["c_t"]["rounding"] == "fixed"


def test_contributions_of_a_root_sum_of_squares_are_shares_of_the_variance(parsed: Read) -> None:
    problem = parsed("").problem
    designs = np.array([[0.05, 0.06, 0.02], [0.1, 0.02, 0.02]])
    found = contributions(problem, slopes_of(problem, designs))
    squares = (designs * [1.0, 2.0, 1.0]) ** 2  # the fixed part is one of them
    expected = 100.0 * squares / squares.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(found[["a_t", "b_t", "c_t"]], expected, rtol=1e-9)
    np.testing.assert_allclose(found[["a_t", "b_t", "c_t"]].sum(axis=1), 100.0, rtol=1e-12)
    own = problem.outputs_of(designs)
    stated = np.stack([own[f"contribution_{part}_percent"] for part in "abc"], axis=1)
    np.testing.assert_allclose(found[["a_t", "b_t", "c_t"]], stated, rtol=1e-9)


def test_contributions_without_derivatives_are_the_same() -> None:
    class Blind(PoseAccuracy):
        def gradient(self, designs: Any) -> dict[str, Any]:
            return {}

    designs = np.full((1, 9), 20.0)
    names = PoseAccuracy().names
    found, known = (contributions(p, slopes_of(p, designs)).set_index("output").loc[
        "squareness_mrad", names] for p in (Blind(), PoseAccuracy()))  # fmt: skip
    np.testing.assert_allclose(found.astype(float), known.astype(float), rtol=2e-3, atol=1e-9)


@pytest.mark.parametrize(
    ("more", "place", "words"),
    [
        ("[choice.weights]\nmass = 1\n", "choice.weights.mass", "is not an objective"),
        ("[choice.weights]\ncost = 0\n", "choice.weights", "must not all be zero"),
        ("[choice]\nbudget = -1\n", "choice.budget", "must be above 0"),
        ("[choice]\nbudgett = 1\n", "choice.budgett", "did you mean `budget`"),
        ("[choice.limits]\nvariatio = 1\n", "choice.limits.variatio", "did you mean `variation`"),
        ("[rounding]\na_t = \"R10\"\n", "rounding.a_t", "must be a number or a string"),
        ("[rounding]\na_t = \"coarse\"\n", "rounding.a_t", "must be one of IT, R20"),
        ("[rounding]\na_t = []\n", "rounding.a_t", "at least one value"),
        ("[rounding]\na_t = [0.0]\n", "rounding.a_t", "above 0"),
        ("[rounding]\na_t = [5.0]\n", "rounding.a_t", "between 0.01 and 0.25"),
        ("[rounding]\nc_t = 0.1\n", "rounding.c_t", "is fixed in this run"),
        ("[rounding]\nd_t = 0.1\n", "rounding.d_t", "is not a known key"),
    ],
)  # fmt: skip
def test_faults(parsed: Read, more: str, place: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        parsed(more)
    (fault,) = caught.value.faults
    assert fault.place == place
    assert words in fault.message


def test_a_grade_needs_a_nominal_size(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text('problem = "rv_backlash"\n[rounding]\npitch_um = "IT"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"rounding.pitch_um: has no nominal size"):
        read(path)


def test_what_is_read_is_written(parsed: Read, tmp_path: Path) -> None:
    more = "[choice]\nbudget = 9.0\nweights = { cost = 2 }\n[choice.limits]\nvariation = 0.1\n"
    first = parsed(more + '[rounding]\na_t = "10 um"\nb_t = [0.02, 0.05]\n')
    path = tmp_path / "again.toml"
    path.write_text(first.toml(), encoding="utf-8")
    assert read(path).choice == first.choice
    assert first.choice.steps == {"a_t": pytest.approx(0.01), "b_t": (0.02, 0.05)}


class Lenient(PoseAccuracy):
    """A search sees 3 % less squareness than the full model: the best of its roundings break it."""

    def outputs_of(self, designs: np.ndarray, searching: bool = False, errors: bool = True,
                   known: Any = None) -> dict[str, np.ndarray]:  # fmt: skip
        found = super().outputs_of(designs, searching, errors, known)
        share = 0.97 if searching else 1.0
        return found | {"squareness_mrad": share * found["squareness_mrad"]}


def test_a_sample_that_is_too_lenient_is_corrected_by_the_full_model() -> None:
    """Many fine steps: more than enough combinations break the limit of the full model alone."""
    limits = {"squareness_mrad": Bound(high=0.1)}
    problem = Lenient(Settings(objectives=("cost",), limits=limits))
    design = problem._corner(tight=True)
    design *= 0.1 / problem.outputs_of(design[None])["squareness_mrad"][0]  # it is homogeneous
    grids = {name: (0.002 * np.arange(1.0, 4000.0) + 0.0017) * own
             for name, own in zip(problem.names, design, strict=True)}  # fmt: skip
    found = rounded(problem, design, grids)
    assert problem.outputs_of(found[None])["squareness_mrad"][0] <= 0.1
    assert problem.cost_of(found[None])[0] < 1.001 * problem.cost_of(design[None])[0]
