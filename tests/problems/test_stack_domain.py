"""Formulas that leave their domain: the clutch of the literature, margins by hand, units lost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import Exact, closed_form, exact_vectors
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.expressions import Formula, domain_margin
from tolevo.problems.stack import Stack

PROCESSES = {
    "hub": (55.29, [(10.0, 0.015, 0.015, 0.08), (5.0, 0.5, 0.06, 0.15), (3.5, 0.75, 0.12, 0.25)]),
    "roller_1": (22.86, [(8.0, 0.25, 0.02, 0.15), (3.0, 0.65, 0.08, 0.30)]),
    "roller_2": (22.86, [(2.5, 0.3, 0.04, 0.20), (5.0, 0.045, 0.12, 0.25)]),
    "cage": (101.6, [(4.0, 0.56, 0.08, 0.12), (6.0, 0.16, 0.15, 0.25), (0.5, 0.88, 0.20, 0.40)]),
}
"""Nominal [mm], and a, b, least and largest tolerance of each process (Fortini's clutch)."""


def clutch(folder: Path, *overrides: str) -> Stack:
    tables = [
        f"[[part]]\nname = '{name}'\nnominal = {nominal}\nunit = 'mm'\n"
        + "".join(
            f"[[part.process]]\nname = 'p{at}'\nt_min = {low}\nt_max = {high}\n"
            f"cost = {{ model = 'reciprocal', a = {a}, b = {b} }}\n"
            for at, (a, b, low, high) in enumerate(ways)
        )
        for name, (nominal, ways) in PROCESSES.items()
    ]
    head = """
problem = "stack"
[objectives]
minimise = ["cost"]
[algorithm]
name = "exact"
[requirement]
unit = "rad"
formula = "acos((hub + (roller_1 + roller_2)/2) / (cage - (roller_1 + roller_2)/2))"
"""
    (folder / "c.toml").write_text(head + "".join(tables), encoding="utf-8")
    problem = read(folder / "c.toml", overrides).problem
    assert isinstance(problem, Stack)
    return problem


@pytest.mark.parametrize(
    ("method", "limit", "cost"),
    [("rss", 0.035, 24.462426), ("rss", 0.025, 30.020704),
     ("worst_case", 0.035, 34.127904), ("worst_case", 0.070, 24.251967)],
)  # fmt: skip
def test_clutch_of_the_literature(method: str, limit: float, cost: float, tmp_path: Path) -> None:
    overrides = f'requirement.method="{method}"', f"limits.variation={limit}"
    problem = clutch(tmp_path, *overrides)
    form = closed_form(problem)
    assert form is not None
    x = exact_vectors(problem, form, 1)
    found = problem.outputs_of(problem.complete(x))
    assert found["cost"][0] == pytest.approx(cost, abs=5e-7)  # all digits that are printed
    assert found["variation"][0] <= limit
    bound = proof(problem, {"cost": found["cost"]}, 1).bound
    assert bound[0] == pytest.approx(cost, abs=6e-7)  # less the room that rounding has


def test_the_domain_is_a_warning_that_says_where(tmp_path: Path) -> None:
    warning = clutch(tmp_path).warnings()[0]
    assert "requirement.formula leaves its domain within the widest tolerances: column 1" in warning
    assert "acos is defined on [-1, 1], its argument is" in warning
    assert "limits.domain_margin = 0 refuses them" in warning
    by_sample = clutch(tmp_path, 'requirement.method="monte_carlo"', "propagation.samples=4096")
    assert "designs that do are infeasible" in by_sample.warnings()[0]


def test_margin_by_hand(tmp_path: Path) -> None:
    """(1 - argument at the worst corner) / (1 - argument at the mid-limits)."""
    problem = clutch(tmp_path)
    rng = np.random.default_rng(0)
    x = rng.uniform(problem.xl, problem.xu, (30, problem.n_var))
    designs = problem.complete(x)
    hub, one, two, cage = problem.tolerances(designs).T
    r = 0.5 * (one + two)
    worst = 1.0 - (55.29 + 22.86 + hub + r) / (101.6 - 22.86 - cage - r)
    margin = worst / (1.0 - 78.15 / 78.74)
    found = problem.outputs_of(designs)["domain_margin"]
    np.testing.assert_allclose(found, margin, rtol=1e-9, atol=1e-12)
    assert margin.min() < 0.0 < margin.max()


def test_designs_beyond_the_edge_are_infeasible_where_the_formula_is_sampled(tmp_path: Path) -> None:
    problem = clutch(tmp_path, 'requirement.method="monte_carlo"', "propagation.samples=4096")
    x = np.random.default_rng(0).uniform(problem.xl, problem.xu, (30, problem.n_var))
    designs = problem.complete(x)
    found = problem.outputs_of(designs)
    feasible = np.all(problem.violations(designs, found) <= 0.0, axis=1)
    np.testing.assert_array_equal(feasible, found["domain_margin"] >= 0.0)
    assert np.all(np.isfinite(found["variation"]))


def test_units_beyond_the_edge_do_not_conform(tmp_path: Path) -> None:
    """acos has no value where hub + r > cage - r: one normal probability, with no other limit."""
    problem = clutch(tmp_path, "requirement.lower=-1.0", "propagation.samples=262144")
    design = problem.complete(problem.xu[None, :])
    found = problem.outputs_of(design)
    hub, one, two, cage = problem.tolerances(design)[0] / 3.0
    lost = norm.sf((78.74 - 78.15) / np.linalg.norm([hub, one, two, cage]))
    error = found["yield_percent_error"][0]
    assert found["yield_percent"][0] == pytest.approx(100.0 * (1.0 - lost), abs=4.0 * error)
    assert lost > 1e-4


@pytest.mark.slow
def test_a_limit_on_the_margin_is_kept(tmp_path: Path) -> None:
    """With the domain asked for, the optimum at 0.035 rad costs more and stays inside."""
    problem = clutch(tmp_path, "limits.variation=0.035", "limits.domain_margin=0.0")
    front = search(problem, Exact(), Budget(), seed=1)
    designs = problem.complete(front.x)
    found = problem.outputs_of(designs)
    best = int(np.argmin(found["cost"]))
    assert found["domain_margin"][best] >= 0.0 and found["variation"][best] <= 0.035
    assert 24.462426 < found["cost"][best] < 26.0


def test_a_front_inside_its_domain_is_not_searched_again(tmp_path: Path) -> None:
    """At a variation of 0.02 the worst corner of every optimum lies inside: the points of the
    closed form are all that is evaluated.
    """
    problem = clutch(tmp_path, 'objectives.minimise=["cost", "variation"]', "limits.variation=0.02",
                     "limits.domain_margin=0.0")  # fmt: skip
    form = problem.form()
    assert form is not None and form.tested == ("domain_margin",)
    found = search(problem, Exact(points=12), Budget(), seed=1)
    assert found.evaluations == len(found.x) <= 12
    out = problem.outputs_of(problem.complete(found.x))
    assert np.all(out["domain_margin"] >= 0.0) and np.all(out["variation"] <= 0.02)


def test_refused_where_no_design_is_inside(tmp_path: Path) -> None:
    """A hub so large that the tightest tolerances reach the edge."""
    clutch(tmp_path)
    text = (tmp_path / "c.toml").read_text(encoding="utf-8").replace("55.29", "55.80")
    (tmp_path / "d.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="even within the tightest tolerances, column 1: acos"):
        read(tmp_path / "d.toml")


@pytest.mark.parametrize(
    ("text", "x", "margin"),
    [
        ("sqrt(a)", 1.0, 0.25), ("sqrt(a)", -4.0, -1.0), ("log(a) + sqrt(8 - a)", 6.0, 0.5),
        ("1/(a - 2)", 3.0, 0.5), ("1/(a - 2)", 1.0, -0.5), ("(a - 6)**-1", 5.0, 0.5),
        ("a**1.5", 2.0, 0.5), ("a**2", -9.0, np.inf), ("tan(a - 4)", 4.0 + 0.25 * np.pi, 0.5),
        ("asin(a - 4)", 4.5, 0.5), ("(a + 1)**-1", 1.5, 0.5), ("(a - 6)**-2", 5.0, 0.5),
        ("tan(a)", 4.5, (1.5 * np.pi - 4.5) / (1.5 * np.pi - 4.0)),  # poles at 1.5 pi, pi / 2
        ("tan(a)", 3.0, (3.0 - 0.5 * np.pi) / (1.5 * np.pi - 4.0)),
        # from (z, y) to the half line y = 0, z <= 0: |y| beside it, the origin is nearest before it
        ("atan2(a, 1)", -3.0, np.sqrt(10.0 / 17.0)), ("atan2(a, 2 - a)", 1.0, np.sqrt(2.0) / 4.0),
        ("atan2(a, 2 - a)", 3.0, 0.75), ("atan2(a, a - 3)", 2.0, 2.0 / np.sqrt(17.0)),
        ("atan2(2 - a, 3 - a)", 3.5, 0.75), ("atan2(6 - a, -1)", 7.0, -0.5),
        ("atan2(-a, a - 3)", 2.0, 2.0 / np.sqrt(17.0)),
    ],
)  # fmt: skip
def test_margins_of_functions(text: str, x: float, margin: float) -> None:
    """Distance of the argument from the edge over that at the middle, a = 4."""
    found = domain_margin(Formula(text), {"a": np.array([x])}, {"a": np.asarray(4.0)})
    np.testing.assert_allclose(np.broadcast_to(found, 1), margin, rtol=1e-12)


# ---------------------------------------------------------------- formulas without slope at the mid-limits

SLOPELESS = Path(__file__).parents[1] / "cases"
UNITS = 1_000_000


def of_case(name: str) -> Stack:
    problem = read(SLOPELESS / name).problem
    assert isinstance(problem, Stack)
    return problem


def normal(rng: np.random.Generator, low: float, high: float) -> np.ndarray:
    """Units of a part with Cp = 1 within these limits."""
    return rng.normal(0.5 * (low + high), (high - low) / 6.0, UNITS)


def pole_units() -> np.ndarray:
    rng = np.random.default_rng(1)
    h, d, t = (rng.uniform(m - r, m + r, UNITS) for m, r in ((90.0, 4.5), (6.0, 0.25), (0.0, 0.1)))
    return np.asarray(np.abs(t * h / d) <= 1.6)


def flange_units() -> np.ndarray:
    rng = np.random.default_rng(2)
    edge, hole_x = normal(rng, 49.7, 50.3), normal(rng, 29.7, 30.3)
    hole, pin = normal(rng, 10.0, 10.036), normal(rng, 9.972, 9.987)  # 10 H9, 10 f7
    bore, boss = normal(rng, 40.0, 40.025), normal(rng, 39.975, 39.991)  # 40 H7, 40 g6
    u, v, w = rng.uniform(-1.0, 1.0, (3, UNITS))
    gap = edge - hole_x + u * (0.1 + (hole - 10.0) / 2) + v * (bore - boss) / 2 + w * (hole - pin) / 2
    return np.asarray((gap >= 19.4) & (gap <= 20.6))


@pytest.mark.parametrize(
    ("name", "worst", "first", "rough", "percent"),
    [
        ("zero_slope/pole.toml", 0.1 * 94.5 / 5.75, 1.5, "H, D", lambda: 100.0 * pole_units().mean()),
        # Rayleigh
        ("zero_slope/true_position.toml", 0.1 * np.sqrt(2.0), 0.0, "x, y", lambda: 100.0 * (1.0 - np.exp(-4.5))),
        ("mmc_assembly_shift/mmc.toml", None, None, "zone, hole, pin, bore, boss",
         lambda: 100.0 * flange_units().mean()),
    ],
)  # fmt: skip
def test_a_formula_without_slope_is_measured_by_corners_and_units(
    name: str, worst: float | None, first: float | None, rough: str, percent: Callable[[], float]
) -> None:
    """These were refused: "no tolerance of it matters", "no finite derivative"."""
    stack = of_case(name)
    (measured,) = stack.measured
    assert ", ".join(measured.mechanism.rough) == rough
    loosest = stack.corner(tight=False)[None]
    outputs = stack.outputs_of(loosest)
    if worst is not None:
        assert outputs["worst_case"][0] == pytest.approx(worst, rel=1e-12)
        assert measured.linear.worst_case(stack.tolerances(loosest))[0] == pytest.approx(first, abs=1e-12)
    error = np.hypot(outputs["yield_percent_error"][0], 0.003)
    assert outputs["yield_percent"][0] == pytest.approx(percent(), abs=4.0 * error)
    (warning,) = (text for text in stack.warnings() if "no slope" in text)
    assert f"by {rough}: rss and contributions are those of the formula itself, by a sample of units" in warning


def test_the_deviation_of_a_formula_without_slope_is_that_of_its_units() -> None:
    """In closed form: T H/D of uniform parts, E[T^2] E[H^2] E[1/D^2]; a Rayleigh radius, s sqrt(2 - pi/2)."""
    stack = of_case("zero_slope/pole.toml")
    outputs = stack.outputs_of(stack.corner(tight=False)[None])
    std = np.sqrt(0.01 / 3.0 * (90.0**2 + 4.5**2 / 3.0) / (5.75 * 6.25))
    assert outputs["rss"][0] == pytest.approx(3.0 * std, rel=1e-4)
    shares = {name: outputs[f"contribution_{name}_percent"][0] for name in "THD"}
    assert sum(shares.values()) == pytest.approx(100.0)
    # t dW/dt of the worst corner, 0.1 (90 + H)/(6 - D): 1, H/(90 + H), D/(6 - D)
    growth = np.array([1.0, 4.5 / 94.5, 0.25 / 5.75])
    np.testing.assert_allclose([shares[name] for name in "THD"], 100.0 * growth / growth.sum(), rtol=1e-5)
    radial = of_case("zero_slope/true_position.toml")
    outputs = radial.outputs_of(radial.corner(tight=False)[None])
    assert outputs["rss"][0] == pytest.approx(0.1 * np.sqrt(2.0 - 0.5 * np.pi), rel=1e-3)
    assert outputs["contribution_x_percent"][0] == pytest.approx(50.0, abs=0.05)


def test_shares_of_a_formula_without_slope_are_those_of_the_variance(tmp_path: Path) -> None:
    """a^2 + 2 b + c |d| about 0: variances 2 s_a^4, 4 s_b^2 and s_c^2 s_d^2, which grow as t^4, t^2 and t^2 t^2."""
    parts = "".join(f"[[part]]\nname = '{n}'\nnominal = 0\ntolerance = {t}\n"
                    for n, t in (("a", 1.5), ("b", 0.3), ("c", 1.2), ("d", 0.9)))  # fmt: skip
    head = "problem = 'stack'\n[requirement]\nunit = 'mm'\nformula = 'a**2 + 2*b + c*abs(d)'\nmethod = 'shifted_rss'\n"
    (tmp_path / "c.toml").write_text(head + parts, "utf-8")
    stack = read(tmp_path / "c.toml").problem
    assert isinstance(stack, Stack)
    outputs = stack.outputs_of(stack.corner(tight=False)[None])
    a, b, c, d = 0.5, 0.1, 0.4, 0.3
    terms = np.array([2.0 * a**4, 4.0 * b**2, (c * d) ** 2])
    assert outputs["rss"][0] == pytest.approx(3.0 * np.sqrt(terms.sum()), rel=5e-3)
    assert outputs["variation"][0] == pytest.approx(a**2 + 3.0 * np.sqrt(terms.sum()), rel=5e-3)
    growth = np.array([4.0 * terms[0], 2.0 * terms[1], 2.0 * terms[2], 2.0 * terms[2]])
    found = [outputs[f"contribution_{name}_percent"][0] for name in "abcd"]
    np.testing.assert_allclose(found, 100.0 * growth / growth.sum(), atol=0.5)


@pytest.mark.parametrize(
    ("formula", "rough"),
    [
        ("max(a, b) + a + b", "ab"),  # a kink, and slopes 2 and 1
        ("abs(a - b) + c", "ab"),
        ("min(a, b) + 2*c", "ab"),
        ("(a - 10)*(b - 5) + c", "b"),
        ("(a - 10)**2 + (b - 10)**2 - c", "ab"),
        ("c*sqrt((a - b)**2)", "abc"),
        ("a + b**2/c", ""),
        ("max(a, b + 3) + c", "a"),
    ],
)
def test_the_worst_case_without_slope_is_that_of_an_enumeration(formula: str, rough: str, tmp_path: Path) -> None:
    nominals, t = (10.0, 10.0, 7.0), np.array([0.3, 0.2, 0.1])
    parts = "".join(f"[[part]]\nname = '{n}'\nnominal = {x}\ntolerance = {r}\n"
                    for n, x, r in zip("abc", nominals, t, strict=True) if n in formula)  # fmt: skip
    text = f"[requirement]\nunit = 'mm'\nformula = '{formula}'\nmethod = 'worst_case'\n{parts}"
    if rough == "a":  # b + 3 is always the larger one
        (tmp_path / "c.toml").write_text(f"problem = 'stack'\n{text}", "utf-8")
        with pytest.raises(InputError, match="does not depend on a anywhere within the tolerances: leave it out"):
            read(tmp_path / "c.toml")
        return
    (tmp_path / "c.toml").write_text(f"problem = 'stack'\n{text}", "utf-8")
    stack = read(tmp_path / "c.toml").problem
    assert isinstance(stack, Stack)
    assert "".join(stack.measured[0].mechanism.rough) == rough
    levels = np.meshgrid(*(np.linspace(x - r, x + r, 9) for x, r in zip(nominals, t, strict=True)))
    functions = {"max": lambda *x: np.maximum.reduce(np.broadcast_arrays(*x)), "abs": np.abs, "sqrt": np.sqrt,
                 "min": lambda *x: np.minimum.reduce(np.broadcast_arrays(*x))}  # fmt: skip
    at = dict(zip("abc", levels, strict=True)) | functions
    y, middle = (eval(formula, {}, x) for x in (at, dict(zip("abc", nominals, strict=True)) | functions))
    found = stack.outputs_of(stack.corner(tight=False)[None])["worst_case"][0]
    if rough:
        assert found == pytest.approx(np.abs(y - middle).max(), rel=1e-9)
    else:  # of the linear model, as before
        assert found == pytest.approx(0.3 + 2.0 * 10.0 / 7.0 * 0.2 + 100.0 / 49.0 * 0.1)


RADIAL = """
problem = "stack"
[objectives]
minimise = ["cost"]
[limits]
{limit}
[requirement]
name = "radial offset"
unit = "mm"
formula = "sqrt(x**2 + y**2)"
upper = 0.1
method = "{method}"
[[part]]
name = "x"
nominal = 0.0
t_min = 0.02
t_max = 0.3
cost = {{ model = "reciprocal", a = 1.0, b = 0.05 }}
[[part]]
name = "y"
nominal = 0.0
t_min = 0.02
t_max = 0.3
cost = {{ model = "reciprocal", a = 1.0, b = 0.05 }}
"""


@pytest.mark.parametrize(
    ("method", "limit", "t"),
    [("monte_carlo", "yield_percent = 99.0", 0.3 / np.sqrt(2.0 * np.log(100.0))),  # Rayleigh, alike by symmetry
     ("worst_case", "variation = 0.1", 0.1 / np.sqrt(2.0)),
     ("rss", "variation = 0.1", 0.1 / np.sqrt(2.0 - 0.5 * np.pi)),
     ("worst_case", "rss = 0.1", 0.1 / np.sqrt(2.0 - 0.5 * np.pi)),
     ("shifted_rss", "variation = 0.1", 0.1 / (np.sqrt(2.0 - 0.5 * np.pi) + np.sqrt(0.5 * np.pi) / 3.0))],
)  # fmt: skip
def test_the_least_cost_of_a_radial_position(method: str, limit: str, t: float, tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(RADIAL.format(method=method, limit=limit), "utf-8")
    problem = read(tmp_path / "c.toml").problem
    assert problem is not None
    found = search(problem, Exact(), Budget(), seed=0)
    outputs = problem.outputs_of(problem.complete(found.x))
    least = 2.0 * (1.0 + 0.05 / t)
    assert outputs["cost"].min() == pytest.approx(least, rel=5e-3)


def test_a_promise_over_a_formula_without_slope_is_refused_in_words(tmp_path: Path) -> None:
    text = RADIAL.format(method="monte_carlo", limit="") + "[promise]\nyield_percent = 99.0\nstatement = 'plug_in'\n"
    (tmp_path / "c.toml").write_text(text, "utf-8")
    with pytest.raises(InputError, match="promise: follows from slopes at the mid-limits, and requirement"):
        read(tmp_path / "c.toml")


def test_a_part_of_which_only_a_formula_without_slope_knows_is_needed(tmp_path: Path) -> None:
    """L moves nothing at tilt 0; the least cost of both requirements by scipy on the closed forms is 6.36494."""
    text = RADIAL.format(method="monte_carlo", limit='"position.yield_percent" = 99.0\n"play.variation" = 0.2')
    text = text.replace("[requirement]", "[[requirement]]").replace("radial offset", "position")
    text += """
[[requirement]]
name = "play"
unit = "mm"
formula = "L*sin(tilt) + x - y"
method = "worst_case"
[[part]]
name = "L"
nominal = 50.0
t_min = 0.1
t_max = 1.0
cost = { model = "reciprocal", a = 1.0, b = 0.1 }
[[part]]
name = "tilt"
unit = "rad"
nominal = 0.0
t_min = 0.0005
t_max = 0.01
cost = { model = "reciprocal", a = 1.0, b = 0.001 }
"""
    (tmp_path / "c.toml").write_text(text, "utf-8")
    problem = read(tmp_path / "c.toml").problem
    assert isinstance(problem, Stack)
    assert [measured.mechanism.rough for measured in problem.measured] == [("x", "y"), ("L",)]
    found = search(problem, Exact(), Budget(), seed=0)
    assert problem.outputs_of(problem.complete(found.x))["cost"].min() == pytest.approx(6.36494, rel=1e-4)


def test_of_a_linear_formula_the_normal_distribution_is_what_misleads(tmp_path: Path) -> None:
    """Two uniform parts +-0.1: variance 2 * 0.01/3, so that 3 standard deviations lie beyond the worst case of 0.2."""
    (tmp_path / "c.toml").write_text(
        """
problem = "stack"
objectives.minimise = ["cost"]
requirement = { unit = "mm", formula = "a - b", lower = 24999.7, upper = 25000.3 }
[[part]]
name = "a"
nominal = 25015
unit = "mm"
distribution = "uniform"
tolerance = 0.1
[[part]]
name = "b"
nominal = 15
unit = "mm"
distribution = "uniform"
t_min = 0.05
t_max = 0.1
cost = { model = "reciprocal", a = 1, b = 1 }
""",
        encoding="utf-8",
    )
    problem = read(tmp_path / "c.toml").problem
    assert problem is not None
    (warning,) = (text for text in problem.warnings() if "misleads" in text)
    assert warning.startswith(
        "the normal distribution misleads at the loosest tolerances: outside 25000.0000 +- 0.2449 mm"
    )
    assert "promises 0.27 %, but the parts' distributions give 0 %" in warning
    assert "linear model" not in warning and "formula itself" not in warning


@pytest.mark.parametrize(
    ("formula", "nominal", "curved"),
    [("sqrt(a**2 + c**2) - b", 1000.0, False), ("", 1000.0, False), ("a**3/c**2 + b/100", 0.1, True)],
)
def test_the_normal_distribution_misleads_where_the_slopes_do_not(formula: str, nominal: float, curved: bool) -> None:
    """Uniform parts +-0.1: none is beyond 0.2449 while the formula is straight; (0.1 +- 0.1)^3 is not."""
    law = {"unit": "mm", "distribution": "uniform"}
    parts = [{"name": name, "nominal": nominal, "tolerance": 0.1} | law for name in "ab"]
    if "c**2" in formula:
        parts.append({"name": "c", "nominal": 1.0, "tolerance": 1e-6} | law)
    if not formula:
        parts = [table | {"sensitivity": slope} for table, slope in zip(parts, (1.0, -1.0), strict=True)]
    keys = {"formula": formula} if formula else {}
    source = {"problem": "stack", "requirement": {"unit": "mm"} | keys, "part": parts}
    problem = read(source).problem
    assert problem is not None
    (warning,) = (text for text in problem.warnings() if "misleads" in text)
    assert ("the linear model misleads" in warning) == curved
    assert ("the normal distribution misleads" in warning and "parts' distributions give 0 %" in warning) != curved
