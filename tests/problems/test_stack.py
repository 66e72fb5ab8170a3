"""`stack` against published figures, closed forms, finite differences and its own contract."""

from __future__ import annotations

import re
import tomllib
from io import StringIO
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import norm

from tolevo.errors import Fault, ModelError
from tolevo.files import read_own_csv
from tolevo.problems.settings import Bound, PropagationSetting, Settings
from tolevo.problems.stack import Stack
from tolevo.problems.tolerance_problem import ToleranceProblem, designs_of
from tolevo.section import Section
from tolevo.testing import ProblemContract

CLUTCH = """
[requirement]
name = "contact angle"
unit = "rad"
formula = "acos((hub + (roller_1 + roller_2)/2) / (cage - (roller_1 + roller_2)/2))"
lower = 0.087
upper = 0.157
method = "{method}"
[[part]]
name = "hub"
nominal = 55.29
unit = "mm"
t_min = 0.01
t_max = 0.25
cost = {{ model = "reciprocal", a = 3.5, b = 0.75 }}
[[part]]
name = "roller"
count = 2
nominal = 22.86
unit = "mm"
t_min = 0.01
t_max = 0.03
cost = {{ model = "reciprocal", a = 0.5, b = 0.01 }}
[[part]]
name = "cage"
nominal = 101.60
unit = "mm"
[[part.process]]
name = "turned"
t_min = 0.15
t_max = 0.25
cost = {{ model = "reciprocal", a = 6.0, b = 0.16 }}
[[part.process]]
name = "ground"
t_min = 0.01
t_max = 0.16
cost = {{ model = "reciprocal", a = 6.5, b = 0.2 }}
"""


def stack(text: str, **settings: Any) -> Stack:
    faults: list[Fault] = []
    kind = Stack.configured(Section(tomllib.loads(text), "", faults))
    assert faults == [] and kind is not None
    found = kind(Settings(**settings))
    assert isinstance(found, Stack)
    return found


def clutch(method: str = "rss", **settings: Any) -> Stack:
    return stack(CLUTCH.format(method=method), **settings)


class TestContract(ProblemContract):
    problem_type = Stack

    def problem(self) -> ToleranceProblem:
        return clutch()


class TestMonteCarloContract(ProblemContract):
    problem_type = Stack

    def problem(self) -> ToleranceProblem:
        limits = {"yield_percent": Bound(low=99.0)}
        return clutch("monte_carlo", limits=limits, propagation=PropagationSetting(samples=4096))


# ---------------------------------------------------------------- published cases

SENSITIVITIES, A, B = (1.0, 2.0, 0.5, 1.0), (2.0, 1.5, 1.0, 0.5), (0.04, 0.09, 0.01, 0.16)
LIMIT = 0.5


def four_parts(model: str, method: str) -> Stack:
    parts = [
        f"[[part]]\nname = 'p{at}'\nunit = 'mm'\nsensitivity = {s}\nt_min = 0.001\nt_max = 2.0\n"
        f"cost = {{ model = '{model}', a = {a}, b = {b} }}\n"
        for at, (s, a, b) in enumerate(zip(SENSITIVITIES, A, B, strict=True))
    ]
    text = f"[requirement]\nunit = 'mm'\nmethod = '{method}'\n" + "".join(parts)
    limits = {"variation": Bound(high=LIMIT)}
    return stack(text, objectives=("cost",), limits=limits)


def lagrange(power: int, method: str) -> np.ndarray:
    """The optimal tolerances of sum a + b/t^power: slopes of cost and requirement proportional.

    Worst case: b k/t^(k+1) = lambda s; RSS: b k/t^(k+1) = lambda s^2 t.
    """
    s, b = np.array(SENSITIVITIES), np.array(B)
    if method == "worst_case":
        shape = (b / s) ** (1.0 / (power + 1))
        return np.asarray(LIMIT * shape / (s @ shape))
    shape = (b / s**2) ** (1.0 / (power + 2))
    return np.asarray(LIMIT * shape / np.sqrt(s**2 @ shape**2))


CASES = [
    ("reciprocal", 1, "worst_case", 7.397939),
    ("reciprocal", 1, "rss", 6.324376),
    ("reciprocal_squared", 2, "rss", 11.25),
]


