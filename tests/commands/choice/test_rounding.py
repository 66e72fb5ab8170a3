"""Rounding against every combination of neighbours, and shares against closed forms."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

from tests.small_jobs import written
from tolevo.algorithms.search import search
from tolevo.commands.run.changes import Ranking, ladders, round_design, rounding_sentence, search_combinations
from tolevo.commands.run.choice import ChoiceSettings
from tolevo.commands.run.decide import decide
from tolevo.commands.run.prices import contributions, slopes_of
from tolevo.commands.run.tolerances import step_of, values_of
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.problems.pose_accuracy import PoseAccuracy
from tolevo.problems.rv_backlash import RvBacklash
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
        path = written(tmp_path / "c.toml", STACK + more)
        return read(path)

    return at


def tables(problem: ToleranceProblem, settings: ChoiceSettings) -> dict[str, np.ndarray]:
    return {
        v.name: np.array(sorted(values_of(problem, v, step)))
        for v in problem.free
        if (step := step_of(problem, v, settings)) is not None
    }


def test_grades_are_those_of_the_nominal(parsed: Read) -> None:
    """ISO 286-1: IT7 is 30 um above 50 up to 80 mm, 35 um above 80 up to 120 mm."""
    configuration = parsed('[rounding]\nsteps = "grades"\n')
    problem = configuration.problem
    a, b = problem.free
    assert step_of(problem, a, configuration.choice) == "grades"
    assert values_of(problem, a, "grades")[0.015] == "IT7"
    assert values_of(problem, b, "grades")[0.0175] == "IT7"


def test_numbers_that_people_write_are_the_default(parsed: Read) -> None:
    """The steps 0.005, 0.01, 0.02 and 0.05 from 0.05, 0.1, 0.2 and 0.5 on, and multiples of 0.05 from 0.2 on."""
    problem = parsed("").problem
    variable = problem.free[0]
    assert step_of(problem, variable, ChoiceSettings()) == "preferred"
    values = sorted(values_of(problem, variable, "preferred"))
    own = [value for value in values if 0.05 <= value <= 0.25]
    expected = [0.05, 0.055, 0.06, 0.065, 0.07, 0.075, 0.08, 0.085, 0.09, 0.095]
    expected += [0.1, 0.11, 0.12, 0.13, 0.14, 0.15, 0.16, 0.17, 0.18, 0.19, 0.2, 0.22, 0.24, 0.25]
    assert own == expected  # to the last digit: 0.055 and not 0.055000000000000004


def test_a_narrow_range_has_numbers_too(parsed: Read) -> None:
    text = STACK.replace("t_min = 0.01\nt_max = 0.25", "t_min = 0.0141\nt_max = 0.0149", 1)
    problem = read(tomllib.loads(text)).problem
    assert problem is not None
    inside = [value for value in values_of(problem, problem.free[0], "preferred") if 0.0141 <= value <= 0.0149]
    assert len(inside) >= 9


def test_preferred_numbers_of_iso_3_cover_the_range() -> None:
    problem = PoseAccuracy()
    variable = problem.free[0]
    values = values_of(problem, variable, "R20")
    low, high = problem.interval(variable.name)
    inside = [one for one in values if low < one < high]
    np.testing.assert_allclose(np.diff(np.log10(inside)), 0.05, atol=0.0085)


@pytest.mark.parametrize("seed", range(4))
def test_nine_variables_are_rounded_as_well_as_by_trying_everything(seed: int) -> None:
    problem = PoseAccuracy(Settings(limits={"squareness_mrad": Bound(high=0.2)}))
    x = problem.xl + (problem.xu - problem.xl) * np.random.default_rng(seed).random(9) * 0.15
    design = problem.complete(x[None])[0]
    values = tables(problem, ChoiceSettings())
    new = round_design(problem, design, values).design
    pairs = [
        sorted({every[every <= own].max(), every[every >= own].min()})
        for own, every in zip(design, values.values(), strict=True)
    ]
    every = np.array(list(itertools.product(*pairs)))
    every = np.clip(every, problem.xl, problem.xu)
    found = problem.outputs_of(every, errors=False)
    own = problem.outputs_of(design[None])["squareness_mrad"][0]
    kept = found["squareness_mrad"] <= min(own * (1.0 + 1e-9), 0.2)
    assert problem.cost_of(new[None])[0] <= (1.0 + 1e-9) * found["cost"][kept].min()  # wider than neighbours
    assert problem.outputs_of(new[None])["squareness_mrad"][0] <= own * (1.0 + 1e-9)


def test_a_limit_is_kept_where_a_neighbour_keeps_it(parsed: Read) -> None:
    """3 sigma is t: with 0.09 and 0.09 the variation is 0.2022, with 0.09 and 0.08 it is 0.1847."""
    more = "\n[rounding]\na_t = 0.09\nb_t = [0.08, 0.09]\n"
    configuration = parsed(more)
    problem = configuration.problem
    design = np.array([0.0889, 0.0889, 0.02])
    assert problem.outputs_of(design[None])["variation"][0] <= 0.2
    new = round_design(problem, design, tables(problem, configuration.choice)).design
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
    found = decide(problem, front, ChoiceSettings(steps={"a_t": 0.02, "b_t": "grades"})).allocation
    rows = {row["variable"]: row for row in found.to_dict("records")}
    row = rows["a_t"]
    assert row["rounded"] / 0.02 == pytest.approx(round(row["rounded"] / 0.02))
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
        ("[rounding]\na_t = \"coarse\"\n", "rounding.a_t", "must be one of preferred, grades, R20"),
        ("[rounding]\na_t = []\n", "rounding.a_t", "at least one value"),
        ("[rounding]\na_t = [0.0]\n", "rounding.a_t", "above 0"),
        ("[rounding]\na_t = [5.0]\n", "rounding.a_t", "between 0.01 and 0.25"),
            ("[rounding]\nsteps = [5.0]\na_t = 0.1\n", "rounding.steps", "between 0.01 and 0.25 for b_t"),
        ("[rounding]\nsteps = 0.3\nb_t = 0.1\n", "rounding.steps", "a multiple between 0.01 and 0.25 for a_t"),
        ("[rounding]\nsteps = \"grade\"\n", "rounding.steps", "must be one of preferred, grades"),
        ("[rounding]\na_t = \"1 mm\"\n", "rounding.a_t", "a multiple between 0.01 and 0.25"),
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


def test_text_and_values_below_0_in_a_list_are_told_together(parsed: Read) -> None:
    with pytest.raises(InputError) as caught:
        parsed('[rounding]\nsteps = ["coarse", -0.1]\n')
    assert [fault.place for fault in caught.value.faults] == ["rounding.steps[0]", "rounding.steps"]


def test_steps_coarser_than_two_ranges_are_two_faults(parsed: Read) -> None:
    with pytest.raises(InputError) as caught:
        parsed("[rounding]\nsteps = [5.0, 10.0]\n")
    assert ["a_t" in caught.value.faults[0].message, "b_t" in caught.value.faults[1].message] == [True, True]


def test_a_grade_needs_a_nominal_size(tmp_path: Path) -> None:
    path = written(tmp_path / "c.toml", 'problem = "rv_backlash"\n[rounding]\npitch_um = "IT"\n')
    with pytest.raises(InputError, match=r"rounding.pitch_um: has no nominal size"):
        read(path)


def test_what_is_read_is_written(parsed: Read, tmp_path: Path) -> None:
    more = "[choice]\nbudget = 9.0\nweights = { cost = 2 }\n[choice.limits]\nvariation = 0.1\n"
    first = parsed(more + '[rounding]\na_t = "10 um"\nb_t = [0.02, 0.05]\n')
    path = written(tmp_path / "again.toml", first.toml())
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
    design = problem.corner(tight=True)
    design *= 0.1 / problem.outputs_of(design[None])["squareness_mrad"][0]  # it is homogeneous
    grids = {name: (0.002 * np.arange(1.0, 4000.0) + 0.0017) * own
             for name, own in zip(problem.names, design, strict=True)}  # fmt: skip
    found = round_design(problem, design, grids).design
    assert problem.outputs_of(found[None])["squareness_mrad"][0] <= 0.1
    assert problem.cost_of(found[None])[0] < 1.001 * problem.cost_of(design[None])[0]


class Fading(PoseAccuracy):
    """A problem whose search is right at one design and the more lenient the farther away."""

    right: np.ndarray

    def outputs_of(self, designs: np.ndarray, searching: bool = False, errors: bool = True,
                   known: Any = None) -> dict[str, np.ndarray]:  # fmt: skip
        found = super().outputs_of(designs, searching, errors, known)
        away = np.mean(np.abs(np.log(designs / self.right)), axis=1) if searching else 0.0
        return found | {"squareness_mrad": (1.0 - 0.8 * away) * found["squareness_mrad"]}


def test_a_search_that_is_too_lenient_away_from_the_design_is_corrected_where_it_arrives() -> None:
    problem = Fading(Settings(objectives=("cost",), limits={"squareness_mrad": Bound(high=0.1)}))
    object.__setattr__(problem, "right", problem.corner(tight=True))
    design = problem.corner(tight=True)
    design *= 0.1 / problem.outputs_of(design[None])["squareness_mrad"][0]
    object.__setattr__(problem, "right", design)
    grids = {name: 1.02 * own * 1.06 ** np.arange(-8.0, 9.0) for name, own in zip(problem.names, design, strict=True)}
    found = round_design(problem, design, grids)
    assert found.keys[0] == 0.0
    assert problem.outputs_of(found.design[None])["squareness_mrad"][0] <= 0.1


def test_settings_of_few_values_leave_tolerances_less_room_and_all_limits_are_kept() -> None:
    """A mixture of two values of dr_rp keeps the backlash of the modification at 0, neither of them does; at
    the prices of that mixture, each of the 4,096 combinations that were listed broke the yield.
    """
    problem = RvBacklash(Settings(objectives=("cost",), parameters={"reading": "printed"},
                                  limits={"yield_percent": Bound(low=99.0)}))  # fmt: skip
    known = dict(zip(problem.names, problem.references()["document B"].tolist(), strict=True)) | {
        "pin_circle_radius_um": 5.021, "pin_position_um": 4.504, "pin_hole_radius_um": 3.861, "pin_radius_um": 2.021,
        "pitch_um": 8.575, "runout_um": 5.147, "eccentricity_um": 8.0, "equidistance_um": 2.185, "shift_um": 3.121,
        "crank_bearing_um": 2.808, "involute_grade": 6.0, "stagger_arcmin": 0.4, "dr_rp_mm": -0.055964,
        "dr_p_mm": -0.096,
    }  # fmt: skip
    design = np.array([known[name] for name in problem.names])
    rounded = round_design(problem, design, tables(problem, ChoiceSettings()))
    assert rounded.keys[0] == 0.0
    assert problem.frame(rounded.design[None])["feasible"].all()
    assert problem.cost_of(rounded.design[None])[0] < 1.03 * problem.cost_of(design[None])[0]


# A hundred random stacks: limits, costs and the best of all combinations by formulas of this test.


class RandomStack:
    """Parts with costs a + b/t^k, one or two linear requirements, limits that the optimum uses up."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.kind = ("variation", "yield_percent", "worst_case")[seed % 3]
        n = int(rng.integers(2, 13))
        self.t0 = 10.0 ** rng.uniform(-2.3, -0.7, n)
        self.ends = np.array([[float(f"{t / 8.0:.2g}"), float(f"{t * 8.0:.2g}")] for t in self.t0])
        rows = 2 if rng.random() < 0.3 else 1
        self.slopes = rng.choice([-1.0, 1.0], (rows, n)) * rng.choice([0.5, 1.0, 1.0, 2.0, 1.7], (rows, n))
        self.costs = np.stack([rng.uniform(0.0, 3.0, n), 10.0 ** rng.uniform(-1.5, 0.0, n), rng.uniform(0.5, 2.0, n)])
        self.widths = self.sums(self.t0[None])[0] * rng.uniform(0.6, 1.5, rows)

    def sums(self, t: np.ndarray) -> np.ndarray:
        """Root sum of squares or worst case, (n, requirements)."""
        moved = np.abs(self.slopes[None] * t[:, None])
        return np.asarray(moved.sum(axis=2) if self.kind == "worst_case" else np.sqrt((moved**2).sum(axis=2)))

    def cost(self, t: np.ndarray) -> np.ndarray:
        a, b, k = self.costs
        return np.asarray((a + b / t**k).sum(axis=1))

    def kept(self, t: np.ndarray) -> np.ndarray:
        sums = self.sums(t)
        if self.kind == "yield_percent":  # 3 sigma is the root sum of squares
            return np.asarray(np.all(100.0 * (1.0 - 2.0 * norm.sf(3.0 * self.widths / sums)) >= 99.73 - 1e-9, axis=1))
        return np.asarray(np.all(sums <= self.widths * (1.0 + 1e-9), axis=1))

    def tables(self) -> dict[str, Any]:
        limit = {"variation": "rss"}.get(self.kind, self.kind)
        method = "worst_case" if self.kind == "worst_case" else "rss"
        names = [f"r{at}" for at in range(len(self.widths))]
        return {
            "problem": "stack",
            "objectives": {"minimise": ["cost"]},
            "requirement": [
                {"name": name, "unit": "mm", "nominal": 0.0, "lower": -w, "upper": w, "method": method}
                for name, w in zip(names, self.widths.tolist(), strict=True)
            ],
            "limits": {f"{name}.{limit}": 99.73 if self.kind == "yield_percent" else w
                       for name, w in zip(names, self.widths.tolist(), strict=True)},
            "part": [
                {"name": f"p{at}", "unit": "mm", "t_min": low, "t_max": high,
                 "sensitivity": dict(zip(names, slopes, strict=True)),
                 "cost": {"model": "reciprocal_power", "a": a, "b": b, "k": k}}
                for at, ((low, high), slopes, (a, b, k)) in enumerate(
                    zip(self.ends.tolist(), self.slopes.T.tolist(), self.costs.T.tolist(), strict=True))
            ],
            "algorithm": {"name": "exact"},
        }  # fmt: skip

    def best_possible(self, optimum: np.ndarray, values: dict[str, np.ndarray]) -> float:
        """The least cost of all combinations of orderable values within a factor of 1.6 that keep the limits."""
        near = [
            every[(every >= max(low, t / 1.6)) & (every <= min(high, 1.6 * t))]
            for every, t, (low, high) in zip(values.values(), optimum, self.ends, strict=True)
        ]
        every = np.array(list(itertools.product(*near)))
        return float(np.min(self.cost(every), where=self.kept(every), initial=np.inf))


