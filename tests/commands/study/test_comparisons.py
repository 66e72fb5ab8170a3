from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from scipy.stats import binom, f, friedmanchisquare, ttest_rel, wilcoxon
from statsmodels.stats.anova import AnovaRM

from tolevo.commands.study.analysis import analyse, recommendation, verdicts
from tolevo.commands.study.designs import Factorial, LatinHypercube, OneAtATime
from tolevo.commands.study.plan import Factor, Hypothesis, StudyData, StudySettings
from tolevo.commands.study.statistics import (
    Contrast,
    Runs,
    contrasts,
    friedman_tests,
    interval_of_median,
    least_p,
    level_test,
    medians,
    pairs_needed,
    runs_of,
    surface_tests,
    wilcoxon_tests,
)
from tolevo.records import Response

pytestmark = pytest.mark.usefixtures("unrendered")

Array = NDArray[np.float64]
SIZE = Factor("population", (20, 40, 80))
RATE = Factor("mutation", (0.001, 0.08))
BASE = {"population": 80, "mutation": 0.08}
GAP = Response("gap_percent", False, 0.0)


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def sides(*columns: Array) -> list[Contrast]:
    """One key whose levels are the settings 0, 1, ..."""
    rows = tuple(np.array([at]) for at in range(len(columns)))
    return [Contrast("key", tuple(range(len(columns))), rows)]


def compared(*columns: Any) -> pd.DataFrame:
    values = np.array(columns, dtype=float)
    return wilcoxon_tests(Runs("gap_percent", values, False), sides(*values), rng())


def test_pairs_are_those_of_scipy_corrected_by_hand() -> None:
    values = rng().normal(size=(3, 12)) + np.array([[0.0], [0.6], [1.5]])
    found = compared(*values)
    assert found[["a", "b"]].to_numpy().tolist() == [[0, 1], [0, 2], [1, 2]]
    p = np.array([wilcoxon(values[a] - values[b]).pvalue for a, b in ((0, 1), (0, 2), (1, 2))])
    np.testing.assert_allclose(found["p"], p, rtol=1e-12)
    by_hand = np.empty(3)
    for place, at in enumerate(np.argsort(p)):
        by_hand[at] = p[at] * (3 - place)
    monotone = [min(by_hand[p <= one].max(), 1.0) for one in p]
    np.testing.assert_allclose(found["p_holm"], monotone, rtol=1e-12)
    np.testing.assert_array_equal(found["significant"], found["p_holm"] <= 0.05)


def test_effect_is_the_share_of_ranks_that_speak_for_the_first_less_the_others() -> None:
    found = compared([1, 2, 3, 4, 5, 6], [0, 0, 0, 0, 0, 12])  # differences 1 2 3 4 5 and -6
    assert found["effect"].iloc[0] == pytest.approx((15 - 6) / 21)
    assert found["difference"].iloc[0] == 2.5
    assert compared([5.0] * 7, [1, 2, 3, 1, 2, 3, 4])["effect"].iloc[0] == 1.0


def test_five_pairs_cannot_be_significant_and_six_can() -> None:
    five, six = compared(np.arange(5), np.arange(5) + 9.0), compared(np.arange(6), np.arange(6) + 9)
    assert five["p"].iloc[0] == 0.0625
    assert not five["significant"].iloc[0]
    assert "5 seeds that differ never fall below p = 0.0625; 6 are needed" in five["reason"].iloc[0]
    assert six["significant"].iloc[0] and six["reason"].iloc[0] == ""


def test_holm_counts_in_what_can_be_significant() -> None:
    """Three tests of six pairs: 0.03125 * 3 is above 0.05; 7 pairs reach 0.015625 * 3."""
    six = compared(*(np.arange(6.0) + 100 * at for at in range(3)))
    assert not six["significant"].any()
    assert six["reason"].str.contains("7 are needed").all()
    seven = compared(*(np.arange(7.0) + 100 * at for at in range(3)))
    assert seven["significant"].all()
    assert [pairs_needed(count) for count in (1, 3, 26)] == [6, 7, 11]
    assert least_p(11) * 26 <= 0.05 < least_p(10) * 26


def test_equal_levels_are_said_to_be_equal() -> None:
    same = compared(np.arange(20.0), np.arange(20.0))
    assert same["p"].iloc[0] == 1.0
    assert "all 20 seeds give the same" in same["reason"].iloc[0]