@pytest.mark.parametrize(("model", "power", "method", "cost"), CASES)
def test_closed_forms_with_sensitivities(model: str, power: int, method: str, cost: float) -> None:
    problem = four_parts(model, method)
    found = problem.outputs_of(lagrange(power, method)[None, :])
    assert found["cost"][0] == pytest.approx(cost, abs=5e-7)
    assert found["variation"][0] == pytest.approx(LIMIT, rel=1e-12)


@pytest.mark.parametrize(("model", "power", "method", "cost"), CASES)
def test_slsqp_on_outputs_and_gradients_reaches_the_closed_form(
    model: str, power: int, method: str, cost: float
) -> None:
    """In log tolerances; nothing but the problem's own outputs and gradients is used."""
    problem = four_parts(model, method)

    def at(name: str, x: np.ndarray) -> float:
        return float(problem.outputs_of(np.exp(x)[None, :])[name][0])

    def slope(name: str, x: np.ndarray) -> np.ndarray:
        return np.asarray(problem.gradient(np.exp(x)[None, :])[name][0] * np.exp(x))

    settings: dict[str, Any] = {
        "jac": lambda x: slope("cost", x),
        "bounds": list(zip(np.log(problem.xl), np.log(problem.xu), strict=True)),
        "constraints": {
            "type": "ineq",
            "fun": lambda x: LIMIT - at("variation", x),
            "jac": lambda x: -slope("variation", x),
        },
    }
    start = np.log(np.full(4, 0.05))
    solve: Any = minimize  # its stubs know no dictionaries
    found = solve(lambda x: at("cost", x), start, method="SLSQP", tol=1e-12, **settings)
    assert found.fun == pytest.approx(cost, abs=2e-6)
    np.testing.assert_allclose(np.exp(found.x), lagrange(power, method), rtol=1e-3)


MOTOR = [
    ("screw_thread_length", -1, 0.375, "+0/-0.031"),
    ("washer", 1, 0.032, "+0.002/-0.002"),
    ("inner_bearing_cap", 1, 0.06, "+0.003/-0.003"),
    ("bearing", 2, 0.438, "+0/-0.015"),
    ("spacer", 2, 0.12, "+0.005/-0.005"),
    ("rotor", 1, 1.5, "+0.010/-0.004"),
    ("pulley_casting", 1, 0.45, "+0.007/-0.007"),
    ("shaft_turned_length", -1, 3.019, "+0.012/-0"),
    ("tapped_hole_depth", 1, 0.3, "+0.03/-0.03"),
]
"""Name, direction (count), nominal and limits of the 11 dimensions [inch]."""


def test_motor_of_the_dimensioning_and_tolerancing_handbook() -> None:
    """McGraw-Hill handbook, chapter 9: gap 0.0615, worst case 0.0955, RSS 0.0381 inch."""
    parts = [
        f"[[part]]\nname = '{name}'\nunit = 'inch'\nnominal = {nominal}\nlimits = '{limits}'\n"
        f"count = {abs(times)}\nsensitivity = {np.sign(times)}.0\n"
        for name, times, nominal, limits in MOTOR
    ]
    problem = stack("[requirement]\nunit = 'inch'\nlower = 0.0\n" + "".join(parts))
    assert sum(part.count for part in problem.definition.parts) == 11
    found = problem.outputs_of(problem.complete(np.empty((1, 0))))
    assert problem.definition.mechanism.centre == pytest.approx(0.0615, abs=1e-12)
    assert found["worst_case"][0] == pytest.approx(0.0955, abs=1e-12)
    assert found["rss"][0] == pytest.approx(0.0380756, abs=5e-8)
    beyond = 100.0 * norm.cdf(-0.0615 / (0.0380756 / 3.0))
    assert 100.0 - found["yield_percent"][0] == pytest.approx(beyond, abs=1e-3)