@pytest.mark.slow
def test_a_hundred_stacks_keep_every_limit_and_lose_at_most_one_percent_where_that_is_possible() -> None:
    losses = []
    for seed in range(100):
        stack = RandomStack(seed)
        plan = read(stack.tables()).plan()
        found = search(plan.problem, plan.algorithm, plan.budget, plan.seed)
        optimum = plan.problem.complete(found.x[[int(np.argmin(found.f[:, 0]))]])[0]
        values = tables(plan.problem, plan.choice)
        finer = {v.name: np.array(list(values_of(plan.problem, v, "finer"))) for v in plan.problem.free}
        rounded = round_design(plan.problem, optimum, values, finer=finer)
        t = rounded.design[None]
        values = {name: np.union1d(values[name], finer[name]) for name in values}
        assert all(np.isclose(every, own, rtol=1e-9).any() for every, own in zip(values.values(), t[0], strict=True))
        assert stack.kept(t)[0]
        before, after = stack.cost(optimum[None])[0], stack.cost(t)[0]
        losses.append(after / before - 1.0)
        said = rounding_sentence(plan.problem, rounded, before, after, "")
        assert ("none that keeps all limits" in said) == (losses[-1] > 0.01)
        broken = rounding_sentence(plan.problem, rounded, before, after, "backlash_max_arcmin gap.yield_percent")
        assert "it breaks backlash max and gap yield: " in broken
        assert "(as much)" in rounding_sentence(plan.problem, rounded, after, after * (1.0 + 1e-15), "")
        if losses[-1] > 0.01:  # no combination is cheaper, by the formulas above
            assert len(optimum) <= 3
            assert stack.best_possible(optimum, values) > 1.01 * before
    assert np.mean(np.array(losses) <= 0.01) >= 0.95


