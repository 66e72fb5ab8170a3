"""Yields and half-widths of linear stacks, proven by quantiles: closed forms and samples."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

from tolevo.algorithms.exact.bounds import least_bounds, proof
from tolevo.algorithms.exact.choices import least_cost
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read_table
from tolevo.models.propagation.convolution import UNIFORM, EvenNormal, EvenPlateau
from tolevo.models.propagation.symmetric_sum import SymmetricSum
from tolevo.models.stack.mechanism import Sample, half_width, yield_percent
from tolevo.problems.forms import Piece, Quantile, Quantiles
from tolevo.problems.stack.problem import Stack

LAWS = ("uniform", "triangular", "truncated_normal", "normal", "trapezoid")
PART = """
[[part]]
name = "p{at}"
unit = "mm"
sensitivity = {s}
t_min = 0.01
t_max = 0.4
distribution = "{law}"
cost = {{ model = "reciprocal", a = 1.0, b = {b} }}
"""


def stack(limits: str, lower: str = "", upper: str = "", laws: tuple[str, ...] = LAWS,
          method: str = "rss", more: str = "") -> Stack:  # fmt: skip
    parts = "".join(
        PART.format(at=at, s=(-1.0) ** at * (0.5 + 0.2 * at), law=law, b=0.1 + 0.03 * at) for at, law in enumerate(laws)
    )
    text = f"""
problem = "stack"
[objectives]
minimise = ["cost"]
[requirement]
name = "gap"
unit = "mm"
nominal = 0.0
method = "{method}"
{lower}
{upper}
[limits]
{limits}
{more}{parts}"""
    problem = read_table(tomllib.loads(text), []).problem
    assert isinstance(problem, Stack)
    return problem


def solved(problem: Stack) -> tuple[float, float, dict[str, np.ndarray]]:
    """Cost, gap [%] and outputs of the exact design, which keeps its limits."""
    found = search(problem, Exact(), Budget(), 1)
    designs = problem.complete(found.x)
    out = problem.outputs_of(designs)
    assert np.all(problem.violations(designs, out) <= 0.0)
    gap = proof(problem, {"cost": out["cost"]}, 1).gap_percent(out["cost"])
    return float(out["cost"][0]), float(gap[0]), out


@pytest.mark.parametrize(
    ("lower", "upper"), [("lower = -0.3", "upper = 0.3"), ("", "upper = 0.3"), ("lower = -0.3", "")]
)
@pytest.mark.parametrize("share", [90.0, 99.73, 99.99])
def test_centred_and_one_sided_yields_are_proven(lower: str, upper: str, share: float) -> None:
    _, gap, out = solved(stack(f"yield_percent = {share}", lower, upper))
    assert gap < 1e-4
    assert out["yield_percent"][0] == pytest.approx(share, abs=1e-6)


def test_normal_stack_with_a_yield_is_the_root_sum_square() -> None:
    """99.73002 % within +-h of normal parts is 3 sigma = h: one design, one cost."""
    share = 100.0 * (norm.cdf(3.0) - norm.cdf(-3.0))
    laws = ("normal",) * 4
    by_yield = solved(stack(f"yield_percent = {share:.12f}", "lower = -0.2", "upper = 0.2", laws))
    by_rss = solved(stack("variation = 0.2", laws=laws))
    assert by_yield[0] == pytest.approx(by_rss[0], rel=1e-8)


def test_half_width_and_yield_are_those_of_a_sample() -> None:
    """Within four standard errors; the half-width's is about 0.5 % with 65,536 units."""
    problem = stack("variation = 0.25", "lower = -0.3", "upper = 0.2", method="monte_carlo",
                    more="[propagation]\ncoverage = 0.99\n")  # fmt: skip
    _, gap, out = solved(problem)
    assert gap < 1e-4
    design = problem.complete(search(problem, Exact(), Budget(), 1).x)
    t, mechanism = problem.tolerances(design), problem.definition.mechanism
    sample = Sample.draw(mechanism, 65536, np.random.default_rng(3))
    assert half_width(mechanism, t, sample, 0.99)[0] == pytest.approx(0.25, rel=5e-3)
    within, error = yield_percent(mechanism, t, sample)
    assert out["yield_percent"][0] == pytest.approx(within[0], abs=4.0 * error[0])


def test_bounds_between_solved_limits_are_near_their_own() -> None:
    """60 levels of a half-width, 12 solved first: below each's own, by 0.1 % at most."""
    problem = stack("variation = 0.35", method="monte_carlo", more="[propagation]\ncoverage = 0.99\n")
    form = problem.form()
    assert form is not None
    limits = np.linspace(0.08, 0.35, 60)[:, None]
    bounds = least_bounds(form, limits)
    own = least_cost(form, limits[::7]).bound
    assert np.all(bounds[::7] <= own * (1.0 + 1e-9))
    assert np.all(bounds[::7] >= own * (1.0 - 1e-3))
    assert np.all(np.diff(bounds) <= 0.0)