def test_clutch_of_fortini() -> None:
    """Contact angle 7.018 degrees; slopes -0.1039, -0.1036 and 0.1032 rad/mm at the nominals."""
    problem = clutch()
    mechanism = problem.definition.mechanism
    assert np.degrees(mechanism.centre) == pytest.approx(7.0184, abs=5e-5)
    angle = mechanism.centre
    reach = 101.60 - 22.86
    by_hub = -1.0 / (reach * np.sin(angle))
    by_cage = np.cos(angle) / (reach * np.sin(angle))
    by_roller = 0.5 * (by_hub - by_cage)
    expected = [by_hub, by_roller, by_roller, by_cage]
    np.testing.assert_allclose(mechanism.sensitivities, expected, rtol=1e-12)
    t = np.array([0.1, 0.0127, 0.2])
    design = np.array([[*t, 0.0]])
    found = problem.outputs_of(design)
    wide = np.abs(expected) * np.array([t[0], t[1], t[1], t[2]])
    assert found["worst_case"][0] == pytest.approx(wide.sum(), rel=1e-12)
    assert found["rss"][0] == pytest.approx(np.linalg.norm(wide), rel=1e-12)
    cost = 3.5 + 0.75 / 0.1 + 2 * (0.5 + 0.01 / 0.0127) + 6.0 + 0.16 / 0.2
    assert found["cost"][0] == pytest.approx(cost, rel=1e-12)
    shares = [found[f"contribution_{name}_percent"][0] for name in ("hub", "roller", "cage")]
    square = 100.0 * wide**2 / np.sum(wide**2)
    np.testing.assert_allclose(shares, [square[0], square[1] + square[2], square[3]])


def test_yield_of_the_clutch_against_the_exact_distribution() -> None:
    """acos falls: the angle is within its limits where hub + r - cos(limit)(cage - r) has a sign.

    That is linear in the normal parts, so each end of the yield is one normal probability.
    """
    problem = clutch(propagation=PropagationSetting(samples=2**18))
    t = np.array([0.2, 0.0127, 0.25])
    found = problem.outputs_of(np.array([[*t, 0.0]]))
    outside = 0.0
    for limit, side in ((0.087, 1.0), (0.157, -1.0)):
        c = np.cos(limit)
        mean = 55.29 + 22.86 - c * (101.60 - 22.86)
        root = 0.5 * (1.0 + c)
        std = np.linalg.norm([t[0], root * t[1], root * t[1], c * t[2]]) / 3.0
        outside += norm.cdf(side * mean / std)
    error = found["yield_percent_error"][0]
    assert error < 0.02
    assert found["yield_percent"][0] == pytest.approx(100.0 * (1.0 - outside), abs=4.0 * error)


# ---------------------------------------------------------------- definitions

LINEAR = """
[requirement]
unit = "mm"
nominal = 0.5
lower = 0.2
upper = 0.8
method = "{method}"
[[part]]
name = "a"
unit = "mm"
sensitivity = 1.0
t_min = 0.01
t_max = 0.3
cost = {{ model = "reciprocal", a = 0.0, b = 1.0 }}
{a}
[[part]]
name = "b"
unit = "um"
sensitivity = -0.001
t_min = 10.0
t_max = 200.0
cost = {{ model = "reciprocal", a = 0.0, b = 100.0 }}
{b}
"""


def linear(method: str = "rss", a: str = "", b: str = "", **settings: Any) -> Stack:
    return stack(LINEAR.format(method=method, a=a, b=b), **settings)


DESIGN = np.array([[0.2, 150.0]])


def test_rss_of_other_inputs_is_three_standard_deviations() -> None:
    problem = linear(a='distribution = "uniform"', b="cp = 1.5")
    expected = np.hypot(np.sqrt(3.0) * 0.2, 0.15 / 1.5)
    assert problem.outputs_of(DESIGN)["rss"][0] == pytest.approx(expected)


@pytest.mark.parametrize("keys", ["cp = 1.2\ncpk = 0.9", "cp = 1.2\nshift = 0.25",
                                  "cp = 1.2\nshift = -0.25"])  # fmt: skip
def test_shifted_rss_adds_mean_shifts_in_the_worst_direction(keys: str) -> None:
    """Chase & Greenwood (1988): Cpk = Cp (1 - m), so 0.9 = 1.2 (1 - 0.25)."""
    problem = linear("shifted_rss", b=keys)
    found = problem.outputs_of(DESIGN)
    spread = np.hypot(0.2, 0.15 / 1.2)
    assert found["rss"][0] == pytest.approx(spread)
    assert found["variation"][0] == pytest.approx(0.25 * 0.15 + spread)


