"""Statistics of a study on given values, for which closed forms say what must come out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from scipy.stats import t

from tolevo.commands.study import sensitivity as morris
from tolevo.commands.study import statistics as resampling
from tolevo.commands.study.analysis import COLUMNS, analyse, courses, verdicts
from tolevo.commands.study.designs import Factorial
from tolevo.commands.study.plan import Factor, Hypothesis
from tolevo.commands.study.sensitivity import sensitivity
from tolevo.commands.study.statistics import (
    DRAWS,
    Contrast,
    Runs,
    _spread,
    friedman_tests,
    level_test,
    mean_over_settings,
    model,
    random_settings,
    runs_of,
    wilcoxon_tests,
)

Array = NDArray[np.float64]


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def sides(count: int) -> list[Contrast]:
    """One key whose levels are the settings 0, 1, ..."""
    return [Contrast("key", tuple(range(count)), tuple(np.array([at]) for at in range(count)))]


# ------------------------------------------------------------- resampling


def test_a_weighted_mean_over_settings_is_that_of_numpy_whatever_its_weights_add_up_to() -> None:
    values, weights = np.array([1.0, 4.0, np.nan, 9.0]), np.array([0.1, 0.2, 5.0, 0.05])
    known = np.array([True, True, False, True])
    expected = np.average(values[known], weights=weights[known])
    assert mean_over_settings(values, weights) == pytest.approx(expected)
    assert np.isnan(mean_over_settings(values, np.array([0.0, 0.0, 1.0, 0.0])))


def mean_of(values: Array) -> Any:
    """A statistic of the settings alone: what the runs do is nothing."""
    return lambda rows, runs: (rows @ values / rows.sum(-1))[:, None] + np.zeros((max(len(rows), len(runs)), 1))


def test_interval_of_a_mean_over_parts_is_that_of_student() -> None:
    """The jackknife of a mean of parts is s^2 / parts, with parts - 1 degrees of freedom."""
    values = rng().normal(size=24)
    found = random_settings(mean_of(values), 24, 3, rng(), parts=4, level=0.9)
    parts = values.reshape(4, 6).mean(axis=1)
    half = t.ppf(0.95, 3) * parts.std(ddof=1) / np.sqrt(4)
    np.testing.assert_allclose(found.value, values.mean())
    np.testing.assert_allclose([found.low, found.high], values.mean() + half * np.array([[-1], [1]]))


def test_interval_of_a_mean_over_three_settings_is_that_of_student() -> None:
    """Within the scatter of 400 draws; with a degree of freedom more it would be 26 % narrower."""
    values = np.array([1.0, 4.0, 2.0])
    found = random_settings(mean_of(values), 3, 2, rng())
    half = t.ppf(0.975, 2) * values.std(ddof=1) / np.sqrt(3)
    np.testing.assert_allclose(found.high - found.value, half, rtol=0.15)
    np.testing.assert_allclose(found.value - found.low, half, rtol=0.15)


def test_draws_are_made_a_block_at_a_time() -> None:
    """And nothing is lost: the variance is over all of them."""
    made, source = [], np.random.default_rng(1)

    def draw(count: int) -> Array:
        made.append(source.normal(size=(count, 1)))
        return made[-1]

    found = _spread(draw, 9, 70)
    assert max(map(len, made)) == 70 and sum(map(len, made)) == DRAWS
    np.testing.assert_allclose(found, np.concatenate(made).var(axis=0) * 10 / 8)
    assert np.isnan(_spread(draw, 1)).all()


# ------------------------------------------------------------- morris, shares of the noise


def test_a_step_of_which_one_seed_is_left_is_left_out() -> None:
    """Effects 2, 4 and 9 without noise: the mean is over the trajectories with two seeds."""
    shares = np.tile([[0.0], [1.0]], (3, 1))
    values = np.repeat(np.array([[0.0], [2.0], [1.0], [5.0], [0.0], [9.0]]), 3, axis=1)
    values[0, 1:] = np.nan
    found = morris.effects(values, shares, rng())
    assert found.value[0] == pytest.approx((4.0 + 9.0) / 2)
    whole = morris.effects(np.nan_to_num(values), shares, rng())
    assert whole.value[0] == pytest.approx((2.0 + 4.0 + 9.0) / 3)


def test_settings_that_are_no_sample_do_not_widen_the_share_of_the_noise(synthetic: Any) -> None:
    """One of 100 settings is far off. Of 30 seeds the variance of a run is known within about
    sqrt(2 / (100 * 29)) = 3 %; a sample of settings with or without that one would be off by 100 %.
    """
    factors = (Factor("a", tuple(range(100))),)
    settings = synthetic.settings(Factorial(), factors, 30, {"a": 0})
    design = pd.DataFrame({"a": range(100)})
    values = 0.1 * rng().normal(size=(100, 30))
    values[7] += 10.0
    runs = Runs("gap_percent", values, False)
    contrast = [Contrast("a", tuple(range(100)), tuple(np.array([k]) for k in range(100)))]
    found = sensitivity(runs, design, settings, contrast, rng()).set_index("statistic")
    row = found.loc["noise_share"]
    within = values.var(axis=1, ddof=1).mean()
    between = values.mean(axis=1).var() - within / 30
    assert row["value"] == pytest.approx(within / (within + between), rel=0.01)
    assert 0.02 < (row["high"] - row["low"]) / row["value"] < 0.3


@pytest.mark.parametrize("seeds", [1, 2])
def test_one_seed_has_no_sensitivities_and_the_study_says_so(synthetic: Any, seeds: int) -> None:
    settings = synthetic.settings(Factorial(), (Factor("a", (1, 2)),), seeds, {"a": 1})
    data = synthetic.data(settings, lambda frame: frame["a"].to_numpy(float), 0.1, rng())
    result = analyse(settings, data, rng())
    assert result.sensitivity.empty == (seeds == 1)
    told = any(one.startswith("one seed per setting") for one in result.notes)
    assert told == (seeds == 1)


# ------------------------------------------------------------- tests and what is said of them


def test_one_seed_is_no_test_of_friedman_and_is_not_said_to_be_the_same_everywhere() -> None:
    found = friedman_tests(Runs("gap_percent", np.array([[1.0], [2.0], [3.0]]), False), sides(3))
    row = found.iloc[0]
    assert (row["n"], row["p"], row["effect"]) == (1, 1.0, 0.0) and np.isnan(row["statistic"])
    assert row["reason"] == "1 seeds that differ never fall below p = 1; more seeds are needed"
    same = friedman_tests(Runs("gap_percent", np.ones((3, 4)), False), sides(3)).iloc[0]
    assert same["reason"] == "all 4 seeds give the same on both sides"


def test_one_pair_is_one_pair() -> None:
    """Of one pair no p is below 1; six are needed for 2^(1 - n) to be below 0.05."""
    found = wilcoxon_tests(Runs("gap_percent", np.array([[1.0], [2.0]]), False), sides(2), rng())
    reason = found["reason"].iloc[0]
    assert reason == "1 seeds that differ never fall below p = 1; 6 are needed"
    lost = Runs("gap_percent", np.array([[np.nan], [2.0]]), False)
    reason = wilcoxon_tests(lost, sides(2), rng())["reason"].iloc[0]
    assert reason == "no seed has a run on both sides that did not fail"


@pytest.mark.parametrize(("low", "high", "told"), [
    (1.0, 2.5, "is 2 [1, 2.5] in the median"), (1.0, np.nan, "is 2 in the median"),
    (np.nan, 2.5, "is 2 in the median"),
])  # fmt: skip
def test_an_interval_without_an_end_is_not_told(low: float, high: float, told: str) -> None:
    tests = pd.DataFrame([{
        "response": "gap_percent", "key": "k", "kind": "wilcoxon", "a": 1, "b": 2, "n": 12,
        "p_holm": 0.01, "effect": 0.9, "difference": 2.0, "low": low, "high": high,
        "significant": True, "reason": "",
    }])  # fmt: skip
    reading = Hypothesis("Figure 1", "k helps", "k", 1, 2, "gap_percent", better=False)
    found = verdicts((reading,), tests)[0]
    assert found.verdict == "holds" and told in found.sentence and "nan" not in found.sentence


def test_a_run_that_never_got_there_is_the_worst_of_either_kind() -> None:
    for response, worst in (("hypervolume_ratio", -np.inf), ("gap_percent", np.inf)):
        table = pd.DataFrame({
            "point": [0, 0, 0], "replicate": [0, 1, 2], "status": ["done", "done", "failed"],
            response: [0.4, np.nan, np.nan],
        })  # fmt: skip
        runs = runs_of(table, response, 1)
        np.testing.assert_array_equal(runs.array, [[0.4, worst, np.nan]])
        np.testing.assert_array_equal(runs.costs()[0, 1:], [np.inf, np.inf])
        assert not runs.reached


# ------------------------------------------------------------- analysis of variance


def test_columns_of_the_model_are_lines_and_curves_in_the_units_of_the_factor() -> None:
    """A logarithmic range is a line and a curve of the logarithm, a list its levels."""
    factors = (Factor("x", low=1.0, high=9.0), Factor("y", low=1e-3, high=10.0, log=True),
               Factor("z", ("p", "q", "r")))  # fmt: skip
    source = rng()
    design = pd.DataFrame({
        "x": source.uniform(1.0, 9.0, 40), "y": 10.0 ** source.uniform(-3.0, 1.0, 40),
        "z": source.choice(["p", "q", "r"], 40),
    })  # fmt: skip
    columns = model(design, factors)
    assert columns.shape == (40, 1 + 2 + 2 + 2)

    def left(values: Any) -> float:
        return float(np.abs(values - columns @ np.linalg.lstsq(columns, values)[0]).max())

    x, y = design["x"].to_numpy(), np.log(design["y"].to_numpy())
    for inside in (x, x**2, y, y**2, (design["z"] == "q").to_numpy(float), np.ones(40)):
        assert left(inside) < 1e-10 * np.abs(inside).max()
    for outside in (np.log(x), design["y"].to_numpy(), x * y):
        assert left(outside) > 1e-2 * np.abs(outside).max()


def test_a_key_of_one_level_has_no_test() -> None:
    found = level_test(rng().normal(size=(1, 8)), sides(1)[0])
    assert np.isnan(found["statistic"]) and np.isnan(found["p"]) and found["n"] == 8


# ------------------------------------------------------------- courses


def test_courses_are_medians_of_the_runs_over_the_generations_that_all_have() -> None:
    values = {0: rng().normal(size=(5, 4)), 1: rng().normal(size=(5, 3))}

    def of(point: int) -> pd.DataFrame:
        own = values[point]
        frame = pd.DataFrame([
            {"replicate": r, "generation": g, "value": own[r, g]}
            for r in range(own.shape[0]) for g in range(own.shape[1])
        ])  # fmt: skip
        return frame[~((frame["replicate"] == 4) & (frame["generation"] == 3))]  # one ended early

    exact = pd.DataFrame({"point": [1], "value": [0.25]})
    data: Any = SimpleNamespace(curves=SimpleNamespace(of=of), exact=exact)
    found = courses(data, [Contrast("key", (7, 9), (np.array([0]), np.array([1])))], rng())
    assert list(found.columns) == list(COLUMNS) and list(found.index) == list(range(6))
    assert found["level"].tolist() == [7] * 3 + [9] * 3
    assert found["generation"].tolist() == [0, 1, 2] * 2
    expected = np.concatenate([np.median(one[:, :3], axis=0) for one in values.values()])
    np.testing.assert_allclose(found["median"], expected)
    assert (found["low"] <= found["median"]).all() and (found["median"] <= found["high"]).all()
    np.testing.assert_array_equal(found["optimum"], [np.nan] * 3 + [0.25] * 3)
    assert (found["n"] == 5).all() and (found["level_of_interval"] == resampling.LEVEL).all()
    none = courses(data, [], rng())
    assert none.empty and list(none.columns) == list(COLUMNS)