def test_a_failed_run_takes_its_pair_along_and_one_that_never_got_there_is_worst() -> None:
    a = np.array([1, 2, 3, np.nan, 5, 6, 7, 8.0])
    b = np.array([2, 4, 6, 8, np.inf, np.inf, np.inf, np.inf])
    found = compared(a, b).iloc[0]
    assert found["n"] == 7
    assert found["effect"] == -1.0 and found["p"] == 2.0**-6
    both = compared([np.inf] * 8, [np.inf] * 8).iloc[0]
    assert both["p"] == 1.0 and "give the same" in both["reason"]


@pytest.mark.slow
def test_no_difference_is_found_more_often_than_stated() -> None:
    """Four equal levels, six pairs each time: a false finding in one of 20 studies at most."""
    source, studies = np.random.default_rng(11), 40
    found = [compared(*source.normal(size=(4, 12)))["significant"].any() for _ in range(studies)]
    assert sum(found) <= binom.ppf(1 - 1e-4, studies, 0.05)


def test_friedman_is_that_of_scipy_with_kendalls_w() -> None:
    values = rng().normal(size=(4, 10)) + np.arange(4)[:, None]
    found = friedman_tests(Runs("gap_percent", values, False), sides(*values)).iloc[0]
    known = friedmanchisquare(*values)
    assert found["statistic"] == pytest.approx(known.statistic)
    assert found["p"] == pytest.approx(known.pvalue)
    assert found["effect"] == pytest.approx(known.statistic / (10 * 3))
    ordered = np.arange(10.0) + 100 * np.arange(4)[:, None]
    row = friedman_tests(Runs("gap_percent", ordered, False), sides(*ordered)).iloc[0]
    assert row["effect"] == pytest.approx(1.0) and row["significant"]
    two = friedman_tests(Runs("gap_percent", ordered[:3, :2], False), sides(*ordered[:3])).iloc[0]
    assert not two["significant"] and "never fall below p = 0.1667" in two["reason"]


def test_anova_of_two_levels_is_a_paired_t_test() -> None:
    values = rng().normal(size=(2, 9)) + np.array([[0.0], [1.0]])
    found = level_test(values, sides(*values)[0])
    known = ttest_rel(*values)
    assert found["statistic"] == pytest.approx(known.statistic**2)
    assert found["p"] == pytest.approx(known.pvalue)
    assert found["n"] == 9
    flat = level_test(np.ones((2, 5)), sides(*np.ones((2, 5)))[0])
    assert np.isnan(flat["p"])


def test_anova_of_a_latin_hypercube_is_the_f_of_nested_least_squares() -> None:
    factors = (Factor("x", low=0.0, high=2.0), Factor("z", ("p", "q")))
    design = LatinHypercube(samples=30).points(factors, {}, rng())
    x, q = design["x"].to_numpy(), (design["z"] == "q").to_numpy(dtype=float)
    values = (x**2)[:, None] + rng().normal(size=(30, 4))
    full: Any = np.column_stack([np.ones(30), x, x**2, q])
    mean = values.mean(axis=1)

    def rest(columns: Array) -> float:
        return float(((mean - columns @ np.linalg.lstsq(columns, mean)[0]) ** 2).sum())

    for row, kept, freedom in zip(surface_tests(values, design, factors),
                                  ([0, 3], [0, 1, 2]), (2, 1), strict=True):  # fmt: skip
        gain = (rest(full[:, kept]) - rest(full)) / freedom
        ratio = gain / (rest(full) / 26)
        assert row["statistic"] == pytest.approx(ratio)
        assert row["p"] == pytest.approx(f.sf(ratio, freedom, 26))


def test_medians_and_their_intervals() -> None:
    values = rng().normal(size=(200, 30))
    table: Any = medians(Runs("gap_percent", values, False), rng())
    np.testing.assert_allclose(table["median"], np.median(values, axis=1))
    inside = ((table["low"] <= 0.0) & (table["high"] >= 0.0)).sum()
    assert binom.ppf(1e-4, 200, 0.93) <= inside <= 199  # that of a median is a little narrow
    values[0, :4], values[1, :16], values[2, :14] = np.nan, np.inf, np.inf
    table = medians(Runs("gap_percent", values, False), rng())
    assert table.loc[0, ["n", "failed"]].tolist() == [26, 4]
    assert table.loc[0, "median"] == pytest.approx(np.nanmedian(values[0]))
    assert np.isnan(table.loc[1, "median"]) and np.isnan(table.loc[2, "high"])
    assert np.isfinite(table.loc[2, "low"])
    assert np.isnan(interval_of_median(np.ones((1, 1)), rng())[0, 1])


