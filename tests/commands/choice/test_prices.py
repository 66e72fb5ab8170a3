"""Prices of requirements against closed forms, and rounding of many parts."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.search import search
from tolevo.commands.run.changes import round_design
from tolevo.commands.run.prices import front_slopes, prices, slopes_of
from tolevo.commands.run.promise import cheapest_design
from tolevo.commands.run.tolerances import tolerances, values_of
from tolevo.configuration.reader import read
from tolevo.models.costs import Reciprocal
from tolevo.plugins import Declaration, Kind, Output, ToleranceProblem, Variable

HEAD = """
problem = "stack"
[requirement]
name = "gap"
unit = "mm"
method = "{0}"
"""
PART = """
[[part]]
name = "p{0}"
nominal = {1}
unit = "mm"
sensitivity = {2}
t_min = 0.003
t_max = 0.5
cost = {{ model = "reciprocal", a = 1.0, b = {3} }}
"""


def stack(folder: Path, count: int, method: str = "worst_case") -> Any:
    rng = np.random.default_rng(0)
    parts = [PART.format(at, round(rng.uniform(5.0, 120.0), 2), rng.choice([1.0, -1.0, 0.5]),
                         round(rng.uniform(0.02, 0.3), 3)) for at in range(count)]  # fmt: skip
    path = folder / "c.toml"
    path.write_text(HEAD.format(method) + "".join(parts), encoding="utf-8")
    return read(path).problem


def known(problem: Any) -> tuple[np.ndarray, np.ndarray]:
    """Cost coefficients b of a + b/t, and sensitivities without their signs."""
    b = np.array([part.processes[0].curve.b for part in problem.definition.parts])
    return b, np.abs(problem.definition.mechanism.sensitivities)


def test_the_price_of_a_worst_case_by_its_closed_form(tmp_path: Path) -> None:
    """Least sum b_j/t_j at sum |s_j| t_j = V: t_j = V sqrt(b_j/s_j)/sum sqrt(b_k s_k), cost
    (sum sqrt(b_k s_k))^2/V; its slope is -(...)^2/V^2.
    """
    problem = stack(tmp_path, 4)
    b, s = known(problem)
    whole = np.sum(np.sqrt(b * s))
    value = np.array([0.2, 0.25, 0.3])
    designs = value[:, None] * np.sqrt(b / s) / whole
    front = problem.frame(designs).assign(gap_percent=0.0)
    np.testing.assert_allclose(front["variation"], value, rtol=1e-12)
    found = prices(problem, front, slopes_of(problem, designs))
    np.testing.assert_allclose(found["price"], whole**2 / value**2, rtol=1e-9)
    assert set(found["source"]) == {"multiplier"}
    assert found["spread_percent"].max() < 1e-6
    unproven = prices(problem, front.assign(gap_percent=5.0), slopes_of(problem, designs))
    assert set(unproven["source"]) == {"estimate"}  # a front's points on either side tell less than the conditions
    np.testing.assert_allclose(unproven["price"], found["price"])
    slopes = front_slopes(front, "variation")
    assert slopes is not None
    np.testing.assert_allclose(slopes[1], whole**2 / (0.2 * 0.3), rtol=1e-9)


def test_the_price_of_a_yield_by_optima_at_limits_beside(tmp_path: Path) -> None:
    """A lower limit: what one percent more costs, by the difference of proven least costs."""

    def at(least: float) -> Any:
        text = HEAD.format("rss") + "nominal = 0.0\nlower = -0.1\nupper = 0.1\n"
        text += f'[objectives]\nminimise = ["cost"]\n[limits]\nyield_percent = {least}\n'
        parts = (PART.format(at, 10.0, s, b) for at, (s, b) in
                 enumerate([(1.0, 0.1), (-1.0, 0.05), (0.5, 0.2)]))  # fmt: skip
        (tmp_path / "y.toml").write_text(text + "".join(parts), encoding="utf-8")
        return read(tmp_path / "y.toml").problem

    low, middle, high = (cheapest_design(at(least)) for least in (99.725, 99.73, 99.735))
    problem = at(99.73)
    designs = middle.design[None, :]
    front = problem.frame(designs).assign(gap_percent=0.0)
    (found,) = prices(problem, front, slopes_of(problem, designs)).to_dict("records")
    assert found["output"] == "yield_percent"
    assert found["source"] == "multiplier"
    # the slope changes by 2 % over the step on either side: 1e-3 is beyond its curvature
    assert found["price"] == pytest.approx((high.cost - low.cost) / 0.01, rel=1e-3)


def test_a_point_that_is_no_optimum_does_not_say_which_limits_cost_nothing(tmp_path: Path) -> None:
    """At the least cost both limits bind: the tight one, and 0.15 mm on the first two of three parts."""
    rows = "".join(
        f'[[requirement]]\nname = "{name}"\nunit = "mm"\nmethod = "worst_case"\nformula = "{formula}"\n'
        for name, formula in (("whole", "p0 + p1 + p2"), ("pair", "p0 + p1"))
    )
    parts = "".join(
        PART.replace("sensitivity = {2}\n", "").format(at, 10.0, 1.0, b) for at, b in enumerate((0.1, 0.2, 0.05))
    )
    limits = "[objectives]\nminimise = ['cost']\n[limits]\nwhole.variation = 0.2\npair.variation = 0.15\n"
    (tmp_path / "two.toml").write_text('problem = "stack"\n' + limits + rows + parts, encoding="utf-8")
    problem: Any = read(tmp_path / "two.toml").problem
    optimum = cheapest_design(problem).design
    for moved, gap, known in (
        ([0.0, 0.0, 0.0], 0.0, "whole pair"),
        ([0.0, -0.002, 0.002], 1.0, "whole"),  # the pair has room, and the conditions hold to some percent
        ([-0.04, 0.0, 0.04], 1.0, ""),
    ):
        design = (optimum + moved)[None]
        front = problem.frame(design).assign(gap_percent=gap)
        found = prices(problem, front, slopes_of(problem, design)).set_index("output")["price"]
        assert " ".join(str(name).split(".")[0] for name, price in found.items() if price > 0.0) == known
        assert found[[f"{name}.variation" for name in {"whole", "pair"} - set(known.split())]].isna().all()


def test_no_price_where_every_tolerance_is_at_its_bound(tmp_path: Path) -> None:
    problem = stack(tmp_path, 3)
    designs = np.full((1, 3), 0.5)
    front = problem.frame(designs).assign(gap_percent=0.0)
    found = prices(problem, front, slopes_of(problem, designs))
    assert found["price"].isna().all()


def test_the_costs_of_the_records_are_those_of_the_model(tmp_path: Path) -> None:
    problem = stack(tmp_path, 3)
    design = np.array([0.05, 0.07, 0.11])
    curves = [one["costs"][0] for one in tolerances(problem, {}, {})]
    own = sum(c["count"] * (c["a"] + c["b"] / t) for c, t in zip(curves, design, strict=True))
    assert own == pytest.approx(problem.cost_of(design[None])[0])


def test_rounding_of_two_hundred_parts_takes_seconds_and_loses_little(tmp_path: Path) -> None:
    """Of neighbours that are IT grades, within 3 % of the cost; the variation is never worse."""
    problem = stack(tmp_path, 200, "rss")
    b, s = known(problem)
    design = np.clip(0.05 * np.cbrt(b / s**2), 0.003, 0.5)  # -C' = price s^2 t / V
    values = {v.name: np.array(sorted(values_of(problem, v, "grades"))) for v in problem.free}
    begun = time.process_time()
    found = round_design(problem, design, values).design
    assert time.process_time() - begun < 5.0
    before, after = (problem.outputs_of(one[None]) for one in (design, found))
    assert after["variation"][0] <= before["variation"][0] * (1.0 + 1e-9)
    assert after["variation"][0] >= before["variation"][0] * 0.995  # what was left is used
    assert after["cost"][0] <= 1.03 * before["cost"][0]


def test_the_price_of_a_limit_without_a_derivative_by_optima_at_limits_beside() -> None:
    """The transmission error is a closed form without derivatives: its price is the slope of the least cost."""
    run = {"problem": "rv_transmission_error", "objectives": {"minimise": ["cost"]}, "algorithm": {"name": "exact"}}

    def least(limit: float) -> tuple[Any, np.ndarray, float]:
        plan = read({**run, "limits": {"te_amplitude_arcsec": limit}}).plan()
        result = search(plan.problem, plan.algorithm, plan.budget, plan.seed)
        best = int(np.argmin(result.f[:, 0]))
        return plan.problem, plan.problem.complete(result.x[best : best + 1]), float(result.f[best, 0])

    problem, design, _ = least(20.0)
    price = prices(problem, problem.frame(design), slopes_of(problem, design)).set_index("output")["price"]
    slope = (least(19.8)[2] - least(20.2)[2]) / 0.4  # 1 % to either side
    np.testing.assert_allclose(price["te_amplitude_arcsec"], slope, rtol=0.02)  # the search ends at 0.1 %


class Preloaded(ToleranceProblem):
    """A width and a preload, which costs nothing: more of it is stiffer, and adds to the play."""

    declaration = Declaration(
        variables=(
            Variable("bore_um", "um", Kind.HALF_WIDTH, 2.0, 60.0, "bore"),
            Variable("preload_um", "um", Kind.NOMINAL, -30.0, 30.0, "preload"),
        ),
        outputs=(
            Output("cost", "", "sum of the cost curves"),
            Output("play_um", "um", "play"),
            Output("stiffness_N_per_um", "N/um", "stiffness"),
        ),
        costs={"bore_um": Reciprocal(1.0, 100.0)},
        objectives=("cost",),
    )

    def _outputs(self, designs: Any, searching: bool) -> dict[str, Any]:
        bore, preload = designs.T
        return {
            "cost": self.cost_of(designs),
            "play_um": bore + np.abs(preload - 5.0),
            "stiffness_N_per_um": 40.0 + preload - 0.3 * bore,
        }


def test_a_searched_setting_is_one_of_the_conditions_of_an_optimum() -> None:
    """Limits move the preload too: bore = (play + 45 - stiffness) / 1.3 at the least cost."""
    import tolevo

    given = {"problem": Preloaded, "algorithm": {"name": "exact"}, "seed": 1}
    problem = tolevo.read(given | {"limits": {"play_um": 25.0, "stiffness_N_per_um": {"min": 42.0}}}).problem
    assert problem is not None
    bore = (25.0 + 45.0 - 42.0) / 1.3
    design = np.array([[bore, 30.0 - bore]])
    priced = prices(problem, problem.frame(design), slopes_of(problem, design))
    assert priced["spread_percent"].max() < 0.1
    np.testing.assert_allclose(priced["price"], 100.0 / bore**2 / 1.3, rtol=2e-3)  # differences: 1e-3
    assert list(priced["tighter"]) == ["less", "more"]