def test_monte_carlo_half_width_of_a_normal_sum_is_the_rss() -> None:
    problem = linear("monte_carlo", propagation=PropagationSetting(samples=2**19))
    found = problem.outputs_of(DESIGN)
    exact = norm.ppf(1.0 - 0.5 * 0.0027) / 3.0 * found["rss"][0]
    assert found["variation"][0] == pytest.approx(exact, rel=5e-3)


def test_monte_carlo_half_width_of_two_uniform_inputs() -> None:
    """The sum of two equal uniform deviations is triangular on [-2t, 2t]: q(p) in closed form."""
    flat = 'distribution = "uniform"'
    problem = linear("monte_carlo", flat, flat, propagation=PropagationSetting(coverage=0.9))
    found = problem.outputs_of(np.array([[0.15, 150.0]]))
    assert found["variation"][0] == pytest.approx(0.3 * (1.0 - np.sqrt(0.1)), rel=2e-3)


def test_yield_of_a_shifted_linear_stack() -> None:
    problem = linear(b="shift = 0.5")
    found = problem.outputs_of(DESIGN)
    mean, std = 0.5 - 0.5 * 0.15, np.hypot(0.2, 0.15) / 3.0
    exact = norm.cdf((0.8 - mean) / std) - norm.cdf((0.2 - mean) / std)
    error = found["yield_percent_error"][0]
    assert found["yield_percent"][0] == pytest.approx(100.0 * exact, abs=4.0 * error)


@pytest.mark.parametrize("coefficient", [1.0, 0.6, -0.4])
def test_correlated_deviations(coefficient: float) -> None:
    """Var(a - b) = va + vb - 2 rho sa sb, in the linear model and in the sample alike."""
    text = LINEAR.format(method="monte_carlo", a="", b="") + (
        f'[[correlation]]\nparts = ["a", "b"]\ncoefficient = {coefficient}\n'
    )
    problem = stack(text, propagation=PropagationSetting(samples=2**18))
    found = problem.outputs_of(DESIGN)
    exact = np.sqrt(0.2**2 + 0.15**2 - 2.0 * coefficient * 0.2 * 0.15)
    assert found["rss"][0] == pytest.approx(exact, rel=1e-9)
    assert found["variation"][0] == pytest.approx(exact, rel=1e-2)
    shares = found["contribution_a_percent"][0] + found["contribution_b_percent"][0]
    assert shares == pytest.approx(100.0)
    std = exact / 3.0
    within = 100.0 * (norm.cdf(0.3 / std) - norm.cdf(-0.3 / std))
    assert found["yield_percent"][0] == pytest.approx(within, abs=0.05)


@pytest.mark.parametrize(
    ("keys", "mid", "t"),
    [('limits = "+0.03/-0.01"', 0.01, 0.02), ('grade = "IT7"', 0.0, 0.0105),
     ('fit = "25 H7"', 0.0105, 0.0105), ('fit = "h7"', -0.0105, 0.0105),
     ('fit = "JS7"', 0.0, 0.0105), ("tolerance = '30 um'", 0.0, 0.03)],
)  # fmt: skip
def test_stated_zones_fix_tolerance_and_mid_limit(keys: str, mid: float, t: float) -> None:
    text = f"""
    [requirement]
    unit = "mm"
    formula = "bore - 2*web"
    [[part]]
    name = "bore"
    nominal = 25.0
    unit = "mm"
    {keys}
    [[part]]
    name = "web"
    nominal = 5000
    unit = "um"
    t_min = 1.0
    t_max = 20.0
    cost = {{ model = "reciprocal", a = 0.0, b = 1.0 }}
    """
    problem = stack(text)
    assert problem.fixed == {"bore_t": pytest.approx(t)}
    assert problem.definition.mechanism.centre == pytest.approx(15.0 + mid)
    found = problem.outputs_of(problem.complete(np.array([[10.0]])))
    assert found["worst_case"][0] == pytest.approx(t + 0.02)
    assert np.isnan(found["yield_percent"][0])