@pytest.mark.parametrize("steps", ["preferred", "grades"])
def test_a_search_by_prices_finds_what_trying_everything_finds(steps: str) -> None:
    """Four parts, all combinations of the ladders: the search evaluates a twentieth of them or fewer."""
    for seed in range(6):
        stack = RandomStack(seed)
        if len(stack.t0) < 4:
            continue
        short = RandomStack(seed)
        short.t0, short.ends, short.slopes, short.costs = (
            stack.t0[:4],
            stack.ends[:4],
            stack.slopes[:, :4],
            stack.costs[:, :4],
        )
        short.widths = short.sums(short.t0[None])[0]
        tables_of = short.tables()
        tables_of["part"] = [part | {"nominal": 40.0} for part in tables_of["part"]]
        plan = read(tables_of).plan()
        problem = plan.problem
        values = tables(problem, ChoiceSettings(steps={"steps": steps}))
        optima = search(problem, plan.algorithm, plan.budget, plan.seed)
        design = problem.complete(optima.x[[int(np.argmin(optima.f[:, 0]))]])[0]
        near = ladders(problem, design, values)
        every = np.array(list(itertools.product(*map(range, near.counts))))
        ranking = Ranking(problem, design, True, {})
        searched = search_combinations(near, ranking)
        keys, best_keys = (
            np.array(min(map(tuple, ranking.keys(near.designs(some)).tolist()))) for some in (searched, every)
        )
        assert keys[0] <= best_keys[0] * (1.0 + 1e-9) + 1e-12
        assert keys[2] <= best_keys[2] * 1.002
        assert len(searched) < 0.05 * len(every)


def test_rounding_tells_what_it_does_to_other_objectives() -> None:
    plan = read(RandomStack(3).tables()).plan()
    design = plan.problem.complete(0.5 * (plan.problem.xl + plan.problem.xu)[None])[0]
    rounded = round_design(plan.problem, design, tables(plan.problem, plan.choice))
    others = {"pose_accuracy_mm": (0.02, 0.021), "yaw_mrad": (0.1, 0.1 * (1.0 + 1e-5)), "backlash_arcmin": (1.0, 0.9)}
    told = rounding_sentence(plan.problem, rounded, 10.0, 9.0, "", others)
    assert told == (
        "Rounded for the drawing, it costs 9 (10 % less); pose accuracy rises from 0.02 to 0.021; backlash falls from "
        "1 to 0.9."
    )
