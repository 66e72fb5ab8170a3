"""The namers that must fail: what each computes, and which gates it fails beyond all doubt."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from itertools import count, islice

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from benchmarks.gap.generator.records import Record, Truth, record
from benchmarks.gap.generator.tables import Points
from benchmarks.gap.namers.baselines import BASELINES
from benchmarks.gap.namers.best_correlation import best_correlation
from benchmarks.gap.namers.plain_bic import plain_bic
from benchmarks.gap.namers.seen import dictionary, seen
from benchmarks.gap.namers.thresholded_least_squares import RIDGE, THRESHOLD, ridge, thresholded
from benchmarks.gap.scoring.held_out import held_out
from benchmarks.gap.scoring.scorer import Figure, Scored, figures, verdict
from benchmarks.gap.scoring.told import told

CLEAN, GOOD = "clean given a name, upper bound", "single named rightly, good design"
POOR, INSIDE = "single named rightly, poor design", "truth inside the reported set"
SIZE, BOTH = "size of the reported set", "two effects, both named"
SPURIOUS, OUTSIDE = "spurious names per record of two", "outside the library, not `unnamed`"
CHANGED = "noise that changes or delay, physics named"
FAILED: Mapping[str, set[str]] = {
    "always compliance": {CLEAN, GOOD, POOR, INSIDE, BOTH, SPURIOUS, OUTSIDE, CHANGED},
    "best correlation": {CLEAN, GOOD, INSIDE, BOTH, OUTSIDE, CHANGED},
    "plain BIC": {CLEAN, GOOD, INSIDE, OUTSIDE, CHANGED},
    "LassoCV": {CLEAN, GOOD, POOR, SIZE, SPURIOUS, OUTSIDE, CHANGED},
    "thresholded least squares": {CLEAN, GOOD, POOR, SIZE, SPURIOUS, OUTSIDE, CHANGED},
}
"""Gates that fail beyond doubt on few records; more fail on more."""
COUNTS = {"clean": 40, "good": 14, "poor": 14, "pair": 6, "outside": 10, "size": 8, "delay": 6}
ROWS = {"outside": 500, "pair": 600}
"""The longest record that is taken, where it is not FEW."""
FEW = 250


def short(group: str) -> Iterator[tuple[Record, Truth]]:
    """Short records of a group, from its first on, for the time that they take."""
    found = (record(group, k) for k in count())
    return (one for one in found if len(one[0].table) <= ROWS.get(group, FEW))


@pytest.fixture(scope="module")
def shown() -> list[tuple[Record, Scored]]:
    """Records with what can be told of each; nothing said yet."""
    found = [one for group, size in COUNTS.items() for one in islice(short(group), size)]
    empty = verdict({"verdict": "no_gap", "effects": [], "alternatives": []})
    return [(one, Scored(truth, tuple(told(truth, each) for each in truth.hidden), empty)) for one, truth in found]


def of(name: str, shown: list[tuple[Record, Scored]]) -> Mapping[str, Figure]:
    found = [Scored(blank.truth, blank.told, verdict(BASELINES[name](one))) for one, blank in shown]
    return {one.name: one for one in figures(found)}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name in ("LassoCV", "plain BIC") else name for name in BASELINES],
)
def test_gates_that_each_fails(name: str, shown: list[tuple[Record, Scored]]) -> None:
    """Clean records are given names, causes outside the library are never left `unnamed`."""
    found = of(name, shown)
    assert {one for one, figure in found.items() if figure.refuted} >= FAILED[name]
    assert found[OUTSIDE].value == 1.0


@pytest.mark.parametrize("kind", ["rotating", "lost_motion"])
def test_points_are_read_from_the_table(kind: str) -> None:
    found, truth = next(one for one in short("good") if one[1].kind == kind)
    read = seen(found).points
    for one in fields(Points):
        true = getattr(truth.points, one.name)
        np.testing.assert_allclose(getattr(read, one.name), true, atol=1e-12)


def test_a_table_without_its_prediction_is_refused() -> None:
    found, _ = record("good", 0)
    (name,) = [one for one in map(str, found.table) if one.endswith("_predicted")]
    short = Record(found.name, found.configuration, found.table.drop(columns=name))
    with pytest.raises(ValueError, match="_predicted"):
        seen(short)


def test_threshold_on_orthogonal_columns_is_that_of_each_by_itself() -> None:
    """X'X = n I: c = X'y / (n + ridge), kept where it reaches the threshold."""
    n = 400
    columns = np.linalg.qr(np.random.default_rng(0).normal(size=(n, 4)))[0] * np.sqrt(n)
    just = THRESHOLD * (n + RIDGE) / n
    what = columns @ np.array([1.0, 1.001 * just, 0.999 * just, 0.0])
    np.testing.assert_allclose(ridge(columns, what)[0], n / (n + RIDGE), rtol=1e-12)
    assert thresholded(columns, what).tolist() == [True, True, False, False]


def test_threshold_is_applied_again_after_each_fit() -> None:
    """Two nearly equal columns share a coefficient of 0.15: both fall, or one has it all."""
    rng = np.random.default_rng(1)
    one = rng.normal(size=5000)
    columns = np.column_stack([one, rng.normal(size=5000)])
    what = 0.15 * one + 0.02 * columns[:, 1]
    assert thresholded(columns, what).tolist() == [True, False]


def test_best_correlation_is_judged_as_if_it_were_alone() -> None:
    """By `scipy.stats.pearsonr` column by column."""
    for number in range(6):
        found, _ = record("clean", number)
        given = seen(found)
        of_all = dictionary(given)
        tried = [stats.pearsonr(column, given.left) for column in of_all.columns.T]
        best = max(range(len(tried)), key=lambda k: abs(tried[k].statistic))
        names = [one["name"] for one in best_correlation(found)["effects"]]
        assert names == ([of_all.names[best]] if tried[best].pvalue < 0.05 else [])


def test_held_out_error_of_a_constant_is_that_by_hand() -> None:
    """Five stretches, each against the mean of the other four."""
    found = next(one for one, truth in short("clean") if truth.noise == "white")
    given = seen(found)
    parts = np.array_split(given.left, 5)
    errors = [parts[k] - np.concatenate(parts[:k] + parts[k + 1 :]).mean() for k in range(len(parts))]
    by_hand = np.sqrt(np.mean(np.concatenate(errors) ** 2))
    assert held_out(lambda rows: given.free, given.left) == pytest.approx(by_hand, rel=1e-12)


def test_bic_finds_what_is_plain() -> None:
    """A straight twist of ten times the noise, and nothing beside it."""
    found, truth = next(one for one in short("clean") if one[1].kind == "rotating")
    rng = np.random.default_rng(3)
    share = truth.points.torque / truth.points.largest_torque
    table = pd.DataFrame(found.table)
    table["te_arcsec"] = table["te_arcsec_predicted"] + 10.0 * share + rng.normal(size=len(table))
    said = plain_bic(Record(found.name, found.configuration, table))
    assert said["effects"][0] == {"name": "torsional_compliance"}
    assert said["gap_after"] == pytest.approx(1.0, abs=0.15)