def test_units_are_consistent_within_a_formula() -> None:
    """A lever of 0.1 m tilted by 30 arc minutes, in um, by parts of four units."""
    text = """
    [requirement]
    unit = "um"
    formula = "lever*sin(tilt) + share*rest"
    [[part]]
    name = "lever"
    nominal = 0.1
    unit = "m"
    tolerance = "1 mm"
    [[part]]
    name = "tilt"
    nominal = 30.0
    unit = "arcmin"
    tolerance = 1.0
    [[part]]
    name = "share"
    nominal = 50.0
    unit = "percent"
    tolerance = 1.0
    [[part]]
    name = "rest"
    nominal = 0.2
    unit = "mm"
    tolerance = 0.01
    """
    mechanism = stack(text).definition.mechanism
    angle, arcmin = np.radians(0.5), np.radians(1.0 / 60.0)
    assert mechanism.centre == pytest.approx(1e5 * np.sin(angle) + 100.0)
    expected = [1e6 * np.sin(angle), 1e5 * np.cos(angle) * arcmin, 2.0, 500.0]
    np.testing.assert_allclose(mechanism.sensitivities, expected, rtol=1e-12)


def test_angles_of_the_requirement_in_its_own_unit() -> None:
    text = CLUTCH.format(method="rss").replace('unit = "rad"', 'unit = "deg"', 1)
    text = text.replace("lower = 0.087", "lower = 5.0").replace("upper = 0.157", "upper = 9.0")
    in_degrees, in_radians = stack(text), clutch()
    design = in_radians.complete(np.atleast_2d(in_radians.xu))
    ratio = in_degrees.outputs_of(design)["rss"] / in_radians.outputs_of(design)["rss"]
    assert ratio[0] == pytest.approx(180.0 / np.pi)


# ---------------------------------------------------------------- what is known

METHODS = ["worst_case", "rss", "shifted_rss", "monte_carlo"]


@pytest.mark.parametrize("method", METHODS)
def test_gradients_against_finite_differences(method: str) -> None:
    problem = clutch(method)
    design = np.array([[0.1, 0.02, 0.2, 0.0]])
    slopes = problem.gradient(design)
    sampled = method == "monte_carlo"
    for at in range(3):
        step = (1e-4 if sampled else 1e-6) * design[0, at]
        pair = np.repeat(design, 2, axis=0)
        pair[:, at] += [-step, step]
        found = problem.smooth().outputs_of(pair, searching=True)
        for name, slope in slopes.items():
            numeric = (found[name][1] - found[name][0]) / (2.0 * step)
            np.testing.assert_allclose(slope[0, at], numeric, rtol=1e-3 if sampled and name == "variation" else 1e-6)
    assert all(slope[0, 3] == 0.0 for slope in slopes.values())


@pytest.mark.parametrize("output", ["cost", "variation", "worst_case", "rss", "yield_percent"])
@pytest.mark.parametrize("method", METHODS)
def test_proven_intervals_hold_and_are_reached(method: str, output: str) -> None:
    problem = clutch(method)
    low, high = problem.interval(output)
    x = np.random.default_rng(3).uniform(problem.xl, problem.xu, size=(300, problem.n_var))
    designs = np.vstack([problem.complete(x), problem._corners()])
    values = problem.outputs_of(designs, searching=output != "yield_percent")[output]
    if not np.all(np.isnan(values)):
        assert np.all(values >= low - 1e-12) and np.all(values <= high + 1e-12)
    if output in ("worst_case", "rss"):
        assert (values.min(), values.max()) == pytest.approx((low, high))


def test_interval_holds_where_correlation_compensates() -> None:
    text = LINEAR.format(method="rss", a="", b="") + ('[[correlation]]\nparts = ["a", "b"]\ncoefficient = 0.95\n')
    problem = stack(text.replace("t_min = 0.01", "t_min = 0.05"))
    low, high = problem.interval("rss")
    x = np.random.default_rng(0).uniform(problem.xl, problem.xu, size=(500, 2))
    x[0] = [0.05, 47.5]
    values = problem.outputs_of(x)["rss"]
    assert low <= values.min() < problem.outputs_of(problem.xl[None, :])["rss"][0]
    assert values.max() <= high