def test_levels_are_compared_with_the_others_as_in_the_run_or_over_all() -> None:
    factors = (SIZE, RATE)
    design = OneAtATime().points(factors, BASE, rng())
    size, rate = contrasts("one_at_a_time", design, factors, BASE)
    assert size.levels == (20, 40, 80) and rate.levels == (0.001, 0.08)
    assert [rows.tolist() for rows in size.members] == [[1], [2], [0]]
    assert [rows.tolist() for rows in rate.members] == [[3], [0]]
    design = Factorial().points(factors, BASE, rng())
    size, rate = contrasts("factorial", design, factors, BASE)
    assert [len(rows) for rows in rate.members] == [3, 3]
    values = np.arange(12.0).reshape(6, 2)
    np.testing.assert_allclose(size.table(values)[0], [1.0, 5.0, 9.0])
    assert contrasts("sobol", design, factors, BASE) == []


def settings_and_data(synthetic: Any, seeds: int, noise: float, shift: float) -> tuple[StudySettings, StudyData]:
    """Population 20 and 40 are worse by `shift` and half of it; mutation does nothing."""
    settings = synthetic.settings(OneAtATime(), (SIZE, RATE), seeds, BASE)

    def effect(frame: pd.DataFrame) -> Array:
        size = frame["population"].to_numpy()
        return 5.0 + shift * np.select([size == 20, size == 40], [1.0, 0.5], 0.0)

    return settings, synthetic.data(settings, effect, noise, rng(), common=1.0)


def readings() -> tuple[Hypothesis, ...]:
    return (
        Hypothesis("Figure 9", "large is good", "population", 80, 20, "gap_percent"),
        Hypothesis("Figure 9", "small is good", "population", 20, 80, "gap_percent"),
        Hypothesis("Figure 9", "small is bad", "population", 20, 80, "gap_percent", better=False),
        Hypothesis("Figure 11", "rate matters", "mutation", 0.001, 0.08, "gap_percent"),
        Hypothesis("Figure 12", "none", "mutation", 0.5, 0.08, "gap_percent"),
    )


def test_readings_are_judged_by_the_tests(synthetic: Any) -> None:
    settings, data = settings_and_data(synthetic, 30, 0.5, 2.0)
    tests = analyse(settings, data, rng()).tests
    found = verdicts(readings(), tests)
    kinds = [one.verdict.split(":")[0] for one in found]
    assert kinds == ["holds", "does not hold", "holds", "not shown", "undecided"]
    assert "“large is good”: holds. gap_percent at 80 less that at 20 is -" in found[0].sentence
    assert "30 seeds" in found[0].sentence
    settings, data = settings_and_data(synthetic, 5, 0.1, 9.0)
    few = verdicts(readings()[:1], analyse(settings, data, rng()).tests)[0]
    assert few.verdict == "undecided" and "never fall below p = 0.0625" in few.sentence


def test_a_run_that_did_not_get_there_is_not_said_to_be_slow(synthetic: Any) -> None:
    settings, data = settings_and_data(synthetic, 30, 0.5, 2.0)
    small = (data.table["population"] == 20) & (data.table["replicate"] < 20)
    data.table.loc[small, "gap_percent"] = np.nan  # done, but out of budget
    tests = analyse(settings, data, rng()).tests
    found = verdicts(readings()[:2], tests)
    assert [one.verdict for one in found] == ["undecided"] * 2
    assert "within the budget of their setting" in found[0].sentence


def study_runs(values: Array, larger: bool = False) -> tuple[Runs, pd.DataFrame]:
    return Runs("gap_percent", values, larger), pd.DataFrame({"k": np.arange(len(values))})


def test_recommendation_is_judged_on_seeds_that_did_not_choose_it() -> None:
    values = 8.0 + 0.1 * rng().normal(size=(3, 24))
    values[2] -= 6.0
    runs, design = study_runs(values)
    found = recommendation(runs, design, {"k": 0}, GAP, rng())
    assert found.point == 2 and found.shown
    judged = values[:, 1::2]
    share = 1 - judged[2].sum() / judged[0].sum()
    assert found.recovered[0] == pytest.approx(share)
    assert found.recovered[1] < share < found.recovered[2] < share + 0.05
    assert "use k = 2: it beats the run's own setting (k = 0) on 12 seeds" in found.sentence
    assert "recovers 75 %" in found.sentence
    changed = values.copy()
    changed[2, 1::2] += 6.0  # good only on the seeds that choose
    assert not recommendation(study_runs(changed)[0], design, {"k": 0}, GAP, rng()).shown