def test_quantiles_of_a_form_at_once_are_those_of_each() -> None:
    """Two sums with parts in common: value and gradient of one sum each."""
    first, second = (UNIFORM, EvenNormal(0.4), EvenPlateau(0.3)), (UNIFORM, EvenPlateau(0.0))
    rows = (
        Quantile(0.95, tuple((Piece(1.0 + 0.1 * at, one),) for at, one in enumerate(first))),
        None,
        Quantile(0.9, ((Piece(2.0, second[0]),), (), (Piece(1.0, second[1]),)),
                 (Piece(0.5, UNIFORM),)),
    )  # fmt: skip
    s = np.array([[[0.3, 0.2, 0.5], [0.1, 9.0, 0.4]]])
    found = Quantiles(rows).tangent(s)
    scales = [np.array([0.3, 0.22, 0.6]), np.array([0.2, 0.4, 0.5])]
    each = [
        SymmetricSum(first).quantile(scales[0][None, :], 0.95),
        SymmetricSum([*second, UNIFORM]).quantile(scales[1][None, :], 0.9),
    ]
    np.testing.assert_allclose(found.value[0], [one.value[0] for one in each], rtol=1e-12)
    np.testing.assert_allclose(found.gradient[0, 0], each[0].gradient[0] * [1.0, 1.1, 1.2])
    expected = [2.0 * each[1].gradient[0, 0], 0.0, each[1].gradient[0, 1]]
    np.testing.assert_allclose(found.gradient[0, 1], expected)


def test_limits_off_the_middle_give_a_bound_and_a_design_near_it() -> None:
    """Each limit at the whole yield: no proof of the optimum, below it by less than 2 %."""
    problem = stack("yield_percent = 99.0", "lower = -0.25", "upper = 0.3")
    form = problem.form()
    assert form is not None
    assert "each limit of yield_percent kept at the whole yield, and two as if even about the mean" in form.statement
    _, gap, out = solved(problem)
    assert 0.0 < gap < 2.0
    assert out["yield_percent"][0] == pytest.approx(99.0, abs=1e-3)


@pytest.mark.parametrize("off", [1e-9, 1e-7, 1e-5, 1e-3, 0.02, 0.08, 0.2])
@pytest.mark.parametrize("share", [90.0, 99.73])
def test_two_limits_off_the_middle_of_normal_parts_have_the_bound_of_their_exact_probability(
    off: float, share: float
) -> None:
    """Two equal parts: the least cost by the deviation s at which both limits keep the share, by a root of its own."""
    part = PART.replace("{s}", "1.0").replace("{b}", "0.1").replace("{law}", "normal")
    text = f"""
problem = "stack"
objectives = {{ minimise = ["cost"] }}
limits = {{ yield_percent = {share} }}
[requirement]
name = "gap"
unit = "mm"
nominal = 0.0
lower = {off - 0.3!r}
upper = {off + 0.3!r}
{part.format(at=0)}{part.format(at=1)}"""
    problem = read_table(tomllib.loads(text), []).problem
    s = brentq(lambda s: norm.cdf((0.3 + off) / s) - norm.cdf((off - 0.3) / s) - 0.01 * share, 0.01, 1.0)
    least = 2.0 * (1.0 + 0.1 / (3.0 * s / np.sqrt(2.0)))
    assert isinstance(problem, Stack)
    cost, gap, _ = solved(problem)
    assert cost == pytest.approx(least, rel=1e-6)
    assert gap < 1e-4


@pytest.mark.parametrize("off", [1e-7, 1e-5, 1e-3])
def test_a_hair_off_the_middle_the_bound_of_other_laws_stays(off: float) -> None:
    middle = solved(stack("yield_percent = 99.73", "lower = -0.3", "upper = 0.3"))
    beside = solved(stack("yield_percent = 99.73", f"lower = {off - 0.3}", f"upper = {off + 0.3}"))
    assert beside[0] == pytest.approx(middle[0], rel=2e-3)
    assert beside[1] < middle[1] + 0.05


def test_gradients_of_yield_and_half_width_by_differences() -> None:
    problem = stack("yield_percent = 99.0\nvariation = 0.3", "lower = -0.2", "upper = 0.3",
                    method="monte_carlo", more="[propagation]\ncoverage = 0.99\n")  # fmt: skip
    design, step = np.linspace(0.05, 0.3, len(LAWS)), 1e-6
    slopes = problem.gradient(design[None, :])
    moved = np.vstack([design + step * np.eye(len(LAWS)), design - step * np.eye(len(LAWS))])
    out = problem.outputs_of(moved)
    for name in ("yield_percent", "variation"):
        by_differences = (out[name][: len(LAWS)] - out[name][len(LAWS) :]) / (2.0 * step)
        np.testing.assert_allclose(slopes[name][0], by_differences, rtol=1e-5, atol=1e-6)


def test_what_breaks_the_theorem_is_named() -> None:
    skewed = 'skew_normal"\nskew = 3.0\n# "'
    form = stack("yield_percent = 99.0", "lower = -0.3", laws=("uniform", skewed)).form()
    assert form is not None
    assert form.relaxed == ("yield_percent",)
    assert "p1 are skewed" in form.statement