def by_form(problem: Stack, designs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cost and requirements (rows, n) by the formula of problems/forms.py."""
    form = problem.form()
    assert form is not None
    cost = np.full(len(designs), form.base)
    value = np.repeat(form.offset[:, None], len(designs), axis=1)
    spreads = []
    for feature in form.features:
        t = problem.column(designs, feature.variable)
        chosen = problem.column(designs, feature.choice) if feature.choice else np.zeros(len(t))
        way = [next(w for w in feature.ways if w.choice == c) for c in chosen]
        cost += feature.count * np.array(
            [float(w.curve.cost(np.array([one]))[0]) for w, one in zip(way, t, strict=True)]
        )
        value += np.array([w.linear for w in way]).T * t
        spreads.append(np.array([w.spread for w in way]).T * t)
    s = np.array(spreads)
    r = np.eye(len(s)) if form.correlation is None else form.correlation
    return cost, value + np.sqrt(form.constant[:, None] + np.einsum("jin,jk,kin->in", s, r, s))


@pytest.mark.parametrize("method", ["worst_case", "rss", "shifted_rss"])
@pytest.mark.parametrize("correlated", [False, True])
@pytest.mark.parametrize("bought_in", [False, True])
def test_the_convex_form_is_the_problem(method: str, correlated: bool, bought_in: bool) -> None:
    text = CLUTCH.format(method=method).replace('name = "hub"', 'name = "hub"\ncp = 1.1\nshift = 0.2')
    if bought_in:
        text = text.replace("t_min = 0.01\nt_max = 0.03", "tolerance = 0.02")
    if correlated:
        text += '[[correlation]]\nparts = ["roller_1", "cage"]\ncoefficient = 0.5\n'
    problem = stack(text, limits={"rss": Bound(high=0.03), "worst_case": Bound(high=0.05)})
    form = problem.form()
    assert form is not None
    assert form.outputs == ("variation", "worst_case", "rss")
    assert form.relaxed == ()
    assert len(form.features) == (3 if correlated or not bought_in else 2)
    x = np.random.default_rng(1).uniform(problem.xl, problem.xu, size=(40, problem.n_var))
    designs = problem.complete(x)
    found = problem.outputs_of(designs, searching=True)
    cost, values = by_form(problem, designs)
    np.testing.assert_allclose(cost, found["cost"], rtol=1e-12)
    for name, value in zip(form.outputs, values, strict=True):
        np.testing.assert_allclose(value, found[name], rtol=1e-12)


def test_the_form_names_what_it_leaves_out() -> None:
    limits = {"yield_percent": Bound(low=99.0), "variation": Bound(high=0.03)}
    form = clutch(limits=limits).form()
    assert form is not None
    assert form.relaxed == ("yield_percent",)
    assert clutch("monte_carlo").form() is None


# ---------------------------------------------------------------- processes and tables


def test_a_tolerance_is_moved_to_what_its_process_holds() -> None:
    problem = clutch()
    assert [v.name for v in problem.free] == ["hub_t", "roller_t", "cage_t", "cage_process"]
    x = np.array([[0.1, 0.02, 0.02, 0.2], [0.1, 0.02, 0.2, 0.9], [0.1, 0.02, 0.1, 1.0]])
    designs = problem.complete(x)
    np.testing.assert_array_equal(problem.column(designs, "cage_process"), [0.0, 1.0, 1.0])
    np.testing.assert_array_equal(problem.column(designs, "cage_t"), [0.15, 0.16, 0.1])


def test_tables_hold_the_names_of_processes() -> None:
    problem = clutch()
    x = np.random.default_rng(0).uniform(problem.xl, problem.xu, size=(20, problem.n_var))
    designs = problem.complete(x)
    frame = problem.frame(designs)
    assert set(frame["cage_process"]) == {"turned", "ground"}
    np.testing.assert_array_equal(designs_of(problem, frame), designs)
    again = read_own_csv(StringIO(frame.to_csv(index=False)))
    np.testing.assert_array_equal(designs_of(problem, again), designs)


def test_yield_is_sampled_in_a_search_only_where_it_is_needed() -> None:
    design = np.array([[0.1, 0.02, 0.2, 0.0]])
    assert np.isnan(clutch().outputs_of(design, searching=True)["yield_percent"][0])
    limited = clutch(limits={"yield_percent": Bound(low=90.0)})
    coarse = limited.outputs_of(design, searching=True)["yield_percent"][0]
    fine = limited.outputs_of(design)["yield_percent"][0]
    assert coarse == pytest.approx(fine, abs=0.1)


def test_a_large_batch_stays_small_in_memory() -> None:
    import tracemalloc

    problem = clutch("monte_carlo")
    designs = problem.complete(np.repeat(np.atleast_2d(problem.xu), 40, axis=0))
    tracemalloc.start()
    found = problem.outputs_of(designs)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert np.ptp(found["yield_percent"]) == 0.0
    assert peak < 200 * 2**20


def test_a_stack_needs_its_definition() -> None:
    with pytest.raises(ModelError, match="definition"):
        Stack()


# ---------------------------------------------------------------- warnings and assumptions


def test_nonlinear_spread_is_reported() -> None:
    """RSS promises 0.27 %; the exact normal probabilities of the clutch give twice as much."""
    (warning,) = clutch(limits={"variation": Bound(high=0.035)}).warnings()
    assert "promises 0.27 %" in warning
    assert "formula itself gives 0.5" in warning
    assert "limits of the requirement" in warning


def test_a_linear_formula_is_not_complained_of() -> None:
    parts = "".join(
        f"[[part]]\nname = '{name}'\nunit = 'mm'\nnominal = 10.0\nt_min = 0.1\nt_max = 1.0\n"
        "cost = { model = 'reciprocal', a = 0.0, b = 1.0 }\n"
        for name in "abc"
    )
    text = "[requirement]\nunit = 'mm'\nformula = 'a + b - c'\nlower = 9.0\nupper = 11.0\n" + parts
    assert stack(text).warnings() == ()


def test_unverified_grades_are_named() -> None:
    text = LINEAR.format(method="rss", a="", b="") + (
        "[[part]]\nname = 'c'\nunit = 'mm'\nsensitivity = 1.0\nnominal = 25.0\ngrade = 'IT14'\n"
    )
    problem = stack(text)
    assert "IT14" in problem.warnings()[0]
    assert "part.c.grade" in {one.name for one in problem.assumptions()}


def test_least_cost_within_limits() -> None:
    assert clutch().least_cost() is None
    found = clutch(limits={"variation": Bound(high=0.03)}).least_cost()
    assert found is not None
    assert found[1].objectives == ("cost",)
    wider = found[1].relaxed({"variation": Bound(high=0.04)})
    assert wider.settings.limits["variation"].high == 0.04


@pytest.mark.parametrize(
    ("nominals", "gap"),
    [((40.1, -40.0), "0.1"), ((100.3, -62.7, -37.5), "0.1"), ((0.3, -0.2, -0.1), "0"), ((1e6, -999999.9), "0.1")],
)
def test_the_nominal_of_a_loop_is_the_decimal_sum(nominals: tuple[float, ...], gap: str) -> None:
    parts = "".join(
        f"[[part]]\nname = 'p{at}'\nunit = 'mm'\ntolerance = 0.01\n"
        f"nominal = {abs(size)}\nsensitivity = {np.sign(size)}\n"
        for at, size in enumerate(nominals)
    )
    problem = stack(f"[requirement]\nunit = 'mm'\nlower = -1.0\nupper = 2.0\n{parts}")
    stated = {one.name: one.value for one in problem.assumptions()}
    assert stated["requirement.nominal"] == float(gap)


@pytest.mark.parametrize(("unit", "sensitivity"), [("um", 3.0), ("in", -1.0), ("m", 2.0)])
def test_a_sensitivity_of_one_is_no_millimetre_per_inch(unit: str, sensitivity: float) -> None:
    """A number alone counts per unit of the part, with a warning; with its own units either meaning can be stated."""
    b = f'unit = "{unit}"\nsensitivity = {sensitivity}'
    text = LINEAR.format(method="rss", a="", b="").replace('unit = "um"\nsensitivity = -0.001', b)
    (note,) = [sentence for sentence in stack(text).warnings() if "sensitivity" in sentence]
    assert f"counts as {sensitivity:g} mm/{unit}, which is " in note
    (remedy,) = re.findall(r'"([^"]+)"', note)
    plain = stack(text.replace(f"sensitivity = {sensitivity}\n", f'sensitivity = "{remedy}"\n'))
    assert not any("sensitivity" in sentence for sentence in plain.warnings())
    found = [one.definition.parts[1].sensitivities[""] for one in (stack(text), plain)]
    np.testing.assert_allclose(found, [sensitivity, sensitivity * {"um": 1e-3, "in": 25.4, "m": 1000.0}[unit]])
