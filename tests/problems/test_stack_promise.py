"""`[promise]`: assured, predictive and plug-in, against formulas, draws and faults."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from typer.testing import CliRunner

import tolevo
from tolevo.cli import app
from tolevo.commands.run.promise import cheapest_design, expected_gain, next_parts, shadow_gain
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.problems.stack.promises import with_knowledge, with_statement

SLOPES, SIZES, PRICES = (1.0, -1.5, 0.7, 2.0), (12, 20, 30, 8), (1.0, 2.0, 0.5, 3.0)
PRIORS = ("", "", "prior = { cp = 1.0, parts = 15 }", "")


def samples() -> list[list[float]]:
    rng = np.random.default_rng(21)
    return [rng.normal(0.4, 10.0 / 3.0, n).round(3).tolist() for n in SIZES]


def text(statement: str = "assured", more: str = "", mean: str = "corrected") -> str:
    parts = "".join(
        f'[[part]]\nname = "p{at}"\nunit = "um"\nsensitivity = {slope}\nt_min = 0.5\nt_max = 60.0\n'
        f'cost = {{ model = "reciprocal", a = 0.0, b = {PRICES[at]} }}\n[part.measured]\n'
        f'values = {samples()[at]}\nmade_to = 10.0\nmean = "{mean}"\n{PRIORS[at]}\n'
        for at, slope in enumerate(SLOPES)
    )
    return (
        f'problem = "stack"\n{more}\n[objectives]\nminimise = ["cost"]\n[promise]\n'
        f'yield_percent = 99.73\nstatement = "{statement}"\n[requirement]\nunit = "um"\n'
        f'nominal = 0.0\nlower = -40.0\nupper = 40.0\n[algorithm]\nname = "exact"\n{parts}'
    )


def built(folder: Path, written: str) -> Any:
    (folder / "c.toml").write_text(written, encoding="utf-8")
    return read(folder / "c.toml").problem


def by_hand(t: np.ndarray) -> float:
    """h of the note, by explicit sums."""
    even = own = shared = 0.0
    for at, values in enumerate(samples()):
        n, s = len(values), float(np.std(values, ddof=1))
        df, parts = n - 1.0, 15.0 if PRIORS[at] else 0.0
        s = np.sqrt((parts * (10.0 / 3.0) ** 2 + df * s**2) / (parts + df))
        df += parts
        v = (SLOPES[at] * s * t[at] / 10.0) ** 2
        e = df / (df - 2.0)
        g = df / stats.chi2.ppf(0.05, df) - e
        even += e * v * (1.0 + 1.0 / n)
        own += (g * v * (1.0 + 1.0 / n)) ** 2
        if PRIORS[at]:
            shared += (stats.norm.ppf(0.975) ** 2 - 1.0) * e * v / n
    return float(np.sqrt(even + np.sqrt(own + shared**2)))


def test_the_promised_yield_is_that_of_the_norm(tmp_path: Path) -> None:
    problem = built(tmp_path, text())
    t = np.array([14.0, 9.0, 20.0, 5.0])
    found = problem.frame(t[None, :]).iloc[0]
    expected = 100.0 * (2.0 * stats.norm.cdf(40.0 / by_hand(t)) - 1.0)
    assert found["promised_yield_percent"] == pytest.approx(expected, abs=1e-9)
    assert found["yield_percent"] > expected


def test_the_optimum_is_proven_and_meets_the_norm(tmp_path: Path) -> None:
    built(tmp_path, text())
    done = CliRunner().invoke(app, ["run", str(tmp_path / "c.toml"), "--out", str(tmp_path / "o")])
    assert done.exit_code == 0, done.output
    row = pd.read_csv(tmp_path / "o" / "front.csv").iloc[0]
    assert 0.0 <= row["gap_percent"] < 1e-4
    t = row[[f"p{at}_t" for at in range(4)]].to_numpy(dtype=float)
    assert 3.0 * by_hand(t) == pytest.approx(40.0, rel=1e-4)  # 99.73 % are 2.99998 sigma
    assert 94.0 <= row["assurance_percent"] <= 99.0
    assert "Promised: at least 99.73 % of the units conform, with 95 % confidence" in done.output
    costs = pd.read_csv(tmp_path / "o" / "promise.csv").set_index("statement")["cost"]
    assert costs["plug_in"] < costs["predictive"] < costs["assured"]
    assert costs["assured"] == pytest.approx(row["cost"], rel=1e-9)
    page = (tmp_path / "o" / "report.html").read_text(encoding="utf-8")
    assert "Cost of assurance" in page
    assert "Control charts" in page
    assert pd.read_csv(tmp_path / "o" / "next_parts.csv")["rank"].tolist() == [1, 2, 3, 4]
    kept = pd.read_csv(tmp_path / "o" / "capability.csv")
    assert set(kept["index"]) == {"Cp", "Cpk"}


def test_a_drawing_that_breaks_the_promise_is_said(tmp_path: Path) -> None:
    """Too coarse steps: the rounded tolerances have the norm of another sum."""
    steps = "[rounding]\n" + "".join(f"p{at}_t = [30.0, 50.0]\n" for at in range(4))
    built(tmp_path, text(more=steps))
    done = CliRunner().invoke(app, ["run", str(tmp_path / "c.toml"), "--out", str(tmp_path / "o")])
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "o" / "summary.json").read_text(encoding="utf-8"))["promise"]
    assert found["rounded_kept"] is False
    assert 3.0 * by_hand(np.full(4, 30.0)) > 40.0
    assert found["rounded_assurance_percent"] < 50.0 < found["assurance_percent"]
    assert found["rounded_assurance_percent"] < 0.05
    assert "as rounded for the drawing it is not kept (probability less than 0.1 %)" in done.output


def test_slopes_of_promised_yields_are_differences(tmp_path: Path) -> None:
    """1e-6 of the largest: central differences with steps of 1e-5."""
    t, step = np.array([14.0, 9.0, 20.0, 5.0]), 1e-5
    for statement in ("assured", "predictive"):
        problem = built(tmp_path, text(statement, mean="as_found"))
        slopes = problem.gradient(t[None, :])["promised_yield_percent"][0]
        moved = t + step * np.vstack([np.eye(4), -np.eye(4)])
        values = problem.frame(moved)["promised_yield_percent"].to_numpy()
        by_steps = (values[:4] - values[4:]) / (2.0 * step)
        np.testing.assert_allclose(slopes, by_steps, atol=1e-5 * np.abs(by_steps).max())


def test_assurance_and_expected_yield_by_other_draws(tmp_path: Path) -> None:
    """40,000 posteriors by scipy: 0.8 % is four standard errors of both together."""
    problem = built(tmp_path, text("predictive"))
    t = np.array([12.0, 8.0, 17.0, 5.0])
    found = problem.frame(t[None, :]).iloc[0]
    variance, shift = np.zeros(40_000), np.zeros(40_000)
    for at, part in enumerate(problem.definition.parts):
        known = part.sample.knowledge
        sigma = known.std * np.sqrt(stats.invgamma(known.df / 2.0, scale=known.df / 2.0).rvs(
            40_000, random_state=at))  # fmt: skip
        along = SLOPES[at] * t[at] / 10.0
        variance += (along * sigma) ** 2
        shift += along * stats.norm.rvs(0.0, sigma / np.sqrt(known.n), random_state=50 + at)
    std = np.sqrt(variance)
    inside = stats.norm.cdf((40.0 - shift) / std) - stats.norm.cdf((-40.0 - shift) / std)
    assert found["assurance_percent"] == pytest.approx(100.0 * np.mean(inside >= 0.9973), abs=1.2)
    assert found["promised_yield_percent"] == pytest.approx(100.0 * inside.mean(), abs=0.02)


def test_plug_in_keeps_the_estimated_yield(tmp_path: Path) -> None:
    problem = built(tmp_path, text("plug_in"))
    assert [(limit.name, limit.low) for limit in problem.limits] == [("yield_percent", 99.73)]
    least = cheapest_design(problem)
    found = problem.frame(least.design[None, :]).iloc[0]
    assert found["yield_percent"] == pytest.approx(99.73, abs=1e-6)
    assert found["assurance_percent"] < 50.0
    assert "promised_yield_percent" not in found


def test_means_as_found_take_room(tmp_path: Path) -> None:
    """T >= |sum a xbar| + K h."""
    problem = built(tmp_path, text(mean="as_found"))
    centre = float(np.dot(SLOPES, [np.mean(values) for values in samples()]))
    least = cheapest_design(problem)
    z = stats.norm.ppf(0.5 * 1.9973)
    assert z * by_hand(least.design) == pytest.approx(40.0 - abs(centre), rel=1e-7)


def test_the_resolved_configuration_promises_the_same(tmp_path: Path) -> None:
    first = built(tmp_path, text())
    told = CliRunner().invoke(app, ["check", str(tmp_path / "c.toml")]).stdout
    assert "the promise includes the" in told
    (tmp_path / "again").mkdir()
    again = built(tmp_path / "again", told)
    t = np.array([[12.0, 8.0, 17.0, 5.0]])
    np.testing.assert_array_equal(first.frame(t), again.frame(t))


def test_what_to_measure_next_is_what_more_parts_are_worth(tmp_path: Path) -> None:
    """The price of a small change by differences of the least cost; expected gains are positive."""
    stack = built(tmp_path, text())
    ranking = next_parts(stack, 2)
    assert ranking["expected_gain"].notna().sum() == 2
    name = str(ranking["part"].iloc[0])
    assert 0.5 * shadow_gain(stack, name) < expected_gain(stack, name) < 1.1 * shadow_gain(
        stack, name)  # fmt: skip
    known = {part.name: part.sample.knowledge for part in stack.definition.parts}
    same = with_knowledge(stack, {name: known[name]})
    assert cheapest_design(same).cost == pytest.approx(cheapest_design(stack).cost, rel=1e-9)
    assert cheapest_design(with_statement(stack, "plug_in")).cost < cheapest_design(stack).cost


def test_a_promise_out_of_reach_is_said_before(tmp_path: Path) -> None:
    wide = text().replace("t_min = 0.5", "t_min = 14.0")
    with pytest.raises(InputError, match="the best that the tightest corner allows is"):
        built(tmp_path, wide)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('statement = "assured"', 'statement = "sure"'), "must be one of plug_in, predictive"),
        (('statement = "assured"', ""), "promise.statement: is missing"),
        (("yield_percent = 99.73\n", ""), "promise.yield_percent: is missing"),
        (("yield_percent = 99.73", "yield_percent = 100"), "must lie in [50, 100), got 100"),
        (("[requirement]", "confidence_percent = 20\n[requirement]"), "must lie in [80, 100)"),
        (("[requirement]", "confidence = 95\n[requirement]"), "confidence: is not a known key"),
        (("lower = -40.0\nupper = 40.0\n", ""), "promise: has no yield"),
        (("[promise]", "[limits]\nyield_percent = 99.0\n[promise]"),
         "limits.yield_percent: asks for 99 % at least, but the promise is of 99.73 %"),
        (("[algorithm]", '[[correlation]]\nparts = ["p0", "p1"]\ncoefficient = 0.5\n[algorithm]'),
         "promise.statement: cannot be assured with [[correlation]]"),
    ],
)  # fmt: skip
def test_faults(change: tuple[str, str], words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        built(tmp_path, text().replace(*change, 1))
    assert words in "\n".join(str(fault) for fault in caught.value.faults)


def test_the_same_percentage_as_a_limit_is_the_promise(tmp_path: Path) -> None:
    problem = built(tmp_path, text().replace("[promise]", "[limits]\nyield_percent = 99.73\n"
                                             "[promise]", 1))  # fmt: skip
    assert [limit.name for limit in problem.limits] == ["promised_yield_percent"]


def test_tails_are_not_called_assured(tmp_path: Path) -> None:
    values = np.random.default_rng(5).standard_t(2.0, 40).round(3).tolist()
    own = f"values = {samples()[1]}\nmade_to = 10.0"
    written = text().replace(own, f"values = {values}\nmade_to = 25.0")
    built(tmp_path, written)
    done = CliRunner().invoke(app, ["run", str(tmp_path / "c.toml"), "--out", str(tmp_path / "o")])
    assert done.exit_code == 0, done.output
    assert "it is not called assured, for p1 has an outlier" in done.output
    assert "by the Bayesian bootstrap" in done.output


def test_pieces_of_one_part_share_the_error_of_its_mean(tmp_path: Path) -> None:
    """Two pieces: variances add, 2 v; the error of their mean is the same, 4 v/n."""
    written = text().replace('name = "p0"\n', 'name = "p0"\ncount = 2\n')
    t = np.array([[14.0, 1e-9, 1e-9, 1e-9]])
    problem = built(tmp_path, written)
    n, s = SIZES[0], float(np.std(samples()[0], ddof=1))
    v, limit = (s * 14.0 / 10.0) ** 2, (n - 1.0) / stats.chi2.ppf(0.05, n - 1.0)
    h = np.sqrt(limit * (2.0 * v + 4.0 * v / n))
    expected = 100.0 * (2.0 * stats.norm.cdf(40.0 / h) - 1.0)
    assert problem.frame(t)["promised_yield_percent"].iloc[0] == pytest.approx(expected, abs=1e-8)


def test_one_limit_alone_takes_the_error_of_the_mean_in_full(tmp_path: Path) -> None:
    """h = a + sqrt((sqrt(a^2 + N) - a)^2 + c^2) by explicit sums; the optimum meets it."""
    problem = built(tmp_path, text().replace("lower = -40.0\n", "").replace(PRIORS[2], ""))
    t = np.array([14.0, 9.0, 20.0, 5.0])
    z, k = stats.norm.ppf(0.95), stats.norm.ppf(0.9973)

    def reach(t: np.ndarray) -> float:
        even, own, error = 0.0, 0.0, 0.0
        for at, values in enumerate(samples()):
            n = len(values)
            v = (SLOPES[at] * float(np.std(values, ddof=1)) * t[at] / 10.0) ** 2
            e = (n - 1.0) / (n - 3.0)
            even += e * v
            own += ((((n - 1.0) / stats.chi2.ppf(0.05, n - 1.0)) - e) * v) ** 2
            error += e * v / n
        a = np.sqrt(even)
        return float(a + np.hypot(np.sqrt(even + np.sqrt(own)) - a, z / k * np.sqrt(error)))

    found = problem.frame(t[None, :]).iloc[0]
    expected = 100.0 * stats.norm.cdf(40.0 / reach(t))
    assert found["promised_yield_percent"] == pytest.approx(expected, abs=1e-9)
    least = cheapest_design(problem)
    assert k * reach(least.design) == pytest.approx(40.0, rel=1e-6)
    kept = problem.frame(least.design[None, :]).iloc[0]
    assert 94.0 <= kept["assurance_percent"] <= 98.0
    slopes, step = problem.gradient(t[None, :])["promised_yield_percent"][0], 1e-5
    values = problem.frame(t + step * np.vstack([np.eye(4), -np.eye(4)]))["promised_yield_percent"]
    by_steps = (values.to_numpy()[:4] - values.to_numpy()[4:]) / (2.0 * step)
    np.testing.assert_allclose(slopes, by_steps, atol=1e-5 * np.abs(by_steps).max())


@pytest.mark.parametrize("statement", ["plug_in", "predictive", "assured"])
def test_nominal_values_outside_of_the_limits_are_a_fault(statement: str, tmp_path: Path) -> None:
    wrong = text().replace("nominal = 0.0", "nominal = 45.0").replace('"assured"', f'"{statement}"')
    with pytest.raises(InputError) as caught:
        built(tmp_path, wrong)
    assert [str(fault) for fault in caught.value.faults] == [
        "requirement: is 45 um at the nominal values, above upper = 40: whatever the tolerances, "
        "fewer than half of the units conform, but 99.73 % are required; move the nominal values "
        "or the limits"
    ]  # fmt: skip


@pytest.mark.parametrize("method", ["worst_case", "rss", "shifted_rss", "monte_carlo"])
def test_a_nominal_outside_of_its_own_limits_is_reported_for_every_method(method: str) -> None:
    """40 cos 40 deg + sqrt(140^2 - (40 sin 40 deg + 2)^2) is 167.872 mm, and the limits begin at
    168.9: a fault where a yield is asked for, and a note else.
    """
    path = Path(__file__).parents[1] / "cases" / "nominal_outside_limits" / "crank.toml"
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    content["requirement"]["method"] = method
    assert "167.872 mm at the nominal values, below lower = 168.9" in tolevo.check(content)
    with pytest.raises(InputError) as caught:
        tolevo.check(content | {"objectives": {"minimise": ["cost"]}, "limits": {"yield_percent": 99.73}})
    assert "is 167.872 mm at the nominal values, below lower = 168.9: whatever the tolerances" in str(caught.value)


def test_no_yield_exceeds_that_of_the_tightest_parts(tmp_path: Path) -> None:
    """Off-centre between two limits, 200 designs; the least widths are the first."""
    near = text().replace("nominal = 0.0", "nominal = 25.0").replace('"assured"', '"plug_in"')
    with pytest.raises(InputError, match=r"yield_percent: at least 99\.73 percent cannot be met"):
        built(tmp_path, near.replace("t_min = 0.5", "t_min = 14.0"))
    problem = built(tmp_path, near)
    x = np.random.default_rng(2).uniform(problem.xl, problem.xu, (200, problem.n_var))
    found = problem.outputs_of(problem.complete(x))["yield_percent"]
    tightest = problem.outputs_of(problem.complete(problem.xl[None, :]))["yield_percent"][0]
    assert problem.interval("yield_percent")[1] == pytest.approx(tightest, abs=1e-6)
    assert np.all(found <= tightest + 1e-6)


CASES = Path(__file__).parents[1] / "cases" / "promise_process_crash"


@pytest.mark.parametrize(("name", "choice"), [("small", "die cast"), ("small_grade", "IT12")])
def test_a_promise_among_processes_or_grades(name: str, choice: str, tmp_path: Path) -> None:
    """Part a by one of its processes, b sampled: least cost by the norm in closed form, each way.

    Its review is of the drawing: the process that was chosen, and the rounded tolerances.
    """
    values = np.array([10.001, 10.006, 10.026, 10.015, 9.99, 10.008, 10.001, 10.01, 9.99, 10.011, 10.021, 9.985])
    limit = 11.0 / stats.chi2.ppf(0.05, 11.0) * (1.0 + 1.0 / 12.0) * (np.std(values, ddof=1) / 0.05) ** 2
    free = (0.15 / stats.norm.ppf(0.99865)) ** 2
    grades = zip((0.0135, 0.0215, 0.035, 0.055, 0.09), (3.0, 2.2, 1.6, 1.2, 1.0), strict=True)
    ways = [(t, 1.0 + 0.05 / t) for t in np.linspace(0.02, 0.1, 20001)]
    ways += [(t, 0.5 + 0.05 / t) for t in np.linspace(0.05, 0.15, 20001)]
    least = min(
        cost + 1.0 + 0.05 / np.clip(np.sqrt((free - (t / 3.0) ** 2) / limit), 0.02, 0.2)
        for t, cost in (grades if name == "small_grade" else ways)
        if (t / 3.0) ** 2 < free
    )
    out = tmp_path / "o"
    done = CliRunner().invoke(app, ["run", str(CASES / f"{name}.toml"), "--out", str(out), "--quiet"])
    assert done.exit_code == 0, done.output
    front, summary = pd.read_csv(out / "front.csv"), json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert front["cost"][0] == pytest.approx(least, rel=1e-6)
    assert front["a_process"][0] == choice
    assert summary["promise"]["rounded_kept"] is True
    (tmp_path / "b.csv").write_text("b [mm]\n" + "\n".join(map(str, values)), encoding="utf-8")
    done = CliRunner().invoke(app, ["review", str(out), str(tmp_path / "b.csv")])
    assert done.exit_code == 0, done.output
    at, rounded = 1.0 if choice == "IT12" else 0.5 + 0.05 / 0.095, 0.095
    assert f"the drawing costs {at + 1.0 + 0.05 / rounded:.4g}" in done.output