def test_best_of_many_equal_settings_is_not_recommended() -> None:
    source, shown = np.random.default_rng(2), 0
    for _ in range(100):
        runs, design = study_runs(8.0 + source.normal(size=(20, 20)))
        shown += recommendation(runs, design, {"k": 0}, GAP, source).shown
    assert shown <= binom.ppf(1 - 1e-4, 100, 0.025)


def test_few_seeds_or_the_runs_own_setting_recommend_nothing() -> None:
    values = 8.0 + np.zeros((3, 10)) + np.array([[0.0], [1.0], [-5.0]])
    runs, design = study_runs(values + 0.01 * rng().normal(size=values.shape))
    few = recommendation(runs, design, {"k": 0}, GAP, rng())
    assert not few.shown and "at least 12 seeds are needed" in few.sentence
    assert few.sentence.startswith("gap_percent: use k = 0, the run's own setting: k = 2 is the best observed, but ")
    middle = recommendation(runs, design, {}, GAP, rng())
    assert not middle.shown
    assert middle.sentence.startswith("gap_percent: use k = 2, the best observed, or any other: the 5 seeds that did ")
    assert "the setting in the middle (k = 0; p = " in middle.sentence
    own = recommendation(runs, design, {"k": 2}, GAP, rng())
    assert not own.shown and "nothing is to be changed" in own.sentence


def test_a_failed_run_counts_as_the_worst_in_a_recommendation() -> None:
    values = np.tile([[5.0], [4.0], [1.0]], 24) + 0.01 * rng().normal(size=(3, 24))
    values[2, ::3] = np.nan
    values[2, ::2] = np.nan  # all that choose
    assert recommendation(*study_runs(values), {"k": 0}, GAP, rng()).point == 1


def test_a_study_says_what_failed_and_what_it_cannot_tell(synthetic: Any) -> None:
    settings, data = settings_and_data(synthetic, 5, 0.5, 2.0)
    for column, value in (("status", "failed"), ("reason", "time limit"), ("gap_percent", np.nan)):
        data.table.loc[3, column] = value
    data.table.loc[9, "gap_percent"] = np.nan
    result = analyse(settings, data, rng())
    notes = "\n".join(result.notes)
    assert "1 of 20 runs failed" in notes
    assert "gap_percent: 1 of 20 runs did not reach it within the budget" in notes
    assert "5 seeds cannot show a difference" in notes and "8 can" in notes
    assert result.sensitivity.empty
    pairs = result.tests[result.tests["kind"] == "wilcoxon"]
    assert len(pairs) == 4 and not pairs["significant"].any() and (pairs["reason"] != "").all()
    runs = runs_of(data.table, "gap_percent", 4)
    assert np.isnan(runs.array[0, 3]) and runs.array[1, 4] == np.inf


def test_the_same_generator_gives_the_same_statistics(synthetic: Any) -> None:
    settings, data = settings_and_data(synthetic, 8, 0.5, 2.0)
    first, second = analyse(settings, data, rng()), analyse(settings, data, rng())
    for name in ("medians", "sensitivity", "tests"):
        pd.testing.assert_frame_equal(getattr(first, name), getattr(second, name))
    assert first.recommendations[0].sentence == second.recommendations[0].sentence


def test_anova_is_that_of_another_implementation() -> None:
    """Of 12 seeds at 4 levels, by statsmodels' repeated measures."""
    rng = np.random.default_rng(5)
    table = rng.normal(0.0, 1.0, (12, 1)) + rng.normal(0.0, 0.5, (12, 4)) + [0.0, 0.1, 0.4, 0.2]
    long = pd.DataFrame({"seed": np.repeat(np.arange(12), 4), "level": np.tile(np.arange(4), 12),
                         "value": table.ravel()})  # fmt: skip
    other = AnovaRM(long, "value", "seed", within=["level"]).fit().anova_table.iloc[0]
    own = level_test(table.T, sides(*table.T)[0])
    assert own["statistic"] == pytest.approx(other["F Value"], rel=1e-12)
    assert own["p"] == pytest.approx(other["Pr > F"], rel=1e-10)
