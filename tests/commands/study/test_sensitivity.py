"""Known truth: indices of given functions, given noise, through the code that a study goes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from SALib.analyze import morris as salib_morris
from SALib.analyze import sobol as salib_sobol
from scipy.stats import binom, norm

from tolevo.commands.study import sensitivity as sobol
from tolevo.commands.study import statistics as resampling
from tolevo.commands.study.designs import Factorial, LatinHypercube, Morris, OneAtATime, Sobol
from tolevo.commands.study.plan import Design, Factor, StudyData, StudySettings
from tolevo.commands.study.sensitivity import sensitivity
from tolevo.commands.study.statistics import contrasts, cross_mean, runs_of

pytestmark = pytest.mark.long

Array = NDArray[np.float64]
KEYS = ("a", "b", "c", "d")
UNIT = tuple(Factor(key, low=0.0, high=1.0) for key in KEYS)
LISTS = (Factor("a", (1, 2, 3)), Factor("b", (0, 1)), Factor("c", ("x", "y", "z")))
BASE = {"a": 1, "b": 0, "c": "x"}
STUDIES = 60
RARE = 1e-4
"""Chance at which a right interval would fail its test."""


def found(settings: StudySettings, data: StudyData, rng: np.random.Generator) -> Any:
    """Rows of the sensitivities by key and statistic."""
    runs = runs_of(data.table, settings.responses[0], len(data.design))
    some = contrasts(settings.design.kind, data.design, settings.factors, settings.base)
    return sensitivity(runs, data.design, settings, some, rng).set_index(["key", "statistic"])


def ishigami(frame: pd.DataFrame) -> Array:
    x = np.pi * (2 * frame[list(KEYS)].to_numpy() - 1)
    return np.asarray(np.sin(x[:, 0]) * (1 + 0.1 * x[:, 2] ** 4) + 7 * np.sin(x[:, 1]) ** 2)


def ishigami_truth() -> dict[tuple[str, str], float]:
    """Closed form (Ishigami and Homma 1990), a = 7, b = 0.1, and a key that does nothing."""
    first, second = 0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2, 49 / 8
    mixed = 0.1**2 * np.pi**8 * (1 / 18 - 1 / 50)
    total = first + second + mixed
    return {
        ("a", "S1"): first / total, ("b", "S1"): second / total,
        ("c", "S1"): 0.0, ("d", "S1"): 0.0,
        ("a", "ST"): (first + mixed) / total, ("b", "ST"): second / total,
        ("c", "ST"): mixed / total, ("d", "ST"): 0.0,
    }  # fmt: skip


def levels(frame: pd.DataFrame) -> Array:
    """Effects of lists: a (variance 2/3), b (variance 1), a with b (variance 1/6); c nothing."""
    a, b = frame["a"].to_numpy(dtype=float) - 2, 2 * frame["b"].to_numpy(dtype=float) - 1
    return np.asarray(a + b + 0.5 * a * b)


def hits(
    synthetic: Any,
    design: Design,
    factors: tuple[Factor, ...],
    effect: Any,
    truth: dict[tuple[str, str], float],
    noise: float,
    seeds: int,
) -> tuple[pd.Series, pd.Series]:
    """How many of `STUDIES` intervals hold the truth, and how many lie above 0."""
    inside, above = [], []
    settings = synthetic.settings(design, factors, seeds, BASE)
    for study in range(STUDIES):
        rng = np.random.default_rng([study, 7])
        data = synthetic.data(settings, effect, noise, rng, common=2.0)
        rows = found(settings, data, rng).loc[list(truth)]
        true = np.array(list(truth.values()))
        inside.append((rows["low"] <= true + 1e-12) & (true - 1e-12 <= rows["high"]))
        above.append(rows["distinct"])
    return sum(inside[1:], inside[0].astype(int)), sum(above[1:], above[0].astype(int))


def assert_covered(inside: pd.Series, level: float = 0.95) -> None:
    assert inside.min() >= binom.ppf(RARE / len(inside), STUDIES, level), inside


@pytest.mark.parametrize("noise", [3.7])
@pytest.mark.slow
def test_sobol_intervals_cover_the_truth_and_nothing_is_reported_as_nothing(synthetic: Any, noise: float) -> None:
    truth = ishigami_truth()
    inside, above = hits(synthetic, Sobol(samples=64), UNIT, ishigami, truth, noise, seeds=4)
    assert_covered(inside, 0.90)
    for statistic in ("S1", "ST"):
        assert above["d", statistic] <= binom.ppf(1 - RARE, STUDIES, 0.05)
    assert above["b", "ST"] > 0.9 * STUDIES


def test_one_seed_makes_something_of_nothing_where_two_do_not(synthetic: Any) -> None:
    """The trap: noise of the size of the effects, one seed, SALib as it is."""
    settings = synthetic.settings(Sobol(samples=256), UNIT, 6)
    rng = np.random.default_rng(0)
    data = synthetic.data(settings, ishigami, 2.5, rng)
    problem = {"num_vars": 4, "names": list(KEYS), "bounds": [[0.0, 1.0]] * 4}
    one = data.table[data.table["replicate"] == 0]["gap_percent"].to_numpy()
    naive = salib_sobol.analyze(problem, one, calc_second_order=False, seed=1)
    nothing = found(settings, data, rng).loc["d", "ST"]
    assert naive["ST"][3] > 0.25
    assert nothing["low"] < 0.0 < nothing["high"] < 0.1


def test_sobol_without_noise_is_that_of_salib(synthetic: Any) -> None:
    settings = synthetic.settings(Sobol(samples=64), UNIT, 3)
    rng = np.random.default_rng(0)
    data = synthetic.data(settings, ishigami, 0.0, rng)
    rows = found(settings, data, rng)
    problem = {"num_vars": 4, "names": list(KEYS), "bounds": [[0.0, 1.0]] * 4}
    known = salib_sobol.analyze(problem, ishigami(data.design), calc_second_order=False, seed=1)
    blocks = ishigami(data.design).reshape(-1, 6)
    a, b = blocks[:, 0], blocks[:, 5]
    apart = [np.mean((b - one) ** 2) / 2 for one in blocks[:, 1:5].T]
    jansen = 1.0 - np.array(apart) / np.r_[a, b].var()
    s1 = (1.0 - known["ST"]) * known["S1"] + known["ST"] * jansen
    # SALib centres by all runs, here those of A and B do it: sequences of 8 differ by as much
    np.testing.assert_allclose(rows.xs("S1", level=1)["value"], s1, atol=3e-3)
    np.testing.assert_allclose(rows.xs("ST", level=1)["value"], known["ST"], rtol=1e-10)
    assert rows.loc["d", "ST"][["value", "low", "high"]].tolist() == [0.0, 0.0, 0.0]
    assert abs(rows.loc["", "noise_share"]["value"]) < 1e-12


def curved(frame: pd.DataFrame) -> Array:
    x = frame[list(KEYS)].to_numpy()
    return np.asarray(6 * x[:, 0] - 5 * x[:, 1] + 4 * x[:, 2] ** 2)


def test_morris_intervals_cover_the_truth(synthetic: Any) -> None:
    """Of x^2 on the grid 0, 1/3, 2/3, 1 with steps of 2/3 the effects are 2/3 and 4/3, times 4."""
    truth = {
        ("a", "mu_star"): 6.0, ("b", "mu_star"): 5.0, ("c", "mu_star"): 4.0, ("d", "mu_star"): 0.0,
        ("a", "sigma"): 0.0, ("c", "sigma"): 4 / 3, ("d", "sigma"): 0.0,
    }  # fmt: skip
    design = Morris(trajectories=12)
    inside, above = hits(synthetic, design, UNIT, curved, truth, noise=1.0, seeds=5)
    assert_covered(inside)
    assert above["d", "mu_star"] <= binom.ppf(1 - RARE, STUDIES, 0.025)
    assert above["c", "mu_star"] == STUDIES


def test_morris_without_noise_is_that_of_salib(synthetic: Any) -> None:
    settings = synthetic.settings(Morris(trajectories=12), UNIT, 2)
    rng = np.random.default_rng(0)
    data = synthetic.data(settings, curved, 0.0, rng)
    rows = found(settings, data, rng)
    problem = {"num_vars": 4, "names": list(KEYS), "bounds": [[0.0, 1.0]] * 4}
    x = data.design[[f"_share_{key}" for key in KEYS]].to_numpy()
    known = salib_morris.analyze(problem, x, curved(data.design), seed=1)
    mu_star = rows.xs("mu_star", level=1)["value"]
    np.testing.assert_allclose(mu_star, np.asarray(known["mu_star"], dtype=float), atol=1e-12)
    sigma = rows.xs("sigma", level=1)["value"]
    np.testing.assert_allclose(sigma, np.asarray(known["sigma"], dtype=float), atol=1e-6)


def test_shares_of_a_factorial_cover_the_truth(synthetic: Any) -> None:
    noise, common = 1.5, 2.0
    total = 2 / 3 + 1 + 1 / 6 + noise**2 + common**2
    truth = {
        ("a", "anova_share"): 2 / 3 / total, ("b", "anova_share"): 1 / total,
        ("a x b", "anova_share"): 1 / 6 / total, ("c", "anova_share"): 0.0,
        ("b x c", "anova_share"): 0.0, ("", "noise_share"): (noise**2 + common**2) / total,
    }  # fmt: skip
    inside, above = hits(synthetic, Factorial(), LISTS, levels, truth, noise, seeds=8)
    assert_covered(inside)
    assert above["c", "anova_share"] <= binom.ppf(1 - RARE, STUDIES, 0.025)


def test_shares_one_at_a_time_cover_the_truth(synthetic: Any) -> None:
    """At b = -1 the slope of a is 1/2, at a = -1 that of b is 1/2."""
    noise, common = 0.5, 2.0
    rest = noise**2 + common**2
    truth = {
        ("a", "anova_share"): 1 / 6 / (1 / 6 + rest), ("b", "anova_share"): 0.25 / (0.25 + rest),
        ("c", "anova_share"): 0.0,
    }  # fmt: skip
    inside, above = hits(synthetic, OneAtATime(), LISTS, levels, truth, noise, seeds=25)
    assert_covered(inside)
    assert above["b", "anova_share"] > 0.9 * STUDIES


def test_shares_of_a_latin_hypercube_find_a_curve_and_a_list(synthetic: Any) -> None:
    factors = (Factor("a", low=0.0, high=1.0), Factor("b", low=0.0, high=1.0), LISTS[2])

    def effect(frame: pd.DataFrame) -> Array:
        bump = 4 * (frame["a"] - 0.5) ** 2  # variance 4/45
        return (3 * bump + (frame["c"] == "y")).to_numpy(dtype=float)  # 0.8 and 2/9

    settings = synthetic.settings(LatinHypercube(samples=120), factors, 20)
    rng = np.random.default_rng(0)
    data = synthetic.data(settings, effect, 0.5, rng)
    rows = found(settings, data, rng).xs("anova_share", level=1)
    total = 0.8 + 2 / 9 + 0.25
    np.testing.assert_allclose(rows["value"], [0.8 / total, 0, 2 / 9 / total], atol=0.04)
    assert rows["distinct"].tolist() == [True, False, True]


def test_a_failed_run_leaves_out_its_seed_in_its_block_only(synthetic: Any) -> None:
    settings = synthetic.settings(Sobol(samples=64), UNIT, 4)
    rng = np.random.default_rng(0)
    data = synthetic.data(settings, ishigami, 1.0, rng)
    lost = (data.table["point"] == 3) & (data.table["replicate"] == 1)
    data.table.loc[lost, ["status", "gap_percent"]] = ["failed", np.nan]
    other = data.table.copy()
    block = (other["point"] < 6) & (other["replicate"] == 1)
    other.loc[block, ["status", "gap_percent"]] = ["failed", np.nan]
    same = StudyData(other, data.design, data.curves, data.exact)
    rows = [found(settings, one, np.random.default_rng(1)) for one in (data, same)]
    drop = ("", "noise_share")  # it uses all runs of A and B
    pd.testing.assert_frame_equal(rows[0].drop([drop]), rows[1].drop([drop]))
    assert rows[0]["value"].notna().all()


def test_an_infinite_response_has_no_shares(synthetic: Any) -> None:
    settings = synthetic.settings(Factorial(), LISTS, 4, BASE, "evaluations_to_99")
    rng = np.random.default_rng(0)
    data = synthetic.data(settings, levels, 1.0, rng)
    data.table.loc[0, "evaluations_to_99"] = np.nan  # done, but never there
    assert found(settings, data, rng).empty


def test_noise_alone_has_no_square_over_different_seeds() -> None:
    """4,000 settings of 4 seeds: the square of a mean is 1/4, that over different seeds is 0."""
    noise = np.random.default_rng(4).normal(size=(4000, 4))
    found = cross_mean(noise, noise, np.ones(4))
    error = found.std() / np.sqrt(len(found))
    assert abs(found.mean()) < 5 * error < 0.05
    by_hand = [a * b for i, a in enumerate(noise[0]) for j, b in enumerate(noise[0]) if i != j]
    assert found[0] == pytest.approx(np.mean(by_hand))
    without = cross_mean(noise, noise, np.array([1.0, 1.0, 1.0, 0.0]))
    np.testing.assert_allclose(without, cross_mean(noise[:, :3], noise[:, :3], np.ones(3)))
    assert np.isnan(cross_mean(noise, noise, np.array([1.0, 0.0, 0.0, 0.0]))).all()


def product(coefficients: tuple[float, ...]) -> Any:
    """The function of Sobol and Saltelli: prod (|4 x - 2| + a) / (1 + a)."""
    a = np.array(coefficients)
    return lambda x: np.prod((np.abs(4 * x - 2) + a) / (1 + a), axis=1)


def product_truth(coefficients: tuple[float, ...]) -> Array:
    """S1, then ST: V_i = 1 / (3 (1 + a_i)^2), the whole is prod (1 + V_i) - 1."""
    own = 1.0 / (3.0 * (1.0 + np.array(coefficients)) ** 2)
    whole = np.prod(1.0 + own) - 1.0
    return np.asarray(np.r_[own, own * np.prod(1.0 + own) / (1.0 + own)] / whole)


def settings_of_a_search(x: Array) -> Array:
    """A best population, a crossover that saturates, and a mutation that needs the first."""
    return np.asarray(3 * (x[:, 0] - 0.4) ** 2 + np.exp(-4 * x[:, 1]) + 0.5 * x[:, 0] * x[:, 2])


def settings_truth() -> Array:
    """In closed form: with m = x_0 - 1/2 the first is 3 m^2 + 0.6 m, and the product 1/4 (1 + 2 m)
    (1 + 2 n) / 2.
    """
    e4, e8 = np.exp(-4.0), np.exp(-8.0)
    exponential = (1 - e8) / 8 - ((1 - e4) / 4) ** 2
    # x_0 alone: 3 m^2 + (0.6 + 0.25) m; x_2 alone: 0.25 n; both: 0.5 m n
    first = 9 * (1 / 80 - 1 / 144) + 0.85**2 / 12
    third, both = 0.25**2 / 12, 0.25 / 144
    total = first + exponential + third + both
    parts = [first, exponential, third, 0.0, first + both, exponential, third + both, 0.0]
    return np.asarray(np.array(parts) / total)


def ishigami_array(x: Array) -> Array:
    return ishigami(pd.DataFrame(x, columns=list(KEYS)))


FUNCTIONS = {
    "Ishigami": (ishigami_array, np.array(list(ishigami_truth().values()))),
    "product": (product((0.0, 1.0, 4.5, 9.0)), product_truth((0.0, 1.0, 4.5, 9.0))),
    "one of many": (product((99.0, 0.5, 3.0, 0.0)), product_truth((99.0, 0.5, 3.0, 0.0))),
    "settings": (settings_of_a_search, settings_truth()),
}


def intervals(name: str, noise: float, repeats: int) -> tuple[Array, Array]:
    """Coverage of each index, and width of its interval over that of the estimates themselves.

    The noise is a share of the standard deviation that the settings make.
    """
    function, truth = FUNCTIONS[name]
    design, found = Sobol(samples=128), []
    spread = function(np.random.default_rng(0).random((20_000, 4))).std()
    for repeat in range(repeats):
        rng = np.random.default_rng([repeat, 11])
        x = design.points(UNIT, {}, rng)[list(KEYS)].to_numpy()
        runs = function(x)[:, None] + spread * noise * rng.normal(size=(len(x), 4))
        one = sobol.indices(runs + spread * rng.normal(size=4), 4, rng)
        found.append((one.value, one.low, one.high))
    value, low, high = np.swapaxes(np.array(found), 0, 1)
    inside = np.mean((low <= truth + 1e-9) & (truth - 1e-9 <= high), axis=0)
    own = 2 * norm.ppf(0.95) * value.std(axis=0)
    width = np.divide((high - low).mean(axis=0), own, out=np.ones_like(own), where=own > 1e-12)
    return inside, width


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_sobol_intervals_are_calibrated(name: str, noise: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """200 repeats: of all indices together 0.90 +- 0.05; none is off by more than chance."""
    monkeypatch.setattr(resampling, "DRAWS", 60)
    inside, width = intervals(name, noise, 200)
    some = FUNCTIONS[name][1] > 0.0
    print(name, noise, inside.round(3), width.round(2))
    assert 0.85 <= inside[some].mean() <= 0.95
    assert inside[some].min() >= binom.ppf(RARE / 96, 200, 0.88) / 200
    assert width.max() <= 1.5


def test_sobol_intervals_are_as_wide_as_the_estimates_spread(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sample of the test above."""
    monkeypatch.setattr(resampling, "DRAWS", 30)
    inside, width = intervals("settings", 0.5, 40)
    assert inside.mean() >= binom.ppf(RARE, 40, 0.90) / 40
    assert 0.6 < width.mean() < 1.6


def test_truths_of_the_functions_by_brute_force() -> None:
    """Against the plain estimator on 2^15 blocks without noise."""
    x = Sobol(samples=1 << 15).points(UNIT, {}, np.random.default_rng(1))[list(KEYS)].to_numpy()
    for function, truth in FUNCTIONS.values():
        y = function(x).reshape(-1, 6)
        variance = np.r_[y[:, 0], y[:, 5]].var()
        total = np.mean((y[:, 1:5] - y[:, :1]) ** 2, axis=0) / 2 / variance
        first = 1 - np.mean((y[:, 1:5] - y[:, 5:]) ** 2, axis=0) / 2 / variance
        np.testing.assert_allclose(np.r_[first, total], truth, atol=0.01)
