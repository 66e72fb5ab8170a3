"""What measured parts tell: posterior, gauges, indices, departures; by simulation and by hand."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from tolevo.models.capability import Prior, knowledge_of
from tolevo.models.capability.knowledge import Difference, Gauge
from tolevo.models.capability.samples import capability, distribution_type, findings


def test_posterior_of_a_sample() -> None:
    values = np.array([1.0, 2.0, 4.0, 7.0, 11.0, 5.0])
    known = knowledge_of(values)
    assert (known.mean, known.std) == pytest.approx((5.0, np.std(values, ddof=1)))
    assert known.df == 5.0
    assert known.inflation == pytest.approx(5.0 / 3.0)
    limit = 5.0 / stats.chi2.ppf(0.05, 5.0)
    assert known.inflation + known.surplus_at() == pytest.approx(limit)


def test_a_prior_counts_as_so_many_parts() -> None:
    values = np.random.default_rng(3).normal(0.0, 2.0, 10)
    known = knowledge_of(values, Prior(3.0, 30.0))
    pooled = (30.0 * 9.0 + 9.0 * np.var(values, ddof=1)) / 39.0
    assert (known.std**2, known.df) == pytest.approx((pooled, 39.0))


@pytest.mark.parametrize("ratio", [0.1, 0.5])
@pytest.mark.parametrize("n", [20, 50])
def test_upper_limit_of_the_parts_own_variance_covers(ratio: float, n: int) -> None:
    """94.9 to 95.0 % of the note, by 4000 repeats (standard error 0.34 %)."""
    rng, df = np.random.default_rng(11), 40.0
    seen = (1.0 + ratio**2) * rng.chisquare(n - 1, 4000) / (n - 1)
    gauge = ratio**2 * rng.chisquare(df, 4000) / df
    pairs = zip(seen, gauge, strict=True)
    kept = [Difference(a, n - 1.0, b, df).upper_limit() >= 1.0 for a, b in pairs]
    assert np.mean(kept) == pytest.approx(0.95, abs=0.012)


def test_a_gauge_is_taken_off() -> None:
    values = np.random.default_rng(5).normal(0.0, 1.0, 40)
    plain, clean = knowledge_of(values), knowledge_of(values, gauge=Gauge(0.3, 40.0))
    assert clean.std**2 == pytest.approx(plain.std**2 - 0.09)
    assert clean.surplus_at() > plain.surplus_at()


@pytest.mark.parametrize(
    ("values", "gauge", "words"),
    [([1.0, 2.0, 3.0, 4.0], None, "has 4 values; at least 5"), ([2.0] * 9, None, "equal values"),
     ([1.0, 2.0, 3.0, 4.0, 5.0], Gauge(2.0), "the gauge is unfit")],
)  # fmt: skip
def test_samples_that_tell_nothing(values: list[float], gauge: Gauge | None, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        knowledge_of(np.array(values), gauge=gauge)


def test_indices_and_their_limits_cover() -> None:
    """Cp 1.33 and Cpk 1.0 of 2000 samples of 30: 95 % of the intervals hold the truth."""
    rng = np.random.default_rng(2)
    covered = {"Cp": 0, "Cpk": 0}
    truth = {"Cp": 4.0 / 3.0, "Cpk": 1.0}
    for _ in range(2000):
        found = capability(rng.normal(1.0, 1.0, 30), -4.0, 4.0)
        for name, one in found.items():
            covered[name] += one.low <= truth[name] <= one.high
    assert covered["Cp"] / 2000 == pytest.approx(0.95, abs=0.015)
    assert covered["Cpk"] / 2000 == pytest.approx(0.95, abs=0.03)
    assert set(capability(np.arange(9.0), None, 12.0)) == {"Cpk"}


def test_a_stable_process_is_left_in_peace() -> None:
    rng = np.random.default_rng(8)
    said = [bool(findings(rng.normal(size=30), {"lot": [str(at // 10) for at in range(30)]}))
            for _ in range(1000)]  # fmt: skip
    assert np.mean(said) <= 0.02


@pytest.mark.slow
def test_lots_without_names_are_found_by_what_follows_what() -> None:
    """Steps of lots, not a trend alone; and the ratio against its definition by explicit sums."""
    rng = np.random.default_rng(8)
    assert np.mean([bool(findings(rng.normal(size=30))) for _ in range(1000)]) <= 0.02
    values = rng.normal(size=40) + np.repeat([0.0, 3.0, -2.0, 2.0, -1.0], 8)
    found = next(one for one in findings(values) if one.kind == "lots")
    at = np.arange(40.0)
    line = np.cov(at, values, ddof=0)[0, 1] / np.var(at)
    rest = values - values.mean() - line * (at - at.mean())
    ratio = sum((b - a) ** 2 for a, b in pairwise(rest)) / sum(rest**2)
    assert f"steps of {ratio:.2g} variances" in found.text
    assert distribution_type([found]) == "C1"
    trend = rng.normal(size=60) + np.linspace(0.0, 6.0, 60)
    assert [one.kind for one in findings(trend)] == ["drift"]


@pytest.mark.parametrize(
    ("kind", "letter"), [("drift", "C3"), ("lots", "C1"), ("outlier", "A1"), ("shape", "A2"), ("scatter", "B")]
)
def test_departures_are_named(kind: str, letter: str) -> None:
    rng = np.random.default_rng(4)
    z, lots = rng.normal(size=60), [str(at % 3) for at in range(60)]
    group = np.arange(60) % 3
    values = {
        "drift": z + np.linspace(0.0, 4.0, 60),
        "lots": z + 2.0 * group,
        "outlier": np.append(z[:-1], 7.0),
        "shape": np.exp(1.2 * z),
        "scatter": z * np.array([0.3, 1.0, 3.0])[group],
    }[kind]
    found = findings(values, {"lot": lots})
    assert kind in [one.kind for one in found], found
    if kind != "scatter":
        assert distribution_type(found) == letter
